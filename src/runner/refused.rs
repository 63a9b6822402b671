//! Errors of a run.

use std::io;

/// See the module.
#[derive(Debug, thiserror::Error)]
pub enum Refused {
    /// Device that needs the wall clock, in a run by the scene's clock.
    #[error(
        "{at}: the tool \"{tool}\" is held by a haply device, which goes by the wall clock; run it with --realtime, or write kind = \"hand\" \
         in its [tool.device]"
    )]
    NeedsWallClock {
        /// Where.
        at: String,
        /// Name of the tool.
        tool: String,
    },

    /// Device attached after the first step.
    #[error("a device is attached to a run that has begun; attach it before the first step")]
    AttachedLate,

    /// Device attached to a tool without a hand.
    #[error("a device is attached to a tool that the scene does not have; count the [[tool]]s from 0")]
    AttachedToNothing,

    /// Run started twice.
    #[error("a run is started that has begun; make a new one")]
    StartedTwice,

    /// Step after the run was stopped.
    #[error(
        "a step is asked of a run that was stopped, whose devices are gone; make a new one; its state may be this one's"
    )]
    Stopped,

    /// State of a run that cannot be restored.
    #[error(
        "the state of a run by the wall clock, or of one that records its devices; run by the scene's clock without recording"
    )]
    NoState,

    /// The global thread pool exists already.
    #[error("no core can be left to the haptic threads ({source}); ask for it before anything is computed")]
    CoresTaken {
        /// Reason given by the thread pool.
        source: rayon::ThreadPoolBuildError,
    },

    /// More threads than make sense.
    #[error(
        "RAYON_NUM_THREADS={asked} asks for more threads than {most}; ask for as many as there are cores, or unset it"
    )]
    TooManyThreads {
        /// The text of the variable.
        asked: String,
        /// Maximum.
        most: usize,
    },

    /// The system starts no more threads, mostly for lack of memory.
    #[error(
        "the threads cannot be started ({source}); close what takes memory or threads, or raise the limit that this program runs under \
         (ulimit -v, ulimit -u)"
    )]
    Threads {
        /// Reason given by the system.
        source: io::Error,
    },

    /// The system starts no thread for a device.
    #[error(
        "the haptic thread cannot be started ({source}); let the system have more threads, or run without --realtime"
    )]
    HapticThread {
        /// Reason given by the system.
        source: io::Error,
    },

    /// A haptic thread panicked: an error of this program or of an attached device.
    #[error("a haptic thread has panicked; report what it said above, with the scene")]
    Panicked,
}
