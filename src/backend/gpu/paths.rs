//! Prescribed paths on the device: the nodes on them, where they are at the end of the step, and their increments.

use super::GpuBackend;
use crate::bodies::Model;
use crate::bodies::gpu::Maker;
use crate::error::Result;
use crate::gpu::{Batch, Bound, Buffer, Gpu};
use crate::kernels::prescribe::SOURCE;
use crate::math::V4;

/// Arrays of a body with nodes on paths.
pub(super) struct Driven {
    params: Buffer,
    ids: Buffer,
    values: Buffer,
    kernel: Bound,
    count: usize,
}

impl Driven {
    /// `None` for a body without paths; `x` takes the increments.
    pub fn new(made: &mut Maker, model: &Model, dofs: &Buffer, u: &Buffer, x: &Buffer) -> Result<Option<Self>> {
        let nodes = model.driven_count();
        if nodes == 0 {
            return Ok(None);
        }
        made.gpu.making("paths");
        // a cut may duplicate nodes on paths
        let room = nodes + model.node_count() - model.own_nodes();
        let params = made.uniform("params", 16, &[0u32; 4]);
        let (ids, values) = (made.zeros::<u32>("ids", room)?, made.vec4("values", room)?);
        let list = [("params", &params), ("ids", &ids), ("values", &values), ("dofs", dofs), ("u", u), ("x", x)];
        let kernel = made.gpu.bind(&SOURCE, &list)?;
        Ok(Some(Self { params, ids, values, kernel, count: 0 }))
    }

    /// Sets the nodes and their prescribed displacements, m.
    fn set(&mut self, gpu: &Gpu, nodes: &[u32], target: &[[f64; 3]]) {
        let values: Vec<V4<f32>> = target.iter().map(|t| [t[0] as f32, t[1] as f32, t[2] as f32, 0.0]).collect();
        gpu.write(&self.params, 0, &[nodes.len() as u32, 0, 0, 0]);
        gpu.write(&self.ids, 0, nodes);
        gpu.write(&self.values, 0, &values);
        self.count = nodes.len();
    }

    /// Records the increments.
    pub fn record(&self, batch: &mut Batch) {
        batch.run(&self.kernel, self.count, 1);
    }
}

impl GpuBackend {
    /// See [`crate::backend::Backend::prescribe`]; Newton's method takes the increments with its first trial point.
    pub(super) fn drive(&mut self, nodes: &[u32], target: &[[f64; 3]]) {
        let mut batch = self.record();
        if let Some(driven) = &mut self.driven {
            driven.set(&self.gpu, nodes, target);
            if self.newton.is_none() {
                driven.record(&mut batch);
            }
        }
        self.pending = Some(batch);
    }
}
