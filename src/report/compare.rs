//! Compares a scene on the GPU with the CPU path in f64: one row per quantity, each with its bound.
//!
//! Before contact, fields are comparable node by node. A pressed patch therefore runs without tools, with 10 kPa on the middle of the top:
//! once solved tightly, once to the scene's own tolerance. After first contact trajectories are chaotic; whole runs are compared by
//! invariants and by the peak force.

use super::Refused;
use super::inspect::{self, Purpose};
use crate::backend::{Device, Snapshot};
use crate::error::Result;
use crate::math::V4;
use crate::scene::{Load, Scene, Skin};
use crate::step::{Body, Platform, Simulation};

/// Pressure on the middle of the top, Pa; it indents the incision's skin by about a tenth of its thickness.
const PRESSURE: f64 = 10e3;
/// Half the side of the pressed square, m.
const HALF_SIDE: f64 = 2e-3;
/// Steps of the pressed patch, 0.1 s at 5 ms, by which the skin has settled.
const PRESSED_STEPS: u32 = 20;
/// Tight tolerance: far below the bound, within the reach of f32 conjugate gradients.
const TIGHT: f64 = 1e-6;
/// Bound on displacements solved tightly: f32 rounding (6e-8) times the condition of thin stiff layers on fat, about 1e3, over 20 steps.
const TIGHT_BOUND: f64 = 2e-4;
/// Bound on displacements solved to the scene's tolerance: relative residuals of 1e-3 on both paths leave errors of a few 1e-3 each.
const OWN_BOUND: f64 = 1e-2;
/// Relative bound on the peak force.
const FORCE_BOUND: f64 = 0.05;
/// Relative bound on remaining mass against remaining cells: nodal masses are rounded to f32 (6e-8) and added in f64.
const MASS_BOUND: f64 = 1e-6;
/// Relative bound on the number of cut links or springs; one may always differ.
const CUT_BOUND: f64 = 0.05;

/// One compared quantity.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Row {
    /// Name, with its unit.
    pub name: String,
    /// Value on the CPU path in f64.
    pub cpu: f64,
    /// Value on the GPU.
    pub gpu: f64,
    /// Difference as bounded: relative to the CPU's value unless the name says otherwise.
    pub difference: f64,
    /// Largest difference that passes.
    pub bound: f64,
}

impl Row {
    /// Whether it is within its bound.
    pub fn holds(&self) -> bool {
        self.difference <= self.bound // false for NaN
    }
}

/// Result of a comparison.
#[derive(Clone, Debug)]
pub struct Comparison {
    /// Device of the GPU run.
    pub gpu: Device,
    /// Device of the CPU run.
    pub cpu: Device,
    /// Steps of the unchanged scene.
    pub steps: u32,
    /// Rows, in the order computed.
    pub rows: Vec<Row>,
}

/// Compares a scene on both paths; calls `stage` with the name of each computation.
///
/// # Errors
/// Without a fitting adapter, or if the scene is too large.
pub fn compare(scene: &Scene, adapter: Option<&str>, steps: u32, stage: &mut dyn FnMut(&str)) -> Result<Comparison> {
    if scene.skins.is_empty() {
        return Err(Refused::NothingToCompare.into());
    }
    inspect::fits(scene, Purpose::Double)?;
    let gpu = Platform::Gpu(adapter.map(String::from));
    let mut rows = vec![];
    for (tolerance, bound) in [(TIGHT, TIGHT_BOUND), (scene.solver.tolerance, OWN_BOUND)] {
        let pressed = pressed(scene, tolerance);
        stage(&format!("pressing the patch, solved to {tolerance:e}, on the GPU"));
        let on_gpu = after(&pressed, &gpu)?;
        stage(&format!("pressing the patch, solved to {tolerance:e}, on the CPU"));
        let on_cpu = after(&pressed, &Platform::Cpu64)?;
        let name = format!("largest displacement under 10 kPa, solved to {tolerance:e} (mm; difference of fields)");
        let largest = largest(&on_cpu);
        let apart: Vec<[f64; 4]> =
            on_gpu.iter().zip(&on_cpu).map(|(a, b)| std::array::from_fn(|n| a[n] - b[n])).collect();
        rows.push(Row {
            name,
            cpu: largest * 1e3,
            gpu: self::largest(&on_gpu) * 1e3,
            difference: ratio(self::largest(&apart), largest),
            bound,
        });
    }
    stage(&format!("the scene itself, {steps} steps, on the GPU"));
    let on_gpu = Outcome::of(scene, &gpu, steps)?;
    stage(&format!("the scene itself, {steps} steps, on the CPU"));
    let on_cpu = Outcome::of(scene, &Platform::Cpu64, steps)?;
    rows.extend(outcome_rows(&on_cpu, &on_gpu));
    Ok(Comparison { gpu: on_gpu.device, cpu: on_cpu.device, steps, rows })
}

