//! Elastic strain at rest: a held slab stays, a free block shrinks by the strain, a held side bears the stress of a plate.
//!
//! Plate: `σ_x = E/(1 − ν²) (e_x + ν e_y)`, `σ_z = 0`. A free linear block is free of stress at `u = −e∘x`, and so is a corotational one:
//! `I − e` has no rotation. Its tangent has no initial-stress stiffness (see `kernels::forces`), which the last case does not need: without
//! rotations `K` is the whole tangent, so one static step ends at the closed form.

use super::setup::{Body, LONG, apart, block, displaced, epsilon, largest, measured, model, tolerance};
use super::{Case, Everywhere, small};
use cutis::bodies::Model;
use cutis::math::V4;
use cutis::scene::Element::{Bbar, Enhanced, Plain};
use cutis::scene::{Element, Region, Scene};
use cutis::step::Platform;

pub const CASES: &[Case] = &[("the_strain_across_the_plane_is_the_one_without_stress", across)];
pub const EVERYWHERE: &[Everywhere] = &[
    ("a_pre_strained_slab_with_held_sides_has_no_force_inside", held),
    ("a_pre_strained_free_block_is_free_of_stress_when_it_has_shrunk_by_the_strain", free),
    ("a_held_side_bears_the_stress_of_a_plate", reaction),
    ("a_pre_strained_slab_with_held_sides_stays_through_a_step", stays),
    ("a_pre_strained_free_block_shrinks_by_the_strain_in_static_steps", shrinks),
];

const STRAIN: [f64; 2] = [0.2, 0.1];

/// Roundings of a force: 8 cells × 24 products, on terms up to ten times their sum at ν 0.45, flat cells and a layer of fourfold stiffness.
fn exact(platform: &Platform) -> f64 {
    8.0 * 24.0 * 10.0 * epsilon(platform)
}

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
fn unbalanced(platform: &Platform, model: Model) -> f64 {
    let (rest, unit) = (model.rest.clone(), scale(&model));
    let start = displaced(&model, |_| [0.0; 3]);
    let forces = Body::new(platform, model, &start, tolerance(platform)).forces();
    largest(rest.iter().zip(&forces).filter(|(x, _)| inside(**x)).map(|(_, f)| f)) / unit
}

/// Layers of their own materials and strains.
fn uneven(element: Element, corotational: bool) -> Scene {
    let mut scene = strained(element, corotational);
    scene.skins[0].layers[1].young *= 4.0;
    scene.skins[0].layers[2].pre_strain = [0.3, -0.1];
    scene
}

fn held(platform: &Platform) {
    for (element, corotational) in kinds() {
        let mut model = model(&uneven(element, corotational));
        let error = unbalanced(platform, model.clone());
        measured("force in a held slab", error, exact(platform));
        assert!(error < exact(platform), "{element:?} {corotational}: {error:e}");
        model.hexahedra_mut().pre_strain.iter_mut().for_each(|e| e[2] = 0.0);
        assert!(unbalanced(platform, model) > 1e-2, "without the strain through the thickness the top is pulled");
    }
}

/// Displacements that relieve a share of the strain: `−share e∘(x − corner)`.
fn relieved(model: &Model, share: f64) -> Vec<V4<f64>> {
    let e = model.hexahedra().pre_strain[0];
    displaced(model, |x| [0, 1, 2].map(|n| -share * e[n] * (x[n] - CORNER[n]))).u
}

fn free(platform: &Platform) {
    for (element, corotational) in kinds() {
        let model = model(&strained(element, corotational));
        let after = |share: f64| {
            let mut start = displaced(&model, |_| [0.0; 3]);
            start.u = relieved(&model, share);
            largest(&Body::new(platform, model.clone(), &start, tolerance(platform)).forces()) / scale(&model)
        };
        let error = after(1.0);
        measured("force in a block that has shrunk", error, exact(platform));
        assert!(error < exact(platform), "{element:?} {corotational}: {error:e}");
        assert!(after(0.99) > 4.0 * exact(platform), "a hundredth of the strain is not noticed");
    }
}

/// Force on the side at +x, relative to that of a plate under [`STRAIN`], less one.
fn reaction_error(platform: &Platform, model: Model) -> f64 {
    let (young, poisson) = (50e3, 0.45);
    let stress = young / (1.0 - poisson * poisson) * (STRAIN[0] + poisson * STRAIN[1]);
    let rest = model.rest.clone();
    let start = displaced(&model, |_| [0.0; 3]);
    let forces = Body::new(platform, model, &start, tolerance(platform)).forces();
    let side = rest.iter().zip(&forces).filter(|(x, _)| x[0] > 3.9e-3);
    side.map(|(_, f)| f[0]).sum::<f64>() / (stress * 6e-3 * 2.5e-3) - 1.0
}

