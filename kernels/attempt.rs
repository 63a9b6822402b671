//! Trial point along Newton's direction `x`: `Δx' = Δx + t x`, `t = params.gain`, displacement `u + Δx'`; and the predicted decrease
//! `−∇Π·x`.
//! Units: u dx x m, residual (`rest`) −∇Π N, predicted decrease (`promise`) J.

use super::{Params, Source};
use crate::math::{Real, V3, V4};

/// The shader.
pub const SOURCE: Source =
    Source { name: "attempt", wgsl: include_str!("attempt.wgsl"), params: Params::<f32>::FIELDS };

/// All nodes; returns the predicted decrease for a full step.
pub fn attempt<R: Real>(
    params: &Params<R>,
    u: &[V4<R>],                // [node] m
    dx: &[V4<R>],               // [node] m
    x: &[V4<R>],                // [node] direction, m
    rest: &[V4<R>],             // [node] N
    dx_next: &mut [V4<R>],      // [node] m
    displacement: &mut [V4<R>], // [node] displacement, m
) -> R {
    let mut promise = R::zero();
    for i in 0..u.len() {
        let moved = V3::from4(dx[i]) + V3::from4(x[i]) * params.gain;
        dx_next[i] = moved.pad(R::zero());
        displacement[i] = (V3::from4(u[i]) + moved).pad(R::zero());
        promise += V3::from4(rest[i]).dot(V3::from4(x[i]));
    }
    promise
}
