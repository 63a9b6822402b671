//! Tetrahedra in a grid's cells: locking, patch test, forces against energies, rotation.

use super::Case;
use super::setup::{block, displaced, measured, model, scene, times};
use super::skin_block::{Grid, POINTS, on_grid, static_answer};
use cutis::bodies::tetrahedra::operator::Arrays;
use cutis::bodies::{Kind, Model, Wound};
use cutis::kernels::blocks::symmetric;
use cutis::math::rotation_matrix;
use cutis::math::{M3, V3, V4};
use cutis::scene::Element::{self, PlainTetra, Tetra};
use cutis::scene::Preconditioner;
use cutis::step::Platform;

pub const CASES: &[Case] = &[
    ("tetrahedra_have_their_own_errors_on_the_skin_block", own_errors),
    ("tetrahedra_have_no_inner_force_under_constant_strain", constant_strain),
    ("forces_of_tetrahedra_are_the_slope_of_their_energy", slopes),
    ("products_of_tetrahedra_are_the_change_of_linear_forces", products),
    ("blocks_of_tetrahedra_are_those_of_the_product", blocks),
    ("rotated_tetrahedra_have_rotated_forces", rotated),
    ("stress_of_tetrahedra_is_that_of_their_material", of_material),
    ("stress_of_tetrahedra_balances_their_forces", balanced),
];

/// Error of the centre displacement at ν 0.45, 0.49, 0.499, %, computed outside this project.
const ERRORS: [(Element, [f64; 3]); 2] = [(PlainTetra, [-25.8, -54.4, -87.7]), (Tetra, [9.0, 6.6, -2.5])];
/// Half of the last digit, the digit of the references, and gravity, which the tabulated errors leave out.
const DIGITS: f64 = 0.3;

fn own_errors() {
    for (element, errors) in ERRORS {
        for ((file, wanted), reference) in [
            ("verify/skin_block_045.toml", -0.1910e-3),
            ("verify/skin_block_049.toml", -0.1482e-3),
            ("verify/skin_block_0499.toml", -0.1362e-3),
        ]
        .iter()
        .map(|(file, reference)| (file, reference))
        .zip(errors)
        .map(|((file, reference), wanted)| ((file, wanted), *reference))
        {
            let mut scene = on_grid(scene(file), Grid::Coarse, element);
            scene.solver.preconditioner = Preconditioner::Block;
            scene.solver.max_iterations = 20_000;
            let (model, u) = static_answer(&Platform::Cpu64, &scene, 1e-6);
            let error = 100.0 * (u[model.grid.nearest(POINTS[0])][2] / reference - 1.0);
            measured(&format!("{file} {element:?} error / %"), error, wanted);
            assert!((error - wanted).abs() < DIGITS, "{file} {element:?}: {error:.2} %, wanted {wanted}");
        }
    }
}

fn body(element: Element, corotational: bool) -> Model {
    let mut scene = block(element, corotational);
    scene.solver.preconditioner = Preconditioner::Block;
    model(&scene)
}

fn arrays(model: &Model) -> &Arrays<f64> {
    let Kind::Tetrahedra(tetrahedra) = &model.kind else { panic!("tetrahedra") };
    &tetrahedra.arrays
}

fn forces(a: &Arrays<f64>, u: &[V4<f64>], corotational: bool) -> Vec<V4<f64>> {
    let rotations = a.rotations(u, corotational);
    let mut f = vec![[0.0; 4]; u.len()];
    a.forces(u, &rotations, &mut f, &mut a.scratch());
    f
}

/// Displacements of 1 % of the size that repeat nowhere.
fn wavy(model: &Model) -> Vec<V4<f64>> {
    let size = model.extent();
    let wave = |x: f64, y: f64| 0.01 * size * (3.0 * x / size + 1.7 * y / size).sin();
    displaced(model, |[x, y, z]| [wave(x, y), wave(y + z, x), wave(z, x - y)]).u
}

