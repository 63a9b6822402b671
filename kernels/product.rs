//! Matrix-free product with the system matrix: `w = A z`, for each right-hand side of a solve.
//!
//! `w_i = P_i (s Σ_c (R_c K R_cᵀ z)_i + m_i (1 + h r_M)/h² z_i)`, `s = 1 + r_K/h`, `P_i` the DOF mask; also computes the dot product `z·w`
//! of the conjugate gradients.
//!
//! A box of isotropic material is symmetric in three mirrors. In the basis of the eight sign patterns of its corners (the Hadamard matrix
//! H, Σ over corners of ±) its 24×24 matrix therefore decouples into eight symmetric 3×3 blocks, one per parity of the three mirrors:
//! `K = H B H`, block `P` couples the x-displacement in pattern `P⊕1`, y in `P⊕2`, z in `P⊕4`. Pattern 0 is a translation and costs
//! nothing. This takes 342 operations per cell (patterns, rotations, blocks) instead of 720, and 72 numbers per layer instead of
//! 576. (The patterns are the hourglass base vectors of Flanagan, Belytschko 1981, here for the complete matrix of any element.)
//!
//! The shader sweeps tiles of 8×8 cell columns upwards through slabs of 4 levels of nodes: corner forces are shared in workgroup memory, and
//! the inner 7×7 nodes gather. A level costs a GPU the time of a memory access whatever the grid's size, and slabs run side by side; the
//! cells between two slabs are computed in both.
//!
//! The twin sweeps strips of node rows upwards, one strip per core at a time. A level's cells have the numbers of the nodes at their lowest
//! corner, so a register ([`crate::math::wide`]) holds consecutive cells, also across the ends of rows; the entry after a row's last cell
//! is an empty one. Each level's vectors are first re-arranged by component (its rotations have been, once a step: [`Frames`]), forces are
//! accumulated in the same layout, those on the corners at the two ends of cells along x in planes of their own, and a level of nodes is
//! complete when the cells on both sides are. Neighbouring strips both compute the row of cells between them (1 in 7 to 17); one thread alone
//! sweeps all rows at once, with a sum for each strip. Strips depend on the grid alone, and in each plane a node's cells are added in
//! ascending order, so the order of sums is the same for any number of threads and any register width.
//!
//! Split cells (`split`) and the rows of duplicate nodes are left to `split_product`.
//!
//! Rotations are used as `|q|² R(q)`: a zero quaternion gives no force, and a short one scales its cell's stiffness by `|q|⁴`.
//!
//! A hyperelastic cell has the stiffness of its volume and tension apart from `K` ([`super::linearised`]): 18 and 39 operations.
//!
//! Cost per cell in the twin: 26 operations for the rotation matrix, 144 for the patterns, 126 for rotating there and back, 72 for the
//! blocks, 24 to accumulate forces, 28 for its node: 420, with a fused multiply-add counted once (552 counted twice). Memory: z, w, mass
//! and rotation, 64 bytes in f32, 128 in f64; everything else stays in a core's cache (18 numbers for each node of 18 rows).
//! Units: z m, w N, B N/m.

use super::linearised::HYPERELASTIC;
use super::{Params, Source};
use crate::math::wide::{Lanes, MOST, Task};
use crate::math::wide::{add_products, dot, patterns, rotation_minus_one, rotation_rows};
use crate::math::{Real, V4};
use rayon::prelude::*;
use std::any::Any;
use std::ops::Range;

/// The shader.
pub const SOURCE: Source =
    Source { name: "product", wgsl: include_str!("product.wgsl"), params: Params::<f32>::FIELDS };

/// Nodes along a side of a workgroup's tile.
pub const TILE: u32 = 7;
/// Levels of nodes of a workgroup's tile.
pub const SLAB: u32 = 4;

/// Workgroups of the shader per right-hand side.
pub fn tiles<R: Real>(params: &Params<R>) -> usize {
    (params.nodes_x.div_ceil(TILE) * params.nodes_y.div_ceil(TILE) * params.nodes_z.div_ceil(SLAB)) as usize
}

/// Element matrix of a layer as the eight 3×3 blocks of `B`, by rows.
pub type Modes<R> = [[[R; 3]; 3]; 8];

/// Unit of the twin's scratch memory.
pub type CellForces<R> = [[[R; LANES]; 3]; 8];

