//! Forces of each plain tetrahedron at its corners, for each right-hand side: `f_a = V R (κ θ + 2 μ dev ε) ∇N_a` ([`super::tetrahedra`]).
//!
//! Units: z m, f N.

use super::tetrahedra::{FEWEST, deviator, displacement_gradient, matrix, volume_strain};
use super::{Params, Source};
use crate::math::{M3, Real, V3, V4, rotation_matrix};
use rayon::prelude::*;

/// The shader.
pub const SOURCE: Source =
    Source { name: "tetrahedra_plain", wgsl: include_str!("tetrahedra_plain.wgsl"), params: Params::<f32>::FIELDS };

/// One right-hand side.
pub fn tetrahedra_plain<R: Real>(
    params: &Params<R>,
    corners: &[[u32; 4]],            // [tetrahedron] nodes
    gradients: &[V4<R>],             // [tetrahedron × 3] see `tetrahedra`
    element_rotation: &[V4<R>],      // [tetrahedron] quaternion
    z: &[V4<R>],                     // [node] m
    tetrahedron_force: &mut [V4<R>], // [tetrahedron × 3] at corners 1 to 3, N
) {
    tetrahedron_force.par_chunks_mut(3).with_min_len(FEWEST).enumerate().for_each(|(e, force)| {
        let [volume, bulk, shear] = [0, 1, 2].map(|n| gradients[3 * e + n][3]);
        let (gradient, q) = (displacement_gradient(gradients, e, corners[e], z), element_rotation[e]);
        let pressure = bulk * volume_strain(gradient, q, params.total);
        let strain = deviator(gradient, q, params.total);
        let stress = rotation_matrix(q) * (M3::diagonal(V3::splat(pressure)) + strain * (R::of(2.0) * shear));
        let forces = stress * matrix(gradients, e) * volume;
        force.copy_from_slice(&forces.0.map(|f| f.pad(R::zero())));
    });
}
