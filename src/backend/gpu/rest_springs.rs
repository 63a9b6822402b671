//! Rest-shape springs on the device: nodes, stiffness, and the nodal masses without their terms in `A`.

use crate::bodies::gpu::{Dispatch, Maker};
use crate::bodies::{Model, RestSprings, rate};
use crate::error::Result;
use crate::gpu::{Buffer, Gpu};
use crate::kernels::rest_springs::SOURCE;
use crate::math::V4;

/// Arrays of a body with rest-shape springs.
pub(super) struct RestSpringPass {
    /// `[node]` DOF masks and nodal masses.
    pub masses: Buffer,
    params: Buffer,
    ids: Buffer,
    stiffness: Buffer,
    list: RestSprings,
    rate: f64,
}

impl RestSpringPass {
    /// `None` for a body without rest-shape springs.
    pub fn new(made: &mut Maker, model: &Model) -> Result<Option<Self>> {
        let count = model.rest_spring_count();
        if count == 0 {
            return Ok(None);
        }
        made.gpu.making("rest_springs");
        let RestSprings { nodes, stiffness: each } = &model.rest_springs;
        let masses: &dyn Fn() -> Vec<V4<f32>> = &|| model.dofs.iter().map(|f| f.map(|c| c as f32)).collect();
        let masses = made.with("dofs", model.node_count(), masses)?;
        let ids = made.with("ids", count, || nodes.clone())?;
        let stiffness = made.with("spring_stiffness", count, || each.iter().map(|k| *k as f32).collect())?;
        let params = made.uniform("params", 16, &[count as u32, 0, 0, 0]);
        made.gpu.making("state");
        Ok(Some(Self { masses, params, ids, stiffness, list: model.rest_springs.clone(), rate: rate(&model.step) }))
    }

    /// DOF masks and masses of nodes as in `A`.
    pub fn in_system(&self, dofs: &[(u32, V4<f64>)]) -> Vec<V4<f32>> {
        dofs.iter().map(|(node, value)| self.list.in_system(self.rate, *node, *value).map(|c| c as f32)).collect()
    }

    /// Dispatch for given displacements and right-hand side.
    pub fn bind(&self, gpu: &Gpu, u: &Buffer, b: &Buffer) -> Result<Dispatch> {
        let list = [
            ("params", &self.params),
            ("ids", &self.ids),
            ("spring_stiffness", &self.stiffness),
            ("dofs", &self.masses),
        ];
        let kernel = gpu.bind(&SOURCE, &[&list[..], &[("u", u), ("b", b)]].concat())?;
        Ok((kernel, self.list.nodes.len()))
    }
}
