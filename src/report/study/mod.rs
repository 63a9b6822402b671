//! Speed against error: runs a scene in many settings and measures the cost and the error of each.
//!
//! Errors are relative, of the probes and the forces on tools over the whole run (of their final values where the scene states known ones):
//! the root of the sum of squares over all samples of one kind of quantity, the largest over the kinds. Displacements and stresses of points
//! that `[study] probes` does not name are measured beside the total. Errors are separated by runs that differ in one thing only:
//!
//! | error | between |
//! |---|---|
//! | discretisation | this grid and element, solved exactly at the shortest step, and the reference |
//! | time step | this step and the shortest, both solved exactly on this grid |
//! | solver | this solver and contact correction in f64, and solved exactly |
//! | rounding | this precision and f64, all else equal |
//! | total | this run and the reference |
//! | law | this run and the reference by the most complete law: large strain, where the scene's law is one of small strain |
//!
//! The reference is the finest grid at the shortest step, solved exactly (a sparse factor, or conjugate gradients to 10⁻⁹), or the known
//! values. Times are medians over the steps of a run, of the fastest of repeated runs; each is also stated as a ratio to the first setting,
//! the scene's own on the CPU path in f64.

mod files;
mod plot;
mod settings;
mod trace;

pub use settings::{Setting, Stop, element_word, grid_words};
pub use trace::{KINDS, Signal, Trace};

use super::inspect::{self, Purpose};
use super::{Listing, StudyUnfit as Unfit};
use crate::error::Result;
use crate::gpu::{Gpu, adapters};
use crate::scene::Scene;
use crate::step::Platform;
use settings::{Axes, exact, most_complete, own, quick, scene_of};
use std::path::PathBuf;
use std::time::{Duration, Instant};
use trace::{Runs, apart, apart_in, at_shortest, signals};

/// A quick study stops each run after this time,
const QUICK_RUN: Duration = Duration::from_secs(12);
/// starts no run after this one,
const QUICK_BEGIN: Duration = Duration::from_secs(90);
/// and stops all runs at this one.
const QUICK_END: Duration = Duration::from_secs(110);
/// Most cells of its reference; more take longer to set up than the study may.
const QUICK_CELLS: f64 = 1e5;
/// Most steps of a run.
const MOST_STEPS: f64 = 1e6;

/// Options of a study.
#[derive(Clone, Debug)]
pub struct Options {
    /// Adapter to run on beside the CPU path.
    pub gpu: Option<Platform>,
    /// Under two minutes: one setting on the scene's grid for it, and its variations in one thing.
    pub quick: bool,
    /// Time limit of a run, s.
    pub limit_s: f64,
    /// Repetitions of each setting; the fastest counts, since other load can only slow a run.
    pub repeats: u32,
    /// Folder for study.csv, study.md, study.svg.
    pub out: PathBuf,
}

/// A setting with its results.
#[derive(Clone, Debug)]
pub struct Row {
    /// The setting.
    pub setting: Setting,
    /// Its run.
    pub trace: Trace,
    /// Error of this grid against the reference. Errors are relative, none if a run was cut short.
    pub error_discretisation: Option<f64>,
    /// Error of this solver against an exact one.
    pub error_solver: Option<f64>,
    /// Error of this precision against f64.
    pub error_rounding: Option<f64>,
    /// Error of this step against the shortest.
    pub error_step: Option<f64>,
    /// Error of this run against the reference.
    pub error_total: Option<f64>,
    /// Error of this run against the reference by the most complete law; none where there is no such law or its run failed.
    pub error_law: Option<f64>,
    /// Error of this run against the reference by kind ([`KINDS`]).
    pub by_kind: [Option<f64>; KINDS.len()],
    /// On the Pareto front: no other run takes less time for the scene and has a smaller error.
    pub pareto: bool,
}

impl Row {
    /// Time per step over the step: below 1 it runs in real time.
    pub fn real_time(&self) -> f64 {
        self.trace.ms_per_step / (self.setting.step * 1e3)
    }
}

