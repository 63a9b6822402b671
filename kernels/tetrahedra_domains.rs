//! Deviatoric stress of each domain of smoothed tetrahedra, for each right-hand side: `τ_k = ⅓ μ_k R_k dev ε̄_k`, the part of
//! `2 μ R dev ε` that each of the six edges of a tetrahedron adds to its stress ([`super::tetrahedra`]).
//!
//! Units: τ Pa.

use super::tetrahedra::{FEWEST, deviator, mean};
use super::{Params, Source};
use crate::math::{Real, V4, rotation_matrix};
use rayon::prelude::*;

/// The shader.
pub const SOURCE: Source =
    Source { name: "tetrahedra_domains", wgsl: include_str!("tetrahedra_domains.wgsl"), params: Params::<f32>::FIELDS };

/// One right-hand side.
pub fn tetrahedra_domains<R: Real>(
    params: &Params<R>,
    gradients: &[V4<R>],         // [tetrahedron × 3] see `tetrahedra`
    first_of_domain: &[u32],     // [domain + 1] into of_domain
    of_domain: &[u32],           // 4 × tetrahedron
    shear: &[[R; 2]],            // [domain] sum of the volumes m³, shear modulus Pa
    domain_rotation: &[V4<R>],   // [domain] quaternion
    strain: &[V4<R>],            // [tetrahedron × 3] displacement gradient, volume strain
    domain_stress: &mut [V4<R>], // [domain × 3] Pa
) {
    domain_stress.par_chunks_mut(3).with_min_len(FEWEST).enumerate().for_each(|(k, stress)| {
        let members = &of_domain[first_of_domain[k] as usize..first_of_domain[k + 1] as usize];
        let (q, [volume, modulus]) = (domain_rotation[k], shear[k]);
        let strain = deviator(mean(gradients, members, strain, R::one() / volume).0, q, params.total);
        let own = rotation_matrix(q) * strain * (modulus * R::of(1.0 / 3.0));
        stress.copy_from_slice(&own.0.map(|column| column.pad(R::zero())));
    });
}
