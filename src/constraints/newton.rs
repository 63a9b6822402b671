//! Newton steps on the contact laws, where sweeps close in slowly.
//!
//! The laws hold where `F(λ) = λ − P(y) = 0`, `y = λ − δ/c`, with the projection `P` of [`Law`]. `F` has a derivative nearly everywhere,
//! `J = I − P′ (I − C⁻¹ W)`; steps `J Δλ = −F` end at the solution once open, sticking and sliding contacts are told apart.
//! Source: Alart, Curnier 1991. Differs: the disc is that of the projected normal force, as in the sweeps; `W`'s diagonal is raised in
//! `J` alone, so that redundant contacts share a force instead of dividing by zero. `F` is untouched: the result is the law's own.

use super::{Law, Residual, aim, between, floor, residual, residual_at, scales};
use crate::math::elementary::hypot;

/// Newton steps at one go.
const STEPS: u32 = 30;
/// Halvings of a step that does not lessen `Σ c F²`.
const HALVINGS: i32 = 8;
/// Shares by which the diagonal is raised in `J`, one after the other while steps fail. The first is well above rounding (1e-16 × 300
/// rows) and well below the tolerance wanted of λ. Redundant contacts whose violations do not agree (four corners of a rigid face, by
/// the rounding of where they are) ask for their disagreement over this share, in newtons without end: then a larger one is due
/// (Levenberg 1944).
const RAISED: [f64; 2] = [1e-11, 1e-7];

/// Shares of the rows' own compliance that take the place of `c`. What a row gives is mostly what all rows near it give together; what
/// tells them apart gives a hundred to a million times less, and a map whose `c` is nearer to that finds the contacts that close. On 27
/// contacts in one dent: five steps with 10⁻³, none that lessens the residual with 1. With well conditioned `W` it is the other way round.
const SHARES: [f64; 2] = [1.0, 1e-3];

/// Steps until `done`, until none lessens the residual, or until the row updates are used up; returns how many, and the row updates that
/// they took. `force` never gets worse.
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

/// Steps that lessen the natural map of one share.
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
    for count in 0..STEPS {
        *updates += rows as u64;
        if *updates >= most || done(&residual(laws, w, free, force), force) {
            return count;
        }
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

/// `J` by rows and `−F`.
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
    for (contact, law) in laws.iter().enumerate() {
        let first = 3 * contact;
        let c = scales(law, w, rows, first, floor).map(|c| share * c);
        let aim = [0, 1, 2].map(|k| aim(w, free, force, first + k, c[k]));
        let (held, slope) = (law.project(aim), slope(law, aim));
        for a in 0..3 {
            let line = &mut jacobian[(first + a) * rows..(first + a + 1) * rows];
            line[first + a] = 1.0;
            minus[first + a] = if c[a] > 0.0 { held[a] - force[first + a] } else { -force[first + a] };
            for b in (0..3).filter(|b| c[a] > 0.0 && c[*b] > 0.0 && slope[a][*b] != 0.0) {
                let row = first + b;
                let m = slope[a][b];
                line.iter_mut().zip(&w[row * rows..(row + 1) * rows]).for_each(|(j, w)| *j += m / c[b] * w);
                line[row] += m * (raised * w[row * rows + row] / c[b] - 1.0);
            }
        }
    }
}

/// `P′`, three by three.
fn slope(law: &Law, aim: [f64; 3]) -> [[f64; 3]; 3] {
    let one = |inside: bool| f64::from(u8::from(inside));
    match *law {
        Law::Coulomb { friction, bound } => {
            let normal = one(aim[0] > 0.0 && aim[0] < bound);
            let (plane, out) = disc(aim[1], aim[2], friction * between(aim[0], 0.0, bound));
            let follow = friction * normal;
            [
                [normal, 0.0, 0.0],
                [follow * out[0], plane[0][0], plane[0][1]],
                [follow * out[1], plane[1][0], plane[1][1]],
            ]
        }
        Law::Cut { radius } => {
            let plane = circle(aim[0], aim[1], radius);
            let across = one(aim[2].abs() < radius);
            [[plane[0][0], plane[0][1], 0.0], [plane[1][0], plane[1][1], 0.0], [0.0, 0.0, across]]
        }
        Law::Bilateral { held } => {
            let [a, b, c] = held.map(one);
            [[a, 0.0, 0.0], [0.0, b, 0.0], [0.0, 0.0, c]]
        }
    }
}

/// Derivatives of the projection on a disc: by the point, and by the radius (zero inside).
fn disc(a: f64, b: f64, radius: f64) -> ([[f64; 2]; 2], [f64; 2]) {
    let length = hypot(a, b);
    if length <= radius {
        return ([[1.0, 0.0], [0.0, 1.0]], [0.0; 2]);
    }
    let (x, y, share) = (a / length, b / length, radius / length);
    ([[share * y * y, -share * x * y], [-share * x * y, share * x * x]], [x, y])
}

/// Derivative of the projection on a blade's circle.
fn circle(a: f64, b: f64, radius: f64) -> [[f64; 2]; 2] {
    let squared = a * a + b * b;
    if a <= 0.0 {
        return [[0.0; 2]; 2];
    }
    if squared <= radius * a {
        return [[1.0, 0.0], [0.0, 1.0]];
    }
    let (r, twice) = (radius / squared, 2.0 * radius * a / (squared * squared));
    [[2.0 * r * a - twice * a * a, -twice * a * b], [r * b - twice * b * a, r * a - twice * b * b]]
}

/// Solves in place by elimination with row pivoting; false where the matrix is singular.
fn eliminate(matrix: &mut [f64], right: &mut [f64]) -> bool {
    let rows = right.len();
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
    for k in (0..rows).rev() {
        let line = &matrix[k * rows..(k + 1) * rows];
        let known: f64 = line[k + 1..].iter().zip(&right[k + 1..]).map(|(m, x)| m * x).sum();
        right[k] = (right[k] - known) / line[k];
    }
    right.iter().all(|x| x.is_finite())
}
