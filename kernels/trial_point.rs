//! Trial point along Newton's direction `x`: `Δx' = Δx + t x`, `t = params.gain`; displacement `u + τ Δx'` at which the step takes its elastic
//! forces, `τ = params.stiffness_factor` of this kernel's own block; and the predicted decrease `−∇Π·x`.
//! Units: u dx x m, residual (`residual_force`) −∇Π N, predicted decrease (`predicted_decrease`) J.

use super::{Params, Source};
use crate::math::{Real, V3, V4};

/// The shader.
pub const SOURCE: Source =
    Source { name: "trial_point", wgsl: include_str!("trial_point.wgsl"), params: Params::<f32>::FIELDS };

/// All nodes; returns the predicted decrease for a full step.
pub fn trial_point<R: Real>(
    params: &Params<R>,
    u: &[V4<R>],                // [node] m
    dx: &[V4<R>],               // [node] m
    x: &[V4<R>],                // [node] direction, m
    residual_force: &[V4<R>],   // [node] N
    dx_next: &mut [V4<R>],      // [node] m
    displacement: &mut [V4<R>], // [node] displacement, m
) -> R {
    let mut predicted_decrease = R::zero();
    for i in 0..u.len() {
        let moved = V3::from4(dx[i]) + V3::from4(x[i]) * params.gain;
        dx_next[i] = moved.pad(R::zero());
        displacement[i] = (V3::from4(u[i]) + moved * params.stiffness_factor).pad(R::zero());
        predicted_decrease += V3::from4(residual_force[i]).dot(V3::from4(x[i]));
    }
    predicted_decrease
}
