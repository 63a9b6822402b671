//! Why a run does not do what is asked of it.

use std::io;

/// See the module.
#[derive(Debug, thiserror::Error)]
pub enum Refused {
    /// A device that goes by the wall clock, in a run by the scene's.
    #[error(
        "the tool \"{tool}\" is held by a haply device, which goes by the wall clock; run it with --realtime, or write kind = \"hand\" in \
         its [tool.device]"
    )]
    NeedsWallClock {
        /// What it holds.
        tool: String,
    },

    /// A device for a run under way.
    #[error("a device is attached to a run that has begun; attach it before the first step")]
    AttachedLate,

    /// A device for a tool that no hand holds.
    #[error("a device is attached to a tool that the scene does not have; count the [[tool]]s from 0")]
    AttachedToNothing,

    /// A second start.
    #[error("a run is started that has begun; make a new one")]
    StartedTwice,

    /// A step after the end.
    #[error(
        "a step is asked of a run that was stopped, whose devices are gone; make a new one; its state may be this one's"
    )]
    Stopped,

    /// A state of what cannot be gone back to.
    #[error(
        "the state of a run by the wall clock, or of one that records its devices; run by the scene's clock without recording"
    )]
    NoState,

    /// Parallel work that has taken all cores.
    #[error("no core can be left to the haptic threads ({source}); ask for it before anything is computed")]
    CoresTaken {
        /// The thread pool's reason.
        source: rayon::ThreadPoolBuildError,
    },

    /// The machine starts no more threads, for which it lacks memory most of the time.
    #[error(
        "the threads cannot be started ({source}); close what takes memory or threads, or raise the limit that this program runs under \
         (ulimit -v, ulimit -u)"
    )]
    Threads {
        /// The system's reason.
        source: io::Error,
    },

    /// The machine starts no thread for a device.
    #[error(
        "the haptic thread cannot be started ({source}); let the system have more threads, or run without --realtime"
    )]
    HapticThread {
        /// The system's reason.
        source: io::Error,
    },

    /// A mistake of this program, or of a device attached to it.
    #[error("a haptic thread has panicked; report what it said above, with the scene")]
    Panicked,
}
