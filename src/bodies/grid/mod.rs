//! Grids of hexahedra: box-shaped cells with a stiffness each, corotational or hyperelastic. A cut separates them along their faces.

pub mod cpu;
mod cut;
pub mod direct;
pub mod element;
pub mod forks;
pub mod gpu;
mod hyperelastic;
pub mod levels;
pub mod local;
pub mod multigrid;
mod stable;

pub(super) use hyperelastic::constants;
pub use hyperelastic::{Hyperelastic, tangent};

use super::gpu::{Maker, Recorded};
use super::{
    Elements, Equations, Kind, Mechanics, Model, Moved, Refused, Removal, Segments, Snapshot, Solved, Stays, Wound,
};
use crate::error::Result;
use crate::gpu::Buffer;
use crate::kernels::cut::Hit;
use crate::kernels::forces::rest_corner;
use crate::kernels::hyperelastic::{NEWTON, STIFFENED};
use crate::kernels::product::{Frames, LANES, Modes, cell_groups, product, tiles};
use crate::kernels::split::split_cells;
use crate::kernels::split_product::split_product;
use crate::kernels::{GROUP, Params, forces, rotations};
use crate::math::{M3, Real, V3, V4, rotation_matrix, rotation_minus_identity};
use crate::mesh::{Carved, Grid};
use crate::scene::{Cut, Element, Integrator, Law, Layer, Mass, Preconditioner, Scene, Skin};

/// Arrays of a body of hexahedra.
#[derive(Clone, Debug)]
pub struct Hexahedra {
    /// `[layer]` elastic strain of the rest shape along x, y, z, and 0.
    pub pre_strain: Vec<[f64; 4]>,
    /// `[layer]` element stiffness matrices, N/m; for a hyperelastic body those of small strains.
    pub stiffness: Vec<element::Matrix>,
    /// `[layer]` Lamé's λ and μ, Pa; of small strains for a hyperelastic body.
    pub moduli: Vec<[f64; 2]>,
    /// Element of the stiffness matrices.
    pub element: Element,
    /// Hyperelastic law, if any.
    pub hyperelastic: Option<Hyperelastic>,
    /// Rotations of the cells, as [`Params::corotational`]: none of linear ones; a hyperelastic body has them in its tangent or preconditioner.
    pub corotational: u32,
    /// Columns of duplicate nodes reserved for cuts ([`crate::kernels::split`]).
    pub extra_columns: usize,
    /// Coarse levels, if the preconditioner is multigrid.
    pub multigrid: Option<Multigrid>,
    /// True if the CPU path uses the direct solver.
    pub direct: bool,
}

/// Multigrid data of a body of hexahedra.
#[derive(Clone, Debug)]
pub struct Multigrid {
    /// Upper bound of the eigenvalues of `M⁻¹A` on the finest level.
    pub largest: f64,
    /// Levels below the finest, in order of coarsening.
    pub coarse: Vec<levels::Level>,
}

/// Number of duplicate columns to reserve for a body that a blade may cut.
///
/// # Errors
/// [`Refused::DirectSplit`] for the direct solver where nodes may be duplicated.
pub(super) fn reserve(scene: &Scene, skin: &Skin) -> Result<usize> {
    let blade = scene.tools.iter().any(|t| t.blade.is_some());
    let columns = match (skin.cut, skin.law) {
        (Cut::Split { reserve_columns }, Law::Fem { .. } | Law::Hyperelastic(_))
            if blade && !skin.law.is_tetrahedral() =>
        {
            reserve_columns as usize
        }
        _ => 0,
    };
    if columns > 0 && scene.solver.preconditioner == Preconditioner::Direct {
        return Err(Refused::DirectSplit.into());
    }
    Ok(columns)
}

