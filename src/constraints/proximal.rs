//! The contact solve: sweeps and Newton steps on problems that have one answer each, within a budget.
//!
//! Redundant contacts leave modes of force on which no violation depends, and a `W` of loosely solved columns may be negative there. Sweeps
//! swing in such modes and Newton steps divide by nothing. So each step adds a compliance that acts only on what changes,
//!
//! `δ = W λ + δ_free + ε D (λ − λ_k)`, `D = diag W`; its forces are `λ_{k+1}`; then `ε`, at first 10⁻², is a tenth,
//!
//! which is the proximal point method. At its end `λ_{k+1} = λ_k`: the laws hold on `W` itself and no force is changed by what was added.
//! Of many solutions it takes the one nearest to the forces that it began with, those of the last step, in the norm of `D`.
//!
//! **What is proved.** Without friction and edges the laws are a convex problem, `min ½ λᵀWλ + δ_freeᵀλ` over a product of intervals. On
//! each step's problem, strongly convex, sweeps converge linearly from any start (Luo, Tseng 1992); the steps converge to a solution if
//! there is one, also when each is solved up to a summable error (Rockafellar 1976, theorem 1), by `ε d / (ε d + w)` per step in a mode
//! of compliance `w`. With friction, whose discs depend on the forces, a solution exists where the tool is free to leave (Klarbring, Pang
//! 1998), but no method is known to end from any start (Acary, Brémond, Huber 2018 compare many); neither on an edge, whose force is no
//! monotone function of the motion. There the budget ends the solve, and what comes back is the best iterate with its residual.
//!
//! **What was measured**, for 10⁻⁸ or else 10⁻⁴ of the largest force and 10 nm: 4,304 solves of perturbed incisions of 8 to 30 contacts, all
//! those that took sweeps and Newton steps alone more than 40 sweeps and a share of the others, some with an eigenvalue of −1 % of the
//! largest. In 400,000 row updates 4,295 end, 4,302 at 10⁻³ and 100 nm, the others at 10⁻³ and 150 nm; half of one cut's in 8,000 and 99 %
//! in 60,000. Sweeps and Newton steps alone, 400 sweeps each, leave 2.7 % of them and take four times the sweeps; without a bound they took up
//! to 10,000 sweeps and 57,000 Newton steps. 64 points with friction on 25 nodes: 240,000 at most. To 10⁻¹⁰ on random `W` over ten decades,
//! 300 rows, 700,000 (`tests/contact_laws.rs`). Of three crossing cuts' 639, 11 were left by 100,000 updates, 17 with `ε` of 10⁻³ at
//! first; with 10⁻¹ they take a sixth more Newton steps. The problem without friction first, and friction
//! brought in by steps, is no longer needed: nothing was left that it solved.
//!
//! ADMM on the same laws (Carpentier 2024: penalty by row, adapted to the residuals' ratio, from 10⁻³, 10⁻¹ and 1), on 990 problems of cuts right
//! through and of random paths, a fifth of those that take more than 4,000 row updates here: 945, 941, 937 end at 10⁻⁴ and 10 nm within
//! 400,000, in 26,800, 15,500 and 13,100 in the median; here 961 end, in 6,300.
//!
//! Source: Rockafellar 1976 (proximal point); Carpentier, Le Lidec, Montaut 2024 (proximal contact solves in robotics). Differs: the
//! problem inside is solved by Gauss–Seidel sweeps and semismooth Newton steps, not by ADMM, and keeps the law without de Saxcé's term.

use super::{Ended, Law, Residual, newton, relax, residual};

/// Compliance that the first proximal step adds to a row, as a share of its own. More slows the steps' convergence, less leaves redundant
/// edges swinging; figures above.
const FIRST: f64 = 1e-2;
/// The most, in a step after one whose problem was not solved: with it no row's force changes faster than that of the row alone.
const MOST: f64 = 1.0;
/// What remains of it in the step after one whose problem was solved.
const THEN: f64 = 0.1;
/// Below this share it is rounding, and left out.
const LEAST: f64 = 1e-13;
/// Sweeps before Newton steps are tried, and between two tries: enough to sort open, sticking and sliding contacts.
const SWEEPS_BETWEEN: u32 = 20;
/// The same after the first proximal step, when they are sorted already.
const SWEEPS_LATER: u32 = 10;
/// Sweeps and Newton steps that leave more than this share of `Σ c F²` do not close in: the problem is left as it is.
const STALLED: f64 = 0.5;
/// A proximal step that leaves more than this share of `Σ c F²` is slow: the solve ends if what is left is enough.
const SLOW: f64 = 0.01;

