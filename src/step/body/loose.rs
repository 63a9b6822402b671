//! Initial guesses at pieces that cuts have set free ([`crate::bodies::Wound`]).
//!
//! The tolerance of a solve is relative to the load of the whole body. The weight of a small piece may be less than the residual
//! that this allows: with the last step's increment as its initial guess it would never begin to fall. The guess therefore grows by what the forces on the piece,
//! its weight, loads and contact, add to the translation of a rigid body in a step: `h² F/m`, for all implicit integrators. A piece that
//! falls freely then takes no iterations. Turning, deformation and mass damping of a piece are left to the solve, to its tolerance.
//!
//! 15 of 1152 tetrahedra cut off a block that is held and rests (tests/engine/loose.rs), share of the free fall after 0.14 s and iterations
//! per step; before (not measured at 1e-1), and with these guesses:
//!
//! | tolerance | node blocks | multigrid |
//! | --- | --- | --- |
//! | 1e-1 | 1.00 with 0.2 | 1.00 with 0.3 |
//! | 1e-2 | 0.42 with 29; 1.00 with 1.9 | 0.41 with 20; 1.00 with 1.1 |
//! | 1e-3 | 0.99 with 145; 1.00 with 15 | 1.00 with 75; 1.00 with 2.6 |
//!
//! A body on prescribed paths begins its solves at rest, and so do its loose pieces.

use super::Body;
use crate::backend::{CORRECTION, FREE};
use crate::error::Result;
use crate::scene::Integrator;
use glam::DVec3;

impl Body {
    /// Sets the loads of a step, `[node]` N.
    pub(in crate::step) fn set_load(&mut self, load: &[[f64; 3]]) {
        self.backend.set_load(load);
        let on = |nodes: &[u32]| nodes.iter().map(|node| DVec3::from_array(load[*node as usize])).sum();
        self.loose_loads = self.wound.loose.iter().map(|piece| on(&piece.nodes)).collect();
    }

    /// Resets the initial guess of the correction.
    pub(in crate::step) fn reset_correction(&mut self) -> Result<()> {
        self.pushed.clear();
        self.backend.reset_initial_guess(&[CORRECTION])
    }

    /// Has the unconstrained motion of loose pieces begin with the translation by their weight, loads and these forces at nodes, N.
    pub(in crate::step) fn guess_fall(&mut self, forces: &[(u32, [f64; 3])]) -> Result<()> {
        let gravity = DVec3::from_array(self.model.step.gravity);
        let sums = self.forces_on_loose(forces).into_iter().zip(&self.loose_loads).map(|(pushed, load)| pushed + *load);
        self.advance_guess(FREE, gravity, sums.collect())
    }

    /// The same of the correction under changes of the contact forces since it was reset.
    pub(in crate::step) fn guess_correction(&mut self, forces: &[(u32, [f64; 3])]) -> Result<()> {
        let now = self.forces_on_loose(forces);
        let mut before = std::mem::replace(&mut self.pushed, now.clone());
        before.resize(now.len(), DVec3::ZERO);
        self.advance_guess(
            CORRECTION,
            DVec3::ZERO,
            now.iter().zip(&before).map(|(now, before)| *now - *before).collect(),
        )
    }

    /// Sum of forces at nodes on each loose piece, N.
    fn forces_on_loose(&self, forces: &[(u32, [f64; 3])]) -> Vec<DVec3> {
        let on = |nodes: &[u32]| {
            let own = forces.iter().filter(|(node, _)| nodes.binary_search(node).is_ok());
            own.map(|(_, force)| DVec3::from_array(*force)).sum()
        };
        self.wound.loose.iter().map(|piece| on(&piece.nodes)).collect()
    }

    /// Adds the translations of the loose pieces by gravity, m/s², and these forces on them, N, to an initial guess.
    fn advance_guess(&mut self, rhs: usize, gravity: DVec3, forces: Vec<DVec3>) -> Result<()> {
        let step = &self.model.step;
        if self.wound.loose.is_empty() || step.explicit() || step.integrator == Integrator::Static {
            return Ok(());
        }
        let mut entries = vec![];
        for (piece, force) in self.wound.loose.iter().zip(forces) {
            let mass: f64 = piece.nodes.iter().map(|node| self.wound.dofs[*node as usize][3]).sum();
            let by = ((gravity + force / mass) * step.step * step.step).to_array();
            entries.extend(piece.nodes.iter().map(|node| (*node, by)));
        }
        self.backend.advance_guess(rhs, &entries)
    }
}
