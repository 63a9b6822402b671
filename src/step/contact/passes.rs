//! Passes of the contact solve: forces by the model `W` of the compliance, correction of the whole bodies, new violations, forces again.
//!
//! `W` comes from columns that are solved loosely, some in earlier steps. When the passes end, the laws hold on the true violations `δ(λ)`,
//! whatever `W` is. Within a step `δ` is linear in `λ`, so each pass observes the true compliance along one change of the forces and `W` is
//! updated to match: a quasi-Newton method. Where convergence is slow all the same, a batch of columns is solved anew.
//!
//! Passes end when one more would change the forces by less than the scene's tolerance, or when they converge slowly and the residual is
//! too small to be felt. Where they are used up the best one is taken, with a warning if its residual can be felt. Time is bounded by the
//! row updates of a solve, the number of passes and the columns of a pass. By the wall clock a step that is due takes no further pass and no
//! columns ([`Simulation::finish_by`]); the best pass so far holds, and what it leaves is reported.
//!
//! Measured on perturbed `incision_shapes`, 14 × 14 cells: 3.0 passes, 8 at most, longest step 24 times the median. With all columns solved
//! anew in a slow pass: 2.7, 7 and 70; the same without a budget of row updates: 2.9, 7 and 1150.

use super::Problem;
use crate::constraints::{self, Effort, LooseTolerance, Residual, solve};
use crate::error::Result;
use crate::math::inner_product;
use crate::scene::Correction;
use crate::step::body::{Body, RestShape};
use crate::step::rows::energy;
use crate::step::{Costs, Part, Simulation, StepReport};
use glam::DVec3;
use std::time::{Duration, Instant};

/// Most row updates of a contact solve with up to [`ROWS`] rows, which bounds a step's time: 4 ms for 36 rows and 50 ms for 192 on one core.
/// 99 % of the solves of incision_shapes.toml take less than 7,300, the hardest of perturbed ones 400,000, 64 points with friction on 25
/// nodes 250,000.
const ROW_UPDATES: u64 = 400_000;
/// Most row updates of a step's solves, twice that of one. Beyond them each try of one has [`UPDATES_WITH_MARGIN`].
const STEP_UPDATES: u64 = 2 * ROW_UPDATES;
/// Row updates after which what cannot be felt is accepted without a margin ([`INNER_SHARE`]). One step of incision.toml spent 1,250,000, 19 of
/// its 25 ms, on three solves that went from 12 nm towards 10.
const UPDATES_WITH_MARGIN: u64 = 65_000;
/// Most row updates of the prediction before the passes.
const PREDICTION_UPDATES: u64 = 50_000;
/// Most that predicted forces are of the last step's.
const RISE: f64 = 10.0;
/// Relative residual that ends a contact solve; with 1e-5, two kilograms resting on a gram jump by 3 % of their weight.
const TOLERANCE: f64 = 1e-8;
/// Share of the passes' tolerance that is sufficient for a contact solve, in its first [`UPDATES_WITH_MARGIN`] row updates.
const INNER_SHARE: f64 = 0.1;
/// Deflection of the hand's spring, 3000 N/m, under the force of a press, 0.3 N; in m. The tolerance is relative to it: at 1e-3 a pass may
/// leave 0.1 µm or 0.3 mN, about a hundredth of the just noticeable difference of such a force (7 %, Pang, Tan, Durlach 1991).
const PRESS: f64 = 1e-4;

/// Rows above which a solve gets as many multiplications as with this number, and so fewer row updates.
const ROWS: usize = 192;

/// Row updates of a budget, which is for up to [`ROWS`] rows, that a problem of some rows gets.
fn fitting(updates: u64, rows: usize) -> u64 {
    updates * ROWS as u64 / rows.max(ROWS) as u64
}

/// Share of the previous pass's residual above which a pass is slow: the compliance has aged too much.
const SLOW: f64 = 0.5;

