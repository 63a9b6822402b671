//! Bodies by kind: deformable bodies (hexahedra on a grid, tetrahedra, spring networks) and rigid bodies.
//!
//! Each kind is one folder. It holds the arrays and the mechanics on the host in f64 ([`Mechanics`]), the interface to the solver on the
//! CPU path ([`cpu::System`]) and on a device ([`gpu::Recorded`]), and the effect of a cut. All kinds share a [`Model`]: nodes with masses,
//! Dirichlet conditions and loads, in flat arrays that never change during a run. The rest of the program sees the [`Model`], its [`Wound`]
//! and these interfaces, never the elements. Nodes are those of a regular [`Grid`], or, of tetrahedra, of a mesh file.

mod counts;
pub mod cpu;
mod element_points;
mod embedded;
mod energy;
mod floating;
pub mod gpu;
pub mod grid;
mod loads;
mod paths;
mod refused;
mod rest_springs;
pub mod rigid;
pub mod springs;
mod start;
mod step;
pub mod tetrahedra;
mod wound;

pub use counts::Counts;
pub use energy::{
    Energy, Equations, Snapshot, Solved, beyond_law, damped, elastic_energy, energy, inverted_cells, law_residual,
    out_of_balance, residual, true_residual,
};
pub use paths::Paths;
pub use refused::Refused;
pub use rest_springs::{RestSprings, rate};
pub use step::Step;
pub use wound::{Loose, Removal, Totals, Wound};

use crate::error::Result;
use crate::gpu::Buffer;
use crate::kernels::Params;
use crate::kernels::cut::Hit;
use crate::math::elementary::sin_cos;
use crate::math::{M3, Real, V3, V4};
use crate::mesh::{Carved, Grid, MaterialPoint, Unstructured};
use crate::scene::{Law, Layer, MOST_NODES, Mass, Region, Scene, Skin};
use cpu::System;
use gpu::{Maker, Recorded};
use grid::Hexahedra;
use springs::Springs;
use tetrahedra::Tetrahedra;

/// Maximum number of layers: one uniform binding holds their element matrices (64 KiB in core WebGPU, 3 KiB each).
pub const MAX_LAYERS: usize = 21;

/// Elements of a deformable body.
#[derive(Clone, Debug)]
pub enum Kind {
    /// Hexahedral cells of the grid, each with a stiffness matrix.
    Hexahedra(Box<Hexahedra>),
    /// Springs between the corners of the grid's cells, or along the edges of a mesh.
    Springs(Box<Springs>),
    /// Tetrahedra in the cells of the grid, or of a mesh.
    Tetrahedra(Box<Tetrahedra>),
}

/// Number of elements of each kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Elements {
    /// Hexahedra.
    pub hexahedron_count: usize,
    /// Springs.
    pub spring_count: usize,
    /// Tetrahedra.
    pub tetrahedron_count: usize,
}

/// Segments that a blade can cut: pairs of points with their rest positions, m.
#[derive(Clone, Debug, Default)]
pub struct Segments {
    /// `[segment]` points; equal where there is nothing to cut.
    pub ends: Vec<[u32; 2]>,
    /// `[point]` m
    pub rest: Vec<[f64; 3]>,
}

/// Displacement, m, and velocity, m/s, of a node.
pub type Moved<'a> = dyn Fn(usize) -> [V3<f64>; 2] + Sync + 'a;

/// Whether a condition holds for an element of a layer with this deformation gradient.
pub type Holds<'a> = dyn Fn(usize, M3<f64>) -> bool + 'a;

/// An element, and the natural coordinates of a point in it, of cells 0 to 1.
pub type ElementPoint = (usize, [f64; 3]);

/// Whether a node stays in the system.
pub type Stays<'a> = Box<dyn Fn(usize) -> bool + 'a>;

