//! Hexahedra on the CPU path: arrays in one precision, and the kernels' twins that use them.
//!
//! A hyperelastic body stores the tangents of its cells and updates them when a solve asks for it.

use super::direct::Direct;
use super::multigrid::{Finest, Hierarchy, apply, workspaces};
use super::{Hyperelastic, element, tangent};
use crate::bodies::cpu::{Cycle, Preconditioner, Start, System, Trial, Workspace};
use crate::bodies::{Model, Refused, Removal};
use crate::error::Result;
use crate::kernels::blocks::blocks;
use crate::kernels::centres::centres;
use crate::kernels::collect_product::collect_product;
use crate::kernels::factor::factor;
use crate::kernels::precondition::precondition;
use crate::kernels::product::{CellForces, Frames, LANES, Modes, cell_groups, elastic_forces, product};
use crate::kernels::split_product::split_product;
use crate::kernels::{PARALLEL, Params, forces, momentum, rotations};
use crate::math::{M3, Real, V4, round, widen};
use crate::mesh::Parts;
use rayon::prelude::*;

/// Arrays over cells and layers in one precision.
pub struct Hexahedra<R> {
    shape: Vec<V4<R>>,
    stiffness: Vec<M3<R>>,
    pre_strain: Vec<V4<R>>,
    elastic: Vec<Modes<R>>,
    system: Vec<M3<R>>,
    modes: Vec<Modes<R>>,
    layer_of: Vec<u32>,
    cell_count: usize,
    /// `[cell]` quaternion; `[cell × 3]` stiffness of the volume of a hyperelastic body ([`crate::kernels::product`])
    rotation: Vec<V4<R>>,
    /// The same for the products of a step.
    frames: Frames<R>,
    split: Vec<u32>,
    split_cells: Vec<u32>,
    /// `[node × 4]` factored columns or blocks of the preconditioners without levels.
    block: Vec<V4<R>>,
    multigrid: Option<Hierarchy<Cycle>>,
    direct: Option<Direct>,
    /// A hyperelastic body that is solved by one linear system per step.
    law: Option<(Hyperelastic, Params<f64>)>,
    /// One that is solved by Newton's method.
    tangents: Option<Tangents<R>>,
}

/// Tangents of a hyperelastic body.
struct Tangents<R> {
    law: Hyperelastic,
    params: Params<f64>,
    /// Parameters for sums of cell forces; the stiffness factor is `elastic_at`.
    sums: Params<R>,
    /// `[cell]` tangents by rows, N/m
    tangent: Vec<[[R; 24]; 24]>,
    /// `τ` ([`crate::bodies::Step::elastic_at`]).
    elastic_at: f64,
    /// `r_K/h`
    damping: f64,
    /// Multiple of the small-strain matrix added to indefinite tangents.
    shift: f64,
}

impl<R: Real> Tangents<R> {
    fn new(law: &Hyperelastic, model: &Model) -> Self {
        let (params, elastic_at) = (model.params::<f64>(), model.step.elastic_at());
        let tangent = vec![[[R::zero(); 24]; 24]; params.cell_count as usize];
        let damping = params.stiffness_factor - elastic_at;
        let sums = Params { stiffness_factor: R::of(elastic_at), ..model.params() };
        Self { law: law.clone(), params, sums, tangent, elastic_at, damping, shift: 0.0 }
    }

    /// Internal forces at `u`, `[node]` N.
    fn forces(&self, u: &[V4<f64>]) -> Vec<V4<f64>> {
        self.law.forces(&self.params, &[], &|_| true, u)
    }

    /// Evaluates the tangents at `u`; inverted cells keep theirs.
    fn linearise(&mut self, u: &[V4<f64>]) {
        let Self { law, params, tangent: all, .. } = self;
        all.par_iter_mut().enumerate().with_min_len(PARALLEL / 32).for_each(|(cell, k)| {
            let state = law.cells(params, &[], u).state(cell);
            if !state.inverted() {
                *k = tangent(&state).map(|row| row.map(R::of));
            }
        });
    }

