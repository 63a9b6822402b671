//! Ends a slot whose residual is small enough before a costly preconditioner runs for nothing: `|r|² ≤ target²`.
//!
//! `advance` asks the same question an iteration later, which is early enough where the preconditioner is cheap.
//! Units: N².

use super::Source;
use super::advance::Scalars;
use crate::math::Real;

/// The shader.
pub const SOURCE: Source =
    Source { name: "converge", wgsl: include_str!("converge.wgsl"), params: super::Params::<f32>::FIELDS };

/// One slot after `update`.
pub fn converge<R: Real>(residual: R, k: &mut Scalars<R>) {
    if k.done != R::zero() {
        return;
    }
    k.residual_squared = residual;
    if residual <= k.target_squared {
        k.done = R::one();
    }
}
