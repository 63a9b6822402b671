//! Whole scenes of several bodies on the GPU, beside the CPU path in f64.

use super::Failure;
use cutis::gpu::Gpu;
use cutis::scene::{ProbeKind, Who, read};
use cutis::step::{Place, Simulation};
use std::path::Path;

type Test = fn(&Gpu) -> Result<(), Failure>;

/// Tests of this file by name.
pub const TESTS: &[(&str, Test)] = &[("soft_blocks_stand_on_each_other", soft_blocks_stand_on_each_other)];

/// Steps after which the blocks have settled to their weights.
const STEPS: u32 = 10;
/// Difference between the paths, of the lowest force: the stack's motion in f32, amplified by the free fall's share of `A`.
const APART: f64 = 2e-3;

fn forces(place: &Place) -> Result<Vec<f64>, Failure> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/verify/stack_five_soft.toml");
    let mut scene = read(&path)?;
    scene.solver.tolerance = 1e-5;
    // the two lowest blocks: each body compiles its kernels, which takes SwiftShader half a minute
    scene.skins.truncate(2);
    scene.probes.retain(|p| matches!(p.kind, ProbeKind::Force { on: Who::Skin(body), .. } if body < 2));
    let mut simulation = Simulation::new(&scene, place)?;
    let mut last = vec![];
    for _ in 0..STEPS {
        last = simulation.step(false)?.probes;
    }
    Ok(last)
}

fn soft_blocks_stand_on_each_other(gpu: &Gpu) -> Result<(), Failure> {
    let a = &gpu.adapter;
    let on_gpu = forces(&Place::Gpu(Some(format!("{} {} {}", a.name, a.backend, a.driver))))?;
    let on_cpu = forces(&Place::Cpu64)?;
    for (gpu, cpu) in on_gpu.iter().zip(&on_cpu) {
        if (gpu - cpu).abs() > APART * on_cpu[1].abs() || on_cpu.len() != 2 || on_cpu[1] < 0.03 {
            return Err(format!("forces under the blocks: {on_gpu:?} N and {on_cpu:?} N").into());
        }
    }
    Ok(())
}
