//! What the CPU path keeps of an elastic law and of cutting, and where its solves work.

use super::super::{cell_centres, links};
use super::hyperelastic::Neo;
use crate::kernels::Params;
use crate::kernels::centres::centres;
use crate::kernels::precondition::precondition;
use crate::kernels::product::{CellForces, Modes, product};
use crate::kernels::split_product::split_product;
use crate::linear::direct::Direct;
use crate::linear::multigrid::{Hierarchy, Operator, Work, cycle};
use crate::math::{M3, Real, V3, V4, round};
use crate::mesh::Parts;
use crate::model::{Model, element};

/// What a solve works in beside the slot's own vectors.
#[derive(Clone, Default)]
pub(super) struct Space<R> {
    pub scratch: Vec<CellForces<R>>,
    pub levels: Vec<Work<R>>,
}

pub(super) enum Elastic<R> {
    Bricks(Bricks<R>),
    Springs { rest: Vec<V4<R>>, first: Vec<u32>, half: Vec<[u32; 2]>, law: Vec<V4<R>>, tangent: Vec<V4<R>> },
}

pub(super) struct Bricks<R> {
    pub shape: Vec<V4<R>>,
    pub stiffness: Vec<M3<R>>,
    pub pre_strain: Vec<V4<R>>,
    pub elastic: Vec<Modes<R>>,
    pub system: Vec<M3<R>>,
    pub modes: Vec<Modes<R>>,
    pub layer_of: Vec<u32>,
    pub rotation: Vec<V4<R>>,
    pub split: Vec<u32>,
    pub split_cells: Vec<u32>,
    pub multigrid: Option<Hierarchy<R>>,
    pub direct: Option<Box<Direct>>,
    pub neo: Option<Box<Neo<R>>>,
}

pub(super) struct Cutting<R> {
    pub ends: Vec<[u32; 2]>,
    pub rest: Vec<V4<R>>,
    pub point_u: Vec<V4<R>>,
    pub point_before: Vec<V4<R>>,
    /// `point_before` is of the last step.
    pub kept: bool,
}

impl<R: Real> Elastic<R> {
    /// A model's law, nothing of it turned or cut.
    pub fn new(model: &Model) -> Self {
        let pad = |p: &[f64; 3]| V3::of(*p).pad(R::zero());
        let zeros = |n: usize| vec![[R::zero(); 4]; n];
        match &model.springs {
            Some(s) => Elastic::Springs {
                rest: model.rest.iter().map(pad).collect(),
                first: s.first.clone(),
                half: s.half.clone(),
                law: s.law.iter().map(round).collect(),
                tangent: zeros(s.half.len() * 2),
            },
            None => Elastic::Bricks(Bricks {
                shape: model.shapes(),
                stiffness: model.stiffness_blocks(),
                pre_strain: model.pre_strains(),
                elastic: element::rounded_modes(&model.stiffness),
                system: model.system_blocks(),
                modes: model.modes(),
                layer_of: model.grid.layer_of.clone(),
                rotation: vec![[R::zero(), R::zero(), R::zero(), R::one()]; model.grid.cell_count()],
                split: Parts::new(model.params()).table().to_vec(),
                split_cells: vec![],
                multigrid: Hierarchy::new(model),
                direct: Direct::new(model).map(Box::new),
                neo: model.neo_hookean.as_ref().map(|law| Box::new(Neo::new(law, model))),
            }),
        }
    }

    /// Bricks, if it is of those.
    pub fn bricks(&self) -> Option<&Bricks<R>> {
        match self {
            Elastic::Bricks(bricks) => Some(bricks),
            Elastic::Springs { .. } => None,
        }
    }

    /// The same, to be changed.
    pub fn bricks_mut(&mut self) -> Option<&mut Bricks<R>> {
        match self {
            Elastic::Bricks(bricks) => Some(bricks),
            Elastic::Springs { .. } => None,
        }
    }

    /// Displacements of the segments' ends: cell centres of bricks, nodes of springs.
    pub fn points(&self, params: &Params<R>, u: &[V4<R>], points: &mut [V4<R>]) {
        match self {
            Elastic::Bricks(Bricks { split, .. }) => centres(params, split, u, points),
            Elastic::Springs { .. } => points.copy_from_slice(u),
        }
    }
}

