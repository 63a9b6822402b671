//! A corner of a block that is cut off and falls.

use crate::ragged::of_cells;
use crate::small::held;
use cutis::kernels::cut::Hit;
use cutis::scene::{Cut, Element, Preconditioner, Region, Scene};
use cutis::step::{Platform, Simulation};
use glam::DVec3;

/// s
const STEP: f64 = 5e-3;
/// m/s²
pub const GRAVITY: f64 = 9.81;

/// A block at rest that is held at its bottom under gravity upwards, and the nodes of its upper corner beyond a point, which is cut off.
pub fn parted(scene: Scene, platform: &Platform, corner: [f64; 3]) -> (Simulation, Vec<usize>) {
    parted_under(GRAVITY, scene, platform, corner)
}

/// The same under another acceleration along z.
pub fn parted_under(gravity: f64, mut scene: Scene, platform: &Platform, corner: [f64; 3]) -> (Simulation, Vec<usize>) {
    scene.boundaries = vec![held(Region::Bottom, [true; 3])];
    (scene.time.gravity, scene.time.step) = ([0.0, 0.0, gravity], STEP);
    (scene.skins[0].rayleigh_mass, scene.skins[0].rayleigh_stiffness) = (0.1, 0.01);
    let mut simulation = Simulation::new(&scene, platform).unwrap_or_else(|e| panic!("{e}"));
    for _ in 0..40 {
        simulation.step(false).unwrap_or_else(|e| panic!("{e}"));
    }
    let body = &mut simulation.bodies[0];
    let of = body.model.unstructured().expect("a mesh");
    let centre = |e: usize| of.mesh.corners(e).map(DVec3::from_array).iter().sum::<DVec3>() * 0.25;
    let inside = |e: usize| centre(e).cmpgt(DVec3::from_array(corner)).all();
    let crosses = |link: &usize| {
        let [a, b] = of.links.ends(*link).map(inside);
        a != b
    };
    let links = (0..of.links.sides.len()).filter(crosses);
    let hits: Vec<Hit<f64>> = links.map(|link| Hit { segment: link as u32, at: 0.5 }).collect();
    let own: Vec<usize> = (0..of.mesh.tetrahedra().len()).filter(|e| inside(*e)).collect();
    body.sever(&hits).unwrap_or_else(|e| panic!("{e}"));
    let surface = &body.wound.surface;
    assert_eq!(surface.pieces(), 2);
    let mut nodes: Vec<usize> =
        own.iter().flat_map(|e| surface.corners_of_tetrahedra()[*e]).map(|node| node as usize).collect();
    nodes.sort_unstable();
    nodes.dedup();
    let loose = &body.wound.loose;
    assert_eq!(loose.len(), 1);
    assert!(loose[0].nodes.iter().map(|node| *node as usize).eq(nodes.iter().copied()));
    (simulation, nodes)
}

/// Mean height of nodes above where they are at rest, m.
pub fn height(simulation: &mut Simulation, nodes: &[usize]) -> f64 {
    let u = simulation.snapshots().unwrap_or_else(|e| panic!("{e}")).remove(0).u;
    nodes.iter().map(|node| u[*node][2]).sum::<f64>() / nodes.len() as f64
}

/// Upper corners of a block of 12 × 4 × 4 mm: 15 of its 1152 tetrahedra, and 214.
pub const CORNERS: [[f64; 3]; 2] = [[4.5e-3, 0.6e-3, 2.6e-3], [2.5e-3, -2e-3, 1.6e-3]];

/// The block, solved to a tolerance.
pub fn block(preconditioner: Preconditioner, tolerance: f64) -> Scene {
    let mut scene = of_cells([12, 4, 4], Element::Tetra, Cut::Split { reserve_columns: 4000 });
    (scene.solver.preconditioner, scene.solver.tolerance) = (preconditioner, tolerance);
    scene
}

/// Motion of a corner over its free fall after 28 steps; iterations per step.
pub fn fall(scene: Scene, platform: &Platform, corner: [f64; 3]) -> (f64, f64) {
    const STEPS: u32 = 28;
    let (mut simulation, nodes) = parted(scene, platform, corner);
    let before = height(&mut simulation, &nodes);
    let mut iterations = 0;
    for _ in 0..STEPS {
        iterations += simulation.step(false).unwrap_or_else(|e| panic!("{e}")).costs.iterations;
    }
    let wanted = GRAVITY * STEP * STEP * f64::from(STEPS * (STEPS + 1)) / 2.0;
    ((height(&mut simulation, &nodes) - before) / wanted, f64::from(iterations) / f64::from(STEPS))
}