/// Prepares the data of the scene's solver, after all other arrays of the body.
pub(super) fn prepare(model: &mut Model, preconditioner: Preconditioner) {
    let implicit = !model.step.explicit();
    let in_system = model.in_system();
    // without the reserve of duplicates; a model of sizes has no nodes at all
    let count = model.own_nodes().min(in_system.len());
    let largest_of_mass = if model.mass == Mass::Consistent { levels::OF_MASS } else { 1.0 };
    let grid = &model.grid;
    let Kind::Hexahedra(hexahedra) = &mut model.kind else { return };
    hexahedra.direct = implicit && preconditioner == Preconditioner::Direct;
    hexahedra.multigrid = (implicit && preconditioner == Preconditioner::Multigrid).then(|| {
        let mut coarse = levels::levels(grid, &hexahedra.stiffness, &in_system[..count]);
        let mut largest = levels::largest(&hexahedra.stiffness).max(largest_of_mass);
        if let Some(law) = &hexahedra.hyperelastic {
            largest = levels::largest(&law.without_volume(&hexahedra.stiffness, 0)).max(levels::OF_VOLUME);
            for (number, level) in (1..).zip(&mut coarse) {
                level.stiffness = law.without_volume(&level.stiffness, number);
                level.largest = levels::largest(&level.stiffness).max(levels::OF_VOLUME);
            }
        }
        Multigrid { largest, coarse }
    });
}

impl Hexahedra {
    /// Builds the arrays of a skin: one element matrix per layer, since all cells of a layer are equal.
    pub(super) fn new(scene: &Scene, body: usize, grid: &Grid, extra_columns: usize) -> Self {
        let skin = &scene.skins[body];
        let element = match skin.law {
            Law::Fem { element, .. } => element,
            _ => Element::Bbar,
        };
        let hyperelastic = Hyperelastic::of(scene, body, grid);
        let matrix = |(index, layer): (usize, &Layer)| {
            let edges = grid.cell_edges(index as u32);
            match &hyperelastic {
                Some(law) => hyperelastic::at_rest(edges, law.material(index)),
                None => element::stiffness(edges, layer.young, layer.poisson, element),
            }
        };
        Self {
            pre_strain: match &hyperelastic {
                Some(law) => law.pre_strain.clone(),
                None => skin.layers.iter().map(|l| element::pre_strain(l.pre_strain, l.poisson)).collect(),
            },
            stiffness: skin.layers.iter().enumerate().map(matrix).collect(),
            moduli: skin.layers.iter().map(|l| element::lame(l.young, l.poisson).into()).collect(),
            element,
            corotational: match (skin.law, &hyperelastic) {
                (Law::Fem { corotational, .. }, _) => u32::from(corotational),
                (_, Some(_)) if scene.time.integrator == Integrator::SymplecticEuler => 1,
                (_, Some(law)) if law.newton => NEWTON,
                (_, Some(_)) => STIFFENED,
                _ => 1,
            },
            hyperelastic,
            extra_columns,
            multigrid: None,
            direct: false,
        }
    }
}

impl Model {
    /// `[cell]` unit quaternions, 0 of cells that an embedded surface leaves out; then rows of 0 for hyperelastic cells.
    pub fn first_rotations<R: Real>(&self) -> Vec<V4<R>> {
        let mut all = vec![[R::zero(), R::zero(), R::zero(), R::one()]; self.params::<R>().frames()];
        for cell in (0..self.grid.cell_count()).filter(|cell| !self.grid.is_present(*cell)) {
            all[cell] = [R::zero(); 4];
        }
        all
    }

    /// Arrays of a body of hexahedra.
    ///
    /// # Panics
    /// If the body is of another kind.
    pub fn hexahedra(&self) -> &Hexahedra {
        match &self.kind {
            Kind::Hexahedra(hexahedra) => hexahedra,
            Kind::Springs(_) | Kind::Tetrahedra(_) => unreachable!("others have no cells with a stiffness"),
        }
    }

