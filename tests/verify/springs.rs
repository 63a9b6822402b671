//! The spring body against the oscillator's and the truss's closed forms.
//!
//! One cell, bottom held, top free along z alone. Without its diagonals it is four equal oscillators: implicit Euler multiplies each
//! eigenvector of `u'' = −(k u + c u')/m` by `1/(1 − h μ)`, so `u_n = Re(2 α z₊ⁿ)`. With them, a uniform pull stretches 4 uprights, 8 face
//! and 4 space diagonals: `F(w) = Σ k (l − L) (a + w)/l`.

use super::setup::{Body, LONG, block, displaced, epsilon, measured, model, tolerance};
use super::{Case, Everywhere};
use cutis::bodies::Model;
use cutis::scene::Element::Plain;
use cutis::scene::{Law, Preconditioner};
use cutis::step::Platform;

pub const EVERYWHERE: &[Everywhere] = &[
    ("oscillator_follows_implicit_eulers_closed_form", oscillator),
    ("pulled_spring_cell_stretches_as_the_truss", pulled_truss),
];
pub const CASES: &[Case] = &[
    ("undamped_period_is_two_pi_root_m_over_k", period),
    ("oscillator_sees_one_percent_of_stiffness", wrong_stiffness),
];

const STIFFNESS: f64 = 100.0; // N/m
const EDGE: [f64; 3] = [2e-3, 1.5e-3, 1.0e-3]; // m

/// One cell whose top moves along z only; `diagonals` keeps the springs that are no edges along z.
fn cell(damping: f64, diagonals: bool) -> Model {
    let mut scene = block(Plain, false);
    scene.skins[0].law = Law::Springs { stiffness: Some(STIFFNESS), damping };
    scene.solver.preconditioner = Preconditioner::Column;
    scene.skins[0].size = [EDGE[0], EDGE[1]];
    scene.skins[0].cells = [1, 1];
    scene.skins[0].layers.truncate(1);
    (scene.skins[0].layers[0].thickness, scene.skins[0].layers[0].cells) = (EDGE[2], 1);
    let mut model = model(&scene);
    for node in 0..8 {
        let top = if node < 4 { 0.0 } else { 1.0 };
        model.dofs[node][..3].copy_from_slice(&[0.0, 0.0, top]);
    }
    if let (Some(springs), false) = (model.springs_mut(), diagonals) {
        for (ends, law) in springs.ends.iter().zip(&mut springs.law) {
            if ends[1] - ends[0] != 4 {
                (law[1], law[2]) = (0.0, 0.0);
            }
        }
    }
    model
}

/// m
const START: f64 = 2e-5;

/// Largest departure of 50 steps from `u_n = Re(2 α z₊ⁿ)` with the stiffness `k`, relative to the start.
fn departure(platform: &Platform, damping: f64, k: f64) -> f64 {
    const STEPS: usize = 50;
    let mut model = cell(damping, false);
    let mass = model.dofs[7][3];
    let natural = (STIFFNESS / mass).sqrt();
    let h = 0.2 / natural;
    model.step.step = h;
    let start = displaced(&model, |x| [0.0, 0.0, if x[2] > 0.0 { START } else { 0.0 }]);
    let mut body = Body::new(platform, model, &start, tolerance(platform));
    // eigenvalues μ = −d ± i w
    let d = damping / (2.0 * mass);
    let w = (k / mass - d * d).sqrt();
    // 1/(1 − hμ₊) in polar form; α = u₀ (d + i w)/(2 i w), for a start at rest
    let (re, im) = (1.0 + h * d, h * w);
    let (size, turn) = (1.0 / re.hypot(im), im.atan2(re));
    let mut worst = 0.0f64;
    for n in 1..=STEPS {
        body.step();
        let angle = turn * n as f64;
        let exact = START * size.powi(n as i32) * (angle.cos() + d / w * angle.sin());
        for u in &body.state().u[4..] {
            worst = worst.max((u[2] - exact).abs() / START);
        }
    }
    worst
}

fn oscillator(platform: &Platform) {
    let mass = cell(0.0, false).dofs[7][3];
    let critical = 2.0 * (STIFFNESS * mass).sqrt();
    for damping in [0.0, 0.3 * critical] {
        let error = departure(platform, damping, STIFFNESS);
        // a step's solve ends at `tolerance`; a spring's length rounds at 1 mm while 20 µm are measured: 50 roundings and some steps of it
        let bound = 100.0 * tolerance(platform) + 1e4 * epsilon(platform);
        measured(&format!("oscillator {platform:?} c {damping:.1e}"), error, 0.0);
        assert!(error < bound, "{platform:?}, c = {damping}: {error:e} above {bound:e}");
    }
}

fn wrong_stiffness() {
    let error = departure(&Platform::Cpu64, 0.0, 1.01 * STIFFNESS);
    assert!(error > 1e-3, "{error:e}");
}

fn period() {
    let mut model = cell(0.0, false);
    let mass = model.dofs[7][3];
    let exact = 2.0 * std::f64::consts::PI * (mass / STIFFNESS).sqrt();
    // implicit Euler turns by atan(ωh) a step: the period is long by (ωh)²/3 = 5e-5
    let h = exact / 500.0;
    model.step.step = h;
    let start = displaced(&model, |x| [0.0, 0.0, if x[2] > 0.0 { START } else { 0.0 }]);
    let mut body = Body::new(&Platform::Cpu64, model, &start, 1e-12);
    let (mut crossings, mut last) = (vec![], START);
    for n in 1..1200 {
        body.step();
        let u = body.state().u[7][2];
        if (u < 0.0) != (last < 0.0) {
            crossings.push(h * (n as f64 - u / (u - last)));
        }
        last = u;
    }
    let found = crossings[2] - crossings[0];
    measured("spring period / s", found, exact);
    assert!((found / exact - 1.0).abs() < 1e-4, "{found:e} s, wanted {exact:e} s");
    assert!(crossings.len() == 5, "{crossings:?}");
}

/// Force that stretches the cell by `w`, N.
fn truss(w: f64) -> f64 {
    let [x, y, z] = EDGE;
    let part = |count: f64, across: f64| {
        let (rest, now) = (z.hypot(across), (z + w).hypot(across));
        count * STIFFNESS * (now - rest) * (z + w) / now
    };
    part(4.0, 0.0) + part(4.0, x) + part(4.0, y) + part(4.0, x.hypot(y))
}

fn pulled_truss(platform: &Platform) {
    let mut model = cell(1.0, true);
    model.step.step = LONG;
    for stretch in [0.4 * EDGE[2], -0.15 * EDGE[2]] {
        let pull = truss(stretch);
        let load: Vec<[f64; 3]> = (0..8).map(|n| [0.0, 0.0, if n < 4 { 0.0 } else { pull / 4.0 }]).collect();
        let start = displaced(&model, |_| [0.0; 3]);
        let mut body = Body::new(platform, model.clone(), &start, tolerance(platform));
        body.load(&load);
        // Newton, or with clamped tangents a contraction by about 3 a step
        for _ in 0..40 {
            body.step();
        }
        let found = body.state().u[7][2];
        let error = (found / stretch - 1.0).abs();
        measured(&format!("truss {platform:?} / m"), found, stretch);
        assert!(error < 100.0 * tolerance(platform), "{found:e} m, wanted {stretch:e} m");
        let other = truss(stretch * 1.01);
        assert!((other / pull - 1.0).abs() > 1e-3, "the load tells 1 % of stretch apart");
    }
}
