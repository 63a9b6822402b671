//! The matrix-free products against a matrix assembled here, with its own node numbers, corner order and rotations.

use super::Case;
use super::setup::{Random, block, measured, model};
use cutis::bodies::Model;
use cutis::bodies::grid::element::rounded_modes;
use cutis::kernels::Params;
use cutis::kernels::forces::forces;
use cutis::kernels::product::{Frames, LANES, cell_groups, elastic_forces, product};
use cutis::math::V4;
use cutis::scene::Element::{Bbar, Enhanced, Plain};
use cutis::scene::Mass::{self, Consistent, Lumped, Uniform};
use cutis::scene::Scene;
use glam::{DMat3, DQuat, DVec3};

pub const CASES: &[Case] = &[
    ("product_is_the_assembled_matrix", product_is_assembled),
    ("product_of_several_strips_is_the_sum_over_cells", product_of_strips),
    ("forces_in_strips_are_those_gathered_by_node", forces_in_strips),
    ("product_sees_a_wrong_entry", product_sees_a_wrong_entry),
    ("product_sees_a_dead_cell", product_sees_a_dead_cell),
];

/// VTK's hexahedron, written out.
const CORNERS: [[usize; 3]; 8] =
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]];

/// A square matrix by rows, with room for its right-hand side.
pub struct Dense {
    pub size: usize,
    pub rows: Vec<Vec<f64>>,
}

impl Dense {
    /// `(1 + h r_M)/h² M + (1 + r_K/h) Σ R K Rᵀ`, rows and columns of held axes cut out, in m and N; row `3 node + axis`.
    pub fn assemble(model: &Model, rotation: &[V4<f64>], held_diagonal: f64) -> Self {
        let [nx, ny, nz] = model.grid.cells.map(|c| c + 1);
        let size = 3 * nx * ny * nz;
        let mut rows = vec![vec![0.0; size]; size];
        let s = &model.step;
        let (scale, inertia) = (1.0 + s.rayleigh_stiffness / s.step, (1.0 + s.step * s.rayleigh_mass) / s.step.powi(2));
        let mut cell = 0;
        for z in 0..nz - 1 {
            for y in 0..ny - 1 {
                for x in 0..nx - 1 {
                    let q = rotation[cell];
                    cell += 1;
                    if q == [0.0; 4] {
                        continue;
                    }
                    let k = &model.hexahedra().stiffness[model.grid.layer_of[z] as usize];
                    let r = DMat3::from_quat(DQuat::from_array(q));
                    let ids = CORNERS.map(|o| x + o[0] + nx * (y + o[1] + ny * (z + o[2])));
                    for (a, i) in ids.into_iter().enumerate() {
                        for (b, j) in ids.into_iter().enumerate() {
                            let column = |n: usize| DVec3::from_array([0, 1, 2].map(|m| k[3 * a + m][3 * b + n]));
                            let turned = r * DMat3::from_cols(column(0), column(1), column(2)) * r.transpose();
                            for m in 0..3 {
                                for n in 0..3 {
                                    rows[3 * i + m][3 * j + n] += scale * turned.col(n)[m];
                                }
                            }
                        }
                    }
                }
            }
        }
        for (i, j, mass) in masses(model, rotation) {
            (0..3).for_each(|n| rows[3 * i + n][3 * j + n] += inertia * mass);
        }
        let held: Vec<bool> = (0..size).map(|k| model.dofs[k / 3][k % 3] == 0.0).collect();
        for i in 0..size {
            for j in 0..size {
                if held[i] || held[j] {
                    rows[i][j] = if i == j { held_diagonal } else { 0.0 };
                }
            }
        }
        Self { size, rows }
    }

    pub fn times(&self, x: &[V4<f64>]) -> Vec<f64> {
        let row = |r: &Vec<f64>| r.iter().enumerate().map(|(k, m)| m * x[k / 3][k % 3]).sum();
        self.rows.iter().map(row).collect()
    }

