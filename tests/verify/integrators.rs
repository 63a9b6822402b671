//! Integrators: each follows its textbook recurrence, has its order, its energy and its numerical damping; symplectic Euler blows up where
//! theory says and not before.
//!
//! One vibration with closed forms: a column of one cell between smooth walls, its top moving up and down as one. With `M_o` the oedometer
//! modulus, `k = M_o A/t` (and the stiffness of the rest-shape springs), `m = ρ A t/2` lumped or `ρ A t/3` consistent, `c = r_M m + r_K k`.

use super::setup::{
    Body, Random, apart as far, block, displaced, dot, epsilon, in_long_steps, measured, model, tolerance, xyz,
};
use super::skin_block::{Grid, on_grid, static_answer};
use super::small::held;
use super::{Case, Everywhere};
use cutis::backend::Snapshot;
use cutis::bodies::{Model, elastic_energy};
use cutis::error::Error;
use cutis::math::norm;
use cutis::report::inspect::inspect;
use cutis::scene::Element::Bbar;
use cutis::scene::Integrator::{self, ImplicitEuler, Midpoint, Newmark, Static, SymplecticEuler};
use cutis::scene::{Mass, Preconditioner, Region, RestSpring, Scene};
use cutis::step::{Platform, Refused, Simulation};

pub const EVERYWHERE: &[Everywhere] = &[
    ("each_integrator_follows_its_textbook_recurrence", recurrences),
    ("newmark_takes_consistent_masses_and_rest_springs", newmark_varieties),
    ("true_residual_knows_each_integrator", true_residuals),
];
pub const CASES: &[Case] = &[
    ("integrators_have_their_orders", orders),
    ("integrators_damp_a_period_as_theory_says", damping),
    ("newmark_keeps_the_energy_of_a_linear_body", newmark_energy),
    ("symplectic_energy_swings_and_does_not_drift", symplectic_energy),
    ("explicit_steps_blow_up_where_theory_says", stable_steps),
    ("unstable_steps_are_refused_with_the_stable_one", refused_steps),
    ("an_explicit_body_has_nothing_to_solve", nothing_to_solve),
    ("integrators_leave_a_released_block_its_energy_or_not", released),
];

const ALL: [Integrator; 3] = [ImplicitEuler, Newmark, SymplecticEuler];

/// The one-cell column, and what it vibrates with.
struct Column {
    scene: Scene,
    /// N/m
    k: f64,
    /// kg
    m: f64,
    /// N·s/m
    c: f64,
    /// N, upward
    load: f64,
}

const DRAG: f64 = 20.0; // 1/s
const VISCOSITY: f64 = 1e-4; // s
const GRAVITY: f64 = -3.0; // m/s²
const THICKNESS: f64 = 2e-3; // m
const REST_SPRINGS: f64 = 7.0; // N/m at each of four nodes

fn column(integrator: Integrator, mass: Mass, on_rest_springs: bool, damped: bool) -> Column {
    let mut scene = block(Bbar, false);
    let skin = &mut scene.skins[0];
    (skin.cells, skin.size, skin.mass) = ([1, 1], [3e-3, 4e-3], mass);
    skin.layers.truncate(1);
    let layer = &mut skin.layers[0];
    (layer.thickness, layer.cells) = (THICKNESS, 1);
    (skin.rayleigh_mass, skin.rayleigh_stiffness) = if damped { (DRAG, VISCOSITY) } else { (0.0, 0.0) };
    let (young, poisson, density) = (layer.young, layer.poisson, layer.density);
    scene.time.integrator = integrator;
    scene.time.gravity = if damped { [0.0, 0.0, GRAVITY] } else { [0.0; 3] };
    scene.boundaries = vec![held(Region::Bottom, [true; 3]), held(Region::All, [true, true, false])];
    if on_rest_springs {
        scene.rest_springs = vec![RestSpring { body: 0, region: Region::Top, stiffness: REST_SPRINGS }];
    }
    scene.solver.preconditioner = Preconditioner::Column;
    let oedometer = young * (1.0 - poisson) / ((1.0 + poisson) * (1.0 - 2.0 * poisson));
    let area = 3e-3 * 4e-3;
    let k = oedometer * area / THICKNESS + if on_rest_springs { 4.0 * REST_SPRINGS } else { 0.0 };
    let whole = density * area * THICKNESS;
    let m = if mass == Mass::Consistent { whole / 3.0 } else { whole / 2.0 };
    let c = if damped { DRAG * m + VISCOSITY * k } else { 0.0 };
    let load = if damped { GRAVITY * whole / 2.0 } else { 0.0 };
    Column { scene, k, m, c, load }
}

