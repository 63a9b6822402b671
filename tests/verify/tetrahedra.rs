//! Tetrahedra in a grid's cells: locking, patch test, forces against energies, rotation.

use super::Case;
use super::setup::{Body, Random, block, displaced, in_long_steps, measured, model, times};
use super::skin_block::{Grid, POINTS, on_grid, static_answer};
use cutis::bodies::tetrahedra::operator::{Arrays, For};
use cutis::bodies::{Kind, Model, Wound};
use cutis::kernels::blocks::symmetric;
use cutis::math::rotation_matrix;
use cutis::math::{M3, V3, V4};
use cutis::scene::Element::{self, PlainTetra, Tetra};
use cutis::scene::{Law, LoadKind, Material, Preconditioner};
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
    ("strains_and_stresses_of_tetrahedra_near_those_of_fine_hexahedra", converging),
    ("forces_of_hyperelastic_tetrahedra_are_the_slope_of_their_energy", slopes_of_laws),
    ("at_rest_hyperelastic_tetrahedra_have_the_slope_of_their_forces", at_rest),
    ("the_linearisation_of_hyperelastic_tetrahedra_is_half_of_the_true_tangent_or_more", half_or_more),
    ("hyperelastic_tetrahedra_do_not_feel_rotation", turned),
    ("hyperelastic_tetrahedra_on_the_skin_block", large_skin_block),
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
            let mut scene = on_grid(in_long_steps(file), Grid::Coarse, element);
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

/// Points of the skin block off its planes of symmetry, at the heights of two layers, m.
fn points_of_the_block() -> Vec<[f64; 3]> {
    let across = [0.31e-3, 1.13e-3, 2.87e-3, 4.21e-3];
    let at = |z: f64| across.iter().flat_map(move |x| across.map(|y| [*x, 0.9 * y, z]));
    at(0.7e-3).chain(at(1.8e-3)).collect()
}

/// Strain and stress at the points, of the linear skin block at ν 0.49.
fn at_points(grid: Grid, element: Element) -> Vec<[M3<f64>; 2]> {
    let mut scene = on_grid(in_long_steps("verify/skin_block_049.toml"), grid, element);
    if element == Tetra {
        (scene.solver.preconditioner, scene.solver.max_iterations) = (Preconditioner::Block, 20_000);
    }
    let (model, u) = static_answer(&Platform::Cpu64, &scene, 1e-7);
    let (wound, mechanics) = (Wound::new(&model), model.mechanics());
    let moved = |node: usize| [V3::from4(u[node]), V3::zero()];
    let of = |point| {
        mechanics.strain_and_stress_at(&model, &wound, &mechanics.element_points(&model, &wound, point), &moved)
    };
    points_of_the_block().into_iter().map(of).collect()
}

/// Strains, those that belong to the stresses by Hooke's law, and stresses, against hexahedra of mean dilatation on the fine grid: root mean
/// square of the differences, relative. (Strains of the tetrahedra's own gradients, which these are not: 38 and 18 %.)
fn converging() {
    let wanted = at_points(Grid::Fine, Element::Bbar);
    let layers = in_long_steps("verify/skin_block_049.toml").skins[0].layers.clone();
    let errors = |grid| {
        let found = at_points(grid, Tetra);
        let (mut sums, mut sizes) = ([0.0; 3], [0.0; 3]);
        for (k, (found, wanted)) in found.iter().zip(&wanted).enumerate() {
            let layer = &layers[usize::from(k >= wanted_in_the_lower_layer())];
            let shear = layer.young / (2.0 * (1.0 + layer.poisson));
            let bulk = layer.young / (3.0 * (1.0 - 2.0 * layer.poisson));
            let mean = found[1].trace() / 3.0;
            let deviator = found[1] - M3::identity() * mean;
            let of_stress = deviator * (0.5 / shear) + M3::identity() * (mean / (3.0 * bulk));
            for (n, (found, wanted)) in
                [(found[0], wanted[0]), (of_stress, wanted[0]), (found[1], wanted[1])].into_iter().enumerate()
            {
                sums[n] += (found - wanted).dot(found - wanted);
                sizes[n] += wanted.dot(wanted);
            }
        }
        [0, 1, 2].map(|n| (sums[n] / sizes[n]).sqrt())
    };
    let (coarse, fine) = (errors(Grid::Coarse), errors(Grid::Fine));
    for (what, n) in [("strains", 0), ("strains of the stresses", 1), ("stresses", 2)] {
        measured(&format!("{what} on 20 × 20 × 5 and 40 × 40 × 8 cells, off"), coarse[n], fine[n]);
        assert!(fine[n] < 0.8 * coarse[n], "{what}: {:.3}, then {:.3}", coarse[n], fine[n]);
        assert!(coarse[n] < 0.3, "{what}: {:.3}", coarse[n]);
    }
}

