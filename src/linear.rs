//! Conjugate gradients on the CPU, from the kernels' twins: the same recurrences as on the GPU, one right-hand side at a time.
//! Source: Chronopoulos, Gear 1989.

use crate::kernels::advance::{Request, Scalars, advance};
use crate::kernels::converge::converge;
use crate::kernels::update::update;
use crate::math::{Real, V4};
use std::sync::atomic::{AtomicBool, Ordering};

/// Vectors of one right-hand side; `x` holds the initial guess and then the solution, `r` the right-hand side and then the residual.
pub struct SolverVectors<'a, R> {
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

/// Solves `A x = r` from the initial guess `x`; `product` computes `w = A z` and `z·w`, `precondition` computes `z = M⁻¹ r` and `r·z`. Once
/// `interrupt` is set, the present iteration is the last.
pub fn solve<R: Real>(
    vectors: SolverVectors<R>,
    request: &Request<R>,
    load: R,
    max_iterations: u32,
    interrupt: &AtomicBool,
    mut product: impl FnMut(&[V4<R>], &mut [V4<R>]) -> R,
    mut precondition: impl FnMut(&[V4<R>], &mut [V4<R>]) -> R,
) -> Outcome {
    let SolverVectors { x, r, p, s, z, w } = vectors;
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
        let last = k.iterations.f64() >= f64::from(max_iterations) || interrupt.load(Ordering::Relaxed);
        if k.done != R::zero() || last {
            break;
        }
        gamma = precondition(r, z);
    }
    Outcome::of(&k)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Solves with the diagonal matrix 1, 2, 3 … without a preconditioner.
    fn solved(interrupt: bool) -> Outcome {
        const N: usize = 40;
        let dot = |a: &[V4<f64>], b: &[V4<f64>]| a.iter().zip(b).map(|(a, b)| a[0] * b[0]).sum();
        let [mut x, mut p, mut s, mut z, mut w] = [(); 5].map(|()| vec![[0.0; 4]; N]);
        let mut r = vec![[1.0, 0.0, 0.0, 0.0]; N];
        let request = Request { tolerance_squared: 1e-18, use_load: 1.0, ..Request::default() };
        let product = |z: &[V4<f64>], w: &mut [V4<f64>]| {
            w.iter_mut().zip(z).enumerate().for_each(|(k, (w, z))| *w = z.map(|z| (k + 1) as f64 * z));
            dot(z, w)
        };
        let precondition = |r: &[V4<f64>], z: &mut [V4<f64>]| {
            z.copy_from_slice(r);
            dot(r, z)
        };
        let vectors = SolverVectors { x: &mut x, r: &mut r, p: &mut p, s: &mut s, z: &mut z, w: &mut w };
        solve(vectors, &request, N as f64, 1000, &AtomicBool::new(interrupt), product, precondition)
    }

    #[test]
    fn an_interrupted_solve_ends_with_its_iteration() {
        let (whole, interrupted) = (solved(false), solved(true));
        assert!(whole.converged && whole.iterations > 10, "{whole:?}");
        assert!(!interrupted.converged && interrupted.iterations <= 1, "{interrupted:?}");
    }
}