    /// Solves by Gaussian elimination; the matrix is positive definite, so no pivoting.
    pub fn solve(mut self, mut b: Vec<f64>) -> Vec<f64> {
        for k in 0..self.size {
            let pivot = self.rows[k].clone();
            for i in k + 1..self.size {
                let f = self.rows[i][k] / pivot[k];
                if f != 0.0 {
                    self.rows[i].iter_mut().zip(&pivot).skip(k).for_each(|(m, p)| *m -= f * p);
                    b[i] -= f * b[k];
                }
            }
        }
        for k in (0..self.size).rev() {
            let sum: f64 = (k + 1..self.size).map(|j| self.rows[k][j] * b[j]).sum();
            b[k] = (b[k] - sum) / self.rows[k][k];
        }
        b
    }
}

/// Entries (node, node, kg) of the mass matrix: node masses, or `∫ ρ N_a N_b dV` of the living cells by Gauss points.
fn masses(model: &Model, rotation: &[V4<f64>]) -> Vec<(usize, usize, f64)> {
    if model.mass != Mass::Consistent {
        return model.dofs.iter().enumerate().map(|(i, f)| (i, i, f[3])).collect();
    }
    let [cx, cy, _] = model.grid.cells;
    let mut out = vec![];
    for cell in (0..rotation.len()).filter(|c| rotation[*c] != [0.0; 4]) {
        let at = [cell % cx, cell / cx % cy, cell / (cx * cy)];
        let ids = CORNERS.map(|o| at[0] + o[0] + (cx + 1) * (at[1] + o[1] + (cy + 1) * (at[2] + o[2])));
        let mass = 8.0 * model.shape[model.grid.layer_of[at[2]] as usize][3];
        for point in CORNERS {
            // natural coordinates in 0…1
            let x = point.map(|o| 0.5 + (o as f64 - 0.5) / 3f64.sqrt());
            let value = CORNERS.map(|o| (0..3).map(|n| if o[n] == 1 { x[n] } else { 1.0 - x[n] }).product::<f64>());
            for (a, b) in (0..64).map(|k| (k / 8, k % 8)) {
                out.push((ids[a], ids[b], mass / 8.0 * value[a] * value[b]));
            }
        }
    }
    out
}

/// A small layered scene with damping and two held regions' worth of axes: 4×3×4 cells, sides of three lengths.
pub fn small(element: cutis::scene::Element) -> Scene {
    let mut scene = block(element, true);
    for (layer, young) in scene.skins[0].layers.iter_mut().zip([3.4e4, 2e5, 1e6]) {
        layer.young = young;
    }
    (scene.skins[0].rayleigh_mass, scene.skins[0].rayleigh_stiffness) = (0.3, 0.002);
    scene
}

/// Holds some axes here and there.
pub fn hold_some(model: &mut Model) {
    for (k, dofs) in model.dofs.iter_mut().enumerate() {
        dofs[k % 3] *= if k % 5 == 0 { 0.0 } else { 1.0 };
    }
}

/// [cell] rotations, two cells dead.
pub fn random_rotations(model: &Model, random: &mut Random) -> Vec<V4<f64>> {
    let dead = [1, model.grid.cell_count() / 2];
    (0..model.grid.cell_count()).map(|c| if dead.contains(&c) { [0.0; 4] } else { random.quaternion() }).collect()
}

/// The masses that dead cells leave.
pub fn without_dead(model: &Model, rotation: &[V4<f64>]) -> Model {
    let mut left = model.clone();
    let p = model.grid.params::<f64>();
    for cell in (0..rotation.len()).filter(|c| rotation[*c] == [0.0; 4] && model.mass != Uniform) {
        let corner_mass = model.shape[model.grid.layer_of[p.cell_at(cell)[2]] as usize][3];
        p.corners(cell).into_iter().for_each(|n| left.dofs[n][3] -= corner_mass);
    }
    left
}

/// `w = A z` by the twin; returns `z·w`.
pub fn multiply(params: &Params<f64>, model: &Model, rotation: &[V4<f64>], z: &[V4<f64>], w: &mut [V4<f64>]) -> f64 {
    let mut scratch = vec![[[[0.0; LANES]; 3]; 8]; cell_groups(params)];
    let frames = Frames::new(params, rotation, &[]);
    product(params, &model.modes(), &model.grid.layer_of, &frames, &model.dofs, z, w, &mut scratch)
}

