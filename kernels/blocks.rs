//! Blocks of `A` for the preconditioner: each node's 3×3 block `D`, and its coupling block `U` with the node above it.
//!
//! `D_i = s Σ_c R_c K_aa R_cᵀ + m_i (1 + h r_M)/h² I`, `U_i = s Σ_c R_c K_{a,a+4} R_cᵀ` over the up to four cells above the node. Where a cut has
//! put the two nodes of a cell's vertical edge into different columns, `U` omits their coupling and `D` counts the cell twice at both: a positive
//! definite matrix is at most twice its block diagonal, so the smoother's bound still holds. Fixed axes get the identity's row and column.
//! Hyperelastic cells add the stiffness of their volume and tension to `K` ([`super::linearised`]). `params.preconditioner`
//! selects the entries kept: 0 the identity, 1 the diagonal of `D`, 2 `D`, 3 `D` and `U`. Packed as 16 numbers per node: 6 of the symmetric `D`,
//! 9 of `U` by columns, one pad.
//! Units: N/m.

use super::linearised::{HYPERELASTIC, Rows, rows};
use super::split::Around;
use super::{PARALLEL, Params, Source};
use crate::math::wide::{Lanes, MOST, Packed, Task};
use crate::math::{M3, Number, Real, V3, V4, rotation_matrix};
use rayon::prelude::*;

/// The shader.
pub const SOURCE: Source = Source { name: "blocks", wgsl: include_str!("blocks.wgsl"), params: Params::<f32>::FIELDS };

/// Preconditioner blocks of a node.
#[derive(Clone, Copy, Debug)]
pub struct Block<R> {
    /// Symmetric.
    pub d: M3<R>,
    /// Coupling with the node above.
    pub g: M3<R>,
}

/// A symmetric matrix by its 6 numbers: xx xy xz yy; yz zz.
pub fn symmetric<R: Real>(a: V4<R>, b: V4<R>) -> M3<R> {
    M3([V3::new(a[0], a[1], a[2]), V3::new(a[1], a[3], b[0]), V3::new(a[2], b[0], b[1])])
}

/// Unpacks 16 numbers.
pub fn unpack<R: Real>(k: &[V4<R>]) -> Block<R> {
    let [a, b, c, e] = [k[0], k[1], k[2], k[3]];
    Block {
        d: symmetric(a, b),
        g: M3([V3::new(b[2], b[3], c[0]), V3::new(c[1], c[2], c[3]), V3::new(e[0], e[1], e[2])]),
    }
}

/// Packs into 16 numbers.
pub fn pack<R: Real>(k: Block<R>) -> [V4<R>; 4] {
    let [d0, d1, d2] = k.d.0;
    let [g0, g1, g2] = k.g.0;
    [[d0.x, d0.y, d0.z, d1.y], [d1.z, d2.z, g0.x, g0.y], [g0.z, g1.x, g1.y, g1.z], [g2.x, g2.y, g2.z, R::zero()]]
}

/// Stiffness of a cell at a corner, turned: with itself, and with the corner above, which only the lower ones have.
#[inline(always)]
pub fn of_corner<N: Number>(a: usize, own: M3<N>, upper: M3<N>, rotation: M3<N>, rows: Option<Rows<N>>) -> [M3<N>; 2] {
    let back = rotation.transpose();
    let (mut own, mut upper) = (own, upper);
    if let Some(rows) = rows {
        own = own + rows.between(a, a);
        if a < 4 {
            upper = upper + rows.between(a, a + 4);
        }
    }
    [rotation * own * back, if a < 4 { rotation * upper * back } else { upper }]
}

/// Turned stiffness of a cell: `[corner]` with itself, then `[lower corner]` with the corner above.
type OfCell<R> = [M3<R>; 12];

/// Computes consecutive cells of one layer, as many at once as a register holds.
struct Cells<'a, R> {
    params: &'a Params<R>,
    /// `[64]` blocks a×8+b of the layer, N/m
    stiffness: &'a [M3<R>],
    /// `[cell]` quaternion; `[cell × 3]` rows
    rotation: &'a [V4<R>],
    first: usize,
    out: &'a mut [OfCell<R>],
}