/// Mechanics of a deformable body on the host, in f64.
pub trait Mechanics {
    /// Number of elements.
    fn elements(&self, model: &Model) -> Elements;
    /// `[node of the grid]` number of elements around it.
    fn around_nodes(&self, model: &Model) -> Vec<u32>;
    /// Number of elements that store a rotation from step to step.
    fn rotation_count(&self, model: &Model) -> usize;
    /// Segments that a blade can cut.
    fn segments(&self, model: &Model) -> Segments;
    /// Number of segments.
    fn segment_count(&self, model: &Model) -> usize;
    /// Number of points that are ends of segments.
    fn point_count(&self, model: &Model) -> usize;
    /// Columns of duplicate nodes reserved for cuts ([`crate::kernels::split`]).
    fn extra_columns(&self) -> usize;
    /// Number of nodes reserved for cuts.
    fn extra_nodes(&self, model: &Model) -> usize {
        self.extra_columns() * model.grid.nodes[2]
    }
    /// Rotations of the elements, as [`Params::corotational`].
    fn corotational(&self) -> u32;
    /// Number of partial sums that a product writes per right-hand side.
    fn product_groups(&self, model: &Model) -> usize;
    /// The same body for reference solves at the limit of f64: with the direct solver where there is one.
    fn exact(&self) -> Kind;
    /// Size of the arrays on the host, bytes.
    fn host_bytes(&self, model: &Model) -> usize;
    /// Elastic energy of a state, J; `rotation` as stored by the kernels (0 for removed cells).
    fn energy(&self, model: &Model, state: &Snapshot, rotation: &[V4<f64>]) -> f64;
    /// Elastic forces of a step at displacements `at`, and the product of the step's matrix with the increment found, `[node]` N;
    /// `in_system` has the DOF masks and masses of that matrix.
    fn forces_and_product(
        &self,
        model: &Model,
        solved: &Solved,
        at: &[V4<f64>],
        in_system: &[V4<f64>],
    ) -> [Vec<V4<f64>>; 2];
    /// True if a step solves a linearisation of the law, whose forces it evaluates at the start.
    fn linearised(&self, model: &Model) -> bool;
    /// `[element]` rotations at the displacements of a state.
    fn rotations(&self, model: &Model, state: &Snapshot) -> Vec<V4<f64>>;
    /// Nodes that internal forces at nodes depend on, both in ascending order: those of the cells around.
    fn reached(&self, model: &Model, wound: &Wound, nodes: &[u32]) -> Vec<u32> {
        element_points::reached(model, wound, nodes)
    }
    /// `[asked]` internal forces at nodes in ascending order, N: of the present elements at the displacements of the nodes that they reach,
    /// and of the stiffness damping (and the springs' own) at their velocities.
    fn forces_at(&self, model: &Model, wound: &Wound, nodes: &[u32], moved: &Moved) -> Vec<[f64; 3]>;
    /// Green–Lagrange strain and Cauchy stress, Pa, at a point of a cell (natural coordinates, 0 to 1) for the displacements of its corners,
    /// m. Springs have no stress: it is 0.
    fn strain_and_stress(&self, model: &Model, cell: usize, u: &[V3<f64>; 8], at: [f64; 3]) -> [M3<f64>; 2];
    /// Present elements of one layer, between two layers of the upper one, that contain a rest position in the body's frame.
    fn element_points(&self, model: &Model, wound: &Wound, point: [f64; 3]) -> Vec<ElementPoint> {
        element_points::at(model, wound, point)
    }
    /// Nodes that strain and stress at points depend on, in ascending order.
    fn reached_from(&self, _model: &Model, wound: &Wound, points: &[ElementPoint]) -> Vec<u32> {
        element_points::corners(wound, points.iter().map(|(cell, _)| *cell))
    }
    /// Means over points, one or more, of the Green–Lagrange strain and the Cauchy stress, Pa.
    fn strain_and_stress_at(&self, model: &Model, wound: &Wound, at: &[ElementPoint], moved: &Moved) -> [M3<f64>; 2] {
        element_points::means(model, wound, at, moved)
    }
    /// `[cell]`, or `[tetrahedron]` of a mesh: Green–Lagrange strain and Cauchy stress, Pa, in the middle, at displacements `u`, `[node]` m;
    /// those of removed cells are 0.
    fn strains_and_stresses(&self, model: &Model, wound: &Wound, u: &[V4<f64>]) -> Vec<[M3<f64>; 2]> {
        element_points::in_the_middle(model, wound, u)
    }
    /// Factor of a cell on the stiffness of its layer, by inclusions.
    fn stiffness_factor(&self, _cell: usize) -> f64 {
        1.0
    }
    /// Share of a present cell's links to its neighbours that are intact, 0 to 1; of the springs in it for springs.
    fn alive_share(&self, _model: &Model, wound: &Wound, cell: usize) -> f64 {
        wound.surface.linked_share(cell)
    }
    /// Number of elements that a condition on their mean deformation gradients holds for; of springs, cells of their grid. Removed cells are
    /// skipped.
    fn count_cells(&self, model: &Model, state: &Snapshot, holds: &Holds) -> u32 {
        energy::count_cells(model, state, holds)
    }
    /// True where the mean deformation gradient of a cell of a layer is beyond what its law is for; false for laws of large strains and
    /// springs.
    fn beyond_law(&self, _layer: usize, _gradient: M3<f64>) -> bool {
        false
    }
    /// Whether its elements have dampers of their own.
    fn damps(&self) -> bool {
        false
    }
    /// Whether a remaining element keeps a node in the system; arguments as in `energy`.
    fn stays<'a>(&'a self, model: &'a Model, rotation: &'a [V4<f64>], split: &[u32], law: &'a [V4<f64>]) -> Stays<'a>;
    /// Applies hits (sorted by segment) to a wound; returns the changes for the backend.
    fn cut(&self, model: &Model, wound: &mut Wound, hits: &[Hit<f64>]) -> Removal;
    /// Removes cells from a wound, and what would hang by an edge or a corner without them; returns the changes for the backend.
    fn carve(&self, _: &Model, _: &mut Wound, _: &[u32]) -> Removal {
        unreachable!("tools carve hexahedra and tetrahedra alone")
    }
    /// Removes space from hexahedra of a large-strain law or from smoothed tetrahedra; returns the changes for the backend.
    fn carve_space(&self, _: &Model, _: &mut Wound, _: &Carved) -> Removal {
        unreachable!("scenes refuse to carve space out of others")
    }
    /// Number of connected pieces of the body; `None` where they are not counted.
    fn pieces(&self, wound: &Wound) -> Option<usize>;
    /// Mass of the remaining elements, kg.
    fn mass_left(&self, model: &Model, wound: &Wound) -> f64;
    /// `√(π E′ G / 2)` of a layer, N/m^1.5, with toughness `G` and `E′ = E/(1 − ν²)`: see [`Model::splitting`].
    fn splitting(&self, layer: &Layer) -> f64;
    /// Arrays and kernels of the body on a device; `u` holds the displacements.
    ///
    /// # Errors
    /// If an array exceeds a limit of the adapter, or the scene's solver does not run on a device.
    fn recorded(&self, model: &Model, made: &mut Maker, u: &Buffer, params: &Params<f32>) -> Result<Box<dyn Recorded>>;
}