/// Length of the last dimension of [`CellForces`].
pub const LANES: usize = MOST;

/// Node rows of a strip: many enough that the shared row of cells costs little, few enough for many cores.
const STRIP: usize = 16;
/// Minimum number of node rows of a strip, for small grids with fewer than four strips.
const NARROW: usize = 6;
/// Minimum number of cells for a product on several threads.
const ALONE: usize = 2048;
/// Planes of a strip's scratch: z and forces of two sets of corners at two levels, by component.
const PLANES: usize = 18;
/// Planes of the rotations of a level, by component.
const ROTATION_PLANES: usize = 4;
/// Further planes of hyperelastic cells: the stiffness of their volume and tension.
const LINEARISED_PLANES: usize = 12;

/// Node rows of each strip.
fn strips<R: Real>(params: &Params<R>) -> Vec<Range<usize>> {
    let rows = params.nodes_y as usize;
    // an even number, since three strips take two threads as long as four
    let even = |count: usize| count / 2 * 2;
    let most = even(rows / STRIP).max(4);
    let count = if (params.cell_count as usize) < ALONE { 1 } else { even(rows / NARROW).clamp(1, most) };
    (0..count).map(|s| rows * s / count..rows * (s + 1) / count).collect()
}

/// Length of a plane of a strip: its rows with one on both sides, the diagonal corner, and one additional register at the end.
fn plane_len<R: Real>(params: &Params<R>, rows: usize) -> usize {
    (rows + 2) * params.nodes_x as usize + 1 + MOST
}

/// Units of scratch that a product needs.
pub fn cell_groups<R: Real>(params: &Params<R>) -> usize {
    strips(params).iter().map(|rows| strip_pieces(params, rows)).sum()
}

fn strip_pieces<R: Real>(params: &Params<R>, rows: &Range<usize>) -> usize {
    (PLANES * plane_len(params, rows.len())).div_ceil(24 * LANES)
}

/// Rotations of all cells, and the stiffness of the volume of hyperelastic ones, by component for the twin's registers: `[level][component]`
/// planes in which cells have the numbers of the nodes at their lowest corner. Split cells have none.
#[derive(Clone, Debug, Default)]
pub struct Frames<R> {
    planes: Vec<R>,
}

impl<R: Real> Frames<R> {
    /// From quaternions and rows `y`, `[cell]` and `[cell × 3]`, and the table of split cells.
    pub fn new(params: &Params<R>, rotation: &[V4<R>], split: &[u32]) -> Self {
        let mut frames = Self::default();
        frames.update(params, rotation, split);
        frames
    }

    /// Takes over new ones.
    pub fn update(&mut self, params: &Params<R>, rotation: &[V4<R>], split: &[u32]) {
        let (planes, len) = Self::sizes(params);
        let (cells_x, nodes_x) = (params.cells_x as usize, params.nodes_x as usize);
        self.planes.resize(params.cells_z as usize * planes * len, R::zero());
        let one_level = |(k, level): (usize, &mut [R])| {
            let mut planes = level.chunks_exact_mut(len);
            let mut take = || planes.next().expect("all components of a level");
            let mut q: [_; ROTATION_PLANES] = std::array::from_fn(|_| take());
            for y in 0..params.cells_y as usize {
                let first = params.cell_id([0, y, k]);
                spread(&rotation[first..][..cells_x], &mut q, y * nodes_x);
                if params.extra_columns > 0 {
                    leave_out(&split[params.layout().row + first..][..cells_x], &mut q, y * nodes_x);
                }
            }
            if params.corotational >= HYPERELASTIC {
                let mut rows: [_; LINEARISED_PLANES] = std::array::from_fn(|_| take());
                for y in 0..params.cells_y as usize {
                    let first = params.cell_count as usize + 3 * params.cell_id([0, y, k]);
                    spread_rows(&rotation[first..][..3 * cells_x], &mut rows, y * nodes_x);
                }
            }
        };
        self.planes.par_chunks_exact_mut(planes * len).enumerate().for_each(one_level);
    }

    /// These, if they are in this precision.
    pub fn same<S: Real>(&self) -> Option<&Frames<S>> {
        (self as &dyn Any).downcast_ref()
    }

