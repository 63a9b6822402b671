//! Springs from nodes to their rest positions, as the right-hand side has them: `b_i −= P_i k_i u_i`, `P_i` the free axes.
//!
//! In implicit Euler `A` gains `k_i (1 + r_K/h)` on the diagonal; that part stands in the mass that the kernels of `A` read from `free`
//! (`Anchors` of the model). The forces `f` of the cells are left as they are, so that their sum over anchored nodes is what the anchors
//! hold, and what anchors bear counts in the step's load as what held nodes bear. A node that has left the system has no free axis.
//! Source: SOFA's RestShapeSpringsForceField, `f = −k (x − x_rest)`, with Rayleigh damping as all stiffness there.
//! Units: k N/m, u m, b N.

use super::Source;
use crate::math::{Real, V3, V4};

/// The shader.
pub const SOURCE: Source =
    Source { name: "anchors", wgsl: include_str!("anchors.wgsl"), params: &["count", "pad_0", "pad_1", "pad_2"] };

/// Adds the springs' forces to `b`.
pub fn anchors<R: Real>(
    ids: &[u32],     // [anchor] node, each once
    anchor: &[R],    // [anchor] N/m
    free: &[V4<R>],  // [node] 1 free, 0 held, per axis; mass kg
    u: &[V4<R>],     // [node] m
    b: &mut [V4<R>], // [slot][node] N
) {
    for (id, k) in ids.iter().zip(anchor) {
        let i = *id as usize;
        let pull = (V3::from4(u[i]) * *k).times(V3::from4(free[i]));
        b[i] = (V3::from4(b[i]) - pull).pad(R::zero());
    }
}
