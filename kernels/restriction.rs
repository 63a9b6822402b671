//! Restriction of a level's residual to the next coarser one: `r_c = F_c Pᵀ (r − w)`, `w = A z`.
//!
//! `P` interpolates bilinearly in x and y: node `2i` of the finer level is node `i` of the coarser one, odd nodes lie between two. The
//! duplicates of a node share its unknown on the coarser level: a cut changes nothing there. `F` is the DOF mask. Units: N.

use super::{Params, Source};
use crate::math::{Real, V4};
use rayon::prelude::*;

/// The shader.
pub const SOURCE: Source =
    Source { name: "restriction", wgsl: include_str!("restriction.wgsl"), params: Params::<f32>::FIELDS };

/// One right-hand side.
pub fn restriction<R: Real>(
    params: &Params<R>,     // of the finer level
    coarse_free: &[V4<R>],  // [coarse node] 1 free, 0 fixed, per axis
    split: &[u32],          // see `split`
    r: &[V4<R>],            // [node] N
    w: &[V4<R>],            // [node] N
    coarse_r: &mut [V4<R>], // [coarse node] N
) {
    let [coarse_x, coarse_y, _] = params.coarse_cells().map(|c| c + 1);
    let [nodes_x, nodes_y] = [params.nodes_x as usize, params.nodes_y as usize];
    let halves = [0.5, 1.0, 0.5].map(R::of); // share of the fine nodes before, at and behind a coarse one
    let has_duplicates = params.extra_columns > 0;
    let one_row = |(row, out): (usize, &mut [V4<R>])| {
        let (y, level) = (2 * (row % coarse_y), row / coarse_y);
        // fine nodes around each coarse one, row by row
        for (i, out) in out.iter_mut().enumerate() {
            let mut sum = [R::zero(); 4];
            for (y, of_row) in (y.saturating_sub(1)..nodes_y.min(y + 2)).map(|at| (at, halves[at + 1 - y])) {
                let first = nodes_x * (y + nodes_y * level);
                for x in (2 * i).saturating_sub(1)..nodes_x.min(2 * i + 2) {
                    let (node, weight) = (first + x, of_row * halves[x + 1 - 2 * i]);
                    add(&mut sum, &r[node], &w[node], weight);
                    if has_duplicates {
                        for e in params.extra_columns_beside(split, nodes_x * y + x) {
                            let copy = params.copy_id(e, level);
                            add(&mut sum, &r[copy], &w[copy], weight);
                        }
                    }
                }
            }
            let free = &coarse_free[row * coarse_x + i];
            *out = [sum[0] * free[0], sum[1] * free[1], sum[2] * free[2], R::zero()];
        }
    };
    let rows = coarse_r.par_chunks_exact_mut(coarse_x).enumerate();
    rows.with_min_len(super::PARALLEL.div_ceil(coarse_x)).for_each(one_row);
}

/// `sum += (r − w) weight`
#[inline(always)]
fn add<R: Real>(sum: &mut V4<R>, r: &V4<R>, w: &V4<R>, weight: R) {
    for n in 0..4 {
        sum[n] += (r[n] - w[n]) * weight;
    }
}
