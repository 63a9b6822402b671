//! Steps that are solved in full ([`Scene::in_full`](crate::scene::Scene::in_full)): again with the defect of their linearisation
//! ([`crate::kernels::defect`]) under the contact forces so far, until law and contact hold together.
//!
//! Follower pressures act on the shape at the end of such a step: on that by its solves so far, until they change nothing.
//!
//! Matrix, columns and the model of the compliance stay those of the step's start, so a repetition costs a force evaluation, a product and the
//! iterations that the defect takes: a modified Newton method. It converges while tangents change by less than a factor of two within the step.

use super::{Simulation, StepReport};
use crate::error::Result;
use crate::linear::Outcome;
use std::time::{Duration, Instant};

/// Most times that the defect of a step is evaluated; 2 to 4 are usual, 8 where a sphere pressed deep is slid.
const MOST: u32 = 12;
/// Warning of a step that has not converged in full.
pub(super) const NOT_IN_FULL: &str = "newton_not_converged";

/// How a step goes on after a solve of its motion and contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Next {
    /// It ends.
    End,
    /// Again, with the defect at the increment so far in the right-hand sides.
    Again,
    /// From its start, as a linearised step.
    Linearised,
}

/// Replaces the outcomes of solves by those of later ones, with the iterations of both; whether these have changed a solution.
pub(super) fn add_up(ended: &mut [Outcome], later: &[Outcome]) -> bool {
    for (sum, later) in ended.iter_mut().zip(later) {
        *sum = Outcome { iterations: sum.iterations + later.iterations, ..*later };
    }
    later.iter().any(|e| e.iterations > 0)
}

impl Simulation {
    /// Prepares the bodies for what comes next. A step that is solved in full ends where the last solve and its contact, which took `longest`,
    /// have not `changed` the increment, or when it is due. If [`MOST`] evaluations did not suffice or the increment is non-finite, it is solved
    /// as a linearised step, and counted: an increment that does not converge may be worse. `corrected`: the increment has a correction.
    pub(super) fn next(
        &mut self,
        changed: bool,
        corrected: bool,
        longest: Duration,
        report: &mut StepReport,
    ) -> Result<Next> {
        let so_far = report.newton_iterations;
        let non_finite = self.bodies.iter().any(|body| body.non_finite);
        let due = self.deadline.excludes_pass(Instant::now(), longest);
        let goes_on = changed || non_finite || so_far == 0;
        if !self.scene.in_full() || due || report.warnings.contains_key(NOT_IN_FULL) || !goes_on {
            return Ok(Next::End);
        }
        let linearised = so_far == MOST || non_finite && so_far > 0;
        if linearised {
            report.warn(NOT_IN_FULL, 1);
        } else {
            report.newton_iterations += 1;
        }
        let begin = self.loaded_at();
        for body in self.bodies.iter_mut().filter(|body| body.in_full) {
            if linearised {
                body.restart(&self.scene, [begin, self.time])?;
            } else {
                body.press(&self.scene, begin, Some(corrected))?;
                body.backend.add_defect(corrected)?;
            }
        }
        Ok(if linearised { Next::Linearised } else { Next::Again })
    }
}
