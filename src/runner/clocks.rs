//! Haptic loops by the scene's clock and by the wall clock.
//!
//! By the scene's clock a step's contact problem serves the ticks until the end of the next step, as on a live device. A tool without
//! `[tool.device]` is held by its recorded hand, whose force is computed unmodified: no ramp, no limits, no controller. A tool with a
//! device is treated as under the wall clock, and the device moves the tool in the simulation.
//!
//! By the wall clock there is one thread per device, and the simulation is paced by the same clock. Step k begins `k h` after the start, or
//! at once if that has passed. Up to a tick is made up for; if a step begins more than a tick late, it is counted and the scene falls
//! behind the wall clock by that time: a long step delays no step but the next. (The first step, which begins when the threads have started, is not
//! counted.) Each step is to end by the next one's beginning ([`Simulation::finish_by`]). At its start the tools follow their hands from the pose of
//! the last step's start, so that no motion is lost. At its end its contact problems go to the servos, with the time of the hand poses that
//! they are based on.

use super::{Channel, HapticCounts, OnTick, RING, Refused, Shortened};
use crate::error::Result;
use crate::haptic::Reduced;
use crate::haptic::servo::{BUDGET, Counts, Felt, Problem, Record, Servo, Settings, SimulationEnd, cells};
use crate::haptic::thread::{Loop, Timing};
use crate::scene::Scene;
use crate::step::{self, Simulation, StepReport};
use rtrb::{Consumer, RingBuffer};
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{Builder, JoinHandle, sleep};
use std::time::{Duration, Instant};

/// Tolerance for the end of a step, s: a tick belongs to the step that its time falls in, and step times are rounded sums.
const SLACK: f64 = 1e-9;

/// By the scene's clock: all devices with their problems.
pub(super) struct SceneClock {
    channels: Vec<(Channel, Problem)>,
    rate: f64,
    tick_number: u64,
    closed: bool,
}

impl Drop for SceneClock {
    /// Closes the devices of a failed run as well; the run's own error is the one reported.
    fn drop(&mut self) {
        drop(self.close());
    }
}

/// State of the haptic loop between two steps.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct State {
    channels: Vec<ChannelState>,
    tick_number: u64,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct ChannelState {
    servo: Servo,
    device: Vec<f64>,
    problem: Problem,
}

impl SceneClock {
    /// Devices at rest at their hands.
    pub fn new(rate: f64, channels: Vec<Channel>) -> Self {
        let channels = channels.into_iter().map(|channel| (channel, Problem::default())).collect();
        Self { channels, rate, tick_number: 0, closed: false }
    }

    /// Accepts the last step's contact problems and ticks until `end`, s; then moves the tools to their devices.
    pub fn advance(&mut self, simulation: &mut Simulation, end: f64, on_tick: OnTick) -> Result<()> {
        if self.channels.is_empty() {
            return Ok(());
        }
        let (now, announced) = (simulation.time, simulation.epoch());
        for ((_, problem), reduced) in self.channels.iter_mut().zip(&simulation.reduced) {
            let number = problem.number + 1;
            problem.refill(reduced, now, number, announced);
        }
        while (self.tick_number + 1) as f64 / self.rate <= end + SLACK {
            self.tick_number += 1;
            let time = self.tick_number as f64 / self.rate;
            for (number, (channel, problem)) in self.channels.iter_mut().enumerate() {
                let record = channel.servo.tick(channel.device.read(time), problem, time);
                channel.device.write(time, record.wrench);
                on_tick(number, &record)?;
            }
        }
        for ((channel, _), tool) in self.channels.iter().zip(&mut simulation.tools).filter(|((c, _), _)| c.moves) {
            let felt = channel.servo.felt();
            tool.follow((felt.hand.position, felt.hand.rotation), now, end);
            tool.sharp = felt.active;
        }
        Ok(())
    }

