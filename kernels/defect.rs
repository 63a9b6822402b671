//! Defect of a step's linearisation: what the right-hand side needs for `A Δx = b + d` to have the law's own forces at its end.
//!
//! `d = P [K Δx − (f(u + Δx) − f(u))]`, `K` the linearised stiffness and `f` the law's internal forces, evaluated at the increment so far; `K Δx`
//! comes from the product `w = A Δx` without inertia: `(w − inertia M Δx)/stiffness_factor`. Solving with it again and again is Newton's method
//! with the matrix of the step's start; damping stays with that matrix. 0 at the solution of the linear step where the law is linear.
//! Source: defect correction, Stetter 1978; modified Newton, Bathe 1996, section 8.4.
//! Units: w, f, b N; x m; dofs 0/1 per axis and kg.

use super::{Params, Source};
use crate::math::{Real, V3, V4};

/// The shader.
pub const SOURCE: Source = Source { name: "defect", wgsl: include_str!("defect.wgsl"), params: Params::<f32>::FIELDS };

/// Adds the defect to `b` (right-hand side 0).
pub fn defect<R: Real>(
    params: &Params<R>,
    w: &[V4<R>],     // [node] product A Δx, N
    x: &[V4<R>],     // [rhs][node] m
    dofs: &[V4<R>],  // [node] DOF mask and mass as in A, kg
    f: &[V4<R>],     // [node] elastic forces at the start, N
    f_end: &[V4<R>], // [node] those at the increment, N
    b: &mut [V4<R>], // [rhs][node] N
) {
    for i in 0..params.node_count as usize {
        let inertia = V3::from4(x[i]) * (params.inertia * dofs[i][3]);
        let linear = (V3::from4(w[i]) - inertia) * (R::one() / params.stiffness_factor);
        let change = V3::from4(f_end[i]) - V3::from4(f[i]);
        b[i] = (V3::from4(b[i]) + (linear - change).times(V3::from4(dofs[i]))).pad(R::zero());
    }
}
