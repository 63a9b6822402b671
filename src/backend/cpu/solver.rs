//! Solves on the CPU path: conjugate gradients over the right-hand sides, explicit steps, and Newton's method.

use super::{CpuBackend, request};
use crate::backend::conserve;
use crate::backend::newton::{Descent, Shifted, TrialPoint, newton, solve_shifted};
use crate::backend::{FREE, SolveRequest, Target};
use crate::bodies::cpu::{Start, Trial, Workspace};
use crate::error::{Error, Result, unless};
use crate::kernels::accelerate::accelerate;
use crate::linear::{Outcome, SolverVectors, solve};
use crate::math::{Real, V3, V4, norm, round, widen};
use rayon::prelude::*;

impl<R: Real> CpuBackend<R> {
    /// Values of `x` at (right-hand side, node), m.
    pub(super) fn picked(&self, pick: &[(usize, u32)]) -> Vec<[f64; 3]> {
        let value = |(rhs, node): &(usize, u32)| self.x[rhs * self.node_count + *node as usize];
        pick.iter().map(|p| V3::from4(value(p)).f64()).collect()
    }

    /// Solves the linear systems of several right-hand sides and reads values.
    pub(super) fn solve_linear(
        &mut self,
        requests: &[SolveRequest],
        pick: &[(usize, u32)],
    ) -> Result<(Vec<Outcome>, Vec<[f64; 3]>)> {
        let n = self.node_count;
        self.system.factor(&self.dofs)?;
        let (params, dofs, system) = (&self.params, &self.dofs, &self.system);
        let (load, floor, max_iterations, driven) = (self.load_squared, self.floor, self.max_iterations, self.driven);
        let interrupt = &*self.interrupt;
        let precondition = system.preconditioner(params, dofs);
        // one conjugate gradient solve per right-hand side, in parallel
        let arrays = (
            self.x.par_chunks_mut(n),
            self.r.par_chunks_mut(n),
            self.p.par_chunks_mut(n),
            self.s.par_chunks_mut(n),
            self.z.par_chunks_mut(n),
            self.w.par_chunks_mut(n),
            self.space.par_iter_mut(),
        );
        let mut done: Vec<(usize, Outcome)> = arrays
            .into_par_iter()
            .enumerate()
            .filter_map(|(rhs, arrays)| Some((requests.iter().find(|w| w.rhs == rhs)?, arrays)))
            .map(|(want, (x, r, p, s, z, w, Workspace { scratch, levels }))| {
                let request = request(want.target, floor, driven);
                let outcome = solve(
                    SolverVectors { x, r, p, s, z, w },
                    &request,
                    load,
                    want.target.iterations(max_iterations),
                    interrupt,
                    |z: &[V4<R>], w: &mut [V4<R>]| system.product(params, dofs, z, w, scratch),
                    |r: &[V4<R>], z: &mut [V4<R>]| precondition(levels, r, z),
                );
                (want.rhs, outcome)
            })
            .collect();
        unless(interrupt)?;
        done.sort_by_key(|(rhs, _)| *rhs);
        let find = |w: &SolveRequest| done.iter().find(|d| d.0 == w.rhs).map(|d| d.1).unwrap_or_default();
        let outcomes = requests.iter().map(find).collect();
        Ok((outcomes, self.picked(pick)))
    }

    /// Unconstrained motion of an explicit step, and its values at nodes: one exact division per node.
    pub(super) fn accelerate(
        &mut self,
        requests: &[SolveRequest],
        pick: &[(usize, u32)],
    ) -> (Vec<Outcome>, Vec<[f64; 3]>) {
        accelerate(&self.params, &self.dofs, &self.r, &mut self.x);
        debug_assert!(requests.iter().all(|w| w.rhs == FREE), "explicit steps have no contact");
        (vec![Outcome::exact(); requests.len()], self.picked(pick))
    }

    /// Unconstrained motion by Newton's method; the right-hand side is `b` of the step, the solution its increment.
    pub(super) fn newton(&mut self, tolerance: f64) -> Result<Outcome> {
        let b = self.r[..self.node_count].to_vec();
        let Some(conserved) = self.conserved.take() else {
            return Ok(self.balance(tolerance, &b)?.0);
        };
        let [u, v] = [&self.u, &self.v].map(|values| widen(values));
        let before = self.system.energy(&u);
        let solved = conserve::solve(|elastic_at| {
            self.set_elastic_at(elastic_at);
            let (outcome, work) = self.balance(tolerance, &b)?;
            let dx = &self.x[..self.node_count];
            let end: Vec<V4<f64>> =
                self.u.iter().zip(dx).map(|(u, d)| std::array::from_fn(|n| (u[n] + d[n]).f64())).collect();
            let excess = self.system.energy(&end) - before - work[0];
            Ok((outcome, conserved.end(&u, &v, &widen(dx), elastic_at, [excess, work[1]])))
        });
        self.conserved = Some(conserved);
        let (outcome, ended) = solved?;
        self.ended = ended.v;
        Ok(outcome)
    }

    fn set_elastic_at(&mut self, elastic_at: f64) {
        self.nonlinear.elastic_at = (elastic_at != 0.5).then_some(elastic_at);
        self.elastic_at = elastic_at;
        self.system.set_elastic_at(elastic_at);
    }

