//! Why a simulation cannot be made, changed, taken to another state or gone on with.

use std::path::PathBuf;

/// See the module.
#[derive(Clone, Debug, thiserror::Error)]
pub enum Refused {
    /// A step at which an explicit run would blow up.
    #[error(
        "{}: {name} is stable under integrator = \"symplectic_euler\" up to a step of {stable_ms:.3e} ms, and its step (step_ms over \
         substeps) is {step_ms:.3e} ms; take at least substeps = {substeps} or a smaller step_ms, a smaller rayleigh_stiffness_s, coarser \
         cells, or integrator = \"implicit_euler\"",
        path.display()
    )]
    UnstableStep {
        /// The scene file.
        path: PathBuf,
        /// The body.
        name: String,
        /// ms
        step_ms: f64,
        /// ms
        stable_ms: f64,
        /// Parts of a whole step that are stable.
        substeps: u64,
    },

    /// An attachment across a gap.
    #[error(
        "the node at ({:.3}, {:.3}, {:.3}) mm is to be tied to a body that is {distance:.3} mm away from it; let the bodies touch where \
         they are tied, or choose another region",
        at[0],
        at[1],
        at[2]
    )]
    TiedToNothing {
        /// mm
        at: [f64; 3],
        /// mm
        distance: f64,
    },

    /// A state of another simulation.
    #[error(
        "the state has {found} {what} where the simulation has {wanted}; restore it in a simulation of the scene that it is of"
    )]
    StateUnfit {
        /// "nodes", "deformable bodies" …
        what: &'static str,
        /// In the state.
        found: usize,
        /// In the simulation.
        wanted: usize,
    },

    /// A change of the step while a simulation runs.
    #[error("a running simulation is given a step of another length; make a new one with that step")]
    OtherStep,

    /// A state that is no number, at the end of a run that came so far.
    #[error("{}: {what} \"{name}\" is non-finite at {time} s, where the run ends; {fix}", path.display())]
    NonFinite {
        /// The scene file.
        path: PathBuf,
        /// "the tool", "the body", "the hand of the tool".
        what: &'static str,
        /// Its name.
        name: String,
        /// End of the step, s.
        time: f64,
        /// What to do.
        fix: &'static str,
    },
}