impl<R: Real> Task<R> for Cells<'_, R> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<R>>(self, lanes: L) {
        let Self { params, stiffness, rotation, first, out } = self;
        let hyperelastic = params.corotational >= HYPERELASTIC;
        for (group, out) in out.chunks_mut(L::COUNT).enumerate() {
            // rotations and rows by component; lanes without a cell repeat the last one
            let mut numbers = [[[R::zero(); MOST]; 4]; 4];
            for i in 0..L::COUNT {
                let cell = first + group * L::COUNT + i.min(out.len() - 1);
                let mut own = [rotation[cell], [R::zero(); 4], [R::zero(); 4], [R::zero(); 4]];
                if hyperelastic {
                    own[1..].copy_from_slice(rows(params, rotation, cell));
                }
                for (to, from) in numbers.as_flattened_mut().iter_mut().zip(own.as_flattened()) {
                    to[i] = *from;
                }
            }
            let zero = Packed::splat(lanes, R::zero());
            let mut loaded = [[zero; 4]; 4];
            for (loaded, from) in loaded.as_flattened_mut().iter_mut().zip(numbers.as_flattened()) {
                *loaded = Packed::load(lanes, from);
            }
            let [q, x, y, z] = loaded;
            let rows = if hyperelastic { Some(Rows::unpacked([x, y, z])) } else { None };
            let rotation = rotation_matrix(q);
            for a in 0..8 {
                let (own, upper) = (stiffness[a * 8 + a].packed(lanes), stiffness[a * 8 + (a | 4)].packed(lanes));
                let [d, u] = of_corner(a, own, upper, rotation, rows);
                unpack_lanes(d, a, out);
                if a < 4 {
                    unpack_lanes(u, 8 + a, out);
                }
            }
        }
    }
}

/// Writes the lanes of a matrix to number `at` of each cell.
#[inline(always)]
fn unpack_lanes<R: Real, L: Lanes<R>>(m: M3<Packed<R, L>>, at: usize, out: &mut [OfCell<R>]) {
    let mut numbers = [[[R::zero(); MOST]; 3]; 3];
    for (to, column) in numbers.iter_mut().zip(m.0) {
        column.x.store(&mut to[0]);
        column.y.store(&mut to[1]);
        column.z.store(&mut to[2]);
    }
    for (i, of) in out.iter_mut().enumerate() {
        for (column, from) in of[at].0.iter_mut().zip(&numbers) {
            *column = V3::new(from[0][i], from[1][i], from[2][i]);
        }
    }
}

/// Most cells of a level that the twin computes at once.
const BAND: usize = 4096;
/// Cells that a thread takes at once.
const CHUNK: usize = 128;

