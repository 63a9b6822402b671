//! A block that is held at its bottom, drawn taut and pulled at by gravity, and random sweeps of a short edge through it.

use cutis::backend::{Needs, Snapshot};
use cutis::bodies::Model;
use cutis::math::random::Random;
use cutis::scene::{Files, parse};
use glam::DVec3;
use std::path::Path;

/// Cells of 1 mm.
const BLOCK: &str = r#"
title = "crumbs"
[time]
step_ms = 0.5
duration_s = 1.0
gravity_m_s2 = [0.3, 0, -1]
[solver]
preconditioner = "multigrid"
[skin]
size_mm = [8, 8]
cells = [8, 8]
rayleigh_mass_per_s = 0.01
rayleigh_stiffness_s = 0.01
layer = [
    { name = "soft", thickness_mm = 3, cells = 3, young_kpa = 40, poisson = 0.45, density_kg_m3 = 1000, pre_strain = [0.05, 0.05] },
    { name = "firm", thickness_mm = 2, cells = 2, young_kpa = 120, poisson = 0.45, density_kg_m3 = 1100, pre_strain = [0.05, 0.05] },
]
[[boundary]]
region = "bottom"
"#;
/// Iterations of a solve at most.
pub const CAP: u32 = 500;
/// Length of the edge and of its way, m.
const EDGE: f64 = 1.5e-3;

/// The block with room for copies in some columns.
pub fn block(reserve: usize) -> Model {
    let scene = parse(BLOCK, Path::new("crumbs.toml"), &Files::Embedded(&[])).unwrap_or_else(|e| panic!("{e}"));
    let mut model = Model::new(&scene, 0).unwrap_or_else(|e| panic!("{e}"));
    model.hexahedra_mut().extra_columns = reserve;
    model.dofs.resize(model.node_count(), [0.0; 4]);
    model
}

/// Arrays that the block needs.
pub fn needs() -> Needs {
    Needs { cutting: true, ..Needs::default() }
}

/// The block at rest.
pub fn at_rest(model: &Model) -> Snapshot {
    let zeros = vec![[0.0; 4]; model.node_count()];
    Snapshot { u: zeros.clone(), v: zeros, ..Snapshot::default() }
}

/// Numbers in −1…1, the same on every machine.
pub fn random(seed: u64) -> impl FnMut() -> f64 {
    let mut random = Random::new(seed);
    move || random.signed()
}

/// What a short edge sweeps somewhere in the block; `next` gives numbers from −1 to 1.
pub fn quad(model: &Model, next: &mut impl FnMut() -> f64) -> [[f64; 3]; 4] {
    let mut vector = || DVec3::from_array([0; 3].map(|_| next()));
    let size = DVec3::new(8e-3, 8e-3, model.grid.thickness());
    let at = DVec3::from_array(model.position) + DVec3::new(0.0, 0.0, 0.5 * size.z) + 0.5 * size * vector();
    let (edge, way) = (0.5 * EDGE * vector().normalize_or(DVec3::X), 0.5 * EDGE * vector().normalize_or(DVec3::Y));
    [at - edge - way, at + edge - way, at + edge + way, at - edge + way].map(|p| p.to_array())
}
