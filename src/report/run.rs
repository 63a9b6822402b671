//! Runs a scene to its end and writes its results.

use super::checkpoint::{self, Checkpoint, Identity};
use super::collect::Collector;
use super::files::{self, Folder};
use super::haptics::{self, HapticFiles};
use super::inspect::{self, Purpose};
use super::listing::Listing;
use super::{Refused, Report, check};
use crate::error::{Error, Result, unless};
use crate::runner::{Clock, Runner};
use crate::scene::{BodyId, STEP, Scene};
use crate::step::{Platform, Simulation, StepReport};
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Longest step by the wall clock, s; a hand feels none that takes a tenth of a second.
const LONGEST_STEP: f64 = 60.0;

/// Options of a run.
#[derive(Clone, Debug)]
pub struct Options {
    /// Backend and precision.
    pub platform: Platform,
    /// Number of steps; none for the scene's duration.
    pub steps: Option<u32>,
    /// Folder of the results; created if missing.
    pub out: PathBuf,
    /// Pace by the wall clock, with a thread per device.
    pub realtime: bool,
    /// Record each device in `hand_TOOL.csv`, a trajectory that a scene can read.
    pub record: bool,
    /// Write `checkpoint.bin` after every this many steps.
    pub checkpoint: Option<u32>,
    /// Checkpoint to resume from; its run had the same folder.
    pub resume: Option<PathBuf>,
    /// Once set, the run ends with [`Error::Interrupted`].
    pub interrupt: Arc<AtomicBool>,
}

impl Options {
    /// Options of a whole run by the scene's clock.
    pub fn new(platform: Platform, out: impl Into<PathBuf>) -> Self {
        let out = out.into();
        let interrupt = Arc::default();
        Self { platform, steps: None, out, realtime: false, record: false, checkpoint: None, resume: None, interrupt }
    }

    /// The checkpoint to resume from, if any.
    fn resumed(&self, scene: &Scene) -> Result<Option<Checkpoint>> {
        let steps = self.steps.unwrap_or(scene.time.steps());
        self.resume.as_ref().map(|file| checkpoint::read(file, scene, &self.platform, steps)).transpose()
    }

    /// Opens the folder of the results and tries the names of all of them.
    fn folder(&self, scene: &Scene) -> Result<Listing> {
        let recordings: Vec<String> = match self.record {
            true => scene.tools.iter().map(haptics::recording).collect(),
            false => vec![],
        };
        let mut names = BTreeSet::new();
        if let Some(name) = recordings.iter().find(|name| !names.insert(*name)) {
            return Err(Refused::RecordingsAlike { name: name.clone() }.into());
        }
        files::open(&self.out, scene.view.frames.min(self.steps.unwrap_or(scene.time.steps())), &recordings)
    }

    /// Refuses options that exclude each other, or that the scene excludes.
    fn check(&self, scene: &Scene) -> Result<()> {
        if self.realtime && scene.time.step > LONGEST_STEP {
            return Err(
                Refused::StepInRealTime { at: scene.at(STEP), step: scene.time.step, most: LONGEST_STEP }.into()
            );
        }
        if self.steps == Some(0) || self.checkpoint == Some(0) {
            return Err(Refused::NoSteps.into());
        }
        let kept = self.checkpoint.is_some() || self.resume.is_some();
        if kept && self.realtime {
            return Err(Refused::CheckpointInRealTime.into());
        }
        if kept && self.record {
            return Err(Refused::CheckpointOfRecording.into());
        }
        Ok(())
    }
}

/// Progress between two steps.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Completed steps.
    pub step: u32,
    /// Steps in total.
    pub steps: u32,
    /// Scene time, s.
    pub time: f64,
    /// Largest force on a tool, N.
    pub force: f64,
    /// Length of the cut so far, m.
    pub cut: f64,
}

/// Result of a run.
#[derive(Clone, Debug)]
pub struct Summary {
    /// Report, as in `report.json`.
    pub report: Report,
    /// Time of the largest contact force, s.
    pub peak_time: f64,
    /// Number of pictures.
    pub frames: u32,
    /// Failed checks; none if the run ended before the scene.
    pub failures: Vec<check::Failure>,
    /// The run ended before the scene, so its checks were not evaluated.
    pub cut_short: bool,
}

