//! The conjugate gradients on the device: vectors, scalars, and an iteration as a flat list of dispatches.
//!
//! With multigrid the preconditioner is one V-cycle, unrolled into the same list: every level has its own arrays, and the parameter block
//! once per pair of smoothing coefficients.

use super::GpuBackend;
use super::arrays::{Arrays, Dispatch, Law, Maker, modes_uniform, stiffness_uniform};
use super::exchange::triples;
use super::hyperelastic::Neo;
use super::in_use::{InUse, TOUCHED, over_columns, over_nodes};
use crate::backend::{CORRECTION, FREE, Target, Wanted};
use crate::error::Result;
use crate::gpu::{Batch, Buffer, Gpu, cast};
use crate::kernels::advance::Scalars;
use crate::kernels::{GROUP, Params, Source};
use crate::kernels::{
    advance, blocks, coarsen, converge, factor, precondition, product, prolongation, relax, restriction, split_product,
    update,
};
use crate::linear::Outcome;
use crate::linear::multigrid::steps;
use crate::model::{Model, Multigrid};

/// Right-hand sides and what the conjugate gradients keep of them.
pub(super) struct Solver {
    pub x: Buffer,
    pub r: Buffer,
    pub z: Buffer,
    pub scalars: Buffer,
    requests: Buffer,
    /// Rotations and columns of the coarse levels, from the finest level's rotations.
    pub refresh: Vec<Dispatch>,
    all: Vec<Dispatch>,
    correction: Vec<Dispatch>,
    /// Iterations submitted beyond those that the last solve took, and at a time once those were not enough.
    pub spare: [u32; 2],
    /// What the dispatches run over.
    pub in_use: InUse,
}

/// One level: its arrays, sizes and smoothing coefficients.
struct Level {
    arrays: Arrays,
    params: Params<f32>,
    main: Buffer,
    steps: Vec<[f64; 2]>,
}

fn columns(params: &Params<f32>) -> usize {
    params.columns() + params.extra_columns as usize
}

impl Solver {
    /// Vectors for `params.slot_count` right-hand sides; `body` has the arrays of the finest level, `main` its parameters.
    pub fn new(
        made: &mut Maker,
        model: &Model,
        law: &Law,
        body: &Arrays,
        params: Params<f32>,
        main: &Buffer,
        with_correction: bool,
        mut neo: Option<&mut Neo>,
    ) -> Result<Self> {
        if model.step.explicit() {
            return Self::explicit(made, body, params, main);
        }
        // vectors and partial sums of the conjugate gradients
        let slots = params.slot_count as usize;
        let n = params.node_count as usize;
        let groups = |threads: usize| threads.div_ceil(GROUP as usize) * slots;
        let [x, r, p, s, z, w] = ["x", "r", "p", "s", "z", "w"].map(|name| made.vec4(name, n * slots));
        let (x, r, z) = (x?, r?, z?);
        let scalars = made.vec4("scalars", slots * 2)?;
        let requests = made.vec4("requests", slots)?;
        let mut sums = |name, count: usize| made.of(name, &vec![0f32; count]);
        let gamma = sums("partial_gamma", groups(columns(&params)))?;
        let shared = Arrays::of(&[
            scalars.clone(),
            gamma.clone(),
            sums("partial_product", params.product_groups as usize * slots)?,
            sums("partial_residual", groups(n))?,
        ]);
        made.reserved.sums.push(gamma);
        let vectors = Arrays::of(&[x.clone(), r.clone(), p?, s?, z.clone(), w?, requests.clone()]);
        let arrays = body.joined(&shared).joined(&vectors);
        let gpu = made.gpu;
        // levels of the V-cycle, and what refreshes them at each step
        let mut levels = vec![];
        let shared = shared.joined(&Arrays::of(&body.get("split").into_iter().collect::<Vec<_>>()));
        if let Some(multigrid) = &model.multigrid {
            levels = make_levels(made, multigrid, arrays.clone(), &shared, params, main)?;
        }
        let refresh = refresh(gpu, &levels)?;
        // dispatches of one iteration: product, step length, update, preconditioner
        let mut iteration = |made: &mut Maker, params: Params<f32>, main: &Buffer| -> Result<Vec<Dispatch>> {
            let bind = |source: &Source, threads: usize| -> Result<Dispatch> {
                Ok((arrays.bind(gpu, source, &[("params", main)])?, threads))
            };
            let tiles = if law.springs > 0 { params.product_groups as usize } else { product::tiles(&params) };
            let product = (law.product, tiles * GROUP as usize);
            let mut out = match &mut neo {
                Some(neo) => neo.products(made, &arrays, product, params)?,
                None => vec![bind(product.0, product.1)?],
            };
            out.extend(split_product(gpu, law, &arrays, &params, main)?);
            out.extend([bind(&advance::SOURCE, 1)?, bind(&update::SOURCE, over_nodes(&params))?]);
            if levels.is_empty() {
                out.push(bind(&precondition::SOURCE, over_columns(&params))?);
            } else {
                out.push(bind(&converge::SOURCE, 1)?);
                cycle(made, law, &levels, params.first_slot, &mut out)?;
            }
            Ok(out)
        };
        // all slots together, and the correction's slot alone
        let all = iteration(made, params, main)?;
        let correction = if with_correction {
            let params = Params { first_slot: CORRECTION as u32, ..params };
            let main = made.params(&params);
            iteration(made, params, &main)?
        } else {
            vec![]
        };
        let spare = if levels.is_empty() { [4, 8] } else { [1, 2] };
        let in_use = InUse::new(&params, &[]);
        Ok(Self { x, r, z, scalars, requests, refresh, all, correction, spare, in_use })
    }

