//! Increments of nodes on prescribed paths: `x_i = u*_i − u_i` along fixed axes, `u*` the prescribed displacement at the end of the step.
//!
//! `x` (right-hand side 0) is the initial guess of the unconstrained motion. The rows of `A` along fixed axes are empty and so are the residuals there,
//! so conjugate gradients leave these entries as they are and solve `A_ff Δx_f = b_f − A_fc Δx_c` for the free ones: damping and inertia see
//! the motion of fixed nodes as that of free ones. Free axes keep their initial guess: 0, so that the initial residual is the step's load. With the increment from the displacement itself,
//! rounding does not accumulate along a path.
//! Source: Hughes 1987, section 1.10 (inhomogeneous essential boundary conditions).
//! Units: m.

use super::Source;
use crate::math::{Real, V4};

/// The shader.
pub const SOURCE: Source =
    Source { name: "prescribe", wgsl: include_str!("prescribe.wgsl"), params: &["count", "pad_0", "pad_1", "pad_2"] };

/// Sets the increments of fixed axes.
pub fn prescribe<R: Real>(
    ids: &[u32],      // [entry] node, each once
    values: &[V4<R>], // [entry] prescribed displacement at the end of the step, m
    dofs: &[V4<R>],   // [node] 1 free, 0 fixed, per axis; mass kg
    u: &[V4<R>],      // [node] m
    x: &mut [V4<R>],  // [rhs][node] m
) {
    for (id, target) in ids.iter().zip(values) {
        let i = *id as usize;
        for n in 0..3 {
            if dofs[i][n] == R::zero() {
                x[i][n] = target[n] - u[i][n];
            }
        }
    }
}
