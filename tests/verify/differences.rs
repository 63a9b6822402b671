//! Finite differences: force against energy, products against force.
//!
//! Linear hexahedra: energy is quadratic, so a central difference of any width is exact to rounding. Springs: error of the square of the
//! width. Corotational hexahedra leave the derivative of the rotation out (SOFA does too): their force differs from the energy's gradient by
//! a share that falls with the strain, and this is what is tested.

use super::Case;
use super::dense::multiply;
use super::setup::{Random, block, measured, model};
use cutis::bodies::{Model, Snapshot, elastic_energy};
use cutis::kernels::springs_product::springs_product;
use cutis::kernels::{forces, rotations, springs};
use cutis::math::{V3, V4, rotation_matrix};
use cutis::scene::Element::{Bbar, Enhanced, Plain};
use cutis::scene::{Law, Preconditioner};

pub const CASES: &[Case] = &[
    ("linear_force_is_the_gradient_of_the_energy", linear_force),
    ("pre_strained_force_is_the_gradient_of_the_energy", pre_strained_force),
    ("linear_product_is_the_tangent", linear_product),
    ("corotational_force_nears_the_gradient_with_the_strain", corotational_force),
    ("spring_force_is_the_gradient_of_the_energy", spring_force),
    ("spring_product_is_the_tangent_of_stretched_springs", spring_product),
];

const SEED: u64 = 3;

/// Forces, and with them the rotations of hexahedra and the tangents of springs.
fn force(model: &Model, u: &[V4<f64>]) -> [Vec<V4<f64>>; 3] {
    let params = model.params();
    let mut f = vec![[0.0; 4]; u.len()];
    if let Some(s) = model.springs() {
        let rest: Vec<V4<f64>> = model.rest.iter().map(|r| V3::of(*r).pad(0.0)).collect();
        let mut tangent = vec![[0.0; 4]; 2 * s.half.len()];
        springs::springs(&params, &rest, u, &s.first, &s.half, &s.law, &mut f, &mut tangent);
        return [f, vec![], tangent];
    }
    let mut rotation = vec![[0.0, 0.0, 0.0, 1.0]; model.grid.cell_count()];
    let (shapes, layers) = (model.shapes(), &model.grid.layer_of);
    if model.hexahedra().corotational != 0 {
        rotations::rotations(&params, &shapes, layers, &[], u, &mut rotation);
    }
    let blocks = model.stiffness_blocks();
    forces::forces(&params, &shapes, &model.pre_strains(), &blocks, layers, &[], u, &rotation, &mut f);
    [f, rotation, vec![]]
}

fn energy(model: &Model, u: &[V4<f64>]) -> f64 {
    let law = model.springs().map_or(vec![], |s| s.law.clone());
    elastic_energy(model, &Snapshot { u: u.to_vec(), law, ..Snapshot::default() }, &force(model, u)[1])
}

fn along(u: &[V4<f64>], z: &[V4<f64>], step: f64) -> Vec<V4<f64>> {
    let add = |(u, z): (&V4<f64>, &V4<f64>)| std::array::from_fn(|n| u[n] + step * z[n]);
    u.iter().zip(z).map(add).collect()
}

fn dot(a: &[V4<f64>], b: &[V4<f64>]) -> f64 {
    let pairs = a.as_flattened().iter().zip(b.as_flattened());
    pairs.map(|(p, q)| p * q).sum()
}

/// Largest `|dE/ds − f·z|` over directions `z`, relative to the largest `|f·z|`.
fn gradient_error(model: &Model, u: &[V4<f64>], width: f64) -> f64 {
    let mut random = Random::new(SEED);
    let [f, ..] = force(model, u);
    let (mut worst, mut size) = (0.0f64, 0.0f64);
    for _ in 0..8 {
        let z = random.field(u.len(), 1e-5);
        let slope = (energy(model, &along(u, &z, width)) - energy(model, &along(u, &z, -width))) / (2.0 * width);
        worst = worst.max((slope - dot(&f, &z)).abs());
        size = size.max(dot(&f, &z).abs());
    }
    worst / size
}

