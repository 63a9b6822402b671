//! Product with the system matrix, matrix-free: `w = A z`, gathered per node, for each slot of a solve.
//!
//! `w_i = P_i (s Σ_c R_c Σ_b K_ab R_cᵀ z_b + m_i (1 + h r_M)/h² z_i)`, `s = 1 + r_K/h`, `P_i` the free axes. The dots `z·w` of the
//! conjugate gradients come with it. [`product`] is the shader's twin; [`product_by_cells`] is the CPU's fast form (each cell once,
//! then a gather), with its own parity test.
//! Units: z m, w N, K N/m.

use super::{Params, Source, corner};
use crate::math::{M3, Real, V3, V4, rotation_matrix};
use rayon::prelude::*;

/// The shader.
pub const SOURCE: Source = Source {
    name: "product",
    wgsl: include_str!("product.wgsl"),
    params: Params::<f32>::FIELDS,
};

/// One slot; returns `z·w`.
pub fn product<R: Real>(
    params: &Params<R>,
    stiffness: &[M3<R>], // [layer × 64] blocks a×8+b, N/m
    layer_of: &[u32],    // [cells_z] layer
    rotation: &[V4<R>],  // [cell] quaternion
    free: &[V4<R>],      // [node] 1 free, 0 held, per axis; mass kg
    z: &[V4<R>],         // [node] m
    w: &mut [V4<R>],     // [node] N
) -> R {
    let mut dot = R::zero();
    for i in 0..params.node_count as usize {
        let c = params.node_at(i);
        let mut sum = V3::zero();
        for a in 0..8 {
            let Some(cell) = params.cell_below(c, a) else {
                continue;
            };
            let q = rotation[cell];
            if q == [R::zero(); 4] {
                continue;
            }
            let layer = layer_of[c[2] - corner(a)[2]] as usize;
            let r = rotation_matrix(q);
            let turned = r.transpose();
            let mut local = V3::zero();
            for (b, node) in params.corners(cell).into_iter().enumerate() {
                local += stiffness[layer * 64 + a * 8 + b] * (turned * V3::from4(z[node]));
            }
            sum += r * local;
        }
        let own = V3::from4(z[i]);
        let out = (sum * params.stiffness_factor + own * (params.inertia * free[i][3]))
            .times(V3::from4(free[i]));
        w[i] = out.pad(R::zero());
        dot += own.dot(out);
    }
    dot
}

/// Forces of one cell on its corners, 3 numbers per corner.
pub type CellForces<R> = [R; 24];

/// The same result in another order of operations: forces per cell, on all cores, then a gather by node.
pub fn product_by_cells<R: Real>(
    params: &Params<R>,
    columns: &[CellForces<R>], // [layer × 24] columns of the 24×24 matrix, N/m
    layer_of: &[u32],          // [cells_z] layer
    rotation: &[V4<R>],        // [cell] quaternion
    free: &[V4<R>],            // [node] 1 free, 0 held, per axis; mass kg
    z: &[V4<R>],               // [node] m
    w: &mut [V4<R>],           // [node] N
    scratch: &mut [CellForces<R>], // [cell] N
) -> R {
    let row = params.cells_x as usize;
    scratch
        .par_chunks_mut(row * 4)
        .enumerate()
        .for_each(|(chunk, forces)| {
            for (k, out) in forces.iter_mut().enumerate() {
                let cell = chunk * row * 4 + k;
                *out = cell_product(params, columns, layer_of, rotation[cell], cell, z);
            }
        });
    gather_cells(params, free, z, scratch, w)
}

fn cell_product<R: Real>(
    params: &Params<R>,
    columns: &[CellForces<R>],
    layer_of: &[u32],
    q: V4<R>,
    cell: usize,
    z: &[V4<R>],
) -> CellForces<R> {
    let mut sum = [R::zero(); 24];
    if q == [R::zero(); 4] {
        return sum;
    }
    let corners = params.corners(cell);
    let layer = layer_of[params.cell_at(cell)[2]] as usize;
    let columns = &columns[layer * 24..layer * 24 + 24];
    let r = rotation_matrix(q);
    let turned = r.transpose();
    for (b, node) in corners.into_iter().enumerate() {
        let local = turned * V3::from4(z[node]);
        for (axis, value) in [local.x, local.y, local.z].into_iter().enumerate() {
            let column = &columns[b * 3 + axis];
            for (s, k) in sum.iter_mut().zip(column) {
                *s += *k * value;
            }
        }
    }
    for a in 0..8 {
        let f = r * V3::new(sum[a * 3], sum[a * 3 + 1], sum[a * 3 + 2]);
        [sum[a * 3], sum[a * 3 + 1], sum[a * 3 + 2]] = [f.x, f.y, f.z];
    }
    sum
}

fn gather_cells<R: Real>(
    params: &Params<R>,
    free: &[V4<R>],
    z: &[V4<R>],
    scratch: &[CellForces<R>],
    w: &mut [V4<R>],
) -> R {
    let row = params.nodes_x as usize;
    let count = params.node_count as usize;
    w[..count]
        .par_chunks_mut(row * 8)
        .enumerate()
        .map(|(chunk, out)| {
            let mut dot = R::zero();
            for (k, slot) in out.iter_mut().enumerate() {
                let i = chunk * row * 8 + k;
                let c = params.node_at(i);
                let mut sum = V3::zero();
                for a in 0..8 {
                    if let Some(cell) = params.cell_below(c, a) {
                        let f = &scratch[cell];
                        sum += V3::new(f[a * 3], f[a * 3 + 1], f[a * 3 + 2]);
                    }
                }
                let own = V3::from4(z[i]);
                let value = (sum * params.stiffness_factor + own * (params.inertia * free[i][3]))
                    .times(V3::from4(free[i]));
                *slot = value.pad(R::zero());
                dot += own.dot(value);
            }
            dot
        })
        .collect::<Vec<_>>() // summed in a fixed order below, whatever the threads do
        .into_iter()
        .sum()
}
