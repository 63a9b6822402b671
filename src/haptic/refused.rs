//! Why a device is not had, or not recorded as a whole.

/// See the module.
#[derive(Clone, Debug, thiserror::Error)]
pub enum Refused {
    /// A device whose driver was left out of the build.
    #[error(
        "the tool \"{tool}\" is held by a haply device, which this build does not have; build with the feature `haply`, or attach a device \
         of your own"
    )]
    NotBuilt {
        /// What it holds.
        tool: String,
    },

    /// A recording with gaps.
    #[error(
        "the recording of the {device} device waited too long to be written, and {ticks} ticks are not in it; use fewer pictures while \
         recording, or a disk that keeps up"
    )]
    TicksLost {
        /// Its name.
        device: String,
        /// That are not in it.
        ticks: usize,
    },
}
