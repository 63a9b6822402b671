//! Restriction of a body's residual to an auxiliary grid: `r_a = F_a Pᵀ r`.
//!
//! `P` has the weights of the grid's trilinear shape functions at the body's nodes, `F` is the DOF mask. Units: N.
//! Source: Xu 1996 (auxiliary space method).

use super::{Params, Source};
use crate::math::{Real, V3, V4};
use rayon::prelude::*;

/// The shader.
pub const SOURCE: Source = Source {
    name: "auxiliary_restriction",
    wgsl: include_str!("auxiliary_restriction.wgsl"),
    params: Params::<f32>::FIELDS,
};

/// One right-hand side.
pub fn auxiliary_restriction<R: Real>(
    first_around: &[u32],      // [node of the grid + 1] into around
    around: &[u32],            // nodes of the body
    weight_around: &[R],       // [around] weights
    auxiliary_dofs: &[V4<R>],  // [node of the grid] 1 free, 0 fixed, per axis
    r: &[V4<R>],               // [node] N
    auxiliary_r: &mut [V4<R>], // [node of the grid] N
) {
    let one_node = |(i, out): (usize, &mut V4<R>)| {
        let mut sum = V3::zero();
        for n in first_around[i] as usize..first_around[i + 1] as usize {
            sum += V3::from4(r[around[n] as usize]) * weight_around[n];
        }
        *out = sum.times(V3::from4(auxiliary_dofs[i])).pad(R::zero());
    };
    auxiliary_r.par_iter_mut().enumerate().with_min_len(super::PARALLEL).for_each(one_node);
}
