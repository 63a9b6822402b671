//! Spring networks: one spring per unique pair of corners of each cell (12 edges, 12 face and 4 space diagonals), or per edge of the
//! tetrahedra of a mesh, as in SOFA's MeshSpringForceField for both. The rest length is the initial length.
//!
//! All springs have one stiffness; those of a mesh may have one each, fitted to the layers' Young's moduli ([`fit`]).

pub mod cpu;
mod cut;
pub mod fit;
mod gpu;

use super::gpu::{Maker, Recorded};
use super::grid::element;
use super::{
    Elements, Holds, Kind, Mechanics, Model, Moved, Refused, Removal, Segments, Snapshot, Solved, Stays, Wound,
    element_points, energy,
};
use crate::error::Result;
use crate::gpu::Buffer;
use crate::kernels::cut::Hit;
use crate::kernels::{GROUP, Params, springs, springs_product};
use crate::math::{M3, V3, V4};
use crate::mesh::{Grid, PAIRS};
use crate::scene::{Layer, Preconditioner, ProbeKind, Scene, TetrahedralMesh};
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
    /// Tetrahedra of a mesh, empty for a grid.
    pub tetrahedra: Edged,
    /// Whether springs may break by themselves.
    pub breaks: bool,
    /// `[spring]` strain beyond which it breaks: the largest of the layers around it. Empty if none breaks.
    pub breaks_at: Vec<f64>,
}

/// Edges of the tetrahedra of a mesh.
#[derive(Clone, Debug, Default)]
pub struct Edged {
    /// `[tetrahedron]` springs, in the order of [`PAIRS`].
    pub springs: Vec<[u32; 6]>,
    /// `[spring + 1]` CSR offsets into `around`.
    pub first: Vec<u32>,
    /// Tetrahedra around each spring.
    pub around: Vec<u32>,
}

impl Edged {
    /// Of a mesh, and the pairs of nodes that are its edges, in ascending order.
    fn new(tetrahedra: &[[u32; 4]]) -> (Self, Vec<[u32; 2]>) {
        let pair = |corners: &[u32; 4], [a, b]: [usize; 2]| [corners[a].min(corners[b]), corners[a].max(corners[b])];
        let mut ends: Vec<[u32; 2]> =
            tetrahedra.iter().flat_map(|corners| PAIRS.map(|edge| pair(corners, edge))).collect();
        ends.sort_unstable();
        ends.dedup();
        let number =
            |ends_of: [u32; 2]| ends.binary_search(&ends_of).unwrap_or_else(|_| unreachable!("it is among them"));
        let springs: Vec<[u32; 6]> =
            tetrahedra.iter().map(|corners| PAIRS.map(|edge| number(pair(corners, edge)) as u32)).collect();
        let mut first = vec![0; ends.len() + 1];
        springs.as_flattened().iter().for_each(|spring| first[*spring as usize + 1] += 1);
        (0..ends.len()).for_each(|spring| first[spring + 1] += first[spring]);
        let (mut next, mut around) = (first.clone(), vec![0; 6 * springs.len()]);
        for (e, own) in springs.iter().enumerate() {
            for spring in own {
                around[next[*spring as usize] as usize] = e as u32;
                next[*spring as usize] += 1;
            }
        }
        (Self { springs, first, around }, ends)
    }

    /// Tetrahedra around a spring.
    pub fn of_spring(&self, spring: usize) -> &[u32] {
        &self.around[self.first[spring] as usize..self.first[spring + 1] as usize]
    }
}

/// True if the springs that are left of a tetrahedron do not join its corners; `left` in the order of [`PAIRS`].
fn comes_apart(left: [bool; 6]) -> bool {
    let mut part = [0, 1, 2, 3];
    for ([a, b], _) in PAIRS.into_iter().zip(left).filter(|(_, left)| *left) {
        let (kept, old) = (part[a], part[b]);
        part.iter_mut().filter(|own| **own == old).for_each(|own| *own = kept);
    }
    part.iter().any(|own| *own != part[0])
}