    /// Of a system that one dispatch solves.
    pub(super) fn of_one(x: Buffer, r: Buffer, kernel: Dispatch, in_use: InUse) -> Self {
        let (z, scalars, requests) = (r.clone(), r.clone(), r.clone());
        let all = vec![kernel];
        Self { x, r, z, scalars, requests, refresh: vec![], all, correction: vec![], spare: [0, 0], in_use }
    }

    /// Dispatches of one iteration, and how many more there are once a cut has split cells.
    pub fn launches(&self) -> [u32; 2] {
        let split = self.all.iter().filter(|(_, threads)| *threads == TOUCHED).count() as u32;
        [self.all.len() as u32 - split, split]
    }

    /// Records `count` iterations of `rows` slots, of all or of the correction alone.
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

    /// Sets what each slot is solved to; slots that are not wanted are done before they start.
    pub fn write_requests(&self, gpu: &Gpu, wanted: &[Wanted], rows: usize, floor: f64) {
        let mut scalars = vec![[1f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]; rows];
        let mut requests = vec![[0f32; 4]; rows];
        for w in wanted {
            scalars[w.slot][3] = 0.0;
            let floor = (floor * floor) as f32;
            requests[w.slot] = match w.target {
                Target::OfLoad(t) => [(t * t) as f32, 0.0, floor, 1.0],
                Target::Absolute(norm) | Target::Loose(norm, _) => [1.0, (norm * norm) as f32, floor, 0.0],
            };
        }
        gpu.write(&self.scalars, 0, &scalars);
        gpu.write(&self.requests, 0, &requests);
    }
}

impl GpuBackend {
    /// The device, with its lists of arrays and kernels.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// Dispatches at a step's begin, per iteration of a solve, per iteration once a cut has split cells, and per place that Newton's method
    /// tries.
    pub fn launches(&self) -> [u32; 4] {
        let [iteration, split] = self.solver.launches();
        [self.begin.len() as u32, iteration, split, self.neo.as_ref().map_or(0, Neo::launches)]
    }
}

