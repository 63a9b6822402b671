//! Tetrahedra on the CPU path.

use super::operator::{Arrays, For, Rotations};
use crate::bodies::cpu::{Preconditioner, System, Workspace};
use crate::bodies::{Model, Removal};
use crate::error::Result;
use crate::kernels::precondition::precondition;
use crate::kernels::product::{CellForces, LANES};
use crate::kernels::{Params, factor, tetrahedra_blocks, tetrahedra_centres, tetrahedra_forces};
use crate::math::{Real, V4};

/// Arrays in one precision, with the rotations of the step.
pub struct Tetrahedra<R> {
    arrays: Arrays<R>,
    corotational: bool,
    can_change: bool,
    rotations: Rotations<R>,
    node_rotations: Vec<V4<R>>,
    block: Vec<V4<R>>, // [node × 4] inverse of the node's block
}

impl<R: Real> Tetrahedra<R> {
    /// Arrays of a model.
    pub fn new(model: &Model, tetrahedra: &super::Tetrahedra) -> Self {
        let arrays: Arrays<R> = tetrahedra.arrays.rounded();
        Self {
            rotations: if arrays.is_hyperelastic() { arrays.unlinearised() } else { arrays.rotations(&[], false) },
            node_rotations: arrays.node_rotations(&[], false),
            corotational: tetrahedra.corotational,
            can_change: tetrahedra.can_change,
            block: Vec::with_capacity(4 * model.node_count()),
            arrays,
        }
    }
}

/// The scratch of a right-hand side as numbers.
fn numbers<R>(scratch: &mut [CellForces<R>]) -> &mut [R] {
    scratch.as_flattened_mut().as_flattened_mut().as_flattened_mut()
}

impl<R: Real> System<R> for Tetrahedra<R> {
    fn forces(
        &mut self,
        params: &Params<R>,
        u: &[V4<R>],
        at: &[V4<R>],
        f: &mut [V4<R>],
        scratch: &mut [CellForces<R>],
    ) -> Result<()> {
        if self.arrays.is_hyperelastic() {
            let (purpose, scratch) = (For::Steps(params.stiffness_factor), numbers(scratch));
            let forces = self.arrays.forces_of_law(at, purpose, &mut self.rotations, scratch);
            tetrahedra_forces::tetrahedra_forces(&self.arrays.first_of_node, &self.arrays.of_node, forces, f);
            self.node_rotations = self.arrays.node_rotations(u, true);
            return Ok(());
        }
        if self.corotational {
            self.rotations = self.arrays.rotations(u, true);
            self.node_rotations = self.arrays.node_rotations(u, true);
        }
        self.arrays.forces(at, &self.rotations, f, numbers(scratch));
        Ok(())
    }

    fn blocks(&self, params: &Params<R>, free: &[V4<R>], out: &mut [V4<R>]) {
        tetrahedra_blocks::tetrahedra_blocks(params, &self.arrays.rest_block, &self.node_rotations, free, out);
    }

    fn refresh(&mut self, params: &Params<R>, free: &[V4<R>]) {
        let mut block = std::mem::take(&mut self.block);
        block.resize(4 * params.node_count as usize, [R::zero(); 4]);
        self.blocks(params, free, &mut block);
        factor::factor(params, &mut block);
        self.block = block;
    }

    fn product(
        &self,
        params: &Params<R>,
        free: &[V4<R>],
        z: &[V4<R>],
        w: &mut [V4<R>],
        scratch: &mut [CellForces<R>],
    ) -> R {
        self.arrays.system_product(params, free, z, &self.rotations, w, numbers(scratch))
    }

    fn preconditioner<'a>(&'a self, params: &'a Params<R>, _: &'a [V4<R>]) -> Preconditioner<'a, R> {
        Box::new(move |_, r, z| precondition(params, &self.block, r, z))
    }

    fn stored_bytes(&self) -> usize {
        size_of_val(&self.rotations.element[..])
            + size_of_val(&self.rotations.domain[..])
            + size_of_val(&self.rotations.cofactor[..])
            + size_of_val(&self.rotations.frame[..])
            + size_of_val(&self.block[..])
    }

    fn workspace(&self, _: &Params<R>) -> Workspace<R> {
        let numbers = size_of::<CellForces<R>>() / size_of::<R>();
        let scratch = vec![[[[R::zero(); LANES]; 3]; 8]; self.arrays.scratch_len().div_ceil(numbers)];
        Workspace { scratch, levels: vec![] }
    }

    fn points(&self, _: &Params<R>, u: &[V4<R>], points: &mut [V4<R>]) {
        tetrahedra_centres::tetrahedra_centres(&self.arrays.corners, u, points);
    }

    fn take(&mut self, _: &Params<R>, removal: &Removal) {
        if let Some((operator, changes)) = &removal.operator {
            self.arrays.take(operator, changes);
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
        vec![]
    }

    fn split(&self) -> &[u32] {
        if self.can_change { self.arrays.corners.as_flattened() } else { &[] }
    }
}
