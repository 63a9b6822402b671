//! Tetrahedra on the CPU path.

use super::operator::{Arrays, Rotations};
use crate::bodies::cpu::{Preconditioner, System, Workspace};
use crate::bodies::{Model, Removal};
use crate::error::Result;
use crate::kernels::blocks::{Block, finish};
use crate::kernels::precondition::precondition;
use crate::kernels::product::CellForces;
use crate::kernels::{Params, factor};
use crate::math::{M3, Real, V3, V4, rotation_matrix};

/// Arrays in one precision, with the rotations of the step.
pub struct Tetrahedra<R> {
    arrays: Arrays<R>,
    corotational: bool,
    rotations: Rotations<R>,
    node_rotations: Vec<V4<R>>,
    block: Vec<V4<R>>, // [node × 4] inverse of the node's block
}

impl<R: Real> Tetrahedra<R> {
    /// Arrays of a model.
    pub fn new(model: &Model, tetrahedra: &super::Tetrahedra) -> Self {
        let arrays: Arrays<R> = tetrahedra.arrays.rounded();
        let at_rest = vec![M3::zero(); arrays.corners.len()];
        Self {
            rotations: arrays.rotations(&at_rest, false),
            node_rotations: arrays.node_rotations(&[], false),
            corotational: tetrahedra.corotational,
            block: Vec::with_capacity(4 * model.own_nodes()),
            arrays,
        }
    }
}

impl<R: Real> System<R> for Tetrahedra<R> {
    fn forces(
        &mut self,
        _: &Params<R>,
        u: &[V4<R>],
        at: &[V4<R>],
        f: &mut [V4<R>],
        _: &mut [CellForces<R>],
    ) -> Result<()> {
        if self.corotational {
            self.rotations = self.arrays.rotations(&self.arrays.displacement_gradients(u), true);
            self.node_rotations = self.arrays.node_rotations(u, true);
        }
        self.arrays.forces(at, &self.rotations, f);
        Ok(())
    }

    fn blocks(&self, params: &Params<R>, free: &[V4<R>], out: &mut [V4<R>]) {
        for (i, (block, q)) in self.arrays.block.iter().zip(&self.node_rotations).enumerate() {
            let r = rotation_matrix(*q);
            let own = Block { d: r * *block * r.transpose(), g: M3::zero() };
            out[i * 4..i * 4 + 4].copy_from_slice(&finish(params, own, free[i], V3::zero()));
        }
    }

    fn refresh(&mut self, params: &Params<R>, free: &[V4<R>]) {
        let mut block = std::mem::take(&mut self.block);
        block.resize(4 * params.node_count as usize, [R::zero(); 4]);
        self.blocks(params, free, &mut block);
        factor::factor(params, &mut block);
        self.block = block;
    }

    fn product(&self, params: &Params<R>, free: &[V4<R>], z: &[V4<R>], w: &mut [V4<R>], _: &mut [CellForces<R>]) -> R {
        self.arrays.product(z, &self.rotations, w);
        let mut dot = R::zero();
        for i in 0..z.len() {
            let own = V3::from4(z[i]);
            let sum = V3::from4(w[i]) * params.stiffness_factor + own * (params.inertia * free[i][3]);
            let out = sum.times(V3::from4(free[i]));
            w[i] = out.pad(R::zero());
            dot += own.dot(out);
        }
        dot
    }

    fn preconditioner<'a>(&'a self, params: &'a Params<R>, _: &'a [V4<R>]) -> Preconditioner<'a, R> {
        Box::new(move |_, r, z| precondition(params, &self.block, r, z))
    }

    fn stored_bytes(&self) -> usize {
        size_of_val(&self.rotations.element[..])
            + size_of_val(&self.rotations.domain[..])
            + size_of_val(&self.block[..])
    }

    fn workspace(&self, _: &Params<R>) -> Workspace<R> {
        Workspace::default()
    }

    fn points(&self, _: &Params<R>, u: &[V4<R>], points: &mut [V4<R>]) {
        points.copy_from_slice(u);
    }

    fn take(&mut self, _: &Params<R>, _: &Removal) {}

    fn nodes_in_use(&self, params: &Params<R>) -> usize {
        params.node_count as usize
    }

    fn rotations(&self) -> Vec<V4<f64>> {
        vec![]
    }

    fn set_rotations(&mut self, _: &[V4<f64>]) {}

    fn law(&self) -> Vec<V4<f64>> {
        vec![]
    }

    fn split(&self) -> &[u32] {
        &[]
    }
}
