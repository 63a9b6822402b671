//! Whole scenes of several bodies on the GPU, beside the CPU path in f64.

use super::states::{SCENES, resumes};
use super::{Failure, platform};
use cutis::backend::Snapshot;
use cutis::gpu::Gpu;
use cutis::scene::{BodyId, Element, Fibres, Integrator, Law, Material, Preconditioner, ProbeKind, Scene, read};
use cutis::step::{Platform, Simulation};
use std::path::Path;
use std::sync::Arc;

type Test = fn(&Gpu) -> Result<(), Failure>;

/// Tests of this file by name.
pub const TESTS: &[(&str, Test)] = &[
    ("soft_blocks_stand_on_each_other", soft_blocks_stand_on_each_other),
    ("a_sphere_presses_hyperelastic_skin_as_on_the_cpu", a_sphere_presses_hyperelastic_skin_as_on_the_cpu),
    ("steps_in_full_end_as_on_the_cpu", steps_in_full_end_as_on_the_cpu),
    ("steps_in_full_go_on_after_a_cut", steps_in_full_go_on_after_a_cut),
    ("a_run_goes_on_from_its_state_bit_for_bit", a_run_goes_on_from_its_state_bit_for_bit),
    ("bodies_and_simulations_share_a_device", bodies_and_simulations_share_a_device),
    ("a_limit_of_iterations_is_kept_to_the_last_one", a_limit_of_iterations_is_kept_to_the_last_one),
];

/// Steps after which the blocks have settled to their weights.
const STEPS: u32 = 10;
/// Difference between the paths, of the lowest force: the stack's motion in f32, amplified by the free fall's share of `A`.
const APART: f64 = 2e-3;

/// Steps of the sphere into the skin.
const SINKING: u32 = 7;

fn forces(platform: &Platform) -> Result<Vec<f64>, Failure> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/verify/stack_five_soft.toml");
    let mut scene = read(&path)?;
    scene.solver.tolerance = 1e-5;
    // the two lowest blocks: five take SwiftShader too long
    scene.skins.truncate(2);
    scene.probes.retain(|p| matches!(p.kind, ProbeKind::Force { on: BodyId::Deformable(body), .. } if body < 2));
    let mut simulation = Simulation::new(&scene, platform)?;
    let mut last = vec![];
    for _ in 0..STEPS {
        last = simulation.step(false)?.probes;
    }
    Ok(last)
}

/// A sphere pressed into skin of two laws: forces of the CPU path, and what steps leave of the law; without `newton` much is left.
fn steps_in_full_end_as_on_the_cpu(gpu: &Gpu) -> Result<(), Failure> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/hard/press_slide.toml");
    let material = Material::NeoHookean;
    for law in [Law::Hyperelastic(material), Law::LargeTetra { material, element: Element::Tetra }] {
        let mut scene = read(&path)?;
        (scene.skins[0].cells, scene.skins[0].law) = ([5, 5], law);
        if let Law::LargeTetra { .. } = law {
            scene.solver.preconditioner = Preconditioner::Block;
        }
        // a softer hand: on so few cells that of the scene squeezes some flat
        let coupling = &mut scene.tools[0].coupling;
        (coupling.stiffness, coupling.damping) = (5e3, 20.0);
        (scene.solver.newton, scene.solver.tolerance) = (true, 1e-3);
        let last = |scene: &Scene, platform: &Platform| -> Result<(f64, f64), Failure> {
            let (mut left, mut force) = (0.0, 0.0);
            let mut simulation = Simulation::new(scene, platform)?;
            for _ in 0..16 {
                let report = simulation.step(true)?;
                (left, force) =
                    (f64::max(left, report.law_residual), report.contact.on_tool.first().map_or(0.0, |f| f[2]));
            }
            Ok((left, force))
        };
        let ((left, force), (_, wanted)) = (last(&scene, &platform(gpu))?, last(&scene, &Platform::Cpu64)?);
        if !(left < 2e-3 && wanted > 0.1 && (force / wanted - 1.0).abs() < 2e-3) {
            return Err(format!("{law:?}: {left:e} of the law is left, {force} N in place of {wanted}").into());
        }
        scene.solver.newton = false;
        let (left, _) = last(&scene, &platform(gpu))?;
        if left < 2e-2 {
            return Err(format!("the counter-test, {law:?}: {left:e}").into());
        }
    }
    Ok(())
}

