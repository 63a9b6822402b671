//! Applies the factored columns: `z = M⁻¹ r`, with the dot `r·z` that the conjugate gradients need.
//!
//! Up: `y_k = r_k − G_{k−1}ᵀ y_{k−1}`; down: `z_k = D'_k⁻¹ y_k − G_k z_{k+1}`.
//! Units: r N, z m.

use super::blocks::unpack;
use super::{Levels, PART, Params, Source, by_columns, parts_at_once};
use crate::math::{Real, V3, V4};
use rayon::prelude::*;

/// The shader.
pub const SOURCE: Source =
    Source { name: "precondition", wgsl: include_str!("precondition.wgsl"), params: Params::<f32>::FIELDS };

/// One right-hand side; returns `r·z`.
pub fn precondition<R: Real>(
    params: &Params<R>,
    block: &[V4<R>], // [node × 4] packed D'⁻¹, G
    r: &[V4<R>],     // [node] N
    z: &mut [V4<R>], // [node] m
) -> R {
    let of_set = |(first, set): (usize, Params<R>)| {
        let nodes = first..first + set.node_count as usize;
        precondition_set(&set, &block[nodes.start * 4..nodes.end * 4], &r[nodes.clone()], &mut z[nodes])
    };
    params.column_sets().map(of_set).sum()
}

fn precondition_set<R: Real>(params: &Params<R>, block: &[V4<R>], r: &[V4<R>], z: &mut [V4<R>]) -> R {
    let columns = params.columns();
    let one_part = |(part, mut z): (usize, Levels<V4<R>>)| -> R {
        let mut gamma = R::zero();
        let mut y = [V3::zero(); PART]; // G_{k−1}ᵀ y_{k−1}
        for k in 0..z.len() {
            let first = part * PART + k * columns;
            for (c, slot) in z[k].iter_mut().enumerate() {
                let i = first + c;
                let own = V3::from4(r[i]) - y[c];
                *slot = own.pad(R::zero());
                y[c] = unpack(&block[i * 4..i * 4 + 4]).g.transpose() * own;
            }
        }
        let mut above = [V3::zero(); PART];
        for k in (0..z.len()).rev() {
            let first = part * PART + k * columns;
            for (c, slot) in z[k].iter_mut().enumerate() {
                let i = first + c;
                let own = unpack(&block[i * 4..i * 4 + 4]);
                above[c] = own.d * V3::from4(*slot) - own.g * above[c];
                *slot = above[c].pad(R::zero());
                gamma += V3::from4(r[i]).dot(above[c]);
            }
        }
        gamma
    };
    let sums: Vec<R> =
        by_columns(z, columns).into_par_iter().enumerate().with_min_len(parts_at_once(params)).map(one_part).collect();
    sums.into_iter().sum()
}