/// The deformable bodies alone, under a pressure on the middle of their tops.
fn pressed(scene: &Scene, tolerance: f64) -> Scene {
    let load = |(body, skin): (usize, &Skin)| {
        let max = skin.size.map(|size| HALF_SIDE.min(0.5 * size));
        Load { body, ..Load::on_top(skin, PRESSURE, max.map(|m| -m), max) }
    };
    let mut pressed = scene.clone();
    (pressed.tools, pressed.contact, pressed.probes) = (vec![], None, vec![]);
    (pressed.planes, pressed.attachments) = (vec![], vec![]);
    pressed.loads = scene.skins.iter().enumerate().map(load).collect();
    pressed.solver.tolerance = tolerance;
    pressed.solver.floor = 0.0;
    pressed
}

/// `[node of all bodies]` displacements, m.
fn after(scene: &Scene, platform: &Platform) -> Result<Vec<V4<f64>>> {
    let mut simulation = Simulation::new(scene, platform)?;
    for _ in 0..PRESSED_STEPS {
        simulation.step(false)?;
    }
    Ok(simulation.snapshots()?.into_iter().flat_map(|s| s.u).collect())
}

/// Length of the longest vector, m; NaN if one is not finite.
fn largest(u: &[[f64; 4]]) -> f64 {
    let length = |u: &[f64; 4]| (u[0] * u[0] + u[1] * u[1] + u[2] * u[2]).sqrt();
    u.iter().map(length).fold(0.0, |a, b| if b.is_nan() || b > a { b } else { a })
}

/// Difference relative to `scale`; 0 for 0/0.
fn ratio(difference: f64, scale: f64) -> f64 {
    if difference == 0.0 { 0.0 } else { difference.abs() / scale.abs() }
}

/// Invariants of a run.
struct Outcome {
    device: Device,
    peak_force: f64,
    /// Cut links or springs.
    cut: usize,
    /// Remaining mass minus that of the remaining cells, relative to the latter.
    mass_error: f64,
    mass: f64,
    non_finite: usize,
}

impl Outcome {
    fn of(scene: &Scene, platform: &Platform, steps: u32) -> Result<Self> {
        let mut simulation = Simulation::new(scene, platform)?;
        let mut peak_force = 0.0f64;
        for _ in 0..steps {
            peak_force = peak_force.max(simulation.step(false)?.contact.largest_on_tools());
        }
        let state = simulation.snapshots()?;
        let mass: f64 = state.iter().flat_map(|s| &s.dofs).map(|f| f[3]).sum();
        let mass_left = |body: &Body| body.model.mechanics().mass_left(&body.model, &body.wound);
        let expected = simulation.bodies.iter().map(mass_left).sum::<f64>();
        let totals = simulation.totals();
        Ok(Self {
            device: simulation.device(),
            peak_force,
            cut: totals.links + totals.springs_removed,
            mass_error: ratio(mass - expected, expected),
            mass,
            non_finite: state.iter().map(Snapshot::non_finite).sum(),
        })
    }
}

fn outcome_rows(cpu: &Outcome, gpu: &Outcome) -> Vec<Row> {
    let row = |name: &str, cpu: f64, gpu: f64, difference: f64, bound: f64| Row {
        name: name.into(),
        cpu,
        gpu,
        difference,
        bound,
    };
    let force = ratio(gpu.peak_force - cpu.peak_force, cpu.peak_force);
    let apart = gpu.cut.abs_diff(cpu.cut) as f64;
    let allowed = (CUT_BOUND * cpu.cut as f64).max(1.0);
    let non_finite = (cpu.non_finite + gpu.non_finite) as f64;
    let error = cpu.mass_error.max(gpu.mass_error);
    vec![
        row("peak contact force (N)", cpu.peak_force, gpu.peak_force, force, FORCE_BOUND),
        row("links or springs cut (difference is a count)", cpu.cut as f64, gpu.cut as f64, apart, allowed),
        row("live mass (g; difference from the live cells)", cpu.mass * 1e3, gpu.mass * 1e3, error, MASS_BOUND),
        row("nodes that are not finite (count)", cpu.non_finite as f64, gpu.non_finite as f64, non_finite, 0.0),
    ]
}