/// Number of the points in the lower layer.
fn wanted_in_the_lower_layer() -> usize {
    points_of_the_block().len() / 2
}

const MATERIALS: [Material; 2] = [Material::NeoHookean, Material::MooneyRivlin];

/// A body of one layer whose law has both constants.
fn large(element: Element, material: Material) -> Model {
    let mut scene = block(element, true);
    scene.solver.preconditioner = Preconditioner::Block;
    scene.skins[0].law = Law::LargeTetra { material, element };
    scene.skins[0].layers.iter_mut().for_each(|layer| layer.second_share = 0.4);
    model(&scene)
}

/// Bodies of all elements and laws.
fn all_large() -> impl Iterator<Item = (Element, Material)> {
    [Tetra, PlainTetra].into_iter().flat_map(|element| MATERIALS.map(|material| (element, material)))
}

/// Displacements with strains up to a third.
fn very_wavy(model: &Model) -> Vec<V4<f64>> {
    wavy(model).into_iter().map(|u| u.map(|c| 8.0 * c)).collect()
}

fn slopes_of_laws() {
    for (element, material) in all_large() {
        let model = large(element, material);
        let (a, u) = (arrays(&model), very_wavy(&model));
        let f = forces(a, &u, true);
        let step = 1e-6 * model.extent();
        let mut worst = 0.0f64;
        for node in (0..u.len()).step_by(5) {
            for axis in 0..3 {
                let energy = |by: f64| {
                    let mut moved = u.clone();
                    moved[node][axis] += by;
                    a.energy(&moved, true)
                };
                let slope = (energy(step) - energy(-step)) / (2.0 * step);
                worst = worst.max((slope - f[node][axis]).abs() / scale(&f));
            }
        }
        measured(&format!("{element:?} {material:?} force against the slope of the energy"), worst, 0.0);
        assert!(worst < 1e-6, "{element:?} {material:?}: {worst:e}");
        // momentum and angular momentum stay
        let sum = f.iter().fold(V3::zero(), |sum, f| sum + V3::from4(*f));
        let torque = f
            .iter()
            .zip(&u)
            .zip(&model.rest)
            .fold(V3::zero(), |sum, ((f, u), x)| sum + (V3::of(*x) + V3::from4(*u)).cross(V3::from4(*f)));
        let most = scale(&f);
        assert!(sum.length() < 1e-12 * most * u.len() as f64, "{:e} N", sum.length());
        assert!(torque.length() < 1e-12 * most * model.extent() * u.len() as f64, "{:e} N m", torque.length());
        // the counter-test: forces of small strains are others
        let small = forces(arrays(&body(element, true)), &u, true);
        let off = small.iter().zip(&f).map(|(a, b)| (V3::from4(*a) - V3::from4(*b)).length()).fold(0.0, f64::max);
        assert!(off > 0.05 * most, "{off:e} of {most:e}");
    }
}

fn at_rest() {
    for (element, material) in all_large() {
        let model = large(element, material);
        let (a, z) = (arrays(&model), wavy(&model));
        let still = vec![[0.0; 4]; z.len()];
        let product = |at: &[V4<f64>]| {
            let mut w = still.clone();
            a.product(&z, &a.linearised(at, For::Steps(1.0)), &mut w, &mut a.scratch());
            w
        };
        let step = 1e-5;
        let moved = |by: f64| forces(a, &z.iter().map(|z| z.map(|c| by * c)).collect::<Vec<_>>(), true);
        let (after, before, w) = (moved(step), moved(-step), product(&still));
        let off = |w: &[V4<f64>]| {
            let each = w.iter().zip(after.iter().zip(&before)).flat_map(|(w, (after, before))| {
                (0..3).map(move |n| (w[n] - (after[n] - before[n]) / (2.0 * step)).abs())
            });
            each.fold(0.0, f64::max) / scale(w)
        };
        measured(&format!("{element:?} {material:?} linearisation at rest"), off(&w), 0.0);
        assert!(off(&w) < 1e-6, "{element:?} {material:?}: {:e}", off(&w));
        // the counter-test: strained it is another one
        assert!(off(&product(&very_wavy(&model))) > 1e-2);
    }
}

