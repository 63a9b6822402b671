//! Indexed access of the host to device arrays: gathered values to read, scattered values to write.

use super::GpuBackend;
use crate::backend::{Query, Values};
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
        let (ids, values) = (made.of("ids", &vec![0u32; capacity])?, made.vec4("values", capacity)?);
        let list = [("params", &row_params), ("ids", &ids), ("values", &values), ("destination", r)];
        let rows = gpu.bind(&scatter::SOURCE, &list)?;
        Ok(Self { row_params, params, ids, values, rows })
    }

    /// Scatters values into any array, in a submission of its own.
    pub fn now(&self, gpu: &Gpu, destination: &Buffer, ids: &[u32], values: &[V4<f32>]) -> Result<()> {
        let list =
            [("params", &self.params), ("ids", &self.ids), ("values", &self.values), ("destination", destination)];
        let kernel = gpu.bind(&scatter::SOURCE, &list)?;
        gpu.write(&self.params, 0, &[ids.len() as u32, 0, 0, 0]);
        gpu.write(&self.ids, 0, ids);
        gpu.write(&self.values, 0, values);
        let mut batch = gpu.batch();
        batch.run(&kernel, ids.len(), 1);
        gpu.submit(batch);
        Ok(())
    }
}

/// Gathered values for the host: elastic forces may follow displacements in the same arrays.
pub(super) struct Gather {
    pub params: Buffer,
    force_params: Buffer,
    pub ids: Buffer,
    pub picked: Buffer,
    pub x: Bound,
    pub u: Bound,
    pub f: Bound,
}

impl Gather {
    pub fn new(made: &mut Maker, capacity: usize, [x, u, f]: [&Buffer; 3]) -> Result<Self> {
        let (params, force_params) = (made.uniform("params", 16, &[0u32; 4]), made.uniform("params", 16, &[0u32; 4]));
        let ids = made.of("ids", &vec![0u32; capacity])?;
        let picked = made.vec4("picked", capacity)?;
        let bind = |params: &Buffer, source: &Buffer| {
            let list = [("params", params), ("ids", &ids), ("source", source), ("picked", &picked)];
            made.gpu.bind(&gather::SOURCE, &list)
        };
        let (x, u, f) = (bind(&params, x)?, bind(&params, u)?, bind(&force_params, f)?);
        Ok(Self { params, force_params, ids, picked, x, u, f })
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
        let most = (self.pick.ids.bytes / 4) as usize;
        let mut batch = self.record();
        // displacements and elastic forces, as many at a time as fit
        let (mut u, mut f) = (&query.displacements[..], &query.elastic_forces[..]);
        let (moved, picked) = loop {
            let (now_u, later_u) = u.split_at(u.len().min(most));
            let (now_f, later_f) = f.split_at(f.len().min(most - now_u.len()));
            let picked = (&self.pick.picked, self.record_picks(&mut batch, now_u, now_f));
            (u, f) = (later_u, later_f);
            if u.is_empty() && f.is_empty() {
                break (now_u.len(), picked);
            }
            take(&mut out, now_u.len(), &self.gpu.submit_and_read(batch, &[picked])?[0]);
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
        take(&mut out, moved, &parts[0]);
        if bounds.is_some() {
            let all: Vec<[V4<f32>; 2]> = cast(&parts[1]);
            out.bounds = all.iter().map(|pair| pair.map(|v| v.map(f64::from))).collect();
        }
        if let (Some(cutting), [.., count, first]) = (cutting, &parts[..]) {
            out.hits = cutting.hits(&self.gpu, [count, first])?;
        }
        Ok(out)
    }

    /// Gathers displacements, then elastic forces; returns the number of bytes to read from `picked`.
    fn record_picks(&self, batch: &mut Batch, u: &[u32], f: &[u32]) -> u64 {
        let counts = [u.len() as u32, f.len() as u32];
        self.gpu.write(&self.pick.params, 0, &[counts[0], 0, 0, 0]);
        self.gpu.write(&self.pick.force_params, 0, &[counts[1], counts[0], 0, 0]);
        self.gpu.write(&self.pick.ids, 0, &[u, f].concat());
        batch.run(&self.pick.u, u.len(), 1);
        batch.run(&self.pick.f, f.len(), 1);
        ((u.len() + f.len()) * 16) as u64
    }

    /// Scatters values into an array by index, in a submission of its own.
    pub(super) fn put(&mut self, destination: &Buffer, ids: &[u32], values: &[V4<f32>]) -> Result<()> {
        if ids.is_empty() {
            return Ok(());
        }
        let batch = self.record();
        self.gpu.submit(batch);
        let put = self.put.as_ref().expect("only a body that is touched or cut is given values by index");
        put.now(&self.gpu, destination, ids, values)
    }
}

/// Appends gathered values, of which the first `moved` are displacements and the others elastic forces.
fn take(out: &mut Values, moved: usize, picked: &[u8]) {
    let mut values = triples(picked).into_iter();
    out.displacements.extend(values.by_ref().take(moved));
    out.elastic_forces.extend(values);
}

pub(super) fn triples(bytes: &[u8]) -> Vec<[f64; 3]> {
    cast::<V4<f32>>(bytes).into_iter().map(|v| V3::from4(v).f64()).collect()
}
