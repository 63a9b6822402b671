//! Elastic forces at the nodes, assembled from the corner forces of the cells: `f_i = Σ f_(c,a)` over the cells `c` whose corner `a` is the node.
//! Units: N.

use super::split::Around;
use super::{PARALLEL, Params, Source};
use crate::math::{Real, V3, V4};
use rayon::prelude::*;

/// The shader.
pub const SOURCE: Source =
    Source { name: "collect", wgsl: include_str!("collect.wgsl"), params: Params::<f32>::FIELDS };

/// Forces of all nodes.
pub fn collect<R: Real>(
    params: &Params<R>,
    split: &[u32],      // see `split`
    corner_force: &[R], // [cell][corner][axis] N
    f: &mut [V4<R>],    // [node] N
) {
    let one = |node: usize| {
        let mut sum = V3::zero();
        for Around { corner, cell, .. } in params.cells_around(split, node) {
            let k = cell * 24 + corner * 3;
            sum += V3::new(corner_force[k], corner_force[k + 1], corner_force[k + 2]);
        }
        sum.pad(R::zero())
    };
    f.par_iter_mut().enumerate().with_min_len(PARALLEL / 8).for_each(|(node, f)| *f = one(node));
}
