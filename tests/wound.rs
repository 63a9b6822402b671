//! What a run says of the wound that a blade leaves, on a small form of the incision scene on the CPU path.

use cutis::scene::{Cut, Pose, Scene};
use cutis::step::{Place, Simulation};
use glam::DVec3;
use std::path::Path;

/// The incision scene on 12 × 12 cells.
fn incision(reserve_columns: u32) -> Scene {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut scene = cutis::scene::read(&root.join("scenes/incision.toml")).expect("the shipped scene is valid");
    scene.skins[0].cells = [12, 12];
    scene.skins[0].cut = Cut::Split { reserve_columns };
    scene
}

/// Its hand replaced: down to 1.8 mm from where the tip touches, within 0.1 s.
fn pressed(reserve_columns: u32) -> Scene {
    let mut scene = incision(reserve_columns);
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

/// The whole slice: where the blade was after each step, m, how many links were said to hold for want of copies, and how it ended.
fn sliced(reserve_columns: u32) -> (Vec<DVec3>, usize, Simulation) {
    let scene = incision(reserve_columns);
    let steps = (scene.time.duration / scene.time.step).round() as usize;
    let mut simulation = Simulation::new(&scene, &Place::Cpu64).expect("the scene fits");
    let (mut path, mut held) = (vec![], 0);
    for _ in 0..steps {
        let step = simulation.step(false).expect("the CPU path has no device to fail");
        let other: Vec<_> = step.warnings.keys().filter(|name| **name != "cut_reserve_exhausted").collect();
        assert!(other.is_empty(), "{reserve_columns} columns at {} s: {other:?}", step.time);
        held += step.warnings.get("cut_reserve_exhausted").copied().unwrap_or_default() as usize;
        path.push(simulation.tools[0].position);
    }
    (path, held, simulation)
}

#[test]
fn a_blade_goes_on_where_the_reserve_is_used_up() {
    let (free, none, whole) = sliced(200);
    let (path, held, mut simulation) = sliced(3);
    let (all, totals) = (whole.totals(), simulation.totals());
    let apart = path.iter().zip(&free).map(|(a, b)| (*a - *b).length()).fold(0.0, f64::max);
    let way = path.iter().map(|p| (p.x - path[0].x).abs()).fold(0.0, f64::max);
    println!("{totals:?}, {held} held, of {all:?}; the blade goes {way} m, {apart} m beside the other");
    assert!(none == 0 && all.refused == 0 && all.links > 0);
    assert!(held == totals.refused && held > 0 && totals.links > 0 && totals.links < all.links);
    let body = &mut simulation.bodies[0];
    assert_eq!(body.wound.surface.parts.parents().len(), 3, "the reserve is used up");
    // both follow the hand, whose spring gives by a tenth of a millimetre
    assert!(way > 9e-3 && apart < 3e-4, "{way} m, {apart} m beside the other");
    let surface = &body.wound.surface;
    assert_eq!((surface.edges().open, surface.parts.pieces(&surface.alive)), (0, 1));
    let mass = |free: &[[f64; 4]]| free.iter().map(|f| f[3]).sum::<f64>();
    let state = body.snapshot().expect("the CPU path has no device to fail");
    assert!((mass(&state.free) / mass(&body.model.free) - 1.0).abs() < 1e-12);
    assert!(state.u.as_flattened().iter().chain(state.v.as_flattened()).all(|c| c.is_finite()));
}