    /// The same, mutable.
    ///
    /// # Panics
    /// If the body is of another kind.
    pub fn hexahedra_mut(&mut self) -> &mut Hexahedra {
        match &mut self.kind {
            Kind::Hexahedra(hexahedra) => hexahedra,
            Kind::Springs(_) | Kind::Tetrahedra(_) => unreachable!("others have no cells with a stiffness"),
        }
    }

    /// Law of a hyperelastic body whose steps are solved by Newton's method.
    pub fn newton(&self) -> Option<&Hyperelastic> {
        let Kind::Hexahedra(hexahedra) = &self.kind else { return None };
        hexahedra.hyperelastic.as_ref().filter(|law| law.newton)
    }

    /// `[layer × 64]` 3×3 blocks of the element matrices, for elastic forces.
    pub fn stiffness_blocks<R: Real>(&self) -> Vec<M3<R>> {
        element::blocks(&self.hexahedra().stiffness)
    }

    /// `[layer × 64]` 3×3 blocks of a cell's matrix in `A`, without the nodal masses.
    pub fn system_blocks<R: Real>(&self) -> Vec<M3<R>> {
        element::blocks(&self.system_matrices())
    }

    /// `[layer]` a cell's matrix in `A` without the nodal masses, divided by the stiffness factor `s`: K, of hyperelastic cells less the
    /// stiffness of their mean volume; and, for a consistent mass, the difference between consistent and lumped mass. Blocks of M are multiples of the identity, so it rotates with K.
    pub fn system_matrices(&self) -> Vec<element::Matrix> {
        let Hexahedra { stiffness, hyperelastic, .. } = self.hexahedra();
        let mut all = hyperelastic.as_ref().map_or_else(|| stiffness.clone(), |law| law.without_volume(stiffness, 0));
        if self.mass == Mass::Consistent {
            let params = self.params::<f64>();
            for (k, shape) in all.iter_mut().zip(&self.shape) {
                let lumping = element::lumping(shape[3] * params.inertia / params.stiffness_factor);
                k.as_flattened_mut().iter_mut().zip(lumping.as_flattened()).for_each(|(k, m)| *k -= m);
            }
        }
        all
    }

    /// `[layer]` the same as mirror blocks, for products.
    pub fn modes<R: Real>(&self) -> Vec<Modes<R>> {
        element::rounded_modes(&self.system_matrices())
    }

    /// `[layer]` elastic strain of the rest shape.
    pub fn pre_strains<R: Real>(&self) -> Vec<V4<R>> {
        self.hexahedra().pre_strain.iter().map(|e| e.map(R::of)).collect()
    }
}

/// Links between face neighbours: segment `3·cell + axis` joins a cell to its neighbour at +x, +y or +z. At the end of the grid both ends
/// are the cell itself.
pub fn links(params: &Params<f64>) -> Vec<[u32; 2]> {
    let size = [params.cells_x, params.cells_y, params.cells_z].map(|n| n as usize);
    let mut out = vec![];
    for cell in 0..params.cell_count as usize {
        let at = params.cell_at(cell);
        for axis in 0..3 {
            let mut next = at;
            next[axis] += 1;
            let other = if next[axis] < size[axis] { params.cell_id(next) } else { cell };
            out.push([cell as u32, other as u32]);
        }
    }
    out
}

/// `[cell]` rest position of the centre, m.
pub fn cell_centres(model: &Model) -> Vec<[f64; 3]> {
    let params = model.grid.params::<f64>();
    let centre = |cell: usize| {
        let corners = params.corners(cell);
        let (a, b) = (model.rest[corners[0]], model.rest[corners[6]]);
        std::array::from_fn(|n| 0.5 * (a[n] + b[n]))
    };
    (0..model.grid.cell_count()).map(centre).collect()
}

