//! Contact laws and their solver: projected block Gauss–Seidel on `δ = W λ + δ_free`, λ in newtons.
//!
//! Each contact has three rows. [`Law::Coulomb`]: row 0 is the normal, `0 ≤ λ_n ≤ bound`, `δ_n ≥ 0` with one of them zero (below the
//! bound); rows 1 and 2 are tangents, `|λ_t| ≤ μ λ_n`, opposing the slip. [`Law::Cut`]: a piece of edge inside the tissue; rows 0 and 1
//! span the blade's plane (forward, along), row 2 is its normal, two-sided, and ends at the same bound: tissue splits sideways no later.
//! The force in the plane opposes the motion and is at most `radius · cos θ`, `radius` = toughness × length, θ the angle between motion
//! and forward (Atkins 2009: push and slice): the work is toughness × area whatever the motion, and slicing lowers the push that a cut
//! takes. So forces lie in the circle through the origin with diameter `radius` along forward, and are projected on it along their own
//! direction, since they oppose the motion; a piece that goes back is free. (The whole disc of that radius, as friction has it, took 1.41
//! times toughness × area of an edge at 45°.) [`Law::Bilateral`]: ties, with all rows held
//! (attached, bilateral) or without the one along which something slides.
//!
//! [`relax`] is plain sweeps, for the haptic tick. [`solve`] ends within a budget of row updates, whatever it is given, and returns the best
//! iterate: sweeps and Newton steps (`newton`) inside of proximal steps (`proximal`, which says what is known of their convergence).
//!
//! Source: Jourdan, Alart, Jean 1998 (block Gauss–Seidel); Duriez et al. 2006 (its use for haptics); Alart, Curnier 1991 (Newton).
//! Differs: a disc's rows are divided by the largest compliance of their plane, not the mean, so that sticking always converges.

mod newton;
mod proximal;

pub use proximal::{Effort, Enough, solve};

use crate::math::elementary::hypot;
use crate::math::larger;
use serde::{Deserialize, Serialize};

/// How the three forces of a contact are bounded.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Law {
    /// Unilateral with a friction disc; the normal force ends at `bound` (infinite for what neither cuts nor splits), N.
    Coulomb {
        /// μ
        friction: f64,
        /// N
        bound: f64,
    },
    /// A piece of edge inside the tissue; N.
    Cut {
        /// N
        radius: f64,
    },
    /// Tied: rows that are held have no violation, whatever force that takes; the others have no force.
    Bilateral {
        /// Which of the three.
        held: [bool; 3],
    },
}

impl Law {
    /// The allowed forces nearest to `aim`, N; a friction disc is that of the allowed normal force.
    fn project(&self, aim: [f64; 3]) -> [f64; 3] {
        match *self {
            Self::Coulomb { friction, bound } => {
                let normal = between(aim[0], 0.0, bound);
                let (t, s) = onto_disc(aim[1], aim[2], friction * normal);
                [normal, t, s]
            }
            Self::Cut { radius } => {
                let (e, s) = onto_circle(aim[0], aim[1], radius);
                [e, s, between(aim[2], -radius, radius)]
            }
            Self::Bilateral { held } => [0, 1, 2].map(|k| if held[k] { aim[k] } else { 0.0 }),
        }
    }

    /// Whether forces have reached what the tissue bears, so that the edge goes on.
    pub fn at_bound(&self, force: [f64; 3]) -> bool {
        const NEAR: f64 = 1.0 - 1e-6;
        match self {
            Self::Coulomb { bound, .. } => force[0] >= bound * NEAR,
            Self::Cut { radius } => {
                let [f, s, n] = force;
                f * f + s * s >= radius * f * NEAR || n.abs() >= radius * NEAR
            }
            Self::Bilateral { .. } => false,
        }
    }
}

/// How a contact solve ended.
#[derive(Clone, Copy, Debug, Default)]
pub struct Ended {
    /// Sweeps done.
    pub sweeps: u32,
    /// Newton steps done.
    pub steps: u32,
    /// Proximal steps done.
    pub rounds: u32,
    /// Row updates that all of these took.
    pub updates: u64,
    /// What the forces leave of the laws.
    pub residual: Residual,
    /// As small as was wanted, or as is enough.
    pub converged: bool,
}