/// A deformable body.
#[derive(Clone, Debug)]
pub struct Model {
    /// Index in the scene's list of deformable bodies.
    pub body: usize,
    /// Rest position of the centre of the grid's bottom face, m.
    pub position: [f64; 3],
    /// Grid, or nodes of a mesh, in the body's own frame.
    pub grid: Grid,
    /// `[layer]` cell edges, m, and the mass that a cell gives each corner, kg; 0 of a mesh.
    pub shape: Vec<[f64; 4]>,
    /// Elements.
    pub kind: Kind,
    /// Mass discretisation; the masses in `dofs` are the row sums of M.
    pub mass: Mass,
    /// `[node of the grid]` rest position, m.
    pub rest: Vec<[f64; 3]>,
    /// `[node]` DOF mask per axis (1 free, 0 fixed) and mass of the uncut body, kg; zero for the reserve of duplicate nodes, which follows
    /// the grid's.
    pub dofs: Vec<[f64; 4]>,
    /// Rest-shape springs.
    pub rest_springs: RestSprings,
    /// `[node]` prescribed displacement of fixed axes without paths, m.
    pub prescribed: Vec<[f64; 3]>,
    /// Fixed nodes that follow paths.
    pub paths: Paths,
    /// `[layer]` J/m²
    pub toughness: Vec<f64>,
    /// `[layer]` `√(π E′ G / 2)`, N/m^1.5, with toughness `G` and `E′ = E/(1 − ν²)`: a pair of forces per length that wedges a crack open
    /// at a distance `d` behind its front drives the crack when it exceeds `√d` times this value. Infinite for springs, which have no
    /// modulus.
    /// Source: Tada, Paris, Irwin, The Stress Analysis of Cracks Handbook, `K = 2P/√(2πd)`.
    pub splitting: Vec<f64>,
    /// Step size, gravity, damping, preconditioner.
    pub step: Step,
    /// Counts in place of the arrays over nodes, rest-shape springs and springs, which are empty with them ([`Model::of_sizes`]).
    pub counts: Option<Counts>,
}

