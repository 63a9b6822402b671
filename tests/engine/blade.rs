//! The blade in skin: a flat touches the wall beside it, and no path throws the blade, whatever it crosses.
//!
//! `cargo bench --bench blade` judges as many paths as wanted by the same bounds.

mod paths;
mod thrown;

use cutis::bodies::rigid::Instrument;
use cutis::collide::sides::Last;
use cutis::collide::{Contact, Patch, Resistance, Search, contacts};
use cutis::constraints::Law;
use cutis::mesh::Face;
use cutis::report::Report;
use cutis::scene::Filter;
use cutis::step::Platform;
use glam::DVec3;
use paths::{Case, Kind};

/// Walls across y, each a quad of 10 mm: at these positions, m, and turned towards −y or +y.
fn walls(at: &[(f64, f64)]) -> (Vec<Face>, Vec<DVec3>) {
    let mut quads = vec![];
    let mut positions = vec![];
    for (wall, (y, normal)) in (0u32..).zip(at) {
        let ends = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
        positions.extend(ends.map(|[x, z]| DVec3::new(5e-3 * x * -normal, *y, 5e-3 * z)));
        quads.push(Face { nodes: [0, 1, 2, 3].map(|n| 4 * wall + n), cell: wall, wall: true });
    }
    (quads, positions)
}

/// Contacts of a blade's flats at the origin, in a step in which it goes on so far, m, with walls of cells of a size, m, and where on
/// the walls they are.
fn flats(at: &[(f64, f64)], travel: f64, cell: f64) -> Vec<(Contact, DVec3)> {
    let mut scene = Case::new(Kind::Straight, 0).scene;
    scene.tools[0].trajectory[0].position = [10e-3, 0.0, 12e-3]; // the middle of its edge at the origin
    scene.tools[0].trajectory[0].rotation = [0.0, 0.0, 0.0, 1.0];
    let mut tool = Instrument::new(&scene.tools[0], [0.0; 3]);
    tool.samples.retain(|sample| matches!(sample.role, cutis::bodies::rigid::Role::Flat(_)));
    let (quads, positions) = walls(at);
    let patch = Patch::new(&quads, |node| positions[node as usize]).expect("there are walls");
    let search = Search { alarm: 2e-4, distance: 0.0, friction: 0.3, filter: Filter::Points, angle_cone: 0.0 };
    let found = contacts(
        (0, &tool),
        (0, &patch),
        &search,
        travel,
        |_| Resistance { edge: 0.0, splitting: SPLITTING, cell },
        |_| None,
        &Last::none(),
    )
    .0;
    let position =
        |contact: &Contact| contact.points[1].0.iter().map(|(node, weight)| positions[*node as usize] * *weight).sum();
    found.into_iter().map(|contact| (contact.clone(), position(&contact))).collect()
}

/// Half of the blade's thickness half a millimetre behind its edge, where the flats' samples are: a quarter of that, m.
const HALF: f64 = 1.25e-4;

/// What splits the tissue, N/m^1.5.
const SPLITTING: f64 = 1e3;

/// So far that the bevel opens a cut by all of the blade's thickness, m.
const FAR: f64 = 1e-3;

#[test]
fn a_flat_touches_the_wall_beside_it() {
    // walls far away come first in the list: they are no flat's business
    let found = flats(&[(4e-3, -1.0), (-4e-3, 1.0), (3e-4, -1.0), (-1e-4, 1.0)], FAR, 0.0);
    assert_eq!(found.len(), 10, "two sides of five samples");
    for (contact, position) in found {
        let wall = if contact.axes[0].y < 0.0 { 3e-4 } else { -1e-4 };
        assert!((position.y - wall).abs() < 1e-12, "on a wall at {} instead of {wall}", position.y);
        assert!((contact.gap[0] - (wall.abs() - HALF)).abs() < 1e-12, "a gap of {}", contact.gap[0]);
        // a millimetre of flat, half a millimetre behind the edge
        let bears = SPLITTING * 5e-4f64.sqrt() * 1e-3;
        let bound = match contact.law {
            Law::Coulomb { bound, .. } => bound,
            law => panic!("{law:?}"),
        };
        assert!((bound / bears - 1.0).abs() < 1e-9, "bears {bound} N instead of {bears} N");
        assert!((position - contact.point).cross(DVec3::Y).length() < 1e-12, "the contact is not beside its sample");
    }
}

#[test]
fn a_flat_touches_nothing_through_tissue_or_out_of_reach() {
    assert!(flats(&[(1e-3, -1.0), (-1e-3, 1.0)], 0.0, 0.0).is_empty(), "out of reach");
    // seen from inside: a surface that turns its back, and the far side of the tissue behind it
    assert!(flats(&[(1e-4, 1.0), (3e-4, -1.0)], FAR, 0.0).is_empty());
}

#[test]
fn a_wall_in_the_blade_is_pushed_as_the_bevel_opens_it() {
    let cases = [
        (0.0, 5e-5, 0.0, 0.0),
        (2e-4, 5e-5, 0.0, -5e-5),
        (FAR, 5e-5, 0.0, -7.5e-5),
        (FAR, 1e-6, 0.0, -1.24e-4),
        // nearer to the front than a cell the blade is that much thinner, and has no thickness within the first cell
        (FAR, 1e-6, 3e-4, -4.9e-5),
        (FAR, 1e-6, 8e-4, 1e-6),
    ];
    for (travel, y, cell, gap) in cases {
        let found = flats(&[(y, -1.0), (-y, 1.0)], travel, cell);
        assert_eq!(found.len(), 10);
        for (contact, _) in found {
            assert!((contact.gap[0] - gap).abs() < 1e-12, "{} instead of {gap}", contact.gap[0]);
        }
    }
}