    /// `w += P τ K_T z`, P the DOF mask, τ `elastic_at`; returns the increment of `z·w`.
    fn add_product(&self, dofs: &[V4<R>], z: &[V4<R>], w: &mut [V4<R>]) -> R {
        let params = &self.params;
        let one = |(cell, k): (usize, &[[R; 24]; 24])| {
            let corners = params.corners(cell);
            let mut at = [R::zero(); 24];
            (0..24).for_each(|n| at[n] = z[corners[n / 3]][n % 3]);
            let row = |k: &[R; 24]| {
                let mut sum = R::zero();
                (0..24).for_each(|n| sum += k[n] * at[n]);
                sum
            };
            let out: [R; 24] = std::array::from_fn(|n| row(&k[n]));
            out
        };
        let cells: Vec<[R; 24]> = self.tangent.par_iter().enumerate().with_min_len(PARALLEL / 32).map(one).collect();
        collect_product(&self.sums, cells.as_flattened(), dofs, z, w)
    }
}

impl<R: Real> Hexahedra<R> {
    /// Arrays of an uncut model, without rotations.
    pub fn new(model: &Model) -> Self {
        let hexahedra = model.hexahedra();
        Self {
            shape: model.shapes(),
            stiffness: model.stiffness_blocks(),
            pre_strain: model.pre_strains(),
            elastic: element::rounded_modes(&hexahedra.stiffness),
            system: model.system_blocks(),
            modes: model.modes(),
            layer_of: model.grid.layer_of.clone(),
            cell_count: model.grid.cell_count(),
            rotation: model.first_rotations(),
            frames: Frames::default(),
            split: Parts::new(model.params()).table().to_vec(),
            split_cells: vec![],
            block: vec![],
            multigrid: Hierarchy::new(model),
            direct: Direct::new(model),
            law: hexahedra.hyperelastic.clone().filter(|law| !law.newton).map(|law| (law, model.params())),
            tangents: hexahedra.hyperelastic.as_ref().filter(|law| law.newton).map(|law| Tangents::new(law, model)),
        }
    }

    /// Has the cells rotated and scaled by these quaternions, `[cell]`.
    pub fn turn(&mut self, params: &Params<R>, rotation: &[V4<R>]) {
        self.rotation[..rotation.len()].copy_from_slice(rotation);
        self.frames.update(params, &self.rotation, &self.split);
    }

    /// Arrays of the finest level.
    fn finest<'a>(&'a self, params: &'a Params<R>, dofs: &'a [V4<R>]) -> Finest<'a, R> {
        let split = (&self.split[..], &self.split_cells[..]);
        Finest { params, dofs, layer_of: &self.layer_of, rotation: &self.rotation, frames: &self.frames, split }
    }

    /// `w = A z` with the rotated small-strain matrices; returns `z·w`.
    fn linear_product(
        &self,
        params: &Params<R>,
        dofs: &[V4<R>],
        z: &[V4<R>],
        w: &mut [V4<R>],
        scratch: &mut [CellForces<R>],
    ) -> R {
        let Self { modes, layer_of, rotation, frames, split, split_cells, .. } = self;
        let dot = product(params, modes, layer_of, frames, dofs, z, w, scratch);
        match split_cells[..] {
            [] => dot,
            _ => dot + split_product(params, modes, layer_of, rotation, dofs, split, split_cells, z, w),
        }
    }
}

impl<R: Real> System<R> for Hexahedra<R> {
    fn forces(
        &mut self,
        params: &Params<R>,
        u: &[V4<R>],
        at: &[V4<R>],
        f: &mut [V4<R>],
        scratch: &mut [CellForces<R>],
    ) -> Result<()> {
        let Self { shape, pre_strain, stiffness, elastic, layer_of, rotation, frames, split, law, tangents, .. } = self;
        // rotations at the start of the step
        if params.corotational != 0 {
            let chunks = rotation[..params.cell_count as usize].par_chunks_mut(PARALLEL / 32).enumerate();
            chunks.for_each(|(chunk, own)| {
                rotations::rotate_cells(params, shape, layer_of, split, u, chunk * (PARALLEL / 32), own);
            });
        }
        // hyperelastic forces
        if let Some(tangents) = tangents {
            let displacement = widen(at);
            if let Some(cell) = tangents.law.first_inverted(&tangents.params, &displacement) {
                return Err(Refused::InvertedCell { cell: tangents.params.cell_at(cell) }.into());
            }
            let forces = tangents.law.linearise(&tangents.params, &[], &displacement, rotation);
            f.iter_mut().zip(forces).for_each(|(f, force)| *f = round(&force));
            frames.update(params, rotation, split);
            return Ok(());
        }
        if let Some((law, own)) = law {
            let wide = Params { node_count: params.node_count, ..*own };
            let forces = law.linearise(&wide, split, &widen(at), rotation);
            f.iter_mut().zip(forces).for_each(|(f, force)| *f = round(&force));
            frames.update(params, rotation, split);
            return Ok(());
        }
        // corotational forces; nodes of split cells are summed again
        frames.update(params, rotation, split);
        elastic_forces(params, shape, pre_strain, elastic, layer_of, frames, at, f, scratch);
        for node in params.touched(split).iter().map(|n| *n as usize) {
            let force = forces::node_force(params, shape, pre_strain, stiffness, layer_of, split, at, rotation, node);
            f[node] = force.pad(R::zero());
        }
        Ok(())
    }