/// Room per duplicate node for split cells and for their nodes: a staircase cut has four cells around each of its edges, in six columns.
const CELLS: usize = 4;
const TOUCHED: usize = 6;
/// Additional room for the cells and nodes around the first duplicate.
const AROUND: usize = 64;

/// Displacement of a point under a rotation about the z axis, m.
pub fn turned([x, y, _]: [f64; 3], angle: f64) -> [f64; 3] {
    let (sin, cos) = sin_cos(angle);
    [cos * x - sin * y - x, sin * x + cos * y - y, 0.0]
}

/// Number of nodes of a skin inside a region.
pub fn count_in(skin: &Skin, region: &Region) -> usize {
    Grid::new(skin).count_in(region)
}

impl Model {
    /// Builds the arrays of deformable body number `body`; the scene must have passed [`Scene::check`].
    ///
    /// # Errors
    /// [`Refused`] for more layers than a uniform binding holds, more nodes than 32-bit indices reach, multigrid or the direct solver on
    /// springs, the direct solver where a cut may duplicate nodes, rest-shape springs on a consistent mass, or springs that cannot be fitted.
    pub fn new(scene: &Scene, body: usize) -> Result<Self> {
        let mut model = Self::without_arrays(scene, body)?;
        let skin = &scene.skins[body];
        if let (Kind::Springs(springs), Law::Springs { stiffness, damping }) = (&mut model.kind, skin.law) {
            **springs = Springs::of(&model.grid, &skin.layers, stiffness, damping)?;
        }
        let count = model.own_nodes();
        let rest = |node| [0, 1, 2].map(|a| model.grid.rest(node)[a] + skin.position[a]);
        model.rest = (0..count).map(rest).collect();
        if let Kind::Tetrahedra(tetrahedra) = &mut model.kind {
            tetrahedra.fill(&model.grid, &model.rest, &skin.layers);
        }
        if let Kind::Hexahedra(hexahedra) = &mut model.kind
            && let Some(law) = &mut hexahedra.hyperelastic
        {
            law.fill(&model.grid, &skin.layers);
        }
        let rest_springs = rest_springs::of_body(scene, body, &model.grid);
        model.rest_springs = RestSprings::new(&rest_springs, |spring| model.grid.nodes_in(&spring.region));
        model.set_masses(&skin.layers);
        model.hold(scene);
        if model.floats() {
            model.step.yield_slowly(skin, model.grid.size()[0].max(model.grid.size()[1]).max(model.grid.thickness()));
        }
        // reserve for the nodes that a cut duplicates
        model.dofs.resize(model.node_count(), [0.0; 4]);
        grid::prepare(&mut model, scene.solver.preconditioner);
        Tetrahedra::with_auxiliary(scene, &mut model)?;
        Ok(model)
    }

    /// A model of deformable body number `body` that has counts in place of the arrays of the size of its grid, for what asks for sizes
    /// alone: nothing can be computed with it.
    ///
    /// # Errors
    /// As [`Model::new`].
    pub fn of_sizes(scene: &Scene, body: usize) -> Result<Self> {
        let mut model = Self::without_arrays(scene, body)?;
        model.counts = Some(Counts::new(scene, body, &model.grid));
        grid::prepare(&mut model, scene.solver.preconditioner);
        Tetrahedra::with_auxiliary(scene, &mut model)?;
        Ok(model)
    }

