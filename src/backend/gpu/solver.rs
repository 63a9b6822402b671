//! Conjugate gradients on the device: vectors, scalars, and an iteration as a flat list of dispatches.

use super::GpuBackend;
use super::exchange::triples;
use super::newton::Newton;
use crate::backend::{CORRECTION, FREE, SolveRequest, Target};
use crate::bodies::Model;
use crate::bodies::gpu::{Arrays, Dispatch, InUse, Maker, Recorded, TOUCHED, over_columns, over_nodes};
use crate::error::{Result, unless};
use crate::gpu::{Batch, Buffer, Gpu, cast};
use crate::kernels::advance::Scalars;
use crate::kernels::{GROUP, Params, Source, advance, converge, precondition, update};
use crate::linear::Outcome;

/// Right-hand sides and the vectors of the conjugate gradients.
pub(super) struct Solver {
    pub x: Buffer,
    pub r: Buffer,
    pub z: Buffer,
    pub scalars: Buffer,
    requests: Buffer,
    /// Dispatches that update the preconditioner besides the factored columns, once per step.
    pub refresh: Vec<Dispatch>,
    all: Vec<Dispatch>,
    correction: Vec<Dispatch>,
    /// Extra iterations recorded beyond those of the last solve, and iterations per further submission if these do not suffice.
    pub spare: [u32; 2],
    /// Nodes and columns in use, which set the thread counts.
    pub in_use: InUse,
}

fn columns(params: &Params<f32>) -> usize {
    params.columns() + params.extra_columns as usize
}

impl Solver {
    /// Vectors for `params.rhs_count` right-hand sides; `body` has the arrays of the body, `main` its parameters.
    pub fn new(
        made: &mut Maker,
        model: &Model,
        kind: &mut dyn Recorded,
        body: &Arrays,
        params: Params<f32>,
        main: &Buffer,
        with_correction: bool,
    ) -> Result<Self> {
        if model.step.explicit() {
            return Self::explicit(made, body, params, main);
        }
        // vectors and partial sums of the conjugate gradients
        let rhs_count = params.rhs_count as usize;
        let n = params.node_count as usize;
        let groups = |threads: usize| threads.div_ceil(GROUP as usize) * rhs_count;
        let [x, r, p, s, z, w] = ["x", "r", "p", "s", "z", "w"].map(|name| made.vec4(name, n * rhs_count));
        let (x, r, z) = (x?, r?, z?);
        let scalars = made.vec4("scalars", rhs_count * 2)?;
        let requests = made.vec4("requests", rhs_count)?;
        let mut sums = |name, count: usize| made.zeros::<f32>(name, count);
        let gamma = sums("partial_gamma", groups(columns(&params)))?;
        let shared = Arrays::of(&[
            scalars.clone(),
            gamma.clone(),
            sums("partial_product", params.product_groups as usize * rhs_count)?,
            sums("partial_residual", groups(n))?,
        ]);
        made.reserved.sums.push(gamma);
        let vectors = Arrays::of(&[x.clone(), r.clone(), p?, s?, z.clone(), w?, requests.clone()]);
        let arrays = body.joined(&shared).joined(&vectors);
        let gpu = made.gpu;
        let refresh = kind.refresh(made, &arrays, &shared, &params, main)?;
        // dispatches of one iteration: product, step length, update, preconditioner
        let mut by_columns = true;
        let mut iteration = |made: &mut Maker, params: Params<f32>, main: &Buffer| -> Result<Vec<Dispatch>> {
            let mut out = kind.product(made, &arrays, &params, main)?;
            let bind = |source: &Source, threads: usize| -> Result<Dispatch> {
                Ok((arrays.bind(gpu, source, &[("params", main)])?, threads))
            };
            out.extend([bind(&advance::SOURCE, 1)?, bind(&update::SOURCE, over_nodes(&params))?]);
            match kind.precondition(made, &params)? {
                None => out.push(bind(&precondition::SOURCE, over_columns(&params))?),
                Some(more) => {
                    by_columns = false;
                    out.push(bind(&converge::SOURCE, 1)?);
                    out.extend(more);
                }
            }
            Ok(out)
        };
        // all right-hand sides together, and the correction alone
        let all = iteration(made, params, main)?;
        let correction = if with_correction {
            let params = Params { first_rhs: CORRECTION as u32, ..params };
            let main = made.params(&params);
            iteration(made, params, &main)?
        } else {
            vec![]
        };
        // the column preconditioner needs many iterations, and their number varies more
        let spare = if by_columns { [4, 8] } else { [1, 2] };
        let in_use = InUse::new(&params, &[]);
        Ok(Self { x, r, z, scalars, requests, refresh, all, correction, spare, in_use })
    }

    /// Solver for a system that one dispatch solves.
    pub(super) fn of_one(x: Buffer, r: Buffer, kernel: Dispatch, in_use: InUse) -> Self {
        let (z, scalars, requests) = (r.clone(), r.clone(), r.clone());
        let all = vec![kernel];
        Self { x, r, z, scalars, requests, refresh: vec![], all, correction: vec![], spare: [0, 0], in_use }
    }

