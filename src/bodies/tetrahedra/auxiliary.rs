//! Multigrid of hexahedra as the preconditioner of tetrahedra: an auxiliary space (Nepomnyaschikh 1991; Xu 1996, Computing 56:215).
//!
//! A grid of hexahedra covers the tetrahedra. Its nodes' displacements, interpolated to the body's nodes by `P`, are the smooth part of
//! a correction, found by one V-cycle `B_a` ([`crate::bodies::grid::multigrid`]); the inverse node blocks `M⁻¹` give the rest:
//! `z = P B_a Pᵀ r + M⁻¹ r`. Where the tetrahedra are those of a grid, it is that grid and `P` the identity.
//!
//! Of a mesh, the grid fills its box with cells as wide as six tetrahedra's cube. A level of cells has the material that fills most of it;
//! each cell's stiffness is scaled by the shear modulus of the tetrahedra in it over that of the full cell. A node of the grid is fixed
//! along an axis where most of the nodes near it are. A cut parts the grid as little as it parts coarse levels: a copy of a node has the
//! weights of its original.
//!
//! Iterations of the skin block on 20×20×5 and 40×40×5 cells, ν 0.49, to 10⁻³ and 10⁻⁶ of its weight, and the time of a static step (CPU
//! path, f64, two cores): 34 and 93, 35 and 91, 1.5 and 3.4 s on the finer one; with node blocks alone 132 and 316, 202 and 481, 4.8 and
//! 10.6 s. At ν 0.45 19 and 55. Dynamic steps of 5 ms of scenes/skin_tetra.toml, 1445 nodes: 24 iterations instead of 35, 0.95 of the time.
//!
//! Tried and not kept: the product of the two in place of their sum, with the same smoothing before and after (Chebyshev polynomials on
//! node blocks, bound 8 or 16 on their eigenvalues). Degrees 1, 2, 3 take 21, 16, 13 and 56, 40, 35 iterations on the coarser grid, of 3,
//! 5, 7 products each: 1.2 to 1.6 times as long.

use super::Tetrahedra;
use crate::bodies::{Kind, MAX_LAYERS, Model, grid};
use crate::error::Result;
use crate::kernels::Params;
use crate::mesh::{Grid, Unstructured, trilinear};
use crate::scene::{Element, Law, Layer, Mass, Preconditioner, Scene};

/// Share of the inverse node blocks in a correction. Iterations to 1e-3 and 1e-6 of the skin block on 20×20×5 cells at ν 0.49 with 2, 1, 0.5,
/// 0.3, 0.1: 45, 37, 34, 36, 46 and 116, 99, 93, 99, 129.
pub const GAIN: f64 = 0.5;
/// Weights that are left out.
const LEAST: f64 = 1e-9;
/// Least scale of the stiffness of a cell that holds anything.
const LEAST_SCALE: f64 = 0.01;
/// Points along an edge of a tetrahedron at which the cells around them take their shares: (n + 1)(n + 2)(n + 3)/6 in all.
const SAMPLES: usize = 3;

/// Lists of members with weights, one list after the other.
#[derive(Clone, Debug, Default)]
pub struct Lists {
    /// `[list + 1]`
    pub first: Vec<u32>,
    /// Members of all lists.
    pub members: Vec<u32>,
    /// `[member]`
    pub weight: Vec<f64>,
}

impl Lists {
    /// From pairs of list and member, with weights, in order of the lists.
    fn new(count: usize, mut pairs: Vec<(u32, u32, f64)>) -> Self {
        pairs.sort_by_key(|(list, member, _)| (*list, *member));
        let mut first = vec![0; count + 1];
        pairs.iter().for_each(|(list, ..)| first[*list as usize + 1] += 1);
        (0..count).for_each(|list| first[list + 1] += first[list]);
        let (members, weight) = pairs.iter().map(|(_, member, weight)| (*member, *weight)).unzip();
        Self { first, members, weight }
    }

    /// Members of a list with their weights.
    pub fn of(&self, list: usize) -> impl Iterator<Item = (usize, f64)> {
        let range = self.first[list] as usize..self.first[list + 1] as usize;
        self.members[range.clone()].iter().map(|m| *m as usize).zip(self.weight[range].iter().copied())
    }
}

/// Interpolation between a grid's nodes and a body's.
#[derive(Clone, Debug, Default)]
pub struct Transfer {
    /// `[node of the body]` nodes of the grid with their weights, `P`.
    pub weights: Lists,
    /// `[node of the grid]` nodes of the body, `Pᵀ`.
    pub around: Lists,
}