/// Differences of twin and assembled matrix on a random vector: of `A z`, relative to its largest, and of `z·A z`, relative to itself.
fn product_error(model: &Model, assembled_from: &Model) -> [f64; 2] {
    const SEED: u64 = 11;
    let mut random = Random::new(SEED);
    let rotation = random_rotations(model, &mut random);
    let (model, assembled_from) = (&without_dead(model, &rotation), &without_dead(assembled_from, &rotation));
    let mut z = random.field(model.rest.len(), 1e-3);
    // CG only ever gives the product vectors that are zero on held axes
    for (z, dofs) in z.iter_mut().zip(&model.dofs) {
        (0..3).for_each(|n| z[n] *= dofs[n]);
    }
    let mut w = vec![[0.0; 4]; z.len()];
    let dot = multiply(&model.params(), model, &rotation, &z, &mut w);
    let exact = Dense::assemble(assembled_from, &rotation, 0.0).times(&z);
    let size = exact.iter().fold(0.0f64, |m, e| m.max(e.abs()));
    let off = |(k, e): (usize, &f64)| (w[k / 3][k % 3] - e).abs();
    let error = exact.iter().enumerate().map(off).fold(0.0, f64::max);
    let expected: f64 = exact.iter().enumerate().map(|(k, e)| z[k / 3][k % 3] * e).sum();
    [error / size, (dot / expected - 1.0).abs()]
}

/// Sums of 8 cells × 24 products.
const ROUNDINGS: f64 = 200.0 * f64::EPSILON;

fn product_is_assembled() {
    // rows of cells that fill no, one and several groups of lanes, and more rows than one thread's share
    for cells in [[1, 1], [3, 2], [4, 3], [5, 3], [9, 7]] {
        for (element, mass) in [(Plain, Lumped), (Bbar, Uniform), (Bbar, Consistent), (Enhanced, Lumped)] {
            let mut scene = small(element);
            (scene.skins[0].cells, scene.skins[0].mass) = (cells, mass);
            // inertia as large as stiffness, so that the mass counts
            scene.time.step = 1e-5;
            let mut model = model(&scene);
            hold_some(&mut model);
            let [error, dot] = product_error(&model, &model);
            measured(&format!("product {cells:?} {element:?} {mass:?} against assembled"), error, 0.0);
            assert!(error < ROUNDINGS && dot < ROUNDINGS, "{cells:?} {element:?} {mass:?}: {error:e} {dot:e}");
        }
    }
}

/// `A z` cell by cell with the whole element matrices, node numbers and corner order of this file.
fn cell_by_cell(model: &Model, rotation: &[V4<f64>], z: &[V4<f64>]) -> Vec<DVec3> {
    let [cx, cy, _] = model.grid.cells;
    let p = model.params::<f64>();
    let mut sum = vec![DVec3::ZERO; z.len()];
    for (cell, q) in rotation.iter().enumerate() {
        let at = [cell % cx, cell / cx % cy, cell / (cx * cy)];
        let ids = CORNERS.map(|o| at[0] + o[0] + (cx + 1) * (at[1] + o[1] + (cy + 1) * (at[2] + o[2])));
        let k = &model.hexahedra().stiffness[model.grid.layer_of[at[2]] as usize];
        let r = if *q == [0.0; 4] { DMat3::ZERO } else { DMat3::from_quat(DQuat::from_array(*q)) };
        let local = ids.map(|i| r.transpose() * DVec3::new(z[i][0], z[i][1], z[i][2]));
        for (a, i) in ids.into_iter().enumerate() {
            let force = [0, 1, 2].map(|m| (0..24).map(|c| k[3 * a + m][c] * local[c / 3][c % 3]).sum::<f64>());
            sum[i] += p.stiffness_factor * (r * DVec3::from_array(force));
        }
    }
    let whole = |(i, f): (usize, &DVec3)| {
        let ([x, y, z, mass], displacement) = (model.dofs[i], z[i]);
        DVec3::new(x, y, z) * (*f + p.inertia * mass * DVec3::new(displacement[0], displacement[1], displacement[2]))
    };
    sum.iter().enumerate().map(whole).collect()
}