    /// Everything but the arrays over nodes, rest-shape springs and springs.
    fn without_arrays(scene: &Scene, body: usize) -> Result<Self> {
        let skin = &scene.skins[body];
        let grid = Grid::new(skin);
        embedded::check(scene, body, &grid)?;
        // limits of uniform bindings and of 32-bit indices
        if skin.layers.len() > MAX_LAYERS {
            return Err(Refused::Layers { count: skin.layers.len() }.into());
        }
        let extra_columns = grid::reserve(scene, skin)?;
        let columns = (skin.cells[0] as u64 + 1) * (skin.cells[1] as u64 + 1) + extra_columns as u64;
        let indexed = match &grid.unstructured {
            Some(_) => grid.node_count() as u64 + tetrahedra::reserve(scene, skin) as u64,
            None => columns * grid.nodes[2] as u64,
        };
        if indexed > u64::from(MOST_NODES) {
            return Err(Refused::Nodes { count: indexed }.into());
        }
        // cell edges and corner masses, one entry per layer
        let shape = skin.layers.iter().enumerate().map(|(index, layer)| {
            let h = grid.cell_edges(index as u32);
            [h[0], h[1], h[2], layer.density * h[0] * h[1] * h[2] / 8.0]
        });
        let shape: Vec<[f64; 4]> = shape.collect();
        // elements; fails if the scene's solver does not support them
        let kind = if skin.law.is_tetrahedral() {
            tetrahedra::check(scene, body)?;
            Kind::Tetrahedra(Box::new(Tetrahedra::new(scene, body)))
        } else if let Law::Springs { .. } = skin.law {
            springs::check(scene, body)?;
            Kind::Springs(Box::new(Springs { breaks: skin.breaks(), ..Springs::default() }))
        } else {
            Kind::Hexahedra(Box::new(Hexahedra::new(scene, body, &grid, extra_columns)))
        };
        if skin.mass == Mass::Consistent && scene.rest_springs.iter().any(|a| a.body == body) {
            return Err(Refused::RestSpringMass.into());
        }
        let mut model = Self {
            rest: vec![],
            position: skin.position,
            body,
            shape,
            mass: skin.mass,
            dofs: vec![],
            rest_springs: RestSprings::default(),
            prescribed: vec![],
            paths: Paths::default(),
            toughness: skin.layers.iter().map(|l| l.toughness).collect(),
            splitting: vec![],
            step: Step::new(scene, skin),
            counts: None,
            grid,
            kind,
        };
        model.splitting = skin.layers.iter().map(|layer| model.mechanics().splitting(layer)).collect();
        Ok(model)
    }

    /// Masses of the nodes, all axes free: an eighth of each cell at each corner, a quarter of each tetrahedron of a mesh, what an embedded surface
    /// encloses, or one uniform value. Nodes without a present cell are fixed and have none.
    fn set_masses(&mut self, layers: &[Layer]) {
        let params = self.grid.params::<f64>();
        let count = self.own_nodes();
        if let Some(embedded) = &self.grid.embedded {
            let of_node = |mass: &f64| if *mass > 0.0 { [1.0, 1.0, 1.0, *mass] } else { [0.0; 4] };
            self.dofs = embedded.mass.iter().map(of_node).collect();
            return;
        }
        self.dofs = vec![[1.0, 1.0, 1.0, 0.0]; count];
        for cell in 0..self.grid.cell_count() {
            let layer = self.grid.layer(cell);
            for node in params.corners(cell) {
                self.dofs[node][3] += self.shape[layer][3];
            }
        }
        if let Some(Unstructured { mesh, .. }) = self.grid.unstructured.as_deref() {
            for (e, (corners, layer)) in mesh.tetrahedra().iter().zip(mesh.layers()).enumerate() {
                let quarter = 0.25 * layers[*layer as usize].density * mesh.volume(e);
                corners.iter().for_each(|node| self.dofs[*node as usize][3] += quarter);
            }
        }
        if self.mass == Mass::Uniform {
            let each = self.dofs.iter().map(|f| f[3]).sum::<f64>() / count as f64;
            self.dofs.iter_mut().for_each(|f| f[3] = each);
        }
    }

