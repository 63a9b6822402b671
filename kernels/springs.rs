//! Damped springs between node pairs, gathered per node: forces, and the tangents for `springs_product`. A cut spring has stiffness and
//! damping 0.
//!
//! `f_i = −Σ_s k ε n`, `d = D + δ = x_j − x_i`, `n = d/|d|`: the internal force, as in `forces`. The elongation
//! `ε = e + (2 D·δ + δ·δ)/(|d| + |D|)` is `|d| − L` without cancellation (`D` at rest, `δ = u_j − u_i`, `e = |D| − L` from f64): in f32,
//! `|d| − L` has the elongation to 10⁻⁷ of the length only, which leaves a true residual of 2·10⁻³ at rest. The damper `c (v_j − v_i)·n n`
//! acts on the velocity `Δx/h` at the end of the step and therefore enters the tangent only: `T = a n nᵀ + b I`, `b = s k max(ε/|d|, 0)`,
//! `a = s k + c/h − b`, `s = 1 + r_K/h`. The clamp keeps `A` positive definite for compressed springs (SOFA does without it).
//! Source: Provot 1995 (springs of a grid), Baraff, Witkin 1998 (implicit). Differs: damping along the axis only, so spinning costs
//! nothing.
//! Units: u m, e m, k N/m, c N·s/m, f N, T N/m.

use super::{Params, Source};
use crate::math::{M3, Real, V3, V4};

/// The shader.
pub const SOURCE: Source =
    Source { name: "springs", wgsl: include_str!("springs.wgsl"), params: Params::<f32>::FIELDS };

/// Spring forces and tangents.
pub fn springs<R: Real>(
    params: &Params<R>,
    rest: &[V4<R>],        // [node] m
    u: &[V4<R>],           // [node] m
    first: &[u32],         // [node + 1] into half
    half: &[[u32; 2]],     // springs around each node: other node, spring
    law: &[V4<R>],         // [spring] e, k, c, 0
    f: &mut [V4<R>],       // [node] N
    tangent: &mut [V4<R>], // [half × 2] symmetric T: xx xy xz yy; yz zz 0 0
) {
    for i in 0..params.node_count as usize {
        let mut sum = V3::zero();
        for n in first[i] as usize..first[i + 1] as usize {
            let [j, s] = half[n].map(|k| k as usize);
            let span = V3::from4(rest[j]) - V3::from4(rest[i]);
            let shift = V3::from4(u[j]) - V3::from4(u[i]);
            let [e, k, c, _] = law[s];
            let d = span + shift;
            let length = d.length();
            let mut t = M3::zero();
            if length > R::zero() {
                let stretch = (e + elongation(span, shift, length)) / length;
                sum = sum - d * (k * stretch);
                let axis = d * (R::one() / length);
                let stiff = k * params.stiffness_factor;
                let across = stiff * stretch.max(R::zero());
                let along = stiff + c / params.step - across;
                t = axis.outer(axis) * along + M3::diagonal(V3::splat(across));
            }
            tangent[n * 2] = [t.0[0].x, t.0[0].y, t.0[0].z, t.0[1].y];
            tangent[n * 2 + 1] = [t.0[1].z, t.0[2].z, R::zero(), R::zero()];
        }
        f[i] = sum.pad(R::zero());
    }
}

/// `|D + δ| − |D|`, m; `length` is `|D + δ|`.
pub fn elongation<R: Real>(span: V3<R>, shift: V3<R>, length: R) -> R {
    (span + span + shift).dot(shift) / (length + span.length())
}
