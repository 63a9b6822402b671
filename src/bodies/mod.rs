//! Bodies by kind: what a deformable body is made of (hexahedra on a grid, springs), and rigid ones.
//!
//! A kind is one folder: its arrays and its mechanics on the host in f64 ([`Mechanics`]), what a solve needs of it on the CPU path
//! ([`cpu::System`]) and on a device ([`gpu::Recorded`]), and what a cut does to it. What all kinds have is a [`Model`]: nodes with
//! masses, held axes and loads, flat arrays that never change during a run. The rest of the program sees a [`Model`], its [`Wound`] and
//! these seams, never what the body is made of. Both kinds of today stand on a regular [`Grid`].

mod anchors;
pub mod cpu;
mod energy;
pub mod gpu;
pub mod grid;
mod refused;
pub mod rigid;
pub mod springs;
mod start;
mod step;
mod wound;

pub use anchors::{Anchors, rate};
pub use energy::{Solved, elastic_energy, energy, inverted_cells, residual, true_residual};
pub use refused::Refused;
pub use step::Step;
pub use wound::{Removal, Totals, Wound};

use crate::error::Result;
use crate::gpu::Buffer;
use crate::kernels::Params;
use crate::kernels::cut::Hit;
use crate::math::elementary::sin_cos;
use crate::math::{Real, V4};
use crate::mesh::Grid;
use crate::scene::{Anchor, Law, Load, MOST_NODES, Mass, Region, Scene, Skin};
use cpu::System;
use gpu::{Maker, Recorded};
use grid::Hexahedra;
use springs::Springs;

/// Layers that one uniform binding of element matrices holds (64 KiB of core WebGPU / 3 KiB each).
pub const MAX_LAYERS: usize = 21;

/// What a deformable body is made of.
#[derive(Clone, Debug)]
pub enum Kind {
    /// Cells of the grid with a stiffness each.
    Hexahedra(Box<Hexahedra>),
    /// Springs between the corners of the grid's cells.
    Springs(Box<Springs>),
}

/// How many of what a body is made of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Elements {
    /// Hexahedra.
    pub hexahedron_count: usize,
    /// Springs.
    pub spring_count: usize,
}

/// What a blade cuts: pairs of points, and where these are at rest, m.
#[derive(Clone, Debug, Default)]
pub struct Segments {
    /// `[segment]` points; both the same where there is nothing to cut.
    pub ends: Vec<[u32; 2]>,
    /// `[point]` m
    pub rest: Vec<[f64; 3]>,
}

/// What a kind of deformable body is to the host, in f64.
pub trait Mechanics {
    /// How many of what it is made of.
    fn elements(&self, model: &Model) -> Elements;
    /// `[node of the grid]` how many elements are around it.
    fn around_nodes(&self, model: &Model) -> Vec<u32>;
    /// Elements that keep a rotation from step to step.
    fn rotation_count(&self, model: &Model) -> usize;
    /// What a blade cuts.
    fn segments(&self, model: &Model) -> Segments;
    /// How many of these there are.
    fn segment_count(&self, model: &Model) -> usize;
    /// Columns of copies that a cut may split nodes into ([`crate::kernels::split`]).
    fn extra_columns(&self) -> usize;
    /// The step's forces follow the rotations of its elements.
    fn corotational(&self) -> bool;
    /// Partial sums that a product leaves for each right-hand side.
    fn product_groups(&self, model: &Model) -> usize;
    /// The same as solves to the limit of f64 want it: by a factor where there is one.
    fn exact(&self) -> Kind;
    /// Bytes of its arrays on the host.
    fn host_bytes(&self) -> usize;
    /// Elastic energy of displacements, J; `rotation` as the kernels keep it (0 for dead cells), `law` of springs as cut so far.
    fn energy(&self, model: &Model, u: &[V4<f64>], rotation: &[V4<f64>], split: &[u32], law: &[V4<f64>]) -> f64;
    /// Elastic forces of a step at displacements `at`, and what the step's matrix, whose nodes are `in_system`, makes of the increment
    /// that was found, `[node]` N.
    fn forces_and_product(
        &self,
        model: &Model,
        solved: &Solved,
        at: &[V4<f64>],
        in_system: &[V4<f64>],
    ) -> [Vec<V4<f64>>; 2];
    /// `[element]` rotations at a state's displacements.
    fn rotations(&self, model: &Model, state: &Solved) -> Vec<V4<f64>>;
    /// Whether a live element holds a node in the system; `rotation` and `law` as for the energy.
    fn stays(&self, model: &Model, rotation: &[V4<f64>], law: &[V4<f64>], node: usize) -> bool;
    /// Takes hits (in the order of segments) over into a wound; returns what has to go.
    fn cut(&self, model: &Model, wound: &mut Wound, hits: &[Hit<f64>]) -> Removal;
    /// Pieces that the body has fallen into; none where they are not counted.
    fn pieces(&self, wound: &Wound) -> Option<usize>;
    /// Mass of the elements that a cut has left, kg.
    fn mass_left(&self, model: &Model, wound: &Wound) -> f64;
    /// `√(π E′ G / 2)` of a layer, N/m^1.5, for the toughness `G` and `E′ = E/(1 − ν²)`: see [`Model::splitting`].
    fn splitting(&self, layer: &crate::scene::Layer) -> f64;
    /// Its arrays and kernels on a device, where `u` has the displacements.
    ///
    /// # Errors
    /// When an array passes a limit of the adapter, or the scene's solver does not run there.
    fn recorded(&self, model: &Model, made: &mut Maker, u: &Buffer, params: &Params<f32>) -> Result<Box<dyn Recorded>>;
}

