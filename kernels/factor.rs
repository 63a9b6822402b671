//! Factors each z-column's block-tridiagonal matrix in place: block LDLᵀ, no pivoting (the blocks are positive definite).
//!
//! From the bottom up: `D'_k = D_k − U_{k−1}ᵀ D'_{k−1}⁻¹ U_{k−1}`, stored as `D'_k⁻¹` and `G_k = D'_k⁻¹ U_k`.
//! With `U = 0` this is the inverse of the node blocks, so one kernel serves every preconditioner.
//! Source: Golub, Van Loan 2013, section 4.5 (block tridiagonal systems).

use super::blocks::{Block, pack, unpack};
use super::{Params, Source};
use crate::math::{M3, Real, V4};

/// The shader.
pub const SOURCE: Source = Source { name: "factor", wgsl: include_str!("factor.wgsl"), params: Params::<f32>::FIELDS };

/// Factors every column.
pub fn factor<R: Real>(
    params: &Params<R>,
    block: &mut [V4<R>], // [node × 4] packed: D, U in; D'⁻¹, G out
) {
    let columns = (params.nodes_x * params.nodes_y) as usize;
    for column in 0..columns {
        let mut below = M3::zero(); // Uᵀ D'⁻¹ U of the node below
        for k in 0..params.nodes_z as usize {
            let at = (column + k * columns) * 4;
            let own = unpack(&block[at..at + 4]);
            let d = (own.d - below).inverse();
            let g = d * own.g;
            below = own.g.transpose() * g;
            block[at..at + 4].copy_from_slice(&pack(Block { d, g }));
        }
    }
}