impl Transfer {
    /// From nodes of the body, nodes of the grid and weights, for these numbers of nodes.
    fn new([body, grid]: [usize; 2], pairs: Vec<(u32, u32, f64)>) -> Self {
        let back = pairs.iter().map(|(i, node, weight)| (*node, *i, *weight)).collect();
        Self { weights: Lists::new(body, pairs), around: Lists::new(grid, back) }
    }

    /// Has copies of nodes take the weights of those that they copy.
    pub fn copy(&mut self, copies: &[[u32; 2]]) {
        let mut source: Vec<usize> = (0..self.weights.first.len() - 1).collect();
        copies.iter().for_each(|[copy, of]| source[*copy as usize] = source[*of as usize]);
        let of = |(i, source): (usize, &usize)| {
            self.weights.of(*source).map(move |(member, weight)| (i as u32, member as u32, weight))
        };
        let pairs = source.iter().enumerate().flat_map(of).collect();
        *self = Self::new([source.len(), self.around.first.len() - 1], pairs);
    }
}

/// See the module.
#[derive(Clone, Debug)]
pub struct Auxiliary {
    /// The grid, as a body of hexahedra; its masses are those of the body's nodes, with their rest-shape springs.
    pub model: Model,
    /// Between the grid's nodes and the body's.
    pub transfer: Transfer,
    /// `[cell]` nodes of the body in it, for its rotation.
    pub in_cell: Lists,
    /// `[cell]` length of its quaternion, the fourth root of the scale of its stiffness; 0 where nothing is.
    pub scale: Vec<f64>,
    /// Length of the lists `in_cell`; all lists are empty in a model of sizes.
    pub inside: usize,
}

impl Auxiliary {
    /// Of a complete model, but for its preconditioner.
    ///
    /// # Errors
    /// As [`Model::new`].
    pub(in crate::bodies) fn new(scene: &Scene, of: &Model) -> Result<Self> {
        let cover = of.unstructured().map(|mesh| Cover::new(scene, of, mesh));
        let of_grid = scene_of_grid(scene, of.body, cover.as_ref());
        if of.counts.is_some() {
            let model = Model::of_sizes(&of_grid, of.body)?;
            let (transfer, in_cell) = (Transfer::default(), Lists::default());
            let inside = cover.map_or(8 * model.grid.cell_count(), |cover| cover.inside.len());
            return Ok(Self { model, transfer, in_cell, scale: vec![], inside });
        }
        let model = Model::new(&of_grid, of.body)?;
        let mut out = match (cover, of.unstructured()) {
            (Some(cover), Some(mesh)) => cover.fill(model, of, mesh),
            _ => Self::same_nodes(model, of),
        };
        out.model.step.static_inertia = of.step.static_inertia;
        out.take_masses(of);
        Ok(out)
    }

    /// Of tetrahedra in the cells of a grid.
    fn same_nodes(model: Model, of: &Model) -> Self {
        let (params, cells) = (model.params::<f64>(), model.grid.cell_count());
        let same = (0..of.own_nodes() as u32).map(|i| (i, i, 1.0)).collect();
        let transfer = Transfer::new([of.node_count(), model.own_nodes()], same);
        let corners = |cell: usize| params.corners(cell).map(|node| (cell as u32, node as u32, 1.0));
        let in_cell = Lists::new(cells, (0..cells).flat_map(corners).collect());
        Self { model, transfer, inside: in_cell.members.len(), in_cell, scale: vec![1.0; cells] }
    }

    /// Most weights that a body's nodes and their copies have.
    pub fn most_weights(of: &Model) -> usize {
        if of.unstructured().is_some() { 8 * of.node_count() } else { of.node_count() }
    }

    /// Masks and masses of the grid's nodes from those of the body's, and the levels below them.
    fn take_masses(&mut self, of: &Model) {
        let own = of.in_system();
        let present: Vec<bool> = self.scale.iter().map(|scale| *scale > 0.0).collect();
        let params = self.model.params::<f64>();
        let mut used = vec![false; self.model.own_nodes()];
        for cell in (0..present.len()).filter(|cell| present[*cell]) {
            params.corners(cell).into_iter().for_each(|node| used[node] = true);
        }
        for (i, dofs) in self.model.dofs.iter_mut().enumerate() {
            let (mut all, mut freed, mut mass) = (0.0, [0.0; 3], 0.0);
            for (node, weight) in self.transfer.around.of(i) {
                all += weight * weight;
                (0..3).for_each(|n| freed[n] += weight * weight * own[node][n]);
                mass += weight * own[node][3];
            }
            let [x, y, z] = freed.map(|freed| f64::from(u8::from(used[i] && 2.0 * freed > all)));
            *dofs = [x, y, z, if used[i] { mass } else { 0.0 }];
        }
        grid::prepare(&mut self.model, Preconditioner::Multigrid);
    }

