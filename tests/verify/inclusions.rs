//! Inclusions: one that fills a layer is that layer, whatever solves it; factors of cells by hand. A ball in a block is beside Eshelby's
//! solution in `cutis verify`.

use super::setup::{LONG, exact, measured, model, static_block};
use super::small::held;
use super::{Case, Everywhere};
use cutis::scene::{Component, Inclusion, Law, Load, MATERIALS, Preconditioner, Probe, ProbeKind, Region, Scene};
use cutis::step::{Platform, Simulation};

pub const CASES: &[Case] = &[("cells_have_the_geometric_mean_of_their_moduli", factors)];
pub const EVERYWHERE: &[Everywhere] = &[("an_inclusion_that_fills_a_layer_is_that_layer", filled)];

/// Young's modulus of the layers and of what is included, Pa.
const SOFT: f64 = 50e3;
const STIFF: f64 = 200e3;
/// The middle layer, whose cells are one high; wider than the body.
const MIDDLE: Region = Region::Box { min: [-1.0, -1.0, 1.2e-3], max: [1.0, 1.0, 2.2e-3] };

/// A pressed block under gravity aslant with everything that is read from cells: reaction, stress, strain, displacement.
fn pressed(place: &Platform, law: Law) -> Scene {
    let mut scene = static_block(place, law);
    scene.boundaries.push(held(Region::Bottom, [true; 3]));
    scene.time.gravity = [1.5, -0.7, -9.81];
    scene.loads.push(Load::on_top(&scene.skins[0], 2e3, [-1.7e-3, -1.1e-3], [3.1e-3, 2.9e-3]));
    let [middle, top] = [[0.3e-3, 0.4e-3, 1.7e-3], [0.3e-3, 0.4e-3, 2.4e-3]];
    let zz = Component::Entry(2, 2);
    let mut kinds = vec![
        ProbeKind::Stress { body: 0, point: middle, component: Component::VonMises },
        ProbeKind::Stress { body: 0, point: top, component: zz },
        ProbeKind::Strain { body: 0, point: middle, component: zz },
    ];
    kinds.extend((0..3).map(|axis| ProbeKind::Displacement { body: 0, point: top, axis }));
    kinds.extend((0..3).map(|axis| ProbeKind::Reaction { body: 0, region: Region::Bottom, axis }));
    scene.probes = kinds.into_iter().map(|kind| Probe { name: "p".into(), kind }).collect();
    scene
}

/// Probes after some steps, and the elastic energy.
fn answers(scene: &Scene, place: &Platform) -> Vec<f64> {
    let mut simulation = Simulation::new(scene, place).unwrap_or_else(|e| panic!("{e}"));
    let reports = (0..4).map(|_| simulation.step(true).unwrap_or_else(|e| panic!("{e}")));
    let last = reports.last().expect("a step");
    let energy = last.measured.expect("it was asked for").energy.elastic;
    last.probes.into_iter().chain([energy]).collect()
}

/// Largest difference between two lists, relative to the numbers of the second.
fn apart(found: &[f64], wanted: &[f64]) -> f64 {
    let size = |k: usize| {
        if (3..9).contains(&k) { wanted[3..9].iter().fold(0.0, |s: f64, w| s.max(w.abs())) } else { wanted[k].abs() }
    };
    found.iter().zip(wanted).enumerate().map(|(k, (a, b))| (a - b).abs() / size(k)).fold(0.0, f64::max)
}

