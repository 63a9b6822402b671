//! Change of stress of each domain of hyperelastic tetrahedra by its linearisation, for each right-hand side: `R (a sym A + b tr A I + t skew A)`,
//! `A = Rᵀ dF̄` ([`super::tetrahedra_laws`]).
//!
//! Units: stress Pa.

use super::tetrahedra::{FEWEST, mean};
use super::{Params, Source};
use crate::math::{M3, Real, V3, V4, rotation_matrix};
use rayon::prelude::*;

/// The shader.
pub const SOURCE: Source =
    Source { name: "tetrahedra_frames", wgsl: include_str!("tetrahedra_frames.wgsl"), params: Params::<f32>::FIELDS };

/// One right-hand side.
pub fn tetrahedra_frames<R: Real>(
    gradients: &[V4<R>],         // [tetrahedron × 3] see `tetrahedra`
    first_of_domain: &[u32],     // [domain + 1] into of_domain
    of_domain: &[u32],           // 4 × tetrahedron
    domain_rotation: &[V4<R>],   // [domain] quaternion
    frame: &[V4<R>],             // [domain] factors a, b, t Pa; 1/volume 1/m³
    strain: &[V4<R>],            // [tetrahedron × 3] change of F
    domain_stress: &mut [V4<R>], // [domain × 3] Pa
) {
    domain_stress.par_chunks_mut(3).with_min_len(FEWEST).enumerate().for_each(|(k, stress)| {
        let members = &of_domain[first_of_domain[k] as usize..first_of_domain[k + 1] as usize];
        let (rotation, [a, b, t, per_volume]) = (rotation_matrix(domain_rotation[k]), frame[k]);
        let change = rotation.transpose() * mean(gradients, members, strain, per_volume).0;
        let (half, turned) = (R::of(0.5), change.transpose());
        let even = (change + turned) * (a * half) + M3::diagonal(V3::splat(b * change.trace()));
        let found = rotation * (even + (change - turned) * (t * half));
        stress.copy_from_slice(&found.0.map(|column| column.pad(R::zero())));
    });
}
