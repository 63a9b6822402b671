//! Exchange between the simulation and a servo: the newest problem in one direction, the newest hand pose in the other.
//!
//! Each passes through a triple buffer, so neither side waits for the other and every read is consistent. Problems are written into
//! existing buffers, so a hand-over allocates nothing once all three have the size of the largest problem.

use super::{Hand, Reduced};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use triple_buffer::{Input, Output, triple_buffer};

/// Contact problem for a servo.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Problem {
    /// Reduced contact problem.
    pub reduced: Reduced,
    /// Time of the hand pose that the problem is based on, on the servo's clock, s.
    pub time: f64,
    /// Number of the hand-over, starting at 0.
    pub number: u64,
    /// Newest epoch announced by the simulation; a problem of an older one precedes a cut.
    pub announced: u32,
}

impl Problem {
    /// Overwrites the problem in its own memory.
    pub fn refill(&mut self, reduced: &Reduced, time: f64, number: u64, announced: u32) {
        self.reduced.refill(reduced);
        (self.time, self.number, self.announced) = (time, number, announced);
    }
}

/// Counters of a servo.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Counts {
    /// Ticks.
    pub ticks: u64,
    /// Largest number of sweeps in a tick.
    pub sweeps_max: u32,
    /// Ticks whose time budget for sweeps was used up.
    pub out_of_time: u64,
    /// Invalid readings.
    pub unsound: u64,
    /// Ticks at which the device was lost: no reading, an old one, or one that is no pose.
    pub lost: u64,
    /// Ticks with a non-finite force; none is applied then.
    pub non_finite: u64,
    /// Ticks with a problem older than two steps, its age when every step takes its time.
    pub old: u64,
    /// Ticks with a problem so old that the force fades.
    pub late: u64,
    /// Ticks with a problem from before a cut.
    pub stale: u64,
    /// Ticks whose force or torque was limited to what the device can exert.
    pub clamped: u64,
    /// Times the force faded because the simulation was late.
    pub fades: u64,
    /// Times the force stopped because the device was lost.
    pub stops: u64,
    /// Largest force on the hand, N.
    pub force_max: f64,
    /// Largest change of the force from one tick to the next, N.
    pub jump_max: f64,
    /// The same at the arrival of a problem of a new epoch.
    pub cut_jump: f64,
    /// Maximum energy given to the hand, J.
    pub energy_out: f64,
    /// The same for the same motion without the passivity controller, J.
    pub energy_uncontrolled: f64,
    /// Energy removed by the controller, J.
    pub energy_damped: f64,
}

/// Message of a servo to the simulation.
#[derive(Clone, Copy, Debug)]
pub struct Felt {
    /// Pose of the tool in the hand.
    pub hand: Hand,
    /// m/s
    pub velocity: DVec3,
    /// rad/s
    pub angular_velocity: DVec3,
    /// Bit k is set while button k is pressed.
    pub buttons: u32,
    /// True while the blade cuts.
    pub active: bool,
    /// Counters so far.
    pub counts: Counts,
}

/// The servo's ends of both buffers.
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

/// Both buffers between a simulation and a servo.
pub fn cells(first: &Problem, felt: &Felt) -> (ServoEnd, SimulationEnd) {
    let (to_servo, problem) = triple_buffer(first);
    let (to_simulation, felt) = triple_buffer(felt);
    (ServoEnd { problem, felt: to_simulation }, SimulationEnd { felt, problem: to_servo, number: first.number })
}

impl SimulationEnd {
    /// Hands a problem over: `time` of its hand pose, s, and the newest epoch.
    pub fn publish(&mut self, reduced: &Reduced, time: f64, announced: u32) {
        self.number += 1;
        self.problem.input_buffer_mut().refill(reduced, time, self.number, announced);
        self.problem.publish();
    }
}
