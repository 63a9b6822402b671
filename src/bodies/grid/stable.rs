//! Critical time step of symplectic Euler.
//!
//! For a vibration `ω` with damping `c = r_M + r_K ω²`, a step multiplies `(u, v)` by a matrix of determinant `1 − h c` and trace
//! `2 − h c − h² ω²`. Both eigenvalues stay within the unit circle if `h² ω² + 2 h c < 4`. The largest `ω` is decisive:
//! `h = 4 / (c + √(c² + 4 ω²))`. `ω²` is the largest eigenvalue of `M⁻¹ K` of the body at rest, found by Lanczos' method on
//! `M^(−½) K M^(−½)` with the matrix-free product. A bent or compressed body may be stiffer.
//! Source: Lanczos 1950; Golub, Van Loan 2013, section 10.1; Hughes 1987, section 9.2 (critical steps).

use super::element::rounded_modes;
use crate::bodies::{Kind, Model};
use crate::kernels::Params;
use crate::kernels::product::{Frames, LANES, cell_groups, product};
use crate::math::random::Random;
use crate::math::{V4, norm};
use crate::scene::Mass;

/// Maximum number of Lanczos steps; 30 to 60 are usual.
const MOST: usize = 500;
/// The iteration stops when this many steps raise the largest eigenvalue by less than the fraction `RISE`.
const WITHOUT_RISE: usize = 8;
const RISE: f64 = 1e-7;

impl Model {
    /// Critical step (see the module), s; infinite for a body without free nodes. For hexahedra with lumped or uniform masses.
    pub fn stable_step(&self) -> f64 {
        assert!(
            matches!(self.kind, Kind::Hexahedra(_)) && self.mass != Mass::Consistent,
            "scenes of others are refused"
        );
        let squared = self.largest_frequency_squared();
        let damping = self.step.rayleigh_mass + self.step.rayleigh_stiffness * squared;
        4.0 / (damping + (damping * damping + 4.0 * squared).sqrt())
    }

    /// Largest `ω²` of the body at rest, 1/s².
    pub fn largest_frequency_squared(&self) -> f64 {
        let count = self.grid.node_count();
        let params = Params { inertia: 0.0, stiffness_factor: 1.0, ..self.params::<f64>() };
        let params = Params { node_count: count as u32, extra_columns: 0, split_cells: 0, touched_nodes: 0, ..params };
        // small strain, with the stiffness of the volume
        let params = Params { corotational: 0, ..params };
        let (modes, layers) = (rounded_modes(&self.hexahedra().stiffness), &self.grid.layer_of);
        let upright = Frames::new(&params, &vec![[0.0, 0.0, 0.0, 1.0]; self.grid.cell_count()], &[]);
        let mut scratch = vec![[[[0.0; LANES]; 3]; 8]; cell_groups(&params)];
        let root: Vec<f64> =
            self.dofs[..count].iter().map(|f| if f[3] > 0.0 { f[3].sqrt().recip() } else { 0.0 }).collect();
        let mut scaled = vec![[0.0; 4]; count];
        let mut force = vec![[0.0; 4]; count];
        let mut apply = |q: &[V4<f64>], w: &mut [V4<f64>]| {
            for i in 0..count {
                scaled[i] = std::array::from_fn(|n| if n < 3 { q[i][n] * root[i] * self.dofs[i][n] } else { 0.0 });
            }
            product(&params, &modes, layers, &upright, &self.dofs[..count], &scaled, &mut force, &mut scratch);
            for (node, stiffness) in self.rest_springs.nodes.iter().zip(&self.rest_springs.stiffness) {
                let i = *node as usize;
                (0..3).for_each(|n| force[i][n] += stiffness * scaled[i][n]);
            }
            for i in 0..count {
                w[i] = force[i].map(|f| f * root[i]);
            }
        };
        lanczos(&first(count), &mut apply)
    }
}

