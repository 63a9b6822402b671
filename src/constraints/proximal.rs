//! Contact solver: sweeps and Newton steps on problems with a unique solution each, within a budget.
//!
//! Redundant contacts have modes of force that change no violation, and a `W` of loosely solved columns may be negative in them. Sweeps
//! oscillate in such modes and Newton's matrix is singular. Each step therefore adds a compliance that acts on changes only,
//!
//! `δ = W λ + δ_free + ε D (λ − λ_k)`, `D = diag W`; the solution is `λ_{k+1}`; `ε`, at first 10⁻², is then divided by ten, or multiplied where no solution is found,
//!
//! which is the proximal point method. At its end `λ_{k+1} = λ_k`: the laws hold on `W` itself, and the added compliance changes no force.
//! Of several solutions it takes the one nearest to its start, the forces of the last step or what was predicted from them, in the norm of `D`.
//! Where there is an edge, whose law is not monotone, sweeps on `W` itself come first.
//!
//! **What was measured**, to 10⁻⁸, or else to 10⁻⁴ of the largest force and 10 nm: 4,304 solves of perturbed incisions with 8 to 30
//! contacts, all those that took sweeps and Newton steps alone more than 40 sweeps and a share of the others, some with an eigenvalue of
//! −1 % of the largest. In 400,000 row updates 4,295 converge, 4,302 to 10⁻³ and 100 nm, the others to 10⁻³ and 150 nm; half of one cut's
//! in 8,000 and 99 % in 60,000. Sweeps and Newton steps alone, 400 sweeps each, leave 2.7 % of them and take four times the sweeps; without
//! a bound they took up to 10,000 sweeps and 57,000 Newton steps. 64 points with friction on 25 nodes: 240,000 at most. To 10⁻¹⁰ on random
//! `W` over ten decades, 300 rows: 700,000 (`tests/engine/contact_laws.rs`). Of the 639 solves of three crossing cuts 100,000 updates leave 11, or
//! 17 with `ε` of 10⁻³ at first; with 10⁻¹ they take a sixth more Newton steps. Solving without friction first and adding it in steps
//! solved none of those left.
//!
//! 714 solves of perturbed incisions of three paths, 24 to 36 cells across, with up to 33 contacts that take more than 40,000 row updates: all
//! converge to 10⁻⁴ and 10 nm in 360,000, half in 45,000, from the last step's forces; from zero 693 of them in 400,000. That is by proximal
//! steps alone; with the sweeps before them, half take 14,500.
//!
//! Before the sweeps came first, ADMM on the same laws (Carpentier 2024: penalty by row, adapted to the residuals' ratio, from 10⁻³, 10⁻¹ and 1), on 990 problems of cuts
//! right through and of random paths, a fifth of those that take more than 4,000 row updates here: 945, 941, 937 converge to 10⁻⁴ and 10 nm
//! within 400,000, in 26,800, 15,500 and 13,100 in the median; here 961 converge, in 6,300.
//!
//! Source: Rockafellar 1976 (proximal point); Carpentier, Le Lidec, Montaut 2024 (proximal contact solves in robotics). Differs: the inner
//! problem is solved by Gauss–Seidel sweeps and semismooth Newton steps, not by ADMM, and the law omits de Saxcé's term.

use super::{Ended, Law, Residual, newton, relax, residual};

