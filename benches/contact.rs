//! A dental probe presses the skin (`scenes/dental_probe.toml`): cost and force error of contact corrections, tolerances and passes.
//! Prints Markdown; every time stands beside its error.
//!
//! The reference solves with a sparse factor and everything to 10⁻⁹; before a time counts, multigrid to the same tolerance must find the
//! same forces. Errors are of the force on the instrument as a vector: at the end of the hold, as a share of the force then, and the
//! largest over the run, as a share of the largest force. Times are of the steps from first touch to the withdrawal, as ratios to the
//! default scene's in the same round; variants take turns.
//!
//! `cargo bench --bench contact` takes about five minutes on two cores; `-- test-form` has cells of twice the width.

use cutis::scene::{Correction, Load, Loop, Preconditioner, Scene, read};
use cutis::step::{Platform, Simulation};
use glam::DVec3;
use std::ops::Range;
use std::path::Path;
use std::time::Instant;

/// Rounds whose median counts; variants take turns.
const ROUNDS: usize = 3;
/// Steps in which the instrument presses: from 0.05 s to 0.4 s.
const PRESSING: Range<usize> = 10..80;
/// The last step of the hold, at 0.35 s.
const HELD: usize = 69;
/// Tolerance of the reference.
const TIGHT: f64 = 1e-9;
/// Two ways to the reference agree to this part of the force: what 10⁻⁹ in each of a hundred steps may add up to, tenfold.
const AGREED: f64 = 1e-6;
/// The default scene is not further from the reference than this, or the table is of a broken engine.
const DEFAULT_ERROR: f64 = 0.02;

/// A row of the table.
struct Variant {
    name: String,
    scene: Scene,
    runs: Vec<Run>,
}

/// What one run gave.
#[derive(Clone, Default)]
struct Run {
    force: Vec<DVec3>, // [step] N, on the instrument
    passes: Vec<u32>,  // [step]
    ms: Vec<f64>,      // [step]
    columns: u32,
    column_iterations: u32, // most
    exhausted: u32,         // steps that wanted more passes
}

