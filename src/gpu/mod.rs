//! The GPU without physics: adapters, buffers, kernels bound by the shader's own names, batches of dispatches, read-back.
//!
//! A [`Source`](crate::kernels::Source) is read by naga on the host: its `var` names, groups and sizes are the truth that [`Gpu::bind`]
//! checks buffers against. A [`Batch`] records dispatches and is submitted once. Nothing here knows what a kernel computes.

mod device;
mod failed;
mod shader;

pub use device::{Adapter, Batch, Bound, Buffer, Gpu, Handle, Made, Taken, Work, adapters, cast};
pub use failed::Failed;
pub use shader::{Access, Shader, Variable};
