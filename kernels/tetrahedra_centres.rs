//! Displacements of the centroids of tetrahedra, which are the ends of the links over their faces: means over the four corners.
//!
//! Units: u m.

use super::tetrahedra::FEWEST;
use super::{Params, Source};
use crate::math::{Real, V3, V4};
use rayon::prelude::*;

/// The shader.
pub const SOURCE: Source =
    Source { name: "tetrahedra_centres", wgsl: include_str!("tetrahedra_centres.wgsl"), params: Params::<f32>::FIELDS };

/// Means of `u` for all tetrahedra.
pub fn tetrahedra_centres<R: Real>(
    corners: &[[u32; 4]],  // [tetrahedron] nodes
    u: &[V4<R>],           // [node] m
    point_u: &mut [V4<R>], // [tetrahedron] m
) {
    point_u.par_iter_mut().with_min_len(FEWEST).enumerate().for_each(|(e, point)| {
        let [a, b, c, d] = corners[e].map(|node| V3::from4(u[node as usize]));
        *point = ((a + b + c + d) * R::of(0.25)).pad(R::zero());
    });
}