/// What forces leave of their laws: the natural map `F = λ − P(λ − δ/c)`, zero exactly where the laws hold.
#[derive(Clone, Copy, Debug, Default)]
pub struct Residual {
    /// Largest change that one more projection would make, N.
    pub force: f64,
    /// The same times its compliance, m: penetration, slip of what should stick, and distance of what is held.
    pub gap: f64,
    /// `Σ c F²`, N·m.
    pub energy: f64,
    /// Contacts of which a row that could bear a force has no compliance; its force is 0.
    pub dropped: u32,
}

/// A diagonal entry of `W` below this share of the largest is rounding, not compliance: both sides of the row hang on one body.
const NOTHING: f64 = 1e-13;

/// Plain sweeps until forces change by less than `tolerance` of their sum per sweep, or `max_sweeps`; returns how many.
///
/// For the haptic tick: allocates nothing, looks at no residual. Arguments as in [`solve`].
pub fn relax(laws: &[Law], w: &[f64], free: &[f64], force: &mut [f64], tolerance: f64, max_sweeps: u32) -> u32 {
    let floor = floor(w, force.len());
    for done in 0..max_sweeps {
        let change = sweep(laws, w, free, force, floor);
        let total: f64 = force.iter().map(|f| f.abs()).sum();
        if change <= tolerance * total {
            return done + 1;
        }
    }
    max_sweeps
}

/// One sweep over all contacts in order; returns the largest change of a force, N.
fn sweep(laws: &[Law], w: &[f64], free: &[f64], force: &mut [f64], floor: f64) -> f64 {
    let mut largest = 0.0f64;
    for (contact, law) in laws.iter().enumerate() {
        let first = 3 * contact;
        let old = [force[first], force[first + 1], force[first + 2]];
        let c = scales(law, w, force.len(), first, floor);
        let aim = |k: usize, force: &[f64]| aim(w, free, force, first + k, c[k]);
        match *law {
            Law::Coulomb { friction, bound } => {
                force[first] = between(aim(0, force), 0.0, bound);
                let (t, s) = (aim(1, force), aim(2, force));
                (force[first + 1], force[first + 2]) = onto_disc(t, s, friction * force[first]);
            }
            Law::Cut { radius } => {
                let (e, s) = (aim(0, force), aim(1, force));
                // half way: the whole way, pieces of one edge may chase each other for ever
                let (e, s) = onto_circle(e, s, radius);
                (force[first], force[first + 1]) = (0.5 * (old[0] + e), 0.5 * (old[1] + s));
                force[first + 2] = between(aim(2, force), -radius, radius);
            }
            Law::Bilateral { held } => {
                for k in 0..3 {
                    force[first + k] = if held[k] { aim(k, force) } else { 0.0 };
                }
            }
        }
        for k in 0..3 {
            largest = largest.max((force[first + k] - old[k]).abs());
        }
    }
    largest
}

/// What `force` leaves of the laws. Arguments as in [`solve`].
pub fn residual(laws: &[Law], w: &[f64], free: &[f64], force: &[f64]) -> Residual {
    residual_at(laws, w, free, force, 1.0)
}

/// The same with the compliances `c` of the natural map times a share; it is zero at the same forces.
fn residual_at(laws: &[Law], w: &[f64], free: &[f64], force: &[f64], share: f64) -> Residual {
    let floor = floor(w, force.len());
    let mut found = Residual::default();
    for (contact, law) in laws.iter().enumerate() {
        let first = 3 * contact;
        let c = scales(law, w, force.len(), first, floor).map(|c| share * c);
        let bears = match law {
            Law::Coulomb { friction: 0.0, .. } => 1,
            Law::Coulomb { .. } | Law::Cut { .. } => 3,
            Law::Bilateral { .. } => 0, // what is held already needs no tie
        };
        found.dropped += u32::from(c[..bears].contains(&0.0));
        let aim = [0, 1, 2].map(|k| aim(w, free, force, first + k, c[k]));
        let held = law.project(aim);
        for k in 0..3 {
            let change = (force[first + k] - held[k]).abs();
            found.force = larger(found.force, change);
            found.gap = larger(found.gap, c[k] * change);
            found.energy += c[k] * change * change;
        }
    }
    found
}