    /// Counts of the servos; none if no hand holds a tool.
    pub fn counts(&self) -> Option<HapticCounts> {
        let servos: Vec<_> = self.channels.iter().map(|(channel, _)| channel.servo.counts()).collect();
        (!servos.is_empty()).then_some(HapticCounts {
            rate: self.rate,
            servos,
            timing: None,
            late_steps: 0,
            behind: 0.0,
            shortened: Shortened::default(),
        })
    }

    /// State of servos and devices.
    pub fn state(&self) -> State {
        let of = |(channel, problem): &(Channel, Problem)| ChannelState {
            servo: channel.servo.clone(),
            device: channel.device.state(),
            problem: problem.clone(),
        };
        State { channels: self.channels.iter().map(of).collect(), tick_number: self.tick_number }
    }

    /// Whether a state has as many devices.
    pub fn fits(&self, state: &State) -> Result<()> {
        let (found, wanted) = (state.channels.len(), self.channels.len());
        match found == wanted {
            true => Ok(()),
            false => Err(step::Refused::StateUnfit { what: "devices", found, wanted }.into()),
        }
    }

    /// Restores a state.
    pub fn restore(&mut self, state: &State) {
        for ((channel, problem), from) in self.channels.iter_mut().zip(&state.channels) {
            channel.servo.clone_from(&from.servo);
            channel.device.restore(&from.device);
            problem.clone_from(&from.problem);
        }
        self.tick_number = state.tick_number;
    }

    /// Closes all devices, once; returns the first error.
    pub fn close(&mut self) -> Result<()> {
        let mut closed = Ok(());
        if std::mem::replace(&mut self.closed, true) {
            return closed;
        }
        for (channel, _) in &mut self.channels {
            closed = closed.and(channel.device.close());
        }
        closed
    }
}

/// Longest wait between two looks at `interrupt`, s: a run that is interrupted ends at once for whoever waits for it.
const SLICE: f64 = 0.02;

type Ended = (Timing, Felt, Result<()>);

/// By the wall clock: all devices, running.
pub(super) struct WallClock {
    threads: Vec<Thread>,
    stop: Arc<AtomicBool>,
    /// Set by the caller of the run.
    interrupt: Arc<AtomicBool>,
    start: Instant,
    rate: f64,
    late_steps: u64,
    /// Time by which the scene fell behind the wall clock, s.
    behind: f64,
    shortened: Shortened,
    /// Time of the last reading of the hands, s.
    seen: f64,
    /// Total time of pauses, s, and the start of the present one.
    paused: f64,
    pausing: Option<Instant>,
    done: Option<(Timing, Vec<Counts>)>,
}

/// Simulation's end of a device's thread.
struct Thread {
    cells: SimulationEnd,
    records: Consumer<Record>,
    handle: Option<JoinHandle<Ended>>,
}

impl WallClock {
    /// Starts the device threads, which `interrupt` ends too; none if no hand holds a tool.
    pub fn start(
        scene: &Scene,
        simulation: &Simulation,
        channels: Vec<Channel>,
        interrupt: Arc<AtomicBool>,
    ) -> Result<Self> {
        let mut clock = Self {
            threads: vec![],
            stop: Arc::default(),
            interrupt,
            start: Instant::now(),
            rate: scene.haptic.rate,
            late_steps: 0,
            behind: 0.0,
            shortened: Shortened::default(),
            seen: 0.0,
            paused: 0.0,
            pausing: None,
            done: None,
        };
        for (channel, tool) in channels.into_iter().zip(&simulation.tools) {
            let Channel { servo, device, .. } = channel;
            let servo = Servo::new(Settings { budget: Some(BUDGET), ..servo.settings }, servo.felt().hand);
            let untouched = Reduced::free(tool.position, tool.rotation, 0);
            let (cells, ours) = cells(&Problem { reduced: untouched, ..Problem::default() }, &servo.felt());
            let (producer, records) = RingBuffer::new((RING * scene.haptic.rate) as usize);
            let (stop, interrupt, start) = (clock.stop.clone(), clock.interrupt.clone(), clock.start);
            let device_loop = Loop { servo, device, cells, records: producer };
            let named = Builder::new().name("haptic".into());
            let spawned = named.spawn(move || device_loop.run(start, [&stop, &interrupt]));
            let handle = spawned.map_err(|source| Refused::HapticThread { source })?;
            clock.threads.push(Thread { cells: ours, records, handle: Some(handle) });
        }
        Ok(clock)
    }

