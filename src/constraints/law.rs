//! Laws of contacts and constraints: the forces that each allows, and what the solvers need of it.
//!
//! A law has one to three rows, each with one force. Rows are projected in groups, one after the other: a friction disc after the normal
//! force that sets its radius. [`Law::groups`], [`Law::project`] and its derivative [`Law::slope`] describe a law, with what
//! [`Law::under_relaxes`], [`Law::is_monotone`] and [`Law::is_constraint`] say of it; the solvers know no particular law.

use super::between;
use crate::math::elementary::hypot;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Rows that are projected together.
type Groups = &'static [Range<usize>];
const SINGLY: Groups = &[0..1, 1..2, 2..3];
const NORMAL_THEN_DISC: Groups = &[0..1, 1..3];
const PLANE_THEN_ACROSS: Groups = &[0..2, 2..3];

/// Law of a contact or a constraint: the bounds on its forces.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Law {
    /// Unilateral contact with Coulomb friction. Row 0 is the normal: `0 ≤ λ_n ≤ bound`, `δ_n ≥ 0`, one of them zero below the bound. Rows
    /// 1 and 2 are the tangents: `|λ_t| ≤ μ λ_n`, against the slip. Without friction the law has the normal row alone.
    Coulomb {
        /// μ
        friction: f64,
        /// Normal force at which the tissue is cut or splits, N; infinite for a contact that does neither.
        bound: f64,
    },
    /// Piece of edge inside the tissue. Rows 0 and 1 span the blade's plane (forward, along the edge), row 2 is its normal.
    ///
    /// The in-plane force opposes the motion and is at most `radius · cos θ`, θ the angle between motion and forward (push and slice,
    /// Atkins 2009): the work is toughness × area for any motion, and slicing lowers the push. Allowed forces therefore lie in the circle
    /// through the origin with diameter `radius` along forward, and are projected on it along their own direction, since they oppose the
    /// motion; a piece that moves back is free. (The disc of that radius, as for friction, took 1.41 times toughness × area with an edge at
    /// 45°.) The normal row is two-sided with the same bound: tissue splits sideways no later.
    Cut {
        /// Toughness × length, N.
        radius: f64,
    },
    /// Bilateral constraint: zero violation by any force.
    Bilateral {
        /// Number of constrained axes, from the first: 1 to 3.
        rows: usize,
    },
    /// Thread in a hole, runner on a rail. Rows 0 and 1, across the path, are bilateral; row 2 is along it, with friction against the slip,
    /// `|λ_s| ≤ μ |λ_across| + resistance`.
    ///
    /// Along a path of many points, each with its own change of direction, the tension grows by `e^{μφ}` over an angle φ (Euler 1769).
    Slide {
        /// μ
        friction: f64,
        /// Friction force of the path without load, N.
        resistance: f64,
    },
}

impl Law {
    /// Contact without a bound on the normal force.
    pub fn contact(friction: f64) -> Self {
        Self::Coulomb { friction, bound: f64::INFINITY }
    }

    /// Groups of rows, in the order of projection.
    pub(super) fn groups(&self) -> Groups {
        match self {
            Self::Coulomb { friction: 0.0, .. } => &SINGLY[..1],
            Self::Coulomb { .. } => NORMAL_THEN_DISC,
            Self::Cut { .. } => PLANE_THEN_ACROSS,
            Self::Bilateral { rows } => &SINGLY[..*rows],
            Self::Slide { .. } => SINGLY,
        }
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.groups().last().map_or(0, |group| group.end)
    }

    /// Rows of friction, which acts against the slip since the start of the step.
    pub fn friction_rows(&self) -> Range<usize> {
        match self {
            Self::Coulomb { .. } => 1..self.rows().max(1),
            Self::Slide { .. } => 2..3,
            Self::Cut { .. } | Self::Bilateral { .. } => 0..0,
        }
    }

    /// Whether it is a constraint, which is always active; a contact opens and closes.
    pub fn is_constraint(&self) -> bool {
        matches!(self, Self::Bilateral { .. } | Self::Slide { .. })
    }

