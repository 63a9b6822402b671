//! Newton's method on the device ([`super::super::newton`]).
//!
//! One read returns a trial point: partial sums over groups of nodes, and the energy of each cell. The host subtracts the cell energies at
//! the start of the step in f64, so that the small change over a step is not lost in the total energy.

use super::exchange::triples;
use super::{GpuBackend, rounded};
use crate::backend::conserve::{self, Conserved, Ended};
use crate::backend::newton::{Descent, Shifted, TrialPoint, newton as descend, solve_shifted};
use crate::backend::{FREE, Nonlinear, SolveRequest, Target};
use crate::bodies::gpu::{NonlinearLaw, Search};
use crate::bodies::{Model, Refused};
use crate::error::{Error, Result};
use crate::gpu::{Batch, Buffer, Gpu, cast};
use crate::kernels::hyperelastic_forces::INVERTED_ENERGY;
use crate::kernels::{GROUP, Params};
use crate::linear::Outcome;
use crate::math::{V4, widen};

/// Rounding error of the summed potential, relative to the sum of magnitudes.
const ROUNDINGS: f64 = 4.0 * f32::EPSILON as f64;

/// Arrays and kernels of the law, and the state of the step's iteration.
pub(super) struct Newton {
    law: NonlinearLaw,
    params: Params<f32>,
    /// Statistics of the step so far.
    pub count: Nonlinear,
    /// Factor of `K₀` added to indefinite tangents.
    shift: f64,
    /// `[cell]` energies at the start of the step, J; empty before the first trial point.
    start: Vec<f32>,
    /// Norm of the step's load, N.
    load: f64,
    /// Work over the increment of elastic forces and residual, and of inertia and damping, at the current and the trial point, J.
    work: [[f64; 2]; 2],
    /// Data for steps that conserve energy.
    conserved: Option<Conserved>,
    /// Velocities at the end of the step that conserve energy, m/s.
    ended: Vec<V4<f64>>,
    /// Nodes whose increments the step begins with, m; elsewhere it begins at rest.
    pub advanced: Vec<(u32, V4<f32>)>,
}

impl Newton {
    pub fn new(law: NonlinearLaw, params: Params<f32>, model: &Model) -> Self {
        Self {
            law,
            params,
            count: Nonlinear::default(),
            shift: 0.0,
            start: vec![],
            load: 0.0,
            work: [[0.0; 2]; 2],
            conserved: Conserved::of(model),
            ended: vec![],
            advanced: vec![],
        }
    }

    /// `[node]` increments of the current point, m.
    pub fn increments(&self) -> &Buffer {
        &self.law.search.dx[0]
    }

    /// Kernel launches per trial point.
    pub fn launches(&self) -> u32 {
        self.law.search.kernels.len() as u32
    }

    /// Parameter block of a trial point at a step length, with the elastic forces at this part of the increment; it leaves the cells'
    /// linearisation as it is at the start of the step.
    fn along(&self, step_length: f64, elastic_at: f64) -> Vec<u32> {
        let trial = Params { corotational: 1, ..self.params };
        Params { gain: step_length as f32, stiffness_factor: elastic_at as f32, ..trial }.words()
    }

    /// Has the steps take their elastic forces at `u + τ Δx`.
    fn set_elastic_at(&mut self, gpu: &Gpu, elastic_at: f64) {
        self.count.elastic_at = (elastic_at != 0.5).then_some(elastic_at);
        if elastic_at == self.law.elastic_at {
            return;
        }
        self.law.elastic_at = elastic_at;
        for (params, block) in &self.law.sums {
            gpu.write(block, 0, &Params { stiffness_factor: elastic_at as f32, ..*params }.words());
        }
    }

    /// Sets the factor of `K₀` in the tangents.
    fn shift(&mut self, gpu: &Gpu, shift: f64) {
        if shift == self.shift {
            return;
        }
        self.shift = shift;
        for (params, block) in &self.law.blocks {
            let params = Params { stiffness_factor: (self.law.damping + shift) as f32, ..*params };
            gpu.write(block, 0, &params.words());
        }
    }

    /// The first inverted cell.
    fn first_inverted(&self, energy: &[f32]) -> Option<Refused> {
        let cell = energy.iter().position(|e| *e >= INVERTED_ENERGY || e.is_nan())?;
        Some(Refused::InvertedCell { cell: self.params.cell_at(cell) })
    }
}

impl GpuBackend {
    /// Size of a vector of one right-hand side, bytes.
    fn vector(&self) -> u64 {
        self.offset(1)
    }

    /// Sets the right-hand side of the unconstrained motion, with a zero initial guess.
    fn restart(&mut self, from: &Buffer) {
        let mut batch = self.record();
        batch.copy(from, 0, &self.solver.r, 0, self.vector());
        batch.clear(&self.solver.x, 0, self.vector());
        self.pending = Some(batch);
    }

