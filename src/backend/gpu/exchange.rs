//! Indexed access of the host to device arrays: gathered values to read, scattered values to write.

use super::GpuBackend;
use crate::backend::{FREE, Query, Values};
use crate::bodies::gpu::Maker;
use crate::error::Result;
use crate::gpu::{Batch, Bound, Buffer, Gpu, cast};
use crate::kernels::{gather, scatter};
use crate::math::{V3, V4};

/// Scattered values from the host: contact rows, coefficients, and changes by a cut.
pub(super) struct Scatter {
    pub row_params: Buffer,
    pub params: Buffer,
    pub ids: Buffer,
    pub values: Buffer,
    pub rows: Bound,
}

impl Scatter {
    pub fn new(made: &mut Maker, capacity: usize, r: &Buffer) -> Result<Self> {
        let gpu = made.gpu;
        let (row_params, params) = (made.uniform("params", 16, &[0u32; 4]), made.uniform("params", 16, &[0u32; 4]));
        let (ids, values) = (made.zeros::<u32>("ids", capacity)?, made.vec4("values", capacity)?);
        let list = [("params", &row_params), ("ids", &ids), ("values", &values), ("destination", r)];
        let rows = gpu.bind(&scatter::SOURCE, &list)?;
        Ok(Self { row_params, params, ids, values, rows })
    }

    /// Scatters values into any array, or adds them, in a submission of its own.
    pub fn now(&self, gpu: &Gpu, destination: &Buffer, ids: &[u32], values: &[V4<f32>], add: bool) -> Result<()> {
        let list =
            [("params", &self.params), ("ids", &self.ids), ("values", &self.values), ("destination", destination)];
        let kernel = gpu.bind(&scatter::SOURCE, &list)?;
        gpu.write(&self.params, 0, &[ids.len() as u32, u32::from(add), 0, 0]);
        gpu.write(&self.ids, 0, ids);
        gpu.write(&self.values, 0, values);
        let mut batch = gpu.batch();
        batch.run(&kernel, ids.len(), 1);
        gpu.submit(batch);
        Ok(())
    }
}

/// Gathered values for the host: velocities and elastic forces may follow displacements in the same arrays.
pub(super) struct Gather {
    pub params: Buffer,
    later_params: [Buffer; 2],
    pub ids: Buffer,
    pub picked: Buffer,
    pub x: Bound,
    /// Displacements, velocities, elastic forces.
    pub state: [Bound; 3],
}

impl Gather {
    pub fn new(made: &mut Maker, capacity: usize, [x, u, v, f]: [&Buffer; 4]) -> Result<Self> {
        let params = made.uniform("params", 16, &[0u32; 4]);
        let later_params = [0; 2].map(|_| made.uniform("params", 16, &[0u32; 4]));
        let ids = made.zeros::<u32>("ids", capacity)?;
        let picked = made.vec4("picked", capacity)?;
        let bind = |params: &Buffer, source: &Buffer| {
            let list = [("params", params), ("ids", &ids), ("source", source), ("picked", &picked)];
            made.gpu.bind(&gather::SOURCE, &list)
        };
        let [of_v, of_f] = &later_params;
        let (x, state) = (bind(&params, x)?, [bind(&params, u)?, bind(of_v, v)?, bind(of_f, f)?]);
        Ok(Self { params, later_params, ids, picked, x, state })
    }
}

impl GpuBackend {
    /// Gathers by index from a bound source within the batch; returns the number of bytes to read from `picked`.
    pub(super) fn record_pick(&self, batch: &mut Batch, kernel: &Bound, ids: &[u32]) -> u64 {
        self.gpu.write(&self.pick.params, 0, &[ids.len() as u32, 0, 0, 0]);
        self.gpu.write(&self.pick.ids, 0, ids);
        batch.run(kernel, ids.len(), 1);
        (ids.len() * 16) as u64
    }