/// Largest `zᵀ(K − 2 S) z / zᵀ D z` over displacements that the power iteration finds, with the true tangent `K`, the linearisation `S`
/// (times `share`) and the diagonal `D` of the stiffness at rest: above 0 a static step overshoots.
fn overshoot(a: &Arrays<f64>, u: &[V4<f64>], size: f64, share: f64, seed: u64) -> f64 {
    let diagonal: Vec<f64> = (0..u.len()).map(|i| a.rest_block[2 * i][0]).collect();
    let rotations = a.linearised(u, For::Steps(1.0));
    let beyond = |z: &[V4<f64>]| {
        let step = 1e-5 * size / scale(z);
        let moved = |by: f64| {
            let at: Vec<V4<f64>> = u.iter().zip(z).map(|(u, z)| std::array::from_fn(|n| u[n] + by * z[n])).collect();
            forces(a, &at, true)
        };
        let (after, before) = (moved(step), moved(-step));
        let mut w = vec![[0.0; 4]; z.len()];
        a.product(z, &rotations, &mut w, &mut a.scratch());
        let of = |i: usize| -> V4<f64> {
            std::array::from_fn(|n| (after[i][n] - before[i][n]) / (2.0 * step) - 2.0 * share * w[i][n])
        };
        (0..z.len()).map(of).collect::<Vec<_>>()
    };
    let mut random = Random::new(seed);
    let mut z = random.field(u.len(), 1.0);
    // beyond every negative eigenvalue of K − 2 S, relative to D
    const SHIFT: f64 = 40.0;
    let mut quotient = 0.0;
    for _ in 0..150 {
        let b = beyond(&z);
        let dot = |a: &[V4<f64>], weight: &dyn Fn(usize) -> f64| -> f64 {
            a.iter().zip(&z).enumerate().map(|(i, (a, z))| weight(i) * V3::from4(*a).dot(V3::from4(*z))).sum()
        };
        quotient = dot(&b, &|_| 1.0) / dot(&z, &|i| diagonal[i]);
        let next = |(i, (z, b)): (usize, (&V4<f64>, &V4<f64>))| -> V4<f64> {
            std::array::from_fn(|n| SHIFT * z[n] + b[n] / diagonal[i])
        };
        let next: Vec<V4<f64>> = z.iter().zip(&b).enumerate().map(next).collect();
        let most = scale(&next);
        z = next.iter().map(|z| z.map(|c| c / most)).collect();
    }
    quotient
}

fn half_or_more() {
    let mut scene = block(Tetra, true);
    (scene.solver.preconditioner, scene.skins[0].cells) = (Preconditioner::Block, [4, 3]);
    scene.skins[0].law = Law::LargeTetra { material: Material::NeoHookean, element: Tetra };
    scene.skins[0].layers.truncate(1);
    scene.skins[0].layers[0].cells = 3;
    let model = model(&scene);
    let a = arrays(&model);
    let size = model.extent();
    let wave = |x: f64| 0.02 * size * (9.0 * x / size).sin();
    let stretched = |s: [f64; 3], bent: f64| {
        displaced(&model, |x| {
            let bend = [bent * wave(x[2]), 0.0, bent * wave(x[0])];
            std::array::from_fn(|n| (s[n] - 1.0) * x[n] + bend[n])
        })
        .u
    };
    for (what, s, bent) in [
        ("pressed", [1.0, 1.0, 0.8], 0.0),
        ("pressed, free aside", [1.15, 1.15, 0.75], 0.5),
        ("stretched", [1.4, 0.85, 0.85], 0.5),
        ("in disorder", [1.0; 3], 1.0),
    ] {
        let found = overshoot(a, &stretched(s, bent), size, 1.0, 7);
        let half = overshoot(a, &stretched(s, bent), size, 0.4, 7);
        measured(&format!("{what}: true tangent beyond twice the linearisation"), found, 0.0);
        assert!(found < 1e-2, "{what}: {found:e}");
        // the counter-test: 0.4 of it is less than half
        assert!(half > 1e-2, "{what}: {half:e} and {found:e}");
    }
}