/// Residual of a late step's last pass, in energy and relative to that of the best one, above which the best one is worth a correction more.
const FAR_BETTER: f64 = 4.0;

/// Residual of a pass, in energy and relative to that of the best one, above which the next correction starts from zero and not from its own, of
/// which rounding would leave nothing; and above which the passes end: a side of layered skin reached 10³⁴ N in ten. (A `W` that is a thousand
/// times too stiff takes one such pass; what it observes mends it.)
const FAR_WORSE: f64 = 1e4;
const RAN_AWAY: f64 = 1e12;

/// A pass that changes the forces by less than one part in [`FINE`] solves its correction to a proportionally smaller tolerance, at least
/// [`FINEST`] of it: a small change is visible only so.
const FINE: f64 = 10.0;
const FINEST: f64 = 0.1;

/// Share of the compliance along a change of the forces that an update leaves.
const LEFT: f64 = 0.1;
/// Share of a row's own compliance by the columns that the updates leave: without any, a row could bear no force.
const LEFT_OF_ROW: f64 = 1e-2;

/// Warnings of the passes: they were used up, their last solve has not converged, rows have no compliance.
const WARNINGS: [&str; 3] = ["contact_passes_exhausted", "contact_not_converged", "contact_rows_dropped"];

fn norm(a: &[f64]) -> f64 {
    inner_product(a, a).sqrt()
}

