//! What goes between the simulation and a servo: the newest problem one way, the newest hand the other.
//!
//! Each goes through a triple buffer, so neither side waits for the other and what is read is always whole. The writer of problems refills
//! buffers that have grown before, so handing over allocates nothing once all three are as large as the largest problem.

use super::servo::Counts;
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