impl Hexahedra {
    /// `[cell]` rotations at the displacements of a state, 0 for a removed cell, and `[cell × 3]` the stiffness of the volume of hyperelastic
    /// cells; stiffened, or as unit quaternions for what is damping alone.
    fn linearisation(&self, model: &Model, state: &Snapshot, stiffened: bool) -> Vec<V4<f64>> {
        let mut rotation = self.rotations(model, state);
        let mut params = model.params::<f64>();
        if let Some(law) = &self.hyperelastic {
            rotation.resize(4 * rotation.len(), [0.0; 4]);
            params.corotational = if stiffened { self.corotational } else { NEWTON };
            law.of_shares(&state.shares).linearise(&params, &state.split, &state.u, &mut rotation);
        }
        rotation
    }

    /// Whether its cells turn with the skin, at small strain.
    fn turns(&self) -> bool {
        self.corotational != 0 && self.hyperelastic.is_none()
    }

    /// Change of the forces of cells that turn from `f`, at displacements `at`, over a step with their rotations, `[node]` N.
    fn change_with_rotations(&self, model: &Model, solved: &Solved, at: &[V4<f64>], f: &[V4<f64>]) -> Vec<V4<f64>> {
        let (params, elastic_at) = (model.params::<f64>(), model.step.elastic_at());
        let moved = |(u, d): (&V4<f64>, &V4<f64>)| std::array::from_fn(|n| u[n] + elastic_at * d[n]);
        let end = Snapshot { u: at.iter().zip(&solved.dx).map(moved).collect(), ..solved.start.clone() };
        let rotation = self.rotations(model, &end);
        let (shapes, blocks) = (model.shapes::<f64>(), model.stiffness_blocks::<f64>());
        let (layers, pre_strains, mut change) = (&model.grid.layer_of, model.pre_strains(), vec![[0.0; 4]; f.len()]);
        forces::forces(&params, &shapes, &pre_strains, &blocks, layers, &end.split, &end.u, &rotation, &mut change);
        change.iter_mut().zip(f).for_each(|(e, f)| (0..3).for_each(|n| e[n] -= f[n]));
        change
    }
}

impl Mechanics for Hexahedra {
    fn elements(&self, model: &Model) -> Elements {
        let present = (0..model.grid.cell_count()).filter(|cell| model.grid.is_present(*cell));
        Elements { hexahedron_count: present.count(), ..Elements::default() }
    }

    fn around_nodes(&self, model: &Model) -> Vec<u32> {
        let params = model.grid.params::<f64>();
        let mut live = vec![0; model.own_nodes()];
        for cell in (0..model.grid.cell_count()).filter(|cell| model.grid.is_present(*cell)) {
            params.corners(cell).into_iter().for_each(|node| live[node] += 1);
        }
        live
    }

    fn rotation_count(&self, model: &Model) -> usize {
        model.grid.cell_count()
    }

    fn segments(&self, model: &Model) -> Segments {
        Segments { ends: links(&model.grid.params()), rest: cell_centres(model) }
    }

    fn segment_count(&self, model: &Model) -> usize {
        3 * model.grid.cell_count()
    }

    fn point_count(&self, model: &Model) -> usize {
        model.grid.cell_count()
    }

    fn extra_columns(&self) -> usize {
        self.extra_columns
    }

    fn corotational(&self) -> u32 {
        self.corotational
    }

    fn product_groups(&self, model: &Model) -> usize {
        let params = model.grid.params::<f64>();
        // partial sums of split cells, or of cells with tangents of their own
        let newton = self.hyperelastic.as_ref().is_some_and(|law| law.newton);
        let more = if newton { model.node_count() } else { model.touched_nodes() };
        tiles(&params) + more.div_ceil(GROUP as usize)
    }

    fn exact(&self) -> Kind {
        Kind::Hexahedra(Box::new(Self { direct: true, multigrid: None, ..self.clone() }))
    }

    fn host_bytes(&self, _: &Model) -> usize {
        let factors = self.hyperelastic.as_ref().map_or(0, Hyperelastic::scale_count);
        size_of_val(&self.stiffness[..]) + size_of_val(&self.pre_strain[..]) + factors * size_of::<f64>()
    }

