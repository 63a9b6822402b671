//! Run loop of a scene: simulation, hands and haptic devices, one step at a time, by the scene's clock or by the wall clock.
//!
//! By the scene's clock, ticks run between the steps in the same thread, so that a run repeats. By the wall clock, each device has a thread
//! of its own and the same clock paces the steps. The caller of a [`Runner`] receives every tick and step: the program's `run` writes them
//! to files ([`crate::report::run`]); another program may show them, pause, or attach its own device to a tool.

mod clocks;

use crate::error::{Result, unless};
use crate::haptic::Hand;
use crate::haptic::device::{Device, Limits, Workspace};
use crate::haptic::devices::{Recorder, Row, open};
use crate::haptic::servo::{Counts, Record, Servo, Settings};
use crate::haptic::thread::Timing;
use crate::math::larger;
use crate::scene::{DeviceKind, Scene, device_of};
use crate::step::{self, ContactReport, Simulation, StepReport};
use clocks::{SceneClock, WallClock};
use rtrb::Consumer;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

/// Capacity of the record rings, seconds of ticks: longer than a picture takes.
const RING: f64 = 8.0;

/// Clock that paces the steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clock {
    /// Scene time: steps follow each other without waiting, and a run repeats.
    Scene,
    /// Real time: a step of 5 ms takes 5 ms, with fewer passes of the contact solve where need be, or is late.
    Wall,
}

/// Called at each tick with the number of the tool and the servo's record.
pub type OnTick<'a> = &'a mut dyn FnMut(usize, &Record) -> Result<()>;

/// Result of a step of the run.
#[derive(Clone, Debug)]
pub struct Step {
    /// Report of the simulation.
    pub report: StepReport,
    /// Wall time of the simulation, without ticks and waiting.
    pub took: Duration,
}

/// Counts of the haptic loops so far.
#[derive(Clone, Debug)]
pub struct HapticCounts {
    /// Ticks per second, Hz.
    pub rate: f64,
    /// `[device]` counts of the servos.
    pub servos: Vec<Counts>,
    /// Timing of the loops by the wall clock, once they have stopped.
    pub timing: Option<Timing>,
    /// Steps that began more than a tick late.
    pub late_steps: u64,
    /// Time by which the scene fell behind the wall clock for that, and until the threads had started, s.
    pub behind: f64,
    /// Steps that ended because they were due, with contact forces off by more than can be felt.
    pub shortened: Shortened,
}

/// Steps by the wall clock that ended because they were due, with contact forces off by more than can be felt ([`Simulation::finish_by`]).
#[derive(Clone, Copy, Debug, Default)]
pub struct Shortened {
    /// Number.
    pub steps: u64,
    /// Largest change of a force by one more projection at the end of one, N.
    pub residual_n: f64,
    /// Largest violation of complementarity at the end of one, m.
    pub residual_m: f64,
}

impl Shortened {
    fn count(&mut self, contact: &ContactReport) {
        if contact.shortened {
            self.steps += 1;
            self.residual_n = larger(self.residual_n, contact.residual_n);
            self.residual_m = larger(self.residual_m, contact.residual_m);
        }
    }
}

/// See the module.
pub struct Runner {
    /// The simulation.
    pub simulation: Simulation,
    scene: Scene,
    clock: Clock,
    steps: u32,
    attached: BTreeMap<usize, Box<dyn Device>>,
    records: bool,
    stopped: bool,
    interrupt: Arc<AtomicBool>,
    hands: Hands,
}

/// Complete state of a run by the scene's clock.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct State {
    steps: u32,
    simulation: step::State,
    hands: clocks::State,
}

impl State {
    /// Number of steps taken.
    pub fn steps(&self) -> u32 {
        self.steps
    }
}

/// Haptic loops.
enum Hands {
    /// Not started.
    Waiting,
    Scene(SceneClock),
    Wall(Box<WallClock>),
}

impl Runner {
    /// Runner at the start of a scene; no device is open yet.
    pub fn new(scene: &Scene, simulation: Simulation, clock: Clock) -> Self {
        Self {
            simulation,
            scene: scene.clone(),
            clock,
            steps: 0,
            attached: BTreeMap::new(),
            records: false,
            stopped: false,
            interrupt: Arc::default(),
            hands: Hands::Waiting,
        }
    }

