//! Preconditioner blocks of a body of tetrahedra: `D_i = s R_i B_i R_iᵀ + m_i (1 + h r_M)/h² I`, `B_i` the node's own block of the stiffness
//! matrix at rest and `R_i` the mean rotation around it; no coupling with other nodes.
//!
//! Packing, fixed axes and the choice of preconditioner as in `blocks`. Units: N/m.

use super::blocks::{Block, finish, symmetric};
use super::{Params, Source};
use crate::math::{M3, Real, V3, V4, rotation_matrix};

/// The shader.
pub const SOURCE: Source =
    Source { name: "tetrahedra_blocks", wgsl: include_str!("tetrahedra_blocks.wgsl"), params: Params::<f32>::FIELDS };

/// Computes the blocks of all nodes.
pub fn tetrahedra_blocks<R: Real>(
    params: &Params<R>,
    rest_block: &[V4<R>],    // [node × 2] symmetric B, N/m
    node_rotation: &[V4<R>], // [node] quaternion
    dofs: &[V4<R>],          // [node] 1 free, 0 fixed, per axis; mass kg
    block: &mut [V4<R>],     // [node × 4] packed
) {
    for i in 0..params.node_count as usize {
        let r = rotation_matrix(node_rotation[i]);
        let d = r * symmetric(rest_block[2 * i], rest_block[2 * i + 1]) * r.transpose();
        let own = Block { d, g: M3::zero() };
        block[i * 4..i * 4 + 4].copy_from_slice(&finish(params, own, dofs[i], V3::zero()));
    }
}
