//! Product with the system matrix of a spring body: `w = A z`, gathered per node, for each right-hand side.
//!
//! `w_i = P_i (Σ_s T_s (z_i − z_j) + m_i (1 + h r_M)/h² z_i)` with the tangents of `springs`. Units: z m, w N.

use super::blocks::symmetric;
use super::{Params, Source};
use crate::math::{Real, V3, V4};

/// The shader.
pub const SOURCE: Source =
    Source { name: "springs_product", wgsl: include_str!("springs_product.wgsl"), params: Params::<f32>::FIELDS };

/// One right-hand side; returns `z·w`.
pub fn springs_product<R: Real>(
    params: &Params<R>,
    first: &[u32],     // [node + 1] into half
    half: &[[u32; 2]], // springs around each node: other node, spring
    tangent: &[V4<R>], // [half × 2] symmetric T, N/m
    dofs: &[V4<R>],    // [node] 1 free, 0 fixed, per axis; mass kg
    z: &[V4<R>],       // [node] m
    w: &mut [V4<R>],   // [node] N
) -> R {
    let mut dot = R::zero();
    for i in 0..params.node_count as usize {
        let own = V3::from4(z[i]);
        let mut sum = V3::zero();
        for n in first[i] as usize..first[i + 1] as usize {
            sum += symmetric(tangent[n * 2], tangent[n * 2 + 1]) * (own - V3::from4(z[half[n][0] as usize]));
        }
        let out = (sum + own * (params.inertia * dofs[i][3])).times(V3::from4(dofs[i]));
        w[i] = out.pad(R::zero());
        dot += own.dot(out);
    }
    dot
}