/// Result of a study.
#[derive(Clone, Debug)]
pub struct Study {
    /// Scene file.
    pub scene: String,
    /// Processor and threads.
    pub machine: String,
    /// The GPU, if used.
    pub adapter: Option<String>,
    /// Description of the reference.
    pub reference: String,
    /// The law that errors of the law are against, or why there are none.
    pub law: String,
    /// Quantities that total errors are of.
    pub signals: Vec<String>,
    /// Quantities that are measured beside them.
    pub beside: Vec<String>,
    /// Poisson's ratios of the layers, without duplicates.
    pub poisson: Vec<f64>,
    /// Rows, in the order run.
    pub rows: Vec<Row>,
    /// Settings that could not be run, with the reason.
    pub failed: Vec<(Setting, String)>,
    /// Variants that a quick study had no time for.
    pub left_out: usize,
    /// Step of the first setting, s.
    pub step: f64,
    /// Time that the ratios refer to: ms per step of the first setting, the scene's own on the CPU path in f64.
    pub own_ms: Option<f64>,
}

/// Progress between two steps of a study.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Completed runs.
    pub run: usize,
    /// Largest number of runs.
    pub runs: usize,
    /// Fraction of the work done, by estimated costs.
    pub share: f64,
}

/// Studies a scene and writes its three files; calls `progress` after every step.
///
/// # Errors
/// If the scene has rigid bodies alone, a grid does not fit its regions or probes, no adapter fits, or the folder cannot be written.
pub fn study(scene: &Scene, options: &Options, progress: &mut dyn FnMut(&Progress)) -> Result<Study> {
    let start = Instant::now();
    let signals = signals(scene);
    if scene.skins.is_empty() || signals.is_empty() {
        return Err(Unfit::Nothing.of(scene).into());
    }
    // settings to run, and their reference
    let axes = Axes::new(scene, options.gpu.as_ref());
    let first = if options.quick { quick(scene) } else { own(scene) };
    let variants = if options.quick { axes.star(scene, &first) } else { axes.all(scene, &first) };
    let reference = reference(scene, options.quick);
    let all_steps = scene.study.all_steps(&scene.time);
    let duration = scene.study.duration.unwrap_or(scene.time.duration);
    let duration = (duration / all_steps[0]).round().max(1.0) * all_steps[0];
    let known = !scene.study.known.is_empty();
    let mut runs = Runs {
        scene,
        signals,
        duration,
        every: (!known).then_some(all_steps[0]),
        limit: match options.quick {
            true => QUICK_RUN,
            false => Duration::try_from_secs_f64(options.limit_s).unwrap_or(Duration::MAX),
        },
        end: options.quick.then(|| start + QUICK_END),
        done: vec![],
        tried: vec![],
        count: [0; 2],
        cost: [0.0; 2],
        progress,
    };
    // refuse what cannot run before anything takes time
    let mut folder = files::open(&options.out)?;
    if let Some(Platform::Gpu(text)) = &options.gpu {
        Gpu::open(text.as_deref())?; // without an adapter there is no study
    }
    if duration / all_steps[all_steps.len() - 1] > MOST_STEPS {
        return Err(Unfit::Steps { most: MOST_STEPS }.of(scene).into());
    }
    let cells = settings::cells(scene, reference.refinement);
    if options.quick && cells > QUICK_CELLS {
        return Err(Unfit::Cells { cells, most: QUICK_CELLS }.of(scene).into());
    }
    // all runs that the rows need, each once, and the repetitions; their costs weigh the progress
    let settings = variants.iter().flat_map(|s| runs.needed(s));
    let mut wanted: Vec<(Setting, bool)> = vec![];
    let complete = most_complete(scene).map(|law| at_shortest(scene, &Setting { law, ..reference.clone() }));
    let by_law = complete.iter().filter(|complete| known || **complete != reference).cloned();
    let references = (!known).then(|| reference.clone()).into_iter().chain(by_law).map(|setting| (setting, true));
    for run in settings.chain(references) {
        if !wanted.contains(&run) {
            // refused before the first run
            inspect::fits(&scene_of(scene, &run.0, duration, run.1)?, Purpose::Single)?;
            wanted.push(run);
        }
    }
    let again = variants.iter().cycle().take(variants.len() * (options.repeats.max(1) as usize - 1));
    wanted.extend(again.map(|setting| (setting.clone(), false)));
    runs.count[1] = wanted.len();
    runs.cost[1] = wanted.iter().map(|(setting, exactly)| runs.cost_of(setting, *exactly)).sum();
    // the reference itself: known values, or the finest run
    let course = match known {
        true => vec![scene.study.known.iter().map(|(_, value)| *value).collect()],
        false => runs.whole(&reference, "the reference")?.samples,
    };
    // the same by the most complete law; without it there are no errors of the law
    let (law, by_law) = match &complete {
        None => ("none: no law of large strain takes the constants of this body".into(), None),
        Some(setting) => match runs.whole(setting, "the reference by the most complete law") {
            Ok(trace) => (described_run(scene, setting), Some(trace.samples)),
            Err(error) => (format!("none: {error}"), None),
        },
    };
    let mut study = Study {
        scene: scene.file.display().to_string(),
        machine: machine(),
        adapter: options.gpu.as_ref().and_then(adapter),
        reference: described(scene, &reference),
        law,
        signals: named(scene, &runs.signals, true),
        beside: named(scene, &runs.signals, false),
        poisson: poisson(scene),
        rows: vec![],
        failed: vec![],
        left_out: 0,
        step: first.step,
        own_ms: None,
    };
    // a row per setting; writing after each leaves the results of a killed study
    for setting in &variants {
        if options.quick && start.elapsed() > QUICK_BEGIN {
            study.left_out += 1;
            continue;
        }
        match row(&mut runs, setting, &course, by_law.as_deref()) {
            Ok(row) => study.rows.push(row),
            Err(error) => study.failed.push((setting.clone(), error.to_string())),
        }
        study.write(&first, &mut folder)?;
    }
    // repetitions keep the fastest time of each setting
    for _ in 1..options.repeats {
        for row in &mut study.rows {
            row.trace.keep_faster(&runs.run(&row.setting, false)?);
            runs.advance(&row.setting, false);
        }
        study.write(&first, &mut folder)?;
    }
    Ok(study)
}

