//! Hyperelastic hexahedra: tangent of a cell; energy, forces and tangents of a grid; all in f64.
//!
//! Energy and forces of a cell, and the symbols, are those of [`crate::kernels::hyperelastic`]. Both derive from one potential, so the
//! tangent ([`crate::kernels::hyperelastic_tangent`]) is symmetric; it may be indefinite. At rest the neo-Hookean tangent is that of the
//! linear hexahedron with its λ-part averaged over the cell.
//!
//! Comparison of the laws: displacement of the skin block's centre (20×20×5 cells, ν 0.45, no gravity) under a pressure on its middle
//! (tests/verify/neo_hookean.rs checks these values):
//!
//! | pressure kPa | neo-Hookean mm | corotational | small strain |
//! | --- | --- | --- | --- |
//! | 1 | −0.0193 | +1.7 % | +0.9 % |
//! | 10 | −0.1868 | +13.7 % | +4.2 % |
//! | 50 | −0.7893 | +174 % | +23 % |
//!
//! Corotational stress is linear in the stretch, so compressed material does not stiffen: at 50 kPa nothing supports the middle of 2.3 mm
//! of skin until the cells have almost collapsed.
//! Units: u m, edges m, material Pa, W J, f N, K N/m.

use super::element::{Matrix, lame};
use crate::bodies::{Model, Solved};
use crate::kernels::collect::collect;
use crate::kernels::deformation::gradient;
use crate::kernels::hyperelastic::{Cell, Cells, FibreRows, Law as CellLaw, Material, mean_volume};
use crate::kernels::hyperelastic_forces::{Response, Wanted};
use crate::kernels::{PARALLEL, Params};
use crate::math::elementary::{cos, exp, ln, sin};
use crate::math::{M3, Real, V3, V4};
use crate::mesh::Grid;
use crate::scene::{self, Law, Layer, Region, Scene};
use rayon::prelude::*;
use std::borrow::Cow;

/// 24×24 tangent, row and column `3a + i`, N/m.
pub fn tangent(cell: &Cell<f64>) -> Matrix {
    let (volume_gradient, pressure, stiff) =
        (cell.volume_gradient().map(V3::f64), cell.pressure(), cell.pressure_slope());
    // material and geometric part, Gauss point by Gauss point, lower half by corner pairs
    let mut k = [[0.0; 24]; 24];
    for (n, p) in cell.points.iter().enumerate() {
        let kirchhoff = cell.weight * pressure * (1.0 + p.dilatation);
        let rest: [V3<f64>; 8] = std::array::from_fn(|a| gradient(cell.inverse, a, n));
        let now = rest.map(|g| (p.log_gradient * g).f64());
        // [3 j + l] material part: dP' for a unit change of F in row j, column l
        let unit = |m: usize| {
            let mut change = [[0.0; 3]; 3]; // columns
            change[m % 3][m / 3] = 1.0;
            cell.material.tangent(p, M3(change.map(V3::of)))
        };
        let changes: [M3<f64>; 9] = std::array::from_fn(unit);
        for b in 0..8 {
            let g = rest[b].f64();
            // [j] dP' for a unit displacement of corner b along j
            let of_corner: [M3<f64>; 3] =
                std::array::from_fn(|j| changes[3 * j] * g[0] + changes[3 * j + 1] * g[1] + changes[3 * j + 2] * g[2]);
            for a in b..8 {
                for j in 0..3 {
                    let straight = (of_corner[j] * rest[a] * cell.weight).f64();
                    for i in 0..3 {
                        k[3 * a + i][3 * b + j] +=
                            straight[i] + kirchhoff * (now[a][i] * now[b][j] - now[b][i] * now[a][j]);
                    }
                }
            }
        }
    }
    // stiffness of the mean dilatation
    for m in 0..24 {
        for n in 0..3 * (m / 3 + 1) {
            k[m][n] += stiff * volume_gradient[m / 3][m % 3] * volume_gradient[n / 3][n % 3];
        }
    }
    // upper half by symmetry
    for m in 0..24 {
        for n in 3 * (m / 3 + 1)..24 {
            k[m][n] = k[n][m];
        }
    }
    k
}

/// κ and two constants, Pa, and the code of a law, in the layout of [`Material::of`].
pub(in crate::bodies) fn constants(law: scene::Material, layer: &Layer) -> V4<f64> {
    let (lambda, mu) = lame(layer.young, layer.poisson);
    match law {
        scene::Material::NeoHookean => [lambda, mu, 0.0, 0.0],
        scene::Material::MooneyRivlin => {
            let (half, share) = (0.5 * mu, layer.second_share);
            [lambda + mu * 2.0 / 3.0, half * (1.0 - share), half * share, 1.0]
        }
        scene::Material::Holzapfel => [lambda, mu, layer.fibres.stiffness, 2.0],
    }
}

/// Numbers of a layer's fibres, in the layout of [`Material::of`].
fn fibre_rows(layer: &Layer) -> FibreRows<f64> {
    let [[x1, y1], [x2, y2]] = layer.fibres.families.map(|angle| [cos(angle), sin(angle)]);
    [[x1, y1, x2, y2], [layer.fibres.growth, layer.fibres.dispersion, 0.0, 0.0]]
}

/// Small-strain matrix of a cell: the tangent of its law at rest, and the stiffness of fibres, which resist stretching alone.
pub(super) fn at_rest(edges: [f64; 3], material: Material<f64>) -> Matrix {
    let material = Material { edges: V3::of(edges), pre_strain: V3::zero(), ..material };
    let (mut k, fibres) = (tangent(&Cell::new(material, &[V3::zero(); 8])), fibre_stiffness(edges, &material));
    k.as_flattened_mut().iter_mut().zip(fibres.as_flattened()).for_each(|(k, more)| *k += more);
    k
}