    /// Dispatches of one iteration, and the additional ones once a cut has split cells.
    pub fn launches(&self) -> [u32; 2] {
        let split = self.all.iter().filter(|(_, threads)| *threads == TOUCHED).count() as u32;
        [self.all.len() as u32 - split, split]
    }

    /// Records `count` iterations for `rows` right-hand sides: all of them, or the correction alone.
    pub fn record(&self, batch: &mut Batch, only_correction: bool, rows: u32, count: u32) {
        let list = if only_correction { &self.correction } else { &self.all };
        for _ in 0..count {
            for (kernel, threads) in list {
                let threads = self.in_use.threads(*threads);
                if threads > 0 {
                    batch.run(kernel, threads, rows);
                }
            }
        }
    }

    /// Sets the stopping criteria; right-hand sides that are not requested are marked as done.
    pub fn write_requests(&self, gpu: &Gpu, requests: &[SolveRequest], rows: usize, floor: f64, driven: bool) {
        let mut scalars = vec![[1f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]; rows];
        let mut criteria = vec![[0f32; 4]; rows];
        for w in requests {
            scalars[w.rhs][3] = 0.0;
            let floor = (floor * floor) as f32;
            criteria[w.rhs] = match w.target {
                Target::OfLoad(t) => [(t * t) as f32, 0.0, floor, if driven { 2.0 } else { 1.0 }],
                Target::Absolute(norm) | Target::Loose(norm, _) => [1.0, (norm * norm) as f32, floor, 0.0],
            };
        }
        gpu.write(&self.scalars, 0, &scalars);
        gpu.write(&self.requests, 0, &criteria);
    }
}

impl GpuBackend {
    /// The device, with its lists of arrays and kernels.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// Dispatches at the start of a step, per iteration of a solve, additionally per iteration once a cut has split cells, and per trial
    /// point of Newton's method.
    pub fn launches(&self) -> [u32; 4] {
        let [iteration, split] = self.solver.launches();
        [self.begin.len() as u32, iteration, split, self.newton.as_ref().map_or(0, Newton::launches)]
    }
}

impl GpuBackend {
    /// Solves several right-hand sides of the linear system together.
    pub(super) fn solve_linear(
        &mut self,
        requests: &[SolveRequest],
        pick: &[(usize, u32)],
    ) -> Result<(Vec<Outcome>, Vec<[f64; 3]>)> {
        // range of right-hand sides, stopping criteria, initial guess
        let only_correction = requests.iter().all(|w| w.rhs == CORRECTION);
        let last = requests.iter().map(|w| w.rhs).max().unwrap_or(FREE);
        let (first, rows) = if only_correction { (CORRECTION, 1) } else { (FREE, last as u32 + 1) };
        self.solver.write_requests(&self.gpu, requests, last + 1, self.floor, self.driven.is_some());
        let ids: Vec<u32> = pick.iter().map(|(rhs, node)| (rhs * self.node_count) as u32 + node).collect();
        let mut batch = self.record();
        let last_bytes = 16 * self.solver.in_use.nodes as u64;
        let (from, bytes) = (self.offset(first), self.offset(rows as usize - 1) + last_bytes);
        batch.copy(&self.solver.x, from, &self.solver.z, from, bytes);
        let again = requests.iter().all(|w| w.rhs == FREE && !matches!(w.target, Target::OfLoad(_)));
        let kind = if again { 2 } else { usize::from(only_correction) };
        // the residual of the initial guess takes one additional product
        let [spare, again] = self.solver.spare;
        let most = requests.iter().map(|w| w.target.iterations(self.max_iterations)).max().unwrap_or(0);
        let mut count = (self.expected[kind] * 5 / 4 + spare).min(most.saturating_add(1));
        // submit iterations until all requested right-hand sides are done or at their limit
        loop {
            self.solver.record(&mut batch, only_correction, rows, count);
            let picked = self.record_pick(&mut batch, &self.pick.x, &ids);
            let heads = 32 * (last as u64 + 1);
            let parts =
                self.gpu.submit_and_read(batch, &[(&self.solver.scalars, heads), (&self.pick.picked, picked)])?;
            unless(&self.interrupt)?;
            let heads = scalars(&parts[0], requests);
            let running = heads.iter().filter(|k| k.done == 0.0).map(|k| k.iterations as u32);
            let left = running.map(|done| most.saturating_sub(done)).max().unwrap_or(0);
            if left == 0 {
                let outcomes: Vec<Outcome> = heads.iter().map(Outcome::of).collect();
                self.expected[kind] = outcomes.iter().map(|o| o.iterations).max().unwrap_or(0);
                return Ok((outcomes, triples(&parts[1])));
            }
            batch = self.gpu.batch();
            count = count.clamp(again, 8 * again).min(left);
        }
    }
}

/// Solver scalars of the requested right-hand sides, from the bytes of the array.
pub(super) fn scalars(bytes: &[u8], requests: &[SolveRequest]) -> Vec<Scalars<f32>> {
    let heads: Vec<[f32; 8]> = cast(bytes);
    let of = |w: &SolveRequest| {
        let [alpha, beta, gamma, done, target_squared, residual_squared, iterations, state] = heads[w.rhs];
        Scalars { alpha, beta, gamma, done, target_squared, residual_squared, iterations, state }
    };
    requests.iter().map(of).collect()
}
