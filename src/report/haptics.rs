//! The haptic tick under the scene's clock: 1 kHz of scene time, one renderer per tool, into `haptic.csv`.
//!
//! A step's contact problem serves the ticks of the time until the next step has ended, as a live device gets it.

use super::HapticReport;
use crate::error::Result;
use crate::haptic::{Hand, Reduced, Renderer};
use crate::instrument::Instrument;
use crate::output::Table;
use crate::step::Simulation;
use glam::{DQuat, DVec3};
use std::path::Path;

/// Ticks per second of scene time.
const RATE_HZ: f64 = 1000.0;
/// A tick belongs to the step in which its time falls; times are sums of rounded steps, so they may differ by this, s.
const SLACK: f64 = 1e-9;

const COLUMNS: [&str; 14] = [
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
];

/// One device per tool.
pub(super) struct Haptics {
    devices: Vec<Device>,
    table: Table,
    tick_number: u64,
    force_max: f64,
}

struct Device {
    renderer: Renderer,
    hand: (DVec3, DQuat),
    work: f64,
    work_max: f64,
}

impl Haptics {
    /// Devices that rest at their hands; none without tools that a hand holds.
    pub fn new(simulation: &Simulation, folder: &Path) -> Result<Option<Self>> {
        let held = || simulation.tools.iter().take_while(|tool| !tool.free);
        if held().next().is_none() {
            return Ok(None);
        }
        let device = |tool: &Instrument| {
            let (position, rotation) = tool.hand(0.0);
            Device {
                renderer: Renderer::new(tool.coupling, Hand { position, rotation }),
                hand: (position, rotation),
                work: 0.0,
                work_max: 0.0,
            }
        };
        Ok(Some(Self {
            devices: held().map(device).collect(),
            table: Table::create(&folder.join("haptic.csv"), &COLUMNS)?,
            tick_number: 0,
            force_max: 0.0,
        }))
    }

    /// Takes the last step's contact problems and ticks until `end`, s.
    pub fn advance(&mut self, simulation: &Simulation, end: f64) -> Result<()> {
        for (device, problem) in self.devices.iter_mut().zip(&simulation.reduced) {
            device.renderer.receive(problem);
        }
        loop {
            let time = (self.tick_number + 1) as f64 / RATE_HZ;
            if time > end + SLACK {
                return Ok(());
            }
            self.tick_number += 1;
            for (number, (device, problem)) in self.devices.iter_mut().zip(&simulation.reduced).enumerate() {
                let row = device.tick(&simulation.tools[number], problem, time, number);
                self.force_max = self.force_max.max(DVec3::new(row[8], row[9], row[10]).length());
                self.table.row(&row)?;
            }
        }
    }

    /// For the report.
    pub fn report(&self) -> HapticReport {
        HapticReport {
            rate_hz: RATE_HZ,
            force_n_max: self.force_max,
            energy_out_j: self.devices.iter().map(|d| d.work_max).fold(0.0, f64::max),
            ..HapticReport::default()
        }
    }

    /// Closes the table.
    pub fn finish(self) -> Result<()> {
        self.table.finish()
    }
}

impl Device {
    fn tick(&mut self, tool: &Instrument, problem: &Reduced, time: f64, number: usize) -> [f64; COLUMNS.len()] {
        let (position, rotation) = tool.hand(time);
        let tick = self.renderer.tick(problem, Hand { position, rotation }, 1.0 / RATE_HZ);
        let turned = crate::instrument::rotation_vector(rotation * self.hand.1.conjugate());
        self.work += tick.force.dot(position - self.hand.0) + tick.torque.dot(turned);
        self.work_max = self.work_max.max(self.work);
        self.hand = (position, rotation);
        let mut row = [0.0; COLUMNS.len()];
        (row[0], row[1]) = (time, number as f64);
        let groups = [position * 1e3, self.renderer.position * 1e3, tick.force, tick.torque * 1e3];
        for (at, group) in groups.iter().enumerate() {
            row[2 + 3 * at..5 + 3 * at].copy_from_slice(&group.to_array());
        }
        row
    }
}