/// Refuses a scene of springs with a solver for hexahedra, and a mesh of springs with probes of a grid's cells.
///
/// # Errors
/// [`Refused::SpringSolver`], [`Refused::SpringProbe`].
pub(super) fn check(scene: &Scene, body: usize) -> Result<()> {
    let meshed = scene.skins[body].mesh.is_some();
    let for_hexahedra = match scene.solver.preconditioner {
        Preconditioner::Multigrid => Some("multigrid"),
        Preconditioner::Direct => Some("the direct solver"),
        _ => None,
    };
    if let Some(solver) = for_hexahedra {
        return Err(Refused::SpringSolver { solver, fix: if meshed { "block" } else { "column" } }.into());
    }
    let of_cells = |kind: &ProbeKind| matches!(kind, ProbeKind::Strain { body: of, .. } if *of == body);
    match scene.probes.iter().find(|probe| meshed && of_cells(&probe.kind)) {
        Some(probe) => Err(Refused::SpringProbe { name: probe.name.clone() }.into()),
        None => Ok(()),
    }
}

impl Springs {
    /// Number of springs: edges, face diagonals and space diagonals of a grid; edges of a mesh.
    pub fn count(grid: &Grid) -> usize {
        if let Some(of) = &grid.unstructured {
            return Edged::new(of.mesh.tetrahedra()).1.len();
        }
        let ([x, y, z], [nodes_x, nodes_y, nodes_z]) = (grid.cells, grid.nodes);
        let edges = x * nodes_y * nodes_z + nodes_x * y * nodes_z + nodes_x * nodes_y * z;
        let faces = x * y * nodes_z + x * nodes_y * z + nodes_x * y * z;
        edges + 2 * faces + 4 * x * y * z
    }

    /// Springs of a grid or of its mesh.
    /// `stiffness` is that of each spring, N/m; without, those of a mesh are fitted to the layers.
    ///
    /// # Errors
    /// [`Refused::SpringFit`] where they cannot be.
    pub fn of(grid: &Grid, layers: &[Layer], stiffness: Option<f64>, damping: f64) -> Result<Self> {
        let one = stiffness.unwrap_or_default();
        let mut springs = match &grid.unstructured {
            Some(of) => Self::along_edges(&of.mesh, one, damping),
            None => Self::between_corners(grid, one, damping),
        };
        if let (None, Some(of)) = (stiffness, &grid.unstructured) {
            let fitted = of.mesh.fitted_springs(|| fit::stiffnesses(&springs, of, layers))?;
            let of_spring = |spring: usize| fitted.iter().zip(layers).map(|(k, layer)| layer.young * k[spring]).sum();
            springs.law = (0..springs.ends.len()).map(|spring| [0.0, of_spring(spring), damping, 0.0]).collect();
        }
        if layers.iter().any(|layer| layer.break_strain.is_finite()) {
            (springs.breaks, springs.breaks_at) = (true, springs.limits(grid, layers));
        }
        Ok(springs)
    }

    /// Number of tetrahedra or cells.
    fn element_count(&self, grid: &Grid) -> usize {
        if grid.unstructured.is_some() { self.tetrahedra.springs.len() } else { grid.cell_count() }
    }

    /// Springs of a tetrahedron or a cell; each of a cell from both of its ends.
    fn of_element(&self, params: &Params<f64>, element: usize) -> Vec<u32> {
        if let Some(own) = self.tetrahedra.springs.get(element) {
            return own.to_vec();
        }
        let corners = params.corners(element).map(|node| node as u32);
        let around = corners.iter().flat_map(|node| {
            let [first, last] = [self.first[*node as usize], self.first[*node as usize + 1]];
            &self.half[first as usize..last as usize]
        });
        around.filter(|[other, _]| corners.contains(other)).map(|[_, spring]| *spring).collect()
    }

    /// `[spring]` largest limit of the layers around it.
    fn limits(&self, grid: &Grid, layers: &[Layer]) -> Vec<f64> {
        let mut limits = vec![0.0f64; self.ends.len()];
        let params = grid.params::<f64>();
        for e in 0..self.element_count(grid) {
            let own = layers[grid.layer(e)].break_strain;
            for spring in self.of_element(&params, e) {
                limits[spring as usize] = limits[spring as usize].max(own);
            }
        }
        limits
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
        Self::new(grid.node_count(), ends, law)
    }

    /// Springs along the edges of a mesh.
    pub fn along_edges(mesh: &TetrahedralMesh, stiffness: f64, damping: f64) -> Self {
        let (tetrahedra, ends) = Edged::new(mesh.tetrahedra());
        let law = vec![[0.0, stiffness, damping, 0.0]; ends.len()];
        Self { tetrahedra, ..Self::new(mesh.nodes().len(), ends, law) }
    }

