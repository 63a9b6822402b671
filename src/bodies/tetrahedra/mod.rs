//! Linear tetrahedra: of a mesh file, or six to each cell of a grid, with the same nodes ([`Grid::tetrahedra`]). Smoothed elements, which do
//! not lock, and plain ones, which do ([`crate::kernels::tetrahedra`]), of small strains or a hyperelastic law ([`law`]).
//!
//! Error of the skin block's centre displacement on 20×20×5 cells (tests/verify/tetrahedra.rs), %, at ν 0.45, 0.49, 0.499:
//! smoothed +9, +7, −2; plain −26, −54, −88. Hexahedra of mean dilatation have +2, +2, +1. Error of the force on the probe of
//! scenes/skin_tetra.toml on irregular meshes of 768, 2592 and 6144 tetrahedra (tests/engine/meshes.rs), %: smoothed +24, +9, −2; plain, on the
//! last, +45.
//!
//! A blade severs the links between tetrahedra of a mesh, or removes tetrahedra, and tools carve them ([`crate::mesh::TetrahedralParts`]).
//! A grid that tools may cut or carve becomes such a mesh ([`with_meshes`]).
//!
//! In a grid, contact, loads and probes see the faces of the cells, whose shape functions share the tetrahedra's nodes, and masses are those
//! of the cells. Of a mesh they see the triangles of its outside, and each tetrahedron gives its corners a quarter of its mass.
//!
//! A probe of a strain or stress is of the tetrahedra that contain its point, by volume: of smoothed elements the means over their edges and
//! corners that their forces come from ([`Arrays::strains_and_stresses`]). On the linear skin block at ν 0.49 the root mean square of their
//! errors inside is 19 and 12 % of 20×20×5 and 40×40×8 cells for strains, 22 and 16 % for stresses (against hexahedra of mean dilatation;
//! strains of the tetrahedra's own gradients: 38 and 18 %).
//! A probe of a reaction takes the passes of the whole body on the host, once a step.

pub mod auxiliary;
pub mod cpu;
mod cut;
mod fields;
mod gpu;
pub mod law;
pub mod operator;

use super::gpu::{Maker, Recorded};
use super::{
    ElementPoint, Elements, Equations, Holds, Kind, Mechanics, Model, Moved, Refused, Removal, Segments, Snapshot,
    Solved, Stays, Wound,
};
use crate::bodies::grid::local::beyond;
use crate::bodies::grid::{constants, element};
use crate::error::Result;
use crate::gpu::Buffer;
use crate::kernels::cut::Hit;
use crate::kernels::hyperelastic::STIFFENED;
use crate::kernels::{GROUP, Params};
use crate::math::{M3, V3, V4};
use crate::mesh::{Carved, EDGES, Grid, PER_CELL};
use crate::scene::{
    Cut, Element, Integrator, Law, Layer, Mass, Material, PRECONDITIONER, Preconditioner, Scene, Skin, TetrahedralMesh,
};
use auxiliary::Auxiliary;
use operator::{Arrays, For, is_removed};
use std::borrow::Cow;
use std::sync::Arc;

/// Arrays of a body of tetrahedra.
#[derive(Clone, Debug, Default)]
pub struct Tetrahedra {
    /// The elastic operator; empty in a model of sizes.
    pub arrays: Arrays<f64>,
    /// Rotations of elements and edges; otherwise small strains.
    pub corotational: bool,
    /// Smoothed elements; otherwise plain ones.
    pub smoothed: bool,
    /// Hyperelastic law; none of small strains.
    pub law: Option<Material>,
    /// Nodes reserved for those that a cut duplicates.
    pub reserve: usize,
    /// Whether the scene has tools that may cut or carve the body.
    pub can_change: bool,
    /// The grid whose multigrid preconditions the body, if it does.
    pub auxiliary: Option<Box<Auxiliary>>,
    /// `[layer]` kg/m³
    density: Vec<f64>,
}

