//! Lumped, uniform and consistent masses: sums, free fall and momentum (`motion`), and a bar's lowest axial frequency.
//!
//! A bar of `n` equal hexahedra, ν 0, held along its axis at one end: hexahedra move as linear bar elements, so one step of implicit Euler on a
//! sine shape has a closed form for each mass, `ω² = 2 (1 − cos θ) k/m` and what follows from the mass matrix of a bar element:
//! lumped: `m = ρ A h`, θ = π/2n; consistent: the same divided by `(2 + cos θ)/3`; uniform, where the free end weighs as much as any other
//! plane of nodes: `m = ρ A L/(n + 1)`, θ = π/(2n + 1) (a chain of equal masses). The exact bar has `ω = (π/2L) √(E/ρ)`.
//! Sources: Archer 1963 (bar elements); Rayleigh 1877 (chain).

use super::setup::{Body, block, displaced, epsilon, measured, model, tolerance};
use super::{Case, Everywhere, small};
use cutis::bodies::Model;
use cutis::bodies::Wound;
use cutis::kernels::cut::Hit;
use cutis::scene::Element::Bbar;
use cutis::scene::Mass::{self, Consistent, Lumped, Uniform};
use cutis::step::Platform;
use std::f64::consts::PI;

pub const CASES: &[Case] = &[
    ("masses_sum_to_density_times_volume", sums),
    ("masses_follow_a_cut", cut_masses),
    ("consistent_mass_is_stiffer_than_lumped_mass", frequency_order),
];
pub const EVERYWHERE: &[Everywhere] = &[("axial_bar_has_its_masses_frequency", bar)];

pub const ALL: [Mass; 3] = [Lumped, Uniform, Consistent];

/// Hexahedra along the bar.
const COUNT: usize = 6;
// m, Pa, kg/m³
const LENGTH: f64 = 12e-3;
const YOUNG: f64 = 1e5;
const DENSITY: f64 = 1000.0;

fn bar_model(mass: Mass) -> Model {
    let mut scene = small::block([LENGTH, 1e-3], [COUNT as u32, 1], &[(1, 1e-3, YOUNG, 0.0, DENSITY)]);
    (scene.time.step, scene.time.gravity) = (0.6e-3, [0.0; 3]);
    let skin = &mut scene.skins[0];
    (skin.rayleigh_mass, skin.rayleigh_stiffness, skin.mass) = (0.0, 0.0, mass);
    let mut model = model(&scene);
    for (dofs, rest) in model.dofs.iter_mut().zip(&model.rest) {
        if rest[0] < -0.49 * LENGTH {
            dofs[0] = 0.0;
        }
    }
    model
}

/// ω² of the bar, rad²/s², and θ of its shape `sin kθ`.
fn closed_form(mass: Mass) -> [f64; 2] {
    let n = COUNT as f64;
    let (h, rate) = (LENGTH / n, YOUNG / DENSITY);
    let bar = |theta: f64| 2.0 * (1.0 - theta.cos()) * rate / (h * h);
    match mass {
        Lumped => [bar(PI / (2.0 * n)), PI / (2.0 * n)],
        Consistent => [bar(PI / (2.0 * n)) * 3.0 / (2.0 + (PI / (2.0 * n)).cos()), PI / (2.0 * n)],
        Uniform => [bar(PI / (2.0 * n + 1.0)) * (n + 1.0) / n, PI / (2.0 * n + 1.0)],
    }
}

/// Steps from the sine shape at rest; displacements of the free end, relative to the start.
fn swing(platform: &Platform, mass: Mass, theta: f64, steps: usize) -> Vec<f64> {
    const SIZE: f64 = 1e-5; // m
    let model = bar_model(mass);
    let h = LENGTH / COUNT as f64;
    let start = displaced(&model, |x| [SIZE * ((x[0] / LENGTH + 0.5) * LENGTH / h * theta).sin(), 0.0, 0.0]);
    let end = model.grid.nearest([0.5 * LENGTH, 0.5e-3, 1e-3]);
    let mut body = Body::new(platform, model, &start, tolerance(platform));
    let first = start.u[end][0];
    let mut one = || {
        body.step();
        body.state().u[end][0] / first
    };
    (0..steps).map(|_| one()).collect()
}

