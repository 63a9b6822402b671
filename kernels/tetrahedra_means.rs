//! Rotation of each domain or node: polar factor of the mean deformation gradient `Σ V_e F_e / Σ V_e` of the tetrahedra of its list; none of
//! an empty list.
//!
//! Units: gradients 1, rotation unit quaternion.

use super::Source;
use super::polar::{UPRIGHT, polar};
use super::tetrahedra::{FEWEST, matrix};
use crate::math::{M3, Real, V4};
use rayon::prelude::*;

/// The shader.
pub const SOURCE: Source = Source {
    name: "tetrahedra_means",
    wgsl: include_str!("tetrahedra_means.wgsl"),
    params: &["count", "pad_0", "pad_1", "pad_2"],
};

/// All domains, or all nodes.
pub fn tetrahedra_means<R: Real>(
    gradients: &[V4<R>],         // [tetrahedron × 3] see `tetrahedra`
    first: &[u32],               // [list + 1] into members
    members: &[u32],             // 4 × tetrahedron, and a corner or 0
    strain: &[V4<R>],            // [tetrahedron × 3] displacement gradient
    mean_rotation: &mut [V4<R>], // [list] quaternion
) {
    mean_rotation.par_iter_mut().with_min_len(FEWEST).enumerate().for_each(|(k, q)| {
        let (mut volume, mut sum) = (R::zero(), M3::zero());
        for entry in &members[first[k] as usize..first[k + 1] as usize] {
            let e = (entry / 4) as usize;
            volume += gradients[3 * e][3];
            sum = sum + matrix(strain, e) * gradients[3 * e][3];
        }
        let per_volume = if volume > R::zero() { R::one() / volume } else { R::zero() };
        *q = polar(M3::identity() + sum * per_volume, UPRIGHT.map(R::of));
    });
}
