//! Semismooth Newton steps on the contact laws, for problems on which sweeps converge slowly.
//!
//! The laws hold where `F(λ) = λ − P(y) = 0`, `y = λ − δ/c`, with the projection `P` of [`Law`]. `F` has a derivative nearly everywhere,
//! `J = I − P′ (I − C⁻¹ W)`; steps `J Δλ = −F` end at the solution once open, sticking and sliding contacts are identified.
//! Source: Alart, Curnier 1991. Differs: the disc is that of the projected normal force, as in the sweeps; `W`'s diagonal is raised in
//! `J` alone, so that redundant contacts share a force instead of making it singular. `F` is unchanged, and so are the laws that hold.

use super::{Law, Residual, first_rows, floor, of_rows, residual, residual_at, scales, trial_force};

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

/// Newton steps until `done`, until they no longer reduce the residual, or until the row updates are used up; returns the number of steps and of row
/// updates. `force` never gets worse.
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
    let (mut jacobian, mut step) = (vec![0.0; rows * rows], vec![0.0; rows]);
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
        let mut better = false;
        while !better && raised < RAISED.len() {
            linearise(laws, w, free, force, (RAISED[raised], share), &mut jacobian, &mut step);
            *updates += (rows * rows / 3 + 2 * rows) as u64; // an elimination takes rows³/3 multiplications
            better = eliminate(&mut jacobian, &mut step)
                && (0..HALVINGS).any(|halving| {
                    let part = 0.5f64.powi(halving);
                    trial.iter_mut().zip(force.iter().zip(&step)).for_each(|(t, (f, s))| *t = f + part * s);
                    *updates += rows as u64;
                    let after = residual_at(laws, w, free, &trial, share).energy;
                    let less = after < before * (1.0 - 1e-4 * part);
                    if less {
                        before = after;
                    }
                    less
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

/// `J`, row-major, and `−F`.
fn linearise(
    laws: &[Law],
    w: &[f64],
    free: &[f64],
    force: &[f64],
    (raised, share): (f64, f64),
    jacobian: &mut [f64],
    minus: &mut [f64],
) {
    let rows = force.len();
    let floor = floor(w, rows);
    jacobian.fill(0.0);
    for (first, law) in first_rows(laws) {
        let law_rows = law.rows();
        let c = scales(law, w, rows, first, floor).map(|c| share * c);
        let trial = of_rows(law, |k| trial_force(w, free, force, first + k, c[k]));
        let (projected, slope) = (law.project(trial), law.slope(trial));
        for a in 0..law_rows {
            let line = &mut jacobian[(first + a) * rows..(first + a + 1) * rows];
            line[first + a] = 1.0;
            minus[first + a] = if c[a] > 0.0 { projected[a] - force[first + a] } else { -force[first + a] };
            for b in (0..law_rows).filter(|b| c[a] > 0.0 && c[*b] > 0.0 && slope[a][*b] != 0.0) {
                let row = first + b;
                let m = slope[a][b];
                line.iter_mut().zip(&w[row * rows..(row + 1) * rows]).for_each(|(j, w)| *j += m / c[b] * w);
                line[row] += m * (raised * w[row * rows + row] / c[b] - 1.0);
            }
        }
    }
}

/// Gaussian elimination in place with row pivoting; false if the matrix is singular.
fn eliminate(matrix: &mut [f64], right: &mut [f64]) -> bool {
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
        for (i, other) in below.chunks_exact_mut(rows).enumerate().filter(|(_, other)| other[k] != 0.0) {
            let factor = other[k] / line[k];
            other[k..].iter_mut().zip(&line[k..]).for_each(|(o, l)| *o -= factor * l);
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