/// What stands for `A⁻¹` in the conjugate gradients.
pub(super) enum Inverse<'a, R> {
    Columns { params: &'a Params<R>, block: &'a [V4<R>] },
    Cycle(Vec<Operator<'a, R>>),
    Exact(&'a Direct),
}

impl<R: Real> Bricks<R> {
    /// Takes what a cut has changed: dead cells, and words of the table in rising order.
    pub fn take(&mut self, params: &Params<R>, cells: &[u32], words: &[(u32, u32)]) {
        for cell in cells {
            self.rotation[*cell as usize] = [R::zero(); 4];
        }
        for (word, value) in words {
            self.split[*word as usize] = *value;
        }
        // rising words: the rows of cells rise, and of new ones the numbers too
        let row = params.layout().row;
        let of_cells = row..row + params.cell_count as usize;
        for (word, value) in words.iter().filter(|(word, _)| of_cells.contains(&(*word as usize))) {
            let at = *value as usize - 1;
            self.split_cells.resize(self.split_cells.len().max(at + 1), 0);
            self.split_cells[at] = word - row as u32;
        }
    }

    /// `w = A z`; returns `z·w`.
    pub fn multiply(
        &self,
        params: &Params<R>,
        free: &[V4<R>],
        z: &[V4<R>],
        w: &mut [V4<R>],
        scratch: &mut [CellForces<R>],
    ) -> R {
        let Some(neo) = &self.neo else {
            return self.linear_product(params, free, z, w, scratch);
        };
        let params = Params { stiffness_factor: R::of(neo.damping + neo.shift), ..*params };
        let dot = self.linear_product(&params, free, z, w, scratch);
        dot + neo.add_product(free, z, w)
    }

    /// The same of the small-strain bricks, turned with the cells.
    pub fn linear_product(
        &self,
        params: &Params<R>,
        free: &[V4<R>],
        z: &[V4<R>],
        w: &mut [V4<R>],
        scratch: &mut [CellForces<R>],
    ) -> R {
        let Self { modes, layer_of, rotation, split, split_cells, .. } = self;
        let dot = product(params, modes, layer_of, rotation, free, split, z, w, scratch);
        match split_cells[..] {
            [] => dot,
            _ => dot + split_product(params, modes, layer_of, rotation, free, split, split_cells, z, w),
        }
    }

    pub fn inverse<'a>(&'a self, params: &'a Params<R>, free: &'a [V4<R>], block: &'a [V4<R>]) -> Inverse<'a, R> {
        let (modes, layer_of, rotation) = (&self.modes[..], &self.layer_of[..], &self.rotation[..]);
        match (&self.direct, &self.multigrid) {
            (Some(direct), _) => Inverse::Exact(direct),
            (None, Some(m)) => {
                let steps = &[];
                let split = (&self.split[..], &self.split_cells[..]);
                let finest = Operator { params: *params, free, block, steps, modes, layer_of, rotation, split };
                Inverse::Cycle(m.operators(finest))
            }
            (None, None) => Inverse::Columns { params, block },
        }
    }
}

impl<R: Real> Inverse<'_, R> {
    /// `z = M⁻¹ r`; returns `r·z`.
    pub fn apply(&self, work: &mut Vec<Work<R>>, r: &[V4<R>], z: &mut [V4<R>]) -> R {
        match self {
            Self::Columns { params, block } => precondition(params, block, r, z),
            Self::Cycle(levels) => {
                if work.is_empty() {
                    *work = Work::new(levels);
                }
                cycle(levels, work, r, z)
            }
            Self::Exact(direct) => direct.solve(r, z),
        }
    }
}

impl<R: Real> Cutting<R> {
    pub fn new(model: &Model) -> Self {
        let params = model.grid.params::<f64>();
        let pad = |p: [f64; 3]| V3::<R>::of(p).pad(R::zero());
        let (ends, rest): (_, Vec<_>) = match &model.springs {
            Some(s) => (s.ends.clone(), model.rest.iter().map(|p| pad(*p)).collect()),
            None => (links(&params), cell_centres(model).into_iter().map(pad).collect()),
        };
        let zeros = vec![[R::zero(); 4]; rest.len()];
        Self { ends, rest, point_u: zeros.clone(), point_before: zeros, kept: false }
    }
}
