//! Forces of each hyperelastic tetrahedron at its corners, for each right-hand side: `f_a = V (p̄ cof F + Σ_k τ_k) ∇N_a` over its six domains,
//! `p̄` the mean of its four patches' pressures ([`super::tetrahedra_laws`]).
//!
//! Units: N.

use super::tetrahedra::{FEWEST, matrix};
use super::{Params, Source};
use crate::math::{Real, V4};
use rayon::prelude::*;

/// The shader.
pub const SOURCE: Source =
    Source { name: "tetrahedra_large", wgsl: include_str!("tetrahedra_large.wgsl"), params: Params::<f32>::FIELDS };

/// Domains of a tetrahedron.
const EDGES: usize = 6;

/// One right-hand side.
pub fn tetrahedra_large<R: Real>(
    corners: &[[u32; 4]],            // [tetrahedron] patches of its volume
    gradients: &[V4<R>],             // [tetrahedron × 3] see `tetrahedra`
    cofactor: &[V4<R>],              // [tetrahedron × 3] cof F
    domains: &[u32],                 // [tetrahedron × 6]
    domain_stress: &[V4<R>],         // [domain × 3] Pa, a sixth
    pressure: &[R],                  // [patch] Pa
    tetrahedron_force: &mut [V4<R>], // [tetrahedron × 3] at corners 1 to 3, N
) {
    tetrahedron_force.par_chunks_mut(3).with_min_len(FEWEST).enumerate().for_each(|(e, force)| {
        let [a, b, c, d] = corners[e].map(|patch| pressure[patch as usize]);
        let mut stress = matrix(cofactor, e) * ((a + b + c + d) * R::of(0.25));
        for k in &domains[EDGES * e..EDGES * (e + 1)] {
            stress = stress + matrix(domain_stress, *k as usize);
        }
        let forces = stress * matrix(gradients, e) * gradients[3 * e][3];
        force.copy_from_slice(&forces.0.map(|f| f.pad(R::zero())));
    });
}