/// Largest difference between `(f(u + z) − f(u − z))/2` and the product's `K z`, relative to the largest of `K z`.
fn tangent_error(model: &Model, u: &[V4<f64>], width: f64) -> f64 {
    let mut random = Random::new(SEED);
    let z = random.field(u.len(), 1e-5);
    let [_, rotation, tangent] = force(model, u);
    let mut params = model.params();
    params.inertia = 0.0;
    let mut w = vec![[0.0; 4]; u.len()];
    if let Some(s) = model.springs() {
        springs_product(&params, &s.first, &s.half, &tangent, &model.dofs, &z, &mut w);
    } else {
        multiply(&params, model, &rotation, &z, &mut w);
    }
    let ([up, ..], [down, ..]) = (force(model, &along(u, &z, width)), force(model, &along(u, &z, -width)));
    let (mut worst, mut size) = (0.0f64, 0.0f64);
    for (w, (up, down)) in w.iter().zip(up.iter().zip(&down)) {
        for n in 0..3 {
            worst = worst.max(((up[n] - down[n]) / (2.0 * width) - w[n]).abs());
            size = size.max(w[n].abs());
        }
    }
    worst / size
}

/// Rounding of a few hundred sums, at displacements and differences of one size.
const EXACT: f64 = 1e-11;

fn linear_force() {
    for element in [Plain, Bbar, Enhanced] {
        let model = model(&block(element, false));
        let u = Random::new(SEED + 1).field(model.rest.len(), 1e-5);
        let error = gradient_error(&model, &u, 1.0);
        measured("linear force against energy", error, 0.0);
        assert!(error < EXACT, "{element:?}: {error:e}");
        let mut wrong = model.clone();
        wrong.hexahedra_mut().stiffness[0][4][9] *= 1.001;
        let u = Random::new(SEED + 1).field(model.rest.len(), 1e-5);
        let error = gradient_error(&wrong, &u, 1.0);
        assert!(error > 1e3 * EXACT, "an unsymmetric entry has no energy: {error:e}");
    }
}

fn pre_strained_force() {
    for element in [Plain, Bbar, Enhanced] {
        let mut scene = block(element, false);
        let layers = scene.skins[0].layers.iter_mut();
        layers.zip([[0.2, 0.1], [0.3, -0.1], [0.05, 0.4]]).for_each(|(layer, e)| layer.pre_strain = e);
        let mut model = model(&scene);
        // of the size of the strain's own displacements in a cell, so that both count in the sums
        let u = Random::new(SEED + 1).field(model.rest.len(), 1e-4);
        let error = gradient_error(&model, &u, 1.0);
        measured("pre-strained force against energy", error, 0.0);
        assert!(error < EXACT, "{element:?}: {error:e}");
        // counter-test: the energy at rest is another, so its gradient is
        let [f, ..] = force(&model, &u);
        model.hexahedra_mut().pre_strain.iter_mut().for_each(|e| e[0] *= 1.001);
        let [g, ..] = force(&model, &u);
        let apart = f.iter().zip(&g).map(|(f, g)| [0, 1, 2, 3].map(|n| f[n] - g[n])).collect::<Vec<_>>();
        assert!(dot(&apart, &apart).sqrt() > 1e3 * EXACT * dot(&f, &f).sqrt(), "a thousandth more is not noticed");
    }
}

fn linear_product() {
    for element in [Plain, Bbar, Enhanced] {
        let mut model = model(&block(element, false));
        let u = Random::new(SEED + 1).field(model.rest.len(), 1e-5);
        let error = tangent_error(&model, &u, 1.0);
        measured("linear product against force", error, 0.0);
        assert!(error < EXACT, "{element:?}: {error:e}");
        model.step.rayleigh_stiffness = 1e-6 * model.step.step; // belongs to the system, not to the tangent
        assert!(tangent_error(&model, &u, 1.0) > 1e3 * EXACT);
    }
}