/// Refuses a scene of tetrahedra with what is for other elements.
///
/// # Errors
/// [`Refused::Tetrahedra`].
pub(super) fn check(scene: &Scene, body: usize) -> Result<()> {
    let skin = &scene.skins[body];
    let of_key = |key, what, fix| Err(Refused::Tetrahedra { key, what, fix }.into());
    let refuse = |what, fix| of_key("", what, fix);
    match scene.solver.preconditioner {
        Preconditioner::Column | Preconditioner::Direct => {
            return of_key(PRECONDITIONER, "this preconditioner", "take \"block\" or \"multigrid\"");
        }
        _ => {}
    }
    if scene.time.integrator == Integrator::SymplecticEuler {
        return refuse("integrator = \"symplectic_euler\"", "take \"implicit_euler\"");
    }
    if let Law::LargeTetra { material: Material::Holzapfel, .. } = skin.law {
        return refuse("law = \"holzapfel\"", "take \"neo_hookean\"");
    }
    if skin.mass == Mass::Consistent {
        return refuse("mass = \"consistent\"", "take \"lumped\"");
    }
    if skin.layers.iter().any(|layer| layer.pre_strain != [0.0; 2]) {
        return refuse("pre_strain", "leave it out");
    }
    Ok(())
}

/// The scene with a mesh in place of each grid of tetrahedra that its tools may cut or carve: links over shared faces are those of a mesh.
///
/// # Errors
/// [`Refused::Tetrahedra`] where cells are too flat for a mesh.
pub fn with_meshes(scene: &Scene) -> Result<Cow<'_, Scene>> {
    let changes = scene.tools.iter().any(|tool| tool.blade.is_some() || tool.carve.is_some());
    let wanted = |skin: &Skin| changes && skin.law.is_tetrahedral() && skin.mesh.is_none();
    if !scene.skins.iter().any(wanted) {
        return Ok(Cow::Borrowed(scene));
    }
    let mut scene = scene.clone();
    for skin in scene.skins.iter_mut().filter(|skin| wanted(skin)) {
        let grid = Grid::new(skin);
        let nodes = (0..grid.node_count()).map(|node| grid.rest(node)).collect();
        let (corners, layers) = grid.tetrahedra().into_iter().map(|(corners, layer)| (corners, layer as u32)).unzip();
        let flat = |_| Refused::Tetrahedra {
            key: "",
            what: "a blade or carving in cells so flat",
            fix: "change the numbers of cells",
        };
        let mesh = TetrahedralMesh::new(nodes, corners, layers).map_err(flat)?;
        skin.size = [mesh.size()[0], mesh.size()[1]];
        skin.cells = [0; 2];
        skin.layers.iter_mut().for_each(|layer| (layer.thickness, layer.cells) = (0.0, 0));
        skin.mesh = Some(Arc::new(mesh));
    }
    Ok(Cow::Owned(scene))
}

/// Number of nodes reserved for those that a blade duplicates.
pub(super) fn reserve(scene: &Scene, skin: &Skin) -> usize {
    let blade = scene.tools.iter().any(|tool| tool.blade.is_some());
    match skin.cut {
        Cut::Split { reserve_columns } if blade && skin.law.is_tetrahedral() => reserve_columns as usize,
        _ => 0,
    }
}

impl Tetrahedra {
    /// Without the arrays of the grid's size.
    pub(super) fn new(scene: &Scene, body: usize) -> Self {
        let skin = &scene.skins[body];
        let (smoothed, corotational, law) = match skin.law {
            Law::Fem { element, corotational } => (element == Element::Tetra, corotational, None),
            Law::LargeTetra { material, element } => (element == Element::Tetra, true, Some(material)),
            _ => (true, true, None),
        };
        let (reserve, can_change) = (reserve(scene, skin), skin.mesh.is_some() && !scene.tools.is_empty());
        let density = skin.layers.iter().map(|layer| layer.density).collect();
        Self { arrays: Arrays::default(), corotational, smoothed, law, reserve, can_change, auxiliary: None, density }
    }

    /// Fills the arrays: `rest` has the nodes of the grid or of its mesh, m.
    pub(super) fn fill(&mut self, grid: &Grid, rest: &[[f64; 3]], layers: &[Layer]) {
        let moduli: Vec<[f64; 2]> = layers
            .iter()
            .map(|layer| {
                let (lambda, mu) = element::lame(layer.young, layer.poisson);
                [lambda + 2.0 / 3.0 * mu, mu]
            })
            .collect();
        self.arrays = match self.law {
            None => Arrays::new(rest, &grid.tetrahedra(), &moduli, self.smoothed),
            Some(material) => {
                let laws: Vec<V4<f64>> = layers.iter().map(|layer| constants(material, layer)).collect();
                Arrays::hyperelastic(rest, &grid.tetrahedra(), &laws, self.smoothed)
            }
        };
        self.arrays.reserve(self.reserve, EDGES * self.reserve);
    }

