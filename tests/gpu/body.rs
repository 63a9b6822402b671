//! A random body in SI units, about as soft and as large as skin: every array that a kernel may ask for, by the shader's name.
//!
//! Each array is made from its name and the seed when it is asked for, so that a kernel and its twin see the same numbers. One cell is
//! dead, some axes are held, one spring has no length, one right-hand side in eight is done. What a kernel overwrites starts as noise.

use cutis::bodies::MAX_LAYERS;
use cutis::bodies::springs::Springs;
use cutis::bodies::tetrahedra::operator::Arrays;
use cutis::error::Result;
use cutis::gpu::{Buffer, Gpu};
use cutis::kernels::bounds;
use cutis::kernels::hyperelastic::STIFFENED;
use cutis::kernels::probe;
use cutis::kernels::product::{Modes, tiles};
use cutis::kernels::{GROUP, Params};
use cutis::math::random;
use cutis::math::{M3, Real, V3, V4};
use cutis::mesh::{Grid, Parts};

/// Sizes and seed; the rest follows.
pub struct Body {
    /// The kernel that runs on it.
    pub kernel: &'static str,
    /// Right-hand sides of a solve.
    pub rhs_count: usize,
    /// First right-hand side that a dispatch works on.
    pub first_rhs: usize,
    /// Geometry.
    pub grid: Grid,
    /// Springs between all corners of each cell.
    pub springs: Springs,
    /// Six tetrahedra in each cell.
    pub tetrahedra: Arrays<f64>,
    /// Springs that are no segments, beside every fifth.
    pub no_segments: Vec<usize>,
    /// Split nodes, for kernels that know of them.
    pub parts: Parts,
    seed: u64,
}

/// Quads of the swept edge.
const QUADS: usize = 6;
/// Nodes of a body without cells.
const ROW: usize = 150;
/// Layers of a body.
const LAYERS: usize = 3;

/// Fills the list of hits; f32 holds it exactly, and every hit before it.
pub const NO_HIT: u32 = 1 << 24;

/// An array as the device holds it.
pub enum Array {
    /// f32
    Real(Vec<f32>),
    /// u32
    Count(Vec<u32>),
}

/// alpha, beta, gamma, done, target², rr, iterations, state of a right-hand side, by what `advance` makes of it; see [`REQUESTS`] too.
#[rustfmt::skip]
const SCALARS: [[f32; 8]; 8] = [
    [2.0, 0.7, 3.0, 0.0, 1e-9, 0.5, 7.0, 3.0], // goes on
    [2.0, 0.7, 3.0, 1.0, 1e-9, 0.5, 7.0, 3.0], // is done
    [1.0, 0.0, 0.0, 0.0, 1e-9, 0.0, 0.0, 1.0], // first iteration
    [2.0, 0.0, 3.0, 0.0, 1e-9, 0.5, 1.0, 2.0], // second iteration
    [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],  // starts, measured against the load
    [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],  // starts, measured against the request
    [2.0, 0.7, 3.0, 0.0, 1e9, 0.5, 7.0, 3.0],  // has converged
    [2.0, 0.7, 3.0, 0.0, 1e-9, 0.5, 7.0, 3.0], // breaks down: negative curvature
];
/// tolerance², reference², floor², use_load of the same right-hand sides.
#[rustfmt::skip]
const REQUESTS: [[f32; 4]; 8] = [
    [1e-6, 3.0, 1e-9, 0.0], [1e-6, 3.0, 1e-9, 0.0], [1e-6, 3.0, 1e-9, 2.0], [1e-6, 3.0, 1e-9, 0.0],
    [1e-6, 3.0, 1e-9, 1.0], [1e-6, 3.0, 1e-2, 0.0], [1e-6, 3.0, 1e-9, 0.0], [1e-6, 3.0, 1e-9, 0.0],
];

/// Numbers in −1 to 1, the same on every machine.
struct Random(random::Random);

