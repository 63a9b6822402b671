//! Compensated sums over a workgroup: what the kernels of the conjugate gradients' scalars share (`advance`, `converge`).
//!
//! Each thread carries the sum of its numbers and what rounding has taken from it (two-sum); pairs of threads are added in halves. Where the
//! device loses what compensates ([`super::probe`]) they are plain sums. The twins add in f64 or in the order of the array.
//! Source: Knuth 1969, section 4.2.2 (two-sum); Ogita, Rump, Oishi 2005 (compensated summation).

/// Text of the shaders.
pub const WGSL: &str = include_str!("compensated.wgsl");
