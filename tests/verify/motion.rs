//! Motion of a free body: free fall, momentum, energy.
//!
//! Implicit Euler keeps linear momentum exactly for every law, and for linear hexahedra the moment of momentum about rest positions
//! (`Σ X × K u = 0`: the rotations are in K's null space); its energy never rises. Corotational hexahedra leave a torque of second order in
//! the strain, and a spinning body loses spin with the first order of the step.

use super::setup::{
    Body, Random, add, block, cross, displaced, dot, epsilon, largest, measured, model, tolerance, xyz,
};
use super::{Case, Everywhere};
use cutis::backend::Snapshot;
use cutis::bodies::{Model, elastic_energy};
use cutis::kernels::momentum;
use cutis::scene::Element::{Bbar, Plain};
use cutis::scene::Mass::{self, Consistent, Lumped, Uniform};
use cutis::scene::{Law, Preconditioner};
use cutis::step::Platform;

pub const EVERYWHERE: &[Everywhere] =
    &[("free_fall_is_implicit_eulers_parabola", free_fall), ("free_block_keeps_its_momentum", kept_momentum)];
pub const CASES: &[Case] = &[
    ("momentum_of_a_held_block_changes", held_momentum),
    ("energy_of_a_free_block_never_rises", energy),
    ("energy_of_explicit_steps_rises", explicit_energy),
    ("corotational_torque_is_of_second_order", torque),
    ("spin_is_lost_with_the_first_order_of_the_step", spin),
];

fn free_fall(platform: &Platform) {
    const STEPS: i32 = 20;
    for (drag, mass) in [(0.0, Lumped), (5.0, Lumped), (5.0, Uniform), (5.0, Consistent)] {
        let mut scene = block(Bbar, true);
        scene.skins[0].mass = mass;
        (scene.time.step, scene.time.gravity) = (5e-3, [1.0, -2.0, -9.81]);
        (scene.skins[0].rayleigh_mass, scene.skins[0].rayleigh_stiffness) = (drag, 0.01);
        let model = model(&scene);
        let mut body = Body::new(platform, model.clone(), &displaced(&model, |_| [0.0; 3]), tolerance(platform));
        let (h, q) = (scene.time.step, 1.0 / (1.0 + scene.time.step * drag));
        // v_n = g h Σ_{k=1..n} q^k, u_n = h Σ v_k
        let (mut v, mut u) = (0.0, 0.0);
        for _ in 0..STEPS {
            body.step();
            v = (v + h) * q;
            u += h * v;
        }
        let exact = scene.time.gravity.map(|g| g * u);
        let state = body.state();
        let size = largest(&[exact]);
        let far = |exact: [f64; 3]| {
            let off = |p: &[f64; 4]| (0..3).map(|n| (p[n] - exact[n]).abs()).fold(0.0, f64::max);
            state.u.iter().map(off).fold(0.0, f64::max) / size
        };
        measured(&format!("free fall {platform:?} drag {drag} {mass:?}"), far(exact), 0.0);
        // each step adds its solve's and its sum's rounding, and the velocity carries both on; measured is a tenth and less on the CPU,
        // a sixth on lavapipe
        let bound = 4.0 * f64::from(STEPS) * (tolerance(platform) + 8.0 * epsilon(platform));
        assert!(far(exact) < bound, "{platform:?}, drag {drag} {mass:?}: {:e} above {bound:e}", far(exact));
        // counter-test: the exact parabola is another curve at this step
        let time = f64::from(STEPS) * h;
        let parabola = scene.time.gravity.map(|g| 0.5 * g * time * time);
        assert!(far(parabola) > 0.04, "{:e}", far(parabola));
    }
}

/// A strained block in motion: smooth strains of up to 4 %, velocities that would strain it by 1 % per millisecond.
fn lively(model: &Model) -> Snapshot {
    let mut start = displaced(model, |x| {
        let [a, b, c] = x.map(|x| 400.0 * x);
        [6e-5 * b.sin(), 5e-5 * (a + c).cos(), 3e-5 * (a * b).sin()]
    });
    start.v = Random::new(21).field(model.rest.len(), 0.02);
    start
}

