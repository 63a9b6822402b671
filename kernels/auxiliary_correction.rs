//! Correction of a body by an auxiliary grid: `z = F P z_a`, and `w = 0`, to which one step of the smoother then adds `M⁻¹ r`
//! ([`super::relax`] with `keep` 0): the additive form, `F P B_a Pᵀ F + M⁻¹`.
//!
//! `P` as of [`super::auxiliary_restriction`]; a node has up to eight weights. Units: m; w N.
//! Source: Xu 1996 (auxiliary space method).

use super::{Params, Source};
use crate::math::{Real, V3, V4};
use rayon::prelude::*;

/// The shader.
pub const SOURCE: Source = Source {
    name: "auxiliary_correction",
    wgsl: include_str!("auxiliary_correction.wgsl"),
    params: Params::<f32>::FIELDS,
};

/// One right-hand side.
pub fn auxiliary_correction<R: Real>(
    first_weight: &[u32],  // [node + 1] into weighted
    weighted: &[u32],      // nodes of the grid
    weight: &[R],          // [weighted] weights
    dofs: &[V4<R>],        // [node] 1 free, 0 fixed, per axis; mass kg
    auxiliary_z: &[V4<R>], // [node of the grid] m
    z: &mut [V4<R>],       // [node] m
    w: &mut [V4<R>],       // [node] N
) {
    let one_node = |(i, (z, w)): (usize, (&mut V4<R>, &mut V4<R>))| {
        let mut sum = V3::zero();
        for n in first_weight[i] as usize..first_weight[i + 1] as usize {
            sum += V3::from4(auxiliary_z[weighted[n] as usize]) * weight[n];
        }
        *z = sum.times(V3::from4(dofs[i])).pad(R::zero());
        *w = [R::zero(); 4];
    };
    z.par_iter_mut().zip(w).enumerate().with_min_len(super::PARALLEL).for_each(one_node);
}