fn filled(place: &Platform) {
    for (_, material) in MATERIALS {
        for (newton, step) in [(true, LONG), (false, 1e-2)] {
            for preconditioner in [Preconditioner::Block, Preconditioner::Multigrid, Preconditioner::Direct] {
                if preconditioner == Preconditioner::Direct && *place != Platform::Cpu64 {
                    continue;
                }
                let mut layered = pressed(place, Law::Hyperelastic(material));
                (layered.solver.newton, layered.solver.preconditioner, layered.time.step) =
                    (newton, preconditioner, step);
                (layered.skins[0].rayleigh_mass, layered.skins[0].rayleigh_stiffness) = (0.5, 1e-3);
                let soft = layered.clone();
                let mut included = layered.clone();
                layered.skins[0].layers[1].young = STIFF;
                included.inclusions.push(Inclusion { body: 0, region: MIDDLE, young: STIFF });
                let [found, wanted, other] = [&included, &layered, &soft].map(|scene| answers(scene, place));
                let what = format!("{material:?}, {preconditioner:?}, Newton {newton}, {place:?}");
                measured(&format!("inclusion as a layer, {what}"), apart(&found, &wanted), 0.0);
                assert!(apart(&found, &wanted) < 10.0 * exact(place), "{what}: {found:?}, wanted {wanted:?}");
                // the counter-test
                assert!(apart(&other, &wanted) > 0.1, "{what}: without it {other:?}, with it {wanted:?}");
            }
        }
    }
}

fn factors() {
    let place = Platform::Cpu64;
    let scene_of = |regions: &[(Region, f64)]| {
        let mut scene = pressed(&place, Law::Hyperelastic(MATERIALS[0].1));
        let all = regions.iter().map(|(region, young)| Inclusion { body: 0, region: region.clone(), young: *young });
        scene.inclusions = all.collect();
        scene
    };
    let all = |regions: &[(Region, f64)]| -> Vec<f64> {
        let model = model(&scene_of(regions));
        (0..model.grid.cell_count()).map(|cell| model.mechanics().stiffness_factor(cell)).collect()
    };
    assert!(all(&[]).iter().all(|factor| *factor == 1.0));
    // half of the first cell, 2 × 2 × 0.6 mm at (−4, −3, 0) mm, by its width, and a quarter by another region over it
    let half = Region::Box { min: [-1.0; 3], max: [-3e-3, -1e-3, 0.6e-3] };
    let quarter = Region::Box { min: [-1.0; 3], max: [-3e-3, -2e-3, 0.6e-3] };
    let ratio: f64 = STIFF / SOFT;
    let close = |found: f64, wanted: f64| (found / wanted - 1.0).abs() < 1e-12;
    let one = all(&[(half.clone(), STIFF)]);
    assert!(close(one[0], ratio.sqrt()), "{} of {ratio}", one[0]);
    assert!(one[1..].iter().all(|factor| *factor == 1.0));
    // the last one counts where they overlap
    let both = all(&[(half.clone(), STIFF), (quarter.clone(), SOFT / 4.0)]);
    assert!(close(both[0], (ratio * 0.25).powf(0.25)), "{}", both[0]);
    let other = all(&[(quarter, SOFT / 4.0), (half, STIFF)]);
    assert!(close(other[0], ratio.sqrt()), "{}", other[0]);
    // a ball has its volume: the mean logarithm over that of the ratio, times the volume of the block
    let (radius, volume) = (1.1e-3, 8e-3 * 6e-3 * 2.5e-3);
    let mut scene = scene_of(&[(Region::Sphere { centre: [0.1e-3, -0.2e-3, 1.2e-3], radius }, STIFF)]);
    scene.skins[0].cells = [32, 24];
    scene.skins[0].layers.truncate(1);
    (scene.skins[0].layers[0].thickness, scene.skins[0].layers[0].cells) = (2.5e-3, 10);
    scene.probes.clear();
    let model = model(&scene);
    let count = model.grid.cell_count();
    let logarithms = (0..count).map(|cell| model.mechanics().stiffness_factor(cell).ln() / ratio.ln());
    let found = logarithms.sum::<f64>() / count as f64 * volume;
    let wanted = 4.0 / 3.0 * std::f64::consts::PI * radius.powi(3);
    assert!((found / wanted - 1.0).abs() < 5e-3, "{found:e} m³ of {wanted:e}");
}
