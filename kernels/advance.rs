//! Scalars of the conjugate gradients, kept on the device: reduces the partial sums, then sets the next `α` and `β` or ends the solve.
//!
//! `γ = r·z`, `δ = z·A z`; first `β = 0`, `α = γ/δ`; then `β = γ/γ_old`, `α = γ/(δ − β γ/α_old)`. A right-hand side is done when
//! `|r|² ≤ target²`, with `target² = max(tolerance² reference², floor²)`; for the unconstrained motion the reference is the step's load, with
//! prescribed paths at least the initial residual, which has what the paths drive.
//! Source: Chronopoulos, Gear 1989 (one reduction per iteration).
//! `done`: 0 running, 1 converged or idle, 2 breakdown (no positive curvature, or non-finite). `state`: 0 before the start, 1 computing the
//! initial residual, 2 first iteration, 3 later.

use super::Source;
use crate::math::Real;

/// The shader.
pub const SOURCE: Source =
    Source { name: "advance", wgsl: include_str!("advance.wgsl"), params: super::Params::<f32>::FIELDS };

/// Scalars of one right-hand side, in the order of the device's two vec4.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Scalars<R> {
    /// Step length along the direction.
    pub alpha: R,
    /// Factor of the previous direction.
    pub beta: R,
    /// `r·z`.
    pub gamma: R,
    /// 0 running, 1 converged or idle, 2 breakdown.
    pub done: R,
    /// Squared target, N²
    pub target_squared: R,
    /// `r·r`, N².
    pub residual_squared: R,
    /// Number of iterations.
    pub iterations: R,
    /// 0 to 3, see the module.
    pub state: R,
}

/// Stopping criterion of one right-hand side: one vec4 on the device.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Request<R> {
    /// Relative tolerance, squared.
    pub tolerance_squared: R,
    /// Reference, N², used if `use_load` is 0.
    pub reference_squared: R,
    /// Absolute floor, N².
    pub floor_squared: R,
    /// 1: the reference is the step's load; 2: at least the initial residual.
    pub use_load: R,
}

/// Scalars of one right-hand side after a product, with reduced sums.
pub fn advance<R: Real>(request: &Request<R>, load: R, delta: R, gamma: R, residual: R, k: &mut Scalars<R>) {
    let zero = R::zero();
    if k.done != zero {
        return;
    }
    if k.state == zero {
        let reference = if request.use_load >= R::one() { load } else { request.reference_squared };
        k.target_squared = (request.tolerance_squared * reference).max(request.floor_squared);
        k.state = R::one();
        return;
    }
    k.residual_squared = residual;
    if k.state == R::one() && request.use_load == R::of(2.0) {
        k.target_squared = k.target_squared.max(request.tolerance_squared * residual);
    }
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
    // written so that NaN fails the test
    if !(denominator > zero && gamma > zero) {
        k.done = R::of(2.0);
        return;
    }
    k.alpha = gamma / denominator;
    k.gamma = gamma;
    k.iterations += R::one();
    // the update in state 2 is the first with a direction; later ones combine it with the previous direction
    k.state = if k.state == R::one() { R::of(2.0) } else { R::of(3.0) };
}
