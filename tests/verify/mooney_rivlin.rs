//! Mooney–Rivlin hexahedra: a bar that is pulled and pressed, against the law in principal stretches, and against Mooney's own formula.

use super::Everywhere;
use super::setup::{Body, LONG, block, displaced, measured, model, tolerance};
use cutis::scene::{Element::Bbar, Law, Material};
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

/// Nominal stress of a bar of 2 × 2 × 2 cells held by its ends alone, Pa.
fn found(platform: &Platform, material: Material, stretch: f64, bulk: f64) -> f64 {
    let mut scene = block(Bbar, true);
    scene.solver.newton = true;
    let shear = 2.0 * (C[0] + C[1]);
    let skin = &mut scene.skins[0];
    (skin.law, skin.cells) = (Law::Hyperelastic(material), [2, 2]);
    skin.layers.truncate(1);
    let layer = &mut skin.layers[0];
    layer.cells = 2;
    layer.poisson = (3.0 * bulk - 2.0 * shear) / (2.0 * (3.0 * bulk + shear));
    layer.young = 2.0 * shear * (1.0 + layer.poisson);
    layer.second_share = C[1] / (C[0] + C[1]);
    let (height, area) = (layer.thickness, skin.size[0] * skin.size[1]);
    scene.time.step = LONG;
    let mut model = model(&scene);
    let params = model.grid.params::<f64>();
    for node in 0..model.rest.len() {
        let at = params.node_at(node);
        let end = at[2] == 0 || at[2] == 2;
        model.free[node][..3].copy_from_slice(&[at[0] != 1, at[1] != 1, !end].map(|f| f64::from(u8::from(f))));
    }
    // a little at a time, each from the heights that it ends at and the width that the last one left
    let mut u = displaced(&model, |_| [0.0; 3]);
    let mut body = None;
    for part in 1..=4 {
        let moved = 1.0 + (stretch - 1.0) * f64::from(part) / 4.0;
        for (node, x) in model.rest.iter().enumerate() {
            u.u[node][2] = (moved - 1.0) * x[2];
        }
        let mut now = Body::new(platform, model.clone(), &u, 100.0 * tolerance(platform));
        now.step();
        now.step(); // whose load is what the first has left
        u.u = now.state().u;
        body = Some(now);
    }
    let forces = body.expect("four parts").forces();
    let top = (0..model.rest.len()).filter(|n| (model.rest[*n][2] - height).abs() < 1e-9);
    top.map(|n| forces[n][2]).sum::<f64>() / area
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
