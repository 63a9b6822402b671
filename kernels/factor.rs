//! Factors each z-column's block-tridiagonal matrix in place: block LDLᵀ, no pivoting (the blocks are positive definite).
//!
//! From the bottom up: `D'_k = D_k − U_{k−1}ᵀ D'_{k−1}⁻¹ U_{k−1}`, stored as `D'_k⁻¹` and `G_k = D'_k⁻¹ U_k`.
//! With `U = 0` this is the inverse of the node blocks, so one kernel serves every preconditioner.
//! Source: Golub, Van Loan 2013, section 4.5 (block tridiagonal systems).

use super::blocks::{Block, pack, unpack};
use super::{Levels, PART, Params, Source, by_columns, parts_at_once};
use crate::math::{M3, Real, V4};
use rayon::prelude::*;

/// The shader.
pub const SOURCE: Source = Source { name: "factor", wgsl: include_str!("factor.wgsl"), params: Params::<f32>::FIELDS };

/// Factors every column.
pub fn factor<R: Real>(
    params: &Params<R>,
    block: &mut [V4<R>], // [node × 4] packed: D, U in; D'⁻¹, G out
) {
    for (first, set) in params.column_sets() {
        factor_set(&set, &mut block[first * 4..(first + set.node_count as usize) * 4]);
    }
}

fn factor_set<R: Real>(params: &Params<R>, block: &mut [V4<R>]) {
    let columns = params.columns();
    let one_part = |mut block: Levels<[V4<R>; 4]>| {
        let mut below = [M3::zero(); PART]; // Uᵀ D'⁻¹ U of the node below
        for level in &mut block {
            for (c, packed) in level.iter_mut().enumerate() {
                let own = unpack(packed.as_slice());
                let d = (own.d - below[c]).inverse();
                let g = d * own.g;
                below[c] = own.g.transpose() * g;
                *packed = pack(Block { d, g });
            }
        }
    };
    by_columns(block.as_chunks_mut::<4>().0, columns)
        .into_par_iter()
        .with_min_len((parts_at_once(params) / 4).max(1))
        .for_each(one_part);
}
