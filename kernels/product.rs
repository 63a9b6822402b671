//! Product with the system matrix, matrix-free: `w = A z`, for each slot of a solve.
//!
//! `w_i = P_i (s Σ_c (R_c K R_cᵀ z)_i + m_i (1 + h r_M)/h² z_i)`, `s = 1 + r_K/h`, `P_i` the free axes; the dot `z·w` of the conjugate
//! gradients comes with it.
//!
//! A box of isotropic material looks the same in three mirrors, so in the basis of the eight sign patterns of its corners (the Hadamard
//! matrix H, Σ over corners of ±) its 24×24 matrix falls apart into eight symmetric 3×3 blocks, one per parity of the three mirrors:
//! `K = H B H`, block `P` couples the x-displacement in pattern `P⊕1`, y in `P⊕2`, z in `P⊕4`. Pattern 0 is a translation and costs
//! nothing. That is 342 operations a cell instead of 720, and 72 numbers a layer instead of 576. (The patterns are the hourglass base
//! vectors of Flanagan, Belytschko 1981, used here for the whole matrix, whatever the element.)
//!
//! The shader walks up tiles of 8×8 cell columns: each cell is computed once, its corner forces are shared in workgroup memory, and the
//! inner 7×7 nodes gather. The twin works on four cells at once, on all cores, and gathers in the same order.
//! Units: z m, w N, B N/m.

use super::{Params, Source};
use crate::math::{Real, V3, V4, rotation_matrix};
use rayon::prelude::*;
use std::ops::{Add, Mul, Sub};

/// The shader.
pub const SOURCE: Source =
    Source { name: "product", wgsl: include_str!("product.wgsl"), params: Params::<f32>::FIELDS };

/// Nodes along one side of a workgroup's tile.
pub const TILE: u32 = 7;

/// Workgroups of the shader per slot.
pub fn tiles<R: Real>(params: &Params<R>) -> usize {
    (params.nodes_x.div_ceil(TILE) * params.nodes_y.div_ceil(TILE)) as usize
}

/// Element matrix of a layer as the eight 3×3 blocks of `B`, by rows.
pub type Modes<R> = [[[R; 3]; 3]; 8];

/// Forces of four neighbouring cells on their corners: `[corner][axis][cell]`.
pub type CellForces<R> = [[[R; LANES]; 3]; 8];

/// Cells that are worked on at once.
pub const LANES: usize = 4;

/// One number of each of four cells.
#[derive(Clone, Copy, Debug)]
struct Lane<R>([R; LANES]);

macro_rules! lanewise {
    ($trait:ident, $fn:ident, $op:tt) => {
        impl<R: Real> $trait for Lane<R> {
            type Output = Self;
            #[inline(always)]
            fn $fn(self, o: Self) -> Self {
                Self(std::array::from_fn(|l| self.0[l] $op o.0[l]))
            }
        }
    };
}
lanewise!(Add, add, +);
lanewise!(Sub, sub, -);
lanewise!(Mul, mul, *);

impl<R: Real> Mul<R> for Lane<R> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, s: R) -> Self {
        Self(self.0.map(|a| a * s))
    }
}

/// Sums over the corners with the eight sign patterns; corner and pattern numbers are bits x + 2y + 4z.
#[inline(always)]
fn patterns<T: Copy + Add<Output = T> + Sub<Output = T>>(mut a: [[T; 3]; 8]) -> [[T; 3]; 8] {
    for bit in [1, 2, 4] {
        for low in 0..8 {
            if low & bit == 0 {
                for n in 0..3 {
                    let (p, q) = (a[low][n], a[low | bit][n]);
                    a[low][n] = p + q;
                    a[low | bit][n] = p - q;
                }
            }
        }
    }
    a
}

/// Groups of cells: each row of cells along x in parts of [`LANES`].
pub fn cell_groups<R: Real>(params: &Params<R>) -> usize {
    (params.cells_x as usize).div_ceil(LANES) * (params.cells_y * params.cells_z) as usize
}

/// One slot; returns `z·w`.
pub fn product<R: Real>(
    params: &Params<R>,
    modes: &[Modes<R>],            // [layer] N/m
    layer_of: &[u32],              // [cells_z] layer
    rotation: &[V4<R>],            // [cell] quaternion
    free: &[V4<R>],                // [node] 1 free, 0 held, per axis; mass kg
    z: &[V4<R>],                   // [node] m
    w: &mut [V4<R>],               // [node] N
    scratch: &mut [CellForces<R>], // [cell_groups]
) -> R {
    let row = (params.cells_x as usize).div_ceil(LANES);
    scratch.par_chunks_mut(row * 4).enumerate().for_each(|(chunk, forces)| {
        for (k, out) in forces.iter_mut().enumerate() {
            let line = chunk * 4 + k / row;
            *out = group_forces(params, modes, layer_of, rotation, z, line, k % row * LANES);
        }
    });
    gather(params, free, z, scratch, w)
}