fn scale(f: &[V4<f64>]) -> f64 {
    f.iter().flatten().fold(0.0, |m: f64, c| m.max(c.abs()))
}

const G: [[f64; 3]; 3] = [[0.01, 0.003, 0.0], [-0.002, 0.02, 0.004], [0.001, 0.0, -0.015]];

fn constant_strain() {
    for (element, corotational) in [(Tetra, false), (Tetra, true), (PlainTetra, false), (PlainTetra, true)] {
        let model = body(element, corotational);
        let params = model.grid.params::<f64>();
        let last = model.grid.nodes.map(|n| n - 1);
        let inside = |node: usize| (0..3).all(|n| (1..last[n]).contains(&params.node_at(node)[n]));
        let of = |u: &[V4<f64>]| {
            let f = forces(arrays(&model), u, corotational);
            let inner = (0..f.len()).filter(|n| inside(*n)).map(|n| f[n]).collect::<Vec<_>>();
            assert!(!inner.is_empty());
            scale(&inner) / scale(&f)
        };
        let found = of(&displaced(&model, |x| times(&G, x)).u);
        assert!(found < 1e-12, "{element:?} corotational {corotational}: {found:e}");
        // counter-test: a strain that is not constant
        assert!(of(&wavy(&model)) > 1e-3);
    }
}

fn slopes() {
    for (element, corotational) in [(Tetra, false), (Tetra, true), (PlainTetra, false), (PlainTetra, true)] {
        let model = body(element, corotational);
        let (a, u) = (arrays(&model), wavy(&model));
        let f = forces(a, &u, corotational);
        let step = 1e-6 * model.extent();
        for node in (0..u.len()).step_by(7) {
            for axis in 0..3 {
                let energy = |by: f64| {
                    let mut moved = u.clone();
                    moved[node][axis] += by;
                    a.energy(&moved, corotational)
                };
                let slope = (energy(step) - energy(-step)) / (2.0 * step);
                // the volume's rotations are held in the forces: of second order in the strains of 3 %
                let bound = if corotational { 3e-2 } else { 1e-6 };
                let error = (slope - f[node][axis]).abs() / scale(&f);
                assert!(error < bound, "{element:?} {corotational} node {node}: {slope:e}, {:e}", f[node][axis]);
            }
        }
    }
}

fn products() {
    for element in [Tetra, PlainTetra] {
        let model = body(element, false);
        let (a, u) = (arrays(&model), wavy(&model));
        let rotations = a.rotations(&u, false);
        let mut w = vec![[0.0; 4]; u.len()];
        a.product(&u, &rotations, &mut w, &mut a.scratch());
        let f = forces(a, &u, false);
        let off = w.iter().zip(&f).flat_map(|(w, f)| (0..3).map(move |n| (w[n] - f[n]).abs())).fold(0.0, f64::max);
        assert!(off <= 1e-12 * scale(&f), "{element:?}: {off:e}");
    }
}

fn blocks() {
    for element in [Tetra, PlainTetra] {
        let model = body(element, false);
        let a = arrays(&model);
        let rotations = a.rotations(&wavy(&model), false);
        for node in (0..model.rest.len()).step_by(5) {
            for axis in 0..3 {
                let mut z = vec![[0.0; 4]; model.rest.len()];
                z[node][axis] = 1.0;
                let mut w = z.clone();
                a.product(&z, &rotations, &mut w, &mut a.scratch());
                let column = symmetric(a.rest_block[2 * node], a.rest_block[2 * node + 1]).0[axis].f64();
                let size = column[axis];
                assert!(size > 0.0);
                let off = (0..3).map(|n| (w[node][n] - column[n]).abs()).fold(0.0, f64::max);
                assert!(off < 1e-10 * size, "{element:?} node {node}: {off:e} of {size:e}");
            }
        }
    }
}