    fn forces_of_law(&self, params: &Params<R>, at: &[V4<R>], f: &mut [V4<R>]) -> bool {
        let Some((law, own)) = &self.law else { return false };
        let wide = Params { node_count: params.node_count, ..*own };
        let alive = |cell: usize| self.rotation[cell] != [R::zero(); 4];
        let forces = law.forces(&wide, &self.split, &alive, &widen(at));
        f.iter_mut().zip(forces).for_each(|(f, force)| *f = round(&force));
        true
    }

    fn mean_velocities(&self, params: &Params<R>, dofs: &[V4<R>], v: &[V4<R>], mean_v: &mut [V4<R>]) {
        let Self { shape, layer_of, split, rotation, .. } = self;
        mean_v.par_iter_mut().enumerate().for_each(|(i, mean)| {
            *mean = momentum::mean_velocity(params, shape, layer_of, split, rotation, dofs, v, i).pad(R::zero());
        });
    }

    fn blocks(&self, params: &Params<R>, dofs: &[V4<R>], out: &mut [V4<R>]) {
        blocks(params, &self.system, &self.layer_of, &self.rotation, dofs, &self.split, out);
    }

    fn refresh(&mut self, params: &Params<R>, dofs: &[V4<R>]) {
        if let Some(direct) = &mut self.direct {
            direct.current = false;
        } else if let Some(mut multigrid) = self.multigrid.take() {
            multigrid.refresh(self.finest(params, dofs));
            self.multigrid = Some(multigrid);
        } else {
            let mut block = std::mem::take(&mut self.block);
            block.resize(4 * params.node_count as usize, [R::zero(); 4]);
            self.blocks(params, dofs, &mut block);
            factor(params, &mut block);
            self.block = block;
        }
    }