impl Random {
    fn new(seed: u64) -> Self {
        Self(random::Random::new(seed))
    }
    fn next(&mut self) -> f32 {
        ((self.0.bits() >> 40) as f32) / ((1u32 << 23) as f32) - 1.0
    }
    fn many(&mut self, count: usize, scale: f32) -> Vec<f32> {
        (0..count).map(|_| scale * self.next()).collect()
    }
    /// Three numbers and a zero each.
    fn vectors(&mut self, count: usize, scale: f32) -> Vec<f32> {
        (0..count).flat_map(|_| [0; 3].map(|_| scale * self.next()).pad()).collect()
    }
}

trait Pad {
    fn pad(self) -> V4<f32>;
}
impl Pad for [f32; 3] {
    fn pad(self) -> V4<f32> {
        [self[0], self[1], self[2], 0.0]
    }
}

/// Nodes that a body has beyond those of its auxiliary grid, or the grid beyond the body's.
pub const BESIDE: usize = 5;

/// Lists of none to three members.
fn lists(count: usize, members: usize) -> (Vec<u32>, Vec<u32>) {
    let length = |list: usize| list % 4;
    let first = (0..=count).map(|list| (0..list).map(length).sum::<usize>() as u32).collect();
    let of = |list: usize| (0..length(list)).map(move |k| ((13 * list + 7 * k) % members) as u32);
    (first, (0..count).flat_map(of).collect())
}

impl Body {
    /// A body of some cells; without any, its nodes are in a row.
    pub fn new(kernel: &'static str, cells: [usize; 3], rhs_count: usize, first_rhs: usize, seed: u64) -> Self {
        let grid = Grid {
            cells,
            nodes: if cells == [0; 3] { [ROW, 1, 1] } else { cells.map(|c| c + 1) },
            edge: [1e-3, 1.1e-3],
            heights: (0..=cells[2]).map(|k| 4e-4 * k as f64).collect(),
            layer_of: (0..cells[2]).map(|k| (k * LAYERS / cells[2]) as u32).collect(),
            unstructured: None,
            embedded: None,
        };
        let (parts, springs) = (parts(kernel, &grid, seed), Springs::between_corners(&grid, 50.0, 0.05));
        let rest: Vec<[f64; 3]> = (0..grid.node_count()).map(|node| grid.rest(node)).collect();
        let moduli = [0.8, 1.0, 1.3].map(|c| [9e4 * c, 1e4 * c]);
        let tetrahedra = Arrays::new(&rest, &grid.tetrahedra(), &moduli, true);
        Self { kernel, rhs_count, first_rhs, springs, tetrahedra, no_segments: vec![], grid, parts, seed }
    }

    /// What the grid kernels know of it.
    pub fn params<R: Real>(&self) -> Params<R> {
        Params {
            preconditioner: 3,
            // one of the bodies takes factors of the stiffness
            corotational: if self.grid.cells[0] == 7 { STIFFENED } else { 1 },
            rhs_count: self.rhs_count as u32,
            first_rhs: self.first_rhs as u32,
            tetrahedron_count: self.tetrahedra.corners.len() as u32,
            domain_count: self.tetrahedra.shear.len() as u32,
            total: u32::from(self.first_rhs == 0),
            product_groups: self.product_groups() as u32,
            inertia: R::of(1_010_000.0),
            stiffness_factor: R::of(11.0),
            step: R::of(f64::from(1e-3f32)),
            momentum_factor: R::of(1.75),
            velocity_factor: R::of(1.5),
            lead_time: R::of(0.0625),
            fresh: u32::from(self.first_rhs > 0),
            compensated: u32::from(self.rhs_count > 3),
            keep: R::of(0.375),
            gain: R::of(0.75),
            gravity_x: R::of(0.5),
            gravity_y: R::of(-0.25),
            gravity_z: R::of(-9.75),
            ..reserved(self.kernel, &self.grid)
        }
    }

    /// First value that is gathered.
    pub const FIRST: u32 = 3;

