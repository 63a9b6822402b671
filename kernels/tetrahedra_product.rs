//! Product with the system matrix of a body of tetrahedra at the nodes: `w_i = P_i (s Σ f_(e,a) + m_i (1 + h r_M)/h² z_i)`, with the forces
//! of the tetrahedra for `z` ([`super::gathered`]), for each right-hand side. Units: z m, w N.

use super::gathered::gathered;
use super::tetrahedra::FEWEST;
use super::{Params, Source};
use crate::math::{Real, V3, V4};
use rayon::prelude::*;

/// The shader.
pub const SOURCE: Source =
    Source { name: "tetrahedra_product", wgsl: include_str!("tetrahedra_product.wgsl"), params: Params::<f32>::FIELDS };

/// One right-hand side; returns `z·w`.
pub fn tetrahedra_product<R: Real>(
    params: &Params<R>,
    first_of_node: &[u32],       // [node + 1] into of_node
    of_node: &[u32],             // 4 × tetrahedron + corner
    tetrahedron_force: &[V4<R>], // [tetrahedron × 3] at corners 1 to 3, N
    dofs: &[V4<R>],              // [node] 1 free, 0 fixed, per axis; mass kg
    z: &[V4<R>],                 // [node] m
    w: &mut [V4<R>],             // [node] N
) -> R {
    w.par_iter_mut().with_min_len(FEWEST).enumerate().for_each(|(i, w)| {
        let around = &of_node[first_of_node[i] as usize..first_of_node[i + 1] as usize];
        let elastic = gathered(around, tetrahedron_force) * params.stiffness_factor;
        let inertia = V3::from4(z[i]) * (params.inertia * dofs[i][3]);
        *w = (elastic + inertia).times(V3::from4(dofs[i])).pad(R::zero());
    });
    z.iter().zip(&*w).map(|(z, w)| V3::from4(*z).dot(V3::from4(*w))).sum()
}
