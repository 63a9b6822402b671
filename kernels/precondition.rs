//! Applies the factored columns ([`super::columns`]): `z = M⁻¹ r`; returns the dot product `r·z` for the conjugate gradients.
//!
//! Units: r N, z m.

use super::columns::solve_columns;
use super::{Levels, Params, Source, by_columns, parts_at_once};
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
        let take = |_: [usize; 2], z: &mut V4<R>, solution: V3<R>| {
            *z = solution.pad(R::zero());
            solution
        };
        solve_columns(columns, part, block, r, &mut z, |r, _| r, take)
    };
    let sums: Vec<R> =
        by_columns(z, columns).into_par_iter().enumerate().with_min_len(parts_at_once(params)).map(one_part).collect();
    sums.into_iter().sum()
}
