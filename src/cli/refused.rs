//! Why a command is not done: arguments that do not go together, or what the library says.

use cutis::error::Error;
use std::path::PathBuf;

/// What the commands return.
pub type Result<T> = std::result::Result<T, Refused>;

/// See the module.
#[derive(Debug, thiserror::Error)]
pub enum Refused {
    /// By the library.
    #[error(transparent)]
    Library(#[from] Error),

    /// A GPU and the CPU path at once.
    #[error("--adapter names a GPU, but the CPU path is asked for; leave out --adapter, or use --backend gpu")]
    AdapterForCpu,

    /// A solver that no GPU has.
    #[error(
        "the direct solver runs on the CPU path, but a GPU is asked for; use --backend cpu, or --preconditioner multigrid"
    )]
    DirectOnGpu,

    /// A precision that no GPU has.
    #[error("--precision f64 is the CPU path's; the GPU computes in f32; leave out --precision, or use --backend cpu")]
    DoubleOnGpu,

    /// A word that no key of a scene has to do with.
    #[error("no key of a scene has to do with \"{word}\"; list all by `cutis keys`")]
    NoKey {
        /// As it was given.
        word: String,
    },

    /// A tool that the scene does not have.
    #[error("{}: no tool of this scene is called \"{name}\"; its tools are {known}", scene.display())]
    NoTool {
        /// Its file.
        scene: PathBuf,
        /// As it was given.
        name: String,
        /// Names of those that a hand holds, with commas.
        known: String,
    },

    /// A scene without a hand.
    #[error(
        "{}: no tool of this scene is held by a hand; name a scene with a [[tool]], for instance scenes/incision.toml, or leave out --scene \
         for a hand at rest",
        scene.display()
    )]
    NoHand {
        /// Its file.
        scene: PathBuf,
    },
}

impl Refused {
    /// Exit status of the program: 2 for arguments, else as [`Error::exit_code`] says.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Library(error) => error.exit_code(),
            _ => 2,
        }
    }
}