/// What a solve is to reach, and what it may cost.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    /// Residual that ends the solve at once: a share of the forces' sum (N) and of the largest motion that a force gives its own row (m).
    pub wanted: f64,
    /// Residual that ends it where that is not reached quickly.
    pub enough: Enough,
    /// Row updates at most (a row update takes as many multiplications as there are rows). A step that has begun is not broken off: up to
    /// 20 sweeps and one elimination more.
    pub updates: u64,
}

/// A residual that cannot be felt.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Enough {
    /// Share of the largest force.
    pub share: f64,
    /// m
    pub gap: f64,
}

impl Enough {
    /// Whether what is left is no more than this.
    pub fn holds(&self, residual: &Residual, force: &[f64]) -> bool {
        let largest = force.iter().fold(0.0f64, |most, f| most.max(f.abs()));
        residual.force <= self.share * largest && residual.gap <= self.gap
    }
}

fn small(residual: &Residual, w: &[f64], force: &[f64], tolerance: f64) -> bool {
    let total: f64 = force.iter().map(|f| f.abs()).sum();
    let motions = force.iter().enumerate().map(|(i, f)| w[i * (force.len() + 1)] * f.abs());
    residual.force <= tolerance * total && residual.gap <= tolerance * motions.fold(0.0, f64::max)
}

/// Forces that hold the laws, as far as the effort goes: the iterate with the least `Σ c F²`, never worse than the start.
///
/// `w` is the compliance by rows, `[row]²`, m/N; `free` the violation without contact force, m; `force` start and result, N. Rows are those
/// of the laws, one after the other.
///
/// # Panics
/// When the laws have other rows than `force`.
pub fn solve(laws: &[Law], w: &[f64], free: &[f64], force: &mut [f64], effort: &Effort) -> Ended {
    assert_eq!(force.len(), laws.iter().map(Law::rows).sum::<usize>(), "a force for each row of the laws");
    let mut ended = Ended { residual: residual(laws, w, free, force), ..Ended::default() };
    ended.updates = force.len() as u64;
    let mut best = force.to_vec();
    let (mut near, mut shifted) = (w.to_vec(), free.to_vec());
    let mut share = FIRST;
    loop {
        add_compliance(w, free, force, share, &mut near, &mut shifted);
        let settled = settle(laws, &near, &shifted, force, effort, &mut ended);
        ended.rounds += 1;
        let (before, found) = (ended.residual.energy, residual(laws, w, free, force));
        if found.energy < before || before.is_nan() {
            ended.residual = found;
            best.copy_from_slice(force);
        }
        ended.converged = small(&ended.residual, w, &best, effort.wanted);
        let slow = ended.updates >= effort.updates || found.energy > SLOW * before;
        if !ended.converged && slow {
            ended.converged = effort.enough.holds(&ended.residual, &best);
        }
        if ended.converged || ended.updates >= effort.updates {
            break;
        }
        if settled {
            share = if share * THEN < LEAST { 0.0 } else { share * THEN };
        } else {
            force.copy_from_slice(&best);
            share = (10.0 * share).clamp(FIRST, MOST);
        }
    }
    force.copy_from_slice(&best);
    ended
}

/// `W + ε D`, and the violation without force that leaves the forces as they are where they are.
fn add_compliance(w: &[f64], free: &[f64], force: &[f64], share: f64, near: &mut [f64], shifted: &mut [f64]) {
    near.copy_from_slice(w);
    for (row, f) in force.iter().enumerate() {
        let diagonal = row * (force.len() + 1);
        let added = share * w[diagonal];
        near[diagonal] += added;
        shifted[row] = free[row] - added * f;
    }
}

/// Sweeps and Newton steps in turn; whether they have solved the problem.
fn settle(laws: &[Law], w: &[f64], free: &[f64], force: &mut [f64], effort: &Effort, ended: &mut Ended) -> bool {
    let rows = force.len() as u64;
    let most = if ended.rounds == 0 { SWEEPS_BETWEEN } else { SWEEPS_LATER };
    let mut before = f64::INFINITY;
    loop {
        let sweeps = relax(laws, w, free, force, effort.wanted, most);
        ended.sweeps += sweeps;
        ended.updates += rows * u64::from(sweeps + 1);
        if small(&residual(laws, w, free, force), w, force, effort.wanted) {
            return true;
        }
        let left = effort.updates.saturating_sub(ended.updates);
        let (steps, updates) = newton::polish(laws, w, free, force, left, |r, f| small(r, w, f, effort.wanted));
        ended.steps += steps;
        ended.updates += updates + rows;
        let found = residual(laws, w, free, force);
        if small(&found, w, force, effort.wanted) {
            return true;
        }
        let stalled = found.energy > STALLED * before || !found.energy.is_finite();
        if stalled || ended.updates >= effort.updates {
            return false;
        }
        before = found.energy;
    }
}
