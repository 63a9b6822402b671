//! Tetrahedra on the CPU path.

use super::auxiliary::{Auxiliary, GAIN, Lists, Transfer};
use super::operator::{Arrays, For, Rotations};
use crate::bodies::cpu::{Preconditioner, System, Workspace};
use crate::bodies::grid::cpu::Hexahedra;
use crate::bodies::{Model, Removal};
use crate::error::Result;
use crate::kernels::precondition::precondition;
use crate::kernels::product::{CellForces, LANES};
use crate::kernels::relax::relax;
use crate::kernels::{
    Params, auxiliary_correction, auxiliary_restriction, auxiliary_rotations, factor, tetrahedra_blocks,
    tetrahedra_centres, tetrahedra_forces,
};
use crate::math::{Real, V4};

/// Arrays in one precision, with the rotations of the step.
pub struct Tetrahedra<R> {
    arrays: Arrays<R>,
    corotational: bool,
    can_change: bool,
    rotations: Rotations<R>,
    node_rotations: Vec<V4<R>>,
    block: Vec<V4<R>>, // [node × 4] inverse of the node's block
    multigrid: Option<Multigrid<R>>,
}

/// The auxiliary grid in one precision.
struct Multigrid<R> {
    transfer: Transfer,
    in_cell: Lists,
    params: Params<R>,
    dofs: Vec<V4<R>>,
    hexahedra: Hexahedra<R>,
    weight: Vec<R>,
    weight_around: Vec<R>,
    scale: Vec<R>,
    rotation: Vec<V4<R>>,
}

impl<R: Real> Multigrid<R> {
    fn new(host: &Auxiliary) -> Self {
        let mut out = Self {
            params: host.model.params(),
            dofs: host.model.dofs.iter().map(|f| f.map(R::of)).collect(),
            hexahedra: Hexahedra::new(&host.model),
            weight: vec![],
            weight_around: vec![],
            scale: host.scale.iter().map(|s| R::of(*s)).collect(),
            rotation: vec![[R::zero(); 4]; host.scale.len()],
            transfer: host.transfer.clone(),
            in_cell: host.in_cell.clone(),
        };
        out.round();
        out
    }

    fn round(&mut self) {
        let rounded = |lists: &Lists| lists.weight.iter().map(|w| R::of(*w)).collect();
        (self.weight, self.weight_around) = (rounded(&self.transfer.weights), rounded(&self.transfer.around));
    }

    fn refresh(&mut self, node_rotation: &[V4<R>]) {
        let Lists { first, members, .. } = &self.in_cell;
        auxiliary_rotations::auxiliary_rotations(first, members, &self.scale, node_rotation, &mut self.rotation);
        self.hexahedra.turn(&self.params, &self.rotation);
        self.hexahedra.refresh(&self.params, &self.dofs);
    }

    /// Size in this precision, and of the levels, bytes.
    fn bytes(&self) -> usize {
        let weights = size_of_val(&self.weight[..]) + size_of_val(&self.weight_around[..]);
        let of_grid = size_of_val(&self.dofs[..]) + size_of_val(&self.scale[..]) + size_of_val(&self.rotation[..]);
        weights + of_grid + self.hexahedra.stored_bytes()
    }

    /// `z = P B_a Pᵀ r + M⁻¹ r`, with the inverse node blocks of the body.
    fn preconditioner<'a>(
        &'a self,
        body: &'a Params<R>,
        block: &'a [V4<R>],
        dofs: &'a [V4<R>],
    ) -> Preconditioner<'a, R> {
        let cycle = self.hexahedra.preconditioner(&self.params, &self.dofs);
        let added = Params { fresh: 0, keep: R::zero(), gain: R::of(GAIN), ..*body };
        let zeros = |count: usize| vec![[R::zero(); 4]; count];
        let Transfer { weights, around } = &self.transfer;
        Box::new(move |work, r, z| {
            let (mut own_r, mut own_z) = (zeros(self.dofs.len()), zeros(self.dofs.len()));
            let (first, members, weight) = (&around.first, &around.members, &self.weight_around);
            auxiliary_restriction::auxiliary_restriction(first, members, weight, &self.dofs, r, &mut own_r);
            cycle(work, &own_r, &mut own_z);
            let (mut w, mut d) = (zeros(z.len()), zeros(z.len()));
            let (first, members, weight) = (&weights.first, &weights.members, &self.weight);
            auxiliary_correction::auxiliary_correction(first, members, weight, dofs, &own_z, z, &mut w);
            relax(&added, block, r, &mut w, &mut d, z)
        })
    }
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
            multigrid: tetrahedra.auxiliary.as_deref().map(Multigrid::new),
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

    fn forces_of_law(&self, params: &Params<R>, at: &[V4<R>], f: &mut [V4<R>]) -> bool {
        if !self.arrays.is_hyperelastic() {
            return false;
        }
        let (mut rotations, mut scratch) = (self.rotations.clone(), self.arrays.scratch());
        let purpose = For::Steps(params.stiffness_factor);
        let forces = self.arrays.forces_of_law(at, purpose, &mut rotations, &mut scratch);
        tetrahedra_forces::tetrahedra_forces(&self.arrays.first_of_node, &self.arrays.of_node, forces, f);
        true
    }

    fn blocks(&self, params: &Params<R>, dofs: &[V4<R>], out: &mut [V4<R>]) {
        tetrahedra_blocks::tetrahedra_blocks(params, &self.arrays.rest_block, &self.node_rotations, dofs, out);
    }

    fn refresh(&mut self, params: &Params<R>, dofs: &[V4<R>]) {
        let mut block = std::mem::take(&mut self.block);
        block.resize(4 * params.node_count as usize, [R::zero(); 4]);
        self.blocks(params, dofs, &mut block);
        factor::factor(params, &mut block);
        self.block = block;
        if let Some(multigrid) = &mut self.multigrid {
            multigrid.refresh(&self.node_rotations);
        }
    }

    fn product(
        &self,
        params: &Params<R>,
        dofs: &[V4<R>],
        z: &[V4<R>],
        w: &mut [V4<R>],
        scratch: &mut [CellForces<R>],
    ) -> R {
        self.arrays.system_product(params, dofs, z, &self.rotations, w, numbers(scratch))
    }

    fn preconditioner<'a>(&'a self, params: &'a Params<R>, dofs: &'a [V4<R>]) -> Preconditioner<'a, R> {
        match &self.multigrid {
            Some(multigrid) => multigrid.preconditioner(params, &self.block, dofs),
            None => Box::new(move |_, r, z| precondition(params, &self.block, r, z)),
        }
    }

    fn stored_bytes(&self) -> usize {
        size_of_val(&self.rotations.element[..])
            + size_of_val(&self.rotations.domain[..])
            + size_of_val(&self.rotations.cofactor[..])
            + size_of_val(&self.rotations.frame[..])
            + size_of_val(&self.block[..])
            + self.multigrid.as_ref().map_or(0, Multigrid::bytes)
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
        if let (Some(multigrid), false) = (&mut self.multigrid, removal.copies.is_empty()) {
            multigrid.transfer.copy(&removal.copies);
            multigrid.round();
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