    /// Pauses the steps until the next one is requested.
    pub fn pause(&mut self) {
        self.pausing.get_or_insert_with(Instant::now);
    }

    /// Waits until the step from `begin` to `end` (scene time, s) may start, or until the run is interrupted; moves the tools to their
    /// hands.
    pub fn before_step(&mut self, simulation: &mut Simulation, begin: f64, end: f64) {
        self.paused += self.pausing.take().map_or(0.0, |since| since.elapsed().as_secs_f64());
        let due = begin + self.paused + self.behind;
        while !self.interrupt.load(Ordering::Acquire) {
            let left = due - self.start.elapsed().as_secs_f64();
            if left <= 0.0 {
                break;
            }
            sleep(Duration::from_secs_f64(left.min(SLICE)));
        }
        self.seen = self.start.elapsed().as_secs_f64();
        let late = self.seen - due;
        if late > 1.0 / self.rate {
            // the first step begins when the threads have started
            self.late_steps += u64::from(begin > 0.0);
            self.behind += late;
        }
        let done = Duration::from_secs_f64((end + self.paused + self.behind).max(0.0));
        simulation.finish_by(self.start + done);
        for (thread, tool) in self.threads.iter_mut().zip(&mut simulation.tools) {
            let felt = thread.cells.felt.read();
            tool.follow((felt.hand.position, felt.hand.rotation), begin, end);
            tool.sharp = felt.active;
        }
    }

    /// Hands the step's contact problems over and passes on the servos' records.
    pub fn after_step(&mut self, simulation: &Simulation, report: &StepReport, on_tick: OnTick) -> Result<()> {
        self.shortened.count(&report.contact);
        for (thread, reduced) in self.threads.iter_mut().zip(&simulation.reduced) {
            thread.cells.publish(reduced, self.seen, simulation.epoch());
        }
        self.tell(on_tick)
    }

    fn tell(&mut self, on_tick: OnTick) -> Result<()> {
        for (number, thread) in self.threads.iter_mut().enumerate() {
            while let Ok(record) = thread.records.pop() {
                on_tick(number, &record)?;
            }
        }
        Ok(())
    }

    /// Stops the threads, which close their devices, and passes on the last records; returns the first error.
    pub fn stop(&mut self, on_tick: OnTick) -> Result<()> {
        self.stop.store(true, Ordering::Release);
        let (mut timing, mut counts, mut ended) = (Timing::new(), vec![], Ok(()));
        for thread in &mut self.threads {
            let Some(handle) = thread.handle.take() else { continue };
            let joined = handle.join().map_err(|_| Refused::Panicked.into());
            ended = ended.and(joined.and_then(|(of_one, felt, closed)| {
                timing.merge(&of_one);
                counts.push(felt.counts);
                closed
            }));
        }
        self.done.get_or_insert((timing, counts));
        ended.and(self.tell(on_tick))
    }

    /// Counts of the servos; timing once the threads have stopped.
    pub fn counts(&mut self) -> HapticCounts {
        let (timing, servos) = match &self.done {
            Some((timing, counts)) => (Some(timing.clone()), counts.clone()),
            None => (None, self.threads.iter_mut().map(|thread| thread.cells.felt.read().counts).collect()),
        };
        let (late_steps, behind, shortened) = (self.late_steps, self.behind, self.shortened);
        HapticCounts { rate: self.rate, servos, timing, late_steps, behind, shortened }
    }
}

impl Drop for WallClock {
    /// Closes the devices of a failed run as well: each thread writes zero force and closes its device.
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Release);
        for handle in self.threads.iter_mut().filter_map(|thread| thread.handle.take()) {
            // the run's own error is the one reported
            drop(handle.join());
        }
    }
}