    /// Size, bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.planes[..])
    }

    /// Number of planes of a level, and their length: all rows, and a register at the end.
    fn sizes(params: &Params<R>) -> (usize, usize) {
        let linearised = if params.corotational >= HYPERELASTIC { LINEARISED_PLANES } else { 0 };
        (ROTATION_PLANES + linearised, (params.cells_y * params.nodes_x) as usize + MOST)
    }

    /// Planes of a level.
    #[inline(always)]
    fn level(&self, params: &Params<R>, k: usize) -> std::slice::ChunksExact<'_, R> {
        let (planes, len) = Self::sizes(params);
        self.planes[k * planes * len..][..planes * len].chunks_exact(len)
    }
}

/// One right-hand side; returns `z·w`.
pub fn product<R: Real>(
    params: &Params<R>,
    modes: &[Modes<R>],            // [layer] N/m
    layer_of: &[u32],              // [cells_z] layer
    frames: &Frames<R>,            // of the cells
    dofs: &[V4<R>],                // [node] 1 free, 0 fixed, per axis; mass kg
    z: &[V4<R>],                   // [node] m
    w: &mut [V4<R>],               // [node] N
    scratch: &mut [CellForces<R>], // [cell_groups]
) -> R {
    let input = Input { params, modes, layer_of, frames, of: Of::System { dofs }, z };
    by_strips(input, w, scratch, |strip| R::widest(strip))
}

/// Elastic forces (see `kernels::forces`) in the form of the product: each cell once, with the patterns of `(Rᵀ − I) X + e∘X` added to
/// those of `Rᵀu`. Three of them are nonzero: `−4 h_i (Rᵀ − I + e_i I) e_i` in the pattern of axis `i`. The displacement of a cell's first
/// corner is subtracted first, so that f32 loses nothing in a body that has moved far.
pub fn elastic_forces<R: Real>(
    params: &Params<R>,
    shape: &[V4<R>],               // [layer] cell edges m, mass of one corner kg
    pre_strain: &[V4<R>],          // [layer] elastic strain at rest along x, y, z
    modes: &[Modes<R>],            // [layer] N/m, of stiffness alone
    layer_of: &[u32],              // [cells_z] layer
    frames: &Frames<R>,            // of the cells
    u: &[V4<R>],                   // [node] m
    f: &mut [V4<R>],               // [node] N
    scratch: &mut [CellForces<R>], // [cell_groups]
) {
    let input = Input { params, modes, layer_of, frames, of: Of::Elastic { shape, pre_strain }, z: u };
    by_strips(input, f, scratch, |strip| R::widest(strip));
}

fn by_strips<R: Real>(
    input: Input<R>,
    w: &mut [V4<R>],
    scratch: &mut [CellForces<R>],
    run: impl Fn(Strip<R>) -> R + Send + Sync,
) -> R {
    let params = input.params;
    let nodes_x = params.nodes_x as usize;
    // one thread takes all rows in one sweep, without the cells between strips twice, and adds up by strips all the same
    let strips = strips(params);
    let at_once = if rayon::current_num_threads() == 1 { strips.len() } else { 1 };
    let mut work: Vec<Strip<R>> = vec![];
    let mut rest = scratch;
    for parts in strips.chunks(at_once) {
        let rows = parts[0].start..parts[parts.len() - 1].end;
        let (own, others) = rest.split_at_mut(strip_pieces(params, &rows));
        rest = others;
        work.push(Strip { input, rows, parts, w: vec![], scratch: bytemuck::cast_slice_mut(own) });
    }
    for mut level in w[..params.grid_nodes()].chunks_exact_mut(nodes_x * params.nodes_y as usize) {
        for strip in &mut work {
            let (own, others) = level.split_at_mut(strip.rows.len() * nodes_x);
            level = others;
            strip.w.push(own);
        }
    }
    if work.len() == 1 {
        return work.into_iter().map(run).sum();
    }
    // summed in the order of strips, independent of the threads
    work.into_par_iter().map(run).collect::<Vec<_>>().into_iter().sum()
}

#[derive(Clone, Copy)]
struct Input<'a, R> {
    params: &'a Params<R>,
    modes: &'a [Modes<R>],
    layer_of: &'a [u32],
    frames: &'a Frames<R>,
    of: Of<'a, R>,
    z: &'a [V4<R>],
}