/// Steps of the incision up to its first cut and three more, which have split cells.
fn steps_in_full_go_on_after_a_cut(gpu: &Gpu) -> Result<(), Failure> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/incision.toml");
    let mut scene = read(&path)?.in_test_form();
    scene.solver.newton = true;
    let mut simulation = Simulation::new(&scene, &platform(gpu))?;
    let (mut severed, mut after) = (0, 0);
    for _ in 0..scene.time.steps() {
        let report = simulation.step(severed > 0)?;
        if severed > 0 {
            after += 1;
            let left = report.law_residual.max(report.true_residual.unwrap_or(f64::NAN));
            if !(left < 2.0 * scene.solver.tolerance && report.warnings.is_empty()) {
                return Err(format!("{left:e} of the law is left after a cut, {:?}", report.warnings).into());
            }
        }
        severed += report.severed;
        if after == 3 {
            return Ok(());
        }
    }
    Err(format!("{severed} links cut, {after} steps after that").into())
}

fn a_run_goes_on_from_its_state_bit_for_bit(gpu: &Gpu) -> Result<(), Failure> {
    let platform = platform(gpu);
    SCENES.iter().try_for_each(|(name, k, n)| Ok(resumes(name, &platform, *k, *n)?))
}

/// The largest displacements of two blocks on each other after some steps, m.
fn stood(mut simulation: Simulation) -> Result<Vec<f64>, Failure> {
    for _ in 0..3 {
        simulation.step(false)?;
    }
    let largest = |state: &Snapshot| state.u.iter().map(|u| u[2].abs()).fold(0.0, f64::max);
    Ok(simulation.snapshots()?.iter().map(largest).collect())
}

/// A device that the caller has opened, for two simulations of two bodies, each in a thread of its own.
fn bodies_and_simulations_share_a_device(gpu: &Gpu) -> Result<(), Failure> {
    let mut scene = read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/verify/stack_five_soft.toml"))?;
    scene.skins.truncate(2);
    scene.probes.clear();
    let wanted = stood(Simulation::new(&scene, &platform(gpu))?)?;
    let descriptor = cutis::wgpu::DeviceDescriptor { label: Some("the caller's"), ..Default::default() };
    let (adapter, (device, queue)) = gpu.adapter.request(&descriptor)?;
    let shared = Arc::new(Gpu::from_wgpu(adapter, device, queue)?);
    let simulations = [Simulation::with_gpu(&scene, shared.clone())?, Simulation::with_gpu(&scene, shared.clone())?];
    let found: Vec<Result<Vec<f64>, Failure>> = std::thread::scope(|scope| {
        let threads = simulations.map(|simulation| scope.spawn(|| stood(simulation)));
        threads.map(|thread| thread.join().unwrap_or_else(|_| Err("a thread has panicked".into()))).into()
    });
    for found in found {
        let found = found?;
        if found != wanted || wanted[0] < 1e-7 {
            return Err(format!("{found:?} m on a shared device, {wanted:?} m on one of its own").into());
        }
    }
    let (compiled, kernels) = (shared.work().compiled, shared.kernels().len() as u64);
    if compiled != kernels {
        return Err(format!("{kernels} kernels were compiled {compiled} times for four bodies").into());
    }
    Ok(())
}

fn soft_blocks_stand_on_each_other(gpu: &Gpu) -> Result<(), Failure> {
    let on_gpu = forces(&platform(gpu))?;
    let on_cpu = forces(&Platform::Cpu64)?;
    for (gpu, cpu) in on_gpu.iter().zip(&on_cpu) {
        if (gpu - cpu).abs() > APART * on_cpu[1].abs() || on_cpu.len() != 2 || on_cpu[1] < 0.03 {
            return Err(format!("forces under the blocks: {on_gpu:?} N and {on_cpu:?} N").into());
        }
    }
    Ok(())
}