impl Column {
    fn omega(&self) -> f64 {
        (self.k / self.m).sqrt()
    }

    /// Height of the top after each step from `(u, v)`.
    fn run(&self, platform: &Platform, h: f64, start: [f64; 2], steps: usize) -> Vec<[f64; 2]> {
        let mut scene = self.scene.clone();
        scene.time.step = h;
        let model = model(&scene);
        let top = model.grid.nearest([0.0, 0.0, THICKNESS]);
        let field = |value: f64| displaced(&model, |x| [0.0, 0.0, if x[2] > 0.5 * THICKNESS { value } else { 0.0 }]).u;
        let start = Snapshot { u: field(start[0]), v: field(start[1]), ..Snapshot::default() };
        let mut body = Body::new(platform, model, &start, tolerance(platform));
        let mut one = || {
            body.step();
            let state = body.state();
            [state.u[top][2], state.v[top][2]]
        };
        (0..steps).map(|_| one()).collect()
    }

    /// The same by the textbook: Newmark with its stored acceleration, the Euler schemes in their velocities.
    fn textbook(&self, integrator: Integrator, h: f64, start: [f64; 2], steps: usize) -> Vec<[f64; 2]> {
        let (k, m, c, f) = (self.k, self.m, self.c, self.load);
        let [mut u, mut v] = start;
        let mut a = (f - c * v - k * u) / m;
        let mut one = || {
            match integrator {
                ImplicitEuler => {
                    v = (m * v + h * (f - k * u)) / (m + h * c + h * h * k);
                    u += h * v;
                }
                Newmark | Midpoint => {
                    let (beta, gamma) = (0.25, 0.5);
                    let far = u + h * v + h * h * (0.5 - beta) * a;
                    let fast = v + h * (1.0 - gamma) * a;
                    a = (f - c * fast - k * far) / (m + gamma * h * c + beta * h * h * k);
                    u = far + beta * h * h * a;
                    v = fast + gamma * h * a;
                }
                SymplecticEuler => {
                    v += h * (f - k * u - c * v) / m;
                    u += h * v;
                }
                Static => (u, v) = (f / k, 0.0),
            }
            [u, v]
        };
        (0..steps).map(|_| one()).collect()
    }
}

/// Largest distance of two trajectories, displacements in units of `size`, velocities of `size ω`.
fn apart(a: &[[f64; 2]], b: &[[f64; 2]], size: f64, omega: f64) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a[0] - b[0]).abs().max((a[1] - b[1]).abs() / omega) / size).fold(0.0, f64::max)
}

/// m
const SIZE: f64 = 1e-5;

fn follows(platform: &Platform, column: &Column, integrator: Integrator) {
    const STEPS: usize = 40;
    let omega = column.omega();
    let (h, start) = (0.3 / omega, [SIZE, 0.4 * SIZE * omega]);
    let found = column.run(platform, h, start, STEPS);
    let wanted = column.textbook(integrator, h, start, STEPS);
    let error = apart(&found, &wanted, SIZE, omega);
    measured(&format!("recurrence {platform:?} {integrator:?}"), error, 0.0);
    // a step's rounding and its solve's tolerance, carried on; velocities are differences of displacements over h ω = 0.3
    let bound = STEPS as f64 * 20.0 * (tolerance(platform) + 8.0 * epsilon(platform));
    assert!(error < bound, "{platform:?} {integrator:?}: {error:e} above {bound:e}");
    // counter-test: no other integrator is this one
    for other in ALL.into_iter().filter(|o| *o != integrator) {
        let error = apart(&found, &column.textbook(other, h, start, STEPS), SIZE, omega);
        assert!(error > 0.05, "{integrator:?} passes for {other:?}: {error}");
    }
}

fn recurrences(platform: &Platform) {
    for integrator in ALL {
        follows(platform, &column(integrator, Mass::Lumped, false, true), integrator);
    }
    // a uniform mass puts half of the body on the moving top, as lumping does
    follows(platform, &column(SymplecticEuler, Mass::Uniform, true, true), SymplecticEuler);
}

fn newmark_varieties(platform: &Platform) {
    for (mass, on_rest_springs) in [(Mass::Consistent, false), (Mass::Lumped, true)] {
        follows(platform, &column(Newmark, mass, on_rest_springs, true), Newmark);
    }
}

