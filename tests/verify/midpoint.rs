//! Midpoint rule with the energy of the step conserved: second order at large strain, energy and momenta in hard cases, Newmark's method for
//! the linear law.
//!
//! The hard case is a free block that starts twisted, with a velocity that makes all momenta nonzero: the midpoint rule by itself (Newmark's
//! constants for a hyperelastic body, which no scene can have) gains energy there, by a little in steps of 0.5 ms and without bound in steps of
//! 5 ms, many periods of what deforms.

use super::setup::{Body, add, cross, displaced, dot, epsilon, measured, model, tolerance, xyz};
use super::small::{block, held};
use super::{Case, Everywhere};
use cutis::backend::Snapshot;
use cutis::bodies::{Model, elastic_energy};
use cutis::math::norm;
use cutis::scene::Integrator::{self, ImplicitEuler, Midpoint, Newmark};
use cutis::scene::{Element, Law, Material, Preconditioner, Region, Scene};
use cutis::step::{Platform, Simulation};

pub const EVERYWHERE: &[Everywhere] = &[
    ("midpoint_rule_is_newmarks_method_for_the_linear_law", linear),
    ("midpoint_rule_keeps_energy_and_momenta_at_large_strain", |platform| twisted(platform, 0.5e-3, 200)),
    ("midpoint_rule_keeps_energy_and_momenta_in_steps_of_many_periods", |platform| twisted(platform, 5e-3, 100)),
    ("a_step_that_is_too_long_for_the_midpoint_rule_is_told", told),
];
pub const CASES: &[Case] = &[
    ("midpoint_rule_is_of_second_order_at_large_strain", order),
    ("midpoint_rule_keeps_energy_of_held_and_partly_held_bodies", held_bodies),
    ("newmarks_method_gains_energy_where_the_law_is_not_linear", newmark_gains),
];

fn kinetic(model: &Model, state: &Snapshot) -> f64 {
    state.v.iter().zip(&model.dofs).map(|(v, dofs)| 0.5 * dofs[3] * dot(xyz(*v), xyz(*v))).sum()
}

fn energy(model: &Model, state: &Snapshot) -> f64 {
    kinetic(model, state) + elastic_energy(model, state, &state.rotation)
}

/// Linear and angular momentum about the origin, kg·m/s and kg·m²/s.
fn momenta(model: &Model, state: &Snapshot) -> [[f64; 3]; 2] {
    let mut out = [[0.0; 3]; 2];
    for (node, rest) in model.rest.iter().enumerate() {
        let p = xyz(state.v[node]).map(|v| model.dofs[node][3] * v);
        out[0] = add(out[0], p);
        out[1] = add(out[1], cross(add(*rest, xyz(state.u[node])), p));
    }
    out
}

/// A free block of 10 × 10 × 20 mm, undamped.
fn free(law: Law) -> Scene {
    let mut scene = block([10e-3; 2], [2, 2], &[(4, 20e-3, 34e3, 0.45, 1000.0)]);
    scene.skins[0].law = law;
    (scene.skins[0].rayleigh_mass, scene.skins[0].rayleigh_stiffness) = (0.0, 0.0);
    (scene.time.gravity, scene.time.integrator) = ([0.0; 3], Midpoint);
    scene
}

const NEO_HOOKEAN: Law = Law::Hyperelastic(Material::NeoHookean);
const LINEAR: Law = Law::Fem { element: Element::Bbar, corotational: false };

/// Turned about the vertical axis by an angle that grows to `angle` at the top, and bent; moving, spinning and stretching.
fn start(model: &Model, angle: f64) -> Snapshot {
    let mut start = displaced(model, |x| {
        let (s, c) = (angle * x[2] / 20e-3).sin_cos();
        [c * x[0] - s * x[1] - x[0] + 5.0 * x[2] * x[2], s * x[0] + c * x[1] - x[1], 0.0]
    });
    for (v, x) in start.v.iter_mut().zip(&model.rest) {
        let spin = cross([20.0, 40.0, -30.0], *x);
        *v = [0.02 + spin[0], -0.01 + spin[1], 0.03 + spin[2] + 3.0 * x[0], 0.0];
    }
    start
}

/// Quarter of a turn over two: the twist of the hard cases.
const ANGLE: f64 = 0.25 * std::f64::consts::PI;

