//! Run loop of a scene: simulation, hands and haptic devices, one step at a time, by the scene's clock or by the wall clock.
//!
//! By the scene's clock, ticks run between the steps in the same thread, so that a run repeats. By the wall clock, each device has a thread
//! of its own and the same clock paces the steps. The caller of a [`Runner`] receives every tick and step: the program's `run` writes them
//! to files ([`crate::report::run`]); another program may show them, pause, or attach its own device to a tool.

mod channel;
mod refused;
mod scene_clock;
mod wall_clock;

pub use refused::Refused;

use crate::error::{Result, unless};
use crate::haptic::cells::Counts;
use crate::haptic::device::Device;
use crate::haptic::replay::Row;
use crate::haptic::servo::Record;
use crate::haptic::thread::Timing;
use crate::scene::Scene;
use crate::step::{self, Simulation, StepReport};
use channel::channels;
use rtrb::Consumer;
use scene_clock::SceneClock;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};
use wall_clock::WallClock;

/// Capacity of the record rings, seconds of ticks: longer than a picture takes.
const RING: f64 = 8.0;

/// Clock that paces the steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clock {
    /// Scene time: steps follow each other without waiting, and a run repeats.
    Scene,
    /// Real time: a step of 5 ms takes 5 ms, or is late.
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
    /// Time by which the scene fell behind the wall clock for that, s.
    pub behind: f64,
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
    hands: scene_clock::State,
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
            clock.after_step(&self.simulation, on_tick)?;
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