/// The column's exact motion from `(u, v)` after a time.
fn exact(column: &Column, start: [f64; 2], time: f64) -> f64 {
    let (rest, damping) = (column.load / column.k, 0.5 * column.c / column.m);
    let swing = (column.omega().powi(2) - damping * damping).sqrt();
    let [u, v] = [start[0] - rest, start[1]];
    rest + (-damping * time).exp() * (u * (swing * time).cos() + (v + damping * u) / swing * (swing * time).sin())
}

fn orders() {
    for (integrator, order) in [(ImplicitEuler, 1.0), (Newmark, 2.0), (SymplecticEuler, 1.0)] {
        let column = column(integrator, Mass::Lumped, false, true);
        let start = [SIZE, 0.4 * SIZE * column.omega()];
        let time = 2.0 / column.omega();
        let error = |steps: usize| {
            let last = column.run(&Platform::Cpu64, time / steps as f64, start, steps)[steps - 1][0];
            (last - exact(&column, start, time)).abs() / SIZE
        };
        let errors = [40, 80, 160].map(error);
        for pair in errors.windows(2) {
            let found = (pair[0] / pair[1]).log2();
            measured(&format!("order of {integrator:?}"), found, order);
            assert!((found - order).abs() < 0.1, "{integrator:?}: order {found}, errors {errors:?}");
        }
    }
}

/// Amplitude `√(u² + (v/ω)²)` left per step by theory, squared, and the angle of a step.
fn theory(integrator: Integrator, z: f64) -> (f64, f64) {
    match integrator {
        ImplicitEuler => (1.0 / (1.0 + z * z), z.atan()),
        Newmark | Midpoint => (1.0, 2.0 * (0.5 * z).atan()),
        SymplecticEuler => (1.0, 2.0 * (0.5 * z).asin()),
        Static => unreachable!("nothing vibrates"),
    }
}

fn damping() {
    for integrator in ALL {
        let column = column(integrator, Mass::Lumped, false, false);
        let omega = column.omega();
        for z in [0.05, 0.1, 0.5, 1.0] {
            let steps = 200;
            let run = column.run(&Platform::Cpu64, z / omega, [SIZE, 0.0], steps);
            // u_{n+1} = s u_n − p u_{n−1}: p the square of a step's factor, s twice its cosine; by least squares over the run
            let u: Vec<f64> = run.iter().map(|s| s[0]).collect();
            let (p, s) = recurrence(&u[..steps.min((60.0 / z) as usize)]);
            let (wanted, angle) = theory(integrator, z);
            let found = (s / (2.0 * p.sqrt())).clamp(-1.0, 1.0).acos();
            measured(&format!("{integrator:?} z {z}: amplitude squared per step"), p, wanted);
            measured(&format!("{integrator:?} z {z}: angle of a step"), found, angle);
            let period = std::f64::consts::TAU / angle;
            measured(&format!("{integrator:?} z {z}: lost in a period"), 1.0 - p.powf(0.5 * period), 0.0);
            assert!((p - wanted).abs() < 1e-6, "{integrator:?} at z {z}: {p}, wanted {wanted}");
            assert!((found - angle).abs() < 1e-6, "{integrator:?} at z {z}: {found}, wanted {angle}");
            // counter-test: the true vibration is told from each of them
            assert!((angle - z).abs() > 1e-6);
        }
    }
}

fn recurrence(u: &[f64]) -> (f64, f64) {
    let (mut aa, mut ab, mut bb, mut ay, mut by) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for w in u.windows(3) {
        let (b, a, y) = (w[0], w[1], w[2]);
        aa += a * a;
        ab += a * b;
        bb += b * b;
        ay += a * y;
        by += b * y;
    }
    let determinant = aa * bb - ab * ab;
    let s = (ay * bb - by * ab) / determinant;
    let p = -(by * aa - ay * ab) / determinant;
    (p, s)
}

/// A small linear body without damping, its bottom held, started at random.
fn lively(integrator: Integrator) -> (Model, Snapshot) {
    let mut scene = block(Bbar, false);
    scene.skins[0].cells = [2, 2];
    scene.time.integrator = integrator;
    scene.solver.preconditioner = Preconditioner::Column;
    scene.boundaries = vec![held(Region::Bottom, [true; 3])];
    let model = model(&scene);
    let mut start = displaced(&model, |_| [0.0; 3]);
    (start.u, start.v) = (Random::new(3).field(model.rest.len(), 1e-6), Random::new(4).field(model.rest.len(), 1e-3));
    for (i, dofs) in model.dofs.iter().enumerate() {
        for n in 0..3 {
            start.u[i][n] *= dofs[n];
            start.v[i][n] *= dofs[n];
        }
    }
    (model, start)
}

