//! The hard cases of deformable bodies on the device, each with the checks of its scene.

use super::forms::{hard, passes, report_of};
use super::long::{PRECISIONS, case, difference_over, measured};
use super::{Failure, Test, platform, report};
use cutis::gpu::Gpu;
use cutis::step::{Platform, Simulation};

/// One test a scene, `hard_NAME`, and those of this file.
pub fn tests() -> Vec<(String, Test)> {
    let scenes = hard().into_iter().map(|(name, scene)| -> (String, Test) {
        let test = format!("hard_{name}");
        let run = move |gpu: &Gpu| {
            let report = report_of(&name, &scene, &platform(gpu))?;
            Ok(passes(&name, &scene, &report)?)
        };
        (test, Box::new(run))
    });
    let still: (String, Test) = ("what_nothing_moves_stays_to_the_last_bit".into(), Box::new(stays));
    let long: (String, Test) = ("thousands_of_steps_are_those_of_f64".into(), Box::new(agrees));
    scenes.chain([still, long]).collect()
}

fn stays(gpu: &Gpu) -> Result<(), Failure> {
    let scene = case("still");
    let mut pulled = scene.clone();
    pulled.time.gravity[2] = -1e-3;
    for (scene, steps, moves) in [(&scene, scene.time.steps(), false), (&pulled, 1, true)] {
        let mut simulation = Simulation::new(scene, &platform(gpu))?;
        for _ in 0..steps {
            simulation.step(false)?;
        }
        let state = simulation.bodies[0].snapshot()?;
        if state.u.iter().chain(&state.v).flatten().any(|c| *c != 0.0) != moves {
            return Err(format!("something has moved: {}", !moves).into());
        }
    }
    Ok(())
}

/// 200 steps; `CUTIS_MEASURED=1`: 10,000.
fn agrees(gpu: &Gpu) -> Result<(), Failure> {
    let steps = if measured() { 10_000 } else { 200 };
    let [difference, motion] = difference_over(steps, [&platform(gpu), &Platform::Cpu64]);
    report(gpu, &format!("{steps} steps off f64 by {:.2e} of {motion:.3e} m", difference / motion));
    if motion > 1e-4 && difference < PRECISIONS * motion {
        return Ok(());
    }
    Err(format!("{difference:e} m of {motion:e} m").into())
}