    /// The uniform `params` of a kernel.
    fn words(&self) -> Vec<u32> {
        let segments = self.springs.ends.len() as u32;
        match self.kernel {
            "cut" => vec![segments, QUADS as u32, segments, 0],
            "rest_springs" | "prescribe" => vec![self.ids().len() as u32, 0, 0, 0],
            "scatter" => vec![self.ids().len() as u32, 1, 0, 0],
            "gather" => vec![self.ids().len() as u32 - Self::FIRST, Self::FIRST, 0, 0],
            "duplicate" => vec![self.copies().len() as u32, self.nodes() as u32, 0, 0],
            "tetrahedra_means" => vec![self.nodes() as u32, 0, 0, 0],
            _ => self.params::<f32>().words(),
        }
    }

    fn params_of_split(&self) -> Params<f64> {
        reserved(self.kernel, &self.grid)
    }

    /// Nodes of the grid and the reserve for copies.
    pub fn nodes(&self) -> usize {
        self.params_of_split().node_count as usize
    }

    /// The table of split nodes; a word where there is none.
    pub fn split(&self) -> Vec<u32> {
        if self.parts.table().is_empty() { vec![0] } else { self.parts.table().to_vec() }
    }

    /// Pairs of nodes, none of them twice.
    pub fn copies(&self) -> Vec<[u32; 2]> {
        self.ids().chunks_exact(2).map(|pair| [pair[0], pair[1]]).collect()
    }

    /// Workgroups of the product.
    pub fn product_tiles(&self) -> usize {
        tiles(&self.grid.params::<f64>())
    }

    /// Partial sums of the product, per right-hand side.
    pub fn product_groups(&self) -> usize {
        match self.kernel {
            "collect_product" => self.product_tiles() + self.node_groups(),
            "product" | "split_product" => {
                self.product_tiles() + (self.params_of_split().touched_nodes as usize).div_ceil(GROUP as usize)
            }
            _ => self.node_groups(),
        }
    }
    /// Groups of 64 over nodes.
    pub fn node_groups(&self) -> usize {
        self.nodes().div_ceil(GROUP as usize)
    }
    /// Groups of 64 over columns.
    pub fn column_groups(&self) -> usize {
        self.columns().div_ceil(GROUP as usize)
    }
    /// Columns of nodes.
    pub fn columns(&self) -> usize {
        let params = self.params_of_split();
        params.columns() + params.extra_columns as usize
    }

    /// Tiles whose displacements are bounded.
    pub fn tiles(&self) -> usize {
        bounds::tile_count(&self.params::<f64>())
    }

    /// Cells of the next coarser level.
    pub fn coarse_cells(&self) -> usize {
        self.params::<f64>().coarse_cells().iter().product()
    }
    /// Quaternions and rows of its cells.
    pub fn coarse_frames(&self) -> usize {
        self.params::<f64>().frames() / self.grid.cell_count() * self.coarse_cells()
    }
    /// Nodes of the next coarser level.
    pub fn coarse_nodes(&self) -> usize {
        self.params::<f64>().coarse_cells().iter().map(|c| c + 1).product()
    }

    /// Three of four nodes in random order, each once.
    pub fn ids(&self) -> Vec<u32> {
        let mut ids: Vec<u32> = (0..self.grid.node_count() as u32).collect();
        let mut random = Random::new(self.seed);
        for k in (1..ids.len()).rev() {
            ids.swap(k, (0.5 * (random.next() + 1.0) * k as f32) as usize);
        }
        ids.truncate((ids.len() * 3).div_ceil(4));
        ids
    }

