//! The haptic side under the wall clock: one thread per device, the simulation paced by the same clock.
//!
//! Step k begins when `k h` have gone by since the start, or at once when that is over; a step that begins later than a tick after its
//! time is counted as late. At its start the tools go to where their hands are then, from where they were at the last step's, so that no
//! motion is lost. When it has ended its contact problems go to the servos, with the time of the hands that they know.

use super::HapticReport;
use super::haptics::{Line, RING, Ticks, lines, report, timed, untouched};
use super::recording::Recording;
use super::run::Options;
use crate::error::{Error, Result};
use crate::haptic::cells::{Felt, SimulationEnd, cells};
use crate::haptic::servo::{BUDGET, Counts, Record, Servo};
use crate::haptic::thread::{Loop, Timing};
use crate::scene::Scene;
use crate::step::Simulation;
use rtrb::{Consumer, RingBuffer};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{Builder, JoinHandle, sleep};
use std::time::{Duration, Instant};

type Ended = (Timing, Felt, Result<()>);

/// All devices, running.
pub(super) struct Live {
    links: Vec<Link>,
    ticks: Option<Ticks>,
    stop: Arc<AtomicBool>,
    start: Instant,
    rate: f64,
    late_steps: u64,
    /// When the hands were looked at last, s.
    seen: f64,
    done: Option<(Timing, Vec<Counts>)>,
    /// What a loop ended with; told after the report is written.
    failed: Option<Error>,
}

struct Link {
    cells: SimulationEnd,
    records: Consumer<Record>,
    recording: Option<Recording>,
    thread: Option<JoinHandle<Ended>>,
}

impl Live {
    /// Opens the devices and starts their threads; none without tools that a hand holds.
    pub fn start(scene: &Scene, simulation: &Simulation, options: &Options) -> Result<Self> {
        let stop = Arc::new(AtomicBool::new(false));
        let ticks = Some(Ticks::create(&options.out)?);
        let opened = lines(scene, simulation, options)?;
        // devices take their time to open; the clock begins when all are there
        let start = Instant::now();
        let mut live = Self {
            links: vec![],
            ticks,
            stop,
            start,
            rate: scene.haptic.rate,
            late_steps: 0,
            seen: 0.0,
            done: None,
            failed: None,
        };
        for (line, tool) in opened.into_iter().zip(&simulation.tools) {
            let Line { servo, device, recording, .. } = line;
            let settings = crate::haptic::servo::Settings { budget: Some(BUDGET), ..servo.settings };
            let servo = Servo::new(settings, servo.felt().hand);
            let (cells, ours) = cells(&untouched(tool), &servo.felt());
            let (producer, records) = RingBuffer::new((RING * scene.haptic.rate) as usize);
            let (stop, start) = (live.stop.clone(), live.start);
            let device_loop = Loop { servo, device, cells, records: producer };
            let named = Builder::new().name("haptic".into());
            let spawned = named.spawn(move || device_loop.run(start, &stop));
            let thread = spawned.map_err(|source| Error::Usage {
                what: format!("the haptic thread cannot be started ({source})"),
                fix: "let the system have more threads, or run without --realtime".into(),
            })?;
            live.links.push(Link { cells: ours, records, recording, thread: Some(thread) });
        }
        Ok(live)
    }

    /// Waits until the step from `begin` to `end` (scene time, s) may start; the tools go to their hands.
    pub fn before_step(&mut self, simulation: &mut Simulation, begin: f64, end: f64) {
        let left = begin - self.start.elapsed().as_secs_f64();
        if left > 0.0 {
            sleep(Duration::from_secs_f64(left));
        }
        self.seen = self.start.elapsed().as_secs_f64();
        self.late_steps += u64::from(self.seen > begin + 1.0 / self.rate);
        for (link, tool) in self.links.iter_mut().zip(&mut simulation.tools) {
            let felt = link.cells.felt.read();
            tool.follow((felt.hand.position, felt.hand.rotation), begin, end);
            tool.sharp = felt.active;
        }
    }

    /// Hands the step's contact problems over and writes down what the servos did meanwhile.
    pub fn after_step(&mut self, simulation: &Simulation) -> Result<()> {
        for (link, reduced) in self.links.iter_mut().zip(&simulation.reduced) {
            link.cells.hand_over(reduced, self.seen, simulation.epoch());
        }
        self.drain()
    }

    fn drain(&mut self) -> Result<()> {
        let Some(ticks) = &mut self.ticks else { return Ok(()) };
        for (number, link) in self.links.iter_mut().enumerate() {
            while let Ok(record) = link.records.pop() {
                ticks.add(number, &record)?;
            }
            link.recording.as_mut().map_or(Ok(()), Recording::drain)?;
        }
        Ok(())
    }

    /// Stops the threads and lets the devices go.
    pub fn stop(&mut self) -> Result<()> {
        self.stop.store(true, Ordering::Release);
        let (mut timing, mut counts) = (Timing::new(), vec![]);
        for link in &mut self.links {
            let Some(thread) = link.thread.take() else { continue };
            let panicked = |_| Error::Usage {
                what: "a haptic thread has panicked".into(),
                fix: "report what it said above, with the scene".into(),
            };
            match thread.join().map_err(panicked) {
                Ok((of_one, felt, closed)) => {
                    timing.merge(&of_one);
                    counts.push(felt.counts);
                    self.failed = self.failed.take().or(closed.err());
                }
                Err(error) => self.failed = Some(error),
            }
        }
        self.done = Some((timing, counts));
        self.drain()
    }

    /// For the report; what the clock has shown once the threads have stopped.
    pub fn report(&mut self) -> HapticReport {
        match &self.done {
            Some((timing, counts)) => timed(report(self.rate, counts.iter().copied()), timing, self.late_steps),
            None => report(self.rate, self.links.iter_mut().map(|link| link.cells.felt.read().counts)),
        }
    }

    /// Closes the table.
    ///
    /// # Errors
    /// When it cannot be written, or a device was not closed as it should.
    pub fn finish(&mut self) -> Result<()> {
        self.ticks.take().map_or(Ok(()), Ticks::finish)?;
        for link in &mut self.links {
            link.recording.take().map_or(Ok(()), Recording::finish)?;
        }
        self.failed.take().map_or(Ok(()), Err)
    }
}

impl Drop for Live {
    /// A run that fails lets its devices go as well: each thread writes no force and closes its device.
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Release);
        for thread in self.links.iter_mut().filter_map(|link| link.thread.take()) {
            // the run's own error is what is told
            drop(thread.join());
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
    pool.build_global().map_err(|source| Error::Usage {
        what: format!("no core can be left to the haptic threads ({source})"),
        fix: "ask for it before anything is computed".into(),
    })
}

/// Starts the threads of the parallel work, one for each core.
///
/// # Errors
/// [`Error::Threads`] when the machine gives none.
pub fn take_all_cores() -> Result<()> {
    let started = rayon::ThreadPoolBuilder::new().build_global();
    // one that is there already serves as well
    let reason = |e: &rayon::ThreadPoolBuildError| std::error::Error::source(e).map(ToString::to_string);
    let refused = started.err().as_ref().and_then(reason).map(std::io::Error::other);
    refused.map_or(Ok(()), |source| Err(Error::Threads { source }))
}
