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

use super::Problem;
use crate::constraints::{self, Effort, Enough, Law, Residual, solve};
use crate::error::Result;
use crate::scene::Correction;
use crate::step::rows::energy;
use crate::step::{Simulation, StepReport};
use glam::DVec3;

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

/// A pass that changes the forces by less than one part in [`FINE`] has its correction solved to that much less than the tolerance, to
/// [`FINEST`] of it at least: what a small change does shows only so.
const FINE: f64 = 10.0;
const FINEST: f64 = 0.1;

/// Share of what a row gives by the columns that an update leaves it.
const LEFT: f64 = 1e-2;

fn norm(a: &[f64]) -> f64 {
    a.iter().map(|a| a * a).sum::<f64>().sqrt()
}

fn less(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

/// What a change of the forces has shown of the compliance.
pub(super) struct Seen {
    /// `[row]` N
    s: Vec<f64>,
    /// `[row]` change of the true violations, m.
    y: Vec<f64>,
    /// What the corrections' residuals may have put into it, m.
    noise: f64,
}

/// A pass of the contact solve.
struct Pass {
    /// `[row]` N
    lambda: Vec<f64>,
    /// `[contact]` slips of the step under them, by the whole body's correction, m.
    slips: Vec<DVec3>,
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
    /// rank one (SR1; Broyden 1967), or of rank two (PSB; Powell 1970) where the first would be large or leave a row no compliance. So passes
    /// are a quasi-Newton method, and columns may be loose and old. What is within the corrections' residuals shows nothing: taken for
    /// compliance, it sent passes around in circles, and 7 of 100 cuts right through used them up.
    fn learn(&mut self) {
        self.w.clone_from(&self.columns);
        if self.law.correction != Correction::Exact {
            return;
        }
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        for Seen { s, y, noise } in &self.seen {
            let rows = s.len();
            let off: Vec<f64> = y.iter().zip(self.w.chunks_exact(rows)).map(|(y, line)| y - dot(line, s)).collect();
            let (along, size) = (dot(&off, s), (dot(&off, &off) * dot(s, s)).sqrt());
            if !size.is_normal() || dot(&off, &off) <= noise * noise {
                continue;
            }
            let squared = dot(s, s);
            let one = |i: usize, j: usize| off[i] * off[j] / along;
            let two = |i: usize, j: usize| (off[i] * s[j] + s[i] * off[j] - along / squared * s[i] * s[j]) / squared;
            // a row that gives nothing, or pushes back, could bear no force
            let least = |i: usize| LEFT * self.columns[i * (rows + 1)];
            let gives = |more: &dyn Fn(usize, usize) -> f64| {
                (0..rows).all(|i| more(i, i) >= 0.0 || self.w[i * (rows + 1)] + more(i, i) > least(i))
            };
            let more: &dyn Fn(usize, usize) -> f64 = match along.abs() > STEEP * size {
                true if gives(&one) => &one,
                _ if gives(&two) => &two,
                _ => continue,
            };
            for i in 0..rows {
                for j in 0..rows {
                    self.w[i * rows + j] += more(i, j);
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
        let ends = |lambda: &mut [f64]| {
            let ended = solve(&self.laws, &self.w, without_force, lambda, &effort);
            (ended.converged || self.enough(1.0).holds(&ended.residual, lambda), ended.residual.energy)
        };
        let (solved, left) = ends(lambda);
        // an edge's law is not convex: what the last step's forces do not lead to, none may
        let mut other = vec![0.0; lambda.len()];
        if !solved && lambda.iter().any(|l| *l != 0.0) {
            let (solved, less) = ends(&mut other);
            if solved || less < left {
                lambda.copy_from_slice(&other);
            }
            return solved;
        }
        solved
    }

    /// A pass that ended with `slips` under `lambda`, and the forces that the laws ask for there by the model `W`.
    fn evaluate(&self, lambda: Vec<f64>, slips: Vec<DVec3>) -> Pass {
        let without_force = self.without_force(&self.rows.violations(&slips), &lambda);
        let mut next = lambda.clone();
        let solved = self.solve(&without_force, &mut next);
        let change = less(&next, &lambda);
        let total = energy(&self.w, &lambda);
        let negligible = change.iter().all(|c| c.abs() <= self.law.tolerance * self.load);
        let size = if total > 0.0 && !negligible { (energy(&self.w, &change) / total).sqrt() } else { 0.0 };
        let residual = constraints::residual(&self.laws, &self.w, &without_force, &lambda);
        Pass { lambda, slips, next, size, solved, residual }
    }
}

impl Simulation {
    /// Forces, correction, passes: until one more would change the forces by less than the tolerance. Where passes are used up, the best of
    /// them counts. Returns its forces and the slips under them.
    pub(super) fn iterate(
        &mut self,
        problem: &mut Problem,
        mut lambda: Vec<f64>,
        report: &mut StepReport,
    ) -> Result<(Vec<f64>, Vec<DVec3>)> {
        let law = problem.law;
        let mut tied = problem.laws.iter().any(Law::is_constraint);
        problem.solve(&problem.violation, &mut lambda);
        let mut last = (vec![0.0; lambda.len()], problem.violation.clone(), 0.0);
        let mut best: Option<Pass> = None;
        let mut before = f64::INFINITY;
        let pass = loop {
            report.contact.passes += 1;
            // correction by the whole bodies, as fine as the change of the forces asks for
            let s = less(&lambda, &last.0);
            let change = norm(&s) / norm(&lambda).max(f64::MIN_POSITIVE);
            let share = law.tolerance * (FINE * change).clamp(FINEST, 1.0);
            let moved = self.correct(problem, &lambda, share, report)?;
            let slips = problem.slips_after(&lambda, &moved);
            let found = problem.rows.violations(&slips);
            // what it has shown of the compliance
            let noise = (share + last.2) * norm(&less(&found, &problem.violation));
            problem.seen.push(Seen { s, y: less(&found, &last.1), noise });
            last = (lambda.clone(), found, share);
            problem.learn();
            // forces that the laws ask for there
            let mut pass = problem.evaluate(lambda, slips);
            if !pass.solved {
                // what was seen from pass to pass need not be a compliance together
                problem.seen.clear();
                problem.learn();
                pass = problem.evaluate(pass.lambda, pass.slips);
            }
            // aged columns are solved anew where passes close in slowly
            let slow = pass.size > SLOW * before;
            if (pass.size > law.tolerance && slow || !pass.solved) && self.renew(problem, &pass.lambda, report)? {
                pass = problem.evaluate(pass.lambda, pass.slips);
            }
            before = pass.size;
            // the end: nothing more to change, or nothing that can be felt
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
            // used up: the best pass counts
            if let Some(best) = best.take_if(|_| report.contact.passes >= law.max_passes) {
                report.warn(
                    "contact_passes_exhausted",
                    u32::from(!problem.enough(1.0).holds(&best.residual, &best.lambda)),
                );
                // the backends hold the correction of the last pass
                self.correct(problem, &best.lambda, law.tolerance, report)?;
                break best;
            }
        };
        let felt = !problem.enough(1.0).holds(&pass.residual, &pass.lambda);
        report.warn("contact_not_converged", u32::from(!pass.solved && felt));
        report.warn("contact_rows_dropped", pass.residual.dropped);
        report.contact.residual = pass.size;
        (report.contact.residual_n, report.contact.residual_m) = (pass.residual.force, pass.residual.gap);
        Ok((pass.lambda, pass.slips))
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