    /// An array by its name in the shaders.
    pub fn array(&self, name: &str) -> Array {
        match name {
            "ids" => Array::Count(self.ids()),
            "layer_of" => Array::Count(self.grid.layer_of.clone()),
            "corners" => Array::Count(self.tetrahedra.corners.concat()),
            "first" if self.kernel == "tetrahedra_means" => Array::Count(self.tetrahedra.first_of_node.clone()),
            "first_of_node" => Array::Count(self.tetrahedra.first_of_node.clone()),
            "members" | "of_node" => Array::Count(self.tetrahedra.of_node.clone()),
            "first_of_domain" => Array::Count(self.tetrahedra.first_of_domain.clone()),
            "of_domain" => Array::Count(self.tetrahedra.of_domain.clone()),
            "domains" => Array::Count(self.tetrahedra.domains.clone()),
            "first" => Array::Count(self.springs.first.clone()),
            "half" => Array::Count(self.springs.half.concat()),
            "ends" => Array::Count(self.segments().concat()),
            "hits" => Array::Count(vec![NO_HIT; 2 * self.springs.ends.len()]),
            "hit_count" => Array::Count(vec![0; 4]),
            "split" => Array::Count(self.split()),
            "pairs" => Array::Count(self.copies().concat()),
            "first_of_cell" => Array::Count(self.in_cells().0),
            "in_cell" => Array::Count(self.in_cells().1),
            "first_around" | "first_weight" => Array::Count(self.weighted().0),
            "around" | "weighted" => Array::Count(self.weighted().1),
            _ => Array::Real(self.reals(name)),
        }
    }

    /// Nodes in the cells, of an auxiliary grid that is the body's own.
    pub fn in_cells(&self) -> (Vec<u32>, Vec<u32>) {
        lists(self.grid.cell_count(), self.nodes())
    }

    /// For each node, nodes of another body that has [`BESIDE`] more.
    pub fn weighted(&self) -> (Vec<u32>, Vec<u32>) {
        lists(self.nodes(), self.nodes() + BESIDE)
    }

    /// Springs, of which every fifth and some more are no segments.
    fn segments(&self) -> Vec<[u32; 2]> {
        let none = |k: usize| k % 5 == 3 || self.no_segments.binary_search(&k).is_ok();
        let loops = |(k, [a, b]): (usize, &[u32; 2])| if none(k) { [*a, *a] } else { [*a, *b] };
        self.springs.ends.iter().enumerate().map(loops).collect()
    }

