//! Iterative refinement: the residual that f32 leaves in a step's equations is computed in f64 on the host and solved for again.
//!
//! `r = b + Jᵀλ − A Δx` in f64 with `Δx` kept in f64, `A e = r` in the backend's precision, `Δx += e`, until `|r|` is below the solver's
//! tolerance times the step's load. The recurrence of f32 conjugate gradients keeps falling when the true residual does not; here every
//! round starts from the true one. The backend then keeps `Δx`, rounded once.
//! Source: Wilkinson 1963; Higham 2002, chapter 12 (mixed precision).

use super::Body;
use crate::backend::{CORRECTION, FREE, SolveRequest, Target, Vector};
use crate::bodies::{Solved, residual};
use crate::error::Result;
use crate::linear::Outcome;
use crate::math::norm;
use crate::scene::Solver;
use crate::step::StepReport;

/// Least relative residual asked of a round: on the hardest scenes the true residual of f32 follows its recurrence down to here.
const MIN_REDUCTION: f64 = 1e-3;

impl Body {
    /// Improves the solution of the unconstrained motion in up to the scene's number of rounds; `solved.dx` becomes the whole step's
    /// increment, `free` the outcome.
    pub(super) fn refine(
        &mut self,
        solved: &mut Solved,
        solver: &Solver,
        corrected: bool,
        free: &mut Outcome,
        report: &mut StepReport,
    ) -> Result<()> {
        let (mut residual_force, load) = residual(&self.model, solved);
        let target_norm = (solver.tolerance * load).max(solver.floor);
        let mut residual_norm = norm(&residual_force);
        for _ in 0..solver.refinements {
            if residual_norm <= target_norm {
                break;
            }
            self.backend.set_vector(Vector::RightHandSide, FREE, &residual_force)?;
            self.backend.reset_initial_guess(&[FREE])?;
            let target = Target::Absolute((0.5 * target_norm).max(MIN_REDUCTION * residual_norm));
            let (outcome, _) = self.backend.solve(&[SolveRequest { rhs: FREE, target }], &[])?;
            let before = solved.dx.clone();
            add(&mut solved.dx, &self.backend.solution(FREE)?, 1.0);
            free.iterations += outcome[0].iterations;
            // accept the round only if the true residual falls
            residual_force = residual(&self.model, solved).0;
            let left = norm(&residual_force);
            if left >= residual_norm {
                solved.dx = before; // only rounding is left
                break;
            }
            residual_norm = left;
            report.refinements += 1;
        }
        (free.residual, free.target, free.converged) = (residual_norm, target_norm, residual_norm <= target_norm);
        // hand the refined increment back, without the correction
        let mut alone = solved.dx.clone();
        if corrected {
            add(&mut alone, &self.backend.solution(CORRECTION)?, -1.0);
        }
        self.backend.set_vector(Vector::Solution, FREE, &alone)
    }
}

/// `sum += factor · term`; the fourth components stay.
pub(super) fn add(sum: &mut [[f64; 4]], term: &[[f64; 4]], factor: f64) {
    for (sum, term) in sum.iter_mut().zip(term) {
        for n in 0..3 {
            sum[n] += factor * term[n];
        }
    }
}