    fn alive_share(&self, model: &Model, wound: &Wound, cell: usize) -> f64 {
        let cut = || wound.surface.linked_share(cell) * wound.surface.share(cell);
        model.grid.embedded.as_ref().map_or_else(cut, |embedded| embedded.share[cell])
    }

    fn stiffness_factor(&self, cell: usize) -> f64 {
        self.hyperelastic.as_ref().map_or(1.0, |law| law.scale(cell))
    }

    /// `½ Σ_c d_cᵀ K d_c`, `d = Rᵀ(X + u) − X + e∘X` with the strain `e` of the rest shape; of a hyperelastic body that of its law.
    fn energy(&self, model: &Model, state: &Snapshot, rotation: &[V4<f64>]) -> f64 {
        let params = model.params::<f64>();
        let Snapshot { u, split, .. } = state;
        if let Some(law) = &self.hyperelastic {
            let alive = |cell: usize| rotation[cell] != [0.0; 4];
            return law.of_shares(&state.shares).energy(&params, split, &alive, u).0;
        }
        let mut energy = 0.0;
        for (cell, q) in rotation.iter().enumerate().filter(|(_, q)| **q != [0.0; 4]) {
            let layer = model.grid.layer(cell);
            let h = V3::from4(model.shape[layer]);
            let e = self.pre_strain[layer];
            let (back, change) = (rotation_matrix(*q).transpose(), rotation_minus_identity(*q).transpose());
            let mut d = [0.0; 24];
            for (a, node) in params.corner_nodes(split, cell).into_iter().enumerate() {
                let x = rest_corner(h, a);
                let local = (back * V3::from4(u[node]) + change * x).f64();
                for (i, x) in x.f64().into_iter().enumerate() {
                    d[3 * a + i] = local[i] + e[i] * x;
                }
            }
            let k = &self.stiffness[layer];
            energy += (0..24).map(|r| 0.5 * d[r] * (0..24).map(|c| k[r][c] * d[c]).sum::<f64>()).sum::<f64>();
        }
        energy
    }

    fn linearised(&self, model: &Model) -> bool {
        let linearised = self.hyperelastic.as_ref().map_or(self.corotational != 0, |law| !law.newton);
        linearised && !model.step.explicit()
    }

    fn forces_and_product(
        &self,
        model: &Model,
        solved: &Solved,
        at: &[V4<f64>],
        in_system: &[V4<f64>],
    ) -> [Vec<V4<f64>>; 2] {
        let mut params = model.params::<f64>();
        let zeros = vec![[0.0; 4]; at.len()];
        let (mut f, mut w) = (zeros.clone(), zeros);
        let (layers, split) = (&model.grid.layer_of, &solved.start.split);
        let of_law = |law: &&Hyperelastic| law.newton || solved.equations != Equations::Linearised;
        let newton = self.hyperelastic.as_ref().filter(of_law);
        let turns = self.turns() && solved.equations == Equations::Law;
        // the stiffening belongs to the linearisation
        let stiffened = newton.is_none_or(|law| !law.newton && solved.equations == Equations::InFull);
        let rotation = self.linearisation(model, &solved.start, stiffened);
        let alive = |cell: usize| rotation[cell] != [0.0; 4];
        // elastic forces: of small-strain cells with the rotations of the state
        if let Some(law) = &self.hyperelastic {
            f = law.of_shares(&solved.start.shares).forces(&params, split, &alive, at);
        } else {
            let (shapes, blocks) = (model.shapes::<f64>(), model.stiffness_blocks::<f64>());
            forces::forces(&params, &shapes, &model.pre_strains(), &blocks, layers, split, at, &rotation, &mut f);
        }
        let mut scratch = vec![[[[0.0; LANES]; 3]; 8]; cell_groups(&params)];
        // product of the small-strain cells; of a hyperelastic body these have damping only
        if newton.is_some() || turns {
            params.stiffness_factor -= model.step.elastic_at();
        }
        let modes = model.modes();
        let frames = Frames::new(&params, &rotation, split);
        product(&params, &modes, layers, &frames, in_system, &solved.dx, &mut w, &mut scratch);
        let cells = split_cells(&params, split);
        if !cells.is_empty() {
            split_product(&params, &modes, layers, &rotation, in_system, split, &cells, &solved.dx, &mut w);
        }
        // change of the law's forces over the step
        let change = match newton {
            Some(law) => Some(law.of_shares(&solved.start.shares).change(model, solved, &alive, &f)),
            None => turns.then(|| self.change_with_rotations(model, solved, at, &f)),
        };
        if let Some(change) = change {
            for ((sum, more), dofs) in w.iter_mut().zip(&change).zip(&solved.start.dofs) {
                (0..3).for_each(|n| sum[n] += more[n] * dofs[n]);
            }
        }
        [f, w]
    }

