//! Forces of each smoothed tetrahedron at its corners, for each right-hand side: `f_a = V (R p̄ + Σ_k τ_k) ∇N_a` over its six domains, `p̄` the
//! mean of the four corners' pressures ([`super::tetrahedra`]).
//!
//! Units: N.

use super::tetrahedra::{FEWEST, matrix};
use super::{Params, Source};
use crate::math::{Real, V4, rotation_matrix};
use rayon::prelude::*;

/// The shader.
pub const SOURCE: Source = Source {
    name: "tetrahedra_smoothed",
    wgsl: include_str!("tetrahedra_smoothed.wgsl"),
    params: Params::<f32>::FIELDS,
};

/// Domains of a tetrahedron.
const EDGES: usize = 6;

/// One right-hand side.
pub fn tetrahedra_smoothed<R: Real>(
    corners: &[[u32; 4]],            // [tetrahedron] nodes
    gradients: &[V4<R>],             // [tetrahedron × 3] see `tetrahedra`
    element_rotation: &[V4<R>],      // [tetrahedron] quaternion
    domains: &[u32],                 // [tetrahedron × 6]
    domain_stress: &[V4<R>],         // [domain × 3] Pa
    pressure: &[R],                  // [node] Pa
    tetrahedron_force: &mut [V4<R>], // [tetrahedron × 3] at corners 1 to 3, N
) {
    tetrahedron_force.par_chunks_mut(3).with_min_len(FEWEST).enumerate().for_each(|(e, force)| {
        let [a, b, c, d] = corners[e].map(|node| pressure[node as usize]);
        let mut stress = rotation_matrix(element_rotation[e]) * ((a + b + c + d) * R::of(0.25));
        for k in &domains[EDGES * e..EDGES * (e + 1)] {
            stress = stress + matrix(domain_stress, *k as usize);
        }
        let forces = stress * matrix(gradients, e) * gradients[3 * e][3];
        force.copy_from_slice(&forces.0.map(|f| f.pad(R::zero())));
    });
}
