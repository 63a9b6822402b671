//! What a step costs: its work, counted, and its time by part.

use serde::{Deserialize, Serialize};
use std::time::Instant;

/// Part of a step. On a GPU, waiting for the device belongs to the part that waits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Contacts are found; positions near tools are read back.
    Search,
    /// Forces, linearisation and solve of the unconstrained motion.
    Free,
    /// Compliance columns.
    Columns,
    /// Corrections by contact forces.
    Corrections,
    /// Contact laws on `W λ + δ`.
    Laws,
    /// Reduced contact problems are made for the haptic loop.
    HandOver,
    /// Edges are swept, links and springs cut.
    Cut,
    /// The remainder: loads, acceptance of the step, probes, checks in f64.
    Other,
}

/// Number of parts.
const PARTS: usize = Part::Other as usize + 1;

/// Work and time of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Costs {
    /// Iterations of all solves: of the unconstrained motion, of each correction, of each batch of columns. Each is one V-cycle with the
    /// multigrid preconditioner.
    pub iterations: u32,
    /// Row updates of the contact laws' solves.
    pub row_updates: u64,
    /// Links and springs tested against the swept edges.
    pub cut_tests: u64,
    /// `[part]` s
    pub seconds: [f64; PARTS],
}

impl Costs {
    /// Adds the time since `start` to a part.
    pub(super) fn spend(&mut self, part: Part, start: Instant) {
        self.seconds[part as usize] += start.elapsed().as_secs_f64();
    }

    /// Time of a part, s.
    pub fn of(&self, part: Part) -> f64 {
        self.seconds[part as usize]
    }

    /// Gives the time of a step since `start` that no part has to the remainder.
    pub(super) fn close(&mut self, start: Instant) {
        self.seconds[Part::Other as usize] =
            (start.elapsed().as_secs_f64() - self.seconds.iter().sum::<f64>()).max(0.0);
    }

    /// Sum of two substeps.
    pub(super) fn and(self, other: Self) -> Self {
        Self {
            iterations: self.iterations + other.iterations,
            row_updates: self.row_updates + other.row_updates,
            cut_tests: self.cut_tests + other.cut_tests,
            seconds: std::array::from_fn(|k| self.seconds[k] + other.seconds[k]),
        }
    }
}
