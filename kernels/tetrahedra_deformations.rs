//! Deformation of each hyperelastic tetrahedron ([`super::tetrahedra_laws`]): displacement gradient, `J_e − 1`, and `cof F_e = ∂J_e/∂F_e`.
//!
//! Units: u m.

use super::deformation::Point;
use super::tetrahedra::{FEWEST, displacement_gradient};
use super::{Params, Source};
use crate::math::{Real, V4};
use rayon::prelude::*;

/// The shader.
pub const SOURCE: Source = Source {
    name: "tetrahedra_deformations",
    wgsl: include_str!("tetrahedra_deformations.wgsl"),
    params: Params::<f32>::FIELDS,
};

/// All tetrahedra.
pub fn tetrahedra_deformations<R: Real>(
    corners: &[[u32; 4]],   // [tetrahedron] nodes
    gradients: &[V4<R>],    // [tetrahedron × 3] see `tetrahedra`
    u: &[V4<R>],            // [node] m
    strain: &mut [V4<R>],   // [tetrahedron × 3] displacement gradient; first fourth number: J − 1
    cofactor: &mut [V4<R>], // [tetrahedron × 3] cof F; fourth numbers: volume m³, two zeros
) {
    let each = strain.par_chunks_mut(3).zip(cofactor.par_chunks_mut(3)).with_min_len(FEWEST).enumerate();
    each.for_each(|(e, (strain, cofactor))| {
        let point = Point::new(displacement_gradient(gradients, e, corners[e], u));
        let [a, b, c] = point.h.0;
        strain.copy_from_slice(&[a.pad(point.dilatation), b.pad(R::zero()), c.pad(R::zero())]);
        let [a, b, c] = point.cofactor.0;
        cofactor.copy_from_slice(&[a.pad(gradients[3 * e][3]), b.pad(R::zero()), c.pad(R::zero())]);
    });
}
