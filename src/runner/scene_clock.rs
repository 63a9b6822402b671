//! Haptic loop by the scene's clock.
//!
//! A step's contact problem serves the ticks until the end of the next step, as on a live device. A tool without `[tool.device]` is held by
//! its recorded hand, whose force is computed unmodified: no ramp, no limits, no controller. A tool with a device is treated as under the
//! wall clock, and the device moves the tool in the simulation.

use super::{Channel, HapticCounts, OnTick};
use crate::error::Result;
use crate::haptic::cells::Problem;
use crate::haptic::servo::Servo;
use crate::step::{self, Simulation};
use serde::{Deserialize, Serialize};

/// Tolerance for the end of a step, s: a tick belongs to the step that its time falls in, and step times are rounded sums.
const SLACK: f64 = 1e-9;

/// All devices with their problems.
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