/// How far a point is from the skin beside a wound whose lip bends inward at its middle corner, m: a face on top with a reflex corner,
/// listed from any of its corners on, and two walls below it.
fn from_a_bent_lip(first: usize, point: DVec3) -> f64 {
    let top = [[0.0, 0.0], [1.0, 0.01], [2.0, 0.0], [1.0, 2.0]].map(|[x, y]| DVec3::new(x, y, 0.0));
    let positions: Vec<DVec3> = top.into_iter().chain(top.map(|p| p - DVec3::Z)).map(|p| p * 1e-3).collect();
    let quad = |nodes, wall| Face { nodes, cell: 0, wall };
    let mut face = [0, 1, 2, 3];
    face.rotate_left(first);
    let quads = [quad(face, false), quad([4, 5, 1, 0], true), quad([5, 6, 2, 1], true)];
    Patch::new(&quads, |node| positions[node as usize]).expect("it has faces").project(point * 1e-3).2
}

#[test]
fn the_air_over_a_bent_lip_is_outside() {
    for first in 0..4 {
        for x in [0.3, 1.0, 1.7] {
            let over = from_a_bent_lip(first, DVec3::new(x, -0.002, 0.4));
            assert!((over / 4e-4 - 1.0).abs() < 1e-3, "{over} m from corner {first} on at {x}");
            let under = from_a_bent_lip(first, DVec3::new(x, 0.05, -0.01));
            assert!((under / -1e-5 - 1.0).abs() < 1e-3, "{under} m from corner {first} on at {x}");
        }
    }
}

/// Runs paths and judges each; the reports.
fn judged(kind: Kind, numbers: &[u64]) -> Vec<Report> {
    let out = std::env::temp_dir().join(format!("cutis_blade_{kind:?}_{}", std::process::id()));
    let judge = |number: &u64| {
        let case = Case::new(kind, *number);
        let report = case.run(Platform::Cpu64, &out).unwrap_or_else(|e| panic!("{}: {e}", case.name));
        let faults = case.faults(&report);
        assert!(faults.is_empty(), "{}: {faults:?}", case.name);
        report
    };
    let reports = numbers.iter().map(judge).collect();
    drop(std::fs::remove_dir_all(&out));
    reports
}

#[test]
fn straight_cuts_do_not_throw_the_blade() {
    judged(Kind::Straight, &[2, 15, 18]);
}

#[test]
fn cuts_right_through_part_the_body() {
    judged(Kind::Through, &[8, 114, 123]);
}

#[test]
fn random_paths_do_not_throw_the_blade() {
    judged(Kind::Any, &[2, 5]);
}

#[test]
fn two_blades_whose_cuts_cross_are_not_thrown() {
    judged(Kind::Crossing, &[13]);
}

#[test]
fn a_blade_along_one_line_20_times_cuts_it_once() {
    judged(Kind::Again, &[6]);
}

#[test]
fn a_piece_cut_free_all_round_falls() {
    let report = judged(Kind::Piece, &[9]).remove(0);
    assert_eq!(report.cut.pieces, Some(2), "{} links", report.cut.links_severed);
}

#[test]
fn a_blade_that_is_thrown_is_noticed() {
    let case = Case::new(Kind::Straight, 2);
    let mut report = Report::default();
    report.cut.links_severed = case.links_on_the_path(0.0);
    assert!(case.faults(&report).is_empty(), "{:?}", case.faults(&report));
    let thrown = |change: &dyn Fn(&mut Report)| {
        let mut report = report.clone();
        change(&mut report);
        assert_eq!(case.faults(&report).len(), 1, "{:?}", case.faults(&report));
    };
    thrown(&|r| r.contact_force_n_max = 53.0);
    thrown(&|r| r.haptic.force_jump_n_max = 28.0);
    thrown(&|r| r.contact.depth_mm_max = 12.5);
    thrown(&|r| r.cut.links_severed += 70);
    thrown(&|r| *r.warnings.entry("step_retried".into()).or_default() += 1);
}

#[test]
fn wild_paths_that_sever_far_too_much_or_nothing_are_noticed() {
    let case = Case::new(Kind::Any, 2);
    let mut report = Report::default();
    let path = case.links_on_the_path(0.0);
    for (severed, count) in [(path, 0), (2 * path, 1), (0, 1)] {
        report.cut.links_severed = severed;
        assert_eq!(case.faults(&report).len(), count, "{severed} of {path}: {:?}", case.faults(&report));
    }
}

#[test]
fn a_piece_that_parts_and_does_not_fall_is_noticed() {
    let case = Case::new(Kind::Piece, 9);
    let mut report = Report::default();
    let probe = case.scene.probes[0].name.clone();
    for (pieces, risen, count) in [(1, 0.0, 0), (2, -1e-2, 0), (2, -1e-3, 1), (2, f64::NAN, 1)] {
        report.cut.pieces = Some(pieces);
        report.probes.insert(probe.clone(), risen);
        assert_eq!(case.faults(&report).len(), count, "{pieces} pieces, {risen} m: {:?}", case.faults(&report));
    }
}
