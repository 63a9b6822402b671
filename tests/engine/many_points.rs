//! One rigid tool with many contact points: the force is that of a flat punch, whatever the points' number and however redundant.

use cutis::scene::{Boundary, Pose, ProbeKind, Region, Scene, read};
use cutis::step::{Platform, Simulation};
use std::path::Path;

/// Relative error of a force between two solves: the passes stop at 1e-3 of the energy, that is well below of the sum.
const SAME: f64 = 2e-3;

fn punch() -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/hard/tools_many_points.toml");
    let mut scene = read(&path).unwrap_or_else(|e| panic!("{e}"));
    // the default; the scene asks for more, which friction does not reach
    scene.contact.as_mut().expect("it has a tool").tolerance = 1e-3;
    scene
}

fn with_points(count: usize, times: usize) -> Scene {
    let mut scene = punch();
    let points = &mut scene.tools[0].points;
    points.truncate(count);
    *points = points.repeat(times);
    scene.contact.as_mut().expect("it has a tool").max_contacts = (count * times) as u32;
    scene
}

/// Force on the tool at rest, and how many points touch; no warning.
fn pressed(scene: &Scene) -> ([f64; 3], usize) {
    let mut simulation = Simulation::new(scene, &Platform::Cpu64).expect("the scene fits");
    let mut last = ([0.0; 3], 0);
    for _ in 0..scene.time.steps() {
        let report = simulation.step(false).expect("the CPU path has no device to fail");
        assert!(report.warnings.is_empty(), "at {} s: {:?}", report.time, report.warnings);
        assert!(report.contact.forces.iter().flatten().all(|f| f.is_finite()));
        last = (report.contact.on_tool.first().copied().unwrap_or_default(), report.contact.count());
    }
    last
}

/// The flat punch itself: the top under it held where the tool holds it, N.
fn held_down() -> f64 {
    let mut scene = punch();
    let end = scene.tools[0].trajectory.last().expect("it has a hand").position[2];
    let top: f64 = scene.skins[0].layers.iter().map(|l| l.thickness).sum();
    let region = Region::Box { min: [-1e-3, -1e-3, top], max: [1e-3, 1e-3, top] };
    let displacement = [0.0, 0.0, end - top];
    scene.boundaries.push(Boundary { region, axes: [false, false, true], displacement, ..Boundary::default() });
    (scene.tools, scene.contact) = (vec![], None);
    assert!(matches!(scene.probes[0].kind, ProbeKind::Reaction { .. }));
    let mut simulation = Simulation::new(&scene, &Platform::Cpu64).expect("the scene fits");
    let mut reports = (0..3).map(|_| simulation.step(false).expect("the CPU path has no device to fail"));
    reports.nth(2).map_or(0.0, |r| r.probes[0].abs())
}

#[test]
fn more_points_press_harder_up_to_a_flat_punch() {
    let flat = held_down();
    let forces =
        [1, 2, 4, 8, 64].map(|count| pressed(&with_points(count, 1))).map(|(force, points)| (force[2], points));
    println!("{forces:?}, flat {flat} N");
    for pair in forces.windows(2) {
        assert!(pair[1].0 > pair[0].0 * (1.0 - SAME), "{forces:?}");
    }
    let (most, touching) = forces[4];
    assert!(touching == 64, "{touching}");
    assert!((most / flat - 1.0).abs() < 0.02, "{most} N, flat {flat} N");
    assert!(forces[0].0 < 0.5 * flat, "one point is no punch: {} N", forces[0].0);
}

#[test]
fn points_at_one_place_share_what_one_of_them_bears() {
    for (count, times) in [(1, 8), (2, 4), (8, 8)] {
        let [alone, together] = [1, times].map(|times| pressed(&with_points(count, times)).0[2]);
        assert!((together / alone - 1.0).abs() < SAME, "{count} points {alone} N, each {times} times {together} N");
    }
}