    /// With the half springs around each node.
    fn new(node_count: usize, ends: Vec<[u32; 2]>, law: Vec<[f64; 4]>) -> Self {
        let mut around = vec![vec![]; node_count];
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
        Self { ends, law, first, half, tetrahedra: Edged::default(), breaks: false, breaks_at: vec![] }
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
        let own = count * (size_of::<[u32; 2]>() + size_of::<[f64; 4]>() + 2 * size_of::<[u32; 2]>())
            + (model.own_nodes() + 1) * size_of::<u32>();
        let own = own + if self.breaks { count * size_of::<f64>() } else { 0 };
        match model.unstructured() {
            Some(of) => own + of.mesh.tetrahedra().len() * 2 * size_of::<[u32; 6]>() + (count + 1) * size_of::<u32>(),
            None => own,
        }
    }

    /// `½ Σ k ε²`, ε the elongation.
    fn energy(&self, model: &Model, Snapshot { u, law, .. }: &Snapshot, _: &[V4<f64>]) -> f64 {
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

    fn stays<'a>(&'a self, _: &'a Model, _: &'a [V4<f64>], _: &[u32], law: &'a [V4<f64>]) -> Stays<'a> {
        Box::new(|node| {
            let own = self.first[node] as usize..self.first[node + 1] as usize;
            self.half[own].iter().any(|[_, spring]| law[*spring as usize] != [0.0; 4])
        })
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

    fn strains_and_stresses(&self, model: &Model, wound: &Wound, u: &[V4<f64>]) -> Vec<[M3<f64>; 2]> {
        let Some(mesh) = model.unstructured() else { return element_points::in_the_middle(model, wound, u) };
        let of = |(e, here): (usize, &bool)| match here {
            true => [element::green_lagrange(mesh.displacement_gradient(e, u)), M3::zero()],
            false => [M3::zero(); 2],
        };
        wound.surface.present().iter().enumerate().map(of).collect()
    }

    fn count_cells(&self, model: &Model, state: &Snapshot, holds: &Holds) -> u32 {
        let Some(mesh) = model.unstructured() else { return energy::count_cells(model, state, holds) };
        let is_there = |own: &[u32; 6]| !comes_apart(own.map(|spring| state.law[spring as usize] != [0.0; 4]));
        let of = |e: usize| holds(model.layer(e), M3::identity() + mesh.displacement_gradient(e, &state.u));
        let all = self.tetrahedra.springs.iter().enumerate();
        all.filter(|(e, own)| is_there(own) && of(*e)).count() as u32
    }

    fn alive_share(&self, model: &Model, wound: &Wound, cell: usize) -> f64 {
        let own = self.of_element(&model.grid.params(), cell);
        let alive = own.iter().filter(|spring| !wound.spring_gone[**spring as usize]).count();
        alive as f64 / own.len() as f64
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tetrahedron_comes_apart_when_its_springs_do_not_join_its_corners() {
        // in the order of PAIRS: 01, 02, 03, 12, 13, 23
        let without = |cut: &[usize]| comes_apart(std::array::from_fn(|k| !cut.contains(&k)));
        for whole in [&[][..], &[0], &[0, 1], &[0, 5], &[0, 1, 3]] {
            assert!(!without(whole), "{whole:?}");
        }
        // a corner alone, two and two, all
        for apart in [&[0, 1, 2][..], &[0, 3, 4], &[1, 2, 3, 4], &[0, 1, 2, 3], &[0, 1, 2, 3, 4, 5]] {
            assert!(without(apart), "{apart:?}");
        }
    }

    #[test]
    fn two_tetrahedra_on_a_face_have_nine_edges_and_share_three() {
        let (edged, ends) = Edged::new(&[[0, 1, 2, 3], [0, 2, 1, 4]]);
        assert_eq!(ends, [[0, 1], [0, 2], [0, 3], [0, 4], [1, 2], [1, 3], [1, 4], [2, 3], [2, 4]]);
        let shared: Vec<&[u32; 2]> = (0..9).filter(|s| edged.of_spring(*s) == [0, 1]).map(|s| &ends[s]).collect();
        assert_eq!(shared, [&[0, 1], &[0, 2], &[1, 2]]);
        assert_eq!(edged.of_spring(8), [1]);
        assert_eq!(edged.springs[1].map(|s| ends[s as usize]), [[0, 2], [0, 1], [0, 4], [1, 2], [2, 4], [1, 4]]);
    }
}