    /// Answers in one read-back, or in more where the nodes or the hits are more than one holds.
    pub(super) fn answer(&mut self, query: &Query) -> Result<Values> {
        let mut out = Values::default();
        let most = (self.pick.picked.bytes / 16) as usize;
        let mut batch = self.record();
        // displacements, velocities and elastic forces, as many at a time as fit
        let mut left = [&query.displacements[..], &query.velocities, &query.elastic_forces];
        let (counts, picked) = loop {
            let mut room = most;
            let now = left.each_mut().map(|nodes| {
                let (now, later) = nodes.split_at(nodes.len().min(room));
                (*nodes, room) = (later, room - now.len());
                now
            });
            let counts = now.map(<[u32]>::len);
            let picked = (&self.pick.picked, self.record_picks(&mut batch, now));
            if left.iter().all(|nodes| nodes.is_empty()) {
                break (counts, picked);
            }
            take(&mut out, counts, &self.gpu.submit_and_read(batch, &[picked])?[0]);
            batch = self.gpu.batch();
        };
        // with the last part, what else is asked for
        let mut wanted = vec![picked];
        let bounds = self.bounds.as_ref().filter(|_| query.bounds);
        let cutting = self.cutting.as_ref().filter(|_| !query.quads.is_empty());
        wanted.extend(bounds.map(|bounds| bounds.record(&mut batch, self.solver.in_use.tiles())));
        if let Some(cutting) = cutting {
            wanted.extend(cutting.record(&self.gpu, &mut batch, &query.quads)?);
        }
        if wanted.iter().all(|(_, bytes)| *bytes == 0) {
            self.pending = Some(batch);
            return Ok(out);
        }
        let parts = self.gpu.submit_and_read(batch, &wanted)?;
        take(&mut out, counts, &parts[0]);
        if bounds.is_some() {
            let all: Vec<[V4<f32>; 2]> = cast(&parts[1]);
            out.bounds = all.iter().map(|pair| pair.map(|v| v.map(f64::from))).collect();
        }
        if let (Some(cutting), [.., count, first]) = (cutting, &parts[..]) {
            out.hits = cutting.hits(&self.gpu, [count, first])?;
        }
        Ok(out)
    }

    /// Gathers displacements, then velocities, then elastic forces; returns the number of bytes to read from `picked`.
    fn record_picks(&self, batch: &mut Batch, nodes: [&[u32]; 3]) -> u64 {
        let mut first = 0;
        let params = [&self.pick.params, &self.pick.later_params[0], &self.pick.later_params[1]];
        for ((nodes, params), kernel) in nodes.iter().zip(params).zip(&self.pick.state) {
            self.gpu.write(params, 0, &[nodes.len() as u32, first, 0, 0]);
            first += nodes.len() as u32;
            batch.run(kernel, nodes.len(), 1);
        }
        self.gpu.write(&self.pick.ids, 0, &nodes.concat());
        u64::from(first) * 16
    }

    /// Scatters values into an array by index, in a submission of its own.
    pub(super) fn put(&mut self, destination: &Buffer, ids: &[u32], values: &[V4<f32>]) -> Result<()> {
        self.scatter(destination, ids, values, false)
    }

    /// The same, or adds them.
    fn scatter(&mut self, destination: &Buffer, ids: &[u32], values: &[V4<f32>], add: bool) -> Result<()> {
        if ids.is_empty() {
            return Ok(());
        }
        let batch = self.record();
        self.gpu.submit(batch);
        let put = self.put.as_ref().expect("only a body that is touched or cut is given values by index");
        put.now(&self.gpu, destination, ids, values, add)
    }
}

impl GpuBackend {
    /// See [`crate::backend::Backend::advance_guess`].
    pub(super) fn advance(&mut self, rhs: usize, entries: &[(u32, [f64; 3])]) -> Result<()> {
        let ids: Vec<u32> = entries.iter().map(|(node, _)| (rhs * self.node_count) as u32 + node).collect();
        let values: Vec<V4<f32>> = entries.iter().map(|(_, by)| V3::of(*by).pad(0.0)).collect();
        let x = self.solver.x.clone();
        self.scatter(&x, &ids, &values, true)?;
        if rhs == FREE && self.newton.is_some() {
            let most = (self.pick.picked.bytes / 16) as usize;
            let mut from = vec![];
            for ids in ids.chunks(most) {
                let mut batch = self.record();
                let picked = self.record_pick(&mut batch, &self.pick.x, ids);
                let parts = self.gpu.submit_and_read(batch, &[(&self.pick.picked, picked)])?;
                from.extend(ids.iter().copied().zip(cast::<V4<f32>>(&parts[0])));
            }
            self.newton.iter_mut().for_each(|newton| newton.advanced.clone_from(&from));
        }
        Ok(())
    }
}

/// Appends gathered values: `counts` of displacements, velocities and elastic forces.
fn take(out: &mut Values, [u, v, _]: [usize; 3], picked: &[u8]) {
    let mut values = triples(picked).into_iter();
    out.displacements.extend(values.by_ref().take(u));
    out.velocities.extend(values.by_ref().take(v));
    out.elastic_forces.extend(values);
}

pub(super) fn triples(bytes: &[u8]) -> Vec<[f64; 3]> {
    cast::<V4<f32>>(bytes).into_iter().map(|v| V3::from4(v).f64()).collect()
}
