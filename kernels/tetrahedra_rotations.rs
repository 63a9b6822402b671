//! Rotation of each tetrahedron: polar factor of `F_e` ([`super::polar`]), found afresh, so that no state is kept from step to step.
//!
//! Units: u m, rotation unit quaternion.

use super::polar::{UPRIGHT, polar};
use super::tetrahedra::{FEWEST, displacement_gradient};
use super::{Params, Source};
use crate::math::{M3, Real, V4};
use rayon::prelude::*;

/// The shader.
pub const SOURCE: Source = Source {
    name: "tetrahedra_rotations",
    wgsl: include_str!("tetrahedra_rotations.wgsl"),
    params: Params::<f32>::FIELDS,
};

/// All rotations.
pub fn tetrahedra_rotations<R: Real>(
    corners: &[[u32; 4]],           // [tetrahedron] nodes
    gradients: &[V4<R>],            // [tetrahedron × 3] see `tetrahedra`
    u: &[V4<R>],                    // [node] m
    element_rotation: &mut [V4<R>], // [tetrahedron] quaternion
) {
    element_rotation.par_iter_mut().with_min_len(FEWEST).enumerate().for_each(|(e, q)| {
        let gradient = displacement_gradient(gradients, e, corners[e], u);
        *q = polar(M3::identity() + gradient, UPRIGHT.map(R::of));
    });
}