    /// Solve for a body with a nonlinear law.
    pub(super) fn solve_nonlinear(
        &mut self,
        requests: &[SolveRequest],
        pick: &[(usize, u32)],
    ) -> Result<(Vec<Outcome>, Vec<[f64; 3]>)> {
        let Some(newton) = &mut self.newton else { return Ok((vec![], vec![])) };
        match requests {
            [SolveRequest { rhs: FREE, target: Target::OfLoad(tolerance) }] => {
                newton.count = Nonlinear::default();
                let outcome = match newton.conserved.take() {
                    None => self.balance(*tolerance)?,
                    Some(conserved) => {
                        let solved = self.conserve(&conserved, *tolerance);
                        self.newton.iter_mut().for_each(|newton| newton.conserved = Some(conserved.clone()));
                        solved?
                    }
                };
                let values = self.found(pick)?;
                Ok((vec![outcome], values))
            }
            _ => self.solve_linear(requests, pick),
        }
    }

    /// Balance of the step, whose right-hand side is in `r`, by Newton's method.
    fn balance(&mut self, tolerance: f64) -> Result<Outcome> {
        self.newton.iter_mut().for_each(|newton| newton.start = vec![]);
        let (outcome, newton_iterations) = descend(self, tolerance, self.floor)?;
        self.newton.iter_mut().for_each(|newton| newton.count.iterations += newton_iterations);
        Ok(outcome)
    }

    /// Balance of a midpoint step, with the velocities at its end that conserve energy.
    fn conserve(&mut self, conserved: &Conserved, tolerance: f64) -> Result<Outcome> {
        let mut again = false;
        let (outcome, ended) = conserve::solve(|elastic_at| {
            let mut batch = self.record();
            if let Some(newton) = &mut self.newton {
                newton.set_elastic_at(&self.gpu, elastic_at);
                if std::mem::replace(&mut again, true) {
                    batch.copy(&newton.law.b, 0, &self.solver.r, 0, (self.node_count * 16) as u64);
                }
            }
            self.pending = Some(batch);
            let outcome = self.balance(tolerance)?;
            Ok((outcome, self.end(conserved)?))
        })?;
        self.newton.iter_mut().for_each(|newton| newton.ended = ended.v.clone());
        Ok(outcome)
    }

    /// Velocities at the end of the step that conserve energy, from the energy there.
    fn end(&mut self, conserved: &Conserved) -> Result<Ended> {
        let mut batch = self.record();
        let Some(newton) = &self.newton else { unreachable!("only Newton's method conserves energy") };
        let NonlinearLaw { search, energy, .. } = &newton.law;
        self.gpu.write(&search.gain, 0, &newton.along(0.0, 1.0));
        search.kernels[..2].iter().for_each(|(kernel, threads)| batch.run(kernel, *threads, 1));
        let state = [&self.body.u, &self.body.v, &search.dx[0]].map(|array| (array, array.bytes));
        let wanted = [&state[..], &[(energy, u64::from(newton.params.cell_count) * 4)]].concat();
        let parts = self.gpu.submit_and_read(batch, &wanted)?;
        let energy: Vec<f32> = cast(&parts[3]);
        let change = |(end, start): (&f32, &f32)| f64::from(*end) - f64::from(*start);
        let gained: f64 = energy.iter().zip(&newton.start).map(change).sum();
        let inverted = newton.first_inverted(&energy).is_some();
        let excess = if inverted { f64::INFINITY } else { gained - newton.work[0][0] };
        let [u, v, dx] = [0, 1, 2].map(|k| widen(&cast::<V4<f32>>(&parts[k])));
        Ok(conserved.end(&u, &v, &dx, newton.law.elastic_at, [excess, newton.work[0][1]]))
    }

    /// Sets the velocities that conserve energy, after the integration.
    pub(super) fn set_ended(&mut self) {
        let ended = self.newton.as_mut().map_or(vec![], |newton| std::mem::take(&mut newton.ended));
        if !ended.is_empty() {
            let batch = self.record();
            self.gpu.submit(batch); // a write takes effect before later commands
            self.gpu.write(&self.body.v, 0, &rounded(&ended));
        }
    }

    /// Copies the result of Newton's method to the solution and returns its values at nodes.
    fn found(&mut self, pick: &[(usize, u32)]) -> Result<Vec<[f64; 3]>> {
        let mut batch = self.record();
        if let Some(newton) = &mut self.newton {
            newton.shift(&self.gpu, 0.0);
        }
        if let Some(newton) = &self.newton {
            batch.copy(&newton.law.search.dx[0], 0, &self.solver.x, 0, self.vector());
        }
        if pick.is_empty() {
            self.pending = Some(batch);
            return Ok(vec![]);
        }
        let ids: Vec<u32> = pick.iter().map(|(rhs, node)| (rhs * self.node_count) as u32 + node).collect();
        let picked = self.record_pick(&mut batch, &self.pick.x, &ids);
        Ok(triples(&self.gpu.submit_and_read(batch, &[(&self.pick.picked, picked)])?[0]))
    }

    /// Before the first trial point of a step: saves the right-hand side, clears increment, residual and solution.
    fn start_step(&self, batch: &mut Batch, newton: &Newton, search: &Search) {
        batch.copy(&self.solver.r, 0, &newton.law.b, 0, self.vector());
        for vector in [&search.dx[0], &search.residual_force[0], &self.solver.x] {
            batch.clear(vector, 0, self.vector());
        }
        self.driven.iter().for_each(|driven| driven.record(batch));
    }
}