    fn rotations(&self, model: &Model, state: &Snapshot) -> Vec<V4<f64>> {
        let mut rotation = state.rotation.clone();
        if self.corotational != 0 {
            let layers = &model.grid.layer_of;
            rotations::rotations(&model.params(), &model.shapes(), layers, &state.split, &state.u, &mut rotation);
        }
        rotation
    }

    fn stays<'a>(&'a self, model: &'a Model, rotation: &'a [V4<f64>], _: &[u32], _: &'a [V4<f64>]) -> Stays<'a> {
        let params = model.grid.params::<f64>();
        Box::new(move |node| {
            let at = params.node_at(node);
            (0..8).filter_map(|a| params.cell_below(at, a)).any(|cell| rotation[cell] != [0.0; 4])
        })
    }

    fn forces_at(&self, model: &Model, wound: &Wound, nodes: &[u32], moved: &Moved) -> Vec<[f64; 3]> {
        self.forces_of_cells(model, wound, nodes, moved)
    }

    fn strain_and_stress(&self, model: &Model, cell: usize, u: &[V3<f64>; 8], at: [f64; 3]) -> [M3<f64>; 2] {
        self.strain_and_stress_at(model, cell, u, at)
    }

    fn beyond_law(&self, layer: usize, gradient: M3<f64>) -> bool {
        self.beyond_small(layer, gradient)
    }

    fn cut(&self, model: &Model, wound: &mut Wound, hits: &[Hit<f64>]) -> Removal {
        if self.extra_columns == 0 { wound.remove_cells(model, hits) } else { wound.split(model, hits) }
    }

    fn carve(&self, model: &Model, wound: &mut Wound, cells: &[u32]) -> Removal {
        wound.carve_cells(model, cells)
    }

    fn carve_space(&self, model: &Model, wound: &mut Wound, carved: &Carved) -> Removal {
        let Some(law) = &self.hyperelastic else { unreachable!("scenes refuse to carve space out of others") };
        wound.carve_space_of(model, law, carved)
    }

    fn pieces(&self, wound: &Wound) -> Option<usize> {
        Some(wound.surface.pieces())
    }

    fn mass_left(&self, model: &Model, wound: &Wound) -> f64 {
        if model.mass == Mass::Uniform || model.grid.embedded.is_some() {
            return wound.mass_of_nodes();
        }
        let live = (0..model.grid.cell_count()).filter(|c| wound.surface.alive[*c]);
        live.map(|c| 8.0 * model.shape[model.grid.layer(c)][3] * wound.surface.share(c)).sum()
    }

    fn splitting(&self, layer: &Layer) -> f64 {
        element::splitting(layer)
    }

    fn recorded(&self, model: &Model, made: &mut Maker, u: &Buffer, params: &Params<f32>) -> Result<Box<dyn Recorded>> {
        Ok(Box::new(gpu::Hexahedra::new(self, model, made, u, params)?))
    }
}
