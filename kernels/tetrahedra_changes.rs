//! Change of the displacement gradient and of the volume, `cof F:dF`, of each hyperelastic tetrahedron, for each right-hand side
//! ([`super::tetrahedra_laws`]).
//!
//! Units: z m.

use super::tetrahedra::{FEWEST, displacement_gradient, matrix};
use super::{Params, Source};
use crate::math::{Real, V4};
use rayon::prelude::*;

/// The shader.
pub const SOURCE: Source =
    Source { name: "tetrahedra_changes", wgsl: include_str!("tetrahedra_changes.wgsl"), params: Params::<f32>::FIELDS };

/// One right-hand side.
pub fn tetrahedra_changes<R: Real>(
    corners: &[[u32; 4]], // [tetrahedron] nodes
    gradients: &[V4<R>],  // [tetrahedron × 3] see `tetrahedra`
    cofactor: &[V4<R>],   // [tetrahedron × 3] cof F
    z: &[V4<R>],          // [node] m
    strain: &mut [V4<R>], // [tetrahedron × 3] change of F; first fourth number: change of J
) {
    strain.par_chunks_mut(3).with_min_len(FEWEST).enumerate().for_each(|(e, strain)| {
        let change = displacement_gradient(gradients, e, corners[e], z);
        let [a, b, c] = change.0;
        strain.copy_from_slice(&[a.pad(matrix(cofactor, e).dot(change)), b.pad(R::zero()), c.pad(R::zero())]);
    });
}