/// A deformable body.
#[derive(Clone, Debug)]
pub struct Model {
    /// Number in the scene's list of deformable bodies.
    pub body: usize,
    /// Where the middle of the grid's bottom is at rest, m.
    pub position: [f64; 3],
    /// Geometry, around its own origin.
    pub grid: Grid,
    /// `[layer]` cell edges m and the mass that a cell gives each corner, kg.
    pub shape: Vec<[f64; 4]>,
    /// What it is made of.
    pub kind: Kind,
    /// Where the mass lies; `free` has the sums over rows of M.
    pub mass: Mass,
    /// `[node of the grid]` rest position, m.
    pub rest: Vec<[f64; 3]>,
    /// `[node]` 1 free or 0 held, per axis, and mass, kg, of the uncut body; zero in the reserve of copies, which follows the grid.
    pub free: Vec<[f64; 4]>,
    /// Springs to rest positions.
    pub anchors: Anchors,
    /// `[node]` displacement of held axes, m.
    pub held: Vec<[f64; 3]>,
    /// `[layer]` J/m²
    pub toughness: Vec<f64>,
    /// `[layer]` `√(π E′ G / 2)`, N/m^1.5, with the toughness `G` and `E′ = E/(1 − ν²)`: a pair of forces per length that wedges a crack open
    /// at a distance `d` behind its front makes it run on by itself at `√d` times this. Springs have no such modulus: infinite.
    /// Source: Tada, Paris, Irwin, The Stress Analysis of Cracks Handbook, `K = 2P/√(2πd)`.
    pub splitting: Vec<f64>,
    /// Step, gravity, damping, preconditioner.
    pub step: Step,
}

/// Split cells and touched nodes for each copy: a stair through the grid has four cells around each edge of it, and six columns.
const CELLS: usize = 4;
const TOUCHED: usize = 6;
/// And around the first one.
const AROUND: usize = 64;

/// What a turn about the z axis moves a place by, m.
pub fn turned([x, y, _]: [f64; 3], angle: f64) -> [f64; 3] {
    let (sin, cos) = sin_cos(angle);
    [cos * x - sin * y - x, sin * x + cos * y - y, 0.0]
}

/// Nodes of a skin in a region.
pub fn nodes_in(skin: &Skin, region: &Region) -> Vec<u32> {
    Grid::new(skin).nodes_in(region)
}

