//! Semismooth Newton steps on the contact laws, for problems on which sweeps converge slowly.
//!
//! The laws hold where `F(λ) = λ − P(y) = 0`, `y = λ − δ/c`, with the projection `P` of [`Law`]. `F` has a derivative nearly everywhere,
//! `J = I − P′ (I − C⁻¹ W)`; steps `J Δλ = −F` end at the solution once open, sticking and sliding contacts are identified.
//! Source: Alart, Curnier 1991. Differs: the disc is that of the projected normal force, as in the sweeps; `W`'s diagonal is raised in
//! `J` alone, so that redundant contacts share a force instead of making it singular. `F` is unchanged, and so are the laws that hold.
//! Rows whose force follows no violation, those of open contacts, are eliminated at once: what is left to eliminate are the others.

use super::{Law, Residual, Violations, first_rows, floor, of_rows, residual, residual_at, scales, trial_force};
use crate::math::inner_product;
use crate::math::wide::{Lanes, Task, Wide};

/// Most Newton steps in a row.
const STEPS: u32 = 30;
/// Most halvings of a step that does not reduce `Σ c F²`.
const HALVINGS: i32 = 8;
/// Steps after which `Σ c F²` has to be less than half of what it was before them: near a solution each step takes several digits, and steps
/// that crawl end in a local minimum. 714 problems of perturbed cuts that take more than 40,000 row updates: without this 61,400 in the mean
/// and two not solved in 400,000, with it 51,400 and none.
const WATCHED: u32 = 3;
/// Shares by which `J`'s diagonal is raised, the next one when a step fails (Levenberg 1944). The first is well above rounding (1e-16 × 300
/// rows) and well below the tolerance of λ. Redundant contacts whose violations disagree (four corners of a rigid face, by the rounding of
/// their positions) call for a force of that disagreement over the share, which grows without bound: they need a larger one.
const RAISED: [f64; 2] = [1e-11, 1e-7];

/// Factors on the rows' own compliance that serve as `c`. Most of a row's compliance is common to all rows near it; what tells them apart
/// is a hundred to a million times smaller, and a map with `c` closer to that identifies the closing contacts. On 27 contacts in one dent
/// 10⁻³ takes five steps, and with 1 none reduces the residual. On a well conditioned `W` it is the other way round.
const SHARES: [f64; 2] = [1.0, 1e-3];

/// Rows up to which a step is begun whatever is left of the budget: those of a side that is tied to another body, which sweeps hardly solve.
/// The elimination of so many takes about as long as the budget of a step.
const ALWAYS: usize = 600;

/// Newton steps until `done`, until they no longer reduce the residual, or until the row updates are used up (of many rows, a
/// step that needs more than are left is not begun); returns the number of steps and of row updates. `force` never gets worse.
pub(super) fn polish(
    laws: &[Law],
    w: &[f64],
    free: &[f64],
    force: &mut [f64],
    most: u64,
    done: impl Fn(&Residual, &[f64]) -> bool,
) -> (u32, u64) {
    let (mut count, mut updates) = (0, 0);
    let mut best = residual(laws, w, free, force).energy;
    // one descent per share of c; keep the better forces
    for share in SHARES {
        let mut trial = force.to_vec();
        count += descend(laws, w, free, &mut trial, (share, most), &mut updates, &done);
        let found = residual(laws, w, free, &trial);
        if found.energy < best {
            best = found.energy;
            force.copy_from_slice(&trial);
        }
        if done(&found, &trial) || updates >= most {
            break;
        }
    }
    (count, updates)
}

/// Steps that reduce the natural map of one share.
fn descend(
    laws: &[Law],
    w: &[f64],
    free: &[f64],
    force: &mut [f64],
    (share, most): (f64, u64),
    updates: &mut u64,
    done: impl Fn(&Residual, &[f64]) -> bool,
) -> u32 {
    let rows = force.len();
    let mut trial = force.to_vec();
    let mut before = residual_at(laws, w, free, force, share).energy;
    let mut raised = 0;
    let mut watched = before;
    for count in 0..STEPS {
        if count > 0 && count % WATCHED == 0 {
            if before > 0.5 * watched {
                return count;
            }
            watched = before;
        }
        *updates += rows as u64;
        if *updates >= most || done(&residual(laws, w, free, force), force) {
            return count;
        }
        // a step with the diagonal raised as little as works; halve it until the residual falls
        let linearised = Linearised::new(laws, w, free, force, share);
        let mut better = false;
        while !better && raised < RAISED.len() {
            if linearised.active.len() > ALWAYS && *updates + linearised.updates() > most {
                return count;
            }
            *updates += linearised.updates();
            better = linearised.step(w, RAISED[raised]).is_some_and(|step| {
                (0..HALVINGS).any(|halving| {
                    let part = 0.5f64.powi(halving);
                    trial.iter_mut().zip(force.iter().zip(&step)).for_each(|(t, (f, s))| *t = f + part * s);
                    *updates += rows as u64;
                    let after = residual_at(laws, w, free, &trial, share).energy;
                    let less = after < before * (1.0 - 1e-4 * part);
                    if less {
                        before = after;
                    }
                    less
                })
            });
            raised += usize::from(!better);
        }
        if !better {
            return count;
        }
        force.copy_from_slice(&trial);
    }
    STEPS
}

