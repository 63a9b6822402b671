//! Runs of thousands of steps, and what they are compared by.

use super::forms::hard;
use cutis::math::V4;
use cutis::scene::Scene;
use cutis::step::{Platform, Simulation};

pub fn case(name: &str) -> Scene {
    let found = hard().into_iter().find(|(known, _)| known == name);
    found.unwrap_or_else(|| panic!("scenes/hard/{name}.toml is gone")).1
}

pub fn measured() -> bool {
    std::env::var_os("CUTIS_MEASURED").is_some()
}

pub fn simulate(scene: &Scene, platform: &Platform) -> Simulation {
    Simulation::new(scene, platform).expect("the scene runs anywhere")
}

pub fn displacements(simulation: &mut Simulation) -> Vec<V4<f64>> {
    simulation.bodies[0].snapshot().expect("the CPU path has no device to fail").u
}

/// Largest component, no number being larger than all.
pub fn largest(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(0.0, |m: f64, c| if m.is_nan() || c.abs() <= m { m } else { c.abs() })
}

pub fn apart(a: &[V4<f64>], b: &[V4<f64>]) -> f64 {
    largest(a.iter().flatten().zip(b.iter().flatten()).map(|(p, q)| p - q))
}

/// Skin of 8 × 8 × 3 cells that is pressed for half of the time and free for the other half.
pub fn pressed(steps: u32, half_free: bool) -> Scene {
    let mut scene = case("step_05ms");
    let skin = &mut scene.skins[0];
    skin.cells = [8, 8];
    skin.layers.iter_mut().for_each(|layer| layer.cells = 1);
    if half_free {
        scene.loads[0].end = 0.5 * f64::from(steps) * scene.time.step;
    }
    scene
}

/// Largest difference of the displacements on two platforms at every hundredth step, m, and the largest displacement, m.
pub fn difference_over(steps: u32, platforms: [&Platform; 2]) -> [f64; 2] {
    let scene = pressed(steps, true);
    let mut both = platforms.map(|platform| simulate(&scene, platform));
    let mut found = [0.0f64; 2];
    for step in 1..=steps {
        for simulation in &mut both {
            let report = simulation.step(false).expect("it runs");
            assert!(report.warnings.is_empty(), "step {step}: {:?}", report.warnings);
        }
        if step % 100 == 0 || step < 20 {
            let [a, b] = both.each_mut().map(displacements);
            found = [largest([found[0], apart(&a, &b)]), largest(b.iter().flatten().copied().chain([found[1]]))];
        }
    }
    found
}

/// Both solve to 1e-4 of a load, which on thin stiff layers over fat is up to ten times that of the displacement.
pub const PRECISIONS: f64 = 1e-3;
