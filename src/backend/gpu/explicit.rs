//! Explicit steps on the device: one division per node instead of a solve, without the arrays of the conjugate gradients.

use super::GpuBackend;
use super::exchange::triples;
use super::solver::Solver;
use crate::backend::SolveRequest;
use crate::bodies::Model;
use crate::bodies::gpu::{Arrays, Dispatch, InUse, Maker, over_nodes};
use crate::error::Result;
use crate::gpu::Buffer;
use crate::kernels::{Params, accelerate, ahead};
use crate::linear::Outcome;

/// Steps submitted before the host waits: more fill the device's queue, fewer cost one wait each.
const UNREAD: u32 = 32;

/// Displacements at which a damped explicit step evaluates its elastic forces.
pub(super) struct Ahead {
    pub kernel: Dispatch,
    pub y: Buffer,
}

impl Ahead {
    /// `None` if forces are evaluated at the current displacements.
    pub fn new(made: &mut Maker, model: &Model, main: &Buffer, u: &Buffer, v: &Buffer) -> Result<Option<Self>> {
        if model.step.lead_time() <= 0.0 {
            return Ok(None);
        }
        let n = model.node_count();
        let y = made.vec4("y", n)?;
        let kernel = made.gpu.bind(&ahead::SOURCE, &[("params", main), ("u", u), ("v", v), ("y", &y)])?;
        Ok(Some(Self { kernel: (kernel, over_nodes(&model.params())), y }))
    }
}

impl Solver {
    /// Solver of a diagonal system: right-hand side, increments and one dispatch. The buffers of the iteration are unused aliases of the
    /// right-hand side.
    pub(super) fn explicit(made: &mut Maker, arrays: &Arrays, params: Params<f32>, main: &Buffer) -> Result<Self> {
        let n = params.node_count as usize;
        let [x, r] = ["x", "r"].map(|name| made.vec4(name, n * params.rhs_count as usize));
        let (x, r) = (x?, r?);
        let kernel = arrays.bind(made.gpu, &accelerate::SOURCE, &[("params", main), ("b", &r), ("x", &x)])?;
        Ok(Self::of_one(x, r, (kernel, over_nodes(&params)), InUse::new(&params, &[])))
    }
}

impl GpuBackend {
    /// Unconstrained motion of an explicit step, and its values at nodes.
    pub(super) fn accelerate(
        &mut self,
        requests: &[SolveRequest],
        pick: &[(usize, u32)],
    ) -> Result<(Vec<Outcome>, Vec<[f64; 3]>)> {
        let mut batch = self.record();
        self.solver.record(&mut batch, false, 1, 1);
        let ids: Vec<u32> = pick.iter().map(|(rhs, node)| (rhs * self.node_count) as u32 + node).collect();
        let picked = self.record_pick(&mut batch, &self.pick.x, &ids);
        let unread = self.unread.unwrap_or(0) + 1;
        let wait = !ids.is_empty() || unread == UNREAD;
        self.unread = Some(if wait { 0 } else { unread });
        let values = if !wait {
            self.gpu.submit(batch);
            vec![]
        } else {
            triples(&self.gpu.submit_and_read(batch, &[(&self.pick.picked, picked.max(16))])?[0])
        };
        Ok((vec![Outcome::exact(); requests.len()], values.into_iter().take(ids.len()).collect()))
    }
}