    /// Projection of `trial` on the allowed forces, N; 0 beyond the last row. A group depends only on itself and on earlier groups.
    pub(super) fn project(&self, trial: [f64; 3]) -> [f64; 3] {
        let [a, b, c] = trial;
        match *self {
            Self::Coulomb { friction: 0.0, bound } => [between(a, 0.0, bound), 0.0, 0.0],
            Self::Coulomb { friction, bound } => {
                let normal = between(a, 0.0, bound);
                let (t, s) = onto_disc(b, c, friction * normal);
                [normal, t, s]
            }
            Self::Cut { radius } => {
                let (e, s) = onto_circle(a, b, radius);
                [e, s, between(c, -radius, radius)]
            }
            Self::Bilateral { rows } => [0, 1, 2].map(|k| if k < rows { trial[k] } else { 0.0 }),
            Self::Slide { friction, resistance } => {
                let most = friction * hypot(a, b) + resistance;
                [a, b, between(c, -most, most)]
            }
        }
    }

    /// Derivative of [`Law::project`], `[force][trial]`.
    pub(super) fn slope(&self, trial: [f64; 3]) -> [[f64; 3]; 3] {
        let one = |inside: bool| f64::from(u8::from(inside));
        let diagonal = |[a, b, c]: [f64; 3]| [[a, 0.0, 0.0], [0.0, b, 0.0], [0.0, 0.0, c]];
        match *self {
            Self::Coulomb { friction, bound } => {
                let normal = one(trial[0] > 0.0 && trial[0] < bound);
                if friction == 0.0 {
                    return diagonal([normal, 0.0, 0.0]);
                }
                let (plane, out) = disc_slope(trial[1], trial[2], friction * between(trial[0], 0.0, bound));
                let follow = friction * normal;
                [
                    [normal, 0.0, 0.0],
                    [follow * out[0], plane[0][0], plane[0][1]],
                    [follow * out[1], plane[1][0], plane[1][1]],
                ]
            }
            Self::Cut { radius } => {
                let plane = circle_slope(trial[0], trial[1], radius);
                let across = one(trial[2].abs() < radius);
                [[plane[0][0], plane[0][1], 0.0], [plane[1][0], plane[1][1], 0.0], [0.0, 0.0, across]]
            }
            Self::Bilateral { rows } => diagonal([0, 1, 2].map(|k| one(k < rows))),
            Self::Slide { friction, resistance } => {
                let across = hypot(trial[0], trial[1]);
                if trial[2].abs() <= friction * across + resistance {
                    return diagonal([1.0; 3]);
                }
                let follow =
                    |k: usize| if across > 0.0 { friction * trial[k] / across * trial[2].signum() } else { 0.0 };
                [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [follow(0), follow(1), 0.0]]
            }
        }
    }

    /// Whether each group's force, for given forces of the others, never falls as what it opposes grows. That of an edge turns with the motion, and
    /// falls where slicing takes over from pushing.
    pub(super) fn is_monotone(&self) -> bool {
        !matches!(self, Self::Cut { .. })
    }

    /// Whether a sweep goes only half way to a group's projection: in an edge's plane, where pieces of one edge that go the whole way may
    /// oscillate for ever.
    pub(super) fn under_relaxes(&self, group: &Range<usize>) -> bool {
        matches!(self, Self::Cut { .. }) && group.start == 0
    }

    /// Whether the force has reached the tissue's resistance, so that the edge advances.
    pub fn at_bound(&self, force: [f64; 3]) -> bool {
        const NEAR: f64 = 1.0 - 1e-6;
        match self {
            Self::Coulomb { bound, .. } => force[0] >= bound * NEAR,
            Self::Cut { radius } => {
                let [f, s, n] = force;
                f * f + s * s >= radius * f * NEAR || n.abs() >= radius * NEAR
            }
            Self::Bilateral { .. } | Self::Slide { .. } => false,
        }
    }
}

fn onto_disc(a: f64, b: f64, radius: f64) -> (f64, f64) {
    let length = hypot(a, b);
    if length <= radius { (a, b) } else { (a * radius / length, b * radius / length) }
}

/// Derivatives of the projection on a disc: with respect to the point, and to the radius (zero inside).
fn disc_slope(a: f64, b: f64, radius: f64) -> ([[f64; 2]; 2], [f64; 2]) {
    let length = hypot(a, b);
    if length <= radius {
        return ([[1.0, 0.0], [0.0, 1.0]], [0.0; 2]);
    }
    let (x, y, share) = (a / length, b / length, radius / length);
    ([[share * y * y, -share * x * y], [-share * x * y, share * x * x]], [x, y])
}