fn kinetic(model: &Model, state: &Snapshot) -> f64 {
    state.v.iter().zip(&model.dofs).map(|(v, dofs)| 0.5 * dofs[3] * dot(xyz(*v), xyz(*v))).sum()
}

fn energy(model: &Model, state: &Snapshot) -> f64 {
    kinetic(model, state) + elastic_energy(model, state, &state.rotation)
}

/// Energies of the state every so many steps, relative to the first.
fn energies(model: Model, start: &Snapshot, steps: usize, every: usize) -> Vec<f64> {
    let mut body = Body::new(&Platform::Cpu64, model, start, 1e-11);
    let first = body.state();
    let first = energy(&body.model, &first);
    let mut out = vec![];
    for step in 1..=steps {
        body.step();
        if step % every == 0 {
            let state = body.state();
            out.push(energy(&body.model, &state) / first);
        }
    }
    out
}

fn newmark_energy() {
    let (mut model, start) = lively(Newmark);
    model.step.step = 2e-4;
    let drift = energies(model, &start, 10_000, 100).iter().map(|e| (e - 1.0).abs()).fold(0.0, f64::max);
    measured("Newmark: energy drift over 10,000 steps", drift, 0.0);
    // each solve leaves 1e-11 of the load; what it leaves has any sign
    assert!(drift < 1e-8, "{drift:e}");
    // counter-test: implicit Euler loses nearly all in a few steps
    let (mut model, start) = lively(ImplicitEuler);
    model.step.step = 2e-4;
    let left = energies(model, &start, 50, 50)[0];
    measured("implicit Euler: energy left after 50 steps", left, 0.0);
    assert!(left < 0.1, "{left}");
}

fn symplectic_energy() {
    let (mut model, start) = lively(SymplecticEuler);
    let h = 0.5 * model.stable_step();
    model.step.step = h;
    let mut body = Body::new(&Platform::Cpu64, model, &start, 1e-11);
    // E − h/2 v·K u is kept exactly; where h ω ≤ 1 it differs from E by at most h ω/2 of it
    let kept = |body: &mut Body| {
        let state = body.state();
        let force = body.forces();
        let power: f64 = force.iter().zip(&state.v).map(|(f, v)| dot(*f, xyz(*v))).sum();
        let energy = energy(&body.model, &state);
        [energy, energy - 0.5 * h * power]
    };
    let first = kept(&mut body);
    let (mut low, mut high, mut drift) = (f64::INFINITY, 0.0f64, 0.0f64);
    for step in 1..=10_000 {
        body.step();
        if step % 10 == 0 {
            let [energy, shadow] = kept(&mut body);
            (low, high) = (low.min(energy / first[1]), high.max(energy / first[1]));
            drift = drift.max((shadow / first[1] - 1.0).abs());
        }
    }
    measured("symplectic: lowest energy over the kept quantity", low, 2.0 / 3.0);
    measured("symplectic: highest", high, 2.0);
    measured("symplectic: drift of the kept quantity over 10,000 steps", drift, 0.0);
    assert!(drift < 1e-10, "{drift:e}");
    assert!(low > 2.0 / 3.0 && high < 2.0, "{low} to {high}");
    // counter-test: the energy itself is not kept
    assert!(high - low > 1e-3, "{low} to {high}");
}

/// Whether a run from a random start stays bounded.
fn bounded(model: &Model, start: &Snapshot, h: f64) -> bool {
    let mut model = model.clone();
    model.step.step = h;
    let mut body = Body::new(&Platform::Cpu64, model, start, 1e-11);
    let first = energy(&body.model, start);
    for _ in 0..20 {
        for _ in 0..100 {
            body.step();
        }
        let state = body.state();
        // within 1 % of the limit energy may swing a hundredfold; what grows at all passes any bound in 2000 steps
        let now = kinetic(&body.model, &state);
        if !now.is_finite() || now > 1e6 * first {
            return false;
        }
    }
    true
}

fn boundary(model: &Model, start: &Snapshot, [mut low, mut high]: [f64; 2]) -> f64 {
    assert!(bounded(model, start, low) && !bounded(model, start, high), "the bracket {low:e}, {high:e} holds no limit");
    while high / low > 1.001 {
        let middle = 0.5 * (low + high);
        if bounded(model, start, middle) { low = middle } else { high = middle }
    }
    low
}

