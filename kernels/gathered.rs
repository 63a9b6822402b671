//! Sum of the forces of the tetrahedra around a node: `f_i = Σ f_(e,a)`; shared by kernels.
//!
//! A tetrahedron stores the forces at its corners 1 to 3; that at corner 0 is minus their sum. The order of the sum is fixed. Units: N.

use crate::math::{Real, V3, V4};

/// Text shared by the shaders that read these forces.
pub const WGSL: &str = include_str!("gathered.wgsl");

/// Sum at one node; `around` has 4 × tetrahedron + corner.
#[inline(always)]
pub fn gathered<R: Real>(around: &[u32], tetrahedron_force: &[V4<R>]) -> V3<R> {
    let mut sum = V3::zero();
    for entry in around {
        let (first, a) = (3 * (entry / 4) as usize, (entry % 4) as usize);
        let force = |k: usize| V3::from4(tetrahedron_force[first + k]);
        sum = if a == 0 { sum - (force(0) + force(1) + force(2)) } else { sum + force(a - 1) };
    }
    sum
}