impl Model {
    /// Builds the arrays of a scene's deformable body of that number; the scene has passed [`Scene::check`].
    ///
    /// # Errors
    /// [`Refused`] for more layers than a uniform binding holds, more nodes than 32-bit indices reach, multigrid or the direct solver on
    /// springs, the direct solver where nodes may be split, or anchors on a consistent mass.
    pub fn new(scene: &Scene, body: usize) -> Result<Self> {
        let skin = &scene.skins[body];
        let grid = Grid::new(skin);
        // limits of uniform bindings and of 32-bit indices
        if skin.layers.len() > MAX_LAYERS {
            return Err(Refused::Layers { count: skin.layers.len() }.into());
        }
        let extra_columns = grid::reserve(scene, skin)?;
        let columns = (skin.cells[0] as u64 + 1) * (skin.cells[1] as u64 + 1) + extra_columns as u64;
        let indexed = columns * grid.nodes[2] as u64;
        if indexed > u64::from(MOST_NODES) {
            return Err(Refused::Nodes { count: indexed }.into());
        }
        // edges and masses of cells; all those of a layer are alike
        let shape = skin.layers.iter().enumerate().map(|(index, layer)| {
            let h = grid.cell_edges(index as u32);
            [h[0], h[1], h[2], layer.density * h[0] * h[1] * h[2] / 8.0]
        });
        let shape: Vec<[f64; 4]> = shape.collect();
        // what it is made of, which may refuse the solver that the scene asks for
        let kind = match skin.law {
            Law::Springs { stiffness, damping } => {
                Kind::Springs(Box::new(Springs::new(scene, &grid, stiffness, damping)?))
            }
            Law::Fem { .. } | Law::Hyperelastic(_) => {
                Kind::Hexahedra(Box::new(Hexahedra::new(scene, skin, &grid, extra_columns)))
            }
        };
        let anchors: Vec<Anchor> = scene.anchors.iter().filter(|a| a.body == body).cloned().collect();
        if skin.mass == Mass::Consistent && !anchors.is_empty() {
            return Err(Refused::AnchoredMass.into());
        }
        // masses of the nodes: an eighth of each cell at its corners, or the same everywhere
        let params = grid.params::<f64>();
        let count = grid.node_count();
        let mut free = vec![[1.0, 1.0, 1.0, 0.0]; count];
        for cell in 0..grid.cell_count() {
            let layer = grid.layer(cell);
            for node in params.corners(cell) {
                free[node][3] += shape[layer][3];
            }
        }
        if skin.mass == Mass::Uniform {
            let each = free.iter().map(|f| f[3]).sum::<f64>() / count as f64;
            free.iter_mut().for_each(|f| f[3] = each);
        }
        // Dirichlet conditions: mask of free axes, and the prescribed displacement of the others
        let mut held = vec![[0.0; 3]; count];
        for boundary in scene.boundaries.iter().filter(|b| b.body == body) {
            for node in (0..count).filter(|n| grid.contains(&boundary.region, *n)) {
                let turned = turned(grid.rest(node), boundary.turn);
                for axis in (0..3).filter(|a| boundary.axes[*a]) {
                    free[node][axis] = 0.0;
                    held[node][axis] = turned[axis] + boundary.displacement[axis];
                }
            }
        }
        // room for the nodes that a cut duplicates
        free.resize(count + extra_columns * grid.nodes[2], [0.0; 4]);
        let mut model = Self {
            rest: (0..count).map(|n| [0, 1, 2].map(|a| grid.rest(n)[a] + skin.position[a])).collect(),
            position: skin.position,
            body,
            shape,
            mass: skin.mass,
            free,
            anchors: Anchors::new(&anchors, |anchor| grid.nodes_in(&anchor.region)),
            held,
            toughness: skin.layers.iter().map(|l| l.toughness).collect(),
            splitting: vec![],
            step: Step::new(scene, skin),
            grid,
            kind,
        };
        model.splitting = skin.layers.iter().map(|layer| model.mechanics().splitting(layer)).collect();
        grid::prepare(&mut model, scene.solver.preconditioner);
        Ok(model)
    }

    /// What it is made of, to the host.
    pub fn mechanics(&self) -> &dyn Mechanics {
        match &self.kind {
            Kind::Hexahedra(hexahedra) => &**hexahedra,
            Kind::Springs(springs) => &**springs,
        }
    }

    /// What it is made of, to a solve on the CPU path.
    pub fn system<R: Real>(&self) -> Box<dyn System<R>> {
        match &self.kind {
            Kind::Hexahedra(_) => Box::new(grid::cpu::Hexahedra::new(self)),
            Kind::Springs(springs) => Box::new(springs::cpu::Springs::new(self, springs)),
        }
    }

    /// The same body solved to the limit of f64.
    pub fn exact(&self) -> Self {
        Self { kind: self.mechanics().exact(), ..self.clone() }
    }

    /// Nodes without the reserve of copies.
    pub fn own_nodes(&self) -> usize {
        self.rest.len()
    }

    /// Nodes of split cells that the table of split nodes has room for.
    fn touched_nodes(&self) -> usize {
        let split = self.mechanics().extra_columns() * self.grid.nodes[2];
        if split > 0 { TOUCHED * split + AROUND } else { 0 }
    }

    /// Nodes and the reserve of copies.
    pub fn node_count(&self) -> usize {
        self.own_nodes() + self.mechanics().extra_columns() * self.grid.nodes[2]
    }

    /// Cells that the body's surface goes around.
    pub fn cell_count(&self) -> usize {
        self.grid.cell_count()
    }

    /// Layer of a cell.
    pub fn layer(&self, cell: usize) -> usize {
        self.grid.layer(cell)
    }

