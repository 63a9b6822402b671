//! Split nodes on the device: the table that kernels read, and the state of new copies.

use super::arrays::{Arrays, Maker};
use crate::error::Result;
use crate::gpu::{Bound, Buffer, Gpu};
use crate::kernels::{Params, duplicate};
use crate::mesh::Parts;
use crate::model::Model;

/// See the module.
pub(super) struct Split {
    /// The table as the device has it.
    pub host: Vec<u32>,
    table: Buffer,
    params: Buffer,
    pairs: Buffer,
    copies: Vec<(Bound, u32)>, // arrays that are duplicated, and their slots
}

impl Split {
    /// For a body of which something can be split; `arrays` by their number of slots.
    pub fn new(made: &mut Maker, model: &Model, shared: &Arrays, arrays: &[(&Buffer, u32)]) -> Result<Option<Self>> {
        let Some(table) = shared.get("split").filter(|_| model.extra_columns > 0) else {
            return Ok(None);
        };
        let most = model.node_count() - model.grid.node_count();
        let params = made.uniform("params", 16, &[0u32; 4]);
        let pairs = made.of("pairs", &vec![[0u32; 2]; most])?;
        let bind = |(values, slots): &(&Buffer, u32)| {
            let list = [("params", &params), ("pairs", &pairs), ("values", *values)];
            Ok((made.gpu.bind(&duplicate::SOURCE, &list)?, *slots))
        };
        let copies = arrays.iter().map(bind).collect::<Result<_>>()?;
        Ok(Some(Self { host: Parts::new(model.params()).table().to_vec(), table, params, pairs, copies }))
    }

    /// Takes over new words and copies, in its own submission; what was recorded before must have been submitted.
    pub fn take(&mut self, gpu: &Gpu, node_count: usize, words: &[(u32, u32)], copies: &[[u32; 2]]) {
        for (word, value) in words {
            self.host[*word as usize] = *value;
        }
        // rising words: written by runs without a hole
        for run in words.chunk_by(|a, b| a.0 + 1 == b.0) {
            let values: Vec<u32> = run.iter().map(|(_, value)| *value).collect();
            gpu.write(&self.table, u64::from(run[0].0) * 4, &values);
        }
        if copies.is_empty() {
            return;
        }
        gpu.write(&self.params, 0, &[copies.len() as u32, node_count as u32, 0, 0]);
        gpu.write(&self.pairs, 0, copies);
        let mut batch = gpu.batch();
        for (kernel, slots) in &self.copies {
            batch.run(kernel, copies.len(), *slots);
        }
        gpu.submit(batch);
    }

    /// Touched nodes.
    pub fn touched(&self, params: &Params<f32>) -> usize {
        params.touched(&self.host).len()
    }
}