/// Stiffness of stretched fibres at small strain, averaged over the mirror images of a cell, which is what products with the small-strain
/// matrix need ([`crate::kernels::product`]); twice that where the two families are no mirror images of each other or of themselves, since
/// a matrix is at most twice its mean with its mirror images.
fn fibre_stiffness(edges: [f64; 3], material: &Material<f64>) -> Matrix {
    let mut own = [[0.0; 24]; 24];
    let CellLaw::Holzapfel(_, fibres) = material.law else { return own };
    let inverse = V3::of(edges.map(|h| 1.0 / h));
    let weight = edges.iter().product::<f64>() / 8.0;
    let mut mirrored = own;
    for family in 0..2 {
        for (sum, side) in [(&mut own, 1.0), (&mut mirrored, -1.0)] {
            let mut fibres = fibres;
            fibres.directions[family][0] *= side;
            let structure = fibres.structure(family);
            for point in 0..8 {
                // dE/du of a corner at rest
                let slopes = (0..8).flat_map(|a| (structure * gradient(inverse, a, point) * 2.0).f64());
                let slopes: Vec<f64> = slopes.collect();
                for (row, left) in sum.iter_mut().zip(&slopes) {
                    row.iter_mut().zip(&slopes).for_each(|(k, right)| *k += weight * fibres.stiffness * left * right);
                }
            }
        }
    }
    let pairs = || own.as_flattened().iter().zip(mirrored.as_flattened());
    let size = own.as_flattened().iter().fold(0.0f64, |most, k| most.max(k.abs()));
    let symmetric = pairs().all(|(a, b)| (a - b).abs() <= SYMMETRIC * size);
    let share = if symmetric { 0.5 } else { 1.0 };
    let mut out = own;
    out.as_flattened_mut().iter_mut().zip(mirrored.as_flattened()).for_each(|(k, m)| *k = share * (*k + m));
    out
}

/// Difference, relative to the largest entry, below which a matrix and its mirror image are one.
const SYMMETRIC: f64 = 1e-9;

/// Elastic strain of a layer with given strains along x and y and no stress along z, by bisection on the stretch along z.
fn pre_strain(material: V4<f64>, fibres: FibreRows<f64>, [x, y]: [f64; 2]) -> V4<f64> {
    if [x, y] == [0.0; 2] {
        return [0.0; 4];
    }
    let pull = |z: f64| {
        let cell = Cell::new(Material::of([1.0; 4], material, fibres, [x, y, z, 0.0]), &[V3::zero(); 8]);
        cell.forces()[4..].iter().map(|force| force.z).sum::<f64>()
    };
    let (mut low, mut high) = (THINNEST - 1.0, THICKEST - 1.0);
    loop {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            return [x, y, middle, 0.0];
        }
        if pull(middle) < 0.0 { low = middle } else { high = middle }
    }
}

/// Bounds of the stretch along z that two strains between −0.5 and 1 can cause.
const THINNEST: f64 = 0.1;
const THICKEST: f64 = 10.0;

/// Points of a cell along an axis at which inclusions are looked for: the volume of a ball of two cells across is right to 2 %.
const SAMPLES: usize = 4;

/// Factors where cells have none of their own, of which cells beyond the last have the last: as many as fill the 16 bytes that arrays on a device have
/// at least.
const ONE_FOR_ALL: usize = 4;

/// Cells that a thread takes at once.
const CHUNK: usize = 128;

/// Grid of hyperelastic cells.
#[derive(Clone, Debug)]
pub struct Hyperelastic {
    /// `[layer]` cell edges, m, and 0.
    shapes: Vec<V4<f64>>,
    /// `[layer]` κ and two constants, Pa, and the law's code, in the kernels' layout.
    materials: Vec<V4<f64>>,
    /// `[layer]` directions of the fibres; k₂, κ.
    fibres: Vec<FibreRows<f64>>,
    /// `[layer]` elastic strain of the rest shape along x, y, z, and 0; that along z leaves no stress on the layer's faces.
    pub(super) pre_strain: Vec<V4<f64>>,
    /// `[cells_z]` layer
    layer_of: Vec<u32>,
    cell_count: usize,
    /// True if cells have factors of their own, by inclusions or by the shares of an embedded surface.
    scaled: bool,
    /// Regions with another Young's modulus, Pa, in the body's frame.
    inclusions: Vec<(Region, f64)>,
    /// `[cell]` factor on the stiffness of its layer, or one for all.
    scale: Vec<f64>,
    /// True if steps are solved by Newton's method with the consistent tangent; otherwise each is one linear solve with the rotated
    /// stiffness ([`Cell::linearised`]).
    pub newton: bool,
}

impl Hyperelastic {
    /// Grid of a scene's body, if its law is hyperelastic.
    pub(super) fn of(scene: &Scene, body: usize, grid: &Grid) -> Option<Self> {
        let skin = &scene.skins[body];
        let Law::Hyperelastic(material) = skin.law else { return None };
        let shape = |layer: usize| {
            let [x, y, z] = grid.cell_edges(layer as u32);
            [x, y, z, 0.0]
        };
        let materials: Vec<V4<f64>> = skin.layers.iter().map(|layer| constants(material, layer)).collect();
        let fibres: Vec<FibreRows<f64>> = skin.layers.iter().map(fibre_rows).collect();
        let constants = skin.layers.iter().zip(&materials).zip(&fibres);
        let strains = constants.map(|((layer, own), fibres)| pre_strain(*own, *fibres, layer.pre_strain));
        Some(Self {
            shapes: (0..skin.layers.len()).map(shape).collect(),
            pre_strain: strains.collect(),
            materials,
            fibres,
            layer_of: grid.layer_of.clone(),
            cell_count: grid.cell_count(),
            scaled: grid.embedded.is_some()
                || scene.carves_space(body)
                || scene.inclusions.iter().any(|i| i.body == body),
            inclusions: scene
                .inclusions
                .iter()
                .filter(|i| i.body == body)
                .map(|i| (i.region.clone(), i.young))
                .collect(),
            scale: vec![1.0; ONE_FOR_ALL],
            newton: scene.newton(),
        })
    }

    /// Number of factors: one per cell where cells have their own.
    pub(super) fn scale_count(&self) -> usize {
        if self.scaled { self.cell_count } else { ONE_FOR_ALL }
    }

    /// Factor of a cell on the stiffness of its layer; 0 for one that is gone from the start.
    pub(super) fn scale(&self, cell: usize) -> f64 {
        self.scale[cell.min(self.scale.len() - 1)]
    }

