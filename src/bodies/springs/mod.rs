//! Spring networks: one spring per unique pair of corners of each cell (12 edges, 12 face and 4 space diagonals), as in SOFA's
//! MeshSpringForceField for hexahedra. The rest length is the initial length.

pub mod cpu;
mod cut;
mod gpu;

use super::gpu::{Maker, Recorded};
use super::grid::element;
use super::{Elements, Kind, Mechanics, Model, Moved, Refused, Removal, Segments, Snapshot, Solved, Wound};
use crate::error::Result;
use crate::gpu::Buffer;
use crate::kernels::cut::Hit;
use crate::kernels::{GROUP, Params, springs, springs_product};
use crate::math::{M3, V3, V4};
use crate::mesh::Grid;
use crate::scene::{Layer, Preconditioner, Scene};
use std::collections::BTreeSet;

/// Spring arrays.
#[derive(Clone, Debug, Default)]
pub struct Springs {
    /// `[spring]` node ids, first < second.
    pub ends: Vec<[u32; 2]>,
    /// `[spring]` elongation in the grid's rest shape (length minus rest length), m, stiffness N/m, damping N·s/m, 0.
    pub law: Vec<[f64; 4]>,
    /// `[node + 1]` CSR offsets into `half`.
    pub first: Vec<u32>,
    /// Half springs around each node: other node, spring.
    pub half: Vec<[u32; 2]>,
}

/// Refuses a scene of springs with a solver for hexahedra.
///
/// # Errors
/// [`Refused::SpringSolver`].
pub(super) fn check(scene: &Scene) -> Result<()> {
    let for_hexahedra = match scene.solver.preconditioner {
        Preconditioner::Multigrid => Some("multigrid"),
        Preconditioner::Direct => Some("the direct solver"),
        _ => None,
    };
    match for_hexahedra {
        Some(solver) => Err(Refused::SpringSolver { solver }.into()),
        None => Ok(()),
    }
}

impl Springs {
    /// Number of springs that [`Springs::between_corners`] makes: edges, face diagonals and space diagonals.
    pub fn count_between_corners(grid: &Grid) -> usize {
        let ([x, y, z], [nodes_x, nodes_y, nodes_z]) = (grid.cells, grid.nodes);
        let edges = x * nodes_y * nodes_z + nodes_x * y * nodes_z + nodes_x * nodes_y * z;
        let faces = x * y * nodes_z + x * nodes_y * z + nodes_x * y * z;
        edges + 2 * faces + 4 * x * y * z
    }

    /// Springs between all corner pairs of each cell.
    pub fn between_corners(grid: &Grid, stiffness: f64, damping: f64) -> Self {
        let params = grid.params::<f64>();
        let mut pairs = BTreeSet::new();
        for cell in 0..grid.cell_count() {
            let corners = params.corners(cell);
            for (a, first) in corners.iter().enumerate() {
                for second in &corners[a + 1..] {
                    pairs.insert([*first.min(second) as u32, *first.max(second) as u32]);
                }
            }
        }
        let ends: Vec<[u32; 2]> = pairs.into_iter().collect();
        let law = vec![[0.0, stiffness, damping, 0.0]; ends.len()];
        let mut around = vec![vec![]; grid.node_count()];
        for (s, [a, b]) in ends.iter().enumerate() {
            around[*a as usize].push([*b, s as u32]);
            around[*b as usize].push([*a, s as u32]);
        }
        let mut first = vec![0];
        let mut half = vec![];
        for list in around {
            half.extend(list);
            first.push(half.len() as u32);
        }
        Self { ends, law, first, half }
    }
}

impl Model {
    /// Springs of the body; `None` for hexahedra.
    pub fn springs(&self) -> Option<&Springs> {
        match &self.kind {
            Kind::Springs(springs) => Some(springs),
            Kind::Hexahedra(_) | Kind::Tetrahedra(_) => None,
        }
    }

    /// The same, mutable.
    pub fn springs_mut(&mut self) -> Option<&mut Springs> {
        match &mut self.kind {
            Kind::Springs(springs) => Some(springs),
            Kind::Hexahedra(_) | Kind::Tetrahedra(_) => None,
        }
    }
}

impl Mechanics for Springs {
    fn elements(&self, model: &Model) -> Elements {
        Elements { spring_count: self.segment_count(model), ..Elements::default() }
    }

    fn around_nodes(&self, _: &Model) -> Vec<u32> {
        self.first.windows(2).map(|w| w[1] - w[0]).collect()
    }

    fn rotation_count(&self, _: &Model) -> usize {
        0
    }

    fn segments(&self, model: &Model) -> Segments {
        Segments { ends: self.ends.clone(), rest: model.rest.clone() }
    }

    fn segment_count(&self, model: &Model) -> usize {
        model.counts.map_or(self.ends.len(), |counts| counts.springs)
    }

    fn point_count(&self, model: &Model) -> usize {
        model.own_nodes()
    }

    fn extra_columns(&self) -> usize {
        0
    }

    fn corotational(&self) -> u32 {
        0
    }

    fn product_groups(&self, model: &Model) -> usize {
        model.own_nodes().div_ceil(GROUP as usize)
    }

    fn exact(&self) -> Kind {
        Kind::Springs(Box::new(self.clone()))
    }

    fn host_bytes(&self, model: &Model) -> usize {
        let count = self.segment_count(model);
        count * (size_of::<[u32; 2]>() + size_of::<[f64; 4]>() + 2 * size_of::<[u32; 2]>())
            + (model.own_nodes() + 1) * size_of::<u32>()
    }