    /// Edges of the largest cells across the body, m.
    pub fn cell_width(&self) -> f64 {
        self.grid.edge[0].max(self.grid.edge[1])
    }

    /// Largest extent along x or z at rest, m.
    pub fn extent(&self) -> f64 {
        self.grid.thickness().max(self.grid.edge[0] * self.grid.cells[0] as f64)
    }

    /// How many of what it is made of.
    pub fn elements(&self) -> Elements {
        self.mechanics().elements(self)
    }

    /// The node nearest to a rest position, in the body's own frame.
    pub fn nearest(&self, point: [f64; 3]) -> u32 {
        self.grid.nearest(point) as u32
    }

    /// The kernels' parameter block.
    pub fn params<R: Real>(&self) -> Params<R> {
        let (s, mechanics) = (&self.step, self.mechanics());
        let extra = mechanics.extra_columns();
        let split = extra * self.grid.nodes[2];
        Params {
            node_count: self.node_count() as u32,
            extra_columns: extra as u32,
            split_cells: if split > 0 { CELLS * split + AROUND } else { 0 } as u32,
            touched_nodes: self.touched_nodes() as u32,
            preconditioner: s.preconditioner,
            corotational: u32::from(mechanics.corotational()),
            slot_count: 1,
            product_groups: mechanics.product_groups(self) as u32,
            inertia: R::of(s.inertia()),
            stiffness_factor: R::of(s.stiffness_factor()),
            step: R::of(s.step),
            carried: R::of(s.carried()),
            reach: R::of(s.reach()),
            lead: R::of(s.lead()),
            gravity_x: R::of(s.gravity[0]),
            gravity_y: R::of(s.gravity[1]),
            gravity_z: R::of(s.gravity[2]),
            ..self.grid.params()
        }
    }

    /// `[layer]` cell edges and corner mass.
    pub fn shapes<R: Real>(&self) -> Vec<V4<R>> {
        self.shape.iter().map(|s| s.map(R::of)).collect()
    }

    /// `[node]` dead loads that act on the uncut body at a time, N.
    pub fn load_at(&self, loads: &[Load], time: f64) -> Vec<[f64; 3]> {
        let params = self.grid.params::<f64>();
        self.load_on(loads, time, |cell| params.corners(cell))
    }

    /// The same once a cut has given cells other `corners`: each pressure's exact share per node (bilinear over the covered part of a
    /// face).
    pub fn load_on(&self, loads: &[Load], time: f64, corners: impl Fn(usize) -> [usize; 8]) -> Vec<[f64; 3]> {
        let mut out = vec![[0.0; 3]; self.node_count()];
        let params = self.grid.params::<f64>();
        let top = self.grid.nodes[2] - 1;
        let [cells_x, cells_y, _] = self.grid.cells;
        for load in loads.iter().filter(|l| l.body == self.body && time >= l.start && time < l.end) {
            for j in 0..cells_y {
                for i in 0..cells_x {
                    let low = self.grid.rest(params.node_id([i, j, top]));
                    let share = |axis: usize| {
                        let edge = self.grid.edge[axis];
                        let a = ((load.min[axis] - low[axis]) / edge).clamp(0.0, 1.0);
                        let b = ((load.max[axis] - low[axis]) / edge).clamp(0.0, 1.0);
                        let upper = 0.5 * (b * b - a * a);
                        [(b - a - upper) * edge, upper * edge]
                    };
                    let (x, y) = (share(0), share(1));
                    let nodes = corners(params.cell_id([i, j, top - 1]));
                    for (a, p, q) in [(4, 0, 0), (5, 1, 0), (7, 0, 1), (6, 1, 1)] {
                        out[nodes[a]][2] -= load.pressure * x[p] * y[q];
                    }
                }
            }
        }
        out
    }

    /// Axes of nodes that nothing holds.
    pub fn degrees_of_freedom(&self) -> usize {
        self.free.iter().map(|f| f[..3].iter().filter(|axis| **axis != 0.0).count()).sum()
    }

    /// Bytes of its arrays.
    pub fn host_bytes(&self) -> u64 {
        let nodes = size_of_val(&self.rest[..]) + size_of_val(&self.free[..]) + size_of_val(&self.held[..]);
        let anchors = size_of_val(&self.anchors.nodes[..]) + size_of_val(&self.anchors.stiffness[..]);
        (nodes + anchors + size_of_val(&self.shape[..]) + self.mechanics().host_bytes()) as u64
    }

    /// Nodes of a region.
    pub fn nodes_in(&self, region: &Region) -> Vec<u32> {
        self.grid.nodes_in(region)
    }
}
