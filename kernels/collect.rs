//! Elastic forces at the nodes, assembled from the corner forces of the cells (`collected`).
//! Units: N.

use super::collected::collected;
use super::{PARALLEL, Params, Source};
use crate::math::{Real, V4};
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
    f.par_iter_mut()
        .enumerate()
        .with_min_len(PARALLEL / 8)
        .for_each(|(node, f)| *f = collected(params, split, corner_force, node).pad(R::zero()));
}
