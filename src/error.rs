//! The error type of the crate, by module.
//!
//! Each message is one paragraph: where, what was found, what was wanted, what to do. It stands in the module that raises it, in that
//! module's enum. Errors are for input, machine and disk; a broken invariant of this crate is an `assert!`.

use crate::bodies;
use crate::formats;
use crate::gpu;
use crate::haptic;
#[cfg(feature = "haply")]
use crate::haptic::haply;
#[cfg(feature = "program")]
use crate::output;
#[cfg(feature = "program")]
use crate::report;
use crate::runner;
use crate::scene::{Invalid, Scene};
#[cfg(feature = "serve")]
use crate::serve;
use crate::step;
#[cfg(feature = "program")]
use crate::view;
#[cfg(feature = "view")]
use crate::window;
use std::sync::atomic::{AtomicBool, Ordering};

/// Result of every fallible function of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// Any failure by input, machine or disk.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
pub enum Error {
    /// Invalid scene, or a file that it names.
    Scene(Box<Invalid>),
    /// Mesh file that cannot be read or written.
    Mesh(#[from] formats::Refused),
    /// Body that cannot be computed as its scene asks.
    Body(#[from] bodies::Refused),
    /// The same of a body, with the scene that it is of.
    #[error("{at}: {error}")]
    OfScene {
        /// File, and line if it is known.
        at: String,
        /// The error.
        error: Box<Error>,
    },
    /// Adapter, kernel, array or device.
    Gpu(#[from] gpu::Failed),
    /// Simulation that cannot be made, changed, restored or continued.
    Step(#[from] step::Refused),
    /// Haptic device or its recording.
    Haptic(#[from] haptic::Refused),
    /// Haply's Inverse Service, or a device of it.
    #[cfg(feature = "haply")]
    Haply(Box<haply::Refused>),
    /// Run that was asked to end, between two steps or within one.
    #[error("interrupted")]
    Interrupted,
    /// Run that cannot proceed as asked.
    Run(#[from] runner::Refused),
    /// Picture for which memory is short.
    #[cfg(feature = "program")]
    Picture(#[from] view::NoMemory),
    /// Result file that cannot be written or continued.
    #[cfg(feature = "program")]
    Output(#[from] output::Failed),
    /// Server that cannot listen.
    #[cfg(feature = "serve")]
    Serve(#[from] serve::Refused),
    /// Window that cannot be opened.
    #[cfg(feature = "view")]
    Window(#[from] window::Refused),
    /// Run with files, comparison or study that cannot proceed as asked.
    #[cfg(feature = "program")]
    Report(#[from] report::Refused),
}

impl Error {
    /// The error with the place of its scene, if it does not say that itself: the line of the key that is to change.
    #[must_use]
    pub fn of_scene(self, scene: &Scene) -> Self {
        match &self {
            Self::Body(refused) => Self::OfScene { at: scene.at(refused.key()), error: Box::new(self) },
            _ => self,
        }
    }

    /// Exit status of the program: 2 for bad input, 3 without a usable adapter, 1 for failures of machine or disk.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::OfScene { error, .. } => error.exit_code(),
            Self::Gpu(gpu::Failed::NoAdapter { .. }) => 3,
            Self::Gpu(gpu::Failed::TooLarge { .. }) => 2,
            Self::Gpu(_) => 1,
            Self::Step(step::Refused::NonFinite { .. } | step::Refused::NoBalance { .. })
            | Self::Run(runner::Refused::Threads { .. })
            | Self::Interrupted => 1,
            #[cfg(feature = "haply")]
            Self::Haply(refused) => match **refused {
                haply::Refused::Nobody { .. } | haply::Refused::NoService { .. } | haply::Refused::Port { .. } => 1,
                _ => 2,
            },
            #[cfg(feature = "serve")]
            Self::Serve(_) => 1,
            #[cfg(feature = "view")]
            Self::Window(_) => 1,
            #[cfg(feature = "program")]
            Self::Picture(_)
            | Self::Report(
                report::Refused::Plot { .. }
                | report::Refused::Locked { .. }
                | report::Refused::Foreign { .. }
                | report::Refused::Memory { .. }
                | report::Refused::CaseMemory { .. },
            ) => 1,
            #[cfg(feature = "program")]
            Self::Output(output::Failed::TableUnfit { .. }) => 2,
            #[cfg(feature = "program")]
            Self::Output(_) => 1,
            _ => 2,
        }
    }
}

/// [`Error::Interrupted`] once the flag is set.
pub(crate) fn unless(interrupt: &AtomicBool) -> Result<()> {
    match interrupt.load(Ordering::Acquire) {
        true => Err(Error::Interrupted),
        false => Ok(()),
    }
}

#[cfg(feature = "haply")]
impl From<haply::Refused> for Error {
    fn from(refused: haply::Refused) -> Self {
        Self::Haply(Box::new(refused))
    }
}

impl From<Invalid> for Error {
    fn from(invalid: Invalid) -> Self {
        Self::Scene(Box::new(invalid))
    }
}
