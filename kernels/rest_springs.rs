//! Rest-shape springs in the right-hand side: `b_i −= P_i k_i u_i`, `P_i` the DOF mask.
//!
//! In implicit Euler `A` gains `k_i (1 + r_K/h)` on the diagonal; this term is part of the mass that the kernels of `A` read from `dofs`
//! (`RestSprings` of the model). The forces `f` of the cells are unchanged, so their sum over these nodes is the reaction of the springs, and
//! it counts in the step's load like the reaction of fixed nodes. A node that has left the system has an empty DOF mask.
//! Source: SOFA's RestShapeSpringsForceField, `f = −k (x − x_rest)`, with Rayleigh damping like all stiffness there.
//! Units: k N/m, u m, b N.

use super::Source;
use crate::math::{Real, V3, V4};

/// The shader.
pub const SOURCE: Source = Source {
    name: "rest_springs",
    wgsl: include_str!("rest_springs.wgsl"),
    params: &["count", "pad_0", "pad_1", "pad_2"],
};

/// Adds the springs' forces to `b`.
pub fn rest_springs<R: Real>(
    ids: &[u32],            // [spring] node, each once
    spring_stiffness: &[R], // [spring] N/m
    dofs: &[V4<R>],         // [node] 1 free, 0 fixed, per axis; mass kg
    u: &[V4<R>],            // [node] m
    b: &mut [V4<R>],        // [rhs][node] N
) {
    for (id, k) in ids.iter().zip(spring_stiffness) {
        let i = *id as usize;
        let pull = (V3::from4(u[i]) * *k).times(V3::from4(dofs[i]));
        b[i] = (V3::from4(b[i]) - pull).pad(R::zero());
    }
}
