//! Spring networks on the CPU path.

use crate::bodies::cpu::{Preconditioner, System, Workspace};
use crate::bodies::{Model, Removal};
use crate::error::Result;
use crate::kernels::precondition::precondition;
use crate::kernels::product::CellForces;
use crate::kernels::{Params, factor, springs, springs_blocks, springs_product};
use crate::math::{Real, V3, V4, round, widen};

/// Spring arrays in one precision.
pub struct Springs<R> {
    rest: Vec<V4<R>>,
    first: Vec<u32>,
    half: Vec<[u32; 2]>,
    law: Vec<V4<R>>,
    tangent: Vec<V4<R>>, // [half spring × 2], at the start of the step
    block: Vec<V4<R>>,   // [node × 4] inverse of the node's block
}

impl<R: Real> Springs<R> {
    /// Arrays of an uncut model.
    pub fn new(model: &Model, springs: &super::Springs) -> Self {
        Self {
            rest: model.rest.iter().map(|p| V3::of(*p).pad(R::zero())).collect(),
            first: springs.first.clone(),
            half: springs.half.clone(),
            law: springs.law.iter().map(round).collect(),
            tangent: vec![[R::zero(); 4]; springs.half.len() * 2],
            block: vec![],
        }
    }
}

impl<R: Real> System<R> for Springs<R> {
    fn forces(
        &mut self,
        params: &Params<R>,
        _: &[V4<R>],
        at: &[V4<R>],
        f: &mut [V4<R>],
        _: &mut [CellForces<R>],
    ) -> Result<()> {
        springs::springs(params, &self.rest, at, &self.first, &self.half, &self.law, f, &mut self.tangent);
        Ok(())
    }

    fn blocks(&self, params: &Params<R>, dofs: &[V4<R>], out: &mut [V4<R>]) {
        springs_blocks::springs_blocks(params, &self.first, &self.half, &self.tangent, dofs, out);
    }

    fn refresh(&mut self, params: &Params<R>, dofs: &[V4<R>]) {
        let mut block = std::mem::take(&mut self.block);
        block.resize(4 * params.node_count as usize, [R::zero(); 4]);
        self.blocks(params, dofs, &mut block);
        factor::factor(params, &mut block);
        self.block = block;
    }

    fn product(&self, params: &Params<R>, dofs: &[V4<R>], z: &[V4<R>], w: &mut [V4<R>], _: &mut [CellForces<R>]) -> R {
        springs_product::springs_product(params, &self.first, &self.half, &self.tangent, dofs, z, w)
    }

    fn preconditioner<'a>(&'a self, params: &'a Params<R>, _: &'a [V4<R>]) -> Preconditioner<'a, R> {
        Box::new(move |_, r, z| precondition(params, &self.block, r, z))
    }

    fn stored_bytes(&self) -> usize {
        size_of_val(&self.tangent[..]) + size_of_val(&self.block[..])
    }

    fn workspace(&self, _: &Params<R>) -> Workspace<R> {
        Workspace::default()
    }

    fn points(&self, _: &Params<R>, u: &[V4<R>], points: &mut [V4<R>]) {
        points.copy_from_slice(u);
    }

    fn take(&mut self, _: &Params<R>, removal: &Removal) {
        for spring in &removal.springs {
            self.law[*spring as usize] = [R::zero(); 4];
        }
    }

    fn nodes_in_use(&self, params: &Params<R>) -> usize {
        params.node_count as usize
    }

    fn rotations(&self) -> Vec<V4<f64>> {
        vec![]
    }

    fn set_rotations(&mut self, _: &[V4<f64>]) {}

    fn law(&self) -> Vec<V4<f64>> {
        widen(&self.law)
    }

    fn split(&self) -> &[u32] {
        &[]
    }
}
