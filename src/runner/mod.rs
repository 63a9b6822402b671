//! A scene as it runs: simulation, hands and haptic devices, a step at a time, by the scene's clock or by the wall clock.
//!
//! By the scene's clock ticks run between the steps, in the same thread, so that a run repeats. By the wall clock each device has a thread
//! of its own and the steps are paced by the same clock. Who drives a [`Runner`] sees each tick and each step as they come: the program's
//! `run` writes them down ([`crate::report::run`]), another program may show them, pause, or hold a tool by a device of its own.

mod channel;
mod refused;
mod scene_clock;
mod wall_clock;

pub use refused::Refused;

use crate::error::Result;
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
use std::time::{Duration, Instant};
use wall_clock::WallClock;

/// Seconds of ticks that wait to be told at most: a picture takes less.
const RING: f64 = 8.0;

/// What paces the steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clock {
    /// Nothing: steps follow each other at once, and a run repeats.
    Scene,
    /// Time: a step of 5 ms takes 5 ms, or is late.
    Wall,
}

/// What to do with each tick: the number of its tool, and what the servo did.
pub type OnTick<'a> = &'a mut dyn FnMut(usize, &Record) -> Result<()>;

/// A step that was taken.
#[derive(Clone, Debug)]
pub struct Step {
    /// What happened in it.
    pub report: StepReport,
    /// What the simulation took, by the wall clock, without ticks and waiting.
    pub took: Duration,
}

/// What the haptic side has counted so far.
#[derive(Clone, Debug)]
pub struct HapticCounts {
    /// Ticks per second.
    pub rate: f64,
    /// `[device]`
    pub servos: Vec<Counts>,
    /// What the loops have seen of the wall clock, once they have stopped.
    pub timing: Option<Timing>,
    /// Steps that began later than a tick after their time.
    pub late_steps: u64,
}

/// See the module.
pub struct Runner {
    /// The bodies.
    pub simulation: Simulation,
    scene: Scene,
    clock: Clock,
    steps: u32,
    attached: BTreeMap<usize, Box<dyn Device>>,
    records: bool,
    stopped: bool,
    hands: Hands,
}

/// All that the rest of a run by the scene's clock depends on.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct State {
    steps: u32,
    simulation: step::State,
    hands: scene_clock::State,
}

impl State {
    /// Steps that were taken.
    pub fn steps(&self) -> u32 {
        self.steps
    }
}

/// The haptic side.
enum Hands {
    /// Not begun.
    Waiting,
    Scene(SceneClock),
    Wall(Box<WallClock>),
}

impl Runner {
    /// A scene's simulation at its start; no device is open yet.
    pub fn new(scene: &Scene, simulation: Simulation, clock: Clock) -> Self {
        Self {
            simulation,
            scene: scene.clone(),
            clock,
            steps: 0,
            attached: BTreeMap::new(),
            records: false,
            stopped: false,
            hands: Hands::Waiting,
        }
    }

    /// Holds a tool by a device of one's own instead of the scene's.
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

    /// Opens the devices and starts the clock; the first [`Runner::step`] does so as well. With `record` what each device says and is given
    /// comes in the rings returned, by the number of its tool: rows of a trajectory with forces.
    ///
    /// # Errors
    /// When a device cannot be had, or no thread for it; the run is then made anew. Once the run has begun.
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
            true => Hands::Wall(Box::new(WallClock::start(&self.scene, &self.simulation, channels)?)),
            false => Hands::Scene(SceneClock::new(self.scene.haptic.rate, channels)),
        };
        Ok(rows)
    }

    /// Steps taken.
    pub fn steps(&self) -> u32 {
        self.steps
    }

    /// Takes the next step, when its time has come; `check` asks for the true residual. Ticks are told as they come: by the scene's clock
    /// those before the step, by the wall clock those until its end.
    ///
    /// # Errors
    /// As [`Simulation::step`], and what `on_tick` fails with.
    pub fn step(&mut self, check: bool, on_tick: OnTick) -> Result<Step> {
        if matches!(self.hands, Hands::Waiting) {
            self.start(false)?;
        }
        if self.stopped {
            return Err(Refused::Stopped.into());
        }
        let [begin, end] = [self.steps, self.steps + 1].map(|n| f64::from(n) * self.scene.time.step);
        match &mut self.hands {
            Hands::Waiting => {}
            Hands::Scene(clock) => clock.advance(&mut self.simulation, end, on_tick)?,
            Hands::Wall(clock) => clock.before_step(&mut self.simulation, begin, end),
        }
        let started = Instant::now();
        let report = self.simulation.step(check)?;
        let took = started.elapsed();
        self.steps += 1;
        if let Hands::Wall(clock) = &mut self.hands {
            clock.after_step(&self.simulation, on_tick)?;
        }
        Ok(Step { report, took })
    }

    /// All that the rest of the run depends on. The run goes on as if it had not been asked for.
    ///
    /// # Errors
    /// By the wall clock, and of recorded devices; when a device fails.
    pub fn state(&mut self) -> Result<State> {
        let hands = self.scene_clock()?.state();
        Ok(State { steps: self.steps, simulation: self.simulation.state()?, hands })
    }

    /// Goes to where a run of the same scene was, from wherever this one is.
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

    /// The haptic side, if it can be gone on with.
    fn scene_clock(&mut self) -> Result<&mut SceneClock> {
        if matches!(self.hands, Hands::Waiting) {
            self.start(false)?;
        }
        match &mut self.hands {
            Hands::Scene(clock) if !self.records => Ok(clock),
            _ => Err(Refused::NoState.into()),
        }
    }

    /// Lets the wall clock stand still until the next step: that one begins when the rest of its time has gone by from then on.
    pub fn pause(&mut self) {
        if let Hands::Wall(clock) = &mut self.hands {
            clock.pause();
        }
    }

    /// What the haptic side has counted; none where no hand holds a tool.
    pub fn haptic(&mut self) -> Option<HapticCounts> {
        match &mut self.hands {
            Hands::Waiting => None,
            Hands::Scene(clock) => clock.counts(),
            Hands::Wall(clock) => Some(clock.counts()),
        }
    }

    /// Stops the clock and lets the devices go: no force is on any hand from here on.
    ///
    /// # Errors
    /// When a device was not closed as it should, or its thread has ended before.
    pub fn stop(&mut self, on_tick: OnTick) -> Result<()> {
        self.stopped = true;
        match &mut self.hands {
            Hands::Waiting => Ok(()),
            Hands::Scene(clock) => clock.close(),
            Hands::Wall(clock) => clock.stop(on_tick),
        }
    }
}

/// Leaves one core to the haptic threads: the parallel work of this process gets one thread less than there are cores.
///
/// # Errors
/// When that work has begun already.
pub fn leave_a_core() -> Result<()> {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(cores.saturating_sub(1).max(1));
    pool.build_global().map_err(|source| Refused::CoresTaken { source }.into())
}

/// Starts the threads of the parallel work, one for each core.
///
/// # Errors
/// [`Refused::Threads`] when the machine gives none.
pub fn take_all_cores() -> Result<()> {
    let started = rayon::ThreadPoolBuilder::new().build_global();
    // one that is there already serves as well
    let reason = |e: &rayon::ThreadPoolBuildError| std::error::Error::source(e).map(ToString::to_string);
    let refused = started.err().as_ref().and_then(reason).map(std::io::Error::other);
    refused.map_or(Ok(()), |source| Err(Refused::Threads { source }.into()))
}
