//! What can go wrong with a GPU, its kernels and its arrays.

/// See the module.
#[derive(Clone, Debug, thiserror::Error)]
pub enum Failed {
    /// No adapter that the program can use.
    #[error(
        "no usable GPU adapter: wanted {wanted}; found {found}; on Debian or Ubuntu a software adapter comes with `apt-get install \
         mesa-vulkan-drivers libvulkan1`; `--backend cpu` needs no adapter"
    )]
    NoAdapter {
        /// What was asked for.
        wanted: String,
        /// What the machine has.
        found: String,
    },

    /// An array larger than a limit of the device.
    #[error(
        "bytes of array `{array}`: {bytes} wanted, but {limit_name} is {limit}; use fewer cells or contacts, the CPU path, or an adapter \
         with a larger limit (`cutis adapters` lists them)"
    )]
    TooLarge {
        /// As the kernels call it.
        array: String,
        /// What it needs.
        bytes: u64,
        /// The limit's name.
        limit_name: &'static str,
        /// The limit.
        limit: u64,
    },

    /// A kernel that does not compile.
    #[error(
        "kernel `{kernel}` does not compile: {message}; mend its WGSL, or report it with adapter and driver if the text is unchanged"
    )]
    Shader {
        /// The kernel.
        kernel: &'static str,
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
}
