//! Runs of shipped scenes, each a little different from the others, and what all of them must have in common.
//!
//! Run `seed` of a scene takes its cells, its precision and every relative change from the seed alone: moduli, toughness and thickness of
//! each layer, friction, length and depth of the path, by ±10^U(−12, −2) with one exponent per run. The hand stands over the skin as in
//! the shipped scene, however thick the skin is, and presses deeper or less by the same share.

use cutis::math::random::Random;
use cutis::report::run::{Options, run};
use cutis::scene::{Pose, ProbeKind, Scene, read};
use cutis::step::Platform;
use glam::{DQuat, DVec3};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicU32, Ordering};

/// Range of the exponent of the relative changes, decades.
const DECADES: [f64; 2] = [-12.0, -2.0];

/// One run's variation, all of it from its seed.
#[derive(Clone, Copy, Debug)]
pub struct Variation {
    pub seed: u64,
    /// Cells across, both ways.
    pub cells: u32,
    pub single: bool,
    /// Largest relative change.
    pub size: f64,
}

/// What a run left.
#[derive(Clone, Debug)]
pub struct Outcome {
    pub variation: Variation,
    pub warnings: BTreeMap<String, u64>,
    pub failures: Vec<String>,
    /// Longest step over the median step.
    pub longest: f64,
    /// ms
    pub median: f64,
    /// N
    pub peak: f64,
    /// Length of the wound at the top less that of the hand's path in the skin, cells; none where nothing cuts straight.
    pub overshoot: Option<f64>,
    /// Mean and most passes of the contact solve.
    pub passes: [f64; 2],
    /// Most row updates of the contact laws in a step.
    pub updates: f64,
}

/// Even numbers in [0, 1) from a seed.
fn random(seed: u64) -> impl FnMut() -> f64 {
    let mut random = Random::split_mix(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15));
    move || random.unit()
}

pub fn shipped(name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("scenes/{name}.toml"));
    let mut scene = read(&path).unwrap_or_else(|e| panic!("{e}"));
    scene.view.frames = 0;
    // a run by the wall clock is no repetition: the hands follow their trajectories
    scene.tools.iter_mut().for_each(|tool| tool.device = None);
    scene
}

fn top(scene: &Scene) -> f64 {
    scene.skins[0].layers.iter().map(|l| l.thickness).sum()
}

/// Points of a tool that may touch, tool frame, m.
fn touching(scene: &Scene, tool: usize) -> Vec<DVec3> {
    let tool = &scene.tools[tool];
    let edge = tool.blade.iter().flat_map(|b| b.edge.iter());
    let lines = tool.lines.iter().flat_map(|l| l.positions.iter());
    edge.chain(&tool.points).chain(lines).map(|p| DVec3::from_array(*p)).collect()
}

fn at(pose: &Pose, point: DVec3) -> DVec3 {
    DQuat::from_array(pose.rotation) * point + DVec3::from_array(pose.position)
}

/// The scene of a seed; `grids` are the cells to choose from.
pub fn varied(shipped: &Scene, grids: &[u32], seed: u64) -> (Scene, Variation) {
    let mut even = random(seed);
    let mut scene = shipped.clone();
    let cells = grids[(even() * grids.len() as f64) as usize];
    let single = even() < 0.5;
    let size = 10f64.powf(DECADES[0] + even() * (DECADES[1] - DECADES[0]));
    let mut factor = || 1.0 + size * (2.0 * even() - 1.0);
    scene.skins[0].cells = [cells, cells];
    let before = top(&scene);
    for layer in &mut scene.skins[0].layers {
        layer.young *= factor();
        layer.toughness *= factor();
        layer.thickness *= factor();
    }
    let (raised, after) = (top(&scene) - before, top(&scene));
    for probe in &mut scene.probes {
        if let ProbeKind::Displacement { point, .. }
        | ProbeKind::Strain { point, .. }
        | ProbeKind::Stress { point, .. } = &mut probe.kind
        {
            point[2] *= after / before;
        }
    }
    scene.contact.as_mut().expect("it has a tool").friction *= factor();
    for number in 0..scene.tools.len() {
        let points = touching(&scene, number);
        let stretch = [factor(), factor(), factor()];
        let first = scene.tools[number].trajectory[0];
        for pose in &mut scene.tools[number].trajectory {
            let lowest = points.iter().map(|p| (DQuat::from_array(pose.rotation) * *p).z).fold(f64::INFINITY, f64::min);
            let zero = [first.position[0], first.position[1], before - lowest];
            for axis in 0..3 {
                pose.position[axis] = zero[axis] + (pose.position[axis] - zero[axis]) * stretch[axis];
            }
            pose.position[2] += raised;
        }
    }
    (scene, Variation { seed, cells, single, size })
}

/// Extent along x of the edge's way below the skin's top by the hand's path, m; none of a scene without a blade.
fn way(scene: &Scene) -> Option<f64> {
    /// Parts of the edge that are looked at.
    const PARTS: usize = 100;
    let edge = &scene.tools[0].blade.as_ref()?.edge;
    let [tip, heel] = [edge.first()?, edge.last()?].map(|p| DVec3::from_array(*p));
    let top = top(scene);
    let parts =
        |pose: &Pose| (0..=PARTS).map(|k| at(pose, tip.lerp(heel, k as f64 / PARTS as f64))).collect::<Vec<_>>();
    let inside = scene.tools[0].trajectory.iter().flat_map(parts).filter(|p| p.z < top).map(|p| p.x);
    let [low, high] = inside.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], x| [a.min(x), b.max(x)]);
    (high > low).then_some(high - low)
}

/// Runs a variation on the CPU path; `steps` for a shortened run, whose checks are not evaluated.
pub fn outcome(scene: &Scene, variation: Variation, steps: Option<u32>, straight: bool) -> Outcome {
    static RUNS: AtomicU32 = AtomicU32::new(0);
    let number = RUNS.fetch_add(1, Ordering::Relaxed); // runs of one seed may be at work at a time
    let out = std::env::temp_dir().join(format!("cutis-perturbed-{}-{number}", std::process::id()));
    let platform = if variation.single { Platform::Cpu32 } else { Platform::Cpu64 };
    let options = Options { steps, ..Options::new(platform, &out) };
    let summary = run(scene, &options, &mut |_| {}).unwrap_or_else(|e| panic!("{variation:?}: {e}"));
    std::fs::remove_dir_all(&out).expect("it was made for this run");
    let report = summary.report;
    let median = report.step_ms.median.unwrap_or(0.0);
    let cell = scene.skins[0].size[0] / f64::from(variation.cells);
    let whole = straight && steps.is_none();
    Outcome {
        variation,
        failures: summary.failures.iter().map(ToString::to_string).collect(),
        longest: report.step_ms.max.unwrap_or(0.0) / median,
        median,
        peak: report.contact_force_n_max,
        overshoot: way(scene).filter(|_| whole).map(|way| (report.cut.length_top_mm * 1e-3 - way) / cell),
        passes: [report.contact.passes_mean, f64::from(report.contact.passes_max)],
        updates: report.costs.row_updates.max,
        warnings: report.warnings,
    }
}