    /// Balance of the step by Newton's method; its outcome, and the work of [`Trial`], J.
    fn balance(&mut self, tolerance: f64, b: &[V4<R>]) -> Result<(Outcome, [f64; 2])> {
        let (n, floor) = (self.node_count, self.floor);
        let zeros = vec![[R::zero(); 4]; n];
        // fixed nodes have their prescribed increments from the start
        let prescribed = |(x, dofs): (&V4<R>, &V4<R>)| {
            std::array::from_fn(|k| if k < 3 && dofs[k] == R::zero() { x[k] } else { R::zero() })
        };
        let mut dx: Vec<V4<R>> = self.x.iter().zip(&self.dofs).map(prescribed).collect();
        self.advanced.iter().for_each(|node| dx[*node as usize] = self.x[*node as usize]);
        let still = Point { dx, residual: zeros.clone(), work: [0.0; 2] };
        let mut descent =
            LineSearch { body: self, b: b.to_vec(), current: still.clone(), trial: still, direction: zeros };
        let (outcome, newton_iterations) = newton(&mut descent, tolerance, floor)?;
        let Point { dx, work, .. } = descent.current;
        self.x[..n].copy_from_slice(&dx);
        self.nonlinear.iterations += newton_iterations;
        self.system.set_shift(0.0);
        Ok((outcome, work))
    }
}

/// Point of the Newton iteration.
#[derive(Clone)]
struct Point<R> {
    /// `[node]` m
    dx: Vec<V4<R>>,
    /// `[node]` −∇Π, N
    residual: Vec<V4<R>>,
    /// J, see [`Trial`].
    work: [f64; 2],
}

/// Line search state: a body and the right-hand side of its step.
struct LineSearch<'a, R: Real> {
    body: &'a mut CpuBackend<R>,
    b: Vec<V4<R>>,
    current: Point<R>,
    trial: Point<R>,
    direction: Vec<V4<R>>,
}

impl<R: Real> Shifted for CpuBackend<R> {
    fn set_shift(&mut self, shift: f64) {
        self.system.set_shift(shift);
    }

    fn count_indefinite(&mut self) {
        self.nonlinear.indefinite += 1;
    }

    fn max_iterations(&self) -> u32 {
        self.max_iterations
    }
}

impl<R: Real> LineSearch<'_, R> {
    /// `[node]` displacements at which the current point has its elastic forces, m.
    fn moved(&self) -> Vec<V4<f64>> {
        let at = self.body.elastic_at;
        let sum = |(u, d): (&V4<R>, &V4<R>)| std::array::from_fn(|n| u[n].f64() + at * d[n].f64());
        self.body.u.iter().zip(&self.current.dx).map(sum).collect()
    }
}

impl<R: Real> Descent for LineSearch<'_, R> {
    fn trial(&mut self, step_length: f64) -> Result<Option<TrialPoint>> {
        let along = |(d, e): (&V4<R>, &V4<R>)| {
            round(&std::array::from_fn::<f64, 4, _>(|n| d[n].f64() + step_length * e[n].f64()))
        };
        let dx: Vec<V4<R>> = self.current.dx.iter().zip(&self.direction).map(along).collect();
        let CpuBackend { params, dofs, u, f, system, space, .. } = &mut *self.body;
        let start = Start { params, dofs, u, f, b: &self.b };
        let Some(Trial { potential, residual, work }) = system.trial(&start, &dx, &mut space[FREE].scratch)? else {
            return Ok(None);
        };
        let product = |(r, e): (&V4<R>, &V4<R>)| (0..3).map(|n| r[n].f64() * e[n].f64()).sum::<f64>();
        let predicted_decrease = self.current.residual.iter().zip(&self.direction).map(product).sum();
        let residual_norm = norm(&widen(&residual));
        self.trial = Point { dx, residual, work };
        Ok(Some(TrialPoint { potential, noise: 0.0, residual_norm, predicted_decrease }))
    }

    fn accept(&mut self) {
        std::mem::swap(&mut self.current, &mut self.trial);
    }

    fn direction(&mut self, residual: f64, shift: f64) -> Result<(u32, f64)> {
        self.body.system.linearise(&self.moved());
        let (residual_force, n) = (&self.current.residual, self.b.len());
        let wanted = [SolveRequest { rhs: FREE, target: Target::Absolute(residual) }];
        let (iterations, shift) = solve_shifted(self.body, shift, |body| {
            body.r[..n].copy_from_slice(residual_force);
            body.x[..n].fill([R::zero(); 4]);
            Ok(body.solve_linear(&wanted, &[])?.0[0])
        })?;
        self.direction.copy_from_slice(&self.body.x[..n]);
        Ok((iterations, shift))
    }

    fn load(&self) -> f64 {
        self.body.load_squared.f64().sqrt()
    }

    fn rounding(&self) -> [f64; 2] {
        [R::EPSILON.f64(), R::MIN_POSITIVE.f64().sqrt()]
    }

    fn driven(&self) -> bool {
        self.body.driven
    }

    fn inverted_at_start(&self) -> Error {
        let found = self.body.system.first_inverted(&self.moved());
        found.unwrap_or_else(|| unreachable!("only an inverted cell rejects the first trial point")).into()
    }
}