    fn reals(&self, name: &str) -> Vec<f32> {
        let (nodes, all) = (self.nodes(), self.nodes() * self.rhs_count.max(2));
        let seed = name.bytes().fold(self.seed, |s, c| s.wrapping_mul(31).wrapping_add(u64::from(c)));
        let mut random = Random::new(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15));
        random.next();
        let of = &self.tetrahedra;
        let (tetrahedra, domains) = (of.corners.len(), of.shear.len());
        match name {
            "gradients" => of.gradients.concat().iter().map(|c| *c as f32).collect(),
            "per_volume" => of.per_volume.iter().map(|c| *c as f32).collect(),
            "shear" if self.kernel != "tetrahedra_laws" => of.shear.concat().iter().map(|c| *c as f32).collect(),
            "rest_block" => of.rest_block.concat().iter().map(|c| *c as f32).collect(),
            "element_rotation" => (0..tetrahedra).flat_map(|_| turned(&mut random)).collect(),
            "domain_rotation" => (0..domains).flat_map(|_| turned(&mut random)).collect(),
            // q and −q are the same rotation
            "node_rotation" if self.kernel == "auxiliary_rotations" => {
                (0..nodes).flat_map(|node| turned(&mut random).map(|c| if node % 3 == 0 { -c } else { c })).collect()
            }
            "node_rotation" | "mean_rotation" => (0..nodes).flat_map(|_| turned(&mut random)).collect(),
            // with pressures of the size of the moduli
            "strain" if self.kernel == "tetrahedra_laws" => {
                let mut strain = random.many(12 * tetrahedra * self.rhs_count, 0.2);
                strain.iter_mut().skip(3).step_by(12).for_each(|pressure| *pressure *= 1e5);
                strain
            }
            "strain" => random.many(12 * tetrahedra * self.rhs_count, 0.2),
            "cofactor" => random.many(12 * tetrahedra, 1.0),
            "frame" => positive(&mut random, 4 * domains).map(|c| 1e4 * c).collect(),
            "laws" => (0..LAYERS)
                .flat_map(|layer| {
                    let [bulk, first, second] = [9e4, 1e4, 4e3].map(|c| c * (1.0 + 0.3 * random.next()));
                    let [second, code] = if layer % 2 == 1 { [second, 1.0] } else { [0.0; 2] };
                    [bulk, first, second, code]
                })
                .collect(),
            // layers in place of moduli
            "shear" if self.kernel == "tetrahedra_laws" => {
                let of_layer = |(k, [volume, _]): (usize, &[f64; 2])| [*volume as f32, (k % LAYERS) as f32];
                of.shear.iter().enumerate().flat_map(of_layer).collect()
            }
            "tetrahedron_force" => random.vectors(3 * tetrahedra * self.rhs_count, 0.01),
            "domain_stress" => random.vectors(3 * domains * self.rhs_count, 1e3),
            // volumes up to two and a half times as large, and flat
            "nodal_strain" if self.kernel == "tetrahedra_pressed" => random.many(nodes * self.rhs_count, 1.5),
            "nodal_strain" => random.many(nodes * self.rhs_count, 0.1),
            "pressure" => random.many(nodes * self.rhs_count, 1e4),
            "u" if self.kernel == "bounds" => nowhere(random.vectors(nodes, 1e-4)),
            "u" => coincide(random.vectors(nodes, 1e-4)),
            "tile_bounds" => random.many(self.tiles() * 8, 1.0),
            "displacement" => self.displacement(&mut random),
            // every law in turn
            "material" => (0..LAYERS)
                .flat_map(|layer| {
                    let [bulk, first, second] = [9e4, 1e4, 4e3].map(|c| c * (1.0 + 0.3 * random.next()));
                    match layer % 3 {
                        0 => [bulk, first, 0.0, 0.0],
                        1 => [bulk, first, second, 1.0],
                        _ => [bulk, first, second, 2.0],
                    }
                })
                .collect(),
            "fibres" => (0..LAYERS)
                .flat_map(|_| {
                    let [x1, x2, growth, dispersion] = [0.6, 0.8, 3.0, 0.1].map(|c| c * (1.0 + 0.2 * random.next()));
                    let across = |x: f32| (1.0 - x * x).sqrt();
                    [x1, across(x1), -x2, across(x2), growth, dispersion, 0.0, 0.0]
                })
                .collect(),
            // one for all of some grids
            "scale" if self.grid.cells[0] == 7 && self.kernel != "auxiliary_rotations" => vec![1.3; 4],
            "scale" => (0..self.grid.cell_count()).map(|_| 1.0 + 0.7 * random.next()).collect(),
            "corner_force" => random.many(self.grid.cell_count() * 24 * self.rhs_count, 0.01),
            "energy" => random.many(self.grid.cell_count(), 1e-6),
            "predicted_decrease" => random.many(self.node_groups(), 1e-6),
            "potential_and_residual" => random.many(self.node_groups() * 4, 1e-6),
            "dx" | "dx_next" => random.vectors(nodes, 1e-4),
            "residual_force" => random.vectors(nodes, 0.01),
            "point_u" if self.kernel == "tetrahedra_centres" => random.vectors(tetrahedra, 3e-4),
            "point_u" | "point_before" => random.vectors(nodes, 3e-4),
            "v" | "mean_v" => random.vectors(nodes, 0.1),
            "y" => random.vectors(nodes, 1e-2),
            "f" | "f_end" | "load" => random.vectors(nodes, 0.01),
            "z" | "x" | "p" | "d" => random.vectors(all, 1e-4),
            "coarse_z" => random.vectors(self.coarse_nodes() * self.rhs_count, 1e-4),
            "coarse_r" => random.vectors(self.coarse_nodes() * self.rhs_count, 0.01),
            "coarse_rotation" => random.many(self.coarse_frames() * 4, 1.0),
            "r" if self.kernel == "auxiliary_restriction" => random.vectors((nodes + BESIDE) * self.rhs_count, 0.01),
            "w" | "r" | "s" | "b" => random.vectors(all, 0.01),
            "values" if self.kernel == "duplicate" => random.many(all * 4, 1.0),
            "source" | "values" | "picked" | "destination" => random.many(nodes * 4, 1.0),
            "spring_stiffness" => positive(&mut random, self.ids().len()).map(|k| 100.0 * k).collect(),
            "rest" => self.rest(&mut random),
            "shape" => {
                (0..LAYERS).flat_map(|_| [1e-3, 1.1e-3, 4e-4, 1e-7].map(|c| c * (1.0 + 0.3 * random.next()))).collect()
            }
            "pre_strain" => random.vectors(LAYERS, 0.3),
            "stiffness" => random.vectors(LAYERS * 64 * 3, 100.0),
            "modes" => (0..LAYERS * 8).flat_map(|_| symmetric(&mut random)).collect(),
            "rotation" => self.rotation(&mut random),
            "weight" | "weight_around" => random.many(self.weighted().1.len(), 1.0),
            "auxiliary_r" => random.vectors(all, 0.01),
            "auxiliary_z" => random.vectors((nodes + BESIDE) * self.rhs_count, 1e-4),
            "dofs" | "coarse_dofs" | "auxiliary_dofs" => (0..nodes)
                .flat_map(|_| {
                    let axes = [0; 3].map(|_| if random.next() < 0.7 { 1.0 } else { 0.0 });
                    [axes[0], axes[1], axes[2], 1e-6 * (2.0 + random.next())]
                })
                .collect(),
            "block" => (0..nodes).flat_map(|_| block(&mut random)).collect(),
            "tangent" => (0..self.springs.half.len())
                .flat_map(|_| {
                    let t = random.many(6, 100.0);
                    [t[0], t[1], t[2], t[3], t[4], t[5], 0.0, 0.0]
                })
                .collect(),
            "law" => (0..self.springs.ends.len())
                .flat_map(|_| {
                    let mut near = |mean: f32| mean * (1.0 + 0.5 * random.next());
                    [near(1e-4) - 1e-4, near(50.0), near(0.05), 0.0]
                })
                .collect(),
            "quads" => random.vectors(QUADS * 4, 3e-3).iter().map(|c| c + 1e-3).collect(),
            "scalars" => SCALARS[..self.rhs_count].concat(),
            "requests" => REQUESTS[..self.rhs_count].concat(),
            "partial_product" => {
                let groups = self.product_groups();
                let sign = |k: usize| if k / groups == 7 { -1.0 } else { 1.0 };
                // what the kernel leaves to another one is zero
                let own = |k: usize| match self.kernel {
                    "product" => k % groups < self.product_tiles(),
                    "split_product" | "collect_product" => k % groups >= self.product_tiles(),
                    _ => true,
                };
                let all = positive(&mut random, self.rhs_count * groups).enumerate();
                all.map(|(k, c)| if own(k) { c * sign(k) } else { 0.0 }).collect()
            }
            "partial_gamma" => positive(&mut random, self.rhs_count * self.column_groups()).collect(),
            "cases" => probe::cases().concat(),
            "errors" => random.many(probe::CASES, 1.0),
            "partial_residual" => positive(&mut random, self.rhs_count * self.node_groups()).collect(),
            "partial_load" => positive(&mut random, self.node_groups()).collect(),
            _ => panic!("no array is called `{name}`; give it a shape and a scale here"),
        }
    }

    fn rest(&self, random: &mut Random) -> Vec<f32> {
        let near = |c: f64, r: f32| c as f32 + 1e-4 * r;
        let nodes = (0..self.grid.node_count()).map(|n| self.grid.rest(n));
        coincide(nodes.flat_map(|p| p.map(|c| near(c, random.next())).pad()).collect())
    }

    /// Strains up to some 20 %; in a larger body nodes are beyond their neighbours, so that cells around them are inverted, and a corner far
    /// up, so that one has more than twice its volume.
    fn displacement(&self, random: &mut Random) -> Vec<f32> {
        let mut displacement = random.vectors(self.nodes(), 2e-5);
        let last = displacement.len();
        if self.grid.cell_count() > 100 {
            displacement[4 * (self.nodes() / 2) + 2] = -3e-3;
            // one in each layer, whose laws differ
            let levels = self.grid.cells[2];
            for layer in 0..LAYERS {
                let node = self.params::<f32>().node_id([2, 2, (layer + 1) * levels / LAYERS]);
                displacement[4 * node + 2] = -8e-4;
            }
            (0..4).for_each(|n| displacement[last - 4 + n] = [4e-4, 4e-4, 2e-3, 0.0][n]);
        }
        displacement
    }

    fn rotation(&self, random: &mut Random) -> Vec<f32> {
        let cells = self.grid.cell_count();
        let unit = |q: [f32; 4]| q.map(|c| c / q.iter().map(|c| c * c).sum::<f32>().sqrt());
        let rows = if self.kernel == "rotations" { 0 } else { self.params::<f64>().frames() - cells };
        let quaternions = (0..cells)
            .flat_map(|cell| {
                let [x, y, z] = [0; 3].map(|_| 0.5 * random.next());
                // a coarse level's cells may be short, and either sign is the same rotation
                let size = if self.kernel == "coarsen" { [1.0, 0.8, -0.9][cell % 3] } else { 1.0 };
                // a cell of its own is alive
                if cell > 0 && cell == cells / 2 { [0.0; 4] } else { unit([x, y, z, 1.0]).map(|c| c * size) }
            })
            .collect::<Vec<_>>();
        // stiffness of the volume and of tension
        let linearised = (0..4 * rows).map(|_| 5.0 * random.next()).collect::<Vec<f32>>();
        [quaternions, linearised].concat()
    }

    /// An array of numbers, for the twin.
    pub fn scalars<R: Real>(&self, name: &str) -> Vec<R> {
        self.reals(name).iter().map(|c| R::of(f64::from(*c))).collect()
    }
    /// An array of vec4, for the twin.
    pub fn v4<R: Real>(&self, name: &str) -> Vec<V4<R>> {
        self.scalars(name).chunks_exact(4).map(|c| [c[0], c[1], c[2], c[3]]).collect()
    }
    /// The element matrices, for the twin.
    pub fn stiffness<R: Real>(&self) -> Vec<M3<R>> {
        let columns = self.v4("stiffness");
        columns.chunks_exact(3).map(|c| M3([c[0], c[1], c[2]].map(V3::from4))).collect()
    }
    /// The element matrices in mirror blocks, for the twin.
    pub fn modes<R: Real>(&self) -> Vec<Modes<R>> {
        let rows: Vec<[R; 3]> = self.v4("modes").iter().map(|c| [c[0], c[1], c[2]]).collect();
        let block = |k: usize, parity: usize| std::array::from_fn(|row| rows[(k * 8 + parity) * 3 + row]);
        (0..LAYERS).map(|k| std::array::from_fn(|parity| block(k, parity))).collect()
    }
    /// An array of pairs of numbers, for the twin.
    pub fn v2<R: Real>(&self, name: &str) -> Vec<[R; 2]> {
        self.scalars(name).chunks_exact(2).map(|c| [c[0], c[1]]).collect()
    }
    /// An array of id pairs, for the twin.
    pub fn pairs(&self, name: &str) -> Vec<[u32; 2]> {
        match name {
            "half" => self.springs.half.clone(),
            _ => self.segments(),
        }
    }

    /// An array on the device.
    pub fn upload(&self, gpu: &Gpu, name: &str) -> Result<Buffer> {
        let uniform = |bytes| match self.array(name) {
            Array::Real(data) => gpu.uniform("uniform", bytes, &data),
            Array::Count(data) => gpu.uniform("uniform", bytes, &data),
        };
        match name {
            "params" => Ok(gpu.uniform("params", 0, &self.words())),
            "shape" | "material" | "laws" | "pre_strain" => Ok(uniform(MAX_LAYERS * 16)),
            "fibres" => Ok(uniform(MAX_LAYERS * 32)),
            "stiffness" => Ok(uniform(MAX_LAYERS * 64 * 48)),
            "modes" => Ok(uniform(MAX_LAYERS * 8 * 48)),
            _ => match self.array(name) {
                Array::Real(data) => gpu.array_of("array", &data),
                Array::Count(data) => gpu.array_of("array", &data),
            },
        }
    }
}