/// Start vector with components of every mode: pseudo-random numbers, the same on every machine.
fn first(count: usize) -> Vec<V4<f64>> {
    let mut random = Random::new(1);
    (0..count).map(|_| [random.signed(), random.signed(), random.signed(), 0.0]).collect()
}

/// Largest eigenvalue of a symmetric positive semidefinite operator.
fn lanczos(start: &[V4<f64>], apply: &mut impl FnMut(&[V4<f64>], &mut [V4<f64>])) -> f64 {
    let mut w = vec![[0.0; 4]; start.len()];
    // the operator leaves out fixed axes; so does its result
    apply(start, &mut w);
    let size = norm(&w);
    if size == 0.0 {
        return 0.0;
    }
    let mut q: Vec<V4<f64>> = w.iter().map(|v| v.map(|c| c / size)).collect();
    let mut before = vec![[0.0; 4]; q.len()];
    let (mut diagonal, mut off, mut found) = (vec![], vec![], vec![]);
    while diagonal.len() < MOST {
        apply(&q, &mut w);
        let alpha: f64 = q.iter().zip(&w).map(|(q, w)| (0..3).map(|n| q[n] * w[n]).sum::<f64>()).sum();
        let beta = off.last().copied().unwrap_or(0.0);
        for i in 0..q.len() {
            (0..3).for_each(|n| w[i][n] -= alpha * q[i][n] + beta * before[i][n]);
        }
        diagonal.push(alpha);
        let largest = largest_of(&diagonal, &off);
        found.push(largest);
        let next = norm(&w);
        let settled = found.len() > WITHOUT_RISE && largest - found[found.len() - 1 - WITHOUT_RISE] <= RISE * largest;
        if settled || next <= f64::EPSILON * largest {
            break;
        }
        off.push(next);
        before = std::mem::replace(&mut q, w.iter().map(|v| v.map(|c| c / next)).collect());
    }
    found.last().copied().unwrap_or(0.0)
}

/// Largest eigenvalue of a symmetric tridiagonal matrix, by bisection on the signs of the pivots (Sturm sequence).
fn largest_of(diagonal: &[f64], off: &[f64]) -> f64 {
    let reach = |i: usize| if i < off.len() { off[i].abs() } else { 0.0 };
    let around = |i: usize| reach(i) + if i > 0 { reach(i - 1) } else { 0.0 };
    let mut high = (0..diagonal.len()).map(|i| diagonal[i] + around(i)).fold(f64::NEG_INFINITY, f64::max);
    let mut low = diagonal.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let all_below = |x: f64| {
        let mut pivot = diagonal[0] - x;
        let mut below = pivot < 0.0;
        for i in 1..diagonal.len() {
            below = below && pivot < 0.0;
            pivot = diagonal[i] - x - off[i - 1] * off[i - 1] / pivot;
        }
        below && pivot < 0.0
    };
    while high - low > 4.0 * f64::EPSILON * high.abs() {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        if all_below(middle) { high = middle } else { low = middle }
    }
    high
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chain_has_its_known_largest_eigenvalue() {
        // 2 on the diagonal, −1 beside it: 2 + 2 cos(π/(n + 1))
        for n in [1usize, 2, 3, 10, 100] {
            let exact = 2.0 + 2.0 * (std::f64::consts::PI / (n as f64 + 1.0)).cos();
            let found = largest_of(&vec![2.0; n], &vec![-1.0; n - 1]);
            assert!((found - exact).abs() < 1e-12, "{n}: {found}, wanted {exact}");
            let mut chain = |q: &[V4<f64>], w: &mut [V4<f64>]| {
                for i in 0..n {
                    let below = if i > 0 { q[i - 1][0] } else { 0.0 };
                    let above = if i + 1 < n { q[i + 1][0] } else { 0.0 };
                    w[i] = [2.0 * q[i][0] - below - above, 0.0, 0.0, 0.0];
                }
            };
            let found = lanczos(&first(n), &mut chain);
            assert!((found / exact - 1.0).abs() < 1e-5, "Lanczos, {n}: {found}, wanted {exact}");
        }
    }
}
