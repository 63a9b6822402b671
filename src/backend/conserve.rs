//! Energy of a midpoint step.
//!
//! The midpoint rule keeps linear and angular momentum. Its kinetic energy changes by the work of the forces at the middle of the step, its
//! elastic energy by `W(u + Δx) − W(u)`; for a nonlinear law the two differ by the excess `ε = W(u + Δx) − W(u) − f(u + Δx/2)·Δx`, which is of
//! third order in the step and adds up without bound in steps that are long beside a body's vibrations. So the velocities at the end are
//! split into the rigid motion that has their momenta, `r = V + Ω × x`, and the rest, and
//!
//! `v' ← r + s (v' − r)`, `s² = 1 − ε/T`, `T = ½ (v' − r)·M (v' − r)`:
//!
//! the energy of the step is that of the work done on it, and both momenta stay. Nodes that are held or have rest-shape springs restrict `r` to
//! the rigid motions that leave them at rest.
//!
//! Where the excess is not small beside `T` and is more than damping takes (the step is many periods of what deforms), the step is solved again
//! with its elastic forces taken nearer to its end, at `u + τ Δx`, `τ` up to 1: their work then falls short of the change of the energy less, and
//! at 1 not at all for a convex `W`. Away from the middle they have a torque about it, whose angular momentum is given back to the rigid motion.
//! Such a step is of first order and counted ([`super::Nonlinear::elastic_at`]).
//! Source: Simo, Tarnow, Wong 1992 (projection of the midpoint rule on the surface of constant energy and momenta); Hairer, Lubich, Wanner 2006,
//! section IV.4; Simo, Wong 1991 (a parameter of the rule that keeps the energy). Differs: displacements are not projected, so that one solve
//! suffices.

use crate::bodies::Model;
use crate::bodies::grid::Hyperelastic;
use crate::error::Result;
use crate::kernels::Params;
use crate::math::{V4, solve_definite};
use crate::scene::Integrator;

/// Weight of held axes beside the mass of the body: what a rigid motion moves them by, relative to the others.
const HELD: f64 = 1e9;

/// Largest excess relative to `T` that velocities take: they lose up to 30 % of their deforming part. What damping takes in the same step may be
/// left.
const MOST_TAKEN: f64 = 0.5;

/// Where a step takes its elastic forces, one after the other until the excess is small enough.
const ELASTIC_AT: [f64; 6] = [0.5, 0.53125, 0.5625, 0.625, 0.75, 1.0];

/// Solves a step with its elastic forces at `u + τ Δx`, with `τ` as small as the excess allows.
pub(super) fn solve<T>(mut at: impl FnMut(f64) -> Result<(T, Ended)>) -> Result<(T, Ended)> {
    let mut solved = at(ELASTIC_AT[0])?;
    for elastic_at in &ELASTIC_AT[1..] {
        if solved.1.conserved {
            break;
        }
        solved = at(*elastic_at)?;
    }
    Ok(solved)
}

/// Velocities at the end of a step.
pub(super) struct Ended {
    /// `[node]` m/s
    pub v: Vec<V4<f64>>,
    /// They have taken the excess, which was small.
    pub conserved: bool,
}

/// Constant data of a body whose steps conserve energy.
#[derive(Clone)]
pub(super) struct Conserved {
    /// `[node]` rest position relative to the middle of the body, m.
    rest: Vec<[f64; 3]>,
    /// `[node]` DOF mask and mass, kg.
    dofs: Vec<V4<f64>>,
    /// `[node]` stiffness of its rest-shape spring, N/m; no rigid motion moves it where there is one.
    rest_stiffness: Vec<f64>,
    /// kg
    mass: f64,
    /// s
    step: f64,
    law: Hyperelastic,
    params: Params<f64>,
}

impl Conserved {
    /// Data of a body by the midpoint rule whose steps are solved by Newton's method; steps of linear bodies conserve energy by themselves.
    pub fn of(model: &Model) -> Option<Self> {
        let law = model.newton()?;
        // a model of sizes has no nodes to conserve anything of
        let conserves = model.step.integrator == Integrator::Midpoint && model.counts.is_none();
        conserves.then(|| Self::new(model, law))
    }

    fn new(model: &Model, law: &Hyperelastic) -> Self {
        let count = model.rest.len() as f64;
        let mut rest_stiffness = vec![0.0; model.rest.len()];
        let rest_springs = model.rest_springs.nodes.iter().zip(&model.rest_springs.stiffness);
        rest_springs.for_each(|(node, stiffness)| rest_stiffness[*node as usize] = *stiffness);
        let middle = [0, 1, 2].map(|n| model.rest.iter().map(|x| x[n]).sum::<f64>() / count);
        Self {
            rest: model.rest.iter().map(|x| [0, 1, 2].map(|n| x[n] - middle[n])).collect(),
            dofs: model.dofs.clone(),
            rest_stiffness,
            mass: model.dofs.iter().map(|dofs| dofs[3]).sum(),
            step: model.step.step,
            law: law.clone(),
            params: model.params(),
        }
    }