    /// Has a flag, once set, end the run: devices under the wall clock are released at their next tick, the others by [`Runner::stop`], and
    /// the present step or the next one is [`Interrupted`](crate::error::Error::Interrupted). Call it before the run begins.
    pub fn interrupt_by(&mut self, flag: Arc<AtomicBool>) {
        self.simulation.interrupt_by(&flag);
        self.interrupt = flag;
    }

    /// Attaches a device to a tool, in place of the scene's.
    ///
    /// # Errors
    /// Once the run has begun, and for a tool that no hand holds.
    pub fn attach(&mut self, tool: usize, device: Box<dyn Device>) -> Result<()> {
        if !matches!(self.hands, Hands::Waiting) {
            return Err(Refused::AttachedLate.into());
        }
        if self.simulation.tools.get(tool).is_none_or(|tool| tool.free) {
            return Err(Refused::AttachedToNothing.into());
        }
        self.attached.insert(tool, device);
        Ok(())
    }

    /// Opens the devices and starts the clock; the first [`Runner::step`] does so as well. With `record`, returns a ring for each device
    /// with the number of its tool: rows of a trajectory with forces.
    ///
    /// # Errors
    /// When a device or its thread is not available, which takes a new runner; once the run has begun.
    pub fn start(&mut self, record: bool) -> Result<Vec<(usize, Consumer<Row>)>> {
        if !matches!(self.hands, Hands::Waiting) {
            return Err(Refused::StartedTwice.into());
        }
        let live = self.clock == Clock::Wall;
        let mut rows = vec![];
        let attached = std::mem::take(&mut self.attached);
        let channels = channels(&self.scene, &self.simulation, live, attached, record.then_some(&mut rows))?;
        self.records = record;
        self.hands = match live {
            true => Hands::Wall(Box::new(WallClock::start(
                &self.scene,
                &self.simulation,
                channels,
                self.interrupt.clone(),
            )?)),
            false => Hands::Scene(SceneClock::new(self.scene.haptic.rate, channels)),
        };
        Ok(rows)
    }

    /// Number of steps taken.
    pub fn steps(&self) -> u32 {
        self.steps
    }

    /// Takes the next step when it is due; `check` evaluates the true residual as well. Passes each tick to `on_tick`: by the scene's
    /// clock those before the step, by the wall clock those until its end.
    ///
    /// # Errors
    /// As [`Simulation::step`], and errors of `on_tick`.
    pub fn step(&mut self, check: bool, on_tick: OnTick) -> Result<Step> {
        if matches!(self.hands, Hands::Waiting) {
            self.start(false)?;
        }
        if self.stopped {
            return Err(Refused::Stopped.into());
        }
        unless(&self.interrupt)?;
        let [begin, end] = [self.steps, self.steps + 1].map(|n| f64::from(n) * self.scene.time.step);
        match &mut self.hands {
            Hands::Waiting => {}
            Hands::Scene(clock) => clock.advance(&mut self.simulation, end, on_tick)?,
            Hands::Wall(clock) => clock.before_step(&mut self.simulation, begin, end),
        }
        unless(&self.interrupt)?;
        let started = Instant::now();
        let report = self.simulation.step(check).map_err(|error| error.of_scene(&self.scene))?;
        let took = started.elapsed();
        self.steps += 1;
        if let Hands::Wall(clock) = &mut self.hands {
            clock.after_step(&self.simulation, &report, on_tick)?;
        }
        Ok(Step { report, took })
    }

    /// Complete state of the run. Reading it does not change how the run continues.
    ///
    /// # Errors
    /// By the wall clock, and with recorded devices; when a device fails.
    pub fn state(&mut self) -> Result<State> {
        let hands = self.scene_clock()?.state();
        Ok(State { steps: self.steps, simulation: self.simulation.state()?, hands })
    }

    /// Restores a state of a run of the same scene.
    ///
    /// # Errors
    /// As [`Runner::state`], and for a state of another scene.
    pub fn restore(&mut self, state: &State) -> Result<()> {
        self.scene_clock()?.fits(&state.hands)?;
        self.simulation.restore(&state.simulation)?;
        self.scene_clock()?.restore(&state.hands);
        self.steps = state.steps;
        Ok(())
    }

