//! Errors of a GPU, its kernels and its arrays.

/// See the module.
#[derive(Clone, Debug, thiserror::Error)]
pub enum Failed {
    /// No usable adapter.
    #[error(
        "no usable GPU adapter: wanted {wanted}; found {found}; on Debian or Ubuntu a software adapter comes with `apt-get install \
         mesa-vulkan-drivers libvulkan1`; `--backend cpu` needs no adapter"
    )]
    NoAdapter {
        /// What was requested.
        wanted: String,
        /// Adapters of the machine.
        found: String,
    },

    /// Array larger than a limit of the device.
    #[error(
        "array `{array}` has {bytes} bytes; {limit_name} is {limit}; use fewer cells or contacts, the CPU path, or an adapter \
         with a larger limit (`cutis adapters` lists them)"
    )]
    TooLarge {
        /// Name in the kernels.
        array: String,
        /// Requested size, bytes.
        bytes: u64,
        /// Name of the limit.
        limit_name: &'static str,
        /// The limit.
        limit: u64,
    },

    /// Kernel that does not compile.
    #[error(
        "kernel `{kernel}` does not compile: {message}; mend its WGSL, or report it with adapter and driver if the text is unchanged"
    )]
    Shader {
        /// The kernel.
        kernel: &'static str,
        /// Message of the compiler.
        message: String,
    },

    /// Buffer that does not fit its binding.
    #[error("kernel `{kernel}`: binding `{name}` {problem}; known bindings: {known}; bind each of them once, by name")]
    Binding {
        /// The kernel.
        kernel: &'static str,
        /// The binding.
        name: String,
        /// Known bindings, separated by commas.
        known: String,
        /// What is wrong with it.
        problem: String,
    },

    /// Failure of the device.
    #[error(
        "the GPU device failed: {message}; run again, with a smaller scene or on the CPU if it fails again at the same step"
    )]
    Device {
        /// Message of the driver.
        message: String,
    },
}
