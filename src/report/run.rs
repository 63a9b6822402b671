//! Steps a scene to its end and writes what happened.

use super::collect::Collector;
use super::files::Folder;
use super::haptics::Haptics;
use super::live::Live;
use super::{HapticReport, Report, check};
use crate::error::{Error, Result};
use crate::scene::{Scene, Who};
use crate::step::{Place, Simulation, StepReport};
use std::path::PathBuf;
use std::time::Instant;

/// How to run.
#[derive(Clone, Debug)]
pub struct Options {
    /// Where the skin is computed.
    pub place: Place,
    /// Steps; none for the scene's duration.
    pub steps: Option<u32>,
    /// Folder of the results; made when it is not there.
    pub out: PathBuf,
    /// Paced by the wall clock, with a thread for each device.
    pub realtime: bool,
    /// Keep what each device says and is given in `hand_TOOL.csv`, a trajectory that a scene can read.
    pub record: bool,
}

/// What feels the skin while it runs, and by which clock.
enum Hands {
    None,
    Scene(Haptics),
    Live(Box<Live>),
}

impl Hands {
    fn new(scene: &Scene, options: &Options, simulation: &Simulation) -> Result<Self> {
        if options.realtime {
            return Ok(Self::Live(Box::new(Live::start(scene, simulation, options)?)));
        }
        Ok(Haptics::new(scene, simulation, options)?.map_or(Self::None, Self::Scene))
    }

    fn before_step(&mut self, simulation: &mut Simulation, begin: f64, end: f64) -> Result<()> {
        match self {
            Self::None => Ok(()),
            Self::Scene(haptics) => haptics.advance(simulation, end),
            Self::Live(live) => {
                live.before_step(simulation, begin, end);
                Ok(())
            }
        }
    }

    fn after_step(&mut self, simulation: &Simulation) -> Result<()> {
        match self {
            Self::Live(live) => live.after_step(simulation),
            _ => Ok(()),
        }
    }

    fn stop(&mut self) -> Result<()> {
        match self {
            Self::Live(live) => live.stop(),
            _ => Ok(()),
        }
    }

    fn report(&mut self) -> Option<HapticReport> {
        match self {
            Self::None => None,
            Self::Scene(haptics) => Some(haptics.report()),
            Self::Live(live) => Some(live.report()),
        }
    }

    fn finish(&mut self) -> Result<()> {
        match self {
            Self::None => Ok(()),
            Self::Scene(haptics) => haptics.finish(),
            Self::Live(live) => live.finish(),
        }
    }
}

/// Between two steps.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Steps done.
    pub step: u32,
    /// Steps in all.
    pub steps: u32,
    /// Scene time, s.
    pub time: f64,
    /// Force on the tools, N.
    pub force: f64,
    /// Length of the cut so far, m.
    pub cut: f64,
}

/// The end of a run.
#[derive(Clone, Debug)]
pub struct Summary {
    /// As in `report.json`.
    pub report: Report,
    /// When the largest contact force was, s.
    pub peak_time: f64,
    /// Pictures written.
    pub frames: u32,
    /// Checks that failed; none when the run ended before the scene.
    pub failures: Vec<check::Failure>,
    /// The run ended before the scene, so its checks were not evaluated.
    pub cut_short: bool,
}

/// Runs a scene; `progress` is called after every step.
///
/// # Errors
/// For a scene too large, no adapter, an unknown key in `[check]`, a folder that cannot be written, a device that fails. What was done
/// until then is in the folder.
pub fn run(scene: &Scene, options: &Options, progress: &mut dyn FnMut(&Progress)) -> Result<Summary> {
    check::known(scene)?;
    if options.steps == Some(0) {
        return Err(Error::Usage {
            what: "a run of 0 steps".into(),
            fix: "ask for at least one step, or for at least half a step of time".into(),
        });
    }
    run_prepared(scene, options, Simulation::new(scene, &options.place)?, progress)
}

