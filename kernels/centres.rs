//! Displacements of the cell centres, which are the ends of the face links: means over the eight corners.
//!
//! Units: u m.

use super::{Params, Source};
use crate::math::{Real, V3, V4};

/// The shader.
pub const SOURCE: Source =
    Source { name: "centres", wgsl: include_str!("centres.wgsl"), params: Params::<f32>::FIELDS };

/// Means of `u` for all cells.
pub fn centres<R: Real>(
    params: &Params<R>,
    split: &[u32],         // see `split`
    u: &[V4<R>],           // [node] m
    point_u: &mut [V4<R>], // [cell] m
) {
    for cell in 0..params.cell_count as usize {
        let mut sum = V3::zero();
        for node in params.corner_nodes(split, cell) {
            sum += V3::from4(u[node]);
        }
        point_u[cell] = (sum * R::of(0.125)).pad(R::zero());
    }
}
