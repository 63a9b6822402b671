//! Displacements at which an explicit step evaluates its elastic forces: `y_i = u_i + τ v_i`, `τ = params.lead_time`.
//!
//! With `τ = r_K` the force of a linear body at `y` is `K u + r_K K v`: elastic force and Rayleigh's stiffness damping in one evaluation.
//! Corotational hexahedra have `R K Rᵀ` for `K`, as in an implicit step, since their rotations are those at `u`.
//! Source: Rayleigh damping as in Belytschko, Liu, Moran 2000, section 6.2 (explicit methods use `C v` with the known velocity). An empty
//! `y` stays empty: bodies without such damping have none.
//! Units: u m, v m/s, y m, τ s.

use super::{Params, Source};
use crate::math::{Real, V3, V4};

/// The shader.
pub const SOURCE: Source = Source { name: "ahead", wgsl: include_str!("ahead.wgsl"), params: Params::<f32>::FIELDS };

/// Displacements at all nodes.
pub fn ahead<R: Real>(
    params: &Params<R>,
    u: &[V4<R>],     // [node] m
    v: &[V4<R>],     // [node] m/s
    y: &mut [V4<R>], // [node] m
) {
    for ((y, u), v) in y.iter_mut().zip(u).zip(v) {
        *y = (V3::from4(*u) + V3::from4(*v) * params.lead_time).pad(R::zero());
    }
}