/// Kernels that are tried on a body with split nodes.
const SPLIT: [&str; 15] = [
    "blocks",
    "bounds",
    "centres",
    "collect",
    "factor",
    "forces",
    "hyperelastic_forces",
    "momentum",
    "precondition",
    "product",
    "prolongation",
    "relax",
    "restriction",
    "rotations",
    "split_product",
];
/// Columns of copies: more than a bundle of them, and in the last one more than a group of `bounds`.
const EXTRA_COLUMNS: u32 = 43;

/// Sizes, with room for copies where the kernel knows of them.
fn reserved<R: Real>(kernel: &str, grid: &Grid) -> Params<R> {
    let params: Params<R> = grid.params();
    if !SPLIT.contains(&kernel) {
        return params;
    }
    let node_count = params.node_count + EXTRA_COLUMNS * params.nodes_z;
    Params { node_count, extra_columns: EXTRA_COLUMNS, split_cells: 400, touched_nodes: 700, ..params }
}

/// Planes across x, y and z that reach part of the way, and links here and there.
fn parts(kernel: &str, grid: &Grid, seed: u64) -> Parts {
    let params = reserved::<f64>(kernel, grid);
    let mut parts = Parts::new(params);
    let mut random = Random::new(seed);
    let middle = grid.cells.map(|c| (c / 2).max(1) - 1);
    let mut hits = vec![];
    for cell in 0..grid.cell_count() {
        let at = params.cell_at(cell);
        let upper = at[2] >= middle[2];
        let planes =
            [upper && at[1] <= middle[1] + 1, upper && at[0] <= middle[0], at[0] >= middle[0] && at[1] > middle[1]];
        for axis in 0..3 {
            if (at[axis] == middle[axis] && planes[axis]) || random.next() > 0.9 {
                hits.push(((3 * cell + axis) as u32, 0.5));
            }
        }
    }
    parts.cut(&hits);
    parts
}