/// Compliance that the first proximal step adds to a row, as a share of its own. A larger one slows the convergence of the steps, a smaller
/// one lets redundant edges oscillate; figures above.
const FIRST: f64 = 1e-2;
/// Largest such share, used after unsolved problems: no row's force then changes faster than that of the row alone.
const MOST: f64 = 1.0;
/// Factor on the share after a solved problem, as long as none with so small a share was left unsolved: such a one takes twenty times the row
/// updates of a solved one. With the smaller share tried again after each step, 18 of 714 problems of perturbed cuts were not solved in 400,000.
const THEN: f64 = 0.1;
/// Share below which the compliance is rounding, and omitted.
const LEAST: f64 = 1e-13;
/// Sweeps before Newton steps and between two tries of them: enough to tell open, sticking and sliding contacts apart.
const SWEEPS_BETWEEN: u32 = 20;
/// The same after the first proximal step, when the contacts are told apart already.
const SWEEPS_LATER: u32 = 10;
/// Sweeps on the problem itself, without added compliance, where a law is not monotone: before the proximal steps and after one that is left
/// unsolved. Newton's steps stall in local minima there and sweeps go on. Row updates of the solves of incision_shapes.toml, mean, 99 % and most,
/// 36 × 36 cells: without any 5,920, 31,200 and 98,800; with these 1,830, 7,200 and 25,500. Of those of 645 solves that take more than 40,000
/// without: 54,700, 183,000, 360,000 and 24,100, 107,000, 399,000; with 200 in place of 100 more in the mean.
const PLAIN_FIRST: u32 = 100;
const PLAIN_LATER: u32 = 200;
/// The same between two looks at the residual, and after which the loose tolerance is accepted.
const PLAIN_AT_ONCE: u32 = 20;
const PLAIN_TIGHT: u32 = 40;
/// Share of `Σ c F²` left by sweeps and Newton steps above which they have stalled; the problem then counts as unsolved.
const STALLED: f64 = 0.5;
/// Share of `Σ c F²` left by a proximal step above which it is slow: the solve then accepts the loose tolerance.
const SLOW: f64 = 0.01;

/// Tolerances and budget of a solve.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    /// Tight tolerance: on forces relative to their sum, on gaps relative to the largest displacement of a row under its own force.
    pub tolerance: f64,
    /// Loose tolerance, accepted where the tight one is not reached quickly: after a slow proximal step, or 40 sweeps where there is an edge.
    pub loose: LooseTolerance,
    /// Most row updates (each takes as many multiplications as there are rows). What has begun is finished: up to 20 sweeps, eight trials
    /// of a Newton step, and an elimination of up to 600 rows; a larger one that needs more than are left is not begun.
    pub updates: u64,
}

/// Residual that cannot be felt.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LooseTolerance {
    /// Largest force residual, as a share of the largest force.
    pub share: f64,
    /// Largest gap residual, m.
    pub gap: f64,
}

impl LooseTolerance {
    /// Whether a residual is within these bounds.
    pub fn is_met(&self, residual: &Residual, force: &[f64]) -> bool {
        let largest = force.iter().fold(0.0f64, |most, f| most.max(f.abs()));
        residual.energy.is_finite() && residual.force <= self.share * largest && residual.gap <= self.gap
    }
}

/// Whether a residual is within the tight tolerance.
fn small(residual: &Residual, w: &[f64], force: &[f64], tolerance: f64) -> bool {
    let total: f64 = force.iter().map(|f| f.abs()).sum();
    let motions = force.iter().enumerate().map(|(i, f)| w[i * (force.len() + 1)] * f.abs());
    residual.energy.is_finite()
        && residual.force <= tolerance * total
        && residual.gap <= tolerance * motions.fold(0.0, f64::max)
}

/// Solves for the forces that hold the laws, within the budget; returns the iterate with the least `Σ c F²`, never worse than the start.
///
/// `w` is the compliance, row-major, `[row]²`, m/N; `free` the violations without contact forces, m; `force` start and result, N. The rows
/// are those of the laws in order.
///
/// # Panics
/// When the laws have another number of rows than `force`.
pub fn solve(laws: &[Law], w: &[f64], free: &[f64], force: &mut [f64], effort: &Effort) -> Ended {
    assert_eq!(force.len(), laws.iter().map(Law::rows).sum::<usize>(), "a force for each row of the laws");
    let mut ended = Ended { residual: residual(laws, w, free, force), ..Ended::default() };
    ended.updates = force.len() as u64;
    let mut best = force.to_vec();
    let (mut near, mut shifted) = (w.to_vec(), free.to_vec());
    let (mut share, mut unsolved) = (FIRST, None);
    let monotone = laws.iter().all(Law::is_monotone);
    if !monotone {
        sweep_plainly(laws, w, free, &mut best, PLAIN_FIRST, effort, &mut ended);
        force.copy_from_slice(&best);
    }
    let (mut left, mut again) = (f64::NAN, false);
    while !ended.converged && ended.updates < effort.updates {
        // the largest share from the same forces again would end the same way
        if again && unsolved == Some(MOST) && ended.residual.energy == left {
            break;
        }
        left = ended.residual.energy;
        // solve the problem with added compliance; keep the best iterate
        add_compliance(w, free, force, share, &mut near, &mut shifted);
        let settled = settle(laws, &near, &shifted, force, effort, &mut ended);
        ended.rounds += 1;
        again = !settled;
        let (before, found) = (ended.residual.energy, residual(laws, w, free, force));
        if found.energy < before || before.is_nan() {
            ended.residual = found;
            best.copy_from_slice(force);
        }
        // tight tolerance; the loose one if progress is slow
        ended.converged = small(&ended.residual, w, &best, effort.tolerance);
        let slow = ended.updates >= effort.updates || found.energy > SLOW * before;
        if !ended.converged && slow {
            ended.converged = effort.loose.is_met(&ended.residual, &best);
        }
        // less compliance after a solved problem; else more, from the best iterate
        if settled {
            let next = if share * THEN < LEAST { 0.0 } else { share * THEN };
            // the same share by another way differs by rounding
            if unsolved.is_none_or(|unsolved| next > 2.0 * unsolved) {
                share = next;
            }
        } else {
            if !monotone && !ended.converged {
                sweep_plainly(laws, w, free, &mut best, PLAIN_LATER, effort, &mut ended);
            }
            force.copy_from_slice(&best);
            unsolved = Some(share);
            share = (10.0 * share).clamp(FIRST, MOST);
        }
    }
    force.copy_from_slice(&best);
    ended
}