    /// Gives a cell another factor, where cells have their own.
    pub(super) fn set_scale(&mut self, cell: u32, factor: f64) {
        self.scale[cell as usize] = factor;
    }

    /// The law of cells with these shares left, `[cell]`; of whole ones where there are none.
    pub(super) fn of_shares(&self, shares: &[f64]) -> Cow<'_, Self> {
        if shares.is_empty() {
            return Cow::Borrowed(self);
        }
        let scale = self.scale.iter().zip(shares).map(|(scale, share)| scale * share).collect();
        Cow::Owned(Self { scale, ..self.clone() })
    }

    /// Fills in the factors of the cells: the geometric mean of Young's modulus over [`SAMPLES`]³ points of a cell, over that of its layer;
    /// where inclusions overlap, the last one counts. The arithmetic mean makes an inclusion larger, the harmonic mean smaller than it is. Times the
    /// factor for the share of the cell in the body ([`Grid::share_factor`]).
    pub(in crate::bodies) fn fill(&mut self, grid: &Grid, layers: &[Layer]) {
        if !self.scaled {
            return;
        }
        let params = grid.params::<f64>();
        let of_cell = |cell: usize| {
            let layer = grid.layer(cell);
            let (low, edges) = (grid.rest(params.corners(cell)[0]), grid.cell_edges(layer as u32));
            let share = |k: usize| (k as f64 + 0.5) / SAMPLES as f64;
            let logarithm = |k: usize| {
                let at = [k % SAMPLES, k / SAMPLES % SAMPLES, k / SAMPLES / SAMPLES].map(share);
                let point = std::array::from_fn(|n| low[n] + at[n] * edges[n]);
                let inside = |(region, _): &&(Region, f64)| region.holds(point, grid.size(), grid.thickness());
                self.inclusions.iter().rfind(inside).map_or(0.0, |(_, young)| ln(young / layers[layer].young))
            };
            let count = SAMPLES.pow(3);
            if self.inclusions.is_empty() {
                return grid.share_factor(cell);
            }
            exp((0..count).map(logarithm).sum::<f64>() / count as f64) * grid.share_factor(cell)
        };
        self.scale = (0..grid.cell_count()).into_par_iter().map(of_cell).collect();
    }

    /// Cells at nodal displacements.
    pub fn cells<'a>(
        &'a self,
        params: &'a Params<f64>,
        split: &'a [u32],
        displacement: &'a [V4<f64>],
    ) -> Cells<'a, f64> {
        let Self { shapes: shape, materials: material, fibres, pre_strain, layer_of, scale, .. } = self;
        Cells { params, shape, material, fibres, pre_strain, layer_of, scale, split, displacement }
    }

    /// State of a cell of a layer at its corners' displacements, without its own factor.
    pub(super) fn of_layer(&self, layer: usize, u: &[V3<f64>; 8]) -> Cell<f64> {
        Cell::new(self.material(layer), u)
    }

    /// Cell size and material of a layer.
    pub(super) fn material(&self, layer: usize) -> Material<f64> {
        Material::of(self.shapes[layer], self.materials[layer], self.fibres[layer], self.pre_strain[layer])
    }

    /// `[cell]` values of the cells that are `alive` and were there from the start, `None` of the others.
    fn each<T: Clone + Send>(
        cells: Cells<f64>,
        alive: &(dyn Fn(usize) -> bool + Sync),
        wanted: Wanted,
        of: impl Fn(&Response<f64>) -> T + Sync,
    ) -> Vec<Option<T>> {
        let mut out = vec![None; cells.params.cell_count as usize];
        let some = |(chunk, out): (usize, &mut [Option<T>])| {
            let (first, count) = (chunk * CHUNK, out.len());
            let there = |cell: usize| alive(cell) && cells.scale(cell) > 0.0;
            let rotation = |cell| there(cell).then_some([0.0, 0.0, 0.0, 1.0]);
            let mut take = |cell: usize, found: &Response<f64>| out[cell - first] = Some(of(found));
            cells.respond(first..first + count, wanted, &rotation, &mut take);
        };
        out.par_chunks_mut(CHUNK).enumerate().with_min_len(PARALLEL / 8 / CHUNK).for_each(some);
        out
    }

    /// First inverted cell of an uncut body.
    pub fn first_inverted(&self, params: &Params<f64>, u: &[V4<f64>]) -> Option<usize> {
        let each = Self::each(self.cells(params, &[], u), &|_| true, Wanted::default(), |found| found.inverted);
        each.iter().position(|inverted| *inverted == Some(true))
    }

    /// Energy of all cells that are `alive`, J, and whether one is inverted.
    pub fn energy(
        &self,
        params: &Params<f64>,
        split: &[u32],
        alive: &(dyn Fn(usize) -> bool + Sync),
        u: &[V4<f64>],
    ) -> (f64, bool) {
        let wanted = Wanted { energy: true, ..Wanted::default() };
        let each = Self::each(self.cells(params, split, u), alive, wanted, |found| (found.energy, found.inverted));
        each.into_iter().flatten().fold((0.0, false), |(sum, any), (energy, inverted)| (sum + energy, any || inverted))
    }

    /// `[node]` internal forces of the cells that are `alive`, N.
    pub fn forces(
        &self,
        params: &Params<f64>,
        split: &[u32],
        alive: &(dyn Fn(usize) -> bool + Sync),
        u: &[V4<f64>],
    ) -> Vec<V4<f64>> {
        let each = Self::each(self.cells(params, split, u), alive, Wanted::default(), |found| found.force);
        sums(params, split, &each.into_iter().map(Option::unwrap_or_default).collect::<Vec<_>>())
    }

    /// Gives the unit quaternions of a body the lengths, and the rows after them the stiffness of the volume, of the cells' linearisation at
    /// `u` ([`Cell::linearised`]); returns the internal forces, `[node]` N. A quaternion of zero is of a removed cell; explicit steps have no
    /// linearisation and no rows.
    pub fn linearise<R: Real>(
        &self,
        params: &Params<f64>,
        split: &[u32],
        u: &[V4<f64>],
        rotation: &mut [V4<R>],
    ) -> Vec<V4<f64>> {
        let (quaternions, rows) = rotation.split_at_mut(params.cell_count as usize);
        if rows.is_empty() {
            return self.forces(params, split, &|cell| quaternions[cell] != [R::zero(); 4], u);
        }
        let cells = self.cells(params, split, u);
        let mut forces = vec![[[0.0; 3]; 8]; quaternions.len()];
        let each = |first: usize, quaternions: &mut [V4<R>], rows: &mut [V4<R>], forces: &mut [[[f64; 3]; 8]]| {
            let unit = quaternions.to_vec();
            let rotation = |cell: usize| (unit[cell - first] != [R::zero(); 4]).then(|| unit[cell - first].map(R::f64));
            let wanted = Wanted { energy: false, linearised: true };
            cells.respond(first..first + unit.len(), wanted, &rotation, &mut |cell, found| {
                let own = cell - first;
                quaternions[own] = unit[own].map(|c| R::of(c.f64() * found.length));
                rows[3 * own..3 * own + 3].copy_from_slice(&found.rows.map(|row| row.map(R::of)));
                forces[own] = found.force;
            });
        };
        let chunks = quaternions.par_chunks_mut(CHUNK).zip(rows.par_chunks_mut(3 * CHUNK));
        let chunks = chunks.zip(forces.par_chunks_mut(CHUNK)).enumerate().with_min_len(PARALLEL / 8 / CHUNK);
        chunks.for_each(|(chunk, ((quaternions, rows), forces))| each(chunk * CHUNK, quaternions, rows, forces));
        sums(params, split, &forces)
    }

    /// `[layer]` small-strain matrices of a level whose cells have `2^coarsened` times the edges along x and y, less the stiffness of their mean
    /// volume, N/m.
    pub(super) fn without_volume(&self, stiffness: &[Matrix], coarsened: u32) -> Vec<Matrix> {
        let times = f64::from(1u32 << coarsened);
        let of_layer = |(layer, k): (usize, &Matrix)| {
            let [x, y, z, _] = self.shapes[layer];
            let volume = mean_volume([x * times, y * times, z], self.materials[layer][0]);
            let mut k = *k;
            k.as_flattened_mut().iter_mut().zip(volume.as_flattened()).for_each(|(k, v)| *k -= v);
            k
        };
        stiffness.iter().enumerate().map(of_layer).collect()
    }

    /// Change of the forces of the cells that are `alive` from `f` over a step, as it enters the step, `[node]` N; NaN if Newton's method has
    /// inverted a cell.
    pub fn change(
        &self,
        model: &Model,
        solved: &Solved,
        alive: &(dyn Fn(usize) -> bool + Sync),
        f: &[V4<f64>],
    ) -> Vec<V4<f64>> {
        let params = model.params::<f64>();
        let elastic_at = solved.elastic_at.unwrap_or(model.step.elastic_at());
        let moved = |(u, d): (&V4<f64>, &V4<f64>)| std::array::from_fn(|n| u[n] + elastic_at * d[n]);
        let at: Vec<V4<f64>> = solved.start.u.iter().zip(&solved.dx).map(moved).collect();
        if self.newton && self.first_inverted(&params, &at).is_some() {
            return vec![[f64::NAN; 4]; f.len()];
        }
        let mut change = self.forces(&params, &solved.start.split, alive, &at);
        change.iter_mut().zip(f).for_each(|(e, f)| (0..3).for_each(|n| e[n] -= f[n]));
        change
    }

    /// `[layer]` materials, for the kernels.
    pub fn rounded<R: Real>(&self) -> Vec<V4<R>> {
        self.materials.iter().map(|m| m.map(R::of)).collect()
    }

    /// `[cell]` factors, or one for all, for the kernels.
    pub fn rounded_scale<R: Real>(&self) -> Vec<R> {
        self.scale.iter().map(|scale| R::of(*scale)).collect()
    }

    /// `[layer × 2]` fibres, for the kernels.
    pub fn rounded_fibres<R: Real>(&self) -> Vec<V4<R>> {
        self.fibres.as_flattened().iter().map(|row| row.map(R::of)).collect()
    }
}

