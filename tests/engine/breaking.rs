//! Springs that break by over-stretch: which, when, what falls, and what is refused.

use crate::small::{block, held};
use cutis::scene::{Boundary, Element, Files, Integrator, Law, Preconditioner, Region, Scene, parse};
use cutis::step::{Platform, Simulation, StepReport};
use std::path::Path;

/// Cells along each axis; two of the lower layer, two of the upper.
const CELLS: u32 = 3;

/// A block of springs of 6 × 6 × 4 mm between its bottom and a top that is lifted at once, whose lower layer breaks at a strain.
fn lifted(by: f64, limit: f64) -> Scene {
    let mut scene = block([6e-3; 2], [CELLS; 2], &[(2, 2e-3, 1e5, 0.3, 1000.0), (2, 2e-3, 1e5, 0.3, 1000.0)]);
    let skin = &mut scene.skins[0];
    skin.law = Law::Springs { stiffness: Some(100.0), damping: 0.1 };
    skin.layers[0].break_strain = limit;
    skin.rayleigh_mass = 1.0;
    let top = Boundary { displacement: [0.0, 0.0, by], ..held(Region::Top, [true; 3]) };
    scene.boundaries = vec![held(Region::Bottom, [true; 3]), top];
    scene.time.gravity = [0.0; 3];
    scene.solver.preconditioner = Preconditioner::Column;
    scene
}

fn steps(simulation: &mut Simulation, count: usize) -> Vec<StepReport> {
    (0..count).map(|_| simulation.step(true).unwrap_or_else(|e| panic!("{e}"))).collect()
}

fn made(scene: &Scene, platform: &Platform) -> Simulation {
    Simulation::new(scene, platform).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn springs_break_in_their_layer_at_its_strain() {
    for platform in [Platform::Cpu64, Platform::Cpu32] {
        // 4 mm lifted by 0.3 mm are strained by 0.075
        let mut held = made(&lifted(0.3e-3, 0.1), &platform);
        assert!(steps(&mut held, 40).iter().all(|step| step.severed == 0));
        let mut broken = made(&lifted(0.3e-3, 0.05), &platform);
        let reports = steps(&mut broken, 40);
        let severed: u32 = reports.iter().map(|step| step.severed).sum();
        let totals = broken.totals();
        assert!(severed > 0 && severed as usize == totals.springs_removed, "{severed} {totals:?}");
        // springs within the layer alone: those of the upper one and of the plane between are all there
        let state = &broken.snapshots().unwrap_or_else(|e| panic!("{e}"))[0];
        let model = &broken.bodies[0].model;
        let springs = model.springs().expect("a network");
        let gone = springs.ends.iter().zip(&state.law).filter(|(_, law)| **law == [0.0; 4]);
        let highest = gone.map(|(ends, _)| ends.map(|n| model.rest[n as usize][2]).into_iter().fold(0.0, f64::max));
        assert!(highest.fold(0.0, f64::max) < 2.001e-3, "a spring of the upper layer has broken");
        // what is left bears less
        let energy = |simulation: &mut Simulation| {
            let snapshot = &simulation.snapshots().unwrap_or_else(|e| panic!("{e}"))[0];
            cutis::bodies::elastic_energy(&simulation.bodies[0].model, snapshot, &snapshot.rotation)
        };
        let [left, whole] = [energy(&mut broken), energy(&mut held)];
        assert!(left < 0.95 * whole, "{left} {whole}");
        assert!(reports.iter().all(|step| !step.warnings.contains_key("energy_grew")));
    }
}

#[test]
fn what_is_torn_off_falls() {
    let mut scene = lifted(0.0, 0.02);
    // the top is let go, and gravity a hundred times its own tears the block off its bottom
    scene.boundaries.truncate(1);
    scene.time.gravity = [0.0, 0.0, 4000.0];
    let mut simulation = made(&scene, &Platform::Cpu64);
    steps(&mut simulation, 30);
    let top = simulation.bodies[0].model.nodes_in(&Region::Top)[0] as usize;
    let up = simulation.snapshots().unwrap_or_else(|e| panic!("{e}"))[0].u[top][2];
    assert!(up > 6e-3 && simulation.totals().springs_removed > 0, "{up}");
    // the counter-test: one that does not break hangs on
    scene.skins[0].layers[0].break_strain = f64::INFINITY;
    let mut whole = made(&scene, &Platform::Cpu64);
    steps(&mut whole, 30);
    let held = whole.snapshots().unwrap_or_else(|e| panic!("{e}"))[0].u[top][2];
    assert!(held < 0.5 * up, "{held} {up}");
}

#[test]
fn a_torn_body_goes_on_from_its_state() {
    let scene = lifted(0.3e-3, 0.05);
    let (mut whole, mut first, mut rest) =
        (made(&scene, &Platform::Cpu64), made(&scene, &Platform::Cpu64), made(&scene, &Platform::Cpu64));
    steps(&mut whole, 20);
    let torn: u32 = steps(&mut first, 10).iter().map(|step| step.severed).sum();
    assert!(torn > 0);
    rest.restore(&first.state().expect("it has a state")).expect("the same scene");
    steps(&mut rest, 10);
    let bytes = |simulation: &mut Simulation| {
        postcard::to_allocvec(&simulation.state().expect("it has a state")).expect("it can be written")
    };
    assert_eq!(bytes(&mut whole), bytes(&mut rest));
}

#[test]
fn a_limit_without_springs_is_refused() {
    let mut scene = lifted(0.0, 0.1);
    assert!(scene.check().is_ok());
    scene.time.integrator = Integrator::Static;
    scene.skins[0].law = Law::Fem { element: Element::Bbar, corotational: true };
    let refused = scene.check().expect_err("cells do not break").to_string();
    assert!(refused.contains("break_strain"), "{refused}");
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let text = std::fs::read_to_string(scenes.join("skin_springs_tetra.toml")).expect("the scene is there");
    let read = |text: &str| parse(text, Path::new("a.toml"), &Files::Folder(scenes.clone())).map_err(|e| e.to_string());
    let limited = text.replace("break_strain = 0.3", "break_strain = 0.8");
    assert_eq!(read(&limited).map(|scene| scene.skins[0].layers[0].break_strain), Ok(0.8));
    let wrong = read(&limited.replace("0.8", "-1")).expect_err("below 0");
    assert!(wrong.contains("break_strain"), "{wrong}");
    let laws = limited.replace("law = \"springs\"", "law = \"corotational\"");
    let needless = read(&laws).expect_err("another law");
    assert!(!needless.is_empty());
}
