//! Loop of a device by the wall clock: a thread of its own, with deadlines that do not drift.
//!
//! Tick k is due at `start + k T`. The thread sleeps until shortly before and then polls the clock, because a sleep may end more than a
//! tick late. Missed deadlines are counted and skipped. Periods and durations of ticks are counted in fixed memory. Records go through a
//! wait-free ring; those that find it full are counted and lost.

use super::device::Device;
use super::servo::{Felt, Record, Servo, ServoEnd};
use crate::error::Result;
use rtrb::Producer;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// Time before a deadline at which the thread stops sleeping, s: sleeps of common kernels end 0.05 to 0.1 ms late.
const SPIN: f64 = 2e-4;
/// Maximum fraction of a tick spent polling, so that loops of 4 kHz leave their cores some time.
const SPIN_SHARE: f64 = 0.2;

/// Timing statistics of a loop.
#[derive(Clone, Debug)]
pub struct Timing {
    /// Time between ticks, s.
    pub period: Histogram,
    /// Duration of a tick, s.
    pub tick: Histogram,
    /// Age of the problem at a tick, s.
    pub age: Histogram,
    /// Missed deadlines.
    pub missed: u64,
    /// Records that found the ring full.
    pub lost: u64,
    /// Faults of the device.
    pub faults: u64,
}

impl Timing {
    /// Empty; resolution 0.1 ms up to 0.8 s for ages, 1 µs up to 8 ms for times.
    pub fn new() -> Self {
        Self {
            period: Histogram::new(1e-6),
            tick: Histogram::new(1e-6),
            age: Histogram::new(1e-4),
            missed: 0,
            lost: 0,
            faults: 0,
        }
    }

    /// Adds the statistics of another loop.
    pub fn merge(&mut self, other: &Self) {
        self.period.merge(&other.period);
        self.tick.merge(&other.tick);
        self.age.merge(&other.age);
        self.missed += other.missed;
        self.lost += other.lost;
        self.faults += other.faults;
    }
}

impl Default for Timing {
    fn default() -> Self {
        Self::new()
    }
}

/// State of a loop.
pub struct Loop {
    /// Tick of the device.
    pub servo: Servo,
    /// Device to read and write.
    pub device: Box<dyn Device>,
    /// Exchange with the simulation.
    pub cells: ServoEnd,
    /// Ring to the writer of records.
    pub records: Producer<Record>,
}

impl Loop {
    /// Ticks from `start` until one of `stops` is set, then releases the device. Returns timing, the last message, and how closing went.
    pub fn run(mut self, start: Instant, stops: [&AtomicBool; 2]) -> (Timing, Felt, Result<()>) {
        let mut timing = Timing::new();
        let tick = self.servo.settings.tick;
        let mut number = 0u64;
        let mut before: Option<f64> = None;
        while !stops.iter().any(|stop| stop.load(Ordering::Acquire)) {
            let due = number as f64 * tick;
            wait(start, due, SPIN.min(SPIN_SHARE * tick));
            let begin = start.elapsed().as_secs_f64();
            if let Some(before) = before.replace(begin) {
                timing.period.add(begin - before);
            }
            self.once(begin, &mut timing);
            let end = start.elapsed().as_secs_f64();
            timing.tick.add(end - begin);
            // next deadline in the future
            let next = ((end / tick).ceil() as u64).max(number + 1);
            timing.missed += next - number - 1;
            number = next;
        }
        self.device.write(start.elapsed().as_secs_f64(), super::device::Wrench::default());
        let felt = self.servo.felt();
        timing.faults = self.device.faults();
        (timing, felt, self.device.close())
    }

    fn once(&mut self, time: f64, timing: &mut Timing) {
        let reading = self.device.read(time);
        let record = self.servo.tick(reading, self.cells.problem.read(), time);
        self.device.write(time, record.wrench);
        self.cells.felt.write(self.servo.felt());
        timing.age.add(record.age);
        timing.lost += u64::from(self.records.push(record).is_err());
    }
}

/// Waits until `due` seconds after `start`, polling for the last `spin` seconds.
fn wait(start: Instant, due: f64, spin: f64) {
    let left = due - start.elapsed().as_secs_f64();
    if left > spin {
        sleep(Duration::from_secs_f64(left - spin));
    }
    while start.elapsed().as_secs_f64() < due {
        std::hint::spin_loop();
    }
}

/// Number of bins; larger values count in the last one, and the largest value is stored.
const BINS: usize = 8192;

/// Order statistics of many values in fixed memory: counts in bins of equal width.
#[derive(Clone, Debug)]
pub struct Histogram {
    width: f64,
    bins: Box<[u64]>,
    count: u64,
    largest: f64,
}

impl Histogram {
    /// Empty histogram with bins of `width`.
    pub fn new(width: f64) -> Self {
        Self { width, bins: vec![0; BINS].into_boxed_slice(), count: 0, largest: 0.0 }
    }

    /// Counts a value of 0 or more; allocates nothing.
    pub fn add(&mut self, value: f64) {
        let bin = (value / self.width) as usize; // a negative float becomes 0
        self.bins[bin.min(BINS - 1)] += 1;
        self.count += 1;
        self.largest = self.largest.max(value);
    }

    /// Adds the counts of a histogram of the same width.
    pub fn merge(&mut self, other: &Self) {
        assert!(self.width == other.width, "histograms of one width");
        for (sum, more) in self.bins.iter_mut().zip(&other.bins) {
            *sum += more;
        }
        self.count += other.count;
        self.largest = self.largest.max(other.largest);
    }

    /// Smallest bin edge such that at least the fraction `share` of the values lies at or below it: at most one bin too large. `None`
    /// without values.
    pub fn quantile(&self, share: f64) -> Option<f64> {
        let rank = (share * self.count as f64).ceil().max(1.0) as u64;
        let mut below = 0;
        for (bin, count) in self.bins.iter().enumerate() {
            below += count;
            if below >= rank {
                let edge = if bin + 1 == BINS { self.largest } else { (bin + 1) as f64 * self.width };
                return Some(edge.min(self.largest));
            }
        }
        None
    }

    /// Largest value; `None` without values.
    pub fn max(&self) -> Option<f64> {
        (self.count > 0).then_some(self.largest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_right_to_a_bin_and_the_largest_is_exact() {
        let mut histogram = Histogram::new(1.0);
        assert_eq!((histogram.quantile(0.5), histogram.max()), (None, None));
        for value in 1..=1000 {
            histogram.add(f64::from(value));
        }
        histogram.add(1e6);
        let near = |share, wanted: f64| (histogram.quantile(share).unwrap_or(f64::NAN) - wanted).abs() <= 1.0;
        assert!(near(0.5, 501.0) && near(0.99, 991.0), "{:?}", histogram.quantile(0.99));
        assert_eq!((histogram.quantile(1.0), histogram.max()), (Some(1e6), Some(1e6)));
    }
}
