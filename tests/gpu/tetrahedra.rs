//! Whole runs of bodies of tetrahedra on the GPU, of a mesh file, beside the CPU path in f64.

use super::{Failure, platform};
use cutis::gpu::Gpu;
use cutis::scene::{Element, Files, Law, Scene, parse};
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
fn skin(element: Element) -> Result<Scene, Failure> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let file = "skin_tetra.toml";
    let text = std::fs::read_to_string(folder.join(file)).map_err(|e| e.to_string())?;
    let text = text.replace("skin_fine.msh", "skin_coarse.msh");
    let mut scene = parse(&text, Path::new(file), &Files::Folder(folder))?;
    scene.skins[0].law = Law::Fem { element, corotational: true };
    scene.solver.tolerance = 1e-5;
    Ok(scene)
}

fn steps(simulation: &mut Simulation, count: usize) -> Result<Vec<StepReport>, Failure> {
    (0..count).map(|_| Ok(simulation.step(true)?)).collect()
}

/// Dent, mean displacement of the top and force on the probe after some steps.
fn pressed(element: Element, platform: &Platform) -> Result<Vec<f64>, Failure> {
    let reports = steps(&mut Simulation::new(&skin(element)?, platform)?, STEPS)?;
    let last = reports.last().ok_or("no step")?;
    // the small-strain law under the ball's edge
    match reports.iter().flat_map(|r| r.warnings.keys()).find(|key| **key != "strain_beyond_law") {
        Some(warning) => Err(format!("{element:?} on {platform:?}: {warning}").into()),
        None => Ok(last.probes.clone()),
    }
}

fn a_probe_presses_skin_of_tetrahedra_as_on_the_cpu(gpu: &Gpu) -> Result<(), Failure> {
    let apart =
        |found: &[f64], wanted: &[f64]| found.iter().zip(wanted).map(|(a, b)| ((a - b) / b).abs()).fold(0.0, f64::max);
    for (element, other) in [(Element::Tetra, Element::PlainTetra), (Element::PlainTetra, Element::Tetra)] {
        let (found, wanted) = (pressed(element, &platform(gpu))?, pressed(element, &Platform::Cpu64)?);
        super::report(gpu, &format!("{element:?}: {found:?} and {wanted:?}, {:.1e} apart", apart(&found, &wanted)));
        // written so that NaN fails it
        if !(apart(&found, &wanted) <= APART && found.len() == 3 && wanted[2] > 0.01) {
            return Err(format!("{element:?}: {found:?}, on the CPU path {wanted:?}").into());
        }
        // the counter-test: the other element is told apart
        let other = pressed(other, &Platform::Cpu64)?;
        if apart(&found, &other) <= 10.0 * APART {
            return Err(format!("{element:?}: {found:?}, with other elements {other:?}").into());
        }
    }
    Ok(())
}

fn skin_of_tetrahedra_goes_on_from_its_state_bit_for_bit(gpu: &Gpu) -> Result<(), Failure> {
    let scene = skin(Element::Tetra)?;
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
