//! Preconditioner blocks of a spring body: `D_i = Σ_s T_s + m_i (1 + h r_M)/h² I`, `U_i = −T` of the spring to the node above.
//!
//! Packing, fixed axes and the choice of preconditioner as in `blocks`. Units: N/m.

use super::blocks::{Block, finish, symmetric};
use super::{Params, Source};
use crate::math::{M3, Real, V3, V4};

/// The shader.
pub const SOURCE: Source =
    Source { name: "springs_blocks", wgsl: include_str!("springs_blocks.wgsl"), params: Params::<f32>::FIELDS };

/// Computes the blocks of all nodes.
pub fn springs_blocks<R: Real>(
    params: &Params<R>,
    first: &[u32],       // [node + 1] into half
    half: &[[u32; 2]],   // springs around each node: other node, spring
    tangent: &[V4<R>],   // [half × 2] symmetric T, N/m
    dofs: &[V4<R>],      // [node] 1 free, 0 fixed, per axis; mass kg
    block: &mut [V4<R>], // [node × 4] packed
) {
    // tangents include the step's stiffness factor
    let scaled = Params { stiffness_factor: R::one(), ..*params };
    for i in 0..params.node_count as usize {
        let above = i + (params.nodes_x * params.nodes_y) as usize;
        let mut sum = Block { d: M3::zero(), g: M3::zero() };
        for n in first[i] as usize..first[i + 1] as usize {
            let t = symmetric(tangent[n * 2], tangent[n * 2 + 1]);
            sum.d = sum.d + t;
            if half[n][0] as usize == above {
                sum.g = sum.g - t;
            }
        }
        let axes_above = if above < params.node_count as usize { V3::from4(dofs[above]) } else { V3::zero() };
        block[i * 4..i * 4 + 4].copy_from_slice(&finish(&scaled, sum, dofs[i], axes_above));
    }
}
