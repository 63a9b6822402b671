//! Contact laws and their solver: projected block Gauss–Seidel on `δ = W λ + δ_free`, λ in newtons.
//!
//! Each [`Law`] has one to three rows; the rows of all contacts follow each other in one list.
//!
//! [`relax`] runs plain sweeps, for the haptic tick. [`solve`] ends within a budget of row updates for any input and returns the best
//! iterate: sweeps and Newton steps inside proximal steps, `δ = W λ + δ_free + ε D (λ − λ_k)` with `D = diag W` for `λ_{k+1}` from `λ_k`.
//!
//! **What is proved.** Without friction and edges the laws are a convex problem, `min ½ λᵀWλ + δ_freeᵀλ` over a product of intervals. Where
//! `W + ε D` is positive definite each step's problem is strongly convex, and sweeps converge on it linearly from any start (Luo, Tseng
//! 1992). The steps converge to a solution if there is one, also when each is solved up to a summable error (Rockafellar 1976, theorem 1),
//! by `ε d / (ε d + w)` per step in a mode of compliance `w`. With friction, whose discs depend on the forces, a solution exists where the
//! tool is free to leave (Klarbring, Pang 1998), but no method is known to converge from any start (Acary, Brémond, Huber 2018 compare
//! many). The same holds for an edge, whose force is no monotone function of the motion. In these cases the budget ends the solve, or that
//! even `ε = 1` leads nowhere, and it returns the best iterate with its residual.
//!
//! Source: Jourdan, Alart, Jean 1998 (block Gauss–Seidel); Duriez et al. 2006 (its use for haptics); Alart, Curnier 1991 (Newton).
//! Differs: the rows of a friction disc are divided by their plane's largest compliance, not the mean, so that sticking always converges.

mod law;
mod newton;
mod proximal;

pub use law::Law;
pub use proximal::{Effort, LooseTolerance, solve};

use crate::math::elementary::hypot;
use crate::math::wide::{Lanes, Task, Wide};
use crate::math::{inner_product, larger};

/// How a contact solve ended.
#[derive(Clone, Copy, Debug, Default)]
pub struct Ended {
    /// Sweeps.
    pub sweeps: u32,
    /// Newton steps.
    pub steps: u32,
    /// Proximal steps.
    pub rounds: u32,
    /// Row updates of all of these.
    pub updates: u64,
    /// Residual of the laws at the returned forces.
    pub residual: Residual,
    /// The residual meets the tight tolerance, or the loose one.
    pub converged: bool,
}

/// Residual of the laws: the natural map `F = λ − P(λ − δ/c)`, zero exactly where the laws hold.
#[derive(Clone, Copy, Debug, Default)]
pub struct Residual {
    /// Largest change that one more projection would make, N.
    pub force: f64,
    /// The same times the row's compliance, m: penetration, slip of a sticking contact, error of a bilateral row.
    pub gap: f64,
    /// `Σ c F²`, N·m.
    pub energy: f64,
    /// Contacts with a row that could bear a force but has no compliance; its force is 0.
    pub dropped: u32,
}

/// Share of the largest diagonal entry of `W` below which an entry is rounding, not compliance: both sides of the row act on one body.
const NOTHING: f64 = 1e-13;

/// Sweeps until the forces change by less than `tolerance` times their sum, or `max_sweeps`; returns the number of sweeps.
///
/// For the haptic tick: does not allocate, does not evaluate the residual. Arguments as in [`solve`].
pub fn relax(laws: &[Law], w: &[f64], free: &[f64], force: &mut [f64], tolerance: f64, max_sweeps: u32) -> u32 {
    debug_assert_eq!(force.len(), laws.iter().map(Law::rows).sum::<usize>(), "a force for each row of the laws");
    let floor = floor(w, force.len());
    for done in 0..max_sweeps {
        let change = f64::widest(Sweep { laws, w, free, force, floor });
        let total: f64 = force.iter().map(|f| f.abs()).sum();
        if change <= tolerance * total {
            return done + 1;
        }
    }
    max_sweeps
}

/// Each law with the index of its first row.
fn first_rows(laws: &[Law]) -> impl Iterator<Item = (usize, &Law)> {
    laws.iter().scan(0, |next, law| {
        let first = *next;
        *next += law.rows();
        Some((first, law))
    })
}

/// Values of a law's rows; 0 beyond its last row.
fn of_rows(law: &Law, mut value: impl FnMut(usize) -> f64) -> [f64; 3] {
    let rows = law.rows();
    [0, 1, 2].map(|k| if k < rows { value(k) } else { 0.0 })
}

/// One sweep over all contacts in order; returns the largest change of a force, N.
struct Sweep<'a> {
    laws: &'a [Law],
    w: &'a [f64],
    free: &'a [f64],
    force: &'a mut [f64],
    floor: f64,
}