#[test]
fn friction_on_redundant_points_changes_little_and_drags_by_its_share() {
    let mut rough = punch();
    let friction = 0.3;
    rough.contact.as_mut().expect("it has a tool").friction = friction;
    // 192 rows on 75 axes, each of 64 points free to stick or slide
    let (still, flat) = (pressed(&rough).0, held_down());
    assert!((still[2] / flat - 1.0).abs() < 0.05, "rough {still:?} N, smooth and flat {flat} N");
    // sideways by a millimetre, farther than the skin follows: the points slide, each at its share of its normal force, and those in
    // front up the side of their dent, 0.1 mm over a cell of 0.5 mm
    let slope = 0.2;
    let pose = |time: f64, x: f64| Pose { time, position: [x, 0.0, 2.2e-3], ..rough.tools[0].trajectory[0] };
    let mut dragged = rough.clone();
    let down = dragged.tools[0].trajectory[0];
    dragged.tools[0].trajectory = vec![down, pose(0.2, 0.0), pose(0.4, 1e-3), pose(1.0, 1e-3)];
    dragged.time.duration = 0.4;
    let force = pressed(&dragged).0;
    let share = -force[0] / force[2];
    assert!(share > 0.5 * friction && share < friction + slope, "{share} of {force:?} N");
    assert!(-still[0] / still[2] < 0.01, "counter-test: not dragged, {still:?} N");
}

/// Forces on a point that rests at the mirror images of a place, mm, on skin of so many cells along each side, N.
fn at_mirror_images(cells: u32, friction: f64, [x, y]: [f64; 2]) -> [f64; 4] {
    [[x, y], [-x, y], [x, -y], [-x, -y]].map(|[x, y]| {
        let mut scene = punch();
        scene.skins[0].cells = [cells; 2];
        scene.solver.tolerance = 1e-5;
        let contact = scene.contact.as_mut().expect("it has a tool");
        (contact.friction, contact.tolerance) = (friction, 1e-5);
        scene.tools[0].points = vec![[x * 1e-3, y * 1e-3, 0.0]];
        pressed(&scene).0[2]
    })
}

/// Largest difference between forces, of the largest.
fn spread(forces: &[f64]) -> f64 {
    let most = forces.iter().fold(0.0, |m: f64, f| m.max(*f));
    1.0 - forces.iter().fold(most, |m, f| m.min(*f)) / most
}

#[test]
fn a_point_feels_the_same_at_mirror_images_of_a_place() {
    for cells in [7, 14, 28] {
        for friction in [0.0, 0.3] {
            let forces = at_mirror_images(cells, friction, [0.3, 0.2]);
            println!("{cells} cells, friction {friction}: {forces:?} N");
            assert!(forces[0] > 1e-3 && spread(&forces) < 0.01, "{cells} cells, friction {friction}: {forces:?} N");
        }
    }
    // the counter-test: two places that are no images of each other
    let [here, there] = [[0.3, 0.2], [0.4, 0.0]].map(|at| at_mirror_images(7, 0.0, at)[0]);
    assert!(spread(&[here, there]) > 0.01, "{here} N, {there} N");
}

/// 64 points reach 25 nodes at once, which are 75 columns: a pass solves those of two nodes at most, the others borrow. The forces are
/// those with all columns solved, within what the passes leave.
#[test]
fn a_pass_solves_one_batch_of_columns() {
    let touch = |depth: f64| {
        let mut scene = punch();
        scene.tools[0].trajectory[0].position[2] = depth;
        scene.time.duration = 2.0;
        let mut simulation = Simulation::new(&scene, &Platform::Cpu64).expect("the scene fits");
        let (mut first, mut most, mut force) = (None, 0, [0.0; 3]);
        for step in 0..scene.time.steps() {
            let contact = simulation.step(false).expect("the CPU path has no device to fail").contact;
            // the first step of a run solves all
            most = if step == 0 { most } else { most.max(contact.columns.saturating_sub(6 * contact.passes)) };
            if contact.count() > 0 && first.is_none() {
                first = Some((step, contact.count(), contact.columns));
            }
            force = contact.on_tool.first().copied().unwrap_or_default();
        }
        (first.expect("the punch touches"), most, force)
    };
    let (first, most, force) = touch(2.45e-3);
    assert!(first.0 > 0 && first.1 == 64, "the counter-test: all points touch in one later step, {first:?}");
    assert!(most <= 6, "{most} columns in the first pass of a step");
    let (at_once, _, reference) = touch(punch().tools[0].trajectory[0].position[2]);
    assert!(
        at_once.0 == 0 && at_once.2 >= 75,
        "with all points there from the start all columns are solved, {at_once:?}"
    );
    println!("{} N, {} N with all columns", force[2], reference[2]);
    assert!((force[2] / reference[2] - 1.0).abs() < 0.01, "{force:?} N, {reference:?} N with all columns");
}
