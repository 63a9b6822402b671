//! Adds the cells' tangent products (`hyperelastic_tangent`) to `w = A z`: `w_i += P_i s Σ f_(c,a)`, with the fraction `s` of the change of
//! forces over a step in `params.stiffness_factor` of this kernel's own block. `product` adds inertia and damping before it.
//! Units: z m, w N, forces N.

use super::collected::collected;
use super::{PARALLEL, Params, Source};
use crate::math::{Real, V3, V4};
use rayon::prelude::*;

/// The shader.
pub const SOURCE: Source =
    Source { name: "collect_product", wgsl: include_str!("collect_product.wgsl"), params: Params::<f32>::FIELDS };

/// One right-hand side; returns the increment of `z·w`.
pub fn collect_product<R: Real>(
    params: &Params<R>,
    corner_force: &[R], // [cell][corner][axis] N
    dofs: &[V4<R>],     // [node] 1 free, 0 fixed, per axis; mass kg
    z: &[V4<R>],        // [node] m
    w: &mut [V4<R>],    // [node] N
) -> R {
    let one = |node: usize, w: &mut V4<R>| {
        let force = collected(params, &[], corner_force, node) * params.stiffness_factor;
        let more = force.times(V3::from4(dofs[node]));
        *w = (V3::from4(*w) + more).pad(R::zero());
        V3::from4(z[node]).dot(more)
    };
    let part =
        |(n, w): (usize, &mut [V4<R>])| w.iter_mut().enumerate().map(|(k, w)| one(n * PARALLEL + k, w)).sum::<R>();
    let sums: Vec<R> = w.par_chunks_mut(PARALLEL).enumerate().map(part).collect();
    sums.into_iter().sum()
}
