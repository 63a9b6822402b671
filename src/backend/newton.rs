//! Newton's method for a step of a law that is not linear, on any backend.
//!
//! A step is the least of `Π(Δx) = ½ Δx·(inertia M + (r_K/h) K₀) Δx + σ (W(u + Δx) − f(u)·Δx) − b·Δx`, `σ` the integrator's share of the end
//! (1, or ½ for Newmark), `K₀` the small-strain bricks turned with the cells, which Rayleigh's damping and the preconditioner take. Newton:
//! `(inertia M + (r_K/h) K₀ + σ K_T) e = −∇Π`, solved by the conjugate gradients to a share of the residual that falls with it, so that
//! convergence stays quadratic; then `Δx += t e`, `t` halved until `Π` falls enough (Armijo) and no cell is inside out. Where the
//! gradients break down the tangent is not positive: `K₀` is added to it, ten times more each time, until they end (counted); what sufficed
//! says what is tried first at the next iteration (Levenberg 1944, Marquardt 1963).
//! Source: Nocedal, Wright 2006, chapters 3 and 7 (line search, inexact Newton); Eisenstat, Walker 1996 (the falling share).

use crate::error::{Error, Result};
use crate::linear::Outcome;

/// Newton iterations of a step at most; 3 to 10 are usual, a bar that buckles by half its length takes 46.
const MOST: u32 = 100;
/// Largest share of its residual that an iteration's solve leaves: less costs more inside, more costs more iterations.
const SHARE: f64 = 0.1;
/// Armijo's share of the promised fall.
const FALL: f64 = 1e-4;
/// Halvings of a step at most: 10⁻⁹ of it.
const HALVINGS: u32 = 30;
/// First share of `K₀` that is added to a tangent that is not positive; ten times more is tried each time, up to the last.
pub(super) const SHIFT: f64 = 0.1;
/// See [`SHIFT`].
const LAST: f64 = 1e3;
/// Least share that is tried first.
const LEAST: f64 = 1e-4;
/// Where a share has sufficed, this part of it is tried first at the next iteration: with a share that is larger than it must be, an
/// iteration goes hardly further than one along the gradient.
const LESS: f64 = 0.25;

/// A body whose tangent may be raised.
pub(super) trait Raised {
    /// Adds this share of `K₀` to its tangent from now on, in place of what was added before.
    fn set_shift(&mut self, shift: f64);
    /// Counts a tangent that was not positive.
    fn count_indefinite(&mut self);
    /// Iterations that a solve may take.
    fn max_iterations(&self) -> u32;
}

/// Solves with more and more of `K₀` in the tangent, `first` of it to begin with, until the gradients end. `solve` is told how often it was
/// asked before; returns what it found in the end, the iterations of all, and the share that was added.
pub(super) fn positive<B: Raised, T>(
    body: &mut B,
    first: f64,
    mut solve: impl FnMut(&mut B, u32) -> Result<(Outcome, T)>,
) -> Result<(T, u32, f64)> {
    let (mut shift, mut spent) = (0.0, 0);
    body.set_shift(shift);
    for attempt in 0.. {
        let (outcome, found) = solve(body, attempt)?;
        spent += outcome.iterations;
        if !outcome.broken(body.max_iterations()) || shift >= LAST {
            return Ok((found, spent, shift));
        }
        shift = if shift == 0.0 { first } else { 10.0 * shift };
        body.set_shift(shift);
        body.count_indefinite();
    }
    unreachable!("the last share returns")
}

/// What a place is worth.
#[derive(Clone, Copy, Debug)]
pub(super) struct Attempt {
    /// Π, J.
    pub potential: f64,
    /// What rounding may have made of it, J.
    pub noise: f64,
    /// |∇Π|, N.
    pub size: f64,
    /// `−∇Π·e` at the place before, for the direction `e` to this one, J.
    pub promise: f64,
}

/// A body on its way to a step's solution: it stands at one place, has a direction, and tries others along it.
pub(super) trait Descent {
    /// Tries the place at a share of the direction; `None` where a cell is inside out. At first there is no direction, and the place is the
    /// step's start.
    fn attempt(&mut self, share: f64) -> Result<Option<Attempt>>;
    /// Stands at the place that was tried last.
    fn take(&mut self);
    /// Solves for the direction from there until this residual is left, N; `shift` is what to add first to a tangent that is not positive.
    /// Returns the iterations, and what was added in the end.
    fn direction(&mut self, residual: f64, shift: f64) -> Result<(u32, f64)>;
    /// Norm of the step's load, N; known once a place was tried.
    fn load(&self) -> f64;
    /// Names the cell that is inside out at the step's start.
    fn inside_out(&self) -> Error;
}

/// Goes on until the residual is `tolerance` of the load, or `floor`, N. Returns how it ended, with the iterations of all solves, and the
/// number of Newton's own.
pub(super) fn newton(body: &mut impl Descent, tolerance: f64, floor: f64) -> Result<(Outcome, u32)> {
    let Some(mut here) = body.attempt(0.0)? else {
        return Err(body.inside_out());
    };
    body.take();
    let target = (tolerance * body.load()).max(floor);
    let first = here.size;
    let (mut iterations, mut own, mut shift) = (0, 0, SHIFT);
    while here.size > target && own < MOST {
        own += 1;
        let wanted = (SHARE * here.size * (here.size / first).min(1.0)).max(0.1 * target);
        let (spent, added) = body.direction(wanted, shift)?;
        iterations += spent;
        shift = if added > 0.0 { (LESS * added).max(LEAST) } else { shift };
        let Some(next) = search(body, &here)? else {
            break; // what is left is rounding
        };
        body.take();
        here = next;
    }
    Ok((Outcome { iterations, converged: here.size <= target, residual: here.size, target }, own))
}

/// The first of the halved steps that lets the potential fall; `None` where none does.
fn search(body: &mut impl Descent, here: &Attempt) -> Result<Option<Attempt>> {
    let mut share = 1.0;
    for _ in 0..HALVINGS {
        if let Some(next) = body.attempt(share)? {
            let promised = share * next.promise;
            let falls = next.potential <= here.potential - FALL * promised;
            // near the end a fall is below the potential's rounding, and the residual still tells
            let unseen = promised < next.noise && next.size < here.size;
            let closer = share == 1.0 && next.size < 0.5 * here.size;
            if promised > 0.0 && (falls || closer || unseen) {
                return Ok(Some(next));
            }
        }
        share *= 0.5;
    }
    Ok(None)
}