pub(super) fn less(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

/// Observation of the true compliance along one change of the forces.
pub(super) struct Observation {
    /// `[row]` change of the forces, N.
    s: Vec<f64>,
    /// `[row]` change of the true violations, m.
    y: Vec<f64>,
    /// Bound on the error of `y` by the corrections' residuals, m.
    noise: f64,
}

/// A pass of the contact solve.
struct Pass {
    /// `[row]` forces, N.
    lambda: Vec<f64>,
    /// `[contact]` slips of the step under `lambda`, by the correction of the whole bodies, m.
    slips: Vec<DVec3>,
    /// `[row]` forces of the next pass, N.
    next: Vec<f64>,
    /// Relative change from `lambda` to `next` in the energy norm, which ignores how redundant contacts share a force. 0 if the change is
    /// negligible against the step's load.
    relative_change: f64,
    /// The solve for `next` reached its tolerance.
    solved: bool,
    /// Residual of the laws at `lambda` on the true violations.
    residual: Residual,
}

impl Problem<'_> {
    /// Violations without force, by the model `W`, from those `found` under `lambda`.
    fn without_force(&self, found: &[f64], lambda: &[f64]) -> Vec<f64> {
        found.iter().zip(self.w.chunks_exact(lambda.len())).map(|(f, line)| f - inner_product(line, lambda)).collect()
    }

    /// Updates `W` to the observations, `y = W s` for each change `s` of the forces and `y` of the true violations, so that it stays
    /// positive definite (BFGS: Broyden, Fletcher, Goldfarb, Shanno 1970; damped where `y` would leave less than [`LEFT`] of the compliance
    /// along `s`, Powell 1978). Observations within the corrections' residuals are ignored: as updates they made passes cycle, and 7 of 100
    /// cuts right through used them all up.
    ///
    /// Updates of rank one (SR1), or two (PSB) where they would be large, take up to a tenth fewer passes in the mean and twice as many at
    /// most: passes (mean, most) of incision 1.8, 6 and 1.9, 6; of press_slide 2.2, 13 and 2.4, 5; of incision_shapes 2.1, 13 and 2.2, 9;
    /// columns a step of nodule.toml 2.3 and 0.4.
    fn update_compliance(&mut self) {
        self.w.clone_from(&self.columns);
        if self.law.correction != Correction::Exact {
            return;
        }
        for Observation { s, y, noise } in &self.observations {
            let rows = s.len();
            let modelled: Vec<f64> = self.w.chunks_exact(rows).map(|line| inner_product(line, s)).collect();
            let (of_model, found) = (inner_product(s, &modelled), inner_product(s, y));
            if !of_model.is_normal() || norm(&less(y, &modelled)) <= *noise {
                continue;
            }
            let share = if found < LEFT * of_model { (1.0 - LEFT) * of_model / (of_model - found) } else { 1.0 };
            let y: Vec<f64> = y.iter().zip(&modelled).map(|(y, m)| share * y + (1.0 - share) * m).collect();
            let found = inner_product(s, &y);
            for (i, line) in self.w.chunks_exact_mut(rows).enumerate() {
                let (a, b) = (y[i] / found, modelled[i] / of_model);
                line.iter_mut().zip(y.iter().zip(&modelled)).for_each(|(w, (y, m))| *w += a * y - b * m);
                line[i] = line[i].max(LEFT_OF_ROW * self.columns[i * (rows + 1)]);
            }
        }
    }

    /// Forgets the observations of the passes so far.
    pub(super) fn forget(&mut self) {
        self.observations.clear();
        self.update_compliance();
    }

    /// Relative change from the included forces that needs no correction: forces must not lag behind by the tolerance where nothing changes
    /// fast, and rigid bodies are corrected at no cost.
    fn enough_at_first(&self) -> f64 {
        if self.nodes.iter().all(Vec::is_empty) { 0.0 } else { FINEST * self.law.tolerance }
    }

    /// Residual too small to be felt, for a share of the tolerance.
    fn loose_tolerance(&self, share: f64) -> LooseTolerance {
        let share = share * self.law.tolerance;
        LooseTolerance { share, gap: share * PRESS }
    }

    /// Replaces the included forces by those that the model `W` predicts from the violations `found` under them, if they meet the laws within
    /// [`PREDICTION_UPDATES`], and on no body are more than [`RISE`] times those included: solves are as accurate as the load of their step's
    /// start requires, and a body at rest has none.
    pub(super) fn predict(&mut self, found: &[f64], costs: &mut Costs) {
        let clock = Instant::now();
        let updates = fitting(PREDICTION_UPDATES, self.included.len());
        let effort = Effort { tolerance: TOLERANCE, loose: self.loose_tolerance(INNER_SHARE), updates };
        let without_force = self.without_force(found, &self.included);
        let mut predicted = self.included.clone();
        let ended = solve(&self.laws, &self.w, &without_force, &mut predicted, &effort);
        costs.row_updates += ended.updates;
        let size = |body: usize, lambda: &[f64]| self.rows.norm_on_nodes(body, lambda);
        let rises = |body: usize| size(body, &predicted) > RISE * size(body, &self.included);
        if ended.converged && !(0..self.nodes.len()).any(rises) {
            self.included = predicted;
        }
        costs.spend(Part::Laws, clock);
    }

    /// Solves for the forces by the model `W`; true if what they leave cannot be felt. Counts the row updates.
    fn solve(&self, without_force: &[f64], lambda: &mut [f64], costs: &mut Costs) -> bool {
        let clock = Instant::now();
        let imperceptible = self.loose_tolerance(1.0);
        let [of_step, of_solve, with_margin] =
            [STEP_UPDATES, ROW_UPDATES, UPDATES_WITH_MARGIN].map(|updates| fitting(updates, lambda.len()));
        // whether a solve within a number of row updates met a tolerance or cannot be felt, what it left in energy, and its updates
        let mut within = |loose, updates: u64, lambda: &mut [f64]| {
            let updates = updates.min(of_step.saturating_sub(costs.row_updates).max(with_margin));
            let ended =
                solve(&self.laws, &self.w, without_force, lambda, &Effort { tolerance: TOLERANCE, loose, updates });
            costs.row_updates += ended.updates;
            let met = ended.converged || imperceptible.is_met(&ended.residual, lambda);
            (met, ended.residual.energy, ended.updates)
        };
        // with the margin, then without it from the forces that are left
        let mut ends = |lambda: &mut [f64]| {
            let (met, left, spent) = within(self.loose_tolerance(INNER_SHARE), with_margin, lambda);
            if met {
                return (met, left);
            }
            let (met, left, _) = within(imperceptible, of_solve.saturating_sub(spent), lambda);
            (met, left)
        };
        let (mut solved, left) = ends(lambda);
        // an edge's law is not monotone: where these forces lead to no solution, a start from zero may
        if !solved && lambda.iter().any(|l| *l != 0.0) {
            let mut other = vec![0.0; lambda.len()];
            let less;
            (solved, less) = ends(&mut other);
            if solved || less < left {
                lambda.copy_from_slice(&other);
            }
        }
        costs.spend(Part::Laws, clock);
        solved
    }

    /// Pass that ended with `slips` under `lambda`, and the forces of the next one by the model `W`; a change of at most `least` in each row, N,
    /// is negligible.
    fn evaluate(&self, lambda: Vec<f64>, slips: Vec<DVec3>, least: f64, costs: &mut Costs) -> Pass {
        let without_force = self.without_force(&self.rows.violations(&slips), &lambda);
        let mut next = lambda.clone();
        let solved = self.solve(&without_force, &mut next, costs);
        let change = less(&next, &lambda);
        let total = energy(&self.w, &lambda).max(energy(&self.w, &next));
        let negligible = change.iter().all(|c| c.abs() <= least);
        let relative_change = if total > 0.0 && !negligible { (energy(&self.w, &change) / total).sqrt() } else { 0.0 };
        let residual = constraints::residual(&self.laws, &self.w, &without_force, &lambda);
        Pass { lambda, slips, next, relative_change, solved, residual }
    }
}