/// Row whose force follows violations: those of its contact's rows.
struct Active {
    row: usize,
    /// Row, derivative of the force by that row's trial force, compliance `c` of that row.
    follows: [(usize, f64, f64); 3],
}

/// `J Δλ = −F`, condensed to the rows whose force depends on violations. In the others, open contacts above all, `J` is the identity.
struct Linearised {
    active: Vec<Active>,
    /// `[row]` `−F`, N.
    minus: Vec<f64>,
}

impl Linearised {
    fn new(laws: &[Law], w: &[f64], free: &[f64], force: &[f64], share: f64) -> Self {
        let rows = force.len();
        let floor = floor(w, rows);
        let violations = f64::widest(Violations { w, free, force });
        let mut out = Self { active: vec![], minus: vec![0.0; rows] };
        for (first, law) in first_rows(laws) {
            let c = scales(law, w, rows, first, floor).map(|c| share * c);
            let trial = of_rows(law, |k| trial_force(force[first + k], violations[first + k], c[k]));
            let (projected, slope) = (law.project(trial), law.slope(trial));
            for a in 0..law.rows() {
                out.minus[first + a] = if c[a] > 0.0 { projected[a] - force[first + a] } else { -force[first + a] };
                let follows = [0, 1, 2].map(|b| {
                    let both = b < law.rows() && c[a] > 0.0 && c[b] > 0.0;
                    (first + b, if both { slope[a][b] } else { 0.0 }, c[b])
                });
                if follows.iter().any(|(_, derivative, _)| *derivative != 0.0) {
                    out.active.push(Active { row: first + a, follows });
                }
            }
        }
        out
    }

    /// Row updates that it and its solution take: multiplications by the number of rows.
    fn updates(&self) -> u64 {
        let [rows, active] = [self.minus.len(), self.active.len()].map(|count| count as u64);
        rows + 3 * active + active.pow(3) / (3 * rows.max(1))
    }

    /// `Δλ`, N, with `J`'s diagonal raised by a share of `W`'s; none if `J` is singular.
    fn step(&self, w: &[f64], raised: f64) -> Option<Vec<f64>> {
        let (rows, size) = (self.minus.len(), self.active.len());
        // steps of the rows that depend on none
        let mut step = self.minus.clone();
        self.active.iter().for_each(|active| step[active.row] = 0.0);
        // the others' block of J, and what is left for them
        let mut jacobian = Vec::with_capacity(size * size);
        let mut right = Vec::with_capacity(size);
        let mut line = vec![0.0; rows];
        for Active { row: active, follows } in &self.active {
            line.fill(0.0);
            line[*active] = 1.0;
            for &(row, m, c) in follows.iter().filter(|(_, m, _)| *m != 0.0) {
                line.iter_mut().zip(&w[row * rows..(row + 1) * rows]).for_each(|(j, w)| *j += m / c * w);
                line[row] += m * (raised * w[row * rows + row] / c - 1.0);
            }
            right.push(self.minus[*active] - inner_product(&line, &step));
            jacobian.extend(self.active.iter().map(|active| line[active.row]));
        }
        if !f64::widest(Elimination { matrix: &mut jacobian, right: &mut right }) {
            return None;
        }
        for (active, of_row) in self.active.iter().zip(right) {
            step[active.row] = of_row;
        }
        Some(step)
    }
}

/// Gaussian elimination in place with row pivoting; false if the matrix is singular. The solution is left in `right`.
struct Elimination<'a> {
    matrix: &'a mut [f64],
    right: &'a mut [f64],
}