/// More cells than one core's share, on every side of the grid's edges and of the strips'.
fn product_of_strips() {
    let mut scene = small(Bbar);
    scene.skins[0].cells = [13, 50];
    let mut model = model(&scene);
    hold_some(&mut model);
    let mut random = Random::new(3);
    let rotation = random_rotations(&model, &mut random);
    let z = random.field(model.rest.len(), 1e-3);
    let mut w = vec![[0.0; 4]; z.len()];
    multiply(&model.params(), &model, &rotation, &z, &mut w);
    let exact = cell_by_cell(&model, &rotation, &z);
    let size = exact.iter().fold(0.0f64, |m, e| m.max(e.abs().max_element()));
    let off = |(w, e): (&V4<f64>, &DVec3)| (DVec3::new(w[0], w[1], w[2]) - *e).abs().max_element();
    let error = w.iter().zip(&exact).map(off).fold(0.0, f64::max) / size;
    measured("product of strips against cells", error, 0.0);
    assert!(error < ROUNDINGS, "{error:e}");
}

/// The CPU's fast form against the kernel's twin, on a body that is turned, stretched, pre-strained, cut, and far away.
fn forces_in_strips() {
    let mut model = model(&small(Bbar));
    model.hexahedra_mut().pre_strain.iter_mut().zip(1..).for_each(|(e, k)| *e = [0.1, 0.2 * f64::from(k), -0.3, 0.0]);
    let params = model.params::<f64>();
    let mut random = Random::new(11);
    let mut rotation = random_rotations(&model, &mut random);
    rotation[5] = [0.0; 4];
    let mut u = random.field(model.rest.len(), 1e-4);
    u.iter_mut().for_each(|u| u[0] += 0.5);
    let (shape, layers) = (model.shapes(), &model.grid.layer_of);
    let zeros = vec![[0.0; 4]; u.len()];
    let (mut plain, mut fast) = (zeros.clone(), zeros);
    forces(&params, &shape, &model.pre_strains(), &model.stiffness_blocks(), layers, &[], &u, &rotation, &mut plain);
    let mut scratch = vec![[[[0.0; LANES]; 3]; 8]; cell_groups(&params)];
    let run = |rotation: &[V4<f64>], fast: &mut [V4<f64>], scratch: &mut [_]| {
        let modes = rounded_modes(&model.hexahedra().stiffness);
        let frames = Frames::new(&params, rotation, &[]);
        elastic_forces(&params, &shape, &model.pre_strains(), &modes, layers, &frames, &u, fast, scratch);
        let largest = plain.as_flattened().iter().fold(0.0f64, |m, c| m.max(c.abs()));
        let off = plain.as_flattened().iter().zip(fast.as_flattened());
        off.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / largest
    };
    // 24 terms of each of 8 cells; the shift of 0.5 m costs 5000 times the displacements' own rounding
    const BOUND: f64 = 200.0 * 5000.0 * f64::EPSILON;
    let error = run(&rotation, &mut fast, &mut scratch);
    measured("forces in strips against the twin", error, BOUND);
    assert!(error < BOUND, "{error:e}");
    // counter-test: one cell turned otherwise
    rotation[7] = rotation[6];
    assert!(run(&rotation, &mut fast, &mut scratch) > BOUND);
}

fn product_sees_a_wrong_entry() {
    let model = model(&small(Bbar));
    let mut wrong = model.clone();
    wrong.hexahedra_mut().stiffness[2][20][5] *= 1.0 + 1e-6;
    let [error, _] = product_error(&model, &wrong);
    assert!(error > 1e2 * ROUNDINGS, "{error:e}");
}

fn product_sees_a_dead_cell() {
    let model = model(&small(Bbar));
    let mut random = Random::new(5);
    let mut rotation = random_rotations(&model, &mut random);
    let z = random.field(model.rest.len(), 1e-3);
    let mut with = vec![[0.0; 4]; z.len()];
    let mut without = with.clone();
    multiply(&model.params(), &model, &rotation, &z, &mut with);
    rotation[0] = [0.0; 4];
    multiply(&model.params(), &model, &rotation, &z, &mut without);
    let changed = with.iter().zip(&without).filter(|(a, b)| a != b).count();
    assert_eq!(changed, 8, "the corners of the cell and no other node");
}