    fn factor(&mut self, dofs: &[V4<R>]) -> Result<()> {
        match &mut self.direct {
            Some(direct) if !direct.current => direct.factor(&widen(&self.rotation), &widen(dofs)),
            _ => Ok(()),
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
        let Some(tangents) = &self.tangents else {
            return self.linear_product(params, dofs, z, w, scratch);
        };
        let params = Params { stiffness_factor: R::of(tangents.damping + tangents.shift), ..*params };
        let dot = self.linear_product(&params, dofs, z, w, scratch);
        dot + tangents.add_product(dofs, z, w)
    }

    fn preconditioner<'a>(&'a self, params: &'a Params<R>, dofs: &'a [V4<R>]) -> Preconditioner<'a, R> {
        match (&self.direct, &self.multigrid) {
            (Some(direct), _) => Box::new(|_, r, z| direct.solve(r, z)),
            (None, Some(multigrid)) => {
                let levels = multigrid.operators(self.finest(params, dofs));
                Box::new(move |work, r, z| {
                    if work.is_empty() {
                        *work = workspaces::<R, Cycle>(&levels);
                    }
                    apply(&levels, work, r, z)
                })
            }
            (None, None) => Box::new(move |_, r, z| precondition(params, &self.block, r, z)),
        }
    }

    fn workspace(&self, params: &Params<R>) -> Workspace<R> {
        Workspace { scratch: vec![[[[R::zero(); LANES]; 3]; 8]; cell_groups(params)], levels: vec![] }
    }

    fn points(&self, params: &Params<R>, u: &[V4<R>], points: &mut [V4<R>]) {
        centres(params, &self.split, u, points);
    }

    /// Applies removed cells, and words of the table in ascending order.
    fn take(&mut self, params: &Params<R>, removal: &Removal) {
        for cell in &removal.cells {
            self.rotation[*cell as usize] = [R::zero(); 4];
        }
        if let Some((law, _)) = &mut self.law {
            removal.scale.iter().for_each(|(cell, factor)| law.set_scale(*cell, *factor));
        }
        if let Some(multigrid) = &mut self.multigrid {
            multigrid.cut |= !removal.words.is_empty();
        }
        for (word, value) in &removal.words {
            self.split[*word as usize] = *value;
        }
        // words ascend, so the rows of cells ascend, and for new rows their numbers too
        let row = params.layout().row;
        let of_cells = row..row + params.cell_count as usize;
        for (word, value) in removal.words.iter().filter(|(word, _)| of_cells.contains(&(*word as usize))) {
            let at = *value as usize - 1;
            self.split_cells.resize(self.split_cells.len().max(at + 1), 0);
            self.split_cells[at] = word - row as u32;
        }
    }

    fn nodes_in_use(&self, params: &Params<R>) -> usize {
        params.nodes_in_use(&self.split)
    }

    fn rotations(&self) -> Vec<V4<f64>> {
        widen(&self.rotation[..self.cell_count])
    }

    fn set_rotations(&mut self, rotation: &[V4<f64>]) {
        self.rotation.iter_mut().zip(rotation).for_each(|(to, from)| *to = round(from));
    }

    fn law(&self) -> Vec<V4<f64>> {
        vec![]
    }

    fn split(&self) -> &[u32] {
        &self.split
    }

    fn stored_bytes(&self) -> usize {
        let tangents = self.tangents.as_ref().map_or(0, |tangents| size_of_val(&tangents.tangent[..]));
        let levels = self.multigrid.as_ref().map_or(0, Hierarchy::bytes);
        tangents + levels + size_of_val(&self.block[..])
    }

    fn newton(&self) -> bool {
        self.tangents.is_some()
    }

    fn first_inverted(&self, at: &[V4<f64>]) -> Option<Refused> {
        let Tangents { law, params, .. } = self.tangents.as_ref()?;
        law.first_inverted(params, at).map(|cell| Refused::InvertedCell { cell: params.cell_at(cell) })
    }

    fn energy(&self, at: &[V4<f64>]) -> f64 {
        let Some(Tangents { law, params, .. }) = &self.tangents else { return 0.0 };
        let (energy, inverted) = law.energy(params, &[], &|_| true, at);
        if inverted { f64::INFINITY } else { energy }
    }

    fn set_elastic_at(&mut self, elastic_at: f64) {
        if let Some(tangents) = &mut self.tangents {
            tangents.elastic_at = elastic_at;
            tangents.sums.stiffness_factor = R::of(elastic_at);
        }
    }

    fn linearise(&mut self, at: &[V4<f64>]) {
        if let Some(tangents) = &mut self.tangents {
            tangents.linearise(at);
        }
    }

    fn set_shift(&mut self, shift: f64) {
        if let Some(tangents) = &mut self.tangents {
            tangents.shift = shift;
        }
    }

    fn trial(&self, step: &Start<R>, dx: &[V4<R>], scratch: &mut [CellForces<R>]) -> Result<Option<Trial<R>>> {
        let Some(tangents) = &self.tangents else { return Ok(None) };
        // elastic energy and forces at the trial point
        let at = tangents.elastic_at;
        let sum = |(u, d): (&V4<R>, &V4<R>)| std::array::from_fn(|n| u[n].f64() + at * d[n].f64());
        let displacement: Vec<V4<f64>> = step.u.iter().zip(dx).map(sum).collect();
        let (energy, inverted) = tangents.law.energy(&tangents.params, &[], &|_| true, &displacement);
        if inverted {
            return Ok(None);
        }
        let forces = tangents.forces(&displacement);
        // inertia and damping: product with the small-strain matrix
        let params = Params { stiffness_factor: R::of(tangents.damping), ..*step.params };
        let mut residual = vec![[R::zero(); 4]; dx.len()];
        let linear = self.linear_product(&params, step.dofs, dx, &mut residual, scratch);
        // potential and its negative gradient on free axes
        let (mut potential, mut work) = (0.5 * linear.f64() + energy / at, 0.0);
        for i in 0..dx.len() {
            for n in 0..3 {
                let (b, f) = (step.b[i][n].f64(), step.f[i][n].f64());
                let axis = step.dofs[i][n].f64();
                let left = (b - residual[i][n].f64() - (forces[i][n] - f)) * axis;
                potential -= dx[i][n].f64() * (b + f);
                work += dx[i][n].f64() * (forces[i][n] + left);
                residual[i][n] = R::of(left);
            }
        }
        Ok(Some(Trial { potential, residual, work: [work, linear.f64()] }))
    }
}
