//! Prolongation of the correction from the next coarser level: `z += F P z_c`, the transpose of `restriction`.
//!
//! Units: m.

use super::{Params, Source};
use crate::math::{Real, V4};
use rayon::prelude::*;

/// The shader.
pub const SOURCE: Source =
    Source { name: "prolongation", wgsl: include_str!("prolongation.wgsl"), params: Params::<f32>::FIELDS };

/// One right-hand side.
pub fn prolongation<R: Real>(
    params: &Params<R>, // of the finer level
    dofs: &[V4<R>],     // [node] 1 free, 0 fixed, per axis; mass kg
    split: &[u32],      // see `split`
    coarse_z: &[V4<R>], // [coarse node] m
    z: &mut [V4<R>],    // [node] m
) {
    let [coarse_x, coarse_y, _] = params.coarse_cells().map(|c| c + 1);
    let [nodes_x, nodes_y] = [params.nodes_x as usize, params.nodes_y as usize];
    let quarter = R::of(0.25);
    let add = |out: &mut V4<R>, dofs: &V4<R>, [a, b, c, d]: [&V4<R>; 4]| {
        let sum: V4<R> = std::array::from_fn(|n| out[n] + (a[n] + b[n] + c[n] + d[n]) * quarter * dofs[n]);
        *out = [sum[0], sum[1], sum[2], R::zero()];
    };
    // the same coarse node twice where the fine node coincides with it
    let (of_grid, duplicates) = z.split_at_mut(params.grid_nodes());
    let one_row = |(row, out): (usize, &mut [V4<R>])| {
        let (y, level) = (row % nodes_y, row / nodes_y);
        let first = coarse_x * (y / 2 + coarse_y * level);
        let (low, high) = (&coarse_z[first..], &coarse_z[first + y % 2 * coarse_x..]);
        let dofs = &dofs[row * nodes_x..][..nodes_x];
        for (x, (out, dofs)) in out.iter_mut().zip(dofs).enumerate() {
            let (left, right) = (x / 2, x / 2 + x % 2);
            add(out, dofs, [&low[left], &low[right], &high[left], &high[right]]);
        }
    };
    let rows = of_grid.par_chunks_exact_mut(nodes_x).enumerate();
    rows.with_min_len(super::PARALLEL.div_ceil(nodes_x)).for_each(one_row);
    for (i, out) in (params.grid_nodes()..).zip(duplicates) {
        let Some([x, y, level]) = params.grid_coordinates(split, i) else { continue };
        let first = x / 2 + coarse_x * (y / 2 + coarse_y * level);
        let (step_x, step_y) = (x % 2, y % 2 * coarse_x);
        add(out, &dofs[i], [0, step_x, step_y, step_x + step_y].map(|step| &coarse_z[first + step]));
    }
}
