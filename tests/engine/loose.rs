//! Pieces that cuts have set free fall as they should, however small.

use crate::falls::{CORNERS, GRAVITY, block, fall, parted, parted_under};
use cutis::scene::{Attachment, BodyId, Contact, Element, Law, Material, Plane, Preconditioner, Region};
use cutis::step::Platform;
use glam::DVec3;

/// The damping of 0.1/s slows the fall by 0.5 %.
#[test]
fn a_piece_falls_freely_however_small_its_weight_is_beside_the_tolerance() {
    let mut all = vec![];
    for corner in CORNERS {
        for preconditioner in [Preconditioner::Block, Preconditioner::Multigrid] {
            for tolerance in [1e-1, 1e-3] {
                let (share, iterations) = fall(block(preconditioner, tolerance), &Platform::Cpu64, corner);
                all.push(format!("{corner:?} {preconditioner:?} {tolerance:e}: {share} {iterations}"));
                assert!((share - 0.9975).abs() < 0.004, "{}", all.join("\n"));
            }
        }
    }
    println!("{}", all.join("\n"));
    // the counter-test: the solve leaves more than such a piece weighs
    let (mut simulation, nodes) = parted(block(Preconditioner::Block, 1e-1), &Platform::Cpu64, CORNERS[0]);
    let left = simulation.step(false).unwrap_or_else(|e| panic!("{e}")).free.target;
    let weight = |node: &usize| (simulation.bodies[0].wound.dofs[*node][3] * GRAVITY).powi(2);
    let weights = nodes.iter().map(weight).sum::<f64>().sqrt();
    assert!(weights < left, "{weights} N, {left} N");
}

#[test]
fn a_piece_falls_in_single_precision_and_under_a_nonlinear_law() {
    let (share, _) = fall(block(Preconditioner::Block, 1e-2), &Platform::Cpu32, CORNERS[0]);
    assert!((share - 0.9975).abs() < 0.004, "{share}");
    let mut scene = block(Preconditioner::Block, 1e-2);
    scene.skins[0].law = Law::LargeTetra { material: Material::NeoHookean, element: Element::Tetra };
    let (share, _) = fall(scene, &Platform::Cpu64, CORNERS[0]);
    assert!((share - 0.9975).abs() < 0.004, "{share}");
}

/// A piece comes to rest on a wall, which bears its weight: the solves of contact see it too.
#[test]
fn a_small_piece_rests_on_a_wall() {
    let mut scene = block(Preconditioner::Block, 1e-1);
    scene.planes = vec![Plane { name: "wall".into(), through: [0.0, 0.0, 5e-3], normal: [0.0, 0.0, -1.0] }];
    scene.tools[0].trajectory[0].position[2] = -0.5;
    scene.contact = Some(Contact { friction: 0.3, alarm: 0.5e-3, ..Contact::default() });
    let (mut simulation, nodes) = parted(scene, &Platform::Cpu64, CORNERS[0]);
    let mass: f64 = nodes.iter().map(|node| simulation.bodies[0].wound.dofs[*node][3]).sum();
    let (mut forces, mut passes) = (vec![], 0);
    for _ in 0..24 {
        let report = simulation.step(false).unwrap_or_else(|e| panic!("{e}"));
        forces.push(report.contact.force(BodyId::Plane(0), Some(BodyId::Deformable(0))).z / (mass * GRAVITY));
        passes += report.contact.passes;
    }
    let state = simulation.snapshots().unwrap_or_else(|e| panic!("{e}")).remove(0);
    let speed = nodes.iter().map(|n| DVec3::from_slice(&state.v[*n]).length()).fold(0.0, f64::max);
    let top = nodes.iter().map(|n| simulation.bodies[0].wound.rest[*n][2] + state.u[*n][2]).fold(0.0, f64::max);
    assert!(forces[8..].iter().all(|force| (force - 1.0).abs() < 0.02), "{forces:?}");
    assert!(speed < 2e-3 && (top - 5e-3).abs() < 1e-5, "{speed} m/s, {top} m");
    // columns as loose as those of what is held take 11 passes a step
    assert!(passes < 24 * 5, "{passes} passes");
}

/// A piece that stays on the bed that it is cut from is borne by it: its nodes move as the piece does and not as those of the bed beside them,
/// whose compliance is a thousandth.
#[test]
fn a_small_piece_rests_on_the_bed_it_is_cut_from() {
    let mut scene = block(Preconditioner::Multigrid, 1e-3);
    scene.tools[0].trajectory[0].position[2] = 0.5;
    scene.contact = Some(Contact { lips: true, alarm: 0.2e-3, ..Contact::default() });
    let (mut simulation, nodes) = parted_under(-GRAVITY, scene, &Platform::Cpu64, CORNERS[0]);
    let before = simulation.snapshots().unwrap_or_else(|e| panic!("{e}")).remove(0).u;
    let mut passes = 0;
    for step in 0..20 {
        let report = simulation.step(false).unwrap_or_else(|e| panic!("{e}"));
        assert!(report.warnings.is_empty(), "step {step}: {:?}", report.warnings);
        passes += report.contact.passes;
    }
    let state = simulation.snapshots().unwrap_or_else(|e| panic!("{e}")).remove(0);
    let moved = |n: &usize| DVec3::from_slice(&state.u[*n]).distance(DVec3::from_slice(&before[*n]));
    let moved = nodes.iter().map(moved).fold(0.0, f64::max);
    println!("{moved} m, {passes} passes");
    // lips have no friction, so it slides as far as its jagged bed lets it; in free fall by 49 mm
    assert!(moved < 5e-4 && passes < 20 * 3, "{moved} m, {passes} passes");
}

/// A piece that is tied to its place hangs there: the tie bears its weight, and nothing throws it.
#[test]
fn a_small_piece_hangs_by_an_attachment() {
    for tolerance in [1e-1, 1e-3] {
        let mut scene = block(Preconditioner::Multigrid, tolerance);
        // the upper part of its end face
        let region = Region::Box { min: [5.9e-3, -1.1e-3, 2.9e-3], max: [6.1e-3, 2.1e-3, 4.1e-3] };
        scene.attachments = vec![Attachment { body: 0, region, to: BodyId::World, slide: None }];
        scene.contact = Some(Contact::default());
        let (mut simulation, nodes) = parted(scene, &Platform::Cpu64, CORNERS[1]);
        let weight: f64 = nodes.iter().map(|n| simulation.bodies[0].wound.dofs[*n][3]).sum::<f64>() * GRAVITY;
        let mut borne = 0.0;
        for _ in 0..40 {
            let report = simulation.step(false).unwrap_or_else(|e| panic!("{e}"));
            borne = report.contact.force(BodyId::World, Some(BodyId::Deformable(0))).z;
        }
        let state = simulation.snapshots().unwrap_or_else(|e| panic!("{e}")).remove(0);
        let speed = nodes.iter().map(|n| DVec3::from_slice(&state.v[*n]).length()).fold(0.0, f64::max);
        println!("{tolerance:e}: {} of the weight, {speed} m/s", borne / weight);
        assert!((borne / weight - 1.0).abs() < 0.02 && speed < 2e-3, "{borne} of {weight} N, {speed} m/s");
    }
}
