//! Hexahedra with collagen fibres: a bar that is pulled along and across Langer's lines, and pressed, against the law in principal stretches.

use super::Everywhere;
use super::setup::{measured, pulled};
use cutis::scene::{Fibres, Layer, Material};
use cutis::step::Platform;

pub const EVERYWHERE: &[Everywhere] = &[("fibres_pull_along_langers_lines_more_than_across", bar)];

const YOUNG: f64 = 40e3;
const POISSON: f64 = 0.47;
/// Fibres to both sides of Langer's lines.
const ASIDE: f64 = 0.6;

fn layer(langer: f64, stiffness: f64) -> Layer {
    let families = [langer + ASIDE, langer - ASIDE];
    let fibres = Fibres { stiffness, growth: 1.5, dispersion: 0.12, families };
    Layer { young: YOUNG, poisson: POISSON, fibres, ..Layer::default() }
}

/// Energy per volume at principal stretches, Langer's lines along the first, J/m³.
fn energy(layer: &Layer, [a, b, c]: [f64; 3]) -> f64 {
    let mu = YOUNG / (2.0 * (1.0 + POISSON));
    let lambda = YOUNG * POISSON / ((1.0 + POISSON) * (1.0 - 2.0 * POISSON));
    let (i1, volume) = (a * a + b * b + c * c, (a * b * c).ln());
    let Fibres { stiffness, growth, dispersion, .. } = layer.fibres;
    // both families have the same stretch
    let i4 = (a * ASIDE.cos()).powi(2) + (b * ASIDE.sin()).powi(2);
    let strain = (dispersion * (i1 - 3.0) + (1.0 - 3.0 * dispersion) * (i4 - 1.0)).max(0.0);
    let fibres = 2.0 * stiffness / (2.0 * growth) * ((growth * strain * strain).exp() - 1.0);
    mu / 2.0 * (i1 - 3.0 - 2.0 * volume) + lambda / 2.0 * volume * volume + fibres
}

/// Nominal stresses by differences of the energy, Pa.
fn stress(layer: &Layer, stretches: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|n| {
        let moved = |by: f64| {
            let mut all = stretches;
            all[n] += by;
            energy(layer, all)
        };
        let d = 1e-4;
        (8.0 * (moved(d) - moved(-d)) - (moved(2.0 * d) - moved(-2.0 * d))) / (12.0 * d)
    })
}

/// Where an increasing function is zero.
fn zero(mut of: impl FnMut(f64) -> f64) -> f64 {
    let (mut low, mut high) = (0.3, 2.5);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if of(middle) < 0.0 { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// Nominal stress of the bar with free sides, stretched along (axis 0) or across (1) Langer's lines, Pa.
fn wanted(layer: &Layer, axis: usize, stretch: f64) -> f64 {
    let at = |side: f64, up: f64| if axis == 0 { [stretch, side, up] } else { [side, stretch, up] };
    let height = |side: f64| zero(|up| stress(layer, at(side, up))[2]);
    let side = zero(|side| stress(layer, at(side, height(side)))[1 - axis]);
    stress(layer, at(side, height(side)))[axis]
}

fn bar(platform: &Platform) {
    let quarter = std::f64::consts::FRAC_PI_2;
    for stretch in [0.8, 1.05, 1.3, 1.5] {
        // the bar lies along x; Langer's lines along it, then across
        let [along, across] = [(0.0, 0), (quarter, 1)].map(|(langer, axis)| {
            let layer = layer(langer, 30e3);
            let (found, wanted) =
                (pulled(platform, Material::Holzapfel, &layer, 0, stretch), wanted(&layer, axis, stretch));
            measured(&format!("bar with fibres {platform:?}, axis {axis} at {stretch} / Pa"), found, wanted);
            let bound = if *platform == Platform::Cpu64 { 1e-6 } else { 2e-3 };
            assert!(
                (found / wanted - 1.0).abs() < bound,
                "{platform:?}, {axis}, {stretch}: {found:e} Pa, wanted {wanted:e}"
            );
            found
        });
        // counter-tests: fibres pull one way more than the other, and pressed ones only where the sides stretch them
        let plain = pulled(platform, Material::Holzapfel, &layer(0.0, 0.0), 0, stretch);
        let neo = pulled(platform, Material::NeoHookean, &layer(0.0, 30e3), 0, stretch);
        assert!((plain / neo - 1.0).abs() < 1e-6, "{stretch}: {plain:e} Pa without fibres, {neo:e}");
        if stretch > 1.2 {
            assert!(along > 1.2 * across && across > plain, "{stretch}: {along:e}, {across:e}, without {plain:e} Pa");
        }
    }
}