/// Computes the blocks of all nodes.
///
/// The twin takes the grid in bands of node rows, and a band level by level: it computes a level's cells, then adds those around each node.
pub fn blocks<R: Real>(
    params: &Params<R>,
    stiffness: &[M3<R>], // [layer × 64] blocks a×8+b, N/m
    layer_of: &[u32],    // [cells_z] layer
    rotation: &[V4<R>],  // [cell] quaternion
    dofs: &[V4<R>],      // [node] 1 free, 0 fixed, per axis; mass kg
    split: &[u32],       // see `split`
    block: &mut [V4<R>], // [node × 4] packed
) {
    let of_layer = |level: usize| &stiffness[layer_of[level] as usize * 64..][..64];
    let complete = |i: usize, [d, g]: [M3<R>; 2]| {
        let above = params.above(i);
        let axes_above = if above < params.node_count as usize { V3::from4(dofs[above]) } else { V3::zero() };
        finish(params, Block { d, g }, dofs[i], axes_above)
    };
    let [width, depth, height] = [params.cells_x, params.cells_y, params.cells_z].map(|n| n as usize);
    let (nodes, grid_nodes) = (params.nodes_x as usize, params.grid_nodes());
    let (grid, duplicates) = block.as_chunks_mut::<4>().0.split_at_mut(grid_nodes);
    let rows_at_once = (BAND / width).max(1);
    let [mut below, mut above] = [vec![], vec![]];
    // bands of node rows
    for first in (0..=depth).step_by(rows_at_once) {
        let end = (first + rows_at_once).min(depth + 1);
        let cells = first.saturating_sub(1) * width..end.min(depth) * width; // of a level
        below.resize(cells.len(), [M3::zero(); 12]);
        above.resize(cells.len(), [M3::zero(); 12]);
        for level in 0..=height {
            std::mem::swap(&mut below, &mut above);
            // blocks of the cells above these nodes
            if level < height {
                let begin = level * width * depth + cells.start;
                let some = |(chunk, out): (usize, &mut [OfCell<R>])| {
                    let first = begin + chunk * CHUNK;
                    R::widest(Cells { params, stiffness: of_layer(level), rotation, first, out });
                };
                above.par_chunks_mut(CHUNK).enumerate().with_min_len(PARALLEL / 8 / CHUNK).for_each(some);
            }
            // sums of the cells around each node; of split cells those with this node at the corner
            let start = (level * (depth + 1) + first) * nodes;
            let one = |(n, out): (usize, &mut [V4<R>; 4])| {
                let i = start + n;
                let mut sums = [M3::zero(); 2];
                for a in 0..8 {
                    let at = [n % nodes, first + n / nodes, level];
                    let Some(cell) = params.cell_below(at, a) else { continue };
                    let of_cell = if a < 4 { &above } else { &below };
                    let own = &of_cell[cell % (width * depth) - cells.start];
                    let chained = match params.is_split(split, cell) {
                        false => true,
                        true => {
                            let corners = params.corner_nodes(split, cell);
                            if corners[a] != i {
                                continue;
                            }
                            is_chained(params, i, a, &corners)
                        }
                    };
                    add(&mut sums, a, [own[a], own[8 + a % 4]], chained);
                }
                *out = complete(i, sums);
            };
            let band = &mut grid[start..][..(end - first) * nodes];
            band.par_iter_mut().enumerate().with_min_len(PARALLEL / 8).for_each(one);
        }
    }
    // duplicates, each from its own cells
    let one_duplicate = |(n, out): (usize, &mut [V4<R>; 4])| {
        let i = grid_nodes + n;
        let mut sums = [M3::zero(); 2];
        for Around { corner: a, cell, level } in params.cells_around(split, i) {
            let rows = (params.corotational >= HYPERELASTIC).then(|| Rows::of(params, rotation, cell));
            let [own, upper] = [a, a | 4].map(|b| of_layer(level)[a * 8 + b]);
            let own = of_corner(a, own, upper, rotation_matrix(rotation[cell]), rows);
            add(&mut sums, a, own, is_chained(params, i, a, &params.corner_nodes(split, cell)));
        }
        *out = complete(i, sums);
    };
    duplicates.par_iter_mut().enumerate().with_min_len(PARALLEL / 8).for_each(one_duplicate);
}

/// Whether the vertical edge of a cell at its corner `a`, a node, is within the node's column.
pub fn is_chained<R: Real>(params: &Params<R>, node: usize, a: usize, corners: &[usize; 8]) -> bool {
    let other = corners[a ^ 4];
    if a < 4 { other == params.above(node) } else { params.above(other) == node }
}

/// Adds a cell's `D` and `U` at its corner `a`.
fn add<R: Real>([d, g]: &mut [M3<R>; 2], a: usize, own: [M3<R>; 2], chained: bool) {
    *d = *d + own[0] * R::of(if chained { 1.0 } else { 2.0 });
    if a < 4 && chained {
        *g = *g + own[1];
    }
}

/// A block between two nodes with these DOF masks.
pub fn masked<R: Real>(m: M3<R>, rows: V3<R>, columns: V3<R>) -> M3<R> {
    M3([m.0[0].times(rows) * columns.x, m.0[1].times(rows) * columns.y, m.0[2].times(rows) * columns.z])
}

/// Multiplies by the stiffness factor, adds inertia, eliminates fixed axes and selects the entries for the preconditioner.
pub fn finish<R: Real>(params: &Params<R>, sum: Block<R>, dofs: V4<R>, axes_above: V3<R>) -> [V4<R>; 4] {
    let axes = V3::from4(dofs);
    let inertia = M3::diagonal(V3::splat(params.inertia * dofs[3]));
    let fixed = M3::diagonal(V3::splat(R::one()) - axes);
    let mut d = masked(sum.d * params.stiffness_factor + inertia, axes, axes) + fixed;
    let mut g = masked(sum.g * params.stiffness_factor, axes, axes_above);
    if params.preconditioner == 0 {
        d = M3::identity();
    } else if params.preconditioner == 1 {
        d = M3::diagonal(V3::new(d.0[0].x, d.0[1].y, d.0[2].z));
    }
    if params.preconditioner < 3 {
        g = M3::zero();
    }
    pack(Block { d, g })
}