/// Gradients cut short far from their end carry rounding on: the GPU may be this many times as far from the CPU path in f32 as that is from f64.
const ROUNDINGS: f64 = 4.0;

/// Iterations of the first steps of the pressed block with a limit that they cannot reach the tolerance in, and the centre's displacement, m.
fn limited(platform: &Platform, limit: u32) -> Result<Vec<(u32, f64)>, Failure> {
    let mut scene = read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/skin_block.toml"))?;
    scene.skins[0].cells = [8, 8];
    scene.solver.preconditioner = Preconditioner::Jacobi;
    (scene.solver.tolerance, scene.solver.max_iterations) = (1e-6, limit);
    let mut simulation = Simulation::new(&scene, platform)?;
    let mut out = vec![];
    for _ in 0..3 {
        let step = simulation.step(false)?;
        out.push((step.free.iterations, step.probes[0]));
    }
    Ok(out)
}

fn a_limit_of_iterations_is_kept_to_the_last_one(gpu: &Gpu) -> Result<(), Failure> {
    let platform = platform(gpu);
    for limit in [1, 3, 25] {
        let (on_gpu, on_cpu) = (limited(&platform, limit)?, limited(&Platform::Cpu32, limit)?);
        let exact = limited(&Platform::Cpu64, limit)?;
        for (((k, u), (_, wanted)), (_, exact)) in on_gpu.iter().zip(&on_cpu).zip(&exact) {
            let bound = (1e-3 * wanted.abs()).max(ROUNDINGS * (wanted - exact).abs());
            if *k != limit || (u - wanted).abs() > bound {
                return Err(format!("limit {limit}: {on_gpu:?} on the GPU, {on_cpu:?} on the CPU").into());
            }
        }
    }
    // one iteration more is seen
    let (three, four) = (limited(&Platform::Cpu32, 3)?, limited(&Platform::Cpu32, 4)?);
    if (three[0].1 - four[0].1).abs() <= 1e-3 * three[0].1.abs() {
        return Err(format!("{three:?} and {four:?} should differ").into());
    }
    Ok(())
}

/// Force on the sphere after some steps into a coarse skin of a law, N.
fn pressed(platform: &Platform, law: Law) -> Result<f64, Failure> {
    let mut scene = read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/verify/sphere_press_neo_hookean.toml"))?;
    (scene.time.integrator, scene.time.step) = (Integrator::ImplicitEuler, 0.1);
    let skin = &mut scene.skins[0];
    (skin.cells, skin.law) = ([10, 10], law);
    for layer in &mut skin.layers {
        (layer.cells, layer.second_share) = (1, 0.4);
        layer.fibres = Fibres { stiffness: 2.0 * layer.young, dispersion: 0.1, families: [0.9, -0.3], ..layer.fibres };
    }
    let mut simulation = Simulation::new(&scene, platform)?;
    let mut force = 0.0;
    for _ in 0..SINKING {
        let step = simulation.step(false)?;
        force = step.contact.force(BodyId::Deformable(0), None).length();
    }
    Ok(force)
}

fn a_sphere_presses_hyperelastic_skin_as_on_the_cpu(gpu: &Gpu) -> Result<(), Failure> {
    let platform = platform(gpu);
    // counter-test: hexahedra of small strain have another force
    let other = pressed(&platform, Law::Fem { element: Element::Bbar, corotational: true })?;
    for material in [Material::NeoHookean, Material::MooneyRivlin, Material::Holzapfel] {
        let law = Law::Hyperelastic(material);
        let (found, wanted) = (pressed(&platform, law)?, pressed(&Platform::Cpu64, law)?);
        super::report(gpu, &format!("{found:.5} N, on the CPU path {wanted:.5} N, corotational {other:.5} N"));
        let off = |force: f64| (force / wanted - 1.0).abs();
        if !(wanted > 0.01 && off(found) < 2e-3 && off(other) > 1e-2) {
            let forces = format!("{found:e} N, on the CPU path {wanted:e} N, corotational {other:e} N");
            return Err(format!("{material:?}: {forces}").into());
        }
    }
    Ok(())
}
