//! Compensated sums over a workgroup, shared by the kernels of the conjugate gradients' scalars (`advance`, `converge`).
//!
//! Each thread carries its sum and the accumulated rounding error (two-sum); threads are added pairwise, halving their number. On devices
//! whose arithmetic defeats the compensation ([`super::probe`]) the sums are plain. The twins add in f64 or in array order.
//! Source: Knuth 1969, section 4.2.2 (two-sum); Ogita, Rump, Oishi 2005 (compensated summation).

/// Text of the shaders.
pub const WGSL: &str = include_str!("compensated.wgsl");
