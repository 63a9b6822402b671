//! The model: flat arrays that never change during a run, made from a scene; and the f64 state that backends hand back.

mod anchors;
pub mod element;
mod energy;
pub mod levels;
mod measures;
mod neo_hookean;
mod springs;
mod stable;
mod step;

pub use anchors::{Anchors, rate};
pub use energy::{Solved, elastic_energy, residual, true_residual};
pub use measures::{energy, inverted_cells};
pub use neo_hookean::{NeoHookean, tangent};
pub use springs::Springs;
pub use step::Step;

use crate::error::{Error, Result};
use crate::kernels::product::{Modes, tiles};
use crate::kernels::{GROUP, Params};
use crate::math::elementary::sin_cos;
use crate::math::{M3, Real, V4};
use crate::mesh::Grid;
use crate::scene::{Anchor, Cut, Element, Law, Layer, Load, MOST_NODES, Mass, Preconditioner, Region, Scene, Skin};

/// Layers that one uniform binding of element matrices holds (64 KiB of core WebGPU / 3 KiB each).
pub const MAX_LAYERS: usize = 21;

/// A deformable body on a grid.
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
    /// `[layer]` elastic strain at rest along x, y, z, and 0.
    pub pre_strain: Vec<[f64; 4]>,
    /// `[layer]` element matrices, N/m; empty for a spring body.
    pub stiffness: Vec<element::Matrix>,
    /// The law of a neo-Hookean body; its `stiffness` is that of small strains.
    pub neo_hookean: Option<NeoHookean>,
    /// Springs of a spring body.
    pub springs: Option<Springs>,
    /// Corotational bricks.
    pub corotational: bool,
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
    /// Columns of copies that a cut may split nodes into ([`crate::kernels::split`]).
    pub extra_columns: usize,
    /// Step, gravity, damping, preconditioner.
    pub step: Step,
    /// Coarse levels, when the preconditioner is multigrid.
    pub multigrid: Option<Multigrid>,
    /// The CPU path solves by an exact factor.
    pub direct: bool,
}

/// What multigrid adds to a body of bricks.
#[derive(Clone, Debug)]
pub struct Multigrid {
    /// Upper bound of the eigenvalues of `M⁻¹A` on the finest level.
    pub largest: f64,
    /// Levels below the finest, finer first.
    pub coarse: Vec<levels::Level>,
}

