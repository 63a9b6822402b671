//! The scalars of the conjugate gradients, kept on the device: reduces the partial sums and sets the next `α`, `β`, or ends the slot.
//!
//! `γ = r·z`, `δ = z·A z`; first `β = 0`, `α = γ/δ`; then `β = γ/γ_old`, `α = γ/(δ − β γ/α_old)`. A slot is done when
//! `|r|² ≤ target²`; its `target² = max(tolerance² reference², floor²)`, where the reference of the free motion is the step's load.
//! `done`: 0 running, 1 converged or idle, 2 broken down (no positive curvature, or not finite).
//! `state`: 0 before the start, 1 the start's residual is being formed, 2 first iteration, 3 later.

use super::Source;
use crate::math::Real;

/// The shader.
pub const SOURCE: Source =
    Source { name: "advance", wgsl: include_str!("advance.wgsl"), params: super::Params::<f32>::FIELDS };

/// Scalars of one slot, in the order of the device's two vec4.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Scalars<R> {
    /// Step along the direction.
    pub alpha: R,
    /// Share of the old direction.
    pub beta: R,
    /// `r·z`.
    pub gamma: R,
    /// 0 running, 1 converged or idle, 2 broken down.
    pub done: R,
    /// N²
    pub target_squared: R,
    /// `r·r`, N².
    pub residual_squared: R,
    /// Iterations done.
    pub iterations: R,
    /// 0 to 3, see above.
    pub state: R,
}

/// What the host asks of a slot: one vec4 on the device.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Request<R> {
    /// Relative tolerance, squared.
    pub tolerance_squared: R,
    /// Reference, N², used unless `use_load` is 1.
    pub reference_squared: R,
    /// Absolute floor, N².
    pub floor_squared: R,
    /// 1: the reference is the step's load.
    pub use_load: R,
}

/// One slot after a product, with reduced sums.
pub fn advance<R: Real>(request: &Request<R>, load: R, delta: R, gamma: R, residual: R, k: &mut Scalars<R>) {
    let zero = R::zero();
    if k.done != zero {
        return;
    }
    if k.state == zero {
        let reference = if request.use_load == R::one() { load } else { request.reference_squared };
        k.target_squared = (request.tolerance_squared * reference).max(request.floor_squared);
        k.state = R::one();
        return;
    }
    k.residual_squared = residual;
    if residual <= k.target_squared {
        k.done = R::one();
        return;
    }
    let mut denominator = delta;
    k.beta = zero;
    if k.state >= R::of(2.0) {
        k.beta = gamma / k.gamma;
        denominator = delta - k.beta * gamma / k.alpha;
    }
    // written so that NaN fails it
    if !(denominator > zero && gamma > zero) {
        k.done = R::of(2.0);
        return;
    }
    k.alpha = gamma / denominator;
    k.gamma = gamma;
    k.iterations += R::one();
    // the update of state 2 is the first with a direction; from then on the direction is kept
    k.state = if k.state == R::one() { R::of(2.0) } else { R::of(3.0) };
}
