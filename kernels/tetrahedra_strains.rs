//! Displacement gradient and volume strain of each tetrahedron, for each right-hand side ([`super::tetrahedra`]).
//!
//! Units: z m.

use super::tetrahedra::{FEWEST, displacement_gradient, volume_strain};
use super::{Params, Source};
use crate::math::{Real, V4};
use rayon::prelude::*;

/// The shader.
pub const SOURCE: Source =
    Source { name: "tetrahedra_strains", wgsl: include_str!("tetrahedra_strains.wgsl"), params: Params::<f32>::FIELDS };

/// One right-hand side.
pub fn tetrahedra_strains<R: Real>(
    params: &Params<R>,
    corners: &[[u32; 4]],       // [tetrahedron] nodes
    gradients: &[V4<R>],        // [tetrahedron × 3] see `tetrahedra`
    element_rotation: &[V4<R>], // [tetrahedron] quaternion
    z: &[V4<R>],                // [node] m
    strain: &mut [V4<R>],       // [tetrahedron × 3] displacement gradient; first fourth number: volume strain
) {
    strain.par_chunks_mut(3).with_min_len(FEWEST).enumerate().for_each(|(e, strain)| {
        let gradient = displacement_gradient(gradients, e, corners[e], z);
        let theta = volume_strain(gradient, element_rotation[e], params.total);
        let [a, b, c] = gradient.0;
        strain.copy_from_slice(&[a.pad(theta), b.pad(R::zero()), c.pad(R::zero())]);
    });
}
