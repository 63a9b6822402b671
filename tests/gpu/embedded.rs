//! Bodies embedded in a grid on the GPU, beside the CPU path in f64.

use super::{Failure, platform};
use cutis::gpu::Gpu;
use cutis::scene::{Boundary, Integrator, Preconditioner, Probe, ProbeKind, Region, Scene, read};
use cutis::step::{Platform, Simulation};
use std::path::Path;

type Test = fn(&Gpu) -> Result<(), Failure>;

/// Tests of this file by name.
pub const TESTS: &[(&str, Test)] = &[
    ("an_embedded_pad_is_pressed_as_on_the_cpu", an_embedded_pad_is_pressed_as_on_the_cpu),
    ("an_embedded_pad_sags_to_the_balance_of_the_cpu", an_embedded_pad_sags_to_the_balance_of_the_cpu),
    ("an_embedded_pad_goes_on_from_its_state_bit_for_bit", an_embedded_pad_goes_on_from_its_state_bit_for_bit),
];

/// Steps of the probe's way into the pad; it touches at once.
const STEPS: usize = 12;
/// Difference between the paths: ten times the residual that solves end at, relative to the load.
const APART: f64 = 1e-4;

/// scenes/pad.toml on a coarse grid.
fn pad(preconditioner: Preconditioner) -> Result<Scene, Failure> {
    let mut scene = read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/pad.toml"))?;
    scene.skins[0].cells = [10, 8];
    scene.skins[0].layers[0].cells = 5;
    scene.solver.tolerance = 1e-5;
    if let Some(contact) = &mut scene.contact {
        contact.tolerance = 1e-5;
    }
    scene.solver.preconditioner = preconditioner;
    Ok(scene)
}

fn probes(scene: &Scene, platform: &Platform, steps: usize) -> Result<Vec<f64>, Failure> {
    let mut simulation = Simulation::new(scene, platform)?;
    let mut last = vec![];
    for _ in 0..steps {
        let report = simulation.step(true)?;
        if let Some(warning) = report.warnings.keys().next() {
            return Err(format!("{platform:?}: {warning}").into());
        }
        last = report.probes;
    }
    Ok(last)
}

/// Compares the paths; the counter-test is a scene that both tell apart.
fn same(gpu: &Gpu, scene: &Scene, other: &Scene, steps: usize) -> Result<(), Failure> {
    let apart =
        |found: &[f64], wanted: &[f64]| found.iter().zip(wanted).map(|(a, b)| ((a - b) / b).abs()).fold(0.0, f64::max);
    let (found, wanted) = (probes(scene, &platform(gpu), steps)?, probes(scene, &Platform::Cpu64, steps)?);
    super::report(gpu, &format!("{found:?} and {wanted:?}, {:.1e} apart", apart(&found, &wanted)));
    // written so that NaN fails it
    if !(apart(&found, &wanted) <= APART && wanted.iter().all(|value| value.abs() > 1e-7)) {
        return Err(format!("{found:?}, on the CPU path {wanted:?}").into());
    }
    let other = probes(other, &Platform::Cpu64, steps)?;
    match apart(&found, &other) > 10.0 * APART {
        true => Ok(()),
        false => Err(format!("{found:?}, of another body {other:?}").into()),
    }
}

/// The same with the whole grid.
fn plain(scene: &Scene) -> Scene {
    let mut other = scene.clone();
    other.skins[0].embedded = None;
    other
}

fn an_embedded_pad_is_pressed_as_on_the_cpu(gpu: &Gpu) -> Result<(), Failure> {
    for preconditioner in [Preconditioner::Multigrid, Preconditioner::Column] {
        let scene = pad(preconditioner)?;
        same(gpu, &scene, &plain(&scene), STEPS)?;
    }
    Ok(())
}

/// Static, by Newton's method, which has tangents of its own on a device.
fn an_embedded_pad_sags_to_the_balance_of_the_cpu(gpu: &Gpu) -> Result<(), Failure> {
    let mut scene = pad(Preconditioner::Multigrid)?;
    (scene.tools, scene.contact) = (vec![], None);
    scene.time.integrator = Integrator::Static;
    scene.time.gravity = [20.0, -10.0, -30.0];
    scene.boundaries = vec![Boundary { region: Region::Bottom, ..Boundary::default() }];
    let probe = |axis| ProbeKind::Displacement { body: 0, point: [1e-3, 0.5e-3, 6e-3], axis };
    scene.probes = (0..3).map(|axis| Probe { name: "u".into(), kind: probe(axis) }).collect();
    same(gpu, &scene, &plain(&scene), 2)
}

fn an_embedded_pad_goes_on_from_its_state_bit_for_bit(gpu: &Gpu) -> Result<(), Failure> {
    let scene = pad(Preconditioner::Multigrid)?;
    let simulation = || Simulation::new(&scene, &platform(gpu));
    let bytes = |simulation: &mut Simulation| -> Result<Vec<u8>, Failure> {
        Ok(postcard::to_allocvec(&simulation.state()?).map_err(|e| e.to_string())?)
    };
    let steps = |simulation: &mut Simulation, count: usize| -> Result<(), Failure> {
        (0..count).try_for_each(|_| simulation.step(false).map(|_| ())).map_err(Failure::from)
    };
    let (mut whole, mut first, mut rest) = (simulation()?, simulation()?, simulation()?);
    steps(&mut whole, 9)?;
    steps(&mut first, 5)?;
    rest.restore(&first.state()?)?;
    let before = bytes(&mut rest)?;
    steps(&mut rest, 4)?;
    let wanted = bytes(&mut whole)?;
    match bytes(&mut rest)? == wanted && before != wanted {
        true => Ok(()),
        false => Err("the state differs, or does not change".into()),
    }
}