/// Assembles cell forces at the nodes, `[node]` N.
fn sums(params: &Params<f64>, split: &[u32], cells: &[[[f64; 3]; 8]]) -> Vec<V4<f64>> {
    let mut out = vec![[0.0; 4]; params.node_count as usize];
    collect(params, split, cells.as_flattened().as_flattened(), &mut out);
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::corner;
    use crate::kernels::holzapfel::Fibres;
    use crate::kernels::hyperelastic;
    use crate::math::random::Random;
    use crate::math::rotation_matrix;

    type Law = hyperelastic::Law<f64>;
    type Field = [V3<f64>; 8];

    const BULK: f64 = 9e4;
    const MU: f64 = 1e4;

    fn of(law: Law) -> Material<f64> {
        Material { edges: V3::new(1.1e-3, 0.9e-3, 0.4e-3), pre_strain: V3::zero(), bulk: BULK, law }
    }

    fn soft() -> Material<f64> {
        of(Law::NeoHookean(MU))
    }

    const FIBRES: Fibres<f64> =
        Fibres { directions: [[0.8, 0.6], [-0.28, 0.96]], stiffness: 0.7 * MU, growth: 2.0, dispersion: 0.1 };

    const LAWS: [Law; 3] = [Law::NeoHookean(MU), Law::MooneyRivlin([0.3 * MU, 0.2 * MU]), Law::Holzapfel(MU, FIBRES)];

    fn field(mut one: impl FnMut(usize, usize) -> f64) -> Field {
        std::array::from_fn(|a| V3::of(std::array::from_fn(|i| one(a, i))))
    }

    fn random(seed: u64, size: f64) -> Field {
        let mut random = Random::new(seed);
        field(|_, _| size * random.signed())
    }

    fn moved(law: Law, u: &Field, d: &Field, by: f64) -> Cell<f64> {
        let at = std::array::from_fn(|a| u[a] + d[a] * by);
        Cell::new(of(law), &at)
    }

    fn times(k: &Matrix, z: &Field) -> [[f64; 3]; 8] {
        let z = z.map(V3::f64);
        let row = |n: usize| k[n].iter().zip(z.as_flattened()).map(|(k, z)| k * z).sum::<f64>();
        std::array::from_fn(|a| std::array::from_fn(|i| row(3 * a + i)))
    }

    #[test]
    fn force_is_the_energys_slope_and_tangent_the_forces() {
        for (law, seed) in LAWS.into_iter().flat_map(|law| (1..20).map(move |seed| (law, seed))) {
            // strains up to 60 %
            let (u, d) = (random(seed, 8e-5), random(seed + 100, 1e-4));
            let moved = |u: &Field, d: &Field, by| moved(law, u, d, by);
            let here = Cell::new(of(law), &u);
            let (step, scale) = (1e-4, tangent(&here).iter().flatten().fold(0.0f64, |m, k| m.max(k.abs())));
            let slope = (moved(&u, &d, step).energy() - moved(&u, &d, -step).energy()) / (2.0 * step);
            let wanted: f64 = here.forces().iter().zip(d).map(|(f, d)| f.dot(d)).sum();
            assert!((slope - wanted).abs() < 1e-6 * scale * 1e-8, "seed {seed}: {slope:e}, wanted {wanted:e}");
            let (after, before) = (moved(&u, &d, step).forces(), moved(&u, &d, -step).forces());
            let (wanted, at_rest) = (times(&tangent(&here), &d), times(&tangent(&moved(&u, &u, -1.0)), &d));
            let product = here.product(&d).map(V3::f64);
            let (mut off, mut rest_off, mut product_off) = (0.0f64, 0.0f64, 0.0f64);
            for (a, i) in (0..24).map(|n| (n / 3, n % 3)) {
                let slope = (after[a] - before[a]).f64()[i] / (2.0 * step);
                off = off.max((slope - wanted[a][i]).abs() / (scale * 1e-4));
                rest_off = rest_off.max((slope - at_rest[a][i]).abs() / (scale * 1e-4));
                product_off = product_off.max((product[a][i] - wanted[a][i]).abs() / (scale * 1e-4));
            }
            assert!(off < 1e-5, "seed {seed}: {off:e}");
            assert!(product_off < 1e-13, "seed {seed}: {product_off:e}");
            // counter-test: the tangent at rest is another one
            assert!(rest_off > 1e-2, "seed {seed}: {rest_off:e}");
        }
    }

    #[test]
    fn rigid_motion_costs_nothing_and_turns_forces() {
        LAWS.into_iter().for_each(turned_about);
    }

    fn turned_about(law: Law) {
        let soft = || of(law);
        let (s, c) = 1.1f64.sin_cos();
        let rotate = |x: V3<f64>| V3::new(c * x.x - s * x.y, s * x.x + c * x.y, x.z);
        let strained = random(7, 6e-5);
        let edges = soft().edges.f64();
        let at = field(|a, n| (corner(a)[n] as f64 - 0.5) * edges[n]);
        let carried = |u: &Field| -> Field { std::array::from_fn(|a| rotate(at[a] + u[a]) - at[a] + V3::splat(0.02)) };
        let still = Cell::new(soft(), &carried(&[V3::zero(); 8]));
        let volume: f64 = edges.iter().product();
        assert!(still.energy().abs() < 1e-12 * volume * BULK, "{:e}", still.energy());
        let (old, new) = (Cell::new(soft(), &strained), Cell::new(soft(), &carried(&strained)));
        assert!((old.energy() / new.energy() - 1.0).abs() < 1e-9);
        for (a, b) in old.forces().iter().zip(new.forces()) {
            assert!((rotate(*a) - b).length() < 1e-9, "{a:?} {b:?}");
        }
    }

    #[test]
    fn an_inverted_cell_is_told_and_pushed_open() {
        let height = 0.4e-3;
        let pressed = |by: f64| Cell::new(soft(), &field(|a, n| if a >= 4 && n == 2 { -by * height } else { 0.0 }));
        assert!(!pressed(0.99).inverted() && pressed(1.01).inverted());
        assert!(Cell::new(soft(), &[V3::splat(f64::NAN); 8]).inverted());
        // through flat and beyond: finite, downward on the top, more and more so, and the slope of the energy
        let on_top = |by: f64| pressed(by).forces()[4..].iter().map(|f| f.z).sum::<f64>();
        let mut before = 0.0;
        for by in [0.5, 0.85, 0.95, 0.999, 1.0, 1.05, 1.5, 2.5] {
            let force = on_top(by);
            assert!(force.is_finite() && force < before, "{by}: {force:e} after {before:e}");
            before = force;
            let step = 1e-5;
            let slope = (pressed(by - step).energy() - pressed(by + step).energy()) / (2.0 * step * height);
            assert!((slope / force - 1.0).abs() < 1e-4, "{by}: force {force:e}, slope of the energy {slope:e}");
        }
    }

    #[test]
    fn a_cell_in_disorder_has_finite_forces_and_stiffening() {
        for (law, seed) in LAWS.into_iter().flat_map(|law| (1..50).map(move |seed| (law, seed))) {
            // up to ten times the thinnest edge
            let cell = Cell::new(of(law), &random(seed, 4e-3));
            assert!(cell.forces().iter().all(|f| f.f64().iter().all(|c| c.is_finite())), "seed {seed}: {law:?}");
            let (u, d) = (random(seed, 4e-3), random(seed + 100, 1e-3));
            let slope = (moved(law, &u, &d, 1e-6).energy() - moved(law, &u, &d, -1e-6).energy()) / 2e-6;
            let wanted: f64 = cell.forces().iter().zip(d).map(|(f, d)| f.dot(d)).sum();
            assert!((slope / wanted - 1.0).abs() < 1e-3, "seed {seed}: {law:?}, {slope:e}, wanted {wanted:e}");
            let s = cell.linearised(Some(3.0), UNTURNED, &cell.forces()).stiffening;
            assert!(s.is_finite() && s >= 1.0, "seed {seed}: {law:?}, {s}");
        }
    }

    #[test]
    fn a_pre_strained_cell_is_at_rest_between_its_faces_and_pulls_on_its_sides() {
        let young = MU * (3.0 * BULK + 2.0 * MU) / (BULK + MU);
        let poisson = 0.5 * BULK / (BULK + MU);
        let material = [BULK, MU, 0.0, 0.0];
        for [x, y] in [[1e-4, 2e-4], [0.05, 0.1], [0.3, -0.2]] {
            let e = pre_strain(material, [[0.0; 4]; 2], [x, y]);
            let own = Material { pre_strain: V3::from4(e), ..soft() };
            let cell = Cell::new(own, &[V3::zero(); 8]);
            let pull =
                |corners: [usize; 4], axis: usize| corners.map(|a| cell.forces()[a].f64()[axis]).iter().sum::<f64>();
            let [h_x, h_y, h_z] = own.edges.f64();
            let right: Vec<usize> = (0..8).filter(|a| corner(*a)[0] == 1).collect();
            let side = pull([right[0], right[1], right[2], right[3]], 0) / (h_y * h_z);
            let top = pull([4, 5, 6, 7], 2) / (h_x * h_y);
            assert!(top.abs() < 1e-9 * MU, "{x}, {y}: {top} Pa on the top");
            // a plate of small strain
            let plate = young / (1.0 - poisson * poisson) * (x + poisson * y);
            if x < 1e-3 {
                assert!((side / plate - 1.0).abs() < 1e-3, "{x}, {y}: {side} Pa on the side, a plate {plate}");
            }
            // counter-test: with the strain of small strains along z the top is not free at large ones
            let z = -poisson / (1.0 - poisson) * (x + y);
            let small = Cell::new(Material { pre_strain: V3::new(x, y, z), ..soft() }, &[V3::zero(); 8]);
            let off = small.forces()[4..].iter().map(|f| f.z).sum::<f64>() / (h_x * h_y);
            assert!(x < 1e-3 || off.abs() > 1e-2 * MU, "{x}, {y}: {off} Pa");
            // forces are the slope of the energy
            let (u, d) = (random(3, 5e-5), random(4, 1e-4));
            let at = |by: f64| Cell::new(own, &std::array::from_fn(|a| u[a] + d[a] * by));
            let slope = (at(1e-5).energy() - at(-1e-5).energy()) / 2e-5;
            let wanted: f64 = at(0.0).forces().iter().zip(d).map(|(f, d)| f.dot(d)).sum();
            assert!((slope / wanted - 1.0).abs() < 1e-6, "{x}, {y}: {slope:e}, wanted {wanted:e}");
        }
    }

    const UNTURNED: V4<f64> = [0.0, 0.0, 0.0, 1.0];

    /// Linearised stiffness of a cell ([`Cell::linearised`]) with a small-strain matrix, for steps without damping.
    fn linearised(cell: &Cell<f64>, small: &Matrix, q: V4<f64>) -> Matrix {
        assembled(cell, small, q, cell.linearised(Some(1.0), q, &cell.forces()))
    }

    /// The same without the stiffness of tension; rotations, which have none then, are held by springs of stiffness `held`.
    fn without_tension(cell: &Cell<f64>, small: &Matrix, q: V4<f64>, held: f64) -> Matrix {
        let mut found = cell.linearised(Some(1.0), q, &cell.forces());
        found.rows.tension = V3::zero();
        let mut k = assembled(cell, small, q, found);
        for axis in 0..3 {
            let x = |a: usize| V3::of(std::array::from_fn(|n| corner(a)[n] as f64 - 0.5)).times(cell.material.edges);
            let spin = V3::of(std::array::from_fn(|n| f64::from(u8::from(n == axis))));
            let turned: [V3<f64>; 8] = std::array::from_fn(|a| rotation_matrix(q) * spin.cross(x(a)));
            let turned: Vec<f64> = turned.iter().flat_map(|x| x.f64()).collect();
            let size: f64 = turned.iter().map(|x| x * x).sum();
            for (row, a) in k.iter_mut().zip(&turned) {
                row.iter_mut().zip(&turned).for_each(|(k, b)| *k += held / size * a * b);
            }
        }
        k
    }

    fn assembled(cell: &Cell<f64>, small: &Matrix, q: V4<f64>, found: hyperelastic::Linearised<f64>) -> Matrix {
        let (volume, r) = (mean_volume(cell.material.edges.f64(), cell.material.bulk), rotation_matrix(q));
        let turned = |m: usize, n: usize, k: &dyn Fn(usize, usize) -> f64| -> f64 {
            let (row, column) = (r.transpose().0[m % 3].f64(), r.transpose().0[n % 3].f64());
            let (a, b) = (m / 3 * 3, n / 3 * 3);
            (0..9).map(|k_of| row[k_of / 3] * k(a + k_of / 3, b + k_of % 3) * column[k_of % 3]).sum()
        };
        let local =
            |m: usize, n: usize| small[m][n] - volume[m][n] + found.rows.between(m / 3, n / 3).0[n % 3].f64()[m % 3];
        std::array::from_fn(|m| std::array::from_fn(|n| found.stiffening * turned(m, n, &local)))
    }

    /// Largest `xᵀ K x / xᵀ S x` over uniform strains and hourglass patterns `x` of a cell, turned by `q`. (Rotations are not the tangent's
    /// business: the matrix turns with the cell.)
    fn stiffer(k: &Matrix, s: &Matrix, q: V4<f64>) -> f64 {
        let (edges, r) = (soft().edges.f64(), rotation_matrix(q));
        let mut random = Random::new(3);
        let mut largest = 0.0f64;
        for sample in 0..3000 {
            let [a, b, c, d, e, f] = [0; 6].map(|_| random.signed());
            let strain = match sample {
                0..3 => std::array::from_fn(|m| std::array::from_fn(|n| f64::from(u8::from(m == n && m == sample)))),
                _ => [[a, d, e], [d, b, f], [e, f, c]],
            };
            let hourglass: [[f64; 3]; 4] = std::array::from_fn(|_| std::array::from_fn(|_| 3e-4 * random.signed()));
            let x = field(|corner_of, m| {
                let at = corner(corner_of).map(|c| 2.0 * c as f64 - 1.0);
                let patterns = [at[0] * at[1], at[1] * at[2], at[2] * at[0], at[0] * at[1] * at[2]];
                let uniform: f64 = (0..3).map(|n| 0.5 * strain[m][n] * at[n] * edges[n]).sum();
                let bent: f64 = (0..4).map(|p| hourglass[p][m] * patterns[p]).sum();
                uniform + if sample % 3 == 1 { bent } else { 0.0 }
            });
            let x = x.map(|x| r * x);
            let energy =
                |matrix: &Matrix| -> f64 { times(matrix, &x).iter().zip(x).map(|(f, x)| V3::of(*f).dot(x)).sum() };
            largest = largest.max(energy(k) / energy(s));
        }
        largest
    }

    /// Largest ratio of the true tangent to the linearised one and to the one at rest, in cells of stretches `scale`.
    fn most_stiff(law: Law, small: &Matrix, scales: impl Iterator<Item = [f64; 3]>) -> [f64; 2] {
        let edges = soft().edges.f64();
        let ratios = scales.map(|scale| {
            let u = field(|a, n| (corner(a)[n] as f64) * edges[n] * (scale[n] - 1.0));
            let cell = Cell::new(of(law), &u);
            let (k, s) = (tangent(&cell), linearised(&cell, small, UNTURNED));
            let ratio = stiffer(&k, &s, UNTURNED);
            assert!(ratio < 2.0, "{scale:?}: {ratio} of the linearised tangent");
            [ratio, stiffer(&k, small, UNTURNED)]
        });
        ratios.fold([0.0; 2], |most, own| [most[0].max(own[0]), most[1].max(own[1])])
    }

    /// Cells that are sheared, bent and turned.
    #[test]
    fn the_linearised_tangent_of_uneven_cells_is_about_half_of_the_true_one_or_more() {
        let (small, edges) = (small_strain(), soft().edges);
        let mut most = 0.0f64;
        for seed in 0..60 {
            let mut random = Random::new(seed);
            let size = 0.25 + 0.15 * random.signed();
            let u = field(|_, n| 0.5 * size * random.signed() * edges.f64()[n]);
            let cell = Cell::new(soft(), &u);
            let mean = cell.points.iter().fold(M3::zero(), |sum, p| sum + p.h * 0.125);
            let q = crate::kernels::polar::polar(M3::identity() + mean, UNTURNED);
            most = most.max(stiffer(&tangent(&cell), &linearised(&cell, &small, q), q));
        }
        assert!(most < 2.0, "{most}");
    }

    fn small_strain() -> Matrix {
        at_rest(soft().edges.f64(), soft())
    }

    #[test]
    fn the_stiffened_tangent_is_more_than_half_of_the_true_one() {
        // pressed along z, held or free to spread aside
        let pressed = [(0.2, 0.0), (0.4, 0.0), (0.6, 0.0), (0.7, 0.0), (0.3, 1.0), (0.5, 1.0), (0.7, 1.0)];
        let scales = pressed.map(|(by, aside): (f64, f64)| {
            let stretch = 1.0 - by;
            let across = 1.0 + aside * (1.0 / f64::sqrt(stretch) - 1.0);
            [across, across, stretch]
        });
        let [_, plain] = most_stiff(Law::NeoHookean(MU), &small_strain(), scales.into_iter());
        assert!(plain > 4.0, "the counter-test: without it the true tangent is {plain} times as stiff");
    }

    /// Stretched in all directions or along one, to four times the volume at rest: what tension adds as a volume grows.
    #[test]
    fn the_stiffened_tangent_of_volumes_that_grow_is_more_than_half_of_the_true_one() {
        let volumes = [1.2, 1.5, 2.0, 2.72, 4.0];
        let evenly = volumes.map(|v: f64| [v.cbrt(); 3]);
        let upwards = volumes.map(|v| [1.0, 1.0, v]);
        let aside = volumes.map(|v: f64| [v.sqrt(), v.sqrt(), 1.0]);
        most_stiff(Law::NeoHookean(MU), &small_strain(), [evenly, upwards, aside].into_iter().flatten());
    }

    /// Largest `xᵀ K x / xᵀ S x` over all displacements of a cell, by power iteration; a millionth of the identity in `S` stands for the
    /// translations.
    fn largest(k: &Matrix, s: &Matrix) -> f64 {
        let size = (0..24).fold(0.0f64, |most, n| most.max(s[n][n]));
        let mut known = *s;
        (0..24).for_each(|n| known[n][n] += 1e-6 * size);
        // beyond every negative eigenvalue of a cell in tension
        const SHIFT: f64 = 2.0;
        let mut random = Random::new(11);
        let mut x: [f64; 24] = std::array::from_fn(|_| random.signed());
        let mut value = 0.0;
        for _ in 0..300 {
            let right: [f64; 24] =
                std::array::from_fn(|m| (0..24).map(|n| (k[m][n] + SHIFT * known[m][n]) * x[n]).sum());
            let next = solved(known, right);
            let norm = next.iter().map(|x| x * x).sum::<f64>().sqrt();
            value = next.iter().zip(x).map(|(a, b)| a * b).sum::<f64>() - SHIFT;
            x = next.map(|x| x / norm);
        }
        value
    }

    /// Solution by Gaussian elimination, without pivots: for positive definite matrices.
    fn solved(mut a: Matrix, mut b: [f64; 24]) -> [f64; 24] {
        for n in 0..24 {
            for m in n + 1..24 {
                let factor = a[m][n] / a[n][n];
                (n..24).for_each(|c| a[m][c] -= factor * a[n][c]);
                b[m] -= factor * b[n];
            }
        }
        for n in (0..24).rev() {
            let known: f64 = (n + 1..24).map(|c| a[n][c] * b[c]).sum();
            b[n] = (b[n] - known) / a[n][n];
        }
        b
    }

    /// Flat cells drawn along one axis or two and bent, all displacements, rotations as well.
    #[test]
    fn the_linearised_tangent_of_cells_in_tension_is_about_half_of_the_true_one_or_more() {
        let edges = [0.5556e-3, 0.5556e-3, 0.1e-3];
        let (young, poisson) = (1e6, 0.45);
        let (lambda, mu) = lame(young, poisson);
        let material =
            Material { edges: V3::of(edges), pre_strain: V3::zero(), bulk: lambda, law: Law::NeoHookean(mu) };
        let small = at_rest(edges, material);
        let (mut most, mut without) = (0.0f64, 0.0f64);
        for (seed, [along, aside]) in
            (0..40).flat_map(|seed| [[1.02, 0.99], [1.33, 0.87], [1.2, 1.2], [1.5, 1.0]].map(|s| (seed, s)))
        {
            let mut random = Random::new(seed);
            let scale = [along, aside, 1.0 / (along * aside)];
            let bent = if seed == 0 { 0.0 } else { 0.1 * edges[2] };
            let u = field(|a, n| corner(a)[n] as f64 * edges[n] * (scale[n] - 1.0) + bent * random.signed());
            let cell = Cell::new(material, &u);
            let mean = cell.points.iter().fold(M3::zero(), |sum, p| sum + p.h * 0.125);
            let q = crate::kernels::polar::polar(M3::identity() + mean, UNTURNED);
            let (k, held) = (tangent(&cell), small[0][0]);
            most = most.max(largest(&k, &linearised(&cell, &small, q)));
            without = without.max(largest(&k, &without_tension(&cell, &small, q, held)));
        }
        println!("{most} {without}");
        assert!(most < 2.0, "{most}");
        assert!(without > 5.0, "the counter-test: without tension {without}");
    }

    /// The same with fibres, whose stiffness at rest is in the small-strain matrix: stretched along them, across them and pressed.
    #[test]
    fn the_stiffened_tangent_of_fibres_is_more_than_half_of_the_true_one() {
        let directions = [[0.8, 0.6], [0.8, -0.6]];
        let crossed = [[0.8, 0.6], [-0.28, 0.96]];
        for (directions, dispersion, stiffness) in
            [(directions, 0.0, 1.0), (directions, 0.2, 30.0), (crossed, 0.1, 1.0), (crossed, 0.0, 100.0)]
        {
            let fibres = Fibres { directions, stiffness: stiffness * MU, growth: 2.0, dispersion };
            let law = Law::Holzapfel(MU, fibres);
            let small = at_rest(soft().edges.f64(), of(law));
            let mut scales = vec![[1.2, 1.2, 0.7], [1.1, 0.9, 1.0], [0.9, 1.1, 1.0], [1.0, 1.0, 0.6]];
            scales.extend([1.001, 1.05, 1.2, 1.5].map(|s: f64| [s, 1.0 / s.sqrt(), 1.0 / s.sqrt()]));
            scales.extend([1.001, 1.05, 1.2, 1.5].map(|s: f64| [1.0 / s.sqrt(), s, 1.0 / s.sqrt()]));
            let [most, plain] = most_stiff(law, &small, scales.into_iter());
            assert!(plain > 2.0, "{fibres:?}: the counter-test: {plain} without it, {most} with it");
            // what is in the matrix keeps the factor small where fibres begin to pull
            let first = field(|a, n| if n == 0 { 1e-3 * (corner(a)[0] as f64) * soft().edges.x } else { 0.0 });
            let cell = Cell::new(of(law), &first);
            let factor = cell.linearised(Some(1.0), UNTURNED, &cell.forces()).stiffening;
            assert!(factor < 2.0, "{fibres:?}: {factor}");
        }
    }

    /// A matrix that is the same in the mirrors x and y, which the products' form asks for.
    #[test]
    fn the_small_strain_matrix_of_fibres_has_the_cells_mirrors() {
        let edges = soft().edges.f64();
        let crossed = Fibres { directions: [[0.8, 0.6], [-0.28, 0.96]], ..FIBRES };
        let k = fibre_stiffness(edges, &of(Law::Holzapfel(MU, crossed)));
        let size = k[0][0].abs();
        for axis in 0..3 {
            let mirror = |a: usize| {
                (0..8).find(|b| {
                    let (own, other) = (corner(a), corner(*b));
                    (0..3).all(|n| (own[n] == other[n]) == (n != axis))
                })
            };
            for (m, row) in k.iter().enumerate() {
                for (n, entry) in row.iter().enumerate() {
                    let of = |m: usize| 3 * mirror(m / 3).expect("a corner") + m % 3;
                    let sign = if (m % 3 == axis) == (n % 3 == axis) { 1.0 } else { -1.0 };
                    let other = sign * k[of(m)][of(n)];
                    assert!((entry - other).abs() < 1e-12 * size, "{axis}: {m}, {n}: {entry} and {other}");
                }
            }
        }
    }

    #[test]
    fn at_rest_the_tangent_is_the_small_strain_element_in_constant_strain() {
        // in the neo-Hookean law BULK is λ, in the other the bulk modulus; fibres have a kink at rest
        for (law, lambda) in LAWS.into_iter().zip([BULK, BULK - MU * 2.0 / 3.0]) {
            as_small_strain(law, lambda);
        }
    }

    fn as_small_strain(law: Law, lambda: f64) {
        let tangent = tangent(&Cell::new(of(law), &[V3::zero(); 8]));
        let young = MU * (3.0 * lambda + 2.0 * MU) / (lambda + MU);
        let poisson = 0.5 * lambda / (lambda + MU);
        let edges = soft().edges.f64();
        let small = super::super::element::stiffness(edges, young, poisson, crate::scene::Element::Bbar);
        let gradient: [[f64; 3]; 3] = [[0.3, 0.2, -0.1], [0.5, -0.4, 0.7], [0.1, 0.6, 0.2]];
        let u = field(|a, i| (0..3).map(|n| gradient[i][n] * corner(a)[n] as f64 * edges[n]).sum());
        let (found, wanted) = (times(&tangent, &u), times(&small, &u));
        let scale = wanted.iter().flatten().fold(0.0f64, |m, f| m.max(f.abs()));
        for (f, w) in found.iter().flatten().zip(wanted.iter().flatten()) {
            assert!((f - w).abs() < 1e-12 * scale, "{f:e} {w:e}");
        }
    }
}