/// State of a body in f64, for output and checks.
#[derive(Clone, Debug, Default)]
pub struct State {
    /// `[node]` displacement, m.
    pub u: Vec<[f64; 3]>,
    /// `[node]` m/s
    pub v: Vec<[f64; 3]>,
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

/// Columns of copies of a body that a blade may cut.
fn reserve(scene: &Scene, skin: &Skin) -> usize {
    let blade = scene.tools.iter().any(|t| t.blade.is_some());
    match (skin.cut, skin.law) {
        (Cut::Split { reserve_columns }, Law::Fem { .. }) if blade => reserve_columns as usize,
        _ => 0,
    }
}

/// See [`Model::splitting`].
fn splitting(law: Law, layer: &Layer) -> f64 {
    match law {
        Law::Springs { .. } => f64::INFINITY,
        _ => {
            let modulus = layer.young / (1.0 - layer.poisson * layer.poisson);
            (std::f64::consts::FRAC_PI_2 * modulus * layer.toughness).sqrt()
        }
    }
}

impl Model {
    /// Builds the arrays of a scene's deformable body of that number.
    ///
    /// # Errors
    /// [`Error::TooLarge`] for more layers than a uniform binding holds or more nodes than 32-bit indices reach; [`Error::Usage`] for
    /// multigrid or the direct solver on springs, the direct solver where nodes may be split, or anchors on a consistent mass.
    pub fn new(scene: &Scene, body: usize) -> Result<Self> {
        let skin = &scene.skins[body];
        let grid = Grid::new(skin);
        // limits of uniform bindings and of 32-bit indices
        if skin.layers.len() > MAX_LAYERS {
            return Err(Error::TooLarge {
                what: "the layers' element matrices".into(),
                need: skin.layers.len() as u64,
                limit_name: "layers in one uniform binding",
                limit: MAX_LAYERS as u64,
                fix: "join layers of the same material".into(),
            });
        }
        let extra_columns = reserve(scene, skin);
        if extra_columns > 0 && scene.solver.preconditioner == Preconditioner::Direct {
            return Err(Error::Usage {
                what: "the direct solver's matrix has no room for nodes that a blade splits".into(),
                fix: "take cut = \"remove\" or the preconditioner multigrid".into(),
            });
        }
        let columns = (skin.cells[0] as u64 + 1) * (skin.cells[1] as u64 + 1) + extra_columns as u64;
        let indexed = columns * grid.nodes[2] as u64;
        if indexed > u64::from(MOST_NODES) {
            return Err(Error::TooLarge {
                what: "the grid's nodes".into(),
                need: indexed,
                limit_name: "nodes reached by 32-bit indices",
                limit: u64::from(MOST_NODES),
                fix: "use fewer cells".into(),
            });
        }
        // what the law and the mass do not go with
        let for_bricks = match scene.solver.preconditioner {
            Preconditioner::Multigrid => Some("multigrid"),
            Preconditioner::Direct => Some("the direct solver"),
            _ => None,
        };
        if let (Law::Springs { .. }, Some(name)) = (skin.law, for_bricks) {
            return Err(Error::Usage {
                what: format!("{name} is for bricks; this skin is of springs"),
                fix: "take the preconditioner column".into(),
            });
        }
        let anchors: Vec<Anchor> = scene.anchors.iter().filter(|a| a.body == body).cloned().collect();
        if skin.mass == Mass::Consistent && !anchors.is_empty() {
            return Err(Error::Usage {
                what: "anchors act through the masses of nodes; this skin's mass is consistent".into(),
                fix: "take a lumped or uniform mass".into(),
            });
        }
        // one element matrix per layer: all its cells are alike
        let mut shape = vec![];
        let mut stiffness = vec![];
        for (index, layer) in skin.layers.iter().enumerate() {
            let h = grid.cell_edges(index as u32);
            shape.push([h[0], h[1], h[2], layer.density * h[0] * h[1] * h[2] / 8.0]);
            let element = match skin.law {
                Law::Fem { element, .. } => element,
                Law::NeoHookean => Element::Bbar,
                Law::Springs { .. } => continue,
            };
            stiffness.push(element::stiffness(h, layer.young, layer.poisson, element));
        }
        // masses of the nodes: an eighth of each cell at its corners, or the same everywhere
        let params = grid.params::<f64>();
        let count = grid.node_count();
        let mut free = vec![[1.0, 1.0, 1.0, 0.0]; count];
        for cell in 0..grid.cell_count() {
            let layer = grid.layer_of[params.cell_at(cell)[2]] as usize;
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
        let springs = match skin.law {
            Law::Springs { stiffness, damping } => Some(Springs::new(&grid, stiffness, damping)),
            Law::Fem { .. } | Law::NeoHookean => None,
        };
        // room for the nodes that a cut duplicates
        free.resize(count + extra_columns * grid.nodes[2], [0.0; 4]);
        let inside = |region: &Region| (0..count).filter(|n| grid.contains(region, *n)).map(|n| n as u32).collect();
        let anchors = Anchors::new(&anchors, |anchor| inside(&anchor.region));
        let step = Step::new(scene, skin);
        let in_system = anchors.all_in_system(rate(&step), &free);
        // coarse levels of the V-cycle
        let solved = |by| !step.explicit() && scene.solver.preconditioner == by;
        let multigrid = solved(Preconditioner::Multigrid).then(|| Multigrid {
            largest: levels::largest(&stiffness).max(if skin.mass == Mass::Consistent { levels::OF_MASS } else { 1.0 }),
            coarse: levels::levels(&grid, &stiffness, &in_system[..count]),
        });
        Ok(Self {
            multigrid,
            direct: solved(Preconditioner::Direct),
            rest: (0..count).map(|n| [0, 1, 2].map(|a| grid.rest(n)[a] + skin.position[a])).collect(),
            position: skin.position,
            body,
            shape,
            pre_strain: skin.layers.iter().map(|l| element::pre_strain(l.pre_strain, l.poisson)).collect(),
            stiffness,
            neo_hookean: NeoHookean::of(scene, skin, &grid),
            springs,
            mass: skin.mass,
            corotational: matches!(skin.law, Law::Fem { corotational: true, .. } | Law::NeoHookean),
            free,
            anchors,
            held,
            extra_columns,
            toughness: skin.layers.iter().map(|l| l.toughness).collect(),
            splitting: skin.layers.iter().map(|l| splitting(skin.law, l)).collect(),
            step,
            grid,
        })
    }

    /// Nodes of the grid and the reserve of copies.
    pub fn node_count(&self) -> usize {
        self.grid.node_count() + self.extra_columns * self.grid.nodes[2]
    }

    /// The kernels' parameter block.
    pub fn params<R: Real>(&self) -> Params<R> {
        let s = &self.step;
        let split = self.extra_columns * self.grid.nodes[2];
        let touched = if split > 0 { TOUCHED * split + AROUND } else { 0 };
        Params {
            node_count: self.node_count() as u32,
            extra_columns: self.extra_columns as u32,
            split_cells: if split > 0 { CELLS * split + AROUND } else { 0 } as u32,
            touched_nodes: touched as u32,
            preconditioner: s.preconditioner,
            corotational: u32::from(self.corotational),
            slot_count: 1,
            product_groups: if self.springs.is_some() {
                self.grid.node_count().div_ceil(GROUP as usize) as u32
            } else {
                // and what split cells, or cells with tangents of their own, add
                let more = if self.neo_hookean.is_some() { self.node_count() } else { touched };
                (tiles(&self.grid.params::<f64>()) + more.div_ceil(GROUP as usize)) as u32
            },
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

    /// `[layer × 64]` 3×3 blocks of the element matrices, for elastic forces.
    pub fn stiffness_blocks<R: Real>(&self) -> Vec<M3<R>> {
        element::blocks(&self.stiffness)
    }

    /// `[layer × 64]` 3×3 blocks of what the system matrix has of a cell beside the masses of nodes.
    pub fn system_blocks<R: Real>(&self) -> Vec<M3<R>> {
        element::blocks(&self.system())
    }

    /// `[layer]` what the system matrix has of a cell beside the masses of nodes, less the factor `s`: K, and with a consistent mass what
    /// lumping it has put too much on the nodes. Blocks of M are multiples of the identity, so it turns with K.
    pub fn system(&self) -> Vec<element::Matrix> {
        let mut all = self.stiffness.clone();
        if self.mass == Mass::Consistent {
            let params = self.params::<f64>();
            for (k, shape) in all.iter_mut().zip(&self.shape) {
                let lumping = element::lumping(shape[3] * params.inertia / params.stiffness_factor);
                k.as_flattened_mut().iter_mut().zip(lumping.as_flattened()).for_each(|(k, m)| *k -= m);
            }
        }
        all
    }

    /// `[layer]` the same in mirror blocks, for products.
    pub fn modes<R: Real>(&self) -> Vec<Modes<R>> {
        element::rounded_modes(&self.system())
    }

    /// `[layer]` cell edges and corner mass.
    pub fn shapes<R: Real>(&self) -> Vec<V4<R>> {
        self.shape.iter().map(|s| s.map(R::of)).collect()
    }

    /// `[layer]` elastic strain at rest.
    pub fn pre_strains<R: Real>(&self) -> Vec<V4<R>> {
        self.pre_strain.iter().map(|e| e.map(R::of)).collect()
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
        let of_springs =
            |s: &Springs| size_of_val(&s.ends[..]) + size_of_val(&s.law[..]) + 4 * s.first.len() + 8 * s.half.len();
        let springs = self.springs.as_ref().map_or(0, of_springs);
        let nodes = size_of_val(&self.rest[..]) + size_of_val(&self.free[..]) + size_of_val(&self.held[..]);
        let anchors = size_of_val(&self.anchors.nodes[..]) + size_of_val(&self.anchors.stiffness[..]);
        let layers = size_of_val(&self.shape[..]) + size_of_val(&self.pre_strain[..]);
        (nodes + springs + anchors + size_of_val(&self.stiffness[..]) + layers) as u64
    }

    /// Nodes of a region.
    pub fn nodes_in(&self, region: &Region) -> Vec<u32> {
        (0..self.grid.node_count()).filter(|n| self.grid.contains(region, *n)).map(|n| n as u32).collect()
    }
}