impl Simulation {
    /// Runs passes until one more would change the forces by less than the tolerance; where they are used up, takes the best one. Returns
    /// its forces and slips. The solve of the unconstrained motion, with its included forces, is the first of them. Attachments take one pass
    /// more (`tied`): their gap is what the changes of the forces leave, and nothing else closes it.
    pub(super) fn iterate(
        &mut self,
        problem: &mut Problem,
        mut tied: bool,
        report: &mut StepReport,
    ) -> Result<(Vec<f64>, Vec<DVec3>)> {
        let law = problem.law;
        let earlier = report.contact.passes;
        // what the passes of an earlier repetition had left
        report.warnings.retain(|name, _| !WARNINGS.contains(name));
        // a first touch of little force is not negligible
        let mut least = 0.0;
        let slips = problem.slips_after(&problem.included, &[]);
        // forces, violations and the correction's tolerance of the pass before
        let mut last = (problem.included.clone(), problem.rows.violations(&slips), 0.0);
        let mut pass = problem.evaluate(last.0.clone(), slips, least, &mut report.costs);
        let mut best: Option<Pass> = None;
        let mut before = f64::INFINITY;
        let mut longest = Duration::ZERO; // of the passes so far
        let (mut late, mut exhausted) = (false, false);
        let pass = loop {
            if !pass.solved && !problem.observations.is_empty() {
                // the observations of several passes need not agree on one compliance
                problem.forget();
                pass = problem.evaluate(pass.lambda, pass.slips, least, &mut report.costs);
            }
            // solve aged columns anew where convergence is slow
            let slow = pass.relative_change > SLOW * before;
            if (pass.relative_change > law.tolerance && slow || !pass.solved)
                && !self.deadline.excludes_batch(Instant::now(), longest)
                && self.renew(problem, &pass.lambda, report)?
            {
                pass = problem.evaluate(pass.lambda, pass.slips, least, &mut report.costs);
            }
            before = pass.relative_change;
            // stop if the change is within the tolerance, or slow and too small to be felt
            let perceptible = !problem.loose_tolerance(1.0).is_met(&pass.residual, &pass.lambda);
            let passes = report.contact.passes - earlier;
            let enough = if report.contact.passes == 0 { problem.enough_at_first() } else { law.tolerance };
            let closed = pass.relative_change <= enough && !std::mem::take(&mut tied);
            let single = law.correction != Correction::Exact && passes == 1;
            if closed || (slow && !perceptible) || single {
                break pass;
            }
            // due: take the last pass, which the backends hold, unless another is far better
            late = passes > 0 && self.deadline.excludes_pass(Instant::now(), longest);
            let far_better = |best: &Pass| pass.residual.energy > FAR_BETTER * best.residual.energy;
            if late && !best.as_ref().is_some_and(far_better) {
                break pass;
            }
            let (lambda, left) = (pass.next.clone(), pass.residual.energy);
            let better = |best: &Pass| left < best.residual.energy || best.residual.energy.is_nan();
            if best.as_ref().is_none_or(better) {
                best = Some(pass);
            }
            // the backends hold the correction of the last pass, which the next one starts from
            let times_best = |best: &Pass| left / best.residual.energy.max(f64::MIN_POSITIVE);
            let worse = best.as_ref().map_or(1.0, times_best);
            if worse.is_nan() || worse > FAR_WORSE {
                self.bodies.iter_mut().try_for_each(Body::reset_correction)?;
            }
            // passes or time used up: take the best one
            let ran_away = worse.is_nan() || worse > RAN_AWAY;
            exhausted = !late && (passes >= law.max_passes || ran_away);
            if let Some(best) = best.take_if(|_| late || exhausted) {
                self.correct(problem, &best.lambda, law.tolerance, report)?;
                break best;
            }
            report.contact.passes += 1;
            let clock = Instant::now();
            // correct the whole bodies, as accurately as the change of the forces requires
            let s = less(&lambda, &last.0);
            let change = norm(&s) / norm(&lambda).max(f64::MIN_POSITIVE);
            let share = law.tolerance * (FINE * change).clamp(FINEST, 1.0);
            let moved = self.correct(problem, &lambda, share, report)?;
            let slips = problem.slips_after(&lambda, &moved);
            let found = problem.rows.violations(&slips);
            // update W by what the pass has observed
            let without_force = problem.without_force(&found, &lambda);
            let noise = (share + last.2) * norm(&less(&found, &without_force));
            problem.observations.push(Observation { s, y: less(&found, &last.1), noise });
            last = (lambda.clone(), found, share);
            problem.update_compliance();
            // forces of the next pass
            least = law.tolerance * problem.load;
            pass = problem.evaluate(lambda, slips, least, &mut report.costs);
            longest = longest.max(clock.elapsed());
        };
        self.deadline.end_passes(Instant::now(), longest);
        let perceptible = !problem.loose_tolerance(1.0).is_met(&pass.residual, &pass.lambda);
        report.contact.shortened = late && perceptible;
        report.warn(WARNINGS[0], u32::from(exhausted && perceptible));
        report.warn(WARNINGS[1], u32::from(!pass.solved && perceptible && !report.contact.shortened));
        report.warn(WARNINGS[2], pass.residual.dropped);
        report.contact.residual = pass.relative_change;
        (report.contact.residual_n, report.contact.residual_m) = (pass.residual.force, pass.residual.gap);
        Ok((pass.lambda, pass.slips))
    }

    /// Solves a batch of each body's aged columns anew; false if there are none.
    fn renew(&mut self, problem: &mut Problem, lambda: &[f64], report: &mut StepReport) -> Result<bool> {
        if problem.law.correction != Correction::Exact {
            return Ok(false);
        }
        let solving = self.solving(&problem.law);
        let mut renewed = false;
        let clock = Instant::now();
        for (number, body) in self.bodies.iter_mut().enumerate() {
            let forces = problem.rows.on_nodes(number, lambda);
            let rest_shape = RestShape::of(&body.model, &body.wound, body.floats);
            renewed |= body.compliance.renew(body.backend.as_mut(), rest_shape, &forces, solving, report)?;
        }
        if renewed {
            self.deadline.batch_took(clock.elapsed());
            problem.columns = self.compliance_of(problem);
            problem.update_compliance();
        }
        Ok(renewed)
    }
}
