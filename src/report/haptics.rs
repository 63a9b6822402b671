//! The haptic side of a run, into `haptic.csv`: under the scene's clock here, under the wall clock in [`live`](super::live).
//!
//! Under the scene's clock a step's contact problem serves the ticks of the time until the next step has ended, as a live device gets it.
//! A tool without a `[tool.device]` is held by its recorded hand, and what that would feel is found as it is: no ramp, no limits, no
//! controller. A tool with one is treated as under the wall clock, and its device moves the tool in the simulation.

use super::recording::Recording;
use super::run::Options;
use super::{HapticReport, Periods};
use crate::error::{Error, Result};
use crate::haptic::cells::Problem;
use crate::haptic::device::{Device, Limits, Workspace};
use crate::haptic::devices::open;
use crate::haptic::replay::Recorder;
use crate::haptic::servo::{Counts, Record, Servo, Settings};
use crate::haptic::thread::Timing;
use crate::haptic::{Hand, Reduced};
use crate::instrument::Instrument;
use crate::output::Table;
use crate::scene::{self, DeviceKind, Scene};
use crate::step::Simulation;
use glam::DVec3;
use std::path::Path;

/// A tick belongs to the step in which its time falls; times are sums of rounded steps, so they may differ by this, s.
const SLACK: f64 = 1e-9;
/// Rows for which memory is taken at the start; a problem with more grows it once.
const MOST_ROWS: usize = 600;

/// Seconds of ticks that wait to be written down at most: a picture takes less.
pub(super) const RING: f64 = 8.0;

const COLUMNS: [&str; 18] = [
    "time_s",
    "tool",
    "hand_x_mm",
    "hand_y_mm",
    "hand_z_mm",
    "proxy_x_mm",
    "proxy_y_mm",
    "proxy_z_mm",
    "force_x_n",
    "force_y_n",
    "force_z_n",
    "torque_x_n_mm",
    "torque_y_n_mm",
    "torque_z_n_mm",
    "coupling_age_ms",
    "gain",
    "sweeps",
    "active",
];

/// The table of all ticks.
pub(super) struct Ticks(Table);

impl Ticks {
    /// Creates `haptic.csv` in a folder.
    pub fn create(folder: &Path) -> Result<Self> {
        Ok(Self(Table::create(&folder.join("haptic.csv"), &COLUMNS)?))
    }

    /// One tick of a tool: places and forces in the scene.
    pub fn add(&mut self, tool: usize, record: &Record) -> Result<()> {
        let mut row = [0.0; COLUMNS.len()];
        (row[0], row[1]) = (record.time, tool as f64);
        let groups = [record.hand.position * 1e3, record.proxy * 1e3, record.felt.force, record.felt.torque * 1e3];
        for (at, group) in groups.iter().enumerate() {
            row[2 + 3 * at..5 + 3 * at].copy_from_slice(&group.to_array());
        }
        row[14..].copy_from_slice(&[
            record.age * 1e3,
            record.gain,
            f64::from(record.sweeps),
            f64::from(u8::from(record.active)),
        ]);
        self.0.row(&row)
    }

    /// Closes the table.
    pub fn finish(self) -> Result<()> {
        self.0.finish()
    }

    /// Hands all rows so far to the system.
    pub fn flush(&mut self) -> Result<()> {
        self.0.flush()
    }
}

/// A tool's device and its servo.
pub(super) struct Line {
    pub servo: Servo,
    pub device: Box<dyn Device>,
    /// The scene has a device for the tool, which moves it.
    pub moves: bool,
    /// Where the device is recorded.
    pub recording: Option<Recording>,
}

/// Devices and servos of the tools that a hand holds, all at rest; by the wall clock those without a device of their own are guarded too.
pub(super) fn lines(scene: &Scene, simulation: &Simulation, options: &Options) -> Result<Vec<Line>> {
    let live = options.realtime;
    let times = [1.0 / scene.haptic.rate, scene.time.step];
    let others = scene.skins.len() + scene.planes.len() + scene.tools.len();
    let rows = scene.contact.map_or(0, |c| 3 * c.max_contacts as usize * others).min(MOST_ROWS);
    let line = |(tool, asked): (&Instrument, &scene::Tool)| {
        let spec = asked.device.clone().unwrap_or_default();
        if !live && matches!(spec.kind, DeviceKind::Haply { .. }) {
            return Err(Error::Usage {
                what: format!("the tool \"{}\" is held by a haply device, which goes by the wall clock", asked.name),
                fix: "run it with --realtime, or write kind = \"hand\" in its [tool.device]".into(),
            });
        }
        let mut device = open(&spec, asked)?;
        let mut recording = None;
        if options.record {
            let plain = |c: char| if c.is_alphanumeric() || "-_".contains(c) { c } else { '_' };
            let name: String = asked.name.chars().map(plain).collect();
            let file = options.out.join(format!("hand_{name}.csv"));
            let (recorder, rows) = Recorder::new(device, Workspace::new(&spec), (RING * scene.haptic.rate) as usize);
            device = Box::new(recorder);
            recording = Some(Recording::create(&file, rows)?);
        }
        let unlimited = Limits { force: f64::INFINITY, torque: f64::INFINITY };
        let moves = asked.device.is_some();
        let can = if moves { device.limits() } else { unlimited };
        let plain = Settings::new(&spec, tool.coupling, can, times);
        let guarded = moves || live;
        let passivity = plain.passivity && guarded;
        let settings = Settings { guarded, passivity, resolution: device.resolution(), rows, ..plain };
        let (position, rotation) = tool.hand(0.0);
        Ok(Line { servo: Servo::new(settings, Hand { position, rotation }), device, moves, recording })
    };
    let held = simulation.tools.iter().zip(&scene.tools).take_while(|(tool, _)| !tool.free);
    held.map(line).collect()
}