fn reaction(platform: &Platform) {
    for (element, corotational) in kinds() {
        let mut model = model(&strained(element, corotational));
        let error = reaction_error(platform, model.clone());
        measured("reaction of a held side, relative error", error, 0.0);
        assert!(error.abs() < exact(platform), "{element:?} {corotational}: {error:e}");
        // counter-test: a rod's stress, or that of a body held on top too, is another
        model.hexahedra_mut().pre_strain.iter_mut().for_each(|e| e[1] = 0.0);
        assert!(reaction_error(platform, model.clone()).abs() > 0.1, "the strain along y bears on the side too");
        model.hexahedra_mut().pre_strain.iter_mut().for_each(|e| (e[1], e[2]) = (STRAIN[1], 0.0));
        assert!(reaction_error(platform, model).abs() > 0.1, "and so does the one across");
    }
}

/// Largest displacement after a static step of the slab with held sides, relative to the strain over its width.
fn moved(platform: &Platform, model: Model) -> f64 {
    let start = displaced(&model, |_| [0.0; 3]);
    let mut body = Body::new(platform, model, &start, tolerance(platform));
    body.try_step();
    let u: Vec<[f64; 3]> = body.state().u.iter().map(|u| [u[0], u[1], u[2]]).collect();
    largest(&u) / (STRAIN[0] * 8e-3)
}

fn stays(platform: &Platform) {
    for (element, corotational) in kinds() {
        let mut scene = uneven(element, corotational);
        scene.time.step = LONG;
        scene.boundaries = vec![small::held(Region::Sides, [true; 3])];
        let mut model = model(&scene);
        let error = moved(platform, model.clone());
        // rounded forces move a body that is hundreds of times softer in bending than its cells are
        let bound = 100.0 * exact(platform);
        measured("a held slab's displacement", error, bound);
        assert!(error < bound, "{element:?} {corotational}: {error:e}");
        model.hexahedra_mut().pre_strain.iter_mut().for_each(|e| e[2] = 0.0);
        assert!(moved(platform, model) > 1e-2, "a slab that is not at rest moves");
    }
}

/// Static steps: the first goes all the way, the others stay.
const STEPS: usize = 3;

/// Of the block, m.
const CORNER: [f64; 3] = [-4e-3, -3e-3, 0.0];

fn shrinks(platform: &Platform) {
    for (element, corotational) in kinds() {
        let mut scene = strained(element, corotational);
        scene.time.step = LONG;
        // three faces slide in their planes, so the block shrinks towards their corner
        let low = |normal| Region::Plane { through: CORNER, normal, within: 1e-6 };
        scene.boundaries = vec![
            small::held(low([1.0, 0.0, 0.0]), [true, false, false]),
            small::held(low([0.0, 1.0, 0.0]), [false, true, false]),
            small::held(Region::Bottom, [false, false, true]),
        ];
        let model = model(&scene);
        let exact_u = relieved(&model, 1.0);
        let start = displaced(&model, |_| [0.0; 3]);
        let mut body = Body::new(platform, model.clone(), &start, tolerance(platform));
        // the load of a later step is what rounding left of the first, and need not be solved
        let outcome = body.try_step();
        assert!(outcome.converged, "{element:?} {corotational}: {outcome:?}");
        (1..STEPS).for_each(|_| {
            body.try_step();
        });
        let error = apart(&body.state().u, &exact_u);
        let bound = 100.0 * exact(platform);
        measured("a free block's shape", error, bound);
        assert!(error < bound, "{element:?} {corotational}: {error:e}");
        assert!(apart(&relieved(&model, 0.5), &exact_u) > bound, "half of it is not enough");
    }
}

fn across() {
    let e = model(&strained(Plain, false)).hexahedra().pre_strain[0];
    // Hooke: σ_z = (λ + 2μ) e_z + λ (e_x + e_y)
    let (lambda, mu) = cutis::bodies::grid::element::lame(50e3, 0.45);
    let stress = |e: [f64; 4]| ((lambda + 2.0 * mu) * e[2] + lambda * (e[0] + e[1])) / lambda;
    assert!(stress(e).abs() < 1e-14, "{:e}", stress(e));
    assert!(stress([e[0], e[1], -(e[0] + e[1]), 0.0]).abs() > 1e-2, "kept volume is another condition");
}
