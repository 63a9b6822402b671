//! Pressure of each hyperelastic tetrahedron, `κ φ φ'` at the mean `J̄_e` of its patches, and the stiffness of its volume, `κ (φ'² + φ φ'')`
//! ([`super::tetrahedra_laws`]). In a volume that grows the stiffness is at least `(0.6 − ln J̄/5) φ'²`, as of hexahedra
//! ([`super::hyperelastic::Cell::linearised`]).
//!
//! Units: κ p Pa, positive in tension.

use super::deformation::{volume_pressure, volume_stiffness};
use super::tetrahedra::FEWEST;
use super::{Params, Source};
use crate::math::{Real, V4};
use rayon::prelude::*;

/// The shader.
pub const SOURCE: Source =
    Source { name: "tetrahedra_pressed", wgsl: include_str!("tetrahedra_pressed.wgsl"), params: Params::<f32>::FIELDS };

/// All tetrahedra.
pub fn tetrahedra_pressed<R: Real>(
    corners: &[[u32; 4]],   // [tetrahedron] patches of its volume
    gradients: &[V4<R>],    // [tetrahedron × 3] see `tetrahedra`
    nodal_strain: &[R],     // [patch] mean of J − 1
    strain: &mut [V4<R>],   // [tetrahedron × 3] first fourth number: pressure Pa
    cofactor: &mut [V4<R>], // [tetrahedron × 3] second fourth number: stiffness of the volume Pa
) {
    let each = strain.par_chunks_mut(3).zip(cofactor.par_chunks_mut(3)).with_min_len(FEWEST).enumerate();
    each.for_each(|(e, (strain, cofactor))| {
        let [a, b, c, d] = corners[e].map(|patch| nodal_strain[patch as usize]);
        let (mean, bulk) = ((a + b + c + d) * R::of(0.25), gradients[3 * e + 1][3]);
        strain[0][3] = bulk * volume_pressure(mean);
        cofactor[1][3] = bulk * volume_stiffness(mean);
    });
}