    /// Dirichlet conditions: DOF mask, and the prescribed displacement of fixed axes.
    fn hold(&mut self, scene: &Scene) {
        let (grid, count) = (&self.grid, self.own_nodes());
        self.prescribed = vec![[0.0; 3]; count];
        let mut holding = vec![[None; 3]; count];
        for (number, boundary) in scene.boundaries.iter().enumerate().filter(|(_, b)| b.body == self.body) {
            for node in (0..count).filter(|n| grid.contains(&boundary.region, *n)) {
                let turned = turned(grid.rest(node), boundary.rotation);
                for axis in (0..3).filter(|a| boundary.axes[*a]) {
                    self.dofs[node][axis] = 0.0;
                    holding[node][axis] = Some(number);
                    self.prescribed[node][axis] = turned[axis] + boundary.displacement[axis];
                }
            }
        }
        let mut paths = Paths::default();
        holding.into_iter().enumerate().for_each(|(node, holding)| paths.take(scene, node, holding));
        self.paths = paths;
    }

    /// Mechanics on the host.
    pub fn mechanics(&self) -> &dyn Mechanics {
        match &self.kind {
            Kind::Hexahedra(hexahedra) => &**hexahedra,
            Kind::Springs(springs) => &**springs,
            Kind::Tetrahedra(tetrahedra) => &**tetrahedra,
        }
    }

    /// System for solves on the CPU path.
    pub fn system<R: Real>(&self) -> Box<dyn System<R>> {
        match &self.kind {
            Kind::Hexahedra(_) => Box::new(grid::cpu::Hexahedra::new(self)),
            Kind::Springs(springs) => Box::new(springs::cpu::Springs::new(self, springs)),
            Kind::Tetrahedra(tetrahedra) => Box::new(tetrahedra::cpu::Tetrahedra::new(self, tetrahedra)),
        }
    }

    /// The same body for reference solves at the limit of f64.
    pub fn exact(&self) -> Self {
        Self { kind: self.mechanics().exact(), ..self.clone() }
    }

    /// Number of nodes without the reserve of duplicates.
    pub fn own_nodes(&self) -> usize {
        self.grid.node_count()
    }

    /// Number of nodes with a rest-shape spring.
    pub fn rest_spring_count(&self) -> usize {
        self.counts.map_or(self.rest_springs.nodes.len(), |counts| counts.rest_springs)
    }

    /// Number of nodes on prescribed paths.
    pub fn driven_count(&self) -> usize {
        self.counts.map_or(self.paths.nodes.len(), |counts| counts.driven)
    }

    /// Capacity of the table of split nodes for nodes of split cells.
    fn touched_nodes(&self) -> usize {
        let split = self.mechanics().extra_columns() * self.grid.nodes[2];
        if split > 0 { TOUCHED * split + AROUND } else { 0 }
    }

    /// Number of nodes, with the reserve of duplicates.
    pub fn node_count(&self) -> usize {
        self.own_nodes() + self.mechanics().extra_nodes(self)
    }

    /// Number of cells inside the body's surface: of the grid, or tetrahedra of a mesh.
    pub fn cell_count(&self) -> usize {
        self.grid.unstructured.as_ref().map_or(self.grid.cell_count(), |of| of.mesh.tetrahedra().len())
    }

    /// Layer of a cell.
    pub fn layer(&self, cell: usize) -> usize {
        self.grid.layer(cell)
    }

    /// Larger horizontal cell edge, m.
    pub fn cell_width(&self) -> f64 {
        self.grid.cell_width()
    }

    /// Largest extent along x or z at rest, m.
    pub fn extent(&self) -> f64 {
        self.grid.thickness().max(self.grid.size()[0])
    }

    /// Number of elements.
    pub fn elements(&self) -> Elements {
        self.mechanics().elements(self)
    }

    /// Node nearest to a rest position given in the body's frame.
    pub fn nearest(&self, point: [f64; 3]) -> u32 {
        self.grid.nearest(point) as u32
    }

    /// The material point at a rest position, m; none outside of the uncut body.
    pub fn material_point(&self, at: [f64; 3]) -> Option<MaterialPoint> {
        self.grid.material_point([0, 1, 2].map(|n| at[n] - self.position[n]))
    }