    /// `½ Σ k ε²`, ε the elongation.
    fn energy(&self, model: &Model, u: &[V4<f64>], _: &[V4<f64>], _: &[u32], law: &[V4<f64>]) -> f64 {
        let stretch = |[a, b]: [u32; 2]| {
            let rest = |n: u32| V3::of(model.rest[n as usize]);
            let span = rest(b) - rest(a);
            let shift = V3::from4(u[b as usize]) - V3::from4(u[a as usize]);
            springs::elongation(span, shift, (span + shift).length())
        };
        self.ends.iter().zip(law).map(|(ends, law)| 0.5 * law[1] * (law[0] + stretch(*ends)).powi(2)).sum::<f64>()
    }

    fn linearised(&self, _: &Model) -> bool {
        false
    }

    fn forces_and_product(
        &self,
        model: &Model,
        solved: &Solved,
        at: &[V4<f64>],
        in_system: &[V4<f64>],
    ) -> [Vec<V4<f64>>; 2] {
        let params = model.params::<f64>();
        let zeros = vec![[0.0; 4]; at.len()];
        let (mut f, mut w) = (zeros.clone(), zeros);
        let rest: Vec<V4<f64>> = model.rest.iter().map(|r| V3::of(*r).pad(0.0)).collect();
        let mut tangent = vec![[0.0; 4]; self.half.len() * 2];
        springs::springs(&params, &rest, at, &self.first, &self.half, &solved.start.law, &mut f, &mut tangent);
        springs_product::springs_product(&params, &self.first, &self.half, &tangent, in_system, &solved.dx, &mut w);
        [f, w]
    }

    fn rotations(&self, _: &Model, state: &Snapshot) -> Vec<V4<f64>> {
        state.rotation.clone()
    }

    fn stays(&self, _: &Model, _: &[V4<f64>], law: &[V4<f64>], node: usize) -> bool {
        let own = self.first[node] as usize..self.first[node + 1] as usize;
        self.half[own].iter().any(|[_, spring]| law[*spring as usize] != [0.0; 4])
    }

    /// The forces of [`springs::springs`]; its dampers `c`, and Rayleigh's damping with `r_K` times its tangent, act on the velocity with
    /// which the ends part.
    fn damps(&self) -> bool {
        self.law.iter().any(|law| law[2] > 0.0)
    }

    fn forces_at(&self, model: &Model, wound: &Wound, nodes: &[u32], moved: &Moved) -> Vec<[f64; 3]> {
        let rate = model.step.rayleigh_stiffness;
        let of_node = |node: &u32| {
            let i = *node as usize;
            let [u, v] = moved(i);
            let mut sum = V3::zero();
            for [j, s] in &self.half[self.first[i] as usize..self.first[i + 1] as usize] {
                if wound.spring_gone[*s as usize] {
                    continue;
                }
                let (j, [e, k, c, _]) = (*j as usize, self.law[*s as usize]);
                let [other, other_v] = moved(j);
                let (span, shift) = (V3::of(model.rest[j]) - V3::of(model.rest[i]), other - u);
                let length = (span + shift).length();
                if length > 0.0 {
                    let axis = (span + shift) * (1.0 / length);
                    let (long, parting) = (e + springs::elongation(span, shift, length), other_v - v);
                    // T = a n nᵀ + b I of the kernel, without the step's factor
                    let across = k * (long / length).max(0.0);
                    let along = (c + rate * (k - across)) * axis.dot(parting);
                    sum = sum - axis * (k * long + along) - parting * (rate * across);
                }
            }
            sum.f64()
        };
        nodes.iter().map(of_node).collect()
    }

    fn strain_and_stress(&self, model: &Model, cell: usize, u: &[V3<f64>; 8], at: [f64; 3]) -> [M3<f64>; 2] {
        let edges = model.grid.cell_edges(model.grid.layer(cell) as u32);
        [element::green_lagrange(element::displacement_gradient(edges, u, at)), M3::zero()]
    }

    fn alive_share(&self, model: &Model, wound: &Wound, cell: usize) -> f64 {
        let corners = model.grid.params::<f64>().corners(cell).map(|node| node as u32);
        let inside = |half: &&[u32; 2]| corners.contains(&half[0]);
        let own = corners.iter().flat_map(|node| {
            let [first, last] = [self.first[*node as usize], self.first[*node as usize + 1]];
            self.half[first as usize..last as usize].iter().filter(inside)
        });
        // each spring from both of its ends
        let (mut all, mut alive) = (0, 0);
        for [_, spring] in own {
            all += 1;
            alive += usize::from(!wound.spring_gone[*spring as usize]);
        }
        alive as f64 / all as f64
    }

    fn cut(&self, model: &Model, wound: &mut Wound, hits: &[Hit<f64>]) -> Removal {
        wound.cut_springs(model, self, hits)
    }

    fn pieces(&self, _: &Wound) -> Option<usize> {
        None
    }

    fn mass_left(&self, _: &Model, wound: &Wound) -> f64 {
        wound.mass_of_nodes()
    }

    fn splitting(&self, _: &Layer) -> f64 {
        f64::INFINITY
    }

    fn recorded(&self, model: &Model, made: &mut Maker, _: &Buffer, _: &Params<f32>) -> Result<Box<dyn Recorded>> {
        Ok(Box::new(gpu::Springs::new(self, model, made)?))
    }
}
