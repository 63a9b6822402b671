//! Pressure at each node of smoothed tetrahedra, for each right-hand side: the transpose of the averages of the volume strain,
//! `p_a = Σ V_e κ_e θ̄_e / Σ V_e` with `θ̄_e` the mean of the four corners' `θ_a` ([`super::tetrahedra`]).
//!
//! Units: p Pa, positive in tension.

use super::tetrahedra::FEWEST;
use super::{Params, Source};
use crate::math::{Real, V4};
use rayon::prelude::*;

/// The shader.
pub const SOURCE: Source = Source {
    name: "tetrahedra_pressures",
    wgsl: include_str!("tetrahedra_pressures.wgsl"),
    params: Params::<f32>::FIELDS,
};

/// One right-hand side.
pub fn tetrahedra_pressures<R: Real>(
    corners: &[[u32; 4]],  // [tetrahedron] nodes
    gradients: &[V4<R>],   // [tetrahedron × 3] see `tetrahedra`
    first_of_node: &[u32], // [node + 1] into of_node
    of_node: &[u32],       // 4 × tetrahedron + corner
    per_volume: &[R],      // [node] 1 / sum of the volumes, 1/m³
    nodal_strain: &[R],    // [node] volume strain
    pressure: &mut [R],    // [node] Pa
) {
    pressure.par_iter_mut().with_min_len(FEWEST).enumerate().for_each(|(i, pressure)| {
        let around = &of_node[first_of_node[i] as usize..first_of_node[i + 1] as usize];
        let sum = around.iter().fold(R::zero(), |sum, entry| {
            let e = (entry / 4) as usize;
            let [a, b, c, d] = corners[e].map(|node| nodal_strain[node as usize]);
            let mean = (a + b + c + d) * R::of(0.25);
            sum + gradients[3 * e][3] * gradients[3 * e + 1][3] * mean
        });
        *pressure = sum * per_volume[i];
    });
}