    /// Number of domains of the deviator: edges, once per material, with the room for those that cuts divide; of plain elements none, or the
    /// tetrahedra where their law is hyperelastic.
    pub(super) fn domain_count(&self, grid: &Grid) -> usize {
        match self.smoothed {
            false if self.law.is_some() => grid.tetrahedron_count(),
            false => 0,
            // a model of sizes has no arrays
            true if self.arrays.shear.is_empty() => grid.tetrahedron_edges() + EDGES * self.reserve,
            true => self.arrays.shear.len(),
        }
    }
}

impl Tetrahedra {
    /// The operator of the body as it is cut now.
    fn now<'a>(&'a self, wound: &'a Wound) -> &'a Arrays<f64> {
        wound.operator.as_deref().unwrap_or(&self.arrays)
    }

    /// Mass that a tetrahedron gives each of its corners, by the share of it that is left, kg.
    fn quarter(&self, model: &Model, wound: &Wound, e: usize) -> f64 {
        let whole = self.density[model.grid.tetrahedron_layer(e)] * self.arrays.volume(e);
        0.25 * whole * wound.surface.share(e)
    }
}

impl Mechanics for Tetrahedra {
    fn elements(&self, model: &Model) -> Elements {
        Elements { tetrahedron_count: model.grid.tetrahedron_count(), ..Elements::default() }
    }

    /// Cuts find the tetrahedra around nodes themselves.
    fn around_nodes(&self, _: &Model) -> Vec<u32> {
        vec![]
    }

    fn rotation_count(&self, _: &Model) -> usize {
        0
    }

    /// Links over the faces that tetrahedra of a mesh share, between their centroids.
    fn segments(&self, model: &Model) -> Segments {
        let Some(of) = model.unstructured() else { return Segments::default() };
        let centroid = |corners: &[u32; 4]| {
            let sum = corners.iter().fold(V3::zero(), |sum, node| sum + V3::of(model.rest[*node as usize]));
            (sum * 0.25).f64()
        };
        let ends = (0..of.links.sides.len()).map(|link| of.links.ends(link).map(|e| e as u32)).collect();
        Segments { ends, rest: of.mesh.tetrahedra().iter().map(centroid).collect() }
    }

    fn segment_count(&self, model: &Model) -> usize {
        model.unstructured().map_or(0, |of| of.links.sides.len())
    }

    fn point_count(&self, model: &Model) -> usize {
        model.unstructured().map_or(0, |of| of.mesh.tetrahedra().len())
    }

    fn extra_columns(&self) -> usize {
        0
    }

    fn extra_nodes(&self, _: &Model) -> usize {
        self.reserve
    }

    fn corotational(&self) -> u32 {
        if self.law.is_some() { STIFFENED } else { u32::from(self.corotational) }
    }

    fn product_groups(&self, model: &Model) -> usize {
        model.node_count().div_ceil(GROUP as usize)
    }

    fn exact(&self) -> Kind {
        Kind::Tetrahedra(Box::new(self.clone()))
    }

    fn host_bytes(&self, model: &Model) -> usize {
        let (nodes, count) = (model.node_count(), model.grid.tetrahedron_count());
        // corners and gradients; lists of the nodes, 1/volume and block
        let of_elements = size_of::<[u32; 4]>() + 3 * size_of::<V4<f64>>() + 4 * size_of::<u32>();
        let of_nodes = size_of::<u32>() + size_of::<f64>() + 2 * size_of::<V4<f64>>();
        let laws = if self.law.is_some() { model.shape.len() * size_of::<V4<f64>>() } else { 0 };
        let auxiliary = self.auxiliary.as_ref().map_or(0, |auxiliary| auxiliary.bytes(model));
        let own = count * of_elements + nodes * of_nodes + size_of::<u32>() + laws + auxiliary;
        if !self.smoothed {
            // domains and patches of a hyperelastic law: volume and modulus, lists; patches, lists, 1/volume
            let more = count * (size_of::<[f64; 3]>() + 14 * size_of::<u32>()) + 2 * size_of::<u32>();
            return own + if self.law.is_some() { more } else { 0 };
        }
        // lists of the domains, both ways; volume and modulus
        let lists = count * 12 * size_of::<u32>() + size_of::<u32>();
        own + lists + self.domain_count(&model.grid) * (size_of::<[f64; 2]>() + size_of::<u32>())
    }

    fn energy(&self, _: &Model, Snapshot { u, split, shares, .. }: &Snapshot, _: &[V4<f64>]) -> f64 {
        self.arrays.by_corners(split, shares).energy(u, self.corotational)
    }

    fn linearised(&self, _: &Model) -> bool {
        self.law.is_some()
    }