/// `(1 + ω²h²) u_{k+1} = 2 u_k − u_{k−1}`, from rest.
fn implicit_euler(omega_squared: f64, step: f64, steps: usize) -> Vec<f64> {
    let (mut before, mut now) = (1.0, 1.0);
    let mut next = || {
        (before, now) = (now, (2.0 * now - before) / (1.0 + omega_squared * step * step));
        now
    };
    (0..steps).map(|_| next()).collect()
}

const STEPS: usize = 6;

fn bar(platform: &Platform) {
    // each step's solve and rounding, carried on
    let bound = 10.0 * STEPS as f64 * (tolerance(platform) + 8.0 * epsilon(platform));
    let step = bar_model(Lumped).step.step;
    for mass in ALL {
        let [omega_squared, theta] = closed_form(mass);
        let found = swing(platform, mass, theta, STEPS);
        let off = |omega_squared: f64| {
            let exact = implicit_euler(omega_squared, step, STEPS);
            found.iter().zip(exact).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
        };
        measured(&format!("bar {platform:?} {mass:?}"), off(omega_squared), 0.0);
        assert!(off(omega_squared) < bound, "{platform:?} {mass:?}: {:e} above {bound:e}", off(omega_squared));
        // counter-test: the other masses are other bars
        for other in ALL.into_iter().filter(|m| *m != mass) {
            let [wrong, _] = closed_form(other);
            assert!(off(wrong) > 1e-3, "{platform:?} {mass:?} is also {other:?}: {:e}", off(wrong));
        }
    }
}

/// Consistent masses overestimate the exact frequency, lumped ones underestimate it; found from the first step.
fn frequency_order() {
    let step = bar_model(Lumped).step.step;
    let exact = (PI / (2.0 * LENGTH)).powi(2) * YOUNG / DENSITY;
    let [lumped, consistent] = [Lumped, Consistent].map(|mass| {
        let [_, theta] = closed_form(mass);
        (1.0 / swing(&Platform::Cpu64, mass, theta, 1)[0] - 1.0) / (step * step)
    });
    measured("bar, lumped ω² / exact", lumped / exact, 1.0);
    measured("bar, consistent ω² / exact", consistent / exact, 1.0);
    // both err by (πh/2L)²/12 to leading order
    let error = (PI / (2.0 * COUNT as f64)).powi(2) / 12.0;
    assert!((1.0 - lumped / exact - error).abs() < 0.1 * error, "{lumped} {exact}");
    assert!((consistent / exact - 1.0 - error).abs() < 0.1 * error, "{consistent} {exact}");
}

fn sums() {
    let mut scene = block(Bbar, true);
    scene.skins[0].layers[1].density = 1500.0;
    let [x, y] = scene.skins[0].size;
    let exact: f64 = scene.skins[0].layers.iter().map(|l| l.density * l.thickness * x * y).sum();
    for mass in ALL {
        scene.skins[0].mass = mass;
        let model = model(&scene);
        let sum: f64 = model.dofs.iter().map(|f| f[3]).sum();
        assert!((sum / exact - 1.0).abs() < 1e-14, "{mass:?}: {sum}, wanted {exact}");
        let alike = model.dofs.iter().all(|f| f[3] == model.dofs[0][3]);
        assert_eq!(alike, mass == Uniform, "{mass:?}");
    }
}

/// Severs the link between two neighbouring cells: one of them goes, with an eighth of its mass at each corner, or with none.
fn cut_masses() {
    for mass in ALL {
        let mut scene = block(Bbar, true);
        scene.skins[0].mass = mass;
        let model = model(&scene);
        let mut wound = Wound::new(&model);
        let removal = wound.apply(&model, &[Hit { segment: 0, at: 0.25 }]);
        assert_eq!(removal.cells, [0]);
        let total = |dofs: &[[f64; 4]]| dofs.iter().map(|f| f[3]).sum::<f64>();
        let lost = total(&model.dofs) - total(&wound.dofs);
        // the corner node of the grid leaves with what it had
        let corner = model.dofs[0][3];
        let wanted = if mass == Uniform { corner } else { 8.0 * model.shape[0][3] };
        assert!((lost / wanted - 1.0).abs() < 1e-9, "{mass:?}: {lost} kg, wanted {wanted}");
        assert_eq!(wound.dofs[0], [0.0; 4], "{mass:?}");
        assert!(wound.dofs[1][3] > 0.0);
    }
}