/// The same with a simulation that is there already, at its start.
///
/// # Errors
/// As [`run`].
pub fn run_prepared(
    scene: &Scene,
    options: &Options,
    simulation: Simulation,
    progress: &mut dyn FnMut(&Progress),
) -> Result<Summary> {
    let steps = options.steps.unwrap_or(scene.time.steps());
    let folder = Folder::create(&options.out, scene)?;
    let hands = Hands::new(scene, options, &simulation)?;
    let collector = Collector::new(scene, &simulation);
    let mut running = Running { scene, simulation, folder, hands, collector, last: vec![] };
    let report = match running.all_steps(steps, progress) {
        Ok(report) => report,
        Err(error) => {
            running.keep(&error);
            return Err(error);
        }
    };
    let cut_short = steps < scene.time.steps();
    Ok(Summary {
        failures: match cut_short {
            true => vec![],
            false => check::failures(scene, &report),
        },
        frames: running.folder.finish()?,
        peak_time: running.collector.peak_time,
        cut_short,
        report,
    })
}

/// A run between its begin and its end.
struct Running<'a> {
    scene: &'a Scene,
    simulation: Simulation,
    folder: Folder,
    hands: Hands,
    collector: Collector,
    /// Probes of the last step.
    last: Vec<f64>,
}

impl Running<'_> {
    fn all_steps(&mut self, steps: u32, progress: &mut dyn FnMut(&Progress)) -> Result<Report> {
        if !self.simulation.bodies.is_empty() {
            let state = self.simulation.snapshots()?;
            self.collector.began(&self.simulation.measure(&state));
        }
        let frames = u64::from(self.scene.view.frames.min(steps));
        // picture k of F shows the end of step k·steps/F, rounded up
        let pictures = |n: u32| u64::from(n) * frames / u64::from(steps);
        for number in 1..=steps {
            let step = self.step(number, steps)?;
            progress(&Progress {
                step: number,
                steps,
                time: step.time,
                force: step.contact.largest_on_tools(),
                cut: self.simulation.totals().length,
            });
            if pictures(number) > pictures(number - 1) {
                let state = self.simulation.snapshots()?;
                self.folder.add_frame(self.scene, &self.simulation, &state, &step)?;
                let report = self.report();
                self.folder.write_report(&report)?;
            }
        }
        self.hands.stop()?;
        let state = self.simulation.snapshots()?;
        self.collector.ended(&self.simulation, &state);
        if let Some(body) = state.iter().position(|state| state.non_finite() > 0) {
            return Err(self.simulation.non_finite(Who::Skin(body)));
        }
        let report = self.report();
        self.folder.write_report(&report)?;
        self.hands.finish()?;
        Ok(report)
    }

    /// One step with what belongs to it, written down.
    fn step(&mut self, number: u32, steps: u32) -> Result<StepReport> {
        let [begin_s, end_s] = [number - 1, number].map(|n| f64::from(n) * self.scene.time.step);
        self.hands.before_step(&mut self.simulation, begin_s, end_s)?;
        let exact = number == steps || number.is_multiple_of(self.scene.solver.true_residual_every);
        let begin = Instant::now();
        let step = self.simulation.step(exact)?;
        self.collector.add(&step, begin.elapsed());
        self.last.clone_from(&step.probes);
        self.hands.after_step(&self.simulation)?;
        self.folder.add_step(&step)?;
        Ok(step)
    }

    fn report(&mut self) -> Report {
        let mut report = self.collector.report(&self.simulation);
        report.haptic = self.hands.report().unwrap_or_default();
        let names = self.scene.probes.iter().map(|p| p.name.clone());
        report.probes = names.zip(self.last.iter().copied()).collect();
        report
    }

    /// Writes down what was done before an error ended it. What fails here as well, as on a full disk, follows from that error, which is
    /// the one to be told.
    fn keep(&mut self, error: &Error) {
        drop(self.hands.stop());
        let report = Report { error: error.to_string(), ..self.report() };
        drop(self.folder.write_report(&report));
        drop(self.hands.finish());
        drop(self.folder.flush());
    }
}
