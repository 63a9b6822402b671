//! Rest-shape springs on the device: nodes, stiffness, and the nodal masses without their terms in `A`.

use crate::bodies::gpu::{Dispatch, Maker};
use crate::bodies::{Anchors, Model, rate};
use crate::error::Result;
use crate::gpu::{Buffer, Gpu};
use crate::kernels::anchors::SOURCE;
use crate::math::V4;

/// Arrays of a body with rest-shape springs.
pub(super) struct Anchored {
    /// `[node]` DOF masks and nodal masses.
    pub masses: Buffer,
    params: Buffer,
    ids: Buffer,
    anchor: Buffer,
    list: Anchors,
    rate: f64,
}

impl Anchored {
    /// `None` for a body without rest-shape springs.
    pub fn new(made: &mut Maker, model: &Model) -> Result<Option<Self>> {
        let count = model.anchor_count();
        if count == 0 {
            return Ok(None);
        }
        made.gpu.making("anchors");
        let Anchors { nodes, stiffness } = &model.anchors;
        let masses: &dyn Fn() -> Vec<V4<f32>> = &|| model.free.iter().map(|f| f.map(|c| c as f32)).collect();
        let masses = made.with("free", model.node_count(), masses)?;
        let ids = made.with("ids", count, || nodes.clone())?;
        let anchor = made.with("anchor", count, || stiffness.iter().map(|k| *k as f32).collect())?;
        let params = made.uniform("params", 16, &[count as u32, 0, 0, 0]);
        made.gpu.making("state");
        Ok(Some(Self { masses, params, ids, anchor, list: model.anchors.clone(), rate: rate(&model.step) }))
    }

    /// DOF masks and masses of nodes as in `A`.
    pub fn in_system(&self, free: &[(u32, V4<f64>)]) -> Vec<V4<f32>> {
        free.iter().map(|(node, value)| self.list.in_system(self.rate, *node, *value).map(|c| c as f32)).collect()
    }

    /// Dispatch for given displacements and right-hand side.
    pub fn bind(&self, gpu: &Gpu, u: &Buffer, b: &Buffer) -> Result<Dispatch> {
        let list = [("params", &self.params), ("ids", &self.ids), ("anchor", &self.anchor), ("free", &self.masses)];
        let kernel = gpu.bind(&SOURCE, &[&list[..], &[("u", u), ("b", b)]].concat())?;
        Ok((kernel, self.list.nodes.len()))
    }
}