fn rotated() {
    let r = rotation_matrix([0.48, -0.36, 0.0, 0.8]);
    for element in [Tetra, PlainTetra] {
        let model = body(element, true);
        let (a, u) = (arrays(&model), wavy(&model));
        let turn = |(u, x): (&V4<f64>, &[f64; 3])| (r * (V3::of(*x) + V3::from4(*u)) - V3::of(*x)).pad(0.0);
        let turned: Vec<V4<f64>> = u.iter().zip(&model.rest).map(turn).collect();
        let (f, g) = (forces(a, &u, true), forces(a, &turned, true));
        let most = scale(&f);
        for (f, g) in f.iter().zip(&g) {
            let off = (r * V3::from4(*f) - V3::from4(*g)).length();
            assert!(off < 1e-9 * most, "{element:?}: {off:e}");
        }
        // counter-test: the small-strain law resists
        assert!(scale(&forces(a, &turned, false)) > 10.0 * scale(&f));
    }
}

/// E 50 kPa, ν 0.45.
const LAME: [f64; 2] = [155_172.413_793_103_4, 17_241.379_310_344_83];

/// Uniform strain, turned: `λ tr ε + 2 μ ε`, turned.
fn of_material() {
    let strain = M3::of_rows([[0.01, 0.003, 0.0], [0.003, 0.02, 0.004], [0.0, 0.004, -0.015]]);
    let stress = M3::identity() * (LAME[0] * strain.trace()) + strain * (2.0 * LAME[1]);
    for (element, corotational) in [(Tetra, false), (Tetra, true), (PlainTetra, false), (PlainTetra, true)] {
        let model = body(element, corotational);
        let r = if corotational { rotation_matrix([0.48, -0.36, 0.0, 0.8]) } else { M3::identity() };
        let gradient = r * (M3::identity() + strain) - M3::identity();
        let u = displaced(&model, |x| (gradient * V3::of(x)).f64()).u;
        let most = (stress.dot(stress)).sqrt();
        let off = |wanted: M3<f64>| {
            let all = model.mechanics().strains_and_stresses(&model, &Wound::new(&model), &u);
            assert_eq!(all.len(), model.grid.cell_count());
            let off = |own: &[M3<f64>; 2]| (own[1] - wanted).dot(own[1] - wanted).sqrt() / most;
            all.iter().map(off).fold(0.0, f64::max)
        };
        let found = off(r * stress * r.transpose());
        measured(&format!("{element:?} corotational {corotational} stress"), found, 0.0);
        assert!(found < 1e-9, "{element:?} corotational {corotational}: {found:e}");
        // counter-test: not turned, or without the strain's volume
        let other = if corotational { stress } else { strain * (2.0 * LAME[1]) };
        assert!(off(other) > 0.1);
    }
}

/// Any displacements: `Σ V σ = Σ f ⊗ x`, of small strains.
fn balanced() {
    for element in [Tetra, PlainTetra] {
        let model = body(element, false);
        let (a, u) = (arrays(&model), wavy(&model));
        let virial = |f: &[V4<f64>]| {
            f.iter().zip(&model.rest).fold(M3::zero(), |sum, (f, x)| sum + V3::from4(*f).outer(V3::of(*x)))
        };
        let wanted = virial(&forces(a, &u, false));
        let stress = a.strains_and_stresses(&u, false);
        let sum = stress.iter().enumerate().fold(M3::zero(), |sum, (e, own)| sum + own[1] * a.volume(e));
        let off = |sum: M3<f64>| (sum - wanted).dot(sum - wanted).sqrt() / wanted.dot(wanted).sqrt();
        assert!(off(sum) < 1e-12, "{element:?}: {:e}", off(sum));
        // counter-test: the last tetrahedron's is missing
        let last = stress[stress.len() - 1][1] * a.volume(stress.len() - 1);
        assert!(off(sum - last) > 1e-4);
    }
}