/// Puts three nodes nowhere, the last two of them on the grid's last seams.
fn nowhere(mut nodes: Vec<f32>) -> Vec<f32> {
    let count = nodes.len();
    (nodes[1], nodes[count - 6], nodes[count - 4]) = (f32::NAN, f32::INFINITY, f32::NEG_INFINITY);
    nodes
}

/// Puts the second node onto the first.
fn coincide(mut nodes: Vec<f32>) -> Vec<f32> {
    nodes.copy_within(0..4, 4);
    nodes
}

/// 0.5 to 1.5, so that no sum is near zero.
fn positive(random: &mut Random, count: usize) -> impl Iterator<Item = f32> {
    (0..count).map(|_| 1.0 + 0.5 * random.next())
}

/// A rotation of up to some 60°.
fn turned(random: &mut Random) -> [f32; 4] {
    let q = [0.5 * random.next(), 0.5 * random.next(), 0.5 * random.next(), 1.0];
    q.map(|c| c / q.iter().map(|c| c * c).sum::<f32>().sqrt())
}

/// A symmetric matrix, by rows of four.
fn symmetric(random: &mut Random) -> [f32; 12] {
    let [a, b, c, d, e, f]: [f32; 6] = std::array::from_fn(|_| 100.0 * random.next());
    [a, b, c, 0.0, b, d, e, 0.0, c, e, f, 0.0]
}

/// A packed pair of blocks: `d` positive definite, `g` small beside it.
fn block(random: &mut Random) -> [f32; 16] {
    let mut k: [f32; 16] = std::array::from_fn(|_| 0.4 * random.next());
    for diagonal in [0, 3, 5] {
        k[diagonal] += 4.0;
    }
    k[15] = 0.0;
    k
}
