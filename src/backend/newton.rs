//! Newton's method for a step with a nonlinear law, on any backend.
//!
//! A step minimises `Π(Δx) = ½ Δx·(inertia M + (r_K/h) K₀) Δx + W(u + τ Δx)/τ − (b + f(u))·Δx`: its elastic forces are those at `u + τ Δx`, with
//! `τ` 1, or ½ for the midpoint rule ([`crate::bodies::Step::elastic_at`]), and the rotated small-strain matrix `K₀` is used for Rayleigh damping
//! and preconditioning. Newton's method solves `(inertia M + (r_K/h) K₀ + τ K_T) e = −∇Π`, `K_T` at `u + τ Δx`, by conjugate gradients to a
//! fraction of the residual that decreases with it, so that convergence stays quadratic; then `Δx += t e`, `t` halved until `Π` decreases
//! sufficiently (Armijo) and no cell is inverted. If the gradients break down, the tangent is indefinite: `K₀` is added with a factor that grows
//! tenfold until they converge (counted). The factor that sufficed sets the first one of the next iteration (Levenberg 1944, Marquardt 1963).
//! Source: Nocedal, Wright 2006, chapters 3 and 7 (line search, inexact Newton); Eisenstat, Walker 1996 (forcing terms).

use crate::error::{Error, Result};
use crate::linear::Outcome;

/// Maximum Newton iterations of a step; 3 to 10 are usual, a bar that buckles by half its length takes 46.
const MAX_ITERATIONS: u32 = 100;
/// Multiple of the rounding of a step's load below which a residual may be rounding alone; it is where [`STALLED`] iterations running do not
/// halve it. A tolerance below what the precision can do would take all iterations in each step.
/// A solid at rest in f32, whose load halves from step to step, is left with 1.05e3 to 1.3e3.
const ROUNDED: f64 = 1e4;
/// See [`ROUNDED`].
const STALLED: u32 = 3;
/// Largest forcing term: fraction of the residual that an inner solve may leave. Smaller costs inner, larger costs outer iterations.
const FORCING: f64 = 0.1;
/// Armijo's fraction of the predicted decrease.
const SUFFICIENT_DECREASE: f64 = 1e-4;
/// Maximum number of step halvings: down to 10⁻⁹ of the step.
const HALVINGS: u32 = 30;
/// First factor of `K₀` added to an indefinite tangent; it grows tenfold with each solve, up to `LARGEST_SHIFT`.
const FIRST_SHIFT: f64 = 0.1;
/// Largest factor; see [`FIRST_SHIFT`].
const LARGEST_SHIFT: f64 = 1e3;
/// Smallest first factor.
const SMALLEST_SHIFT: f64 = 1e-4;
/// Part of a factor that sufficed, tried first in the next iteration. A factor larger than needed turns the Newton direction towards the
/// gradient, with little progress per iteration.
const SHIFT_REDUCTION: f64 = 0.25;

/// Body whose tangent can be shifted by `K₀`.
pub(super) trait Shifted {
    /// Sets the factor of `K₀` in the tangent.
    fn set_shift(&mut self, shift: f64);
    /// Counts an indefinite tangent.
    fn count_indefinite(&mut self);
    /// Iteration limit of a solve.
    fn max_iterations(&self) -> u32;
}

/// Solves with increasing factors of `K₀`, starting with none and then `first`, until the gradients converge. Returns the iterations of all
/// solves, and the factor used.
pub(super) fn solve_shifted<B: Shifted>(
    body: &mut B,
    first: f64,
    mut solve: impl FnMut(&mut B) -> Result<Outcome>,
) -> Result<(u32, f64)> {
    let (mut shift, mut iterations) = (0.0, 0);
    loop {
        body.set_shift(shift);
        let outcome = solve(body)?;
        iterations += outcome.iterations;
        if !outcome.broken(body.max_iterations()) || shift >= LARGEST_SHIFT {
            return Ok((iterations, shift));
        }
        shift = if shift == 0.0 { first } else { 10.0 * shift };
        body.count_indefinite();
    }
}

