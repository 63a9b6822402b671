//! Mooney–Rivlin hexahedra: a bar that is pulled and pressed, against the law in principal stretches, and against Mooney's own formula.

use super::Everywhere;
use super::setup::{measured, pulled};
use cutis::scene::{Layer, Material};
use cutis::step::Platform;

pub const EVERYWHERE: &[Everywhere] = &[("mooney_rivlin_bar_follows_its_uniaxial_curve", bar)];

/// c₁₀ and c₀₁, Pa.
const C: [f64; 2] = [6e3, 4e3];

/// Nominal stress along a bar of stretch `a` that is free beside, Pa: `W = c₁₀ (J^(−2/3) I₁ − 3) + c₀₁ (J^(−4/3) I₂ − 3) + κ/2 ln² J` with the
/// stretches `a, b, b`, `b` where the stress across vanishes.
fn uniaxial(a: f64, bulk: f64) -> f64 {
    let stress = |b: f64| {
        let (j, i1, i2) = (a * b * b, a * a + 2.0 * b * b, 2.0 * a * a * b * b + b.powi(4));
        let (p, q) = (j.powf(-2.0 / 3.0), j.powf(-4.0 / 3.0));
        let volume = bulk * j.ln();
        let along = C[0] * p * (2.0 * a - 2.0 / 3.0 * i1 / a) + C[1] * q * (4.0 * a * b * b - 4.0 / 3.0 * i2 / a);
        let across = C[0] * p * (2.0 * b - 2.0 / 3.0 * i1 / b)
            + C[1] * q * (2.0 * a * a * b + 2.0 * b.powi(3) - 4.0 / 3.0 * i2 / b);
        [along + volume / a, across + volume / b]
    };
    let (mut low, mut high) = (0.2, 3.0);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if stress(middle)[1] < 0.0 { low = middle } else { high = middle }
    }
    stress(0.5 * (low + high))[0]
}

/// Nominal stress of a bar of these constants at small strain, pulled along z, Pa.
fn found(platform: &Platform, material: Material, stretch: f64, bulk: f64) -> f64 {
    let shear = 2.0 * (C[0] + C[1]);
    let poisson = (3.0 * bulk - 2.0 * shear) / (2.0 * (3.0 * bulk + shear));
    let young = 2.0 * shear * (1.0 + poisson);
    let layer = Layer { young, poisson, second_share: C[1] / (C[0] + C[1]), ..Layer::default() };
    pulled(platform, material, &layer, 2, stretch)
}

fn bar(platform: &Platform) {
    let bulk = 50.0 * 2.0 * (C[0] + C[1]);
    for stretch in [0.6, 0.95, 1.3, 2.0] {
        let (here, wanted) = (found(platform, Material::MooneyRivlin, stretch, bulk), uniaxial(stretch, bulk));
        measured(&format!("Mooney–Rivlin bar {platform:?} at {stretch} / Pa"), here, wanted);
        let bound = if *platform == Platform::Cpu64 { 1e-8 } else { 2e-3 };
        assert!((here / wanted - 1.0).abs() < bound, "{platform:?}, {stretch}: {here:e} Pa, wanted {wanted:e}");
        // counter-test: the neo-Hookean law of the same small strain
        let other = found(platform, Material::NeoHookean, stretch, bulk);
        let least = if (stretch - 1.0f64).abs() < 0.1 { 5e-3 } else { 4e-2 };
        assert!((other / wanted - 1.0).abs() > least, "{stretch}: {other:e} Pa is too near to tell");
        // Mooney 1940: 2 (a − a⁻²) (c₁₀ + c₀₁/a) where the volume is kept
        let classic = 2.0 * (stretch - stretch.powi(-2)) * (C[0] + C[1] / stretch);
        let kept = uniaxial(stretch, 1e4 * bulk);
        assert!((kept / classic - 1.0).abs() < 1e-4, "{stretch}: {kept:e} Pa, wanted {classic:e}");
    }
}