/// Runs a scene; calls `progress` after every step.
///
/// # Errors
/// If the scene is too large, no adapter fits, `[check]` has an unknown key, the folder cannot be written, the checkpoint does not fit, or
/// a device fails. The results up to then are in the folder.
pub fn run(scene: &Scene, options: &Options, progress: &mut dyn FnMut(&Progress)) -> Result<Summary> {
    check::known(scene)?;
    options.check(scene)?;
    // refuse before anything is computed, a device opened or a file touched
    let resumed = options.resumed(scene)?;
    inspect::fits(scene, Purpose::from(&options.platform))?;
    let listing = options.folder(scene)?;
    let simulation = Simulation::new(scene, &options.platform).map_err(|error| error.of_scene(scene))?;
    run_from(scene, options, simulation, resumed, listing, progress)
}

/// The same with an existing simulation at its start.
///
/// # Errors
/// As [`run`].
pub fn run_prepared(
    scene: &Scene,
    options: &Options,
    simulation: Simulation,
    progress: &mut dyn FnMut(&Progress),
) -> Result<Summary> {
    options.check(scene)?;
    let resumed = options.resumed(scene)?;
    run_from(scene, options, simulation, resumed, options.folder(scene)?, progress)
}

fn run_from(
    scene: &Scene,
    options: &Options,
    simulation: Simulation,
    resumed: Option<Checkpoint>,
    listing: Listing,
    progress: &mut dyn FnMut(&Progress),
) -> Result<Summary> {
    // while it was set up: the results of an earlier run stay
    unless(&options.interrupt)?;
    let steps = options.steps.unwrap_or(scene.time.steps());
    let clock = if options.realtime { Clock::Wall } else { Clock::Scene };
    let mut collector = Collector::new(scene, &simulation);
    let mut runner = Runner::new(scene, simulation, clock);
    runner.interrupt_by(options.interrupt.clone());
    // start the folder's files, or continue those of the checkpoint
    let (folder, haptic, last) = match resumed {
        None => {
            let mut folder = Folder::create(listing, scene)?;
            let rows = runner.start(options.record)?;
            let haptic = match runner.haptic() {
                Some(_) => HapticFiles::create(&mut folder.listing, scene, rows)?,
                None => HapticFiles::default(),
            };
            (folder, haptic, vec![])
        }
        Some(checkpoint) => {
            // touch no file before all are known to be this run's and the state is restored
            Folder::verify(&options.out, scene, &checkpoint.files)?;
            HapticFiles::verify(&options.out, checkpoint.ticks)?;
            runner.restore(&checkpoint.runner)?;
            collector.resume(checkpoint.collected);
            let folder = Folder::reopen(listing, scene, &checkpoint.files)?;
            (folder, HapticFiles::reopen(&options.out, checkpoint.ticks)?, checkpoint.last)
        }
    };
    // all steps; after an error the results so far are written
    let identity = checkpoint::identity(scene, &options.platform);
    let mut running = Running { scene, options, identity, folder, collector, runner, haptic, last };
    let report = match running.all_steps(steps, progress) {
        Ok(report) => report,
        Err(error) => {
            running.keep(&error);
            return Err(error);
        }
    };
    // checks are for whole runs
    let cut_short = steps < scene.time.steps();
    Ok(Summary {
        failures: match cut_short {
            true => vec![],
            false => check::failures(scene, &report),
        },
        frames: running.folder.finish()?,
        peak_time: running.collector.peak_time(),
        cut_short,
        report,
    })
}

/// A run in progress.
struct Running<'a> {
    scene: &'a Scene,
    options: &'a Options,
    /// Identity of its checkpoints.
    identity: Identity,
    runner: Runner,
    folder: Folder,
    haptic: HapticFiles,
    collector: Collector,
    /// Probe values of the last step.
    last: Vec<f64>,
}