fn stable_steps() {
    let (model, mut start) = lively(SymplecticEuler);
    start.rotation = vec![[0.0, 0.0, 0.0, 1.0]; model.grid.cell_count()];
    let omega = model.largest_frequency_squared().sqrt();
    let undamped = model.stable_step();
    assert!((undamped * omega / 2.0 - 1.0).abs() < 1e-12);
    for (drag, viscosity) in [(0.0, 0.0), (0.5 * omega, 0.0), (0.0, 1.0 / omega), (0.3 * omega, 0.4 / omega)] {
        let mut model = model.clone();
        (model.step.rayleigh_mass, model.step.rayleigh_stiffness) = (drag, viscosity);
        let theory = model.stable_step();
        let found = boundary(&model, &start, [0.7 * theory, 1.4 * theory]);
        measured(&format!("stable step, r_M {drag:.3e} 1/s, r_K {viscosity:.3e} s"), found, theory);
        assert!((found / theory - 1.0).abs() < 0.01, "r_M {drag:e}, r_K {viscosity:e}: {found:e}, theory {theory:e}");
        // counter-test: the limit without damping is another one
        assert!(drag + viscosity == 0.0 || (found / undamped - 1.0).abs() > 0.1, "{found:e}");
    }
}

fn refused_steps() {
    let mut scene = block(Bbar, true);
    (scene.time.integrator, scene.time.step) = (SymplecticEuler, 1e-3);
    let Err(error) = Simulation::new(&scene, &Platform::Cpu64) else { panic!("1 ms is not stable") };
    assert_eq!(error.exit_code(), 2);
    let Error::Step(Refused::UnstableStep { stable_ms, step_ms, substeps, .. }) = &error else { panic!("{error}") };
    let stable = 1e3 * model(&scene).stable_step();
    assert!((stable_ms / stable - 1.0).abs() < 1e-9 && *step_ms == 1.0, "{error}");
    assert!(error.to_string().contains("substeps"), "{error}");
    scene.time.substeps = *substeps as u32;
    let mut run = Simulation::new(&scene, &Platform::Cpu64).unwrap_or_else(|e| panic!("{e}"));
    let report = run.step(true).unwrap_or_else(|e| panic!("{e}"));
    assert!(report.warnings.is_empty(), "{:?}", report.warnings);
    scene.time.substeps -= 1;
    assert!(Simulation::new(&scene, &Platform::Cpu64).is_err(), "one part fewer is not stable");
}

fn nothing_to_solve() {
    let mut scene = block(Bbar, true);
    scene.solver.preconditioner = Preconditioner::Multigrid;
    let size = |scene: &Scene| {
        let body = Body::new(&Platform::Cpu64, model(scene), &displaced(&model(scene), |_| [0.0; 3]), 1e-9);
        (body.model.hexahedra().multigrid.is_some(), body.bytes())
    };
    let names = |scene: &Scene| {
        let plan = inspect(scene).unwrap_or_else(|e| panic!("{e}"));
        let vectors = plan.arrays.iter().filter(|a| ["p", "s", "z", "w", "d"].contains(&a.name)).count();
        (vectors, plan.kernels.contains(&"product"), plan.kernels.contains(&"accelerate"))
    };
    assert!(matches!(names(&scene), (5.., true, false)), "{:?}", names(&scene));
    let implicit = size(&scene);
    scene.time.integrator = SymplecticEuler;
    let explicit = size(&scene);
    assert_eq!(names(&scene), (0, false, true));
    assert!(implicit.0 && !explicit.0);
    // four of the solver's vectors in f64, and four words a node of the V-cycle's columns in f32
    let nodes = model(&scene).node_count() as u64;
    assert!(implicit.1 - explicit.1 >= (4 * 32 + 4 * 16) * nodes, "{implicit:?} {explicit:?}");
}

