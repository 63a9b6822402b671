//! The one error type: what can go wrong, by the module that finds it.
//!
//! Every message is one paragraph that says where, what was found, what was wanted and what to do; it stands beside its maker, in the enum
//! of that module. Input from users ends here; a broken invariant of this crate is an `assert!` instead.

use crate::bodies;
use crate::gpu;
use crate::haptic;
#[cfg(feature = "haply")]
use crate::haptic::haply;
#[cfg(feature = "program")]
use crate::output;
#[cfg(feature = "program")]
use crate::report;
use crate::runner;
use crate::scene::Invalid;
use crate::step;
#[cfg(feature = "program")]
use crate::view;

/// What every fallible function of this crate returns.
pub type Result<T> = std::result::Result<T, Error>;

/// Everything that can go wrong through the input, the machine or the disk.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
pub enum Error {
    /// A scene, or a file that it names, that is not as it has to be.
    Scene(Box<Invalid>),
    /// A body that cannot be computed as its scene asks.
    Body(#[from] bodies::Refused),
    /// An adapter, a kernel, an array or the device itself.
    Gpu(#[from] gpu::Failed),
    /// A simulation that cannot be made, changed or gone on with.
    Step(#[from] step::Refused),
    /// A haptic device, or its recording.
    Haptic(#[from] haptic::Refused),
    /// Haply's Inverse Service, or a device behind it.
    #[cfg(feature = "haply")]
    Haply(#[from] haply::Refused),
    /// A run that does not do what is asked of it.
    Run(#[from] runner::Refused),
    /// A picture that there is no memory for.
    #[cfg(feature = "program")]
    Picture(#[from] view::NoMemory),
    /// A file of results that cannot be written or gone on with.
    #[cfg(feature = "program")]
    Output(#[from] output::Failed),
    /// A run with its files, a comparison or a study that is not done as asked.
    #[cfg(feature = "program")]
    Report(#[from] report::Refused),
}

impl Error {
    /// Exit status of the program: 2 for bad input, 3 for no usable adapter, 1 for failures of machine or disk.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Gpu(gpu::Failed::NoAdapter { .. }) => 3,
            Self::Gpu(gpu::Failed::TooLarge { .. }) => 2,
            Self::Gpu(_) => 1,
            Self::Step(step::Refused::NonFinite { .. }) | Self::Run(runner::Refused::Threads { .. }) => 1,
            #[cfg(feature = "haply")]
            Self::Haply(
                haply::Refused::Nobody { .. } | haply::Refused::NoService { .. } | haply::Refused::Port { .. },
            ) => 1,
            #[cfg(feature = "program")]
            Self::Picture(_) | Self::Report(report::Refused::Plot { .. }) => 1,
            #[cfg(feature = "program")]
            Self::Output(output::Failed::Write { .. } | output::Failed::Vtk { .. }) => 1,
            _ => 2,
        }
    }
}

impl From<Invalid> for Error {
    fn from(invalid: Invalid) -> Self {
        Self::Scene(Box::new(invalid))
    }
}