/// A body strained by about `strain`, then turned by 50° about a skew axis.
fn strained(model: &Model, strain: f64) -> Vec<V4<f64>> {
    let mut random = Random::new(SEED + 2);
    let noise = random.field(model.rest.len(), 1e-3 * strain);
    let (s, c) = 25f64.to_radians().sin_cos();
    let r = rotation_matrix([s * 2.0 / 3.0, s / 3.0, -s * 2.0 / 3.0, c]);
    let displacement = |(x, d): (&[f64; 3], &V4<f64>)| {
        let x = V3::of(*x);
        (r * (x + V3::from4(*d)) - x).pad(0.0)
    };
    model.rest.iter().zip(&noise).map(displacement).collect()
}

fn corotational_force() {
    for element in [Plain, Bbar, Enhanced] {
        let model = model(&block(element, true));
        let errors = [0.04, 0.02, 0.01, 1e-4].map(|s| gradient_error(&model, &strained(&model, s), 1e-2 * s));
        measured("corotational force against energy, strain 0.04", errors[0], 0.0);
        measured("corotational force against energy, strain 0.01", errors[2], 0.0);
        for pair in errors[..3].windows(2) {
            let order = (pair[0] / pair[1]).log2();
            assert!((0.7..1.4).contains(&order), "{element:?}: order {order} of {errors:?}");
        }
        assert!(errors[0] < 0.1 && errors[3] < 1e-3, "{element:?}: {errors:?}");
        // counter-test: forces of unturned hexahedra are not near the gradient at any strain
        let mut linear = model.clone();
        linear.hexahedra_mut().corotational = 0;
        let u = strained(&model, 1e-4);
        let ([f, ..], [g, ..]) = (force(&linear, &u), force(&model, &u));
        assert!(dot(&f, &f) > 10.0 * dot(&g, &g));
    }
}

fn spring_body() -> Model {
    let mut scene = block(Plain, false);
    scene.skins[0].law = Law::Springs { stiffness: Some(100.0), damping: 0.0 };
    scene.solver.preconditioner = Preconditioner::Column;
    model(&scene)
}

/// Uniform growth by `by`, with noise of a tenth of it.
fn grown(model: &Model, by: f64) -> Vec<V4<f64>> {
    let noise = Random::new(SEED + 3).field(model.rest.len(), 1e-4 * by.abs());
    let grow = |(x, d): (&[f64; 3], &V4<f64>)| (V3::of(*x) * by + V3::from4(*d)).pad(0.0);
    model.rest.iter().zip(&noise).map(grow).collect()
}

/// Square of the differences' relative width (1e-5 m × 1e-2 against springs of 3e-4 m and more), and rounding over the width.
const SPRING: f64 = 1e-5;

fn spring_force() {
    let body = spring_body();
    for by in [0.1, -0.1] {
        let error = gradient_error(&body, &grown(&body, by), 1e-2);
        measured("spring force against energy", error, 0.0);
        assert!(error < SPRING, "{by}: {error:e}");
    }
    let mut wrong = body.clone();
    if let Some(s) = wrong.springs_mut() {
        s.half[0][0] = s.half[2][0]; // one end of an edge takes itself for a diagonal, the other does not
    }
    let error = gradient_error(&wrong, &grown(&wrong, 0.1), 1e-2);
    assert!(error > 1e2 * SPRING, "{error:e}");
}

fn spring_product() {
    let body = spring_body();
    let error = tangent_error(&body, &grown(&body, 0.1), 1e-2);
    measured("spring product against force", error, 0.0);
    assert!(error < SPRING, "{error:e}");
    // compressed springs are clamped on purpose: there the product is not the tangent
    let clamped = tangent_error(&body, &grown(&body, -0.1), 1e-2);
    assert!(clamped > 1e3 * SPRING, "{clamped:e}");
}