fn turned() {
    let r = rotation_matrix([0.48, -0.36, 0.0, 0.8]);
    for (element, material) in all_large() {
        let model = large(element, material);
        let (a, u) = (arrays(&model), very_wavy(&model));
        let turn = |(u, x): (&V4<f64>, &[f64; 3])| (r * (V3::of(*x) + V3::from4(*u)) - V3::of(*x)).pad(0.0);
        let turned = |u: &[V4<f64>]| u.iter().zip(&model.rest).map(turn).collect::<Vec<_>>();
        let (f, g) = (forces(a, &u, true), forces(a, &turned(&u), true));
        let most = scale(&f);
        let still = scale(&forces(a, &turned(&vec![[0.0; 4]; u.len()]), true));
        assert!(still < 1e-10 * most, "{element:?} {material:?}: {still:e} N of {most:e} N");
        let off = f.iter().zip(&g).map(|(f, g)| (r * V3::from4(*f) - V3::from4(*g)).length()).fold(0.0, f64::max);
        assert!(off < 1e-9 * most, "{element:?} {material:?}: {off:e}");
        // products turn with the body
        let z = wavy(&model);
        let around: Vec<V4<f64>> = z.iter().map(|z| (r * V3::from4(*z)).pad(0.0)).collect();
        let product = |u: &[V4<f64>], z: &[V4<f64>]| {
            let mut w = vec![[0.0; 4]; z.len()];
            a.product(z, &a.linearised(u, For::Steps(1.0)), &mut w, &mut a.scratch());
            w
        };
        let (w, x) = (product(&u, &z), product(&turned(&u), &around));
        let off = w.iter().zip(&x).map(|(w, x)| (r * V3::from4(*w) - V3::from4(*x)).length()).fold(0.0, f64::max);
        assert!(off < 1e-8 * scale(&w), "{element:?} {material:?}: {off:e}");
        // the counter-test: not turned
        assert!(f.iter().zip(&g).any(|(f, g)| (V3::from4(*f) - V3::from4(*g)).length() > 0.1 * most));
    }
}

/// Displacement of the skin block's centre under a pressure, m, after so many steps of one linear solve, and how much of it the last one moved.
fn large_centre(file: &str, element: Element, pressure: f64, steps: u32) -> [f64; 2] {
    let mut scene = on_grid(in_long_steps(file), Grid::Coarse, element);
    scene.skins[0].law = Law::LargeTetra { material: Material::NeoHookean, element };
    (scene.solver.newton, scene.solver.preconditioner, scene.solver.max_iterations) =
        (false, Preconditioner::Block, 20_000);
    scene.loads[0].kind = LoadKind::Pressure { pressure, follower: false };
    if pressure > 20e3 {
        scene.time.gravity = [0.0; 3];
    }
    let model = model(&scene);
    let centre = model.grid.nearest(POINTS[0]);
    let mut body = Body::new(&Platform::Cpu64, model.clone(), &displaced(&model, |_| [0.0; 3]), 1e-4);
    body.load(&model.load_at(&scene.loads, 0.0));
    let mut at = [0.0; 2];
    for _ in 0..steps {
        body.step();
        let now = body.state().u[centre][2];
        at = [now, (now - at[0]) / now];
    }
    at
}

/// Converged displacements (src/report/verify/cases.rs). Bricks of mean dilatation on the same grid have +1.7 % at 10 kPa and ν 0.45, +4.1 % at
/// 50 kPa.
fn large_skin_block() {
    for (file, pressure, reference, steps, known) in [
        ("verify/skin_block_neo_045.toml", 10e3, -0.1836e-3, 12, 6.7),
        ("verify/skin_block_neo_049.toml", 10e3, -0.1431e-3, 20, 4.4),
        ("verify/skin_block_neo_045.toml", 50e3, -0.7585e-3, 40, 7.3),
        ("verify/skin_block_neo_049.toml", 50e3, -0.6171e-3, 60, 3.6),
    ] {
        let [found, moved] = large_centre(file, Tetra, pressure, steps);
        let error = 100.0 * (found / reference - 1.0);
        measured(&format!("{file} {pressure} Pa, last step moved {moved:e}: error / %"), error, known);
        assert!((error - known).abs() < DIGITS, "{file} {pressure} Pa: {error:.2} %, known {known}");
        assert!(moved.abs() < 1e-3, "{file} {pressure} Pa: the last step moved {moved:e}");
    }
    // the counter-test: plain ones lock
    let [plain, _] = large_centre("verify/skin_block_neo_045.toml", PlainTetra, 10e3, 6);
    assert!(plain / -0.1836e-3 < 0.8, "{plain:e}");
}