/// `δ` of a row, m.
fn violation(w: &[f64], free: &[f64], force: &[f64], row: usize) -> f64 {
    let line = &w[row * force.len()..(row + 1) * force.len()];
    free[row] + line.iter().zip(force).map(|(w, f)| w * f).sum::<f64>()
}

/// Least diagonal entry of `W` that counts, m/N.
fn floor(w: &[f64], rows: usize) -> f64 {
    let own = w.iter().step_by(rows + 1).filter(|c| c.is_finite());
    NOTHING * own.fold(0.0f64, |most, c| most.max(*c))
}

/// Compliances `c` by which violations become forces, m/N: a row's own, and for a disc the largest of its plane (with less a row that
/// sticks may swing for ever). 0 for a row without compliance that a force could act on; it has none.
fn scales(law: &Law, w: &[f64], rows: usize, first: usize, floor: f64) -> [f64; 3] {
    let at = |i: usize, j: usize| w[(first + i) * rows + first + j];
    let gives = |k: usize| at(k, k).is_finite() && at(k, k) > floor;
    let plane = |i: usize, j: usize| match (gives(i), gives(j)) {
        (true, true) => {
            let coupling = 0.5 * (at(i, j) + at(j, i));
            0.5 * (at(i, i) + at(j, j)) + hypot(0.5 * (at(i, i) - at(j, j)), coupling)
        }
        (true, false) => at(i, i),
        _ => at(j, j),
    };
    let [a, b, c] = match law {
        Law::Coulomb { .. } => [at(0, 0), plane(1, 2), plane(1, 2)],
        Law::Cut { .. } => [plane(0, 1), plane(0, 1), at(2, 2)],
        Law::Bilateral { .. } => [at(0, 0), at(1, 1), at(2, 2)],
    };
    let of = |k: usize, c: f64| if gives(k) { c } else { 0.0 };
    [of(0, a), of(1, b), of(2, c)]
}

/// Where a row's force would go without its bounds, N; 0 for a row without compliance.
fn aim(w: &[f64], free: &[f64], force: &[f64], row: usize, scale: f64) -> f64 {
    if scale > 0.0 { force[row] - violation(w, free, force, row) / scale } else { 0.0 }
}

/// `clamp` that takes any bounds and keeps what is not a number.
fn between(x: f64, low: f64, high: f64) -> f64 {
    if x < low {
        low
    } else if x > high {
        high
    } else {
        x
    }
}

fn onto_disc(a: f64, b: f64, radius: f64) -> (f64, f64) {
    let length = hypot(a, b);
    if length <= radius { (a, b) } else { (a * radius / length, b * radius / length) }
}

/// Along its own direction onto the circle through the origin whose diameter is `radius` along `a`; nothing where it points back.
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

#[cfg(test)]
mod tests {
    use super::*;

    const EXACT: Effort = Effort { wanted: 1e-12, enough: Enough { share: 0.0, gap: 0.0 }, updates: 100_000 };
    const W: [f64; 9] = [1e-3, 1e-4, 0.0, 1e-4, 2e-3, 0.0, 0.0, 0.0, 2e-3];

    fn run(law: Law, free: [f64; 3]) -> [f64; 3] {
        let mut force = [0.0; 3];
        let ended = solve(&[law], &W, &free, &mut force, &EXACT);
        assert!(ended.converged);
        force
    }

    #[test]
    fn a_closing_gap_is_stopped_and_an_open_one_left_alone() {
        let law = Law::Coulomb { friction: 0.0, bound: f64::INFINITY };
        assert!((run(law, [-1e-3, 0.0, 0.0])[0] - 1.0).abs() < 1e-9);
        assert_eq!(run(law, [1e-3, 1e-3, 0.0]), [0.0; 3]);
    }

    #[test]
    fn friction_sticks_below_its_limit_and_slides_on_the_disc_above_it() {
        let law = Law::Coulomb { friction: 0.5, bound: f64::INFINITY };
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
}