impl GpuBackend {
    /// Solves slots of the linear system together.
    pub(super) fn solve_slots(
        &mut self,
        wanted: &[Wanted],
        pick: &[(usize, u32)],
    ) -> Result<(Vec<Outcome>, Vec<[f64; 3]>)> {
        let only_correction = wanted.iter().all(|w| w.slot == CORRECTION);
        let last = wanted.iter().map(|w| w.slot).max().unwrap_or(FREE);
        let (first, rows) = if only_correction { (CORRECTION, 1) } else { (FREE, last as u32 + 1) };
        self.solver.write_requests(&self.gpu, wanted, last + 1, self.floor);
        let ids: Vec<u32> = pick.iter().map(|(slot, node)| (slot * self.node_count) as u32 + node).collect();
        let mut batch = self.record();
        let last_bytes = 16 * self.solver.in_use.nodes as u64;
        let (from, bytes) = (self.offset(first), self.offset(rows as usize - 1) + last_bytes);
        batch.copy(&self.solver.x, from, &self.solver.z, from, bytes);
        let kind = usize::from(only_correction);
        // one product more than there are iterations forms the start's residual
        let [spare, again] = self.solver.spare;
        let most = wanted.iter().map(|w| w.target.iterations(self.max_iterations)).max().unwrap_or(0);
        let mut count = (self.expected[kind] * 5 / 4 + spare).min(most.saturating_add(1));
        loop {
            self.solver.record(&mut batch, only_correction, rows, count);
            let picked = self.record_pick(&mut batch, &self.pick.x, &ids);
            let heads = 32 * (last as u64 + 1);
            let parts =
                self.gpu.submit_and_read(batch, &[(&self.solver.scalars, heads), (&self.pick.picked, picked)])?;
            let heads = scalars(&parts[0], wanted);
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

/// Scalars of the wanted slots, from the bytes of the array.
pub(super) fn scalars(bytes: &[u8], wanted: &[Wanted]) -> Vec<Scalars<f32>> {
    let heads: Vec<[f32; 8]> = cast(bytes);
    let of = |w: &Wanted| {
        let [alpha, beta, gamma, done, target_squared, residual_squared, iterations, state] = heads[w.slot];
        Scalars { alpha, beta, gamma, done, target_squared, residual_squared, iterations, state }
    };
    wanted.iter().map(of).collect()
}

/// The finest level, which has the body's arrays, and the coarse ones.
fn make_levels(
    made: &mut Maker,
    multigrid: &Multigrid,
    finest: Arrays,
    shared: &Arrays,
    params: Params<f32>,
    main: &Buffer,
) -> Result<Vec<Level>> {
    made.gpu.making("multigrid");
    let slots = params.slot_count as usize;
    let count = multigrid.coarse.len();
    let d = made.vec4("d", params.node_count as usize * slots)?;
    let first = steps(multigrid.largest, count == 0);
    let finest = finest.joined(&Arrays::of(&[d]));
    let layer_of = finest.get("layer_of");
    let mut out = vec![Level { arrays: finest, params, main: main.clone(), steps: first }];
    // the coarse levels' smoothing sums up what nothing reads; the finest level's sums beyond what is in use stay zero
    let unread = multigrid.coarse.first().map_or(0, |level| columns(&level.params(params)).div_ceil(GROUP as usize));
    let unread = made.of("partial_gamma", &vec![0f32; unread * slots])?;
    for (number, level) in multigrid.coarse.iter().enumerate() {
        let params = level.params(params);
        let n = params.node_count as usize;
        let free: Vec<[f32; 4]> = level.free.iter().map(|f| f.map(|c| c as f32)).collect();
        let mut own = vec![stiffness_uniform(made, &level.stiffness), modes_uniform(made, &level.stiffness)];
        own.push(unread.clone());
        own.extend(layer_of.clone());
        own.push(made.of("free", &free)?);
        own.push(made.vec4("rotation", params.cell_count as usize)?);
        own.push(made.vec4("block", n * 4)?);
        for name in ["r", "z", "d", "w"] {
            own.push(made.vec4(name, n * slots)?);
        }
        // its own, so that what the finest level has summed up stays
        own.push(made.of("partial_product", &vec![0f32; params.product_groups as usize * slots])?);
        let main = made.params(&params);
        let steps = steps(level.largest, number + 1 == count);
        out.push(Level { arrays: shared.joined(&Arrays::of(&own)), params, main, steps });
    }
    Ok(out)
}

fn refresh(gpu: &Gpu, levels: &[Level]) -> Result<Vec<Dispatch>> {
    let mut out = vec![];
    for pair in levels.windows(2) {
        let (fine, coarse) = (&pair[0], &pair[1]);
        let rotation = coarse.arrays.get("rotation");
        let below: Vec<_> = rotation.iter().map(|r| ("coarse_rotation", r)).chain([("params", &fine.main)]).collect();
        out.push((fine.arrays.bind(gpu, &coarsen::SOURCE, &below)?, coarse.params.cell_count as usize));
        let own = [("params", &coarse.main)];
        out.push((coarse.arrays.bind(gpu, &blocks::SOURCE, &own)?, coarse.params.node_count as usize));
        out.push((coarse.arrays.bind(gpu, &factor::SOURCE, &own)?, columns(&coarse.params)));
    }
    Ok(out)
}

/// What split cells add to a product; nothing where no cell can be split.
fn split_product(
    gpu: &Gpu,
    law: &Law,
    arrays: &Arrays,
    params: &Params<f32>,
    main: &Buffer,
) -> Result<Option<Dispatch>> {
    if params.extra_columns == 0 {
        return Ok(None);
    }
    let system = law.consistent.iter().map(|[system, _]| ("stiffness", system));
    let more: Vec<_> = system.chain([("params", main)]).collect();
    Ok(Some((arrays.bind(gpu, &split_product::SOURCE, &more)?, TOUCHED)))
}

/// One V-cycle from the first of `levels` down, as `linear::multigrid::cycle` does it.
fn cycle(made: &mut Maker, law: &Law, levels: &[Level], first_slot: u32, out: &mut Vec<Dispatch>) -> Result<()> {
    let gpu = made.gpu;
    let own = &levels[0];
    let params = Params { first_slot, ..own.params };
    let main = made.params(&params);
    let product = own.arrays.bind(gpu, &product::SOURCE, &[("params", &main)])?;
    let mut products = vec![(product, product::tiles(&params) * GROUP as usize)];
    products.extend(split_product(gpu, law, &own.arrays, &params, &main)?);
    let mut smoother = |fresh: bool, [keep, gain]: [f64; 2]| -> Result<Dispatch> {
        let params = Params { fresh: u32::from(fresh), keep: keep as f32, gain: gain as f32, ..params };
        let words = made.params(&params);
        Ok((own.arrays.bind(gpu, &relax::SOURCE, &[("params", &words)])?, over_columns(&params)))
    };
    let first = smoother(true, own.steps[0])?;
    let later: Vec<Dispatch> = own.steps.iter().map(|s| smoother(false, *s)).collect::<Result<_>>()?;
    let sweep = |steps: &[Dispatch], out: &mut Vec<Dispatch>| {
        for step in steps {
            out.extend(products.iter().chain([step]).cloned());
        }
    };
    out.push(first);
    sweep(&later[1..], out);
    let Some(next) = levels.get(1) else {
        return Ok(());
    };
    let coarse = |names: &[(&'static str, &'static str)]| -> Vec<(&'static str, Buffer)> {
        names.iter().filter_map(|(theirs, ours)| Some((*ours, next.arrays.get(theirs)?))).collect()
    };
    let bind = |source: &Source, names: &[(&'static str, &'static str)]| {
        let below = coarse(names);
        let mut more: Vec<_> = below.iter().map(|(name, buffer)| (*name, buffer)).collect();
        more.push(("params", &main));
        own.arrays.bind(gpu, source, &more)
    };
    out.extend(products.iter().cloned());
    let threads = next.params.node_count as usize;
    out.push((bind(&restriction::SOURCE, &[("free", "coarse_free"), ("r", "coarse_r")])?, threads));
    cycle(made, law, &levels[1..], first_slot, out)?;
    out.push((bind(&prolongation::SOURCE, &[("z", "coarse_z")])?, over_nodes(&params)));
    sweep(&later, out);
    Ok(())
}