    /// Size on the host, bytes.
    pub fn bytes(&self, of: &Model) -> usize {
        let (weights, nodes) = (Self::most_weights(of), of.node_count() + self.model.own_nodes());
        let entry = size_of::<u32>() + size_of::<f64>();
        let cells = self.model.grid.cell_count();
        let lists = (2 * weights + self.inside) * entry + (nodes + cells + 3) * size_of::<u32>();
        lists + cells * size_of::<f64>() + self.model.host_bytes() as usize
    }
}

/// The scene with hexahedra in place of a body's tetrahedra, and nothing that touches them.
fn scene_of_grid(scene: &Scene, body: usize, cover: Option<&Cover>) -> Scene {
    let mut scene = scene.clone();
    scene.tools.clear();
    scene.rest_springs.clear();
    scene.solver.preconditioner = Preconditioner::Multigrid;
    let skin = &mut scene.skins[body];
    skin.law = Law::Fem { element: Element::Bbar, corotational: true };
    skin.mass = Mass::Lumped;
    if let Some(cover) = cover {
        skin.mesh = None;
        skin.size = [0, 1].map(|n| cover.size[n]);
        skin.cells = [0, 1].map(|n| cover.cells[n] as u32);
        skin.layers.clone_from(&cover.layers);
    }
    scene
}

/// The grid over a mesh.
struct Cover {
    /// Lowest corner of the mesh in the body's frame, and the extent, m.
    low: [f64; 3],
    size: [f64; 3],
    cells: [usize; 3],
    layers: Vec<Layer>,
    /// `[level of cells]` shear modulus, Pa.
    shear: Vec<f64>,
    /// `[cell]` integral of the shear modulus over the tetrahedra in it, N·m.
    stiffness: Vec<f64>,
    /// Cells with the nodes that tetrahedra in them have there, each pair once.
    inside: Vec<(u32, u32)>,
}

impl Cover {
    fn new(scene: &Scene, of: &Model, mesh: &Unstructured) -> Self {
        let layers = &scene.skins[of.body].layers;
        let (nodes, tetrahedra) = (mesh.mesh.nodes(), mesh.mesh.tetrahedra());
        let fold = |pick: fn(f64, f64) -> f64, start: f64| {
            nodes.iter().fold([start; 3], |all, p| [0, 1, 2].map(|n| pick(all[n], p[n])))
        };
        let (low, high) = (fold(f64::min, f64::INFINITY), fold(f64::max, f64::NEG_INFINITY));
        let size = [0, 1, 2].map(|n| high[n] - low[n]);
        let width = mesh.mesh.cell_width();
        let cells = [0, 1, 2].map(|n| ((size[n] / width).round() as usize).max(1));
        let cells = [cells[0], cells[1], cells[2].min(MAX_LAYERS)];
        let shear = |layer: usize| layers[layer].young / (2.0 * (1.0 + layers[layer].poisson));
        // points of the tetrahedra: the cell around each takes its share, and the corner that it is nearest to
        let mut stiffness = vec![0.0; cells.iter().product()];
        let mut filled = vec![vec![0.0; layers.len()]; cells[2]];
        let (mut inside, mut own) = (vec![], vec![]);
        let points: Vec<[f64; 4]> = lattice();
        for (e, corners) in tetrahedra.iter().enumerate() {
            let (layer, volume) = (mesh.mesh.layers()[e] as usize, mesh.mesh.volume(e) / points.len() as f64);
            for weights in &points {
                let at = [0, 1, 2].map(|n| (0..4).map(|c| weights[c] * nodes[corners[c] as usize][n]).sum::<f64>());
                let of_axis = |n: usize| (((at[n] - low[n]) / size[n] * cells[n] as f64) as usize).min(cells[n] - 1);
                let [x, y, z] = [0, 1, 2].map(of_axis);
                let cell = x + cells[0] * (y + cells[1] * z);
                let nearest = (0..4).max_by(|a, b| weights[*a].total_cmp(&weights[*b])).unwrap_or(0);
                filled[z][layer] += volume;
                stiffness[cell] += volume * shear(layer);
                own.push((cell as u32, corners[nearest]));
            }
            own.sort_unstable();
            own.dedup();
            inside.append(&mut own);
        }
        inside.sort_unstable();
        inside.dedup();
        // of each level the layer that fills most of it
        let most = |filled: &Vec<f64>| (0..layers.len()).max_by(|a, b| filled[*a].total_cmp(&filled[*b])).unwrap_or(0);
        let of_level: Vec<usize> = filled.iter().map(most).collect();
        let height = size[2] / cells[2] as f64;
        let run = |run: &[usize]| Layer {
            thickness: height * run.len() as f64,
            cells: run.len() as u32,
            pre_strain: [0.0; 2],
            ..layers[run[0]].clone()
        };
        let runs = of_level.chunk_by(|a, b| a == b).map(run).collect();
        Self { low, size, cells, layers: runs, shear: of_level.into_iter().map(shear).collect(), stiffness, inside }
    }