/// Sweeps on the problem itself from the best iterate, until a tolerance is met, the forces rest, or `most` are done; keeps the best iterate.
fn sweep_plainly(
    laws: &[Law],
    w: &[f64],
    free: &[f64],
    best: &mut [f64],
    most: u32,
    effort: &Effort,
    ended: &mut Ended,
) {
    let mut force = best.to_vec();
    let mut done = 0;
    while done < most && ended.updates < effort.updates {
        let sweeps = relax(laws, w, free, &mut force, effort.tolerance, PLAIN_AT_ONCE);
        done += sweeps;
        ended.sweeps += sweeps;
        ended.updates += force.len() as u64 * u64::from(sweeps + 1);
        let found = residual(laws, w, free, &force);
        if found.energy < ended.residual.energy || ended.residual.energy.is_nan() {
            ended.residual = found;
            best.copy_from_slice(&force);
        }
        ended.converged = small(&ended.residual, w, best, effort.tolerance)
            || (done >= PLAIN_TIGHT || ended.updates >= effort.updates) && effort.loose.is_met(&ended.residual, best);
        if ended.converged || sweeps < PLAIN_AT_ONCE {
            break;
        }
    }
}

/// `W + ε D`, with the violation without force that leaves the present forces unchanged.
fn add_compliance(w: &[f64], free: &[f64], force: &[f64], share: f64, near: &mut [f64], shifted: &mut [f64]) {
    near.copy_from_slice(w);
    for (row, f) in force.iter().enumerate() {
        let diagonal = row * (force.len() + 1);
        let added = share * w[diagonal];
        near[diagonal] += added;
        shifted[row] = free[row] - added * f;
    }
}

/// Sweeps and Newton steps in turn; returns whether they have solved the problem.
fn settle(laws: &[Law], w: &[f64], free: &[f64], force: &mut [f64], effort: &Effort, ended: &mut Ended) -> bool {
    let rows = force.len() as u64;
    let most = if ended.rounds == 0 { SWEEPS_BETWEEN } else { SWEEPS_LATER };
    let mut before = f64::INFINITY;
    loop {
        let sweeps = relax(laws, w, free, force, effort.tolerance, most);
        ended.sweeps += sweeps;
        ended.updates += rows * u64::from(sweeps + 1);
        if small(&residual(laws, w, free, force), w, force, effort.tolerance) {
            return true;
        }
        let left = effort.updates.saturating_sub(ended.updates);
        let (steps, updates) = newton::polish(laws, w, free, force, left, |r, f| small(r, w, f, effort.tolerance));
        ended.steps += steps;
        ended.updates += updates + rows;
        let found = residual(laws, w, free, force);
        if small(&found, w, force, effort.tolerance) {
            return true;
        }
        let stalled = found.energy > STALLED * before || !found.energy.is_finite();
        if stalled || ended.updates >= effort.updates {
            return false;
        }
        before = found.energy;
    }
}
