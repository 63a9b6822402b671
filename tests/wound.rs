//! What a run says of the wound that a blade leaves, on a small form of the incision scene on the CPU path.

use cutis::scene::{Cut, Pose, Scene};
use cutis::step::{Place, Simulation};
use std::path::Path;

/// The incision scene on 12 × 12 cells, its hand replaced: down to 1.8 mm from where the tip touches, within 0.1 s.
fn pressed(reserve_columns: u32) -> Scene {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut scene = cutis::scene::read(&root.join("scenes/incision.toml")).expect("the shipped scene is valid");
    scene.skins[0].cells = [12, 12];
    scene.skins[0].cut = Cut::Split { reserve_columns };
    let tool = &mut scene.tools[0];
    let tip = tool.blade.as_ref().expect("a scalpel has a blade").edge[0];
    let top = scene.skins[0].layers.iter().map(|l| l.thickness).sum::<f64>();
    let pose = |time: f64, down: f64| Pose {
        time,
        position: [-tip[0], 1e-4 - tip[1], top - down - tip[2]],
        rotation: [0.0, 0.0, 0.0, 1.0],
    };
    tool.trajectory = vec![pose(0.0, -1e-4), pose(0.1, 1.8e-3), pose(10.0, 1.8e-3)];
    scene
}

/// The end of 60 steps.
fn run(reserve_columns: u32) -> Simulation {
    let scene = pressed(reserve_columns);
    let mut simulation = Simulation::new(&scene, &Place::Cpu64).expect("the scene fits");
    for _ in 0..60 {
        let step = simulation.step(false).expect("the CPU path has no device to fail");
        assert!(!step.warnings.contains_key("non_finite_nodes"));
    }
    simulation
}

#[test]
fn a_cut_leaves_no_hole_in_the_surface() {
    let simulation = run(200);
    let surface = &simulation.bodies[0].wound.surface;
    assert!(simulation.totals().links > 0 && surface.all().iter().any(|quad| quad.wall));
    assert_eq!(surface.edges().open, 0);
}
