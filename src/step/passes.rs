//! The passes of the contact solve: forces by a model of the compliance, the whole body's correction, forces again from its violations.
//!
//! The model `W` comes from columns that are loose and of earlier steps; where passes end, the laws hold on the true violations `δ(λ)`,
//! whatever `W` is. `δ` is linear in `λ` within a step, so each pass shows the true compliance along one change of the forces, and
//! `W` takes that over: the passes are a quasi-Newton method. Where they still close in slowly, a batch of columns is solved anew.
//!
//! A pass is the last one where one more would change the forces by less than the scene's tolerance; where passes close in slowly or are
//! used up, the best of them will do if what it leaves cannot be felt, and is told as a warning otherwise. Time is bounded: row updates
//! of a solve, passes, and columns of a pass.
//!
//! Perturbed `incision_shapes` on 14 × 14 cells: 3.0 passes, 8 at most, longest step 24 times the median; with all columns solved anew
//! where a pass is slow 2.7, 7 and 70; so and without a budget of row updates 2.9, 7 and 1150.

use super::contact::Problem;
use super::rows::energy;
use super::{Simulation, StepReport};
use crate::constraints::{self, Effort, Enough, Law, Residual, solve};
use crate::error::Result;
use crate::scene::Correction;

/// Row updates of a contact solve at most, which bounds a step's time: 4 ms of 36 rows and 50 ms of 192 on one core. 99 % of the solves of
/// perturbed incisions take less than 65,000, 64 points with friction on 25 nodes 250,000; with 50,000 a third of three crossing cuts leave
/// what can be felt in a pass.
const ROW_UPDATES: u64 = 400_000;
/// Relative residual that ends a contact solve at once; with 1e-5, two kilograms on a gram jump by 3 % of their weight.
const WANTED: f64 = 1e-8;
/// Share of the passes' tolerance that is enough for a contact solve.
const WITHIN: f64 = 0.1;
/// Gap that comes to the force of a press, 0.3 N, in the hand's spring, 3000 N/m; in m. A tolerance is also a share of it: at 1e-3 what a
/// pass leaves may be 0.1 µm, 0.3 mN, a hundredth of the least change of such a force that fingers tell (7 %, Pang, Tan, Durlach 1991).
const PRESS: f64 = 1e-4;

/// A pass that leaves more than this share of the last one's residual shows that the compliance has aged too much.
const SLOW: f64 = 0.5;

/// Cosine between a change of the forces and what `W` has wrong there, above which the update of rank one is safe: it is as large as what
/// is wrong over the cosine.
const STEEP: f64 = 0.1;

fn less(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

/// A pass of the contact solve.
struct Pass {
    /// `[row]` N
    lambda: Vec<f64>,
    /// `[row]` violations under them, by the whole body's correction, m.
    found: Vec<f64>,
    /// `[row]` forces that one more pass would take, N.
    next: Vec<f64>,
    /// Relative change to them, in the energy's norm: redundant contacts may share a force in many ways, which means nothing. 0 where it
    /// is a negligible share of the step's load.
    size: f64,
    /// Whether they could be found.
    solved: bool,
    /// What `lambda` leaves of the laws on the true violations.
    residual: Residual,
}

impl Problem<'_> {
    /// Violations without force, by the model `W`, of those `found` under `lambda`.
    fn without_force(&self, found: &[f64], lambda: &[f64]) -> Vec<f64> {
        let product = |line: &[f64]| line.iter().zip(lambda).map(|(w, l)| w * l).sum::<f64>();
        found.iter().zip(self.w.chunks_exact(lambda.len())).map(|(f, line)| f - product(line)).collect()
    }

    /// Has `W` agree with what was seen: `y = W s` for each change `s` of the forces and `y` of the true violations, by symmetric updates of
    /// rank one (SR1; Broyden 1967), or of rank two (PSB; Powell 1970) where the first would be large. So passes are a quasi-Newton
    /// method, and columns may be loose and old.
    fn learn(&mut self) {
        let noise = self.law.tolerance; // the correction is solved to no more of it
        self.w.clone_from(&self.columns);
        if self.law.correction != Correction::Exact {
            return;
        }
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        for (s, y) in &self.seen {
            let rows = s.len();
            let off: Vec<f64> = y.iter().zip(self.w.chunks_exact(rows)).map(|(y, line)| y - dot(line, s)).collect();
            let (along, size) = (dot(&off, s), (dot(&off, &off) * dot(s, s)).sqrt());
            if !size.is_normal() || dot(&off, &off) <= noise * noise * dot(y, y) {
                continue;
            }
            let steep = along.abs() > STEEP * size;
            let squared = dot(s, s);
            for i in 0..rows {
                for j in 0..rows {
                    self.w[i * rows + j] += match steep {
                        true => off[i] * off[j] / along,
                        false => (off[i] * s[j] + s[i] * off[j] - along / squared * s[i] * s[j]) / squared,
                    };
                }
            }
        }
    }

    /// What is too little to be felt, for a share of the tolerance.
    fn enough(&self, share: f64) -> Enough {
        let share = share * self.law.tolerance;
        Enough { share, gap: share * PRESS }
    }

    /// Solves for forces that hold the laws by the model `W`.
    fn solve(&self, without_force: &[f64], lambda: &mut [f64]) -> bool {
        let effort = Effort { wanted: WANTED, enough: self.enough(WITHIN), updates: ROW_UPDATES };
        let ended = solve(&self.laws, &self.w, without_force, lambda, &effort);
        ended.converged || self.enough(1.0).holds(&ended.residual, lambda)
    }

    /// A pass that ended with violations `found` under `lambda`, and the forces that the laws ask for there by the model `W`.
    fn judge(&self, lambda: Vec<f64>, found: Vec<f64>) -> Pass {
        let without_force = self.without_force(&found, &lambda);
        let mut next = lambda.clone();
        let solved = self.solve(&without_force, &mut next);
        let change = less(&next, &lambda);
        let total = energy(&self.w, &lambda);
        let negligible = change.iter().all(|c| c.abs() <= self.law.tolerance * self.load);
        let size = if total > 0.0 && !negligible { (energy(&self.w, &change) / total).sqrt() } else { 0.0 };
        let residual = constraints::residual(&self.laws, &self.w, &without_force, &lambda);
        Pass { lambda, found, next, size, solved, residual }
    }
}