fn true_residuals(platform: &Platform) {
    let varieties = [
        (ImplicitEuler, Preconditioner::Multigrid, 0),
        (Newmark, Preconditioner::Multigrid, 0),
        (Newmark, Preconditioner::Column, 3),
        (SymplecticEuler, Preconditioner::None, 0),
    ];
    for (integrator, preconditioner, refinements) in varieties {
        for corotational in [false, true].into_iter().filter(|corotational| !corotational || integrator != Newmark) {
            let mut scene = block(Bbar, corotational);
            let skin = &mut scene.skins[0];
            (skin.rayleigh_mass, skin.rayleigh_stiffness, skin.velocity) = (3.0, 1e-6, [0.1, 0.0, 0.2]);
            scene.boundaries = vec![held(Region::Bottom, [true; 3])];
            scene.rest_springs = vec![RestSpring { body: 0, region: Region::Top, stiffness: 2.0 }];
            (scene.time.integrator, scene.time.gravity) = (integrator, [0.0, 0.0, -9.81]);
            (scene.solver.preconditioner, scene.solver.refinements) = (preconditioner, refinements);
            scene.solver.tolerance = 10.0 * tolerance(platform);
            scene.time.step = if integrator == SymplecticEuler { 0.5 * model(&scene).stable_step() } else { 1e-3 };
            let mut run = Simulation::new(&scene, platform).unwrap_or_else(|e| panic!("{e}"));
            for _ in 0..3 {
                let report = run.step(true).unwrap_or_else(|e| panic!("{e}"));
                let residual = report.true_residual.unwrap_or(f64::NAN);
                measured(&format!("true residual {platform:?} {integrator:?} {preconditioner:?}"), residual, 0.0);
                let bound = 100.0 * tolerance(platform);
                assert!(residual < bound, "{platform:?} {integrator:?} {preconditioner:?}: {residual:e}");
                assert!(report.warnings.is_empty(), "{platform:?} {integrator:?}: {:?}", report.warnings);
            }
        }
    }
}

/// The skin block one millisecond after its load is let go, undamped: displacements, the energy left, and seconds per step.
fn release(model: &Model, start: &Snapshot, integrator: Integrator, steps: u32) -> (Vec<[f64; 4]>, f64, f64) {
    let mut model = model.clone();
    (model.step.integrator, model.step.step) = (integrator, 1e-3 / f64::from(steps));
    if integrator == SymplecticEuler {
        model.hexahedra_mut().multigrid = None;
    }
    let mut body = Body::new(&Platform::Cpu64, model, start, 1e-6);
    let first = body.state();
    let first = energy(&body.model, &first);
    let clock = std::time::Instant::now();
    (0..steps).for_each(|_| body.step());
    let seconds = clock.elapsed().as_secs_f64() / f64::from(steps);
    let state = body.state();
    let left = energy(&body.model, &state) / first;
    (state.u, left, seconds)
}

fn released() {
    let mut scene = on_grid(in_long_steps("verify/skin_block_045.toml"), Grid::Coarse, Bbar);
    scene.time.gravity = [0.0; 3];
    let (mut model, u) = static_answer(&Platform::Cpu64, &scene, 1e-8);
    (model.step.rayleigh_mass, model.step.rayleigh_stiffness) = (0.0, 0.0);
    let start = Snapshot { u, ..displaced(&model, |_| [0.0; 3]) };
    let stable = (1e-3 / model.stable_step()).ceil() as u32;
    let (exact, _, _) = release(&model, &start, SymplecticEuler, 4 * stable);
    let share = norm(&exact) / norm(&start.u);
    let (_, _, unit) = release(&model, &start, ImplicitEuler, 8);
    let row = |integrator, steps: u32| {
        let (u, left, seconds) = release(&model, &start, integrator, steps);
        let error = far(&u, &exact) * share;
        let what = format!("release, {integrator:?}, {steps} steps in 1 ms");
        measured(&format!("{what}: energy left"), left, 1.0);
        measured(&format!("{what}: error, of the start's displacement"), error, 0.0);
        measured(&format!("{what}: time of a step, of implicit Euler's at 8"), seconds / unit, 0.0);
        [left, error]
    };
    let euler = [1, 8, 64].map(|steps| row(ImplicitEuler, steps));
    let newmark = [1, 8, 64].map(|steps| row(Newmark, steps));
    let symplectic = row(SymplecticEuler, stable);
    // 97 % of the energy goes in one step of 1 ms, and much of it at any step that skin is run at
    assert!(euler[0][0] < 0.03 && euler[2][0] < 0.9, "{euler:?}");
    assert!(newmark.iter().all(|n| (n[0] - 1.0).abs() < 1e-3), "{newmark:?}");
    assert!((symplectic[0] - 1.0).abs() < 0.05, "{symplectic:?}");
    assert!(newmark[2][1] < 0.5 * euler[2][1] && symplectic[1] < newmark[2][1], "{euler:?} {newmark:?} {symplectic:?}");
}
