//! Motion of the cell centres, the ends of the face links: means over the eight corners.
//!
//! Units: u m, v m/s.

use super::{Params, Source};
use crate::math::{Real, V3, V4};

/// The shader.
pub const SOURCE: Source =
    Source { name: "centres", wgsl: include_str!("centres.wgsl"), params: Params::<f32>::FIELDS };

/// Means of `u` and `v` per cell.
pub fn centres<R: Real>(
    params: &Params<R>,
    split: &[u32],         // see `split`
    u: &[V4<R>],           // [node] m
    v: &[V4<R>],           // [node] m/s
    point_u: &mut [V4<R>], // [cell] m
    point_v: &mut [V4<R>], // [cell] m/s
) {
    let eighth = R::of(0.125);
    for cell in 0..params.cell_count as usize {
        let (mut a, mut b) = (V3::zero(), V3::zero());
        for node in params.corner_nodes(split, cell) {
            a += V3::from4(u[node]);
            b += V3::from4(v[node]);
        }
        point_u[cell] = (a * eighth).pad(R::zero());
        point_v[cell] = (b * eighth).pad(R::zero());
    }
}
