//! Changes by a cut on the device: the table of split nodes, the state of new duplicates, removed elements.

use super::GpuBackend;
use super::arrays::axes;
use crate::bodies::gpu::{InUse, Maker, Recorded, Reserved};
use crate::bodies::{Model, Removal};
use crate::error::Result;
use crate::gpu::{Bound, Buffer, Gpu};
use crate::kernels::duplicate;
use crate::math::V4;

/// Arrays and kernels for cuts.
pub(super) struct Split {
    /// Copy of the device's table.
    pub host: Vec<u32>,
    table: Buffer,
    params: Buffer,
    pairs: Buffer,
    copies: Vec<(Bound, u32)>, // kernels that duplicate nodal arrays, and the right-hand sides of each array
    reserved: Reserved,
}

impl Split {
    /// For a body whose nodes can be split, after all other arrays; `arrays` with their number of right-hand sides.
    pub fn new(
        made: &mut Maker,
        model: &Model,
        kind: &dyn Recorded,
        arrays: &[(&Buffer, u32)],
    ) -> Result<Option<Self>> {
        let Some((table, host)) = kind.split() else {
            return Ok(None);
        };
        let most = model.node_count() - model.own_nodes();
        let params = made.uniform("params", 16, &[0u32; 4]);
        let pairs = made.zeros::<[u32; 2]>("pairs", most)?;
        let bind = |(values, rhs_count): &(&Buffer, u32)| {
            let list = [("params", &params), ("pairs", &pairs), ("values", *values)];
            Ok((made.gpu.bind(&duplicate::SOURCE, &list)?, *rhs_count))
        };
        let copies = arrays.iter().map(bind).collect::<Result<_>>()?;
        let reserved = std::mem::take(&mut made.reserved);
        Ok(Some(Self { host, table, params, pairs, copies, reserved }))
    }

    /// Applies new table words and duplicates, in a submission of its own; earlier commands must have been submitted.
    pub fn take(&mut self, gpu: &Gpu, node_count: usize, words: &[(u32, u32)], copies: &[[u32; 2]]) {
        for (word, value) in words {
            self.host[*word as usize] = *value;
        }
        // first cut: parameter blocks that know the reserve
        if !self.reserved.blocks.is_empty() {
            let Reserved { blocks, sums } = std::mem::take(&mut self.reserved);
            for (params, block) in blocks {
                gpu.write(&block, 0, &params.words());
            }
            // partial sums of groups without threads must be zero under the new count as well
            let mut batch = gpu.batch();
            sums.iter().for_each(|sums| batch.clear(sums, 0, sums.bytes));
            gpu.submit(batch);
        }
        // ascending words: one write per run of consecutive words
        for run in words.chunk_by(|a, b| a.0 + 1 == b.0) {
            let values: Vec<u32> = run.iter().map(|(_, value)| *value).collect();
            gpu.write(&self.table, u64::from(run[0].0) * 4, &values);
        }
        if copies.is_empty() {
            return;
        }
        // state of the new duplicates
        gpu.write(&self.params, 0, &[copies.len() as u32, node_count as u32, 0, 0]);
        gpu.write(&self.pairs, 0, copies);
        let mut batch = gpu.batch();
        for (kernel, rhs_count) in &self.copies {
            batch.run(kernel, copies.len(), *rhs_count);
        }
        gpu.submit(batch);
    }
}

impl GpuBackend {
    /// Implements [`crate::backend::Backend::remove`].
    pub(super) fn take(&mut self, removal: &Removal) -> Result<()> {
        let Removal { cells, springs, copies, words, dofs, .. } = removal;
        let batch = self.record();
        self.gpu.submit(batch);
        if let Some(split) = &mut self.split {
            split.take(&self.gpu, self.node_count, words, copies);
            self.solver.in_use = InUse::new(&self.params, &split.host);
        }
        self.kind.take(&self.gpu, removal);
        // removed elements, new masses
        let gone = if self.rotates { cells } else { springs };
        if let Some(elements) = self.body.elements.clone() {
            self.put(&elements, gone, &vec![[0f32; 4]; gone.len()])?;
        }
        let ids: Vec<u32> = dofs.iter().map(|(n, _)| *n).collect();
        let values: Vec<V4<f32>> = dofs.iter().map(|(_, v)| v.map(|c| c as f32)).collect();
        let buffer = self.body.masses.clone();
        self.put(&buffer, &ids, &values)?;
        if let Some(rest_springs) = &self.rest_springs {
            let (buffer, values) = (self.body.dofs.clone(), rest_springs.in_system(dofs));
            self.put(&buffer, &ids, &values)?;
        }
        for (node, value) in dofs {
            self.axes[*node as usize] = axes(*value);
        }
        // nodes without cells leave the system at their position
        let dead: Vec<u32> = dofs.iter().filter(|(_, v)| v[3] == 0.0).map(|(n, _)| *n).collect();
        let zeros = vec![[0f32; 4]; dead.len()];
        let v = self.body.v.clone();
        self.put(&v, &dead, &zeros)?;
        let x = self.solver.x.clone();
        for rhs in 0..self.params.rhs_count as usize {
            let ids: Vec<u32> = dead.iter().map(|n| (rhs * self.node_count) as u32 + n).collect();
            self.put(&x, &ids, &zeros)?;
        }
        Ok(())
    }
}
