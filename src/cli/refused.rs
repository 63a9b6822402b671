//! Errors of commands: conflicting arguments, or errors of the library.

use cutis::error::Error;
use std::io;
use std::path::PathBuf;

/// Result of the commands.
pub type Result<T> = std::result::Result<T, Refused>;

/// See the module.
#[derive(Debug, thiserror::Error)]
pub enum Refused {
    /// Error of the library.
    #[error(transparent)]
    Library(#[from] Error),

    /// Command line that cannot be read.
    #[error("{}", error.to_string().trim_start_matches("error: ").trim_end())]
    Usage {
        /// Error of the parser.
        error: clap::Error,
    },

    /// Word that is neither a command nor a file.
    #[error(
        "there is no command and no scene file `{word}`; {}`cutis --help` lists the commands",
        nearest.as_ref().map(|nearest| format!("did you mean `cutis {nearest}`? ")).unwrap_or_default()
    )]
    NoCommand {
        /// The word.
        word: String,
        /// The nearest command, if one is near.
        nearest: Option<String>,
    },

    /// Options of a command in front of it.
    #[error("options stand before the command `{command}`; write them behind it: cutis {command} …")]
    OptionBeforeCommand {
        /// The command.
        command: String,
    },

    /// Time of more steps than are counted.
    #[error("--seconds {seconds} is {steps:.3e} steps of this scene; at most {} are counted; ask for less", u32::MAX)]
    Seconds {
        /// s
        seconds: f64,
        /// Number of steps.
        steps: f64,
    },

    /// Standard output that takes no more.
    #[error("standard output cannot be written ({source}); make space where it goes, or send it elsewhere")]
    Print {
        /// Reason given by the system.
        source: io::Error,
    },

    /// Signals that cannot be caught.
    #[error("signals cannot be caught ({source}); run it outside the sandbox that forbids it")]
    Signals {
        /// Reason given by the system.
        source: io::Error,
    },

    /// Run that a signal ended.
    #[error("interrupted")]
    Interrupted {
        /// Exit status.
        code: u8,
    },

    /// Program without the window.
    #[cfg(not(feature = "view"))]
    #[error(
        "this program was built without its window; build it with `cargo build --release --features view`, or use `cutis serve` and a browser"
    )]
    NoWindow,

    /// A GPU and the CPU path requested together.
    #[error("--adapter names a GPU, but the CPU path is asked for; leave out --adapter, or use --backend gpu")]
    AdapterForCpu,

    /// The direct solver requested on a GPU.
    #[error(
        "the direct solver runs on the CPU path, but a GPU is asked for; use --backend cpu, or --preconditioner multigrid"
    )]
    DirectOnGpu,

    /// Double precision requested on a GPU.
    #[error("--precision f64 is the CPU path's; the GPU computes in f32; leave out --precision, or use --backend cpu")]
    DoubleOnGpu,

    /// No key, table or meaning contains the word.
    #[error("no key of a scene has to do with \"{word}\"; list all by `cutis keys`")]
    NoKey {
        /// The word given.
        word: String,
    },

    /// Tool that the scene does not have.
    #[error("{}: no tool of this scene is called \"{name}\"; its tools are {known}", scene.display())]
    NoTool {
        /// File of the scene.
        scene: PathBuf,
        /// The name given.
        name: String,
        /// Names of the tools held by a hand, separated by commas.
        known: String,
    },

    /// Scene without a tool held by a hand.
    #[error(
        "{}: no tool of this scene is held by a hand; name a scene with a [[tool]], for instance scenes/incision.toml, or leave out --scene \
         for a hand at rest",
        scene.display()
    )]
    NoHand {
        /// File of the scene.
        scene: PathBuf,
    },
}

impl Refused {
    /// Exit status of the program: 2 for arguments, 1 for the machine, that of the signal, else as [`Error::exit_code`].
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Library(error) => error.exit_code(),
            Self::Interrupted { code } => *code,
            Self::Print { .. } | Self::Signals { .. } => 1,
            _ => 2,
        }
    }
}