    /// The mesh of tetrahedra that its nodes are of, if they are of one.
    pub fn unstructured(&self) -> Option<&Unstructured> {
        self.grid.unstructured.as_deref()
    }

    /// The tetrahedron of a mesh at a rest position in the body's frame, or nearest to it, and the weights of its corners; none of a grid.
    pub fn tetrahedron_at(&self, at: [f64; 3]) -> Option<(usize, [f64; 4])> {
        self.grid.tetrahedron_at(at)
    }

    /// Cells that contain a rest position given in the body's frame ([`Grid::cells_at`]).
    pub fn cells_at(&self, point: [f64; 3]) -> Vec<(usize, [f64; 3])> {
        self.grid.cells_at(point)
    }

    /// The kernels' parameter block.
    pub fn params<R: Real>(&self) -> Params<R> {
        let (s, mechanics) = (&self.step, self.mechanics());
        let [tetrahedron_count, domain_count] = match &self.kind {
            Kind::Tetrahedra(own) => [self.grid.tetrahedron_count(), own.domain_count(&self.grid)],
            Kind::Hexahedra(_) | Kind::Springs(_) => [0; 2],
        };
        let extra = mechanics.extra_columns();
        let split = extra * self.grid.nodes[2];
        Params {
            node_count: self.node_count() as u32,
            extra_columns: extra as u32,
            split_cells: if split > 0 { CELLS * split + AROUND } else { 0 } as u32,
            touched_nodes: self.touched_nodes() as u32,
            tetrahedron_count: tetrahedron_count as u32,
            domain_count: domain_count as u32,
            preconditioner: s.preconditioner,
            corotational: mechanics.corotational(),
            rhs_count: 1,
            product_groups: mechanics.product_groups(self) as u32,
            inertia: R::of(s.inertia()),
            stiffness_factor: R::of(s.stiffness_factor()),
            step: R::of(s.step),
            momentum_factor: R::of(s.momentum_factor()),
            velocity_factor: R::of(s.velocity_factor()),
            lead_time: R::of(s.lead_time()),
            gravity_x: R::of(s.gravity[0]),
            gravity_y: R::of(s.gravity[1]),
            gravity_z: R::of(s.gravity[2]),
            // nodes of a mesh are in one row, with their duplicates
            nodes_x: if self.grid.unstructured.is_some() {
                self.node_count() as u32
            } else {
                self.grid.nodes[0] as u32
            },
            ..self.grid.params()
        }
    }

    /// `[layer]` cell edges, m, and corner mass, kg.
    pub fn shapes<R: Real>(&self) -> Vec<V4<R>> {
        self.shape.iter().map(|s| s.map(R::of)).collect()
    }

    /// Number of unconstrained degrees of freedom.
    pub fn degrees_of_freedom(&self) -> usize {
        let of_node = |f: &[f64; 4]| f[..3].iter().filter(|axis| **axis != 0.0).count();
        self.counts.map_or_else(|| self.dofs.iter().map(of_node).sum(), |counts| counts.dof)
    }

    /// Size of the arrays on the host, bytes.
    pub fn host_bytes(&self) -> u64 {
        // rest positions and prescribed displacements; DOF masks and masses, with the reserve of duplicates
        let nodes = self.own_nodes() * 2 * size_of::<[f64; 3]>() + self.node_count() * size_of::<[f64; 4]>();
        let rest_springs = self.rest_spring_count() * (size_of::<u32>() + size_of::<f64>());
        let mesh = self.grid.unstructured.as_ref().map_or(0, |unstructured| unstructured.bytes());
        let embedded = self.grid.embedded.as_ref().map_or(0, |embedded| embedded.bytes());
        (nodes + rest_springs + mesh + embedded + size_of_val(&self.shape[..]) + self.mechanics().host_bytes(self))
            as u64
    }

    /// Number of nodes inside a region.
    pub fn count_in(&self, region: &Region) -> usize {
        self.grid.count_in(region)
    }

    /// Nodes inside a region.
    pub fn nodes_in(&self, region: &Region) -> Vec<u32> {
        self.grid.nodes_in(region)
    }
}
