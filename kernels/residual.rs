//! Residual at a trial point of Newton's method, and the nodal part of the potential (`backend::newton`).
//!
//! `−∇Π = P (b − w − (f(u + τ Δx) − f(u)))`, `w = (inertia M + (r_K/h) K₀) Δx` from `product`. The nodal part of the potential is
//! `½ Δx·w − Δx·(b + f(u))`; the cells' energy over `τ` is added to it. The work of the step's elastic forces and of what is left over is
//! `Δx·(f(u + τ Δx) − ∇Π)` ([`crate::backend`] compares it with the change of the energy).
//! Units: forces N, dx m, potential and work J.

use super::collected::collected;
use super::{Params, Source};
use crate::math::{Real, V3, V4};

/// The shader.
pub const SOURCE: Source =
    Source { name: "residual", wgsl: include_str!("residual.wgsl"), params: Params::<f32>::FIELDS };

/// All nodes; returns the nodal part of the potential, `|−∇Π|²`, and the work.
pub fn residual<R: Real>(
    params: &Params<R>,
    corner_force: &[R],           // [cell][corner][axis] at the trial point, N
    f: &[V4<R>],                  // [node] at the step's start, N
    b: &[V4<R>],                  // [node] N
    w: &[V4<R>],                  // [node] N
    dx: &[V4<R>],                 // [node] m
    dofs: &[V4<R>],               // [node] 1 free, 0 fixed, per axis; mass kg
    residual_force: &mut [V4<R>], // [node] N
) -> [R; 3] {
    let mut sum = [R::zero(); 3];
    for i in 0..residual_force.len() {
        let (before, right, linear) = (V3::from4(f[i]), V3::from4(b[i]), V3::from4(w[i]));
        let elastic = collected(params, &[], corner_force, i);
        let left = (right - linear - (elastic - before)).times(V3::from4(dofs[i]));
        residual_force[i] = left.pad(R::zero());
        let pull = linear * R::of(0.5) - (right + before);
        sum[0] += V3::from4(dx[i]).dot(pull);
        sum[1] += left.dot(left);
        sum[2] += V3::from4(dx[i]).dot(elastic + left);
    }
    sum
}
