//! The hard cases of deformable bodies on the device, each with the checks of its scene.

use super::forms::{hard, passes, report_of};
use super::{Failure, Test};
use cutis::gpu::Gpu;
use cutis::scene::{Law, Scene};
use cutis::step::{Place, Simulation};

fn place(gpu: &Gpu) -> Place {
    let a = &gpu.adapter;
    Place::Gpu(Some(format!("{} {} {}", a.name, a.backend, a.driver)))
}

/// One test a scene, `hard_NAME`, and those of this file.
pub fn tests() -> Vec<(String, Test)> {
    // that law runs on the CPU path alone, and says so (tests/scene_errors.rs, tests/verify)
    let there = |scene: &Scene| !scene.skins.iter().any(|skin| matches!(skin.law, Law::NeoHookean { .. }));
    let scenes =
        hard().into_iter().filter(|(_, scene, _)| there(scene)).map(|(name, scene, steps)| -> (String, Test) {
            let test = format!("hard_{name}");
            let run = move |gpu: &Gpu| {
                let report = report_of(&name, &scene, steps, &place(gpu))?;
                Ok(passes(&name, &scene, steps, &report)?)
            };
            (test, Box::new(run))
        });
    let still: (String, Test) = ("what_nothing_moves_stays_to_the_last_bit".into(), Box::new(stays));
    scenes.chain([still]).collect()
}

fn stays(gpu: &Gpu) -> Result<(), Failure> {
    let found = hard().into_iter().find(|(name, ..)| name == "still");
    let (_, scene, steps) = found.ok_or("scenes/hard/still.toml is gone")?;
    let mut simulation = Simulation::new(&scene, &place(gpu))?;
    for _ in 0..steps {
        simulation.step(false)?;
    }
    let state = simulation.bodies[0].snapshot()?;
    if state.u.iter().chain(&state.v).flatten().any(|c| *c != 0.0) {
        return Err("something has moved".into());
    }
    Ok(())
}