    fn forces_and_product(
        &self,
        model: &Model,
        solved: &Solved,
        at: &[V4<f64>],
        in_system: &[V4<f64>],
    ) -> [Vec<V4<f64>>; 2] {
        let zeros = vec![[0.0; 4]; at.len()];
        let (mut f, mut w) = (zeros.clone(), zeros);
        let arrays = self.arrays.by_corners(&solved.start.split, &solved.start.shares);
        let mut params = model.params::<f64>();
        let rotations = match self.law {
            None => arrays.rotations(&solved.start.u, self.corotational),
            Some(_) if solved.equations == Equations::Law => arrays.linearised(&solved.start.u, For::Damping),
            Some(_) => arrays.linearised(&solved.start.u, For::Steps(params.stiffness_factor)),
        };
        let scratch = &mut arrays.scratch();
        arrays.forces(at, &rotations, &mut f, scratch);
        // damping alone, and the change of the law's own forces
        let of_law = self.law.is_some() && solved.equations != Equations::Linearised;
        if of_law {
            params.stiffness_factor -= model.step.elastic_at();
        }
        arrays.system_product(&params, in_system, &solved.dx, &rotations, &mut w, scratch);
        if of_law {
            let elastic_at = solved.elastic_at.unwrap_or(model.step.elastic_at());
            let moved = |(u, d): (&V4<f64>, &V4<f64>)| std::array::from_fn(|n| u[n] + elastic_at * d[n]);
            let end: Vec<V4<f64>> = solved.start.u.iter().zip(&solved.dx).map(moved).collect();
            let mut after = f.clone();
            arrays.forces(&end, &rotations, &mut after, scratch);
            for (((sum, after), before), dofs) in w.iter_mut().zip(&after).zip(&f).zip(&solved.start.dofs) {
                (0..3).for_each(|n| sum[n] += (after[n] - before[n]) * dofs[n]);
            }
        }
        [f, w]
    }

    fn rotations(&self, _: &Model, _: &Snapshot) -> Vec<V4<f64>> {
        vec![]
    }

    /// Of smoothed elements three elements away: a pressure is a mean over volume strains, these are means over their nodes', and those over
    /// the tetrahedra around.
    fn reached(&self, _: &Model, wound: &Wound, nodes: &[u32]) -> Vec<u32> {
        self.now(wound).reached(nodes.to_vec(), if self.smoothed { 3 } else { 1 })
    }

    /// By the passes over the whole body, in which nodes that were not asked for do not count.
    fn forces_at(&self, model: &Model, wound: &Wound, nodes: &[u32], moved: &Moved) -> Vec<[f64; 3]> {
        let (u, v): (Vec<_>, Vec<_>) =
            (0..model.node_count()).map(moved).map(|[u, v]| (u.pad(0.0), v.pad(0.0))).unzip();
        let arrays = self.now(wound);
        let rotations = match self.law {
            None => arrays.rotations(&u, self.corotational),
            Some(_) => arrays.linearised(&u, For::Damping),
        };
        let (mut f, mut damping) = (vec![[0.0; 4]; u.len()], vec![[0.0; 4]; u.len()]);
        let scratch = &mut arrays.scratch();
        arrays.forces(&u, &rotations, &mut f, scratch);
        arrays.product(&v, &rotations, &mut damping, scratch);
        let sum = |node: &u32| {
            let i = *node as usize;
            (V3::from4(f[i]) + V3::from4(damping[i]) * model.step.rayleigh_stiffness).f64()
        };
        nodes.iter().map(sum).collect()
    }

    fn strain_and_stress(&self, _: &Model, _: usize, _: &[V3<f64>; 8], _: [f64; 3]) -> [M3<f64>; 2] {
        unreachable!("tetrahedra have points of their own")
    }

    fn element_points(&self, model: &Model, wound: &Wound, point: [f64; 3]) -> Vec<ElementPoint> {
        let at = V3::of([0, 1, 2].map(|n| point[n] + model.position[n]));
        let layer = |e: usize| model.grid.tetrahedron_layer(e);
        let mut points = self.now(wound).element_points(&wound.rest, at);
        let upper = points.iter().map(|(e, _)| layer(*e)).max();
        points.retain(|(e, _)| Some(layer(*e)) == upper);
        points
    }

    /// Of smoothed elements two elements away from the corners.
    fn reached_from(&self, _: &Model, wound: &Wound, points: &[ElementPoint]) -> Vec<u32> {
        let arrays = self.now(wound);
        let corners = points.iter().flat_map(|(e, _)| arrays.corners[*e]).collect();
        arrays.reached(corners, if self.smoothed { 2 } else { 0 })
    }