impl Shifted for GpuBackend {
    fn set_shift(&mut self, shift: f64) {
        if let Some(newton) = &mut self.newton {
            newton.shift(&self.gpu, shift);
        }
    }

    fn count_indefinite(&mut self) {
        if let Some(newton) = &mut self.newton {
            newton.count.indefinite += 1;
        }
    }

    fn max_iterations(&self) -> u32 {
        self.max_iterations
    }
}

impl Descent for GpuBackend {
    fn trial(&mut self, step_length: f64) -> Result<Option<TrialPoint>> {
        let mut batch = self.record();
        let Some(newton) = &self.newton else { return Ok(None) };
        let search = &newton.law.search;
        let first = newton.start.is_empty();
        if first {
            self.start_step(&mut batch, newton, search);
            let (ids, values): (Vec<u32>, Vec<V4<f32>>) = newton.advanced.iter().copied().unzip();
            let increments = search.dx[0].clone();
            self.pending = Some(batch);
            self.put(&increments, &ids, &values)?;
            batch = self.record();
        }
        let Some(newton) = &self.newton else { return Ok(None) };
        let search = &newton.law.search;
        // evaluate the point
        self.gpu.write(&search.gain, 0, &newton.along(step_length, newton.law.elastic_at));
        search.kernels.iter().for_each(|(kernel, threads)| batch.run(kernel, *threads, 1));
        let groups = self.node_count.div_ceil(GROUP as usize) as u64;
        let wanted = [
            (&search.predicted_decrease, groups * 4),
            (&search.potential_and_residual, groups * 16),
            (&newton.law.energy, u64::from(newton.params.cell_count) * 4),
            (&search.load, groups * 4),
        ];
        let parts = self.gpu.submit_and_read(batch, &wanted)?;
        // sum on the host, the elastic energy relative to the start of the step
        let sum = |values: Vec<f32>| values.iter().map(|v| f64::from(*v)).sum::<f64>();
        let (potential_and_residual, energy) = (cast::<V4<f32>>(&parts[1]), cast::<f32>(&parts[2]));
        let (inverted, at) = (newton.first_inverted(&energy).is_some(), newton.law.elastic_at);
        if let Some(newton) = &mut self.newton {
            let [potential, work] =
                [0, 2].map(|part| potential_and_residual.iter().map(|b| f64::from(b[part])).sum::<f64>());
            newton.work[1] = [work, -2.0 * (potential + work)]; // w = b + f(u) − f(u + τ Δx) + ∇Π
            if first {
                newton.start = energy.clone();
                newton.load = sum(cast(&parts[3])).sqrt();
            }
        }
        if inverted {
            return Ok(None);
        }
        let start = self.newton.iter().flat_map(|newton| &newton.start);
        let gained: f64 = energy.iter().zip(start).map(|(e, s)| f64::from(*e) - f64::from(*s)).sum();
        let of_nodes =
            |part: fn(&V4<f32>) -> f32| potential_and_residual.iter().map(|b| f64::from(part(b))).sum::<f64>();
        let magnitude = of_nodes(|b| b[0].abs()) + sum(energy) / at;
        Ok(Some(TrialPoint {
            potential: of_nodes(|b| b[0]) + gained / at,
            noise: ROUNDINGS * magnitude,
            residual_norm: of_nodes(|b| b[1]).sqrt(),
            predicted_decrease: sum(cast(&parts[0])),
        }))
    }

    fn accept(&mut self) {
        let mut batch = self.record();
        if let Some(Newton { law: NonlinearLaw { search, .. }, .. }) = &self.newton {
            for [current, trial] in [&search.dx, &search.residual_force] {
                batch.copy(trial, 0, current, 0, self.vector());
            }
        }
        self.pending = Some(batch);
        if let Some(newton) = &mut self.newton {
            newton.work[0] = newton.work[1];
        }
    }

    fn direction(&mut self, residual: f64, shift: f64) -> Result<(u32, f64)> {
        let residual_force = self.newton.as_ref().map(|newton| newton.law.search.residual_force[0].clone());
        let wanted = [SolveRequest { rhs: FREE, target: Target::Absolute(residual) }];
        solve_shifted(self, shift, |body| {
            residual_force.iter().for_each(|r| body.restart(r));
            Ok(body.solve_linear(&wanted, &[])?.0[0])
        })
    }

    fn load(&self) -> f64 {
        self.newton.as_ref().map_or(0.0, |newton| newton.load)
    }

    fn rounding(&self) -> [f64; 2] {
        [f32::EPSILON, f32::MIN_POSITIVE.sqrt()].map(f64::from)
    }

    fn driven(&self) -> bool {
        self.driven.is_some()
    }

    fn inverted_at_start(&self) -> Error {
        let found = self.newton.as_ref().and_then(|newton| newton.first_inverted(&newton.start));
        found.unwrap_or_else(|| unreachable!("only an inverted cell rejects the first trial point")).into()
    }
}