impl Task<f64> for Elimination<'_> {
    type Output = bool;
    #[inline(always)]
    fn run<L: Lanes<f64>>(self, _: L) -> bool {
        let Self { matrix, right } = self;
        let rows = right.len();
        // forward elimination
        for k in 0..rows {
            let size = |i: usize, matrix: &[f64]| matrix[i * rows + k].abs();
            let pivot = (k..rows).fold(k, |best, i| if size(i, matrix) > size(best, matrix) { i } else { best });
            if !matrix[pivot * rows + k].is_normal() {
                return false;
            }
            if pivot != k {
                (0..rows).for_each(|j| matrix.swap(k * rows + j, pivot * rows + j));
                right.swap(k, pivot);
            }
            let (above, below) = matrix.split_at_mut((k + 1) * rows);
            let line = &above[k * rows..];
            for (i, other) in below.chunks_exact_mut(rows).enumerate() {
                if other[k] == 0.0 {
                    continue;
                }
                let factor = other[k] / line[k];
                for (o, l) in other[k..].iter_mut().zip(&line[k..]) {
                    *o -= factor * l;
                }
                right[k + 1 + i] -= factor * right[k];
            }
        }
        // back substitution
        for k in (0..rows).rev() {
            let line = &matrix[k * rows..(k + 1) * rows];
            let known: f64 = line[k + 1..].iter().zip(&right[k + 1..]).map(|(m, x)| m * x).sum();
            right[k] = (right[k] - known) / line[k];
        }
        right.iter().all(|x| x.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;

    /// `J Δλ` of a step, by the derivatives of the laws over all rows.
    fn applied(laws: &[Law], w: &[f64], free: &[f64], force: &[f64], step: &[f64]) -> Vec<f64> {
        let rows = force.len();
        let floor = floor(w, rows);
        let mut out = step.to_vec();
        for (first, law) in first_rows(laws) {
            let c = scales(law, w, rows, first, floor);
            let value = |force: &[f64], free: &[f64], k: usize| {
                let line = &w[(first + k) * rows..(first + k + 1) * rows];
                force[first + k] - (free[first + k] + inner_product(line, force)) / c[k]
            };
            let trial = of_rows(law, |k| if c[k] > 0.0 { value(force, free, k) } else { 0.0 });
            let change = of_rows(law, |k| if c[k] > 0.0 { value(step, &vec![0.0; rows], k) } else { 0.0 });
            let slope = law.slope(trial);
            (0..law.rows())
                .filter(|a| c[*a] > 0.0)
                .for_each(|a| out[first + a] -= (0..law.rows()).map(|b| slope[a][b] * change[b]).sum::<f64>());
        }
        out
    }

    #[test]
    fn a_condensed_step_solves_the_equations_of_all_rows() {
        let mut random = Random::new(3);
        // pressed, sliding, open, held, a runner that slides; one row in ten without compliance
        let laws: Vec<Law> = (0..40)
            .map(|k| match k % 4 {
                0 | 1 => Law::contact(0.4),
                2 => Law::Bilateral { rows: 1 },
                _ => Law::Slide { friction: 0.2, resistance: 0.1 },
            })
            .collect();
        let rows: usize = laws.iter().map(Law::rows).sum();
        let mut w: Vec<f64> = (0..rows * rows).map(|n| if n % (rows + 1) == 0 { 1e-3 } else { 0.0 }).collect();
        for i in 0..rows {
            for j in 0..i {
                let common = 2e-5 * random.signed();
                (w[i * rows + j], w[j * rows + i]) = (common, common);
            }
        }
        for row in (0..rows).step_by(10) {
            (0..rows).for_each(|k| (w[row * rows + k], w[k * rows + row]) = (0.0, 0.0));
        }
        let free: Vec<f64> = (0..rows).map(|_| 1e-3 * random.signed()).collect();
        let force: Vec<f64> = (0..rows).map(|_| random.signed().abs()).collect();
        let linearised = Linearised::new(&laws, &w, &free, &force, 1.0);
        let idle = rows - linearised.active.len();
        assert!(idle > rows / 5 && idle < rows / 2, "{idle} of {rows} rows follow no violation");
        let step = linearised.step(&w, 0.0).expect("W is regular");
        let off = |step: &[f64]| {
            let left = applied(&laws, &w, &free, &force, step);
            left.iter().zip(&linearised.minus).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
        };
        assert!(off(&step) < 1e-12, "{:e}", off(&step));
        let other: Vec<f64> = step.iter().map(|s| 1.001 * s).collect();
        assert!(off(&other) > 1e-5, "the counter-test: {:e}", off(&other));
    }
}
