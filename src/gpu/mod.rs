//! GPU access without physics: adapters, buffers, kernels bound by the shader's own names, batches of dispatches, read-back.
//!
//! naga parses a [`Source`](crate::kernels::Source) on the host; [`Gpu::bind`] checks buffers against the `var` names, groups and sizes
//! found there. A [`Batch`] records dispatches and is submitted once. Nothing here knows what a kernel computes.

mod device;
mod failed;
mod shader;

pub use device::{Adapter, Batch, Bound, Buffer, Gpu, Handle, Made, Taken, Work, adapters, cast};
pub use failed::Failed;
pub use shader::{Access, Shader, Variable};