/// Operation.
#[derive(Clone, Copy)]
enum Of<'a, R> {
    /// `A z`: scaled, with inertia, fixed axes eliminated.
    System { dofs: &'a [V4<R>] },
    /// Elastic force at given displacements.
    Elastic { shape: &'a [V4<R>], pre_strain: &'a [V4<R>] },
}

/// Nodes of some rows, at all levels.
struct Strip<'a, R> {
    input: Input<'a, R>,
    rows: Range<usize>,
    parts: &'a [Range<usize>], // rows that are added up together
    w: Vec<&'a mut [V4<R>]>,   // [level] the strip's nodes
    scratch: &'a mut [R],
}

impl<R: Real> Task<R> for Strip<'_, R> {
    type Output = R;

    #[inline(always)]
    fn run<L: Lanes<R>>(self, lanes: L) -> R {
        let Strip { input, rows, parts, mut w, scratch } = self;
        let Input { params, modes, layer_of, frames, of, z } = input;
        let nodes_x = params.nodes_x as usize;
        let level_nodes = nodes_x * params.nodes_y as usize;
        // one row of cells more than of nodes, where the grid has it
        let cell_rows = rows.start.saturating_sub(1)..rows.end.min(params.cells_y as usize);
        let first = cell_rows.start * nodes_x;
        let (cells, nodes) = (cell_rows.len() * nodes_x, (cell_rows.len() + 1) * nodes_x);
        let own = rows.start * nodes_x - first..rows.end * nodes_x - first;

        // scratch planes: vectors and forces at two levels
        scratch.fill(R::zero());
        let len = plane_len(params, rows.len());
        let mut planes = scratch.chunks_exact_mut(len);
        let mut take = || planes.next().expect("PLANES of them");
        let mut three = || [take(), take(), take()];
        let (mut z_below, mut z_above) = (three(), three());
        // forces on the corners at the lower and at the upper end of cells along x: in one plane the sums of two corners would overlap in
        // memory, and each would wait for the one before to be written
        let (mut f_below, mut f_above) = ([three(), three()], [three(), three()]);
        let hyperelastic = params.corotational >= HYPERELASTIC && matches!(of, Of::System { .. });

        spread(&z[first..first + nodes], &mut z_below, 0);
        let mut along = vec![[R::zero(); MOST]; parts.len()];
        // sweep upwards
        for k in 0..params.nodes_z as usize {
            if k < params.cells_z as usize {
                spread(&z[(k + 1) * level_nodes + first..][..nodes], &mut z_above, 0);
                // rotations of these rows and all after them
                let mut planes = frames.level(params, k);
                let mut take = || &planes.next().expect("all components of a level")[first..];
                let q: [&[R]; ROTATION_PLANES] = [take(), take(), take(), take()];
                let mut linearised_planes = [q[0]; LINEARISED_PLANES];
                if hyperelastic {
                    linearised_planes.iter_mut().for_each(|plane| *plane = take());
                }
                let layer = layer_of[k] as usize;
                let blocks = &modes[layer];
                // forces of the cells between the two levels, a register at a time
                for at in (0..cells).step_by(L::COUNT) {
                    let corner = [at, at + 1, at + nodes_x, at + nodes_x + 1];
                    let mut rotation = [lanes.splat(R::zero()); 4];
                    for n in 0..4 {
                        rotation[n] = lanes.load(&q[n][at..]);
                    }
                    let mut at_corner = [[lanes.splat(R::zero()); 3]; 8];
                    for c in 0..4 {
                        for n in 0..3 {
                            at_corner[c][n] = lanes.load(&z_below[n][corner[c]..]);
                            at_corner[c + 4][n] = lanes.load(&z_above[n][corner[c]..]);
                        }
                    }
                    let [mut stretch, mut pulled] = [[lanes.splat(R::zero()); 3]; 2];
                    if let Of::Elastic { shape, pre_strain } = of {
                        // the lower corner has the positive sign in a pattern
                        for n in 0..3 {
                            stretch[n] = lanes.splat(shape[layer][n] * R::of(-4.0));
                            pulled[n] = lanes.mul(stretch[n], lanes.splat(pre_strain[layer][n]));
                        }
                        let first = at_corner[0];
                        for corner in &mut at_corner {
                            for n in 0..3 {
                                corner[n] = lanes.sub(corner[n], first[n]);
                            }
                        }
                    }
                    let mut linearised = None;
                    if hyperelastic {
                        let mut rows = [[lanes.splat(R::zero()); 4]; 3];
                        for n in 0..3 {
                            for i in 0..4 {
                                rows[n][i] = lanes.load(&linearised_planes[4 * n + i][at..]);
                            }
                        }
                        linearised = Some(rows);
                    }
                    let force = cell_forces(lanes, blocks, rotation, at_corner, stretch, pulled, linearised);
                    // corners in descending order: each plane gets its cells in ascending order, independent of the register width
                    for c in (0..4).rev() {
                        for n in 0..3 {
                            add_to(lanes, &mut f_below[c % 2][n][corner[c]..], force[c][n]);
                            add_to(lanes, &mut f_above[c % 2][n][corner[c]..], force[c + 4][n]);
                        }
                    }
                }
            }
            // the lower level is complete
            let w = &mut *w[k];
            gather(&f_below, own.start, w);
            if let Of::System { dofs } = of {
                let at = k * level_nodes + first;
                for (part, along) in parts.iter().zip(&mut along) {
                    let nodes = part.start * nodes_x - first..part.end * nodes_x - first;
                    let (dofs, z) = (&dofs[at..][nodes.clone()], &z[at..][nodes.clone()]);
                    finish(params, dofs, z, &mut w[nodes.start - own.start..nodes.end - own.start], along);
                }
            }
            std::mem::swap(&mut z_below, &mut z_above);
            std::mem::swap(&mut f_below, &mut f_above);
            f_above.as_flattened_mut().iter_mut().for_each(|plane| plane.fill(R::zero()));
        }
        along.iter().map(|part| part.iter().copied().sum::<R>()).sum()
    }
}

