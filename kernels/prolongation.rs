//! Prolongation of the correction from the next coarser level: `z += F P z_c`, the transpose of `restriction`.
//!
//! Units: m.

use super::{Params, Source};
use crate::math::{Real, V3, V4};
use rayon::prelude::*;

/// The shader.
pub const SOURCE: Source =
    Source { name: "prolongation", wgsl: include_str!("prolongation.wgsl"), params: Params::<f32>::FIELDS };

/// One right-hand side.
pub fn prolongation<R: Real>(
    params: &Params<R>, // of the finer level
    free: &[V4<R>],     // [node] 1 free, 0 fixed, per axis
    split: &[u32],      // see `split`
    coarse_z: &[V4<R>], // [coarse node] m
    z: &mut [V4<R>],    // [node] m
) {
    let [nodes_x, nodes_y, _] = params.coarse_cells().map(|c| c + 1);
    let quarter = R::of(0.25);
    let one_node = |i: usize, out: &mut V4<R>| {
        let Some([x, y, level]) = params.grid_coordinates(split, i) else {
            return;
        };
        let first = x / 2 + nodes_x * (y / 2 + nodes_y * level);
        // the same node twice where the fine node coincides with it
        let (step_x, step_y) = (x % 2, y % 2 * nodes_x);
        let sum = V3::from4(coarse_z[first])
            + V3::from4(coarse_z[first + step_x])
            + V3::from4(coarse_z[first + step_y])
            + V3::from4(coarse_z[first + step_x + step_y]);
        *out = (V3::from4(*out) + (sum * quarter).times(V3::from4(free[i]))).pad(R::zero());
    };
    z.par_iter_mut().enumerate().with_min_len(super::PARALLEL).for_each(|(i, out)| one_node(i, out));
}