    /// Means by volume: at a node those over the tetrahedra around it.
    fn strain_and_stress_at(&self, model: &Model, wound: &Wound, at: &[ElementPoint], moved: &Moved) -> [M3<f64>; 2] {
        let arrays = self.now(wound);
        let u: Vec<V4<f64>> = (0..model.node_count()).map(|node| moved(node)[0].pad(0.0)).collect();
        let all = arrays.strains_and_stresses(&u, self.corotational);
        let volume: f64 = at.iter().map(|(e, _)| arrays.volume(*e)).sum();
        let mean = |k: usize| {
            let add = |sum, (e, _): &ElementPoint| sum + all[*e][k] * (arrays.volume(*e) / volume);
            at.iter().fold(M3::zero(), add)
        };
        [0, 1].map(mean)
    }

    /// Of a cell of a grid the means over its tetrahedra.
    fn strains_and_stresses(&self, model: &Model, wound: &Wound, u: &[V4<f64>]) -> Vec<[M3<f64>; 2]> {
        let all = self.now(wound).strains_and_stresses(u, self.corotational);
        if model.unstructured().is_some() {
            return all;
        }
        let (six, _) = all.as_chunks::<PER_CELL>();
        let mean = |own: &[[M3<f64>; 2]; PER_CELL]| {
            [0, 1].map(|k| own.iter().fold(M3::zero(), |sum, own| sum + own[k]) * (1.0 / PER_CELL as f64))
        };
        six.iter().map(mean).collect()
    }

    /// Nothing cuts or carves those of a grid.
    fn alive_share(&self, model: &Model, wound: &Wound, cell: usize) -> f64 {
        if model.unstructured().is_none() {
            return 1.0;
        }
        wound.surface.linked_share(cell) * wound.surface.share(cell)
    }

    fn count_cells(&self, model: &Model, state: &Snapshot, holds: &Holds) -> u32 {
        let arrays = self.arrays.by_corners(&state.split, &state.shares);
        let gradients = arrays.displacement_gradients(&state.u);
        let of = |(e, h): &(usize, &M3<f64>)| {
            !is_removed(&arrays.corners[*e]) && holds(model.grid.tetrahedron_layer(*e), M3::identity() + **h)
        };
        gradients.iter().enumerate().filter(of).count() as u32
    }

    fn beyond_law(&self, _: usize, gradient: M3<f64>) -> bool {
        self.law.is_none() && beyond(gradient - M3::identity(), self.corotational)
    }

    fn stays<'a>(&'a self, _: &'a Model, _: &'a [V4<f64>], split: &[u32], _: &'a [V4<f64>]) -> Stays<'a> {
        let (corners, _) = split.as_chunks();
        let mut has = vec![corners.is_empty(); self.arrays.per_volume.len()];
        let present = corners.iter().filter(|corners| !is_removed(corners));
        present.flatten().for_each(|node| has[*node as usize] = true);
        Box::new(move |node| has[node])
    }

    fn cut(&self, model: &Model, wound: &mut Wound, hits: &[Hit<f64>]) -> Removal {
        if self.reserve == 0 { wound.remove_crossed(model, self, hits) } else { wound.split_nodes(model, self, hits) }
    }

    fn carve(&self, model: &Model, wound: &mut Wound, cells: &[u32]) -> Removal {
        wound.carve_tetrahedra(model, self, cells)
    }

    fn carve_space(&self, model: &Model, wound: &mut Wound, carved: &Carved) -> Removal {
        wound.carve_space_of_tetrahedra(model, self, carved)
    }

    fn pieces(&self, wound: &Wound) -> Option<usize> {
        Some(wound.surface.tetrahedra()?.pieces())
    }

    fn mass_left(&self, model: &Model, wound: &Wound) -> f64 {
        if model.mass == Mass::Uniform || model.unstructured().is_none() {
            return wound.mass_of_nodes();
        }
        let present = wound.surface.present().iter().enumerate().filter(|(_, here)| **here);
        present.map(|(e, _)| 4.0 * self.quarter(model, wound, e)).sum()
    }

    /// As of hexahedra, of the same material.
    fn splitting(&self, layer: &Layer) -> f64 {
        element::splitting(layer)
    }

    fn recorded(&self, model: &Model, made: &mut Maker, u: &Buffer, params: &Params<f32>) -> Result<Box<dyn Recorded>> {
        Ok(Box::new(gpu::Tetrahedra::new(self, model, made, u, params)?))
    }
}