/// Writes vectors by component, starting at entry `at`.
#[inline(always)]
fn spread<R: Real, const N: usize>(from: &[V4<R>], to: &mut [&mut [R]; N], at: usize) {
    let planes = to.each_mut().map(|plane| &mut plane[at..][..from.len()]);
    for i in 0..from.len() {
        for n in 0..N {
            planes[n][i] = from[i][n];
        }
    }
}

/// The same of the three rows of each cell.
#[inline(always)]
fn spread_rows<R: Real>(from: &[V4<R>], to: &mut [&mut [R]; LINEARISED_PLANES], at: usize) {
    for (cell, rows) in from.as_chunks::<3>().0.iter().enumerate() {
        for (plane, value) in to.iter_mut().zip(rows.as_flattened()) {
            plane[at + cell] = *value;
        }
    }
}

/// Zeroes the rotations of split cells, starting at entry `at`.
#[inline(always)]
fn leave_out<R: Real>(row: &[u32], q: &mut [&mut [R]; 4], at: usize) {
    // most rows have none, which a register of them tells at once (one by one, 4 % of the time of incision.toml)
    if row.iter().fold(0, |any, word| any | word) == 0 {
        return;
    }
    for (x, _) in row.iter().enumerate().filter(|(_, row)| **row != 0) {
        q.iter_mut().for_each(|plane| plane[at + x] = R::zero());
    }
}

/// Forces of nodes from the planes of both ends of cells along x, starting at entry `at`.
#[inline(always)]
fn gather<R: Real>([near, far]: &[[&mut [R]; 3]; 2], at: usize, w: &mut [V4<R>]) {
    let count = w.len();
    let [x, y, z] = near.each_ref().map(|plane| &plane[at..][..count]);
    let [far_x, far_y, far_z] = far.each_ref().map(|plane| &plane[at..][..count]);
    for i in 0..count {
        w[i] = [x[i] + far_x[i], y[i] + far_y[i], z[i] + far_z[i], R::zero()];
    }
}

/// Multiplies forces by the stiffness factor, adds inertia and eliminates fixed axes; adds `z·w` to `along`.
#[inline(always)]
fn finish<R: Real>(params: &Params<R>, dofs: &[V4<R>], z: &[V4<R>], w: &mut [V4<R>], along: &mut [R; MOST]) {
    let count = w.len();
    let (dofs, z) = (&dofs[..count], &z[..count]);
    for i in 0..count {
        let [x, y, z_axis, mass] = dofs[i];
        let (axes, inertia) = ([x, y, z_axis, R::zero()], params.inertia * mass);
        for n in 0..4 {
            w[i][n] = (w[i][n] * params.stiffness_factor + z[i][n] * inertia) * axes[n];
        }
    }
    add_products(z.as_flattened(), w.as_flattened(), along);
}