fn momentum_of(model: &Model, state: &Snapshot) -> ([f64; 3], [f64; 3]) {
    let (mut linear, mut angular) = ([0.0; 3], [0.0; 3]);
    let mut v = state.v.clone();
    if model.mass == Consistent {
        let alive = vec![[0.0, 0.0, 0.0, 1.0]; model.grid.cell_count()];
        let (shape, layers) = (model.shapes(), &model.grid.layer_of);
        momentum::momentum(&model.params(), &shape, layers, &[], &alive, &model.dofs, &state.v, &mut v);
    }
    for node in 0..model.rest.len() {
        let p = xyz(v[node]).map(|v| v * model.dofs[node][3]);
        linear = add(linear, p);
        angular = add(angular, cross(model.rest[node], p));
    }
    (linear, angular)
}

/// Change of linear momentum and of moment of momentum (about rest positions) over 20 steps, relative to what one sign would sum to.
fn momentum_change(platform: &Platform, model: &Model) -> [f64; 2] {
    let start = lively(model);
    let mut body = Body::new(platform, model.clone(), &start, tolerance(platform));
    for _ in 0..20 {
        body.step();
    }
    let (p, l) = momentum_of(model, &start);
    let (q, m) = momentum_of(model, &body.state());
    let mass: f64 = model.dofs.iter().map(|f| f[3]).sum();
    let (speed, arm) = (0.02, largest(&model.rest));
    let change = |a: [f64; 3], b: [f64; 3]| (0..3).map(|n| (a[n] - b[n]).abs()).fold(0.0, f64::max);
    [change(p, q) / (mass * speed), change(l, m) / (mass * speed * arm)]
}

fn free_block(law: Law, damping: f64) -> Model {
    free_block_of(law, Lumped, damping)
}

fn free_block_of(law: Law, mass: Mass, damping: f64) -> Model {
    let mut scene = block(Bbar, true);
    scene.skins[0].mass = mass;
    (scene.time.step, scene.skins[0].rayleigh_stiffness) = (2e-4, damping);
    scene.skins[0].law = law;
    if matches!(law, Law::Springs { .. }) {
        scene.solver.preconditioner = Preconditioner::Column;
    }
    model(&scene)
}

const LINEAR: Law = Law::Fem { element: Bbar, corotational: false };
const COROTATIONAL: Law = Law::Fem { element: Bbar, corotational: true };
const SPRINGS: Law = Law::Springs { stiffness: Some(30.0), damping: 0.1 };

fn kept_momentum(platform: &Platform) {
    let lumped = [LINEAR, COROTATIONAL, SPRINGS].map(|law| (law, Lumped));
    let others = [(LINEAR, Uniform), (LINEAR, Consistent), (COROTATIONAL, Consistent)];
    for (law, mass) in lumped.into_iter().chain(others) {
        let [linear, angular] = momentum_change(platform, &free_block_of(law, mass, 0.001));
        measured(&format!("momentum {platform:?} {law:?} {mass:?}"), linear, 0.0);
        measured(&format!("moment of momentum {platform:?} {law:?} {mass:?}"), angular, 0.0);
        // a step's impulses are a few times the momentum and cancel to the solve's tolerance times the root of the nodes
        let bound = 20.0 * 100.0 * tolerance(platform);
        assert!(linear < bound, "{platform:?} {law:?} {mass:?}: {linear:e} above {bound:e}");
        if let Law::Fem { corotational: false, .. } = law {
            assert!(angular < bound, "{platform:?} {mass:?}: {angular:e} above {bound:e}");
        }
    }
}

fn held_momentum() {
    let mut model = free_block(LINEAR, 0.001);
    model.dofs[0][..3].fill(0.0);
    let [linear, angular] = momentum_change(&Platform::Cpu64, &model);
    assert!(linear > 1e-3 && angular > 1e-3, "{linear:e} {angular:e}");
}

/// Largest rise of kinetic and elastic energy in a step, relative to the start's.
fn energy_rise(model: Model, steps: u32) -> f64 {
    let start = lively(&model);
    let mut body = Body::new(&Platform::Cpu64, model, &start, 1e-12);
    let total = |body: &mut Body| {
        let state = body.state();
        let kinetic: f64 =
            state.v.iter().zip(&body.model.dofs).map(|(v, dofs)| 0.5 * dofs[3] * dot(xyz(*v), xyz(*v))).sum();
        kinetic + elastic_energy(&body.model, &state, &state.rotation)
    };
    let first = total(&mut body);
    let (mut last, mut rise) = (first, f64::NEG_INFINITY);
    for _ in 0..steps {
        body.try_step();
        let now = total(&mut body);
        rise = rise.max((now - last) / first);
        last = now;
    }
    assert!(last < first || rise > 0.0);
    rise
}