impl Study {
    /// Marks the Pareto front and writes the files for the runs so far.
    fn write(&mut self, first: &Setting, folder: &mut Listing) -> Result<()> {
        mark_front(&mut self.rows);
        self.own_ms = self.rows.iter().find(|r| r.setting == *first).map(|r| r.trace.ms_per_step);
        files::write(self, folder)
    }

    /// Rows as JSON with the columns of study.csv.
    pub fn to_json(&self) -> serde_json::Value {
        files::json(self)
    }

    /// Settings that could not be run with the reason, one line each.
    pub fn failures(&self) -> Vec<String> {
        files::failed_lines(self)
    }

    /// Fastest setting within each of several errors, one line each.
    pub fn advice(&self) -> Vec<String> {
        files::advice_lines(self)
    }
}

/// Runs a setting, and the runs that its errors refer to.
fn row(runs: &mut Runs, setting: &Setting, course: &[Vec<f64>], by_law: Option<&[Vec<f64>]>) -> Result<Row> {
    let [own, twin, exactly, shortest] = runs.needed(setting).map(|(setting, exactly)| runs.get(&setting, exactly));
    let (own, twin, exactly, shortest) = (own?, twin?, exactly?, shortest?);
    let signals = &runs.signals;
    let error = |a: &Trace, b: &Trace| (a.whole() && b.whole()).then(|| apart(&a.samples, &b.samples, course, signals));
    let from = |a: &Trace, course: &[Vec<f64>]| a.whole().then(|| apart(&a.samples, course, course, signals));
    Ok(Row {
        setting: setting.clone(),
        error_discretisation: from(&shortest, course),
        error_solver: error(&twin, &exactly),
        error_rounding: error(&own, &twin),
        error_step: error(&exactly, &shortest),
        error_total: from(&own, course),
        error_law: by_law.and_then(|course| from(&own, course)),
        by_kind: KINDS.map(|kind| own.whole().then(|| apart_in(kind, &own.samples, course, course, signals)).flatten()),
        pareto: false,
        trace: own,
    })
}

/// Setting of the reference: finest grid, shortest step, solved exactly with the scene's own element.
fn reference(scene: &Scene, quick: bool) -> Setting {
    // meshes are not refined
    let twice = if scene.skins.iter().any(|skin| skin.mesh.is_some()) { 1.0 } else { 2.0 };
    let finest = scene.study.finest_grid().max(twice);
    let grid = if scene.study.reference_grid > 0.0 { scene.study.reference_grid } else { finest };
    let grid = if quick { grid.min(2.0 * settings::quick(scene).refinement) } else { grid };
    at_shortest(scene, &exact(scene, &Setting { refinement: grid, ..own(scene) }))
}