    /// Haptic loop by the scene's clock, if its state can be read and restored.
    fn scene_clock(&mut self) -> Result<&mut SceneClock> {
        if matches!(self.hands, Hands::Waiting) {
            self.start(false)?;
        }
        match &mut self.hands {
            Hands::Scene(clock) if !self.records => Ok(clock),
            _ => Err(Refused::NoState.into()),
        }
    }

    /// Pauses the wall clock until the next step, which begins once the rest of its waiting time has passed.
    pub fn pause(&mut self) {
        if let Hands::Wall(clock) = &mut self.hands {
            clock.pause();
        }
    }

    /// Counts of the haptic loops; none before the start, or by the scene's clock without a hand.
    pub fn haptic(&mut self) -> Option<HapticCounts> {
        match &mut self.hands {
            Hands::Waiting => None,
            Hands::Scene(clock) => clock.counts(),
            Hands::Wall(clock) => Some(clock.counts()),
        }
    }

    /// Stops the clock and closes the devices: no force acts on any hand from here on.
    ///
    /// # Errors
    /// When a device fails to close, or its thread has panicked.
    pub fn stop(&mut self, on_tick: OnTick) -> Result<()> {
        self.stopped = true;
        match &mut self.hands {
            Hands::Waiting => Ok(()),
            Hands::Scene(clock) => clock.close(),
            Hands::Wall(clock) => clock.stop(on_tick),
        }
    }
}

/// Leaves one core to the haptic threads: the global thread pool gets one thread less than there are cores.
///
/// # Errors
/// When the pool exists already.
pub fn leave_a_core() -> Result<()> {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(cores.saturating_sub(1).max(1));
    pool.build_global().map_err(|source| Refused::CoresTaken { source }.into())
}

/// Variable that asks for a number of threads.
const THREADS: &str = "RAYON_NUM_THREADS";
/// Most threads, beyond the cores of any machine; each takes 2 MiB of address space, and time to start.
const MOST_THREADS: usize = 4096;

/// Refuses a number of threads by `RAYON_NUM_THREADS` that no machine has cores for: the pool, which the first parallel loop starts, would
/// take minutes to start them.
///
/// # Errors
/// [`Refused::TooManyThreads`].
pub fn check_threads() -> Result<()> {
    let asked = std::env::var(THREADS).unwrap_or_default();
    if asked.parse().is_ok_and(|found: usize| found > MOST_THREADS) {
        return Err(Refused::TooManyThreads { asked, most: MOST_THREADS }.into());
    }
    Ok(())
}

/// Starts the global thread pool: one thread per core, or as many as `RAYON_NUM_THREADS` asks for.
///
/// # Errors
/// As [`check_threads`], and [`Refused::Threads`] when the system starts none.
pub fn take_all_cores() -> Result<()> {
    check_threads()?;
    let started = rayon::ThreadPoolBuilder::new().build_global();
    // an existing pool serves as well
    let reason = |e: &rayon::ThreadPoolBuildError| std::error::Error::source(e).map(ToString::to_string);
    let refused = started.err().as_ref().and_then(reason).map(std::io::Error::other);
    refused.map_or(Ok(()), |source| Err(Refused::Threads { source }.into()))
}

/// Most rows for which memory is reserved at the start; a larger problem reallocates once.
const MOST_ROWS: usize = 600;

/// A tool's device, with the servo between it and the simulation.
struct Channel {
    pub servo: Servo,
    pub device: Box<dyn Device>,
    /// The device moves the tool; false if the tool follows its trajectory.
    pub moves: bool,
}