/// Projection along its own direction on the circle through the origin with diameter `radius` along `a`; zero if it points back.
fn onto_circle(a: f64, b: f64, radius: f64) -> (f64, f64) {
    let squared = a * a + b * b;
    if a <= 0.0 {
        (0.0, 0.0)
    } else if squared <= radius * a {
        (a, b)
    } else {
        (a * radius * a / squared, b * radius * a / squared)
    }
}

/// Derivative of [`onto_circle`].
fn circle_slope(a: f64, b: f64, radius: f64) -> [[f64; 2]; 2] {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;

    const LAWS: [Law; 8] = [
        Law::Coulomb { friction: 0.0, bound: 0.7 },
        Law::Coulomb { friction: 0.4, bound: 0.7 },
        Law::Cut { radius: 0.8 },
        Law::Bilateral { rows: 1 },
        Law::Bilateral { rows: 2 },
        Law::Bilateral { rows: 3 },
        Law::Slide { friction: 0.0, resistance: 0.3 },
        Law::Slide { friction: 0.5, resistance: 0.1 },
    ];

    #[test]
    fn friction_acts_along_the_rows_that_slide() {
        let rows = LAWS.map(|law| law.friction_rows());
        assert_eq!(rows, [1..1, 1..3, 0..0, 0..0, 0..0, 0..0, 2..3, 2..3]);
        assert!(LAWS.iter().all(|law| law.friction_rows().end <= law.rows()), "rows that a law does not have");
    }

    fn aims() -> impl Iterator<Item = [f64; 3]> {
        let mut random = Random::new(7);
        std::iter::repeat_with(move || [0; 3].map(|_| random.signed())).take(500)
    }

    /// Largest difference between `slope` and central differences of the projection, away from the law's kinks.
    fn off(law: Law, slope: impl Fn([f64; 3]) -> [[f64; 3]; 3]) -> f64 {
        const STEP: f64 = 1e-6;
        let mut worst = 0.0f64;
        for trial in aims() {
            let at = |k: usize, by: f64| {
                let mut trial = trial;
                trial[k] += by;
                law.project(trial)
            };
            for k in 0..3 {
                let [low, here, high] = [-STEP, 0.0, STEP].map(|by| at(k, by));
                for row in 0..law.rows() {
                    let (back, on) = ((here[row] - low[row]) / STEP, (high[row] - here[row]) / STEP);
                    if (back - on).abs() < 1e-3 {
                        worst = worst.max((slope(trial)[row][k] - 0.5 * (back + on)).abs());
                    }
                }
            }
        }
        worst
    }

    #[test]
    fn slopes_are_the_derivatives_of_the_projections() {
        for law in LAWS {
            let worst = off(law, |trial| law.slope(trial));
            assert!(worst < 1e-4, "{law:?}: {worst:e}");
        }
        let other = off(Law::Slide { friction: 0.5, resistance: 0.1 }, |trial| {
            Law::Slide { friction: 0.4, resistance: 0.1 }.slope(trial)
        });
        assert!(other > 0.05, "the counter-test: another μ gives the same slope");
    }

    #[test]
    fn what_is_allowed_stays_and_rows_that_a_law_has_not_bear_nothing() {
        for law in LAWS {
            assert_eq!(law.groups().iter().map(|group| group.len()).sum::<usize>(), law.rows());
            for trial in aims() {
                let once = law.project(trial);
                let twice = law.project(once);
                let same = once.iter().zip(twice).all(|(a, b)| (a - b).abs() <= 1e-15);
                assert!(same, "{law:?}: {trial:?} to {once:?} to {twice:?}");
                assert!(once[law.rows()..].iter().all(|force| *force == 0.0), "{law:?}: {once:?}");
            }
        }
    }

    #[test]
    fn groups_depend_on_those_before_them_alone() {
        for law in LAWS {
            for trial in aims() {
                let mut forces = trial;
                for group in law.groups() {
                    let projected = law.project(forces);
                    forces[group.clone()].copy_from_slice(&projected[group.clone()]);
                }
                let whole = law.project(trial);
                let same = (0..law.rows()).all(|k| (forces[k] - whole[k]).abs() <= 1e-15);
                assert!(same, "{law:?}: {forces:?} by groups, {whole:?} at once");
            }
        }
    }
}
