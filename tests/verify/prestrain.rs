//! Elastic strain at rest: a held slab stays, a free block shrinks by the strain, a held side bears the stress of a plate.
//!
//! Plate: `σ_x = E/(1 − ν²) (e_x + ν e_y)`, `σ_z = 0`. A free linear block is free of stress at `u = −e∘x`, and so is a corotational one:
//! `I − e` has no rotation.

use super::Case;
use super::setup::{Body, block, displaced, largest, measured, model};
use cutis::model::Model;
use cutis::scene::Element::{Bbar, Enhanced, Plain};
use cutis::scene::{Element, Scene};
use cutis::step::Place;

pub const CASES: &[Case] = &[
    ("a_pre_strained_slab_with_held_sides_stays_at_rest", held),
    ("a_pre_strained_free_block_is_free_of_stress_when_it_has_shrunk_by_the_strain", free),
    ("a_held_side_bears_the_stress_of_a_plate", reaction),
];

const STRAIN: [f64; 2] = [0.2, 0.1];
/// Rounding of the sums over 64 corners' products, on terms a few times larger than their sum at ν 0.45.
const EXACT: f64 = 1e-12;

fn strained(element: Element, corotational: bool) -> Scene {
    let mut scene = block(element, corotational);
    scene.skins[0].layers.iter_mut().for_each(|layer| layer.pre_strain = STRAIN);
    scene
}

fn kinds() -> impl Iterator<Item = (Element, bool)> {
    [Plain, Bbar, Enhanced].into_iter().flat_map(|element| [(element, false), (element, true)])
}

/// The largest force, N, that the strain makes on one corner where nothing balances it.
fn scale(model: &Model) -> f64 {
    let [hx, hy, hz, _] = model.shape[0];
    50e3 * hx.max(hy) * hx.max(hz)
}

/// Whether a node lies inside the sides of the block of 8 mm × 6 mm.
fn inside(x: [f64; 3]) -> bool {
    x[0].abs() < 3.9e-3 && x[1].abs() < 2.9e-3
}

/// The largest force on nodes that are not on the sides, relative to that on one corner.
fn unbalanced(model: Model) -> f64 {
    let (rest, unit) = (model.rest.clone(), scale(&model));
    let start = displaced(&model, |_| [0.0; 3]);
    let forces = Body::new(&Place::Cpu64, model, &start, 1e-12).forces();
    largest(rest.iter().zip(&forces).filter(|(x, _)| inside(**x)).map(|(_, f)| f)) / unit
}

fn held() {
    for (element, corotational) in kinds() {
        let mut scene = strained(element, corotational);
        // layer by layer, whatever their materials
        scene.skins[0].layers[1].young *= 4.0;
        scene.skins[0].layers[2].pre_strain = [0.3, -0.1];
        let mut model = model(&scene);
        let error = unbalanced(model.clone());
        measured("force in a held slab", error, EXACT);
        assert!(error < EXACT, "{element:?} {corotational}: {error:e}");
        model.pre_strain.iter_mut().for_each(|e| e[2] = 0.0);
        assert!(unbalanced(model) > 1e-2, "without the strain through the thickness the top is pulled");
    }
}

fn free() {
    for (element, corotational) in kinds() {
        let model = model(&strained(element, corotational));
        let unit = scale(&model);
        let after = |share: f64| {
            let e = model.pre_strain[0];
            let start = displaced(&model, |x| [0, 1, 2].map(|n| -share * e[n] * x[n]));
            largest(&Body::new(&Place::Cpu64, model.clone(), &start, 1e-12).forces()) / unit
        };
        assert!(after(1.0) < EXACT, "{element:?} {corotational}: {:e}", after(1.0));
        assert!(after(0.99) > 1e-4, "a hundredth of the strain is not noticed");
    }
}

fn reaction() {
    let (young, poisson) = (50e3, 0.45);
    let stress = young / (1.0 - poisson * poisson) * (STRAIN[0] + poisson * STRAIN[1]);
    let exact = stress * 6e-3 * 2.5e-3;
    for (element, corotational) in kinds() {
        let model = model(&strained(element, corotational));
        let rest = model.rest.clone();
        let start = displaced(&model, |_| [0.0; 3]);
        let forces = Body::new(&Place::Cpu64, model, &start, 1e-12).forces();
        let side = rest.iter().zip(&forces).filter(|(x, _)| x[0] > 3.9e-3);
        let total: f64 = side.map(|(_, f)| f[0]).sum();
        measured("reaction of a held side", total, exact);
        assert!((total / exact - 1.0).abs() < EXACT, "{element:?} {corotational}: {total:e} N, {exact:e} N");
    }
}
