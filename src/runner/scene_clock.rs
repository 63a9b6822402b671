//! The haptic side by the scene's clock.
//!
//! A step's contact problem serves the ticks of the time until the next step has ended, as a live device gets it. A tool without a
//! `[tool.device]` is held by its recorded hand, and what that would feel is found as it is: no ramp, no limits, no controller. A tool with
//! one is treated as under the wall clock, and its device moves the tool in the simulation.

use super::channel::Channel;
use super::{HapticCounts, OnTick};
use crate::error::Result;
use crate::haptic::cells::Problem;
use crate::haptic::servo::Servo;
use crate::step::{self, Simulation};
use serde::{Deserialize, Serialize};

/// A tick belongs to the step in which its time falls; times are sums of rounded steps, so they may differ by this, s.
const SLACK: f64 = 1e-9;

/// All devices and their problems.
pub(super) struct SceneClock {
    channels: Vec<(Channel, Problem)>,
    rate: f64,
    tick_number: u64,
    closed: bool,
}

impl Drop for SceneClock {
    /// A run that fails lets its devices go as well; its own error is what is told.
    fn drop(&mut self) {
        drop(self.close());
    }
}

/// Where the haptic side is between two steps.
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
    /// Devices that rest at their hands.
    pub fn new(rate: f64, channels: Vec<Channel>) -> Self {
        let channels = channels.into_iter().map(|channel| (channel, Problem::default())).collect();
        Self { channels, rate, tick_number: 0, closed: false }
    }

    /// Takes the last step's contact problems and ticks until `end`, s; then the tools go where the devices are.
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

    /// What was counted; none where no hand holds a tool.
    pub fn counts(&self) -> Option<HapticCounts> {
        let servos: Vec<_> = self.channels.iter().map(|(channel, _)| channel.servo.counts()).collect();
        (!servos.is_empty()).then_some(HapticCounts { rate: self.rate, servos, timing: None, late_steps: 0 })
    }

    /// Where servos and devices are.
    pub fn state(&self) -> State {
        let of = |(channel, problem): &(Channel, Problem)| ChannelState {
            servo: channel.servo.clone(),
            device: channel.device.state(),
            problem: problem.clone(),
        };
        State { channels: self.channels.iter().map(of).collect(), tick_number: self.tick_number }
    }

    /// Whether a state is of as many devices.
    pub fn fits(&self, state: &State) -> Result<()> {
        let (found, wanted) = (state.channels.len(), self.channels.len());
        match found == wanted {
            true => Ok(()),
            false => Err(step::Refused::StateUnfit { what: "devices", found, wanted }.into()),
        }
    }

    /// Goes there.
    pub fn restore(&mut self, state: &State) {
        for ((channel, problem), from) in self.channels.iter_mut().zip(&state.channels) {
            channel.servo.clone_from(&from.servo);
            channel.device.restore(&from.device);
            problem.clone_from(&from.problem);
        }
        self.tick_number = state.tick_number;
    }

    /// Lets the devices go, all of them, once; the first failure is told.
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
