//! The one error type, around those of scenes and devices: where, what was found, what was wanted, what to do.
//!
//! Every message is one paragraph. Input from users ends here; a broken invariant of this crate is an `assert!` instead.
//! Messages show numbers as the file has them, in the file's units.

#[cfg(feature = "haply")]
use crate::haptic::haply::Refused;
use crate::scene::Invalid;
use std::path::PathBuf;

/// What every fallible function of this crate returns.
pub type Result<T> = std::result::Result<T, Error>;

/// Everything that can go wrong through the input, the machine or the disk.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A scene, or a file that it names, that is not as it has to be.
    #[error(transparent)]
    Scene(Box<Invalid>),

    /// Haply's Inverse Service, or a device behind it.
    #[cfg(feature = "haply")]
    #[error(transparent)]
    Haply(Box<Refused>),

    /// A hyperelastic cell without volume, where the law has no energy.
    #[error(
        "cell {cell:?} of a hyperelastic body is inside out at a step's start; take a shorter step_ms, let contacts and held nodes move \
         less in one step, or take law = \"fem\""
    )]
    InsideOut {
        /// Cells along x, y, z.
        cell: [usize; 3],
    },

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

    /// A checkpoint that a run cannot go on from.
    #[error("{}: the checkpoint {what}; {fix}", path.display())]
    Checkpoint {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        what: String,
        /// What to do.
        fix: &'static str,
    },

    /// A table that a resumed run cannot go on with.
    #[error("{}: the table {what}; resume in the folder of the run that wrote the checkpoint", path.display())]
    TableUnfit {
        /// The table.
        path: PathBuf,
        /// What is wrong with it.
        what: &'static str,
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

    /// No adapter that the program can use.
    #[error("no usable GPU adapter: wanted {wanted}; found {found}; {how}")]
    NoAdapter {
        /// What was asked for.
        wanted: String,
        /// What the machine has.
        found: String,
        /// How to get one, or go without.
        how: String,
    },

    /// A thing larger than a limit of the device.
    #[error("{what}: {need} wanted, but {limit_name} is {limit}; {fix}")]
    TooLarge {
        /// What is too large.
        what: String,
        /// What it needs.
        need: u64,
        /// The limit's name.
        limit_name: &'static str,
        /// The limit.
        limit: u64,
        /// What to do.
        fix: String,
    },

    /// A kernel that does not compile.
    #[error(
        "kernel `{kernel}` does not compile: {message}; mend its WGSL, or report it with adapter and driver if the text is unchanged"
    )]
    Shader {
        /// The kernel.
        kernel: String,
        /// The compiler's words.
        message: String,
    },

    /// A buffer that does not fit its binding.
    #[error("kernel `{kernel}`: binding `{name}` {problem}; known bindings: {known}; bind each of them once, by name")]
    Binding {
        /// The kernel.
        kernel: &'static str,
        /// The binding.
        name: String,
        /// Known names, with commas.
        known: String,
        /// What is wrong with it.
        problem: String,
    },

    /// The device stopped working.
    #[error(
        "the GPU device failed: {message}; run again, with a smaller scene or on the CPU if it fails at the same place"
    )]
    Device {
        /// The driver's words.
        message: String,
    },

    /// The machine gives no more memory.
    #[error("no memory is left for {what}: {bytes} bytes were refused; {fix}")]
    Memory {
        /// What was to be stored.
        what: &'static str,
        /// How much of it was asked for at once.
        bytes: u64,
        /// What to do.
        fix: &'static str,
    },

    /// The machine starts no more threads, for which it lacks memory most of the time.
    #[error(
        "the threads cannot be started ({source}); close what takes memory or threads, or raise the limit that this program runs under \
         (ulimit -v, ulimit -u)"
    )]
    Threads {
        /// The system's reason.
        source: std::io::Error,
    },

    /// A result that cannot be written.
    #[error("{path}: cannot be written ({source}); choose a folder that exists, is writable and has space")]
    Write {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },

    /// A picture that cannot be drawn.
    #[error("study.svg cannot be drawn ({message}); study.csv has the same numbers")]
    Plot {
        /// The drawing library's words.
        message: String,
    },

    /// A VTK file that cannot be written.
    #[error("{path}: cannot be written as VTK ({message}); choose a folder that exists, is writable and has space")]
    Vtk {
        /// The file.
        path: PathBuf,
        /// The writer's words.
        message: String,
    },

    /// A system that has no one solution.
    #[error(
        "the step's matrix is not positive definite at node {node:?} of the grid (counted from 0 along x, y, z), axis {axis}: nothing holds a part of the body there that has no mass either, or positions are not finite; hold the body, give it mass, or take a shorter step"
    )]
    NotPositive {
        /// Node along x, y, z.
        node: [usize; 3],
        /// x, y or z.
        axis: char,
    },

    /// A command that makes no sense.
    #[error("{what}; {fix}")]
    Usage {
        /// What was asked.
        what: String,
        /// What to do.
        fix: String,
    },
}

impl Error {
    /// Exit status of the program: 2 for bad input, 3 for no usable adapter, 1 for failures of machine or disk.
    pub fn exit_code(&self) -> u8 {
        match self {
            Error::NoAdapter { .. } => 3,
            Error::Shader { .. }
            | Error::Binding { .. }
            | Error::Device { .. }
            | Error::Memory { .. }
            | Error::Threads { .. }
            | Error::NonFinite { .. }
            | Error::Write { .. }
            | Error::Plot { .. }
            | Error::Vtk { .. } => 1,
            #[cfg(feature = "haply")]
            Error::Haply(refused) => refused.exit_code(),
            _ => 2,
        }
    }
}

impl From<Invalid> for Error {
    fn from(invalid: Invalid) -> Self {
        Self::Scene(Box::new(invalid))
    }
}

#[cfg(feature = "haply")]
impl From<Refused> for Error {
    fn from(refused: Refused) -> Self {
        Self::Haply(Box::new(refused))
    }
}
