//! Spring networks on a device.

use crate::bodies::Model;
use crate::bodies::gpu::{Arrays, Dispatch, Maker, Recorded};
use crate::error::Result;
use crate::gpu::{Bound, Buffer, Gpu};
use crate::kernels::{GROUP, Params, springs, springs_blocks, springs_product};
use crate::math::{V3, V4};

/// Spring arrays on a device.
pub(super) struct Springs {
    shared: Arrays,
    law: Buffer,
    nodes: usize,
}

impl Springs {
    pub fn new(springs: &super::Springs, model: &Model, made: &mut Maker) -> Result<Self> {
        let (count, nodes) = (model.elements().spring_count, model.own_nodes());
        let rest: &dyn Fn() -> Vec<V4<f32>> = &|| model.rest.iter().map(|p| V3::of(*p).pad(0.0)).collect();
        let law: &dyn Fn() -> Vec<V4<f32>> = &|| springs.law.iter().map(|l| l.map(|c| c as f32)).collect();
        let law = made.with("law", count, law)?;
        let shared = Arrays::of(&[
            made.with("rest", nodes, rest)?,
            made.with("first", nodes + 1, || springs.first.clone())?,
            made.with("half", 2 * count, || springs.half.clone())?,
            made.vec4("tangent", 4 * count)?,
            law.clone(),
        ]);
        Ok(Self { shared, law, nodes: model.node_count() })
    }
}

impl Recorded for Springs {
    fn shared(&self) -> Arrays {
        self.shared.clone()
    }

    fn elements(&self) -> Option<Buffer> {
        Some(self.law.clone())
    }

    fn mean_velocities(&self) -> Option<Buffer> {
        None
    }

    fn forces(&self, gpu: &Gpu, arrays: &Arrays, main: &Buffer, _: Option<&Buffer>) -> Result<Vec<Dispatch>> {
        Ok(vec![(arrays.bind(gpu, &springs::SOURCE, &[("params", main)])?, self.nodes)])
    }

    fn blocks(&self, gpu: &Gpu, arrays: &Arrays, more: &[(&'static str, &Buffer)]) -> Result<Bound> {
        arrays.bind(gpu, &springs_blocks::SOURCE, more)
    }

    fn product(
        &mut self,
        made: &mut Maker,
        arrays: &Arrays,
        params: &Params<f32>,
        main: &Buffer,
    ) -> Result<Vec<Dispatch>> {
        let kernel = arrays.bind(made.gpu, &springs_product::SOURCE, &[("params", main)])?;
        Ok(vec![(kernel, params.product_groups as usize * GROUP as usize)])
    }
}