impl Task<f64> for Sweep<'_> {
    type Output = f64;
    #[inline(always)]
    fn run<L: Lanes<f64>>(self, _: L) -> f64 {
        let Self { laws, w, free, force, floor } = self;
        let mut largest = 0.0f64;
        for (first, law) in first_rows(laws) {
            let c = scales(law, w, force.len(), first, floor);
            for group in law.groups() {
                // forces of earlier rows as this sweep has left them; unbounded forces of the group's rows
                let mut forces = of_rows(law, |k| force[first + k]);
                for k in group.clone() {
                    forces[k] = trial_force(force[first + k], violation(w, free, force, first + k), c[k]);
                }
                let projected = law.project(forces);
                for k in group.clone() {
                    let old = force[first + k];
                    force[first + k] = if law.under_relaxes(group) { 0.5 * (old + projected[k]) } else { projected[k] };
                    largest = largest.max((force[first + k] - old).abs());
                }
            }
        }
        largest
    }
}

/// Residual of the laws at `force`. Arguments as in [`solve`].
pub fn residual(laws: &[Law], w: &[f64], free: &[f64], force: &[f64]) -> Residual {
    residual_at(laws, w, free, force, 1.0)
}

/// The same with the compliances `c` of the natural map scaled by a share; zero at the same forces.
fn residual_at(laws: &[Law], w: &[f64], free: &[f64], force: &[f64], share: f64) -> Residual {
    let floor = floor(w, force.len());
    let violations = f64::widest(Violations { w, free, force });
    let mut found = Residual::default();
    for (first, law) in first_rows(laws) {
        let rows = law.rows();
        let c = scales(law, w, force.len(), first, floor).map(|c| share * c);
        // a constraint on a node that is held already is redundant, not dropped
        let unknown = (first..first + rows).any(|row| !w[row * (force.len() + 1)].is_finite());
        found.dropped += u32::from(unknown || !law.is_constraint() && c[..rows].contains(&0.0));
        let projected = law.project(of_rows(law, |k| trial_force(force[first + k], violations[first + k], c[k])));
        for k in 0..rows {
            let change = (force[first + k] - projected[k]).abs();
            found.force = larger(found.force, change);
            found.gap = larger(found.gap, c[k] * change);
            found.energy += c[k] * change * change;
        }
    }
    found
}

/// `δ` of a row, m.
#[inline(always)]
fn violation(w: &[f64], free: &[f64], force: &[f64], row: usize) -> f64 {
    let line = &w[row * force.len()..(row + 1) * force.len()];
    free[row] + inner_product(line, force)
}

/// `δ` of all rows, m.
struct Violations<'a> {
    w: &'a [f64],
    free: &'a [f64],
    force: &'a [f64],
}

impl Task<f64> for Violations<'_> {
    type Output = Vec<f64>;
    #[inline(always)]
    fn run<L: Lanes<f64>>(self, _: L) -> Vec<f64> {
        let mut out = vec![0.0; self.force.len()];
        for (row, out) in out.iter_mut().enumerate() {
            *out = violation(self.w, self.free, self.force, row);
        }
        out
    }
}

/// Least diagonal entry of `W` that counts as compliance, m/N.
fn floor(w: &[f64], rows: usize) -> f64 {
    let own = w.iter().step_by(rows + 1).filter(|c| c.is_finite());
    NOTHING * own.fold(0.0f64, |most, c| most.max(*c))
}

/// Compliances `c` that turn violations into forces, m/N: a row's own; for rows that are projected together the largest of their plane
/// (with a smaller one a sticking row may oscillate for ever). 0 for a row without compliance, which bears no force.
fn scales(law: &Law, w: &[f64], rows: usize, first: usize, floor: f64) -> [f64; 3] {
    let at = |i: usize, j: usize| w[(first + i) * rows + first + j];
    let compliant = |k: usize| at(k, k).is_finite() && at(k, k) > floor;
    let plane = |i: usize, j: usize| match (compliant(i), compliant(j)) {
        (true, true) => {
            let coupling = 0.5 * (at(i, j) + at(j, i));
            0.5 * (at(i, i) + at(j, j)) + hypot(0.5 * (at(i, i) - at(j, j)), coupling)
        }
        (true, false) => at(i, i),
        _ => at(j, j),
    };
    let mut c = [0.0; 3];
    for group in law.groups() {
        let largest = if group.len() == 2 { plane(group.start, group.start + 1) } else { at(group.start, group.start) };
        group.clone().filter(|k| compliant(*k)).for_each(|k| c[k] = largest);
    }
    c
}

/// Unbounded force of a row, N; 0 for a row without compliance.
#[inline(always)]
fn trial_force(force: f64, violation: f64, scale: f64) -> f64 {
    if scale > 0.0 { force - violation / scale } else { 0.0 }
}

