//! Elastic forces of nodes from those of cells on their corners: `f_i = Σ f_(c,a)` over the cells `c` whose corner `a` the node is.
//!
//! One node after the other and each sum in one order, so that a run repeats. Bodies that are cut have other kernels: no node is split.
//! Units: N.

use super::{PARALLEL, Params, Source};
use crate::math::{Real, V3, V4};
use rayon::prelude::*;

/// The shader.
pub const SOURCE: Source =
    Source { name: "collect", wgsl: include_str!("collect.wgsl"), params: Params::<f32>::FIELDS };

/// Text of the sum at one node, shared by the shaders that read cells' forces.
pub const WGSL: &str = include_str!("collected.wgsl");

/// Sum of the cells' forces at one node.
pub fn collected<R: Real>(params: &Params<R>, corner_force: &[R], node: usize) -> V3<R> {
    let c = params.node_at(node);
    let mut sum = V3::zero();
    for a in 0..8 {
        if let Some(cell) = params.cell_below(c, a) {
            let k = cell * 24 + a * 3;
            sum += V3::new(corner_force[k], corner_force[k + 1], corner_force[k + 2]);
        }
    }
    sum
}

/// Forces of all nodes.
pub fn collect<R: Real>(
    params: &Params<R>,
    corner_force: &[R], // [cell][corner][axis] N
    f: &mut [V4<R>],    // [node] N
) {
    f.par_iter_mut()
        .enumerate()
        .with_min_len(PARALLEL)
        .for_each(|(node, f)| *f = collected(params, corner_force, node).pad(R::zero()));
}
