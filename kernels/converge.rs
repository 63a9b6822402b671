//! Ends a right-hand side whose residual is small enough, before a costly preconditioner runs in vain: `|r|² ≤ target²`.
//!
//! `advance` makes the same test one iteration later, which suffices for cheap preconditioners.
//! Units: N².

use super::Source;
use super::advance::Scalars;
use crate::math::Real;

/// The shader.
pub const SOURCE: Source =
    Source { name: "converge", wgsl: include_str!("converge.wgsl"), params: super::Params::<f32>::FIELDS };

/// One right-hand side after `update`.
pub fn converge<R: Real>(residual: R, k: &mut Scalars<R>) {
    if k.done != R::zero() {
        return;
    }
    k.residual_squared = residual;
    if residual <= k.target_squared {
        k.done = R::one();
    }
}