/// All devices under the scene's clock.
pub(super) struct Haptics {
    lines: Vec<(Line, Problem)>,
    ticks: Ticks,
    rate: f64,
    tick_number: u64,
}

impl Haptics {
    /// Devices that rest at their hands; none without tools that a hand holds.
    pub fn new(scene: &Scene, simulation: &Simulation, options: &Options) -> Result<Option<Self>> {
        let lines = lines(scene, simulation, options)?;
        if lines.is_empty() {
            return Ok(None);
        }
        let lines = lines.into_iter().map(|line| (line, Problem::default())).collect();
        Ok(Some(Self { lines, ticks: Ticks::create(&options.out)?, rate: scene.haptic.rate, tick_number: 0 }))
    }

    /// Takes the last step's contact problems and ticks until `end`, s; then the tools go where the devices are.
    pub fn advance(&mut self, simulation: &mut Simulation, end: f64) -> Result<()> {
        let (now, announced) = (simulation.time, simulation.epoch());
        for ((_, problem), reduced) in self.lines.iter_mut().zip(&simulation.reduced) {
            let number = problem.number + 1;
            problem.refill(reduced, now, number, announced);
        }
        while (self.tick_number + 1) as f64 / self.rate <= end + SLACK {
            self.tick_number += 1;
            let time = self.tick_number as f64 / self.rate;
            for (number, (line, problem)) in self.lines.iter_mut().enumerate() {
                let record = line.servo.tick(line.device.read(time), problem, time);
                line.device.write(time, record.wrench);
                self.ticks.add(number, &record)?;
                line.recording.as_mut().map_or(Ok(()), Recording::drain)?;
            }
        }
        for ((line, _), tool) in self.lines.iter().zip(&mut simulation.tools).filter(|((line, _), _)| line.moves) {
            let felt = line.servo.felt();
            tool.follow((felt.hand.position, felt.hand.rotation), now, end);
            tool.sharp = felt.active;
        }
        Ok(())
    }

    /// For the report.
    pub fn report(&self) -> HapticReport {
        report(self.rate, self.lines.iter().map(|(line, _)| line.servo.counts()))
    }

    /// Lets the devices go and closes the tables.
    pub fn finish(&mut self) -> Result<()> {
        let mut closed = Ok(());
        for (line, _) in &mut self.lines {
            closed = closed.and(line.device.close());
            closed = closed.and(line.recording.take().map_or(Ok(()), Recording::finish));
        }
        self.ticks.flush().and(closed)
    }
}

/// What servos have counted, without the clock: sums of counts and energies, the largest of sizes.
pub(super) fn report(rate_hz: f64, counts: impl Iterator<Item = Counts>) -> HapticReport {
    let mut r = HapticReport { rate_hz, ..HapticReport::default() };
    for c in counts {
        r.force_n_max = r.force_n_max.max(c.force_max);
        r.sweeps_max = r.sweeps_max.max(c.sweeps_max);
        r.out_of_time += c.out_of_time;
        r.unsound += c.unsound;
        r.non_finite += c.non_finite;
        r.late_ticks += c.late;
        r.stale_ticks += c.stale;
        r.clamped += c.clamped;
        r.fades += c.fades;
        r.stops += c.stops;
        r.force_jump_n_max = r.force_jump_n_max.max(c.jump_max);
        r.cut_jump_n = r.cut_jump_n.max(c.cut_jump);
        r.energy_out_j = r.energy_out_j.max(c.energy_out);
        r.energy_uncontrolled_j = r.energy_uncontrolled_j.max(c.energy_uncontrolled);
        r.energy_damped_j += c.energy_damped;
    }
    r
}

/// Adds what the clock has shown.
pub(super) fn timed(mut r: HapticReport, timing: &Timing, late_steps: u64) -> HapticReport {
    let spread = |h: &crate::haptic::histogram::Histogram, unit: f64| Periods {
        p50: h.quantile(0.5).map(|v| v * unit),
        p99: h.quantile(0.99).map(|v| v * unit),
        p99_9: h.quantile(0.999).map(|v| v * unit),
        max: h.max().map(|v| v * unit),
    };
    r.period_us = spread(&timing.period, 1e6);
    r.tick_us = spread(&timing.tick, 1e6);
    r.coupling_age_ms = spread(&timing.age, 1e3);
    r.missed = Some(timing.missed);
    r.records_lost = Some(timing.lost);
    r.device_faults = Some(timing.faults);
    r.late_steps = Some(late_steps);
    r
}

/// What a tool that nothing touches has, for the first ticks.
pub(super) fn untouched(tool: &Instrument) -> Problem {
    let (position, rotation): (DVec3, _) = (tool.position, tool.rotation);
    Problem { reduced: Reduced::free(position, rotation, 0), ..Problem::default() }
}
