//! Internal forces of tetrahedra at the nodes ([`super::gathered`]). Units: N.

use super::gathered::gathered;
use super::tetrahedra::FEWEST;
use super::{Params, Source};
use crate::math::{Real, V4};
use rayon::prelude::*;

/// The shader.
pub const SOURCE: Source =
    Source { name: "tetrahedra_forces", wgsl: include_str!("tetrahedra_forces.wgsl"), params: Params::<f32>::FIELDS };

/// Forces of all nodes.
pub fn tetrahedra_forces<R: Real>(
    first_of_node: &[u32],       // [node + 1] into of_node
    of_node: &[u32],             // 4 × tetrahedron + corner
    tetrahedron_force: &[V4<R>], // [tetrahedron × 3] at corners 1 to 3, N
    f: &mut [V4<R>],             // [node] N
) {
    f.par_iter_mut().with_min_len(FEWEST).enumerate().for_each(|(i, f)| {
        let around = &of_node[first_of_node[i] as usize..first_of_node[i + 1] as usize];
        *f = gathered(around, tetrahedron_force).pad(R::zero());
    });
}