fn run(scene: &Scene) -> Run {
    let mut simulation = Simulation::new(scene, &Platform::Cpu64).expect("the CPU holds it");
    let mut out = Run::default();
    for _ in 0..scene.time.steps() {
        let begin = Instant::now();
        let report = simulation.step(false).expect("the device works");
        out.ms.push(begin.elapsed().as_secs_f64() * 1e3);
        out.force.push(report.contact.on_tool.first().map_or(DVec3::ZERO, |f| DVec3::from_array(*f)));
        out.passes.push(report.contact.passes);
        out.columns += report.contact.columns;
        out.column_iterations = out.column_iterations.max(report.contact.column_iterations);
        out.exhausted += report.warnings.get("contact_passes_exhausted").copied().unwrap_or(0);
    }
    out
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn largest(force: impl Iterator<Item = DVec3>) -> f64 {
    force.map(DVec3::length).fold(0.0, |most, f| if f.is_nan() { f64::NAN } else { most.max(f) })
}

/// Force errors at the end of the hold and over the run, as shares.
fn errors(found: &Run, exact: &Run) -> [f64; 2] {
    let apart: Vec<DVec3> = found.force.iter().zip(&exact.force).map(|(a, b)| *a - *b).collect();
    let held = apart[HELD].length() / exact.force[HELD].length();
    [held, largest(apart.into_iter()) / largest(exact.force.iter().copied())]
}

/// The scene with everything solved to the reference's tolerance.
fn tight(scene: &Scene, preconditioner: Preconditioner) -> Scene {
    let mut scene = scene.clone();
    (scene.solver.preconditioner, scene.solver.tolerance) = (preconditioner, TIGHT);
    let law = scene.contact.as_mut().expect("it has a tool");
    (law.tolerance, law.column_tolerance) = (TIGHT, TIGHT);
    scene
}

/// The skin alone under a pressure that comes to the instrument's force, 0.16 N.
fn without_tool(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    scene.tools.clear();
    scene.contact = None;
    let half = 2e-3;
    let load = Load::on_top(&scene.skins[0], 1e4, [-half; 2], [half; 2]);
    scene.loads.push(Load { start: 0.05, end: 0.4, ..load });
    scene
}

fn variants(scene: &Scene) -> Vec<Variant> {
    let mut list = vec![];
    let mut add = |name: &str, scene: Scene| list.push(Variant { name: name.into(), scene, runs: vec![] });
    add("exact (default: tolerance 1e-3, columns 0.2, 16 passes)", scene.clone());
    let mut with = |name: &str, change: &dyn Fn(&mut Scene)| {
        let mut scene = scene.clone();
        change(&mut scene);
        add(name, scene);
    };
    for (tolerance, name) in [(1e-1, "1e-1"), (1e-2, "1e-2"), (1e-5, "1e-5")] {
        with(&format!("exact, tolerance {name}"), &|s| law(s).tolerance = tolerance);
    }
    for (tolerance, name) in [(0.05, "0.05"), (1e-3, "1e-3")] {
        with(&format!("exact, columns {name}"), &|s| law(s).column_tolerance = tolerance);
    }
    for passes in [1, 2] {
        with(&format!("exact, max_passes {passes}"), &|s| {
            law(s).max_passes = passes;
        });
    }
    with("exact, max_passes 1, columns 1e-3", &|s| (law(s).max_passes, law(s).column_tolerance) = (1, 1e-3));
    with("exact, free motion to 1e-6", &|s| s.solver.tolerance = 1e-6);
    with("exact, substeps 2", &|s| s.time.substeps = 2);
    with("precomputed", &|s| law(s).correction = Correction::Precomputed);
    with("uncoupled (own block of A at each node)", &|s| law(s).correction = Correction::Uncoupled);
    for (stiffness, substeps) in PENALTIES {
        with(&format!("penalty, {stiffness} N/m, substeps {substeps}"), &|s| {
            (law(s).forces, s.time.substeps) = (Loop::Penalty(stiffness), substeps);
        });
    }
    add("no tool, 10 kPa on 4×4 mm", without_tool(scene));
    list
}

/// Springs of the penalty loop, N/m, and substeps.
const PENALTIES: [(f64, u32); 4] = [(100.0, 1), (1000.0, 1), (1000.0, 4), (3000.0, 10)];

fn law(scene: &mut Scene) -> &mut cutis::scene::Contact {
    scene.contact.as_mut().expect("it has a tool")
}

/// Both ways to the exact forces, which must agree.
fn reference(scene: &Scene) -> Run {
    let by_factor = run(&tight(scene, Preconditioner::Direct));
    let by_cycles = run(&tight(scene, Preconditioner::Multigrid));
    let [held, most] = errors(&by_cycles, &by_factor);
    println!(
        "Reference: {:.5} N at the end of the hold, {:.5} N at most;",
        by_factor.force[HELD].length(),
        largest(by_factor.force.iter().copied())
    );
    println!("factor and multigrid, both to {TIGHT:e}, are {held:.0e} apart at the hold and {most:.0e} over the run.");
    assert!(by_factor.force[HELD].length() > 0.05, "the instrument does not press");
    assert!(held <= AGREED, "the two exact solves are {held} apart: neither is a reference");
    by_factor
}

fn line(variant: &Variant, default: &[Run], exact: &Run) {
    let found = &variant.runs[0];
    let touched: Vec<f64> = PRESSING.map(|k| f64::from(found.passes[k])).collect();
    let most = found.passes.iter().max().copied().unwrap_or(0);
    let ratio =
        |time: &dyn Fn(&Run) -> f64| median(variant.runs.iter().zip(default).map(|(a, b)| time(a) / time(b)).collect());
    let middle = ratio(&|r| median(r.ms[PRESSING].to_vec()));
    let whole = ratio(&|r| mean(&r.ms[PRESSING]));
    let shares = if variant.scene.tools.is_empty() {
        "– | –".into()
    } else {
        let [held, run] = errors(found, exact);
        format!("{} | {}", percent(held), percent(run))
    };
    println!(
        "| {} | {shares} | {:.1} / {most} | {} | {}, {} | {middle:.2} | {whole:.2} |",
        variant.name,
        mean(&touched),
        found.exhausted,
        found.columns,
        found.column_iterations
    );
}

/// A share in percent, to two digits.
fn percent(share: f64) -> String {
    let percent = 100.0 * share;
    match percent {
        p if p >= 10.0 => format!("{p:.0}"),
        p if p >= 1.0 => format!("{p:.1}"),
        p if p >= 0.1 => format!("{p:.2}"),
        p => format!("{p:.0e}"),
    }
}

fn main() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut scene = read(&root.join("scenes/dental_probe.toml")).expect("the shipped scene is valid");
    if std::env::args().any(|a| a == "test-form") {
        scene = scene.in_test_form();
    }
    let [across, along] = scene.skins[0].cells;
    println!(
        "{across}×{along} cells; CPU f64, {} threads",
        std::thread::available_parallelism().map_or(1, usize::from)
    );
    let exact = reference(&scene);
    let mut variants = variants(&scene);
    for _ in 0..ROUNDS {
        for variant in &mut variants {
            let again = run(&variant.scene);
            if let Some(first) = variant.runs.first() {
                let same = first.force.iter().zip(&again.force).all(|(a, b)| a == b || a.is_nan() && b.is_nan());
                assert!(same, "{}: a run does not repeat", variant.name);
            }
            variant.runs.push(again);
        }
    }
    println!(
        "\n| forces | error at hold % | over the run % | passes, mean / most | steps cut short | columns, most iterations | time per step, median | mean |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    let default = variants[0].runs.clone();
    for variant in &variants {
        line(variant, &default, &exact);
    }
    let [held, _] = errors(&default[0], &exact);
    assert!(held <= DEFAULT_ERROR, "the default is {held} off: these times mean nothing");
}