    /// Velocities at the end of a step from `u` and `v` with increments `dx`, `[node]` m and m/s, and elastic forces at `u + τ Δx`, less the
    /// excess `ε`, J; `linear` is the work of inertia and damping over the increments, J.
    pub fn end(
        &self,
        u: &[V4<f64>],
        v: &[V4<f64>],
        dx: &[V4<f64>],
        elastic_at: f64,
        [mut excess, linear]: [f64; 2],
    ) -> Ended {
        let at = |part: f64| -> Vec<V4<f64>> {
            u.iter().zip(dx).map(|(u, d)| std::array::from_fn(|n| u[n] + part * d[n])).collect()
        };
        let end = |(v, d): (&V4<f64>, &V4<f64>)| std::array::from_fn(|n| 2.0 * d[n] / self.step - v[n]);
        let mut v: Vec<V4<f64>> = v.iter().zip(dx).map(end).collect();
        // angular momentum of elastic forces away from the middle
        let (u, middle) = (at(1.0), at(0.5));
        if elastic_at != 0.5 && excess.is_finite() {
            let force = self.law.forces(&self.params, &[], &|_| true, &at(elastic_at));
            let mut momentum = [0.0; 6];
            for (node, axis) in (0..3 * u.len()).map(|n| (n / 3, n % 3)) {
                let (mode, push) =
                    (self.mode(node, axis, &middle), self.step * self.dofs[node][axis] * force[node][axis]);
                (0..6).for_each(|k| momentum[k] += push * mode[k]);
            }
            let back = solve_definite(self.inertia(&u), momentum);
            for (node, axis) in (0..3 * u.len()).map(|n| (n / 3, n % 3)) {
                let (before, dofs) = (v[node][axis], self.dofs[node]);
                v[node][axis] += dofs[axis] * dot(&back, &self.mode(node, axis, &u));
                excess += 0.5 * dofs[3] * (v[node][axis] * v[node][axis] - before * before);
            }
        }
        // energy that damping takes: the work without that of inertia and of rest-shape springs
        let stored = |node: usize| {
            let squared: f64 = (0..3).map(|n| self.dofs[node][n] * dx[node][n] * dx[node][n]).sum();
            (2.0 * self.dofs[node][3] / (self.step * self.step) + 0.5 * self.rest_stiffness[node]) * squared
        };
        let damped = linear - (0..dx.len()).map(stored).sum::<f64>();
        // kinetic energy of what is not rigid, and what it has in common with the rigid motion
        let rigid = self.rigid(&u, &v);
        let (mut deforming, mut common) = (0.0, 0.0);
        let rest = |node: usize, v: &[V4<f64>]| {
            [0, 1, 2].map(|axis| self.dofs[node][axis] * (v[node][axis] - dot(&rigid, &self.mode(node, axis, &u))))
        };
        for node in 0..u.len() {
            let (rest, mass) = (rest(node, &v), self.dofs[node][3]);
            for axis in 0..3 {
                deforming += 0.5 * mass * rest[axis] * rest[axis];
                common += mass * rest[axis] * (v[node][axis] - rest[axis]);
            }
        }
        if deforming == 0.0 {
            return Ended { v, conserved: excess <= damped };
        }
        // deforming s² + common s = deforming + common − taken
        let conserved = excess <= MOST_TAKEN * deforming + damped;
        let taken = if conserved { excess.min(MOST_TAKEN * deforming) } else { excess };
        let root = common * common + 4.0 * deforming * (deforming + common - taken);
        let scale = ((root.max(0.0).sqrt() - common) / (2.0 * deforming)).max(0.0);
        for node in 0..u.len() {
            let rest = rest(node, &v);
            (0..3).for_each(|axis| v[node][axis] += (scale - 1.0) * rest[axis]);
        }
        Ended { v, conserved }
    }

    /// Velocity of a node along an axis in the six rigid motions: along x, y, z, and about them.
    fn mode(&self, node: usize, axis: usize, u: &[V4<f64>]) -> [f64; 6] {
        let x: [f64; 3] = [0, 1, 2].map(|n| self.rest[node][n] + u[node][n]);
        let mut mode = [0.0; 6];
        let [next, last] = [(axis + 1) % 3, (axis + 2) % 3];
        (mode[axis], mode[3 + next], mode[3 + last]) = (1.0, x[last], -x[next]);
        mode
    }

    /// The rigid motion with the momentum of the velocities, along and about the axes: the one nearest to them in kinetic energy.
    fn rigid(&self, u: &[V4<f64>], v: &[V4<f64>]) -> [f64; 6] {
        let mut momentum = [0.0; 6];
        for (node, axis) in (0..3 * u.len()).map(|n| (n / 3, n % 3)) {
            let (mode, dofs) = (self.mode(node, axis, u), self.dofs[node]);
            (0..6).for_each(|k| momentum[k] += dofs[axis] * dofs[3] * mode[k] * v[node][axis]);
        }
        solve_definite(self.inertia(u), momentum)
    }

    /// Inertia of the six rigid motions; held nodes resist them.
    fn inertia(&self, u: &[V4<f64>]) -> [[f64; 6]; 6] {
        let mut matrix = [[0.0; 6]; 6];
        for (node, axis) in (0..3 * u.len()).map(|n| (n / 3, n % 3)) {
            let (mode, dofs) = (self.mode(node, axis, u), self.dofs[node]);
            let rests = dofs[axis] == 0.0 || self.rest_stiffness[node] > 0.0;
            let weight = if rests { HELD * self.mass } else { dofs[3] };
            (0..36).for_each(|n| matrix[n / 6][n % 6] += weight * mode[n / 6] * mode[n % 6]);
        }
        matrix
    }
}

fn dot(a: &[f64; 6], b: &[f64; 6]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