/// Largest changes over a run of energy, momentum and angular momentum, relative to the start, in units of √(2 m E) and that times the extent;
/// and the number of steps that had their elastic forces elsewhere than in the middle. Energy is infinite where the run fails.
fn drifts(platform: &Platform, integrator: Integrator, step: f64, steps: usize) -> ([f64; 3], usize) {
    let mut model = model(&free(NEO_HOOKEAN));
    (model.step.step, model.step.integrator) = (step, integrator);
    let first = start(&model, ANGLE);
    let mut body = Body::new(platform, model, &first, 10.0 * tolerance(platform));
    let state = body.state();
    let (e, p) = (energy(&body.model, &state), momenta(&body.model, &state));
    let size = (2.0 * body.model.dofs.iter().map(|dofs| dofs[3]).sum::<f64>() * e).sqrt();
    let (mut out, mut moved) = ([0.0f64; 3], 0);
    for _ in 0..steps {
        if body.fallible_step().is_err() {
            out[0] = f64::INFINITY;
            break;
        }
        moved += usize::from(body.moved());
        let Ok(state) = body.fallible_state() else {
            out[0] = f64::INFINITY;
            break;
        };
        let now = momenta(&body.model, &state);
        let change = |k: usize| norm(&[std::array::from_fn(|n| if n < 3 { now[k][n] - p[k][n] } else { 0.0 })]);
        out[0] = out[0].max((energy(&body.model, &state) / e - 1.0).abs());
        out[1] = out[1].max(change(0) / size);
        out[2] = out[2].max(change(1) / (size * body.model.extent()));
    }
    (out, moved)
}

fn twisted(platform: &Platform, step: f64, steps: usize) {
    let (found, moved) = drifts(platform, Midpoint, step, steps);
    for (what, found) in ["energy", "momentum", "angular momentum"].iter().zip(found) {
        measured(&format!("midpoint rule, {platform:?}, steps of {step} s: change of {what}"), found, 0.0);
    }
    measured(&format!("{platform:?}, steps of {step} s that are no midpoint steps"), moved as f64, 0.0);
    // each step leaves its solve's tolerance and some roundings of its numbers
    let bound = steps as f64 * (10.0 * tolerance(platform) + 20.0 * epsilon(platform));
    assert!(found.iter().all(|change| *change < bound), "{platform:?} {step}: {found:?} above {bound:e}");
    assert!(moved == 0 || step > 1e-3, "{platform:?} {step}: {moved} steps are not resolved");
    // counter-tests: the midpoint rule by itself keeps the momenta, not the energy; implicit Euler not the angular momentum
    let (plain, _) = drifts(platform, Newmark, step, steps);
    measured(&format!("midpoint rule by itself, {platform:?}, steps of {step} s: change of energy"), plain[0], 0.0);
    assert!(plain[0] > if step > 1e-3 { 1.0 } else { 1e-3 }, "{platform:?} {step}: {plain:?}");
    let (euler, _) = drifts(platform, ImplicitEuler, step, steps);
    measured(&format!("implicit Euler, {platform:?}, steps of {step} s: change of angular momentum"), euler[2], 0.0);
    assert!(euler[0] > 0.1 && euler[2] > bound, "{platform:?} {step}: implicit Euler {euler:?}");
}

fn linear(platform: &Platform) {
    let run = |integrator, law| {
        let mut scene = free(law);
        (scene.time.integrator, scene.time.step) = (integrator, 1e-3);
        let model = model(&scene);
        let first = start(&model, 0.1);
        let mut body = Body::new(platform, model, &first, 10.0 * tolerance(platform));
        (0..20).for_each(|_| body.step());
        body.state()
    };
    let [midpoint, newmark] = [Midpoint, Newmark].map(|integrator| run(integrator, LINEAR));
    assert!(midpoint.u == newmark.u && midpoint.v == newmark.v, "{platform:?}: not to the bit");
    // counter-test: at large strain it is another method
    let [midpoint, newmark] = [Midpoint, Newmark].map(|integrator| run(integrator, NEO_HOOKEAN));
    assert!(midpoint.v != newmark.v, "{platform:?}");
}

fn told(platform: &Platform) {
    let warned = |step: f64| {
        let mut scene = free(NEO_HOOKEAN);
        scene.skins[0].start = cutis::scene::Start::Twist(ANGLE);
        (scene.time.step, scene.time.duration, scene.solver.true_residual_every) = (step, 1.0, 1);
        let mut run = Simulation::new(&scene, platform).unwrap_or_else(|e| panic!("{e}"));
        let report = run.step(true).unwrap_or_else(|e| panic!("{e}"));
        report.warnings
    };
    assert!(warned(0.5e-3).is_empty(), "{platform:?}: {:?}", warned(0.5e-3));
    let long = warned(5e-3);
    assert!(long.len() == 1 && long.get("midpoint_moved") == Some(&1), "{platform:?}: {long:?}");
}

/// Displacement of the free end's middle, per length, of a bar held at its bottom that starts stretched by a fifth and bent.
fn swing(integrator: Integrator, steps: u32) -> [f64; 3] {
    let mut scene = free(NEO_HOOKEAN);
    scene.boundaries = vec![held(Region::Bottom, [true; 3])];
    let mut model = model(&scene);
    (model.step.step, model.step.integrator) = (4e-3 / f64::from(steps), integrator);
    let first = displaced(&model, |x| [8.0 * x[2] * x[2], 0.0, 0.2 * x[2]]);
    let mut body = Body::new(&Platform::Cpu64, model, &first, 1e-10);
    (0..steps).for_each(|_| body.step());
    let top = body.model.grid.nearest([0.0, 0.0, 20e-3]);
    xyz(body.state().u[top]).map(|u| u / 20e-3)
}

