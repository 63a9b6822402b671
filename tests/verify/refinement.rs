//! Iterative refinement: f32 with a residual from f64 against the same step in f64.
//!
//! One solve for the balance of the skin block: the hardest shipped system, since stiffness stands alone (no inertia beside it).

use super::Everywhere;
use super::setup::{apart, in_long_steps, measured};
use cutis::math::V4;
use cutis::scene::Scene;
use cutis::step::{Platform, Simulation, StepReport};

pub const EVERYWHERE: &[Everywhere] = &[("refinement_reaches_what_single_precision_misses", reaches)];

fn block(tolerance: f64, refinements: u32) -> Scene {
    let mut scene = in_long_steps("verify/skin_block_0499.toml");
    (scene.solver.tolerance, scene.solver.refinements) = (tolerance, refinements);
    scene
}

fn step(platform: &Platform, scene: &Scene) -> (Vec<V4<f64>>, StepReport) {
    let mut simulation = Simulation::new(scene, platform).unwrap_or_else(|e| panic!("{e}"));
    let report = simulation.step(true).unwrap_or_else(|e| panic!("{e}"));
    (simulation.bodies[0].snapshot().unwrap_or_else(|e| panic!("{e}")).u, report)
}

/// Largest error that rounding a displacement to f32 makes, relative L2, with some room.
const ROUNDED: f64 = 6e-8;

fn reaches(platform: &Platform) {
    let (exact, _) = step(&Platform::Cpu64, &block(1e-12, 0));
    let (plain, once) = step(platform, &block(1e-7, 0));
    let (refined, again) = step(platform, &block(1e-7, 8));
    let (before, after) = (apart(&plain, &exact), apart(&refined, &exact));
    measured(&format!("step error unrefined {platform:?}"), before, 0.0);
    measured(&format!("step error refined {platform:?}"), after, 0.0);
    assert!(again.free.converged && again.residual <= 1e-7, "{:e}", again.residual);
    assert!(after < ROUNDED, "{after:e}");
    if *platform == Platform::Cpu64 {
        assert_eq!(again.refinements, 0, "nothing to refine");
        return;
    }
    // counter-test: without refinement the recurrence promises the same and misses it by far
    assert!(once.free.converged && once.residual <= 1e-7, "{:e}", once.residual);
    assert!(before > 10.0 * ROUNDED && again.refinements > 0, "{before:e}");
}
