//! Solve of an explicit step: `A = M/h²` is diagonal, so `x_i = P_i b_i / (m_i/h²)`, `P_i` the DOF mask.
//!
//! `params.inertia` is `1/h²`. A node without mass does not move.
//! Units: b N, mass kg, x m.

use super::{Params, Source};
use crate::math::{Real, V3, V4};

/// The shader.
pub const SOURCE: Source =
    Source { name: "accelerate", wgsl: include_str!("accelerate.wgsl"), params: Params::<f32>::FIELDS };

/// Displacement increments of all nodes (right-hand side 0).
pub fn accelerate<R: Real>(
    params: &Params<R>,
    dofs: &[V4<R>],  // [node] 1 free, 0 fixed, per axis; mass kg
    b: &[V4<R>],     // [rhs][node] N
    x: &mut [V4<R>], // [rhs][node] m
) {
    for i in 0..params.node_count as usize {
        let inertia = dofs[i][3] * params.inertia;
        let inverse = if inertia > R::zero() { R::one() / inertia } else { R::zero() };
        x[i] = (V3::from4(b[i]) * inverse).times(V3::from4(dofs[i])).pad(R::zero());
    }
}