/// Trial point of the line search: potential, its rounding error, residual norm, predicted decrease.
#[derive(Clone, Copy, Debug)]
pub(super) struct TrialPoint {
    /// Π, J.
    pub potential: f64,
    /// Rounding error of Π, J.
    pub noise: f64,
    /// |∇Π|, N.
    pub residual_norm: f64,
    /// Predicted decrease `−∇Π·e` for a full step, at the point before, J.
    pub predicted_decrease: f64,
}

/// Body in the line search: has a current point and a direction, and evaluates trial points along it.
pub(super) trait Descent {
    /// Evaluates the trial point at a step length; `None` if a cell is inverted. The first call, without a direction, is the start of the
    /// step.
    fn trial(&mut self, step_length: f64) -> Result<Option<TrialPoint>>;
    /// Makes the last trial point the current one.
    fn accept(&mut self);
    /// Computes the Newton direction, solved to this residual, N; `shift` is the first factor of `K₀` for an indefinite tangent. Returns
    /// the iterations and the factor used.
    fn direction(&mut self, residual: f64, shift: f64) -> Result<(u32, f64)>;
    /// Norm of the step's load, N; known after the first trial point.
    fn load(&self) -> f64;
    /// Relative rounding of its numbers, and the norm below which their squares underflow.
    fn rounding(&self) -> [f64; 2];
    /// Nodes on prescribed paths have increments at the first trial point.
    fn driven(&self) -> bool;
    /// Error that names the cell inverted at the start of the step.
    fn inverted_at_start(&self) -> Error;
}

/// Iterates until the residual is `tolerance` times the load, or `floor`, N. Returns the outcome with the iterations of all inner solves,
/// and the number of Newton iterations.
pub(super) fn newton(body: &mut impl Descent, tolerance: f64, floor: f64) -> Result<(Outcome, u32)> {
    let Some(mut current) = body.trial(0.0)? else {
        return Err(body.inverted_at_start());
    };
    body.accept();
    let first = current.residual_norm;
    // what paths drive is part of the load
    let load = if body.driven() { body.load().max(first) } else { body.load() };
    let target = (tolerance * load).max(floor);
    let [rounding, underflow] = body.rounding();
    let rounded = ROUNDED * (rounding * load).max(underflow);
    let (mut iterations, mut newton_iterations, mut shift, mut stalled) = (0, 0, FIRST_SHIFT, 0);
    while current.residual_norm > target && newton_iterations < MAX_ITERATIONS && stalled < STALLED {
        newton_iterations += 1;
        let residual = (FORCING * current.residual_norm * (current.residual_norm / first).min(1.0)).max(0.1 * target);
        let (inner, added) = body.direction(residual, shift)?;
        iterations += inner;
        shift = if added > 0.0 { (SHIFT_REDUCTION * added).max(SMALLEST_SHIFT) } else { shift };
        let Some(next) = search(body, &current)? else {
            break; // only rounding error is left
        };
        body.accept();
        let stalls = next.residual_norm <= rounded && next.residual_norm > 0.5 * current.residual_norm;
        stalled = if stalls { stalled + 1 } else { 0 };
        current = next;
    }
    Ok((
        Outcome { iterations, converged: current.residual_norm <= target, residual: current.residual_norm, target },
        newton_iterations,
    ))
}

/// Backtracking line search; `None` if no step length is accepted.
fn search(body: &mut impl Descent, current: &TrialPoint) -> Result<Option<TrialPoint>> {
    let mut step_length = 1.0;
    for _ in 0..HALVINGS {
        if let Some(next) = body.trial(step_length)? {
            let predicted = step_length * next.predicted_decrease;
            let sufficient = next.potential <= current.potential - SUFFICIENT_DECREASE * predicted;
            // close to the solution the decrease is below the rounding error of the potential; the residual still shows progress
            let below_noise = predicted < next.noise && next.residual_norm < current.residual_norm;
            let halved = step_length == 1.0 && next.residual_norm < 0.5 * current.residual_norm;
            if predicted > 0.0 && (sufficient || halved || below_noise) {
                return Ok(Some(next));
            }
        }
        step_length *= 0.5;
    }
    Ok(None)
}
