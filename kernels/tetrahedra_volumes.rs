//! Volume strain at each node of smoothed tetrahedra, for each right-hand side: `θ_a = Σ V_e θ_e / Σ V_e` ([`super::tetrahedra`]).

use super::tetrahedra::FEWEST;
use super::{Params, Source};
use crate::math::{Real, V4};
use rayon::prelude::*;

/// The shader.
pub const SOURCE: Source =
    Source { name: "tetrahedra_volumes", wgsl: include_str!("tetrahedra_volumes.wgsl"), params: Params::<f32>::FIELDS };

/// One right-hand side.
pub fn tetrahedra_volumes<R: Real>(
    gradients: &[V4<R>],    // [tetrahedron × 3] see `tetrahedra`
    first_of_node: &[u32],  // [node + 1] into of_node
    of_node: &[u32],        // 4 × tetrahedron + corner
    per_volume: &[R],       // [node] 1 / sum of the volumes, 1/m³
    strain: &[V4<R>],       // [tetrahedron × 3] displacement gradient, volume strain
    nodal_strain: &mut [R], // [node] volume strain
) {
    nodal_strain.par_iter_mut().with_min_len(FEWEST).enumerate().for_each(|(i, theta)| {
        let around = &of_node[first_of_node[i] as usize..first_of_node[i + 1] as usize];
        let sum = around.iter().fold(R::zero(), |sum, entry| {
            let at = 3 * (entry / 4) as usize;
            sum + gradients[at][3] * strain[at][3]
        });
        *theta = sum * per_volume[i];
    });
}
