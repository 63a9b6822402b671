//! Conjugate gradients on the CPU, from the kernels' twins: the same recurrences as on the GPU, one right-hand side at a time.

use crate::kernels::advance::{Request, Scalars, advance};
use crate::kernels::converge::converge;
use crate::kernels::update::update;
use crate::math::{Real, V4};

/// Vectors of one right-hand side; `x` holds the initial guess and then the solution, `r` the right-hand side and then the residual.
pub struct Slot<'a, R> {
    /// `[node]` m
    pub x: &'a mut [V4<R>],
    /// `[node]` N
    pub r: &'a mut [V4<R>],
    /// `[node]` m
    pub p: &'a mut [V4<R>],
    /// `[node]` N
    pub s: &'a mut [V4<R>],
    /// `[node]` m
    pub z: &'a mut [V4<R>],
    /// `[node]` N
    pub w: &'a mut [V4<R>],
}

/// Outcome of a solve.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outcome {
    /// Iterations done.
    pub iterations: u32,
    /// Reached the target.
    pub converged: bool,
    /// Residual norm by the recurrence, N.
    pub residual: f64,
    /// Requested residual norm, N.
    pub target: f64,
}

impl Outcome {
    /// Outcome of a direct solution, which meets any target.
    pub fn exact() -> Self {
        Self { iterations: 0, converged: true, residual: 0.0, target: f64::INFINITY }
    }

    /// True if it broke down before it converged or reached its iteration limit: the matrix is not positive definite.
    pub fn broken(&self, max_iterations: u32) -> bool {
        !self.converged && self.iterations < max_iterations
    }

    /// From the solver's scalars.
    pub fn of<R: Real>(k: &Scalars<R>) -> Self {
        Self {
            iterations: k.iterations.f64() as u32,
            converged: k.done == R::one(),
            residual: k.residual_squared.f64().sqrt(),
            target: k.target_squared.f64().sqrt(),
        }
    }
}

/// Solves `A x = r` from the initial guess `x`; `product` computes `w = A z` and `z·w`, `precondition` computes `z = M⁻¹ r` and `r·z`.
pub fn solve<R: Real>(
    slot: Slot<R>,
    request: &Request<R>,
    load: R,
    max_iterations: u32,
    mut product: impl FnMut(&[V4<R>], &mut [V4<R>]) -> R,
    mut precondition: impl FnMut(&[V4<R>], &mut [V4<R>]) -> R,
) -> Outcome {
    let Slot { x, r, p, s, z, w } = slot;
    let mut k = Scalars { alpha: R::one(), ..Scalars::default() };
    let (mut gamma, mut residual) = (R::zero(), R::zero());
    z.copy_from_slice(x);
    loop {
        let delta = product(z, w);
        advance(request, load, delta, gamma, residual, &mut k);
        if k.done != R::zero() {
            break;
        }
        residual = update(&k, z, w, x, p, s, r);
        converge(residual, &mut k);
        if k.done != R::zero() || k.iterations.f64() >= f64::from(max_iterations) {
            break;
        }
        gamma = precondition(r, z);
    }
    Outcome::of(&k)
}
