//! Indexed access of the host to device arrays: gathered values to read, scattered values to write.

use super::GpuBackend;
use crate::bodies::gpu::Maker;
use crate::error::Result;
use crate::gpu::{Batch, Bound, Buffer, Gpu, cast};
use crate::kernels::{gather, scatter};
use crate::math::{V3, V4};

/// Scattered values from the host: contact rows, coefficients, and changes by a cut.
pub(super) struct Put {
    pub row_params: Buffer,
    pub params: Buffer,
    pub ids: Buffer,
    pub values: Buffer,
    pub rows: Bound,
}

impl Put {
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

/// Gathered values for the host.
pub(super) struct Pick {
    pub params: Buffer,
    pub ids: Buffer,
    pub picked: Buffer,
    pub x: Bound,
    pub u: Bound,
    pub f: Bound,
}

impl Pick {
    pub fn new(made: &mut Maker, capacity: usize, [x, u, f]: [&Buffer; 3]) -> Result<Self> {
        let params = made.uniform("params", 16, &[0u32; 4]);
        let ids = made.of("ids", &vec![0u32; capacity])?;
        let picked = made.vec4("picked", capacity)?;
        let bind = |source: &Buffer| {
            let list = [("params", &params), ("ids", &ids), ("source", source), ("picked", &picked)];
            made.gpu.bind(&gather::SOURCE, &list)
        };
        let (x, u, f) = (bind(x)?, bind(u)?, bind(f)?);
        Ok(Self { params, ids, picked, x, u, f })
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

    pub(super) fn read_picked(&mut self, ids: &[u32], kernel: fn(&Pick) -> &Bound) -> Result<Vec<[f64; 3]>> {
        let mut out = Vec::with_capacity(ids.len());
        for part in ids.chunks((self.pick.ids.bytes / 4) as usize) {
            let mut batch = self.record();
            let bytes = self.record_pick(&mut batch, kernel(&self.pick), part);
            out.extend(triples(&self.gpu.submit_and_read(batch, &[(&self.pick.picked, bytes)])?[0]));
        }
        Ok(out)
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

pub(super) fn triples(bytes: &[u8]) -> Vec<[f64; 3]> {
    cast::<V4<f32>>(bytes).into_iter().map(|v| V3::from4(v).f64()).collect()
}
