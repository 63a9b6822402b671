//! What goes between the simulation and a servo: the newest problem one way, the newest hand the other.
//!
//! Each goes through a triple buffer, so neither side waits for the other and what is read is always whole. The writer of problems refills
//! buffers that have grown before, so handing over allocates nothing once all three are as large as the largest problem.

use super::{Hand, Reduced};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use triple_buffer::{Input, Output, triple_buffer};

/// A contact problem on its way to a servo.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Problem {
    /// What is left of the skin.
    pub reduced: Reduced,
    /// Time of the hand that it knows, on the servo's clock, s.
    pub time: f64,
    /// Counts hand-overs, from 0 for the first.
    pub number: u64,
    /// Newest epoch that the simulation has announced; a problem of an older one is from before a cut.
    pub announced: u32,
}

impl Problem {
    /// Becomes the next problem, in its own memory.
    pub fn refill(&mut self, reduced: &Reduced, time: f64, number: u64, announced: u32) {
        self.reduced.refill(reduced);
        (self.time, self.number, self.announced) = (time, number, announced);
    }
}

/// What a servo has counted.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Counts {
    /// Ticks.
    pub ticks: u64,
    /// Most sweeps of a tick.
    pub sweeps_max: u32,
    /// Ticks whose time for sweeps was used up.
    pub out_of_time: u64,
    /// Readings that were no poses.
    pub unsound: u64,
    /// Ticks whose force was no number; none is given then.
    pub non_finite: u64,
    /// Ticks on a problem that was too old.
    pub late: u64,
    /// Ticks on a problem from before a cut.
    pub stale: u64,
    /// Ticks whose force or torque was cut down to what the device can give.
    pub clamped: u64,
    /// Times that the force faded because the simulation was late.
    pub fades: u64,
    /// Times that the force stopped because the device was lost.
    pub stops: u64,
    /// Largest force on the hand, N.
    pub force_max: f64,
    /// Largest change of the force from one tick to the next, N.
    pub jump_max: f64,
    /// The same where a problem of a new epoch came in.
    pub cut_jump: f64,
    /// Most energy given to the hand, J.
    pub energy_out: f64,
    /// The same along the same motions without the controller, J.
    pub energy_uncontrolled: f64,
    /// What the controller took out, J.
    pub energy_damped: f64,
}

/// What a servo says to the simulation.
#[derive(Clone, Copy, Debug)]
pub struct Felt {
    /// Where the hand holds the tool.
    pub hand: Hand,
    /// m/s
    pub velocity: DVec3,
    /// rad/s
    pub spin: DVec3,
    /// Bit k is set while button k is down.
    pub buttons: u32,
    /// The blade cuts.
    pub active: bool,
    /// What was counted so far.
    pub counts: Counts,
}

/// The servo's ends of both cells.
pub struct ServoEnd {
    /// From the simulation.
    pub problem: Output<Problem>,
    /// To it.
    pub felt: Input<Felt>,
}

/// The simulation's ends.
pub struct SimulationEnd {
    /// From the servo.
    pub felt: Output<Felt>,
    problem: Input<Problem>,
    number: u64,
}

/// Both cells between a simulation and a servo.
pub fn cells(first: &Problem, felt: &Felt) -> (ServoEnd, SimulationEnd) {
    let (to_servo, problem) = triple_buffer(first);
    let (to_simulation, felt) = triple_buffer(felt);
    (ServoEnd { problem, felt: to_simulation }, SimulationEnd { felt, problem: to_servo, number: first.number })
}

impl SimulationEnd {
    /// Hands a problem over: of the hand at `time`, s, with the newest epoch.
    pub fn hand_over(&mut self, reduced: &Reduced, time: f64, announced: u32) {
        self.number += 1;
        self.problem.input_buffer_mut().refill(reduced, time, self.number, announced);
        self.problem.publish();
    }
}
