//! Haptic results of a run: `haptic.csv`, recordings, counters for the report.

use super::listing::Listing;
use super::{HapticReport, Periods};
use crate::error::Result;
use crate::haptic::devices::Row;
use crate::haptic::servo::Record;
use crate::haptic::thread::Timing;
use crate::output::{Table, TableMark};
use crate::runner::HapticCounts;
use crate::scene::{FORCE_COLUMNS, Scene, TRAJECTORY_COLUMNS, Tool};
use rtrb::Consumer;
use std::path::Path;

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

/// Name of a tool's recording.
pub(super) fn recording(tool: &Tool) -> String {
    let plain = |c: char| if c.is_alphanumeric() || "-_".contains(c) { c } else { '_' };
    format!("hand_{}.csv", tool.name.chars().map(plain).collect::<String>())
}

/// Table of all ticks, and the recordings of devices.
#[derive(Default)]
pub(super) struct HapticFiles {
    ticks: Option<Table>,
    recordings: Vec<Recording>,
}

impl HapticFiles {
    /// Creates `haptic.csv` in a folder, and `hand_TOOL.csv` for each recorded device.
    pub fn create(listing: &mut Listing, scene: &Scene, rows: Vec<(usize, Consumer<Row>)>) -> Result<Self> {
        let ticks = Some(Table::create(&listing.add("haptic.csv")?, &COLUMNS)?);
        let mut recordings = vec![];
        for (tool, rows) in rows {
            recordings.push(Recording::create(&listing.add(&recording(&scene.tools[tool]))?, rows)?);
        }
        Ok(Self { ticks, recordings })
    }

    /// Checks that the `haptic.csv` of a folder matches a mark.
    pub fn verify(folder: &Path, kept: Option<TableMark>) -> Result<()> {
        kept.map_or(Ok(()), |kept| Table::verify(&folder.join("haptic.csv"), &COLUMNS, kept))
    }

    /// Continues the `haptic.csv` of a folder.
    pub fn reopen(folder: &Path, kept: Option<TableMark>) -> Result<Self> {
        let reopened = kept.map(|kept| Table::reopen(&folder.join("haptic.csv"), &COLUMNS, kept));
        Ok(Self { ticks: reopened.transpose()?, recordings: vec![] })
    }

    /// Mark of `haptic.csv`, with all rows flushed; `None` without one.
    pub fn kept(&mut self) -> Result<Option<TableMark>> {
        self.ticks.as_mut().map(Table::kept).transpose()
    }

    /// Adds one tick of a tool: positions and forces in the scene.
    pub fn add(&mut self, tool: usize, record: &Record) -> Result<()> {
        let Some(ticks) = &mut self.ticks else { return Ok(()) };
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
        ticks.row(&row)?;
        self.recordings.iter_mut().try_for_each(Recording::drain)
    }

    /// Closes all tables; returns the first error.
    pub fn finish(&mut self) -> Result<()> {
        let closed = self.ticks.take().map_or(Ok(()), Table::finish);
        self.recordings.drain(..).fold(closed, |closed, recording| closed.and(recording.finish()))
    }
}

/// Report of the servos' counters (sums of counts, maxima of magnitudes) and of the timing, if measured.
pub(super) fn report(counted: &HapticCounts) -> HapticReport {
    let mut r = HapticReport { rate_hz: counted.rate, ..HapticReport::default() };
    let ticks: u64 = counted.servos.iter().map(|c| c.ticks).sum();
    r.old_share = counted.servos.iter().map(|c| c.old).sum::<u64>() as f64 / ticks.max(1) as f64;
    for c in &counted.servos {
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
    counted.timing.iter().for_each(|timing| timed(&mut r, timing, counted));
    r
}

/// Warning of a device that was lost.
pub(super) const LOST: &str = "device_lost";
/// Share of a device's ticks without it that is warned of: below, the hand led the tool for most of the run.
const LOST_SHARE: f64 = 0.5;

/// Ticks of devices that were lost for most of the run.
fn lost(counted: &HapticCounts) -> u64 {
    let gone = counted.servos.iter().filter(|c| c.lost as f64 > LOST_SHARE * c.ticks as f64);
    gone.map(|c| c.lost).sum()
}

/// Warnings of the servos, with their counts.
pub(super) fn warnings(counted: &HapticCounts) -> impl Iterator<Item = (&'static str, u64)> {
    let jumps = counted.servos.iter().map(|c| c.jumps).sum();
    [(LOST, lost(counted)), ("force_jumped", jumps)].into_iter().filter(|(_, count)| *count > 0)
}

/// Adds the timing.
fn timed(r: &mut HapticReport, timing: &Timing, counted: &HapticCounts) {
    let spread = |h: &crate::haptic::thread::Histogram, unit: f64| Periods {
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
    r.late_steps = Some(counted.late_steps);
    r.behind_ms = Some(counted.behind * 1e3);
    r.shortened_steps = Some(counted.shortened.steps);
    r.shortened_n_max = Some(counted.shortened.residual_n);
    r.shortened_mm_max = Some(counted.shortened.residual_m * 1e3);
}

/// An open recording of a device: `hand_TOOL.csv`, written during the run; a killed run leaves it up to the last flush.
pub struct Recording {
    rows: Consumer<Row>,
    table: Table,
}

impl Recording {
    /// Creates or truncates the file at `path`; `rows` come from a [`Recorder`](crate::haptic::devices::Recorder).
    ///
    /// # Errors
    /// Here and in every method: if the file cannot be written.
    pub fn create(path: &Path, rows: Consumer<Row>) -> Result<Self> {
        let columns: Vec<&str> = TRAJECTORY_COLUMNS.iter().chain(&FORCE_COLUMNS).copied().collect();
        Ok(Self { rows, table: Table::create(path, &columns)? })
    }

    /// Writes the rows that have arrived.
    pub fn drain(&mut self) -> Result<()> {
        while let Ok(row) = self.rows.pop() {
            self.table.row(&row)?;
        }
        Ok(())
    }

    /// Writes the remaining rows and closes the file.
    pub fn finish(mut self) -> Result<()> {
        self.drain()?;
        self.table.finish()
    }
}
