//! Restriction of a level's residual to the next coarser one: `r_c = F_c Pᵀ (r − w)`, `w = A z`.
//!
//! `P` interpolates bilinearly in x and y: node `2i` of the finer level is node `i` of the coarser one, odd nodes lie between two. The
//! duplicates of a node share its unknown on the coarser level: a cut changes nothing there. `F` is the DOF mask. Units: N.

use super::{Params, Source};
use crate::math::{Real, V3, V4};
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
    let [nodes_x, nodes_y, _] = params.coarse_cells().map(|c| c + 1);
    let one_node = |i: usize, out: &mut V4<R>| {
        let at = [2 * (i % nodes_x), 2 * (i / nodes_x % nodes_y), i / (nodes_x * nodes_y)];
        let mut sum = V3::zero();
        for dy in 0..3 {
            for dx in 0..3 {
                let (x, y) = (at[0] + dx, at[1] + dy);
                if x < 1 || y < 1 || x > params.nodes_x as usize || y > params.nodes_y as usize {
                    continue;
                }
                let weight = R::of([0.5, 1.0, 0.5][dx] * [0.5, 1.0, 0.5][dy]);
                let node = params.node_id([x - 1, y - 1, at[2]]);
                sum += (V3::from4(r[node]) - V3::from4(w[node])) * weight;
                for e in params.extra_columns_beside(split, node % params.columns()) {
                    let copy = params.copy_id(e, at[2]);
                    sum += (V3::from4(r[copy]) - V3::from4(w[copy])) * weight;
                }
            }
        }
        *out = sum.times(V3::from4(coarse_free[i])).pad(R::zero());
    };
    coarse_r.par_iter_mut().enumerate().with_min_len(super::PARALLEL).for_each(|(i, out)| one_node(i, out));
}
