//! Contact laws and their solver: projected block Gauss–Seidel on `δ = W λ + δ_free`, λ in newtons.
//!
//! Each contact has three rows. [`Law::Coulomb`]: row 0 is the normal, `0 ≤ λ_n ≤ bound`, `δ_n ≥ 0` with one of them zero (below the
//! bound); rows 1 and 2 are tangents, `|λ_t| ≤ μ λ_n`, opposing the slip. [`Law::Cut`]: a piece of edge inside the tissue; rows 0 and 1
//! span the blade's plane (forward, along), row 2 is its normal, two-sided, and ends at the same bound: tissue splits sideways no later. The force in the plane opposes the motion, forward force
//! only pushes back, and both together are at most `radius` = toughness × length (Atkins 2009: push and slice); whatever the motion, the
//! force takes energy out. The disc is projected as friction is (true disc, no pyramid).
//! Source: Jourdan, Alart, Jean 1998 (block Gauss–Seidel); Duriez et al. 2006 (its use for haptics).

/// How the three forces of a contact are bounded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Law {
    /// Unilateral with a friction disc; the normal force ends at `bound` (infinite for what does not cut), N.
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
}

impl Law {
    /// Whether forces have reached what the tissue bears, so that the edge goes on.
    pub fn at_bound(&self, force: [f64; 3]) -> bool {
        const NEAR: f64 = 1.0 - 1e-6;
        match self {
            Self::Coulomb { bound, .. } => force[0] >= bound * NEAR,
            Self::Cut { radius } => force[0].hypot(force[1]) >= radius * NEAR || force[2].abs() >= radius * NEAR,
        }
    }
}

/// How a contact solve ended.
#[derive(Clone, Copy, Debug, Default)]
pub struct Ended {
    /// Sweeps done.
    pub sweeps: u32,
    /// Largest change of a force in the last sweep, N.
    pub change: f64,
    /// Small enough.
    pub converged: bool,
}

/// Sweeps until forces change by less than `tolerance` of their sum per sweep, or `max_sweeps`.
///
/// `w` is the compliance by rows, `[3·contacts]²`, m/N; `free` the violation without contact force, m; `force` start and result, N.
pub fn solve(laws: &[Law], w: &[f64], free: &[f64], force: &mut [f64], tolerance: f64, max_sweeps: u32) -> Ended {
    let mut ended = Ended { converged: laws.is_empty(), ..Ended::default() };
    while !ended.converged && ended.sweeps < max_sweeps {
        ended.change = sweep(laws, w, free, force);
        ended.sweeps += 1;
        let total: f64 = force.iter().map(|f| f.abs()).sum();
        ended.converged = ended.change <= tolerance * total;
    }
    ended
}

/// One sweep over all contacts in order; returns the largest change of a force, N.
pub fn sweep(laws: &[Law], w: &[f64], free: &[f64], force: &mut [f64]) -> f64 {
    let rows = force.len();
    let mut largest = 0.0f64;
    for (contact, law) in laws.iter().enumerate() {
        let first = 3 * contact;
        let old = [force[first], force[first + 1], force[first + 2]];
        let violation = |row: usize, force: &[f64]| {
            let line = &w[row * rows..(row + 1) * rows];
            free[row] + line.iter().zip(force).map(|(w, f)| w * f).sum::<f64>()
        };
        let own = |row: usize| w[row * rows + row];
        match *law {
            Law::Coulomb { friction, bound } => {
                force[first] = (old[0] - violation(first, force) / own(first)).clamp(0.0, bound);
                let compliance = 0.5 * (own(first + 1) + own(first + 2));
                let slip = [violation(first + 1, force), violation(first + 2, force)];
                let (t, s) = (old[1] - slip[0] / compliance, old[2] - slip[1] / compliance);
                (force[first + 1], force[first + 2]) = onto_disc(t, s, friction * force[first]);
            }
            Law::Cut { radius } => {
                let compliance = 0.5 * (own(first) + own(first + 1));
                let slip = [violation(first, force), violation(first + 1, force)];
                let (e, s) = ((old[0] - slip[0] / compliance).max(0.0), old[1] - slip[1] / compliance);
                (force[first], force[first + 1]) = onto_disc(e, s, radius);
                force[first + 2] = (old[2] - violation(first + 2, force) / own(first + 2)).clamp(-radius, radius);
            }
        }
        for k in 0..3 {
            largest = largest.max((force[first + k] - old[k]).abs());
        }
    }
    largest
}

fn onto_disc(a: f64, b: f64, radius: f64) -> (f64, f64) {
    let length = a.hypot(b);
    if length <= radius { (a, b) } else { (a * radius / length, b * radius / length) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const W: [f64; 9] = [1e-3, 1e-4, 0.0, 1e-4, 2e-3, 0.0, 0.0, 0.0, 2e-3];

    fn run(law: Law, free: [f64; 3]) -> [f64; 3] {
        let mut force = [0.0; 3];
        let ended = solve(&[law], &W, &free, &mut force, 1e-12, 10_000);
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
    fn a_cutting_edge_resists_forward_motion_within_its_disc_and_lets_go_backward() {
        let law = Law::Cut { radius: 0.4 };
        let deep = run(law, [-1e-2, -1e-2, 0.0]);
        assert!((deep[0].hypot(deep[1]) - 0.4).abs() < 1e-9 && deep[0] > 0.0);
        let back = run(law, [1e-2, 0.0, 5e-4]);
        assert_eq!(back[0], 0.0);
        assert!((back[2] + 0.25).abs() < 1e-9, "the row across is two-sided: {}", back[2]);
        assert_eq!(run(law, [1e-2, 0.0, 5e-2])[2], -0.4);
    }
}
