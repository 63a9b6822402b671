//! What the states of the deformable bodies amount to, together.

use super::Body;
use crate::backend::Snapshot;
use crate::bodies::{Model, Solved, energy, inverted_cells};
use crate::step::Simulation;

/// Sums over the bodies.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measured {
    /// Kinetic, elastic and potential, J ([`crate::bodies::energy`]).
    pub energy: f64,
    /// Cells that are inside out.
    pub inverted: u32,
}

impl Measured {
    /// Of one body.
    pub(super) fn of(model: &Model, state: &Solved) -> Self {
        Self { energy: energy(model, state), inverted: inverted_cells(model, state) }
    }

    /// Both together.
    pub(super) fn and(self, other: Self) -> Self {
        Self { energy: self.energy + other.energy, inverted: self.inverted + other.inverted }
    }
}

impl Simulation {
    /// What the deformable bodies amount to now, from their states.
    pub fn measure(&self, states: &[Snapshot]) -> Measured {
        let of = |(body, state): (&Body, &Snapshot)| {
            Measured::of(&body.model, &body.solved(state.clone(), &[], &self.scene, self.time))
        };
        self.bodies.iter().zip(states).map(of).fold(Measured::default(), Measured::and)
    }
}