/// Four cells of a line (row along x) from cell `from` on; cells that are not there, or dead, push nothing.
fn group_forces<R: Real>(
    params: &Params<R>,
    modes: &[Modes<R>],
    layer_of: &[u32],
    rotation: &[V4<R>],
    z: &[V4<R>],
    line: usize,
    from: usize,
) -> CellForces<R> {
    let (cells_x, cells_y) = (params.cells_x as usize, params.cells_y as usize);
    let level = line / cells_y;
    let last = cells_x - 1 - from;
    // a lane beyond the row's end repeats the last cell with a dead rotation
    let q: [V4<R>; LANES] =
        std::array::from_fn(|l| if l > last { [R::zero(); 4] } else { rotation[line * cells_x + from + l] });
    let m = q.map(rotation_matrix);
    let r = |i: usize, j: usize| {
        Lane(std::array::from_fn(|l| {
            let c = m[l].0[j];
            [c.x, c.y, c.z][i]
        }))
    };
    let r: [[Lane<R>; 3]; 3] = std::array::from_fn(|i| std::array::from_fn(|j| r(i, j)));
    let first = params.node_id([from, line % cells_y, level]);
    let (step_y, step_z) = (params.nodes_x as usize, (params.nodes_x * params.nodes_y) as usize);
    let mut a: [[Lane<R>; 3]; 8] = std::array::from_fn(|corner| {
        let base = first + (corner & 1) + (corner >> 1 & 1) * step_y + (corner >> 2) * step_z;
        std::array::from_fn(|n| Lane(std::array::from_fn(|l| z[base + l.min(last)][n])))
    });
    a = patterns(a);
    let zero = Lane([R::zero(); LANES]);
    let mut local = [[zero; 3]; 8];
    for (to, v) in local.iter_mut().zip(&a).skip(1) {
        *to = std::array::from_fn(|n| r[0][n] * v[0] + r[1][n] * v[1] + r[2][n] * v[2]);
    }
    let b = &modes[layer_of[level] as usize];
    let mut force = [[zero; 3]; 8];
    for (parity, block) in b.iter().enumerate() {
        let v: [Lane<R>; 3] = std::array::from_fn(|n| local[parity ^ (1 << n)][n]);
        for n in 0..3 {
            force[parity ^ (1 << n)][n] = v[0] * block[n][0] + v[1] * block[n][1] + v[2] * block[n][2];
        }
    }
    let mut out = [[zero; 3]; 8];
    for (to, v) in out.iter_mut().zip(&force).skip(1) {
        *to = std::array::from_fn(|n| r[n][0] * v[0] + r[n][1] * v[1] + r[n][2] * v[2]);
    }
    let dead = q.map(|q| if q == [R::zero(); 4] { R::zero() } else { R::one() });
    patterns(out).map(|v| v.map(|c| (c * Lane(dead)).0))
}

fn gather<R: Real>(params: &Params<R>, free: &[V4<R>], z: &[V4<R>], scratch: &[CellForces<R>], w: &mut [V4<R>]) -> R {
    let row = params.nodes_x as usize;
    let groups = (params.cells_x as usize).div_ceil(LANES);
    let one_node = |i: usize, slot: &mut V4<R>| -> R {
        let c = params.node_at(i);
        let mut sum = V3::zero();
        // the four cells below, then the four above
        for above in [1usize, 0] {
            let mut half = V3::zero();
            for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                let (x, y, k) = (c[0] + dx, c[1] + dy, c[2] + 1 - above);
                if x < 1
                    || y < 1
                    || k < 1
                    || x > params.cells_x as usize
                    || y > params.cells_y as usize
                    || k > params.cells_z as usize
                {
                    continue;
                }
                let cell = x - 1;
                let group = ((k - 1) * params.cells_y as usize + y - 1) * groups + cell / LANES;
                let f = &scratch[group][(1 - dx) + 2 * (1 - dy) + 4 * above];
                let l = cell % LANES;
                half += V3::new(f[0][l], f[1][l], f[2][l]);
            }
            sum += half;
        }
        let own = V3::from4(z[i]);
        let value = (sum * params.stiffness_factor + own * (params.inertia * free[i][3])).times(V3::from4(free[i]));
        *slot = value.pad(R::zero());
        own.dot(value)
    };
    let chunks = w[..params.node_count as usize].par_chunks_mut(row * 8).enumerate().map(|(chunk, out)| {
        let mut dot = R::zero();
        for (k, slot) in out.iter_mut().enumerate() {
            dot += one_node(chunk * row * 8 + k, slot);
        }
        dot
    });
    // summed in a fixed order, whatever the threads do
    chunks.collect::<Vec<_>>().into_iter().sum()
}