impl Simulation {
    /// Forces, correction, passes: until one more would change the forces by less than the tolerance. Where passes are used up, the best of
    /// them counts. Returns its forces and the violations under them.
    pub(super) fn close(
        &mut self,
        problem: &mut Problem,
        mut lambda: Vec<f64>,
        report: &mut StepReport,
    ) -> Result<(Vec<f64>, Vec<f64>)> {
        let law = problem.law;
        let mut tied = problem.laws.iter().any(|law| matches!(law, Law::Hold { .. }));
        problem.solve(&problem.violation, &mut lambda);
        let mut last = (vec![0.0; lambda.len()], problem.violation.clone());
        let mut best: Option<Pass> = None;
        let mut before = f64::INFINITY;
        let pass = loop {
            report.contact.passes += 1;
            let moved = self.correct(problem, &lambda, report)?;
            let found = problem.after(&lambda, &moved);
            // changes below the tolerance show how well the correction is solved, not the compliance
            if before > law.tolerance {
                problem.seen.push((less(&lambda, &last.0), less(&found, &last.1)));
            }
            last = (lambda.clone(), found.clone());
            problem.learn();
            let mut pass = problem.judge(lambda, found);
            if !pass.solved {
                // what was seen from pass to pass need not be a compliance together
                problem.seen.clear();
                problem.learn();
                pass = problem.judge(pass.lambda, pass.found);
            }
            let slow = pass.size > SLOW * before;
            if pass.size > law.tolerance && (slow || !pass.solved) && self.renew(problem, &pass.lambda, report)? {
                pass = problem.judge(pass.lambda, pass.found);
            }
            before = pass.size;
            let felt = !problem.enough(1.0).holds(&pass.residual, &pass.lambda);
            // one pass more for what is tied: its gap is what the changes of the forces leave, and nothing else closes it
            let closed = pass.size <= law.tolerance && !std::mem::take(&mut tied);
            if closed || (slow && !felt) || law.correction != Correction::Exact {
                break pass;
            }
            lambda = pass.next.clone();
            if best.as_ref().is_none_or(|best| pass.residual.energy < best.residual.energy) {
                best = Some(pass);
            }
            if let Some(best) = best.take_if(|_| report.contact.passes >= law.max_passes) {
                report.warn(
                    "contact_passes_exhausted",
                    u32::from(!problem.enough(1.0).holds(&best.residual, &best.lambda)),
                );
                // the backends hold the correction of the last pass
                self.correct(problem, &best.lambda, report)?;
                break best;
            }
        };
        let felt = !problem.enough(1.0).holds(&pass.residual, &pass.lambda);
        report.warn("contact_not_converged", u32::from(!pass.solved && felt));
        report.warn("contact_rows_dropped", pass.residual.dropped);
        report.contact.residual = pass.size;
        (report.contact.residual_n, report.contact.residual_m) = (pass.residual.force, pass.residual.gap);
        Ok((pass.lambda, pass.found))
    }

    /// Solves a batch of each body's columns of earlier steps anew; false where there are none.
    fn renew(&mut self, problem: &mut Problem, lambda: &[f64], report: &mut StepReport) -> Result<bool> {
        if problem.law.correction != Correction::Exact {
            return Ok(false);
        }
        let mut renewed = false;
        for (number, body) in self.bodies.iter_mut().enumerate() {
            let forces = problem.rows.on_nodes(number, lambda);
            let tolerance = problem.law.column_tolerance * body.looseness;
            renewed |= body.compliance.renew(body.backend.as_mut(), &forces, tolerance, report)?;
        }
        if renewed {
            problem.columns = self.compliance_of(problem);
            problem.learn();
        }
        Ok(renewed)
    }
}
