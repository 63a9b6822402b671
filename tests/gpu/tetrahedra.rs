//! Whole runs of bodies of tetrahedra on the GPU, of a mesh file, beside the CPU path in f64.

use super::{Failure, platform};
use cutis::gpu::Gpu;
use cutis::scene::{Element, Files, Law, Material, Scene, parse};
use cutis::step::{Platform, Simulation, StepReport};
use std::path::Path;

type Test = fn(&Gpu) -> Result<(), Failure>;

/// Tests of this file by name.
pub const TESTS: &[(&str, Test)] = &[
    ("a_probe_presses_skin_of_tetrahedra_as_on_the_cpu", a_probe_presses_skin_of_tetrahedra_as_on_the_cpu),
    ("skin_of_tetrahedra_goes_on_from_its_state_bit_for_bit", skin_of_tetrahedra_goes_on_from_its_state_bit_for_bit),
];

/// Steps of the probe's way into the skin; it touches at once.
const STEPS: usize = 20;
/// Difference between the paths, of the probe's values: ten times the residual that solves end at, relative to the load.
const APART: f64 = 1e-4;

/// scenes/skin_tetra.toml on its coarse mesh.
fn skin(law: Law) -> Result<Scene, Failure> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let file = "skin_tetra.toml";
    let text = std::fs::read_to_string(folder.join(file)).map_err(|e| e.to_string())?;
    let text = text.replace("skin_fine.msh", "skin_coarse.msh");
    let mut scene = parse(&text, Path::new(file), &Files::Folder(folder))?;
    scene.skins[0].law = law;
    scene.solver.tolerance = 1e-5;
    Ok(scene)
}

fn steps(simulation: &mut Simulation, count: usize) -> Result<Vec<StepReport>, Failure> {
    (0..count).map(|_| Ok(simulation.step(true)?)).collect()
}

/// Dent, mean displacement of the top and force on the probe after some steps.
fn pressed(law: Law, platform: &Platform) -> Result<Vec<f64>, Failure> {
    let reports = steps(&mut Simulation::new(&skin(law)?, platform)?, STEPS)?;
    let last = reports.last().ok_or("no step")?;
    // the small-strain law under the ball's edge
    match reports.iter().flat_map(|r| r.warnings.keys()).find(|key| **key != "strain_beyond_law") {
        Some(warning) => Err(format!("{law:?} on {platform:?}: {warning}").into()),
        None => Ok(last.probes.clone()),
    }
}

fn a_probe_presses_skin_of_tetrahedra_as_on_the_cpu(gpu: &Gpu) -> Result<(), Failure> {
    let apart =
        |found: &[f64], wanted: &[f64]| found.iter().zip(wanted).map(|(a, b)| ((a - b) / b).abs()).fold(0.0, f64::max);
    let laws = |element| {
        let large = |material| Law::LargeTetra { material, element };
        [Law::Fem { element, corotational: true }, large(Material::NeoHookean), large(Material::MooneyRivlin)]
    };
    let both = laws(Element::Tetra).into_iter().zip(laws(Element::PlainTetra));
    for (law, other) in both.flat_map(|(smoothed, plain)| [(smoothed, plain), (plain, smoothed)]) {
        let (found, wanted) = (pressed(law, &platform(gpu))?, pressed(law, &Platform::Cpu64)?);
        super::report(gpu, &format!("{law:?}: {found:?} and {wanted:?}, {:.1e} apart", apart(&found, &wanted)));
        // written so that NaN fails it
        if !(apart(&found, &wanted) <= APART && found.len() == 3 && wanted[2] > 0.01) {
            return Err(format!("{law:?}: {found:?}, on the CPU path {wanted:?}").into());
        }
        // the counter-test: the other element is told apart
        let other = pressed(other, &Platform::Cpu64)?;
        if apart(&found, &other) <= 10.0 * APART {
            return Err(format!("{law:?}: {found:?}, with other elements {other:?}").into());
        }
    }
    Ok(())
}

fn skin_of_tetrahedra_goes_on_from_its_state_bit_for_bit(gpu: &Gpu) -> Result<(), Failure> {
    let element = Element::Tetra;
    let large = Law::LargeTetra { material: Material::NeoHookean, element };
    [Law::Fem { element, corotational: true }, large].into_iter().try_for_each(|law| goes_on(gpu, law))
}

fn goes_on(gpu: &Gpu, law: Law) -> Result<(), Failure> {
    let scene = skin(law)?;
    let simulation = || Simulation::new(&scene, &platform(gpu));
    let bytes = |simulation: &mut Simulation| -> Result<Vec<u8>, Failure> {
        Ok(postcard::to_allocvec(&simulation.state()?).map_err(|e| e.to_string())?)
    };
    let (mut whole, mut first, mut rest) = (simulation()?, simulation()?, simulation()?);
    steps(&mut whole, 12)?;
    steps(&mut first, 7)?;
    rest.restore(&first.state()?)?;
    let before = bytes(&mut rest)?;
    steps(&mut rest, 5)?;
    let wanted = bytes(&mut whole)?;
    if bytes(&mut rest)? != wanted {
        return Err("a restored run has other bits than the whole one".into());
    }
    // the counter-test
    if before == wanted { Err("five steps change nothing".into()) } else { Ok(()) }
}
