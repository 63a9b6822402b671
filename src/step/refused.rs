//! Errors of making, changing, restoring and stepping a simulation.

use super::Warnings;

/// See the module.
#[derive(Clone, Debug, thiserror::Error)]
pub enum Refused {
    /// Explicit step above the stability limit.
    #[error(
        "{at}: {name} is stable under integrator = \"symplectic_euler\" up to a step of {stable_ms:.3e} ms, and its step (step_ms over \
         substeps) is {step_ms:.3e} ms; take at least substeps = {substeps} or a smaller step_ms, a smaller rayleigh_stiffness_s, coarser \
         cells, or integrator = \"implicit_euler\""
    )]
    UnstableStep {
        /// Where.
        at: String,
        /// Name of the body.
        name: String,
        /// Requested substep, ms.
        step_ms: f64,
        /// Largest stable substep, ms.
        stable_ms: f64,
        /// Number of substeps that is stable.
        substeps: u64,
    },

    /// Attachment across a gap.
    #[error(
        "{at}: the node at ({:.3}, {:.3}, {:.3}) mm is to be tied to a body that is {distance:.3} mm away from it; let the bodies touch \
         where they are tied, or choose another region",
        position[0],
        position[1],
        position[2]
    )]
    TiedToNothing {
        /// Where.
        at: String,
        /// Rest position of the node, mm.
        position: [f64; 3],
        /// Distance to the other body, mm.
        distance: f64,
    },

    /// State of another simulation.
    #[error(
        "the state has {found} {what} where the simulation has {wanted}; restore it in a simulation of the scene that it is of"
    )]
    StateUnfit {
        /// What was counted: "nodes", "deformable bodies" …
        what: &'static str,
        /// Count in the state.
        found: usize,
        /// Count in the simulation.
        wanted: usize,
    },

    /// Change of the step of a running simulation.
    #[error("the step length of a running simulation cannot change; make a new one with that step")]
    OtherStep,

    /// Static step without balance.
    #[error(
        "{at}: the static step to {time} s is not in balance after {iterations} iterations: {left:.1e} of the forces are left, and the \
         tolerance is {tolerance:.1e}; {fix}"
    )]
    NoBalance {
        /// Where.
        at: String,
        /// End of the step, s.
        time: f64,
        /// Linear solves.
        iterations: u32,
        /// Forces out of balance, or the change of the forces on tools in the last solve, relative to the largest.
        left: f64,
        /// Solver's tolerance.
        tolerance: f64,
        /// What may mend it.
        fix: &'static str,
    },

    /// Non-finite state that ends a run.
    #[error("{at}: {what} \"{name}\" is non-finite at {time} s, where the run ends; {fix}")]
    NonFinite {
        /// Where.
        at: String,
        /// "the tool", "the body", "the hand of the tool".
        what: &'static str,
        /// Its name.
        name: String,
        /// End of the step, s.
        time: f64,
        /// Advice.
        fix: &'static str,
    },
}

/// Warnings that keep a static step from ending: its contact is open.
pub(super) const OPEN: [&str; 2] = ["contact_not_converged", "contact_passes_exhausted"];

/// What may bring a static step with these warnings, in f32 (`single`) or f64, into balance.
pub(super) fn mends_balance(warnings: &Warnings, single: bool) -> &'static str {
    if warnings.contains_key("contacts_dropped") {
        "take a larger max_contacts of [contact], which has had contacts dropped"
    } else if OPEN.iter().any(|name| warnings.contains_key(name)) {
        "its contact is still open: raise max_passes of [contact], or hold what slides or turns away"
    } else if single {
        "take a larger tolerance, or f64 (`--backend cpu --precision f64`), since f32 may round to no less than that; \
         if it fails in f64 as well, take shorter steps, or hold what slides or turns away"
    } else {
        "take shorter steps, hold what slides or turns away, or a larger tolerance"
    }
}