/// Devices and servos of the tools held by a hand, at rest. Under the wall clock those without a device are guarded too. `attached` devices
/// replace the scene's. With `rows` each device is recorded.
fn channels(
    scene: &Scene,
    simulation: &Simulation,
    live: bool,
    mut attached: BTreeMap<usize, Box<dyn Device>>,
    mut rows: Option<&mut Vec<(usize, Consumer<Row>)>>,
) -> Result<Vec<Channel>> {
    let times = [1.0 / scene.haptic.rate, scene.time.step];
    let others = scene.skins.len() + scene.planes.len() + scene.tools.len();
    let most = scene.contact.map_or(0, |c| 3 * c.max_contacts as usize * others).min(MOST_ROWS);
    let held = simulation.tools.iter().zip(&scene.tools).take_while(|(tool, _)| !tool.free);
    let mut out = vec![];
    // the attached device, or the scene's
    for (number, (tool, asked)) in held.enumerate() {
        let spec = asked.device.clone().unwrap_or_default();
        let own = attached.remove(&number);
        let moves = own.is_some() || asked.device.is_some();
        let mut device = match own {
            Some(device) => device,
            None if !live && matches!(spec.kind, DeviceKind::Haply { .. }) => {
                let at = scene.at(&device_of(&asked.name));
                return Err(Refused::NeedsWallClock { at, tool: asked.name.clone() }.into());
            }
            None => open(&spec, asked)?,
        };
        // record it
        if let Some(rows) = &mut rows {
            let ticks = (RING * scene.haptic.rate) as usize;
            let (recorder, written) = Recorder::new(device, Workspace::new(&spec), ticks);
            device = Box::new(recorder);
            rows.push((number, written));
        }
        // settings of the servo; a trajectory has no force limits
        let unlimited = Limits { force: f64::INFINITY, torque: f64::INFINITY };
        let can = if moves { device.limits() } else { unlimited };
        let plain = Settings::new(&spec, tool.coupling, can, times);
        let guarded = moves || live;
        let passivity = plain.passivity && guarded;
        let settings = Settings { guarded, passivity, resolution: device.resolution(), rows: most, ..plain };
        let (position, rotation) = tool.hand(0.0);
        out.push(Channel { servo: Servo::new(settings, Hand { position, rotation }), device, moves });
    }
    Ok(out)
}

/// Errors of a run.
#[derive(Debug, thiserror::Error)]
pub enum Refused {
    /// Device that needs the wall clock, in a run by the scene's clock.
    #[error(
        "{at}: the tool \"{tool}\" is held by a haply device, which goes by the wall clock; run it with --realtime, or write kind = \"hand\" \
         in its [tool.device]"
    )]
    NeedsWallClock {
        /// Where.
        at: String,
        /// Name of the tool.
        tool: String,
    },

    /// Device attached after the first step.
    #[error("a device is attached to a run that has begun; attach it before the first step")]
    AttachedLate,

    /// Device attached to a tool without a hand.
    #[error("a device is attached to a tool that the scene does not have; count the [[tool]]s from 0")]
    AttachedToNothing,

    /// Run started twice.
    #[error("the run has already started; make a new one")]
    StartedTwice,

    /// Step after the run was stopped.
    #[error("the run was stopped and its devices are closed; make a new one, which may restore this one's state")]
    Stopped,

    /// State of a run that cannot be restored.
    #[error(
        "the state of a run by the wall clock, or of one that records its devices; run by the scene's clock without recording"
    )]
    NoState,

    /// The global thread pool exists already.
    #[error("no core can be left to the haptic threads ({source}); ask for it before anything is computed")]
    CoresTaken {
        /// Reason given by the thread pool.
        source: rayon::ThreadPoolBuildError,
    },

    /// More threads than make sense.
    #[error(
        "RAYON_NUM_THREADS={asked} asks for more threads than {most}; ask for as many as there are cores, or unset it"
    )]
    TooManyThreads {
        /// The text of the variable.
        asked: String,
        /// Maximum.
        most: usize,
    },

    /// The system starts no more threads, mostly for lack of memory.
    #[error(
        "the threads cannot be started ({source}); close what takes memory or threads, or raise the limit that this program runs under \
         (ulimit -v, ulimit -u)"
    )]
    Threads {
        /// Reason given by the system.
        source: io::Error,
    },

    /// The system starts no thread for a device.
    #[error(
        "the haptic thread cannot be started ({source}); let the system have more threads, or run without --realtime"
    )]
    HapticThread {
        /// Reason given by the system.
        source: io::Error,
    },

    /// A haptic thread panicked: an error of this program or of an attached device.
    #[error("a haptic thread has panicked; report what it said above, with the scene")]
    Panicked,
}