    fn fill(self, model: Model, of: &Model, mesh: &Unstructured) -> Auxiliary {
        let Self { low, size, cells, shear, stiffness, inside, .. } = self;
        // trilinear weights of the body's nodes, in the grid's frame
        let (grid, params): (&Grid, Params<f64>) = (&model.grid, model.params());
        let bottom = [low[0] + 0.5 * size[0], low[1] + 0.5 * size[1], low[2]];
        let of_node = |(i, p): (usize, &[f64; 3])| {
            let (cell, natural) = grid.cell_at([0, 1, 2].map(|n| p[n] - bottom[n]));
            let weights = params.corners(cell).into_iter().zip(trilinear(natural));
            weights.filter(|(_, weight)| *weight > LEAST).map(move |(node, weight)| (i as u32, node as u32, weight))
        };
        let pairs = mesh.mesh.nodes().iter().enumerate().flat_map(of_node).collect();
        // scales of the cells, and the nodes in them
        let count = grid.cell_count();
        let whole: f64 = size.iter().product::<f64>() / count as f64;
        let of_cell = |(cell, own): (usize, &f64)| own / (whole * shear[cell / (cells[0] * cells[1])]);
        let inside: Vec<(u32, u32, f64)> = inside.into_iter().map(|(cell, node)| (cell, node, 1.0)).collect();
        let length = |scale: f64| if scale > 0.0 { scale.max(LEAST_SCALE).sqrt().sqrt() } else { 0.0 };
        Auxiliary {
            transfer: Transfer::new([of.node_count(), model.own_nodes()], pairs),
            inside: inside.len(),
            in_cell: Lists::new(count, inside),
            scale: stiffness.iter().enumerate().map(of_cell).map(length).collect(),
            model,
        }
    }
}

/// Barycentric coordinates of the samples of a tetrahedron, as far from each other as from its faces.
fn lattice() -> Vec<[f64; 4]> {
    let mut out = vec![];
    for a in 0..=SAMPLES {
        for b in 0..=SAMPLES - a {
            for c in 0..=SAMPLES - a - b {
                let of = |n: usize| (n as f64 + 0.25) / (SAMPLES as f64 + 1.0);
                out.push([of(a), of(b), of(c), of(SAMPLES - a - b - c)]);
            }
        }
    }
    out
}

impl Tetrahedra {
    /// Adds the auxiliary grid of a complete model, if the scene asks for one.
    ///
    /// # Errors
    /// As [`Model::new`].
    pub(in crate::bodies) fn with_auxiliary(scene: &Scene, model: &mut Model) -> Result<()> {
        if scene.solver.preconditioner != Preconditioner::Multigrid || !matches!(model.kind, Kind::Tetrahedra(_)) {
            return Ok(());
        }
        let auxiliary = Auxiliary::new(scene, model)?;
        if let Kind::Tetrahedra(own) = &mut model.kind {
            own.auxiliary = Some(Box::new(auxiliary));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_of_a_copy_are_those_of_its_original() {
        // nodes 2 and 3 are a reserve
        let mut transfer = Transfer::new([4, 6], vec![(0, 4, 0.25), (0, 5, 0.75), (1, 5, 1.0)]);
        transfer.copy(&[[2, 0]]);
        transfer.copy(&[[3, 2]]);
        let of = |list: usize| transfer.weights.of(list).collect::<Vec<_>>();
        assert_eq!(of(2), of(0));
        assert_eq!(of(3), of(0));
        assert_ne!(of(1), of(0));
        let around: Vec<_> = transfer.around.of(4).collect();
        assert_eq!(around, [(0, 0.25), (2, 0.25), (3, 0.25)]);
    }

    #[test]
    fn samples_of_a_tetrahedron_are_weights() {
        let all = lattice();
        assert_eq!(all.len(), 20);
        for corner in 0..4 {
            let mean = all.iter().map(|weights| weights[corner]).sum::<f64>() / 20.0;
            assert!((mean - 0.25).abs() < 1e-12, "{mean}");
        }
        assert!(all.iter().all(|weights| (weights.iter().sum::<f64>() - 1.0).abs() < 1e-12));
    }
}