/// Marks the rows that no other beats in both time for the scene and total error.
fn mark_front(rows: &mut [Row]) {
    let point = |row: &Row| {
        let error = row.error_total.filter(|e| e.is_finite())?;
        Some((row.real_time(), error))
    };
    let points: Vec<Option<(f64, f64)>> = rows.iter().map(point).collect();
    for (k, row) in rows.iter_mut().enumerate() {
        let Some((ms, error)) = points[k] else { continue };
        let beats = |other: &(f64, f64)| other.0 <= ms && other.1 <= error && (other.0 < ms || other.1 < error);
        row.pareto = !points.iter().flatten().any(beats);
    }
}

/// Names of the signals that are counted, or of those beside them.
fn named(scene: &Scene, signals: &[Signal], counted: bool) -> Vec<String> {
    let name = |signal: &Signal| match signal.probe {
        Some(probe) => scene.probes[probe].name.clone(),
        None => "force on the tools".into(),
    };
    signals.iter().filter(|signal| signal.counted == counted).map(name).collect()
}

fn described(scene: &Scene, reference: &Setting) -> String {
    let known = &scene.study.known;
    if !known.is_empty() {
        let values = known.iter().map(|(probe, value)| format!("{} = {value}", scene.probes[*probe].name));
        return format!("known values at the end: {}", values.collect::<Vec<_>>().join(", "));
    }
    described_run(scene, reference)
}

fn described_run(scene: &Scene, reference: &Setting) -> String {
    let how = if reference.stop == Stop::Exact { "a sparse factor" } else { "conjugate gradients to 1e-9" };
    let (law, grid, step) = (element_word(reference.law), reference.refinement, reference.step * 1e3);
    let cells = settings::on_grid(scene, grid).map(|scene| format!(" ({})", grid_words(&scene))).unwrap_or_default();
    format!("{law} on {grid} times the scene's cells along each axis{cells}, steps of {step} ms, {how}, f64")
}

fn poisson(scene: &Scene) -> Vec<f64> {
    let mut all: Vec<f64> = scene.skins.iter().flat_map(|s| &s.layers).map(|l| l.poisson).collect();
    all.sort_by(f64::total_cmp);
    all.dedup();
    all
}

/// Name of the processor, if the system states it.
fn machine() -> String {
    let threads = rayon::current_num_threads();
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = text.lines().find_map(|line| line.strip_prefix("model name")?.split(':').nth(1));
    let name = name.map_or_else(|| std::env::consts::ARCH.to_string(), |name| name.trim().to_string());
    format!("{name}, {threads} threads")
}

/// Name and driver of a backend's adapter.
fn adapter(platform: &Platform) -> Option<String> {
    let Platform::Gpu(text) = platform else { return None };
    let found = adapters().into_iter().find(|a| a.named(text.as_deref().unwrap_or("")))?;
    let kind = if found.software { ", a software adapter" } else { "" };
    Some(format!("{}, {} {}{kind}", found.name, found.backend, found.driver))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(ms: f64, error: Option<f64>) -> Row {
        let scene = crate::scene::incision().expect("the embedded scene is valid");
        Row {
            setting: own(&scene),
            trace: Trace { ms_per_step: ms, ..Trace::default() },
            error_discretisation: None,
            error_solver: None,
            error_rounding: None,
            error_step: None,
            error_total: error,
            error_law: None,
            by_kind: [None; KINDS.len()],
            pareto: false,
        }
    }

    #[test]
    fn the_front_has_what_nothing_beats() {
        let points = [(1.0, Some(0.5)), (2.0, Some(0.1)), (3.0, Some(0.2)), (0.5, Some(f64::INFINITY)), (0.1, None)];
        let mut rows: Vec<Row> = points.iter().map(|(ms, error)| row(*ms, *error)).collect();
        mark_front(&mut rows);
        let marked: Vec<bool> = rows.iter().map(|r| r.pareto).collect();
        assert_eq!(marked, [true, true, false, false, false]);
    }

    #[test]
    fn longer_steps_are_ranked_by_the_time_that_they_cover() {
        // as long a step for the clock: the longer one covers more of the scene, with a larger error
        let mut rows = [row(1.0, Some(0.2)), row(1.0, Some(0.1))];
        rows[0].setting.step = 8.0 * rows[1].setting.step;
        mark_front(&mut rows);
        assert!(rows[0].pareto && rows[1].pareto);
        rows[0].setting.step = rows[1].setting.step;
        mark_front(&mut rows);
        assert!(!rows[0].pareto && rows[1].pareto);
    }
}