fn energy() {
    for law in [LINEAR, COROTATIONAL, SPRINGS] {
        for damping in [0.0, 0.002] {
            let rise = energy_rise(free_block(law, damping), 100);
            measured(&format!("energy rise {law:?} r_K {damping}"), rise, 0.0);
            assert!(rise < 1e-12, "{law:?}, r_K {damping}: {rise:e}");
        }
    }
}

fn explicit_energy() {
    // r_K = −h takes the stiffness out of the system matrix: symplectic Euler, whose energy swings up and down
    let mut model = free_block(LINEAR, 0.0);
    model.step.step = 2e-6;
    model.step.rayleigh_stiffness = -model.step.step;
    let rise = energy_rise(model, 100);
    assert!(rise > 1e-6, "{rise:e}");
}

/// Torque of the elastic forces about the present positions, relative to the sum of force times arm, at a strain.
fn relative_torque(corotational: bool, strain: f64) -> f64 {
    let model = model(&block(Plain, corotational));
    let (s, c) = 40f64.to_radians().sin_cos();
    let noise = Random::new(8).field(model.rest.len(), 1e-3 * strain);
    let turn = |(x, d): (&[f64; 3], &[f64; 4])| {
        let y = add(*x, xyz(*d));
        [c * y[0] - s * y[1] - x[0], s * y[0] + c * y[1] - x[1], y[2] - x[2], 0.0]
    };
    let mut start = displaced(&model, |_| [0.0; 3]);
    start.u = model.rest.iter().zip(&noise).map(turn).collect();
    let mut body = Body::new(&Platform::Cpu64, model.clone(), &start, 1e-12);
    let (mut sum, mut size) = ([0.0; 3], 0.0);
    for (node, f) in body.forces().into_iter().enumerate() {
        let x = add(model.rest[node], xyz(start.u[node]));
        sum = add(sum, cross(x, f));
        size += dot(x, x).sqrt() * dot(f, f).sqrt();
    }
    largest(&[sum]) / size
}

fn torque() {
    let found = [0.04, 0.02, 0.01].map(|strain| relative_torque(true, strain));
    measured("torque at strain 0.04", found[0], 0.0);
    for pair in found.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!((0.8..1.2).contains(&order), "order {order}: {found:?}");
    }
    assert!(found[0] < 1e-2, "{found:?}");
    let linear = relative_torque(false, 0.01);
    assert!(linear > 0.1, "unturned hexahedra resist the rotation: {linear:e}");
}

/// Share of the spin that is left after a quarter turn.
fn spin_left(steps: u32) -> f64 {
    let mut model = model(&block(Bbar, true));
    let rate = 100.0; // rad/s; far below the body's lowest frequency, so it hardly grows
    model.step.step = 0.5 * std::f64::consts::PI / rate / f64::from(steps);
    let centre = [0.0, 0.0, 0.5 * model.grid.thickness()];
    let mut start = displaced(&model, |_| [0.0; 3]);
    for (v, x) in start.v.iter_mut().zip(&model.rest) {
        *v = [-rate * (x[1] - centre[1]), rate * (x[0] - centre[0]), 0.0, 0.0];
    }
    let spin = |state: &Snapshot| -> f64 {
        (0..model.rest.len())
            .map(|n| {
                let x = add(model.rest[n], xyz(state.u[n]));
                model.dofs[n][3] * cross(x, xyz(state.v[n]))[2]
            })
            .sum()
    };
    let mut body = Body::new(&Platform::Cpu64, model.clone(), &start, 1e-10);
    for _ in 0..steps {
        body.step();
    }
    spin(&body.state()) / spin(&start)
}

fn spin() {
    let lost = [40, 80, 160].map(|steps| 1.0 - spin_left(steps));
    measured("spin lost in a quarter turn of 80 steps", lost[1], 0.0);
    for pair in lost.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!((0.8..1.2).contains(&order), "order {order}: {lost:?}");
    }
}
