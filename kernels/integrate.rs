//! Ends a step: `Δx = x_0 + x_1` (unconstrained motion and contact correction), `u += Δx`, `v' = v + ρ (Δx/h − v)`.
//!
//! `ρ = params.velocity_factor`: 1 where `v' = Δx/h`, the one velocity of the step; 2 for the trapezoidal and the midpoint rule, where `Δx/h`
//! is the mean of `v` and `v'`. `params.rhs_count` 1: no contact; right-hand side 1 is not read. Otherwise `x_0` becomes `Δx`, with which the
//! next step's solve starts.
//! Units: x m, u m, v m/s.

use super::{Params, Source};
use crate::math::{Real, V3, V4};

/// The shader.
pub const SOURCE: Source =
    Source { name: "integrate", wgsl: include_str!("integrate.wgsl"), params: Params::<f32>::FIELDS };

/// Updates every node.
pub fn integrate<R: Real>(
    params: &Params<R>,
    x: &mut [V4<R>], // [rhs][node] m
    u: &mut [V4<R>], // [node] m
    v: &mut [V4<R>], // [node] m/s
) {
    let count = params.node_count as usize;
    for i in 0..count {
        let mut dx = V3::from4(x[i]);
        if params.rhs_count > 1 {
            dx += V3::from4(x[count + i]);
            x[i] = dx.pad(R::zero());
        }
        u[i] = (V3::from4(u[i]) + dx).pad(R::zero());
        let kept = V3::from4(v[i]) * (params.velocity_factor - R::one());
        v[i] = (dx * (params.velocity_factor / params.step) - kept).pad(R::zero());
    }
}
