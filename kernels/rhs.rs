//! Right-hand side of the unconstrained motion, and the load that residuals are compared with.
//!
//! Implicit Euler with Rayleigh damping in displacement increments `Δx = h v'`: `A Δx = b`, `A = (1 + h r_M)/h² M + (1 + r_K/h) K`,
//! `b = −f + f_ext + m g + M v/h`. The trapezoidal and the midpoint rule have `2 M v/h`, symplectic Euler `(1 − h r_M) M v/h`: `params.momentum_factor`
//! (`bodies::Step` has their `A`). (These are the equations of SOFA's `EulerImplicitSolver` with `dv = Δx/h − v`, where the damping terms
//! of the right-hand side cancel.) `load² = Σ |b|² + |f_ext + m g|²` over free axes plus `Σ |f|²` over fixed ones: the magnitude of the
//! step's forces, also at rest.
//! Units: f N, v m/s, dofs 0/1 per axis and kg, load N, b N.

use super::{Params, Source};
use crate::math::{Real, V3, V4};

/// The shader.
pub const SOURCE: Source = Source { name: "rhs", wgsl: include_str!("rhs.wgsl"), params: Params::<f32>::FIELDS };

/// Fills `b` (right-hand side 0) and returns load² in N².
pub fn rhs<R: Real>(
    params: &Params<R>,
    f: &[V4<R>],     // [node] N
    v: &[V4<R>],     // [node] m/s
    dofs: &[V4<R>],  // [node] 1 free, 0 fixed, per axis; mass kg
    load: &[V4<R>],  // [node] N
    b: &mut [V4<R>], // [rhs][node] N
) -> R {
    let g = V3::new(params.gravity_x, params.gravity_y, params.gravity_z);
    let mut load_squared = R::zero();
    for i in 0..params.node_count as usize {
        let mass = dofs[i][3];
        let axes = V3::from4(dofs[i]);
        let elastic = V3::from4(f[i]);
        let applied = V3::from4(load[i]) + g * mass;
        let rate = mass * params.momentum_factor / params.step;
        let sum = (applied - elastic + V3::from4(v[i]) * rate).times(axes);
        b[i] = sum.pad(R::zero());
        let pushed = applied.times(axes);
        let reaction = elastic - elastic.times(axes);
        load_squared += sum.dot(sum) + pushed.dot(pushed) + reaction.dot(reaction);
    }
    load_squared
}