#[inline(always)]
fn add_to<R: Real, L: Lanes<R>>(l: L, to: &mut [R], value: L::V) {
    l.store(l.add(l.load(to), value), to);
}

/// Forces of cells on their corners, without the factor `s`; corner numbers have bits x + 2y + 4z. `stretch_i (Rᵀ − I) e_i + pulled_i e_i`
/// is added to the pattern of axis `i`; `linearised` has the rows of a hyperelastic cell ([`super::linearised`]).
#[inline(always)]
pub(super) fn cell_forces<R: Real, L: Lanes<R>>(
    l: L,
    blocks: &Modes<R>,
    q: [L::V; 4],
    z: [[L::V; 3]; 8],
    stretch: [L::V; 3],
    pulled: [L::V; 3],
    linearised: Option<[[L::V; 4]; 3]>,
) -> [[L::V; 3]; 8] {
    // patterns in the cells' frames
    let r = rotation_rows(l, q);
    let a = patterns(l, z);
    let zero = l.splat(R::zero());
    let mut local = [[zero; 3]; 8];
    for p in 1..8 {
        for n in 0..3 {
            local[p][n] = dot(l, [r[0][n], r[1][n], r[2][n]], a[p]);
        }
    }
    // pattern of each axis: rest positions and pre-strain
    let turned = rotation_minus_one(l, q, r);
    for i in 0..3 {
        for n in 0..3 {
            local[1 << i][n] = l.mul_add(stretch[i], turned[i][n], local[1 << i][n]);
        }
        local[1 << i][i] = l.add(local[1 << i][i], pulled[i]);
    }
    // one 3×3 block per parity
    let mut force = [[zero; 3]; 8];
    for parity in 0..8 {
        let v = [local[parity ^ 1][0], local[parity ^ 2][1], local[parity ^ 4][2]];
        for n in 0..3 {
            let [a, b, c] = blocks[parity][n];
            force[parity ^ (1 << n)][n] = dot(l, [l.splat(a), l.splat(b), l.splat(c)], v);
        }
    }
    if let Some(rows) = linearised {
        // stiffness of the volume
        let along = |n: usize| dot(l, [rows[n][0], rows[n][1], rows[n][2]], local[1 << n]);
        let change = l.add(l.add(along(0), along(1)), along(2));
        for n in 0..3 {
            for i in 0..3 {
                force[1 << n][i] = l.mul_add(rows[n][i], change, force[1 << n][i]);
            }
        }
        // of tension: rotation
        let p = rows.map(|row| row[3]);
        let half = l.splat(R::of(0.5));
        for [i, j] in [[0, 1], [1, 2], [2, 0]] {
            let turned = l.sub(l.mul(p[i], local[1 << i][j]), l.mul(p[j], local[1 << j][i]));
            let turned = l.mul(half, turned);
            force[1 << i][j] = l.mul_add(p[i], turned, force[1 << i][j]);
            force[1 << j][i] = l.sub(force[1 << j][i], l.mul(p[j], turned));
        }
        // hourglass patterns
        let third = l.splat(R::of(1.0 / 3.0));
        let squares = p.map(|p| l.mul(l.mul(p, p), third));
        for n in 0..3 {
            let (a, b) = ((n + 1) % 3, (n + 2) % 3);
            let both = l.add(squares[a], squares[b]);
            for (pattern, k) in [
                (1 << n | 1 << a, squares[a]),
                (1 << n | 1 << b, squares[b]),
                (1 << a | 1 << b, both),
                (7, l.mul(third, both)),
            ] {
                force[pattern][n] = l.mul_add(k, local[pattern][n], force[pattern][n]);
            }
        }
    }
    // rotate back, and from patterns to corners
    let mut out = [[zero; 3]; 8];
    for p in 1..8 {
        for n in 0..3 {
            out[p][n] = dot(l, r[n], force[p]);
        }
    }
    patterns(l, out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::wide::{Arrays, OneByOne, Wide};

    /// Cells along x, y, z: several strips, rows that are no multiple of a register.
    const CELLS: [u32; 3] = [21, 40, 5];
    /// Rows that are shorter than a register.
    const NARROW_CELLS: [u32; 3] = [2, 5, 2];

    fn with<R: Real>(
        (cells, corotational): ([u32; 3], u32),
        run: impl Fn(Strip<R>) -> R + Send + Sync,
    ) -> (R, Vec<V4<R>>) {
        let [x, y, z] = cells;
        let layer_of = vec![0; z as usize];
        let (node_count, cell_count) = ((x + 1) * (y + 1) * (z + 1), x * y * z);
        let (nodes_x, nodes_y, nodes_z) = (x + 1, y + 1, z + 1);
        let (cells_x, cells_y, cells_z) = (x, y, z);
        let size = Params {
            nodes_x,
            nodes_y,
            nodes_z,
            node_count,
            cells_x,
            cells_y,
            cells_z,
            cell_count,
            corotational,
            ..Params::default()
        };
        let params = Params { inertia: R::of(0.7), stiffness_factor: R::of(1.3), ..size };
        assert_eq!(strips(&params).len() > 1, cells == CELLS);
        let wave = |i: usize, n: usize| R::of((1.7 * i as f64 + n as f64).sin());
        let field = |count: usize, first: usize| {
            (0..count).map(|i| [0, 1, 2, 3].map(|n| wave(i, first + n))).collect::<Vec<V4<R>>>()
        };
        let nodes = node_count as usize;
        let (rotation, dofs, z) = (field(params.frames(), 0), field(nodes, 4), field(nodes, 8));
        let modes = [[[[R::one(), R::of(0.2), R::of(0.1)]; 3]; 8]];
        let mut w = vec![[R::zero(); 4]; nodes];
        let mut scratch = vec![[[[R::one(); LANES]; 3]; 8]; cell_groups(&params)];
        let input = Input {
            params: &params,
            modes: &modes,
            layer_of: &layer_of,
            frames: &Frames::new(&params, &rotation, &[]),
            of: Of::System { dofs: &dofs },
            z: &z,
        };
        (by_strips(input, &mut w, &mut scratch, run), w)
    }

    /// Numbers and arrays of different widths against the registers of this machine.
    fn registers_agree<R: Real>() {
        for cells in [(CELLS, 1), (NARROW_CELLS, 1), (CELLS, HYPERELASTIC)] {
            let wide = with::<R>(cells, |strip| R::widest(strip));
            assert!(wide.1.iter().flatten().any(|a| a.f64().abs() > 1.0), "nothing is computed");
            assert_eq!(with::<R>(cells, |strip| strip.run(OneByOne)), wide, "{} one by one", R::NAME);
            assert_eq!(with::<R>(cells, |strip| strip.run(Arrays::<2>)), wide, "{} by 2", R::NAME);
            assert_eq!(with::<R>(cells, |strip| strip.run(Arrays::<4>)), wide, "{} by 4", R::NAME);
            assert_eq!(with::<R>(cells, |strip| strip.run(Arrays::<8>)), wide, "{} by 8", R::NAME);
            assert_eq!(with::<R>(cells, |strip| strip.run(Arrays::<16>)), wide, "{} by 16", R::NAME);
        }
    }

    #[test]
    fn registers_of_any_width_give_the_same_bits() {
        registers_agree::<f32>();
        registers_agree::<f64>();
    }

    #[test]
    fn any_number_of_threads_gives_the_same_bits() {
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.expect("a few threads can be had")
                .install(|| with::<f32>((CELLS, HYPERELASTIC), |strip| f32::widest(strip)))
        };
        let one = on(1);
        assert!(on(2) == one && on(3) == one);
    }

    #[test]
    fn strips_cover_all_rows_and_are_one_or_an_even_number() {
        for cells_y in 1..200 {
            let [nodes_y, cell_count] = [cells_y + 1, 5 * cells_y * cells_y];
            let strips = strips(&Params::<f32> { nodes_y, cells_y, cell_count, ..Params::default() });
            let ends: Vec<usize> = strips.iter().flat_map(|rows| [rows.start, rows.end]).collect();
            assert!(ends[0] == 0 && ends[ends.len() - 1] == nodes_y as usize, "{strips:?}");
            assert!(ends[1..ends.len() - 1].chunks(2).all(|pair| pair[0] == pair[1]), "{strips:?}");
            assert!(strips.len() == 1 || strips.len().is_multiple_of(2), "{cells_y}: {}", strips.len());
        }
    }
}