/// `clamp` that accepts any bounds and keeps NaN.
fn between(x: f64, low: f64, high: f64) -> f64 {
    if x < low {
        low
    } else if x > high {
        high
    } else {
        x
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EXACT: Effort = Effort { tolerance: 1e-12, loose: LooseTolerance { share: 0.0, gap: 0.0 }, updates: 100_000 };
    const W: [f64; 9] = [1e-3, 1e-4, 0.0, 1e-4, 2e-3, 0.0, 0.0, 0.0, 2e-3];

    fn run(law: Law, free: [f64; 3]) -> [f64; 3] {
        let rows = law.rows();
        let w: Vec<f64> = (0..rows * rows).map(|n| W[n / rows * 3 + n % rows]).collect();
        let mut force = [0.0; 3];
        let ended = solve(&[law], &w, &free[..rows], &mut force[..rows], &EXACT);
        assert!(ended.converged);
        force
    }

    #[test]
    fn a_closing_gap_is_stopped_and_an_open_one_left_alone() {
        let law = Law::contact(0.0);
        assert!((run(law, [-1e-3, 0.0, 0.0])[0] - 1.0).abs() < 1e-9);
        assert_eq!(run(law, [1e-3, 1e-3, 0.0]), [0.0; 3]);
    }

    #[test]
    fn friction_sticks_below_its_limit_and_slides_on_the_disc_above_it() {
        let law = Law::contact(0.5);
        let sticks = run(law, [-1e-3, 1e-4, 1e-4]);
        assert!((2e-3 * sticks[1] + 1e-4 * sticks[0] + 1e-4).abs() < 1e-9);
        let slides = run(law, [-1e-3, 1e-2, 1e-2]);
        assert!((slides[1].hypot(slides[2]) - 0.5 * slides[0]).abs() < 1e-9);
        assert!(slides[1] < 0.0 && slides[2] < 0.0);
    }

    #[test]
    fn a_bounded_row_gives_way() {
        let law = Law::Coulomb { friction: 0.0, bound: 0.3 };
        let force = run(law, [-1e-3, 0.0, 0.0]);
        assert_eq!(force[0], 0.3);
        assert!(law.at_bound(force));
    }

    #[test]
    fn a_cutting_edge_takes_toughness_times_area_and_lets_go_backward() {
        let law = Law::Cut { radius: 0.4 };
        for free in [[-1e-2, -1e-2, 0.0], [-1e-2, 0.0, 0.0], [-3e-3, 1e-2, 0.0], [-1e-2, -2e-2, 0.0]] {
            let force = run(law, free);
            let motion = [0, 1].map(|k| free[k] + (0..3).map(|j| W[3 * k + j] * force[j]).sum::<f64>());
            let work = force[0] * motion[0] + force[1] * motion[1];
            assert!(
                (work - 0.4 * motion[0]).abs() < 1e-9,
                "{force:?} over {motion:?}: what the edge goes forward counts"
            );
            assert!((force[0] * motion[1] - force[1] * motion[0]).abs() < 1e-9, "against the motion");
            assert!(law.at_bound(force));
        }
        let push = run(law, [-1e-2, 0.0, 0.0])[0];
        assert!(run(law, [-1e-2, -2e-2, 0.0])[0] < 0.3 * push, "slicing lowers the push");
        let back = run(law, [1e-2, 0.0, 5e-4]);
        assert_eq!(back[0], 0.0);
        assert!((back[2] + 0.25).abs() < 1e-9, "the row across is two-sided: {}", back[2]);
        assert_eq!(run(law, [1e-2, 0.0, 5e-2])[2], -0.4);
    }

    #[test]
    fn a_slide_holds_across_and_rubs_along() {
        let law = Law::Slide { friction: 0.5, resistance: 0.1 };
        // δ across is 0 whatever comes; along it sticks below μ |λ_across| + resistance, and gives way at it
        for (along, sticks) in [(1e-4, true), (3e-4, true), (5e-3, false), (-5e-3, false)] {
            let force = run(law, [-6e-4, 8e-4, along]);
            let violation =
                [0, 1, 2].map(|i| [-6e-4, 8e-4, along][i] + (0..3).map(|j| W[3 * i + j] * force[j]).sum::<f64>());
            assert!(violation[0].abs() < 1e-9 && violation[1].abs() < 1e-9, "{violation:?}");
            let most = 0.5 * force[0].hypot(force[1]) + 0.1;
            match sticks {
                true => assert!(violation[2].abs() < 1e-9 && force[2].abs() < most, "{force:?}"),
                false => assert!((force[2].abs() - most).abs() < 1e-9 && force[2] * along < 0.0, "{force:?}"),
            }
        }
        let free = run(Law::Bilateral { rows: 2 }, [-6e-4, 8e-4, 5e-3]);
        assert_eq!(free[2], 0.0, "the counter-test: without friction nothing acts along");
    }
}