impl Running<'_> {
    fn all_steps(&mut self, steps: u32, progress: &mut dyn FnMut(&Progress)) -> Result<Report> {
        let done = self.runner.steps();
        if done == 0 {
            let state = self.runner.simulation.snapshots()?;
            if let Some(measured) = self.runner.simulation.measure(&state) {
                self.collector.began(&measured);
                self.folder.tables.add_energy(&measured)?;
            }
        }
        if done > 0 {
            // the first part may have left the report of a later step, or of its end
            let report = self.report();
            self.folder.write_report(&report)?;
        }
        let report = self.report();
        self.folder.reserve(&report)?;
        let frames = u64::from(self.scene.view.frames.min(steps));
        // picture k of F shows the end of step k·steps/F, rounded up
        let pictures = |n: u32| u64::from(n) * frames / u64::from(steps);
        for number in done + 1..=steps {
            let step = self.step(number, steps)?;
            progress(&Progress {
                step: number,
                steps,
                time: step.time,
                force: step.contact.largest_on_tools(),
                cut: self.runner.simulation.totals().length,
            });
            if pictures(number) > pictures(number - 1) {
                let state = self.runner.simulation.snapshots()?;
                self.folder.add_frame(self.scene, &self.runner.simulation, &state, &step)?;
                let report = self.report();
                self.folder.write_report(&report)?;
            }
            if self.options.checkpoint.is_some_and(|every| number.is_multiple_of(every)) {
                let checkpoint = self.checkpoint()?;
                checkpoint::write(&checkpoint, &mut self.folder.listing)?;
            }
        }
        let Self { runner, haptic, .. } = self;
        let closed = runner.stop(&mut |tool, record| haptic.add(tool, record));
        let state = self.runner.simulation.snapshots()?;
        let measured = self.runner.simulation.measure(&state);
        self.collector.ended(&self.runner.simulation, &state, measured.as_ref());
        measured.iter().try_for_each(|measured| self.folder.tables.add_energy(measured))?;
        if let Some(body) = state.iter().position(|state| state.non_finite() > 0) {
            return Err(self.runner.simulation.non_finite(BodyId::Deformable(body)));
        }
        let report = self.report();
        self.folder.write_report(&report)?;
        self.haptic.finish()?;
        closed?;
        Ok(report)
    }

    /// Takes one step and writes its rows.
    fn step(&mut self, number: u32, steps: u32) -> Result<StepReport> {
        // a check takes longer than a step: by the wall clock the last step alone has one
        let due = !self.options.realtime && number.is_multiple_of(self.scene.solver.true_residual_every);
        let exact = number == steps || due;
        let Self { runner, haptic, .. } = self;
        let step = runner.step(exact, &mut |tool, record| haptic.add(tool, record))?;
        self.collector.add(&step.report, step.took);
        self.last.clone_from(&step.report.probes);
        self.folder.tables.add_step(self.scene, &step.report)?;
        step.report.measured.iter().try_for_each(|measured| self.folder.tables.add_energy(measured))?;
        Ok(step.report)
    }

    fn report(&mut self) -> Report {
        let mut report = self.collector.report(&self.runner.simulation);
        let counted = self.runner.haptic();
        report.haptic = counted.as_ref().map(haptics::report).unwrap_or_default();
        let warnings = counted.iter().flat_map(haptics::warnings);
        report.warnings.extend(warnings.map(|(name, count)| (name.into(), count)));
        let names = self.scene.probes.iter().map(|p| p.name.clone());
        report.probes = names.zip(self.last.iter().copied()).collect();
        report
    }

    /// Writes the results up to an error that ends the run. Further errors here, as on a full disk, follow from that one and are dropped.
    fn keep(&mut self, error: &Error) {
        let Self { runner, haptic, .. } = self;
        drop(runner.stop(&mut |tool, record| haptic.add(tool, record)));
        let report = Report { error: error.to_string(), ..self.report() };
        // the report comes first: what the tables have left may fill the room that it was kept
        drop(self.folder.release());
        drop(self.folder.write_report(&report));
        drop(self.haptic.finish());
        drop(self.folder.tables.flush());
    }

    /// Complete state of the run. Table rows are flushed before they are counted.
    fn checkpoint(&mut self) -> Result<Checkpoint> {
        Ok(Checkpoint {
            identity: self.identity.clone(),
            runner: self.runner.state()?,
            collected: self.collector.collected(),
            files: self.folder.written()?,
            ticks: self.haptic.kept()?,
            last: self.last.clone(),
        })
    }
}