/// Order by the changes from 80 to 160 and to 320 steps, and the last of them.
fn order_of(integrator: Integrator) -> (f64, f64) {
    let found = [80, 160, 320].map(|steps| swing(integrator, steps));
    let apart = |a: [f64; 3], b: [f64; 3]| (0..3).map(|n| (a[n] - b[n]).powi(2)).sum::<f64>().sqrt();
    let [first, last] = [apart(found[0], found[1]), apart(found[1], found[2])];
    measured(&format!("order of {integrator:?} at large strain"), (first / last).log2(), 0.0);
    measured(&format!("{integrator:?}: change of the last halving, of the length"), last, 0.0);
    ((first / last).log2(), last)
}

fn order() {
    let (order, change) = order_of(Midpoint);
    assert!((order - 2.0).abs() < 0.2, "order {order}");
    // counter-test: implicit Euler is not of second order
    let (euler, of_euler) = order_of(ImplicitEuler);
    assert!(euler < 1.5 && of_euler > 10.0 * change, "implicit Euler: order {euler}, {of_euler:e} against {change:e}");
}

fn held_bodies() {
    // on its bottom; on a smooth plane, along which it slides and spins
    for (region, axes) in [(Region::Bottom, [true; 3]), (Region::All, [false, false, true])] {
        let mut scene = free(NEO_HOOKEAN);
        scene.boundaries = vec![held(region, axes)];
        let model = model(&scene);
        let mut first = start(&model, ANGLE);
        for (node, dofs) in model.dofs.iter().enumerate() {
            (0..3).for_each(|n| {
                first.u[node][n] *= dofs[n];
                first.v[node][n] *= dofs[n];
            });
        }
        let mut body = Body::new(&Platform::Cpu64, model, &first, 1e-10);
        body.model.step.step = 5e-3;
        let state = body.state();
        let (e, p) = (energy(&body.model, &state), momenta(&body.model, &state));
        let size = (2.0 * body.model.dofs.iter().map(|dofs| dofs[3]).sum::<f64>() * e).sqrt();
        for _ in 0..50 {
            body.step();
            let state = body.state();
            let drift = energy(&body.model, &state) / e - 1.0;
            assert!(drift.abs() < 1e-8, "{axes:?}: {drift:e}");
            let now = momenta(&body.model, &state);
            let slide = (0..2).map(|n| (now[0][n] - p[0][n]).abs()).fold(0.0, f64::max) / size;
            let spin = (now[1][2] - p[1][2]).abs() / (size * body.model.extent());
            assert!(axes[0] || slide.max(spin) < 1e-6, "{slide:e} {spin:e}");
        }
    }
}

/// Most energy that a run gains, relative to the start; infinite where it fails.
fn gained(law: Law, integrator: Integrator, step: f64, steps: u32) -> f64 {
    let mut scene = free(law);
    scene.solver.preconditioner = Preconditioner::Column;
    let mut model = model(&scene);
    (model.step.integrator, model.step.step) = (integrator, step);
    let first = start(&model, ANGLE);
    let mut body = Body::new(&Platform::Cpu64, model, &first, 1e-8);
    let state = body.state();
    let e = energy(&body.model, &state);
    let one = |_| {
        body.step();
        let state = body.state();
        energy(&body.model, &state) / e - 1.0
    };
    (0..steps).map(one).fold(0.0, |most, now| if now.is_finite() { f64::max(most, now) } else { f64::INFINITY })
}

/// Why scenes refuse it with laws whose steps are one linear solve ([`Integrator::fits`]).
fn newmark_gains() {
    let corotational = Law::Fem { element: Element::Bbar, corotational: true };
    let springs = Law::Springs { stiffness: Some(100.0), damping: 0.0 };
    for (law, least) in [(corotational, 10.0), (springs, 0.1)] {
        let [newmark, midpoint] = [Newmark, Midpoint].map(|integrator| gained(law, integrator, 5e-3, 100));
        measured(&format!("Newmark, {law:?}, 100 steps of 5 ms: energy gained"), newmark, 0.0);
        assert!(newmark > least, "{law:?}: {newmark:e}");
        assert!(midpoint == newmark, "{law:?}: one linear solve a step is the same by both, {midpoint:e} {newmark:e}");
        assert!(!Newmark.fits(law) && !Midpoint.fits(law));
    }
    // counter-test
    let linear = gained(LINEAR, Newmark, 5e-3, 100);
    assert!(linear < 1e-6 && Newmark.fits(LINEAR), "the linear law: {linear:e}");
}
