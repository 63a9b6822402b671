//! Blocks of `A` for the preconditioner: each node's 3×3 block `D`, and its coupling block `U` with the node above it.
//!
//! `D_i = s Σ_c R_c K_aa R_cᵀ + m_i (1 + h r_M)/h² I`, `U_i = s Σ_c R_c K_{a,a+4} R_cᵀ` over the up to four cells above the node. Where a cut has
//! put the two nodes of a cell's vertical edge into different columns, `U` omits their coupling and `D` counts the cell twice at both: a positive
//! definite matrix is at most twice its block diagonal, so the smoother's bound still holds. Fixed axes get the identity's row and column.
//! Hyperelastic cells add the stiffness of their volume and tension to `K` ([`super::linearised`]). `params.preconditioner`
//! selects the entries kept: 0 the identity, 1 the diagonal of `D`, 2 `D`, 3 `D` and `U`. Packed as 16 numbers per node: 6 of the symmetric `D`,
//! 9 of `U` by columns, one pad.
//! Units: N/m.

use super::linearised::{HYPERELASTIC, Rows};
use super::split::Around;
use super::{PARALLEL, Params, Source};
use crate::math::{M3, Real, V3, V4, rotation_matrix};
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

/// Computes the blocks of all nodes.
pub fn blocks<R: Real>(
    params: &Params<R>,
    stiffness: &[M3<R>], // [layer × 64] blocks a×8+b, N/m
    layer_of: &[u32],    // [cells_z] layer
    rotation: &[V4<R>],  // [cell] quaternion
    free: &[V4<R>],      // [node] 1 free, 0 fixed, per axis; mass kg
    split: &[u32],       // see `split`
    block: &mut [V4<R>], // [node × 4] packed
) {
    let one_node = |i: usize, out: &mut [V4<R>; 4]| {
        let above = params.above(i);
        let mut sum = Block { d: M3::zero(), g: M3::zero() };
        for Around { corner: a, cell, level, nodes } in params.cells_around(split, i) {
            let other = nodes[a ^ 4]; // along the vertical edge
            let chained = if a < 4 { other == above } else { params.above(other) == i };
            let twice = R::of(if chained { 1.0 } else { 2.0 });
            let first = layer_of[level] as usize * 64 + a * 8;
            let rows = (params.corotational >= HYPERELASTIC).then(|| Rows::of(params, rotation, cell));
            let with = |b: usize| rows.map_or(stiffness[first + b], |rows| stiffness[first + b] + rows.between(a, b));
            let r = rotation_matrix(rotation[cell]);
            let turned = r.transpose();
            sum.d = sum.d + r * with(a) * turned * twice;
            if a < 4 && chained {
                sum.g = sum.g + r * with(a + 4) * turned;
            }
        }
        let axes_above = if above < params.node_count as usize { V3::from4(free[above]) } else { V3::zero() };
        *out = finish(params, sum, free[i], axes_above);
    };
    let nodes = block.as_chunks_mut::<4>().0;
    nodes.par_iter_mut().enumerate().with_min_len(PARALLEL / 8).for_each(|(i, out)| one_node(i, out));
}

/// Multiplies by the stiffness factor, adds inertia, eliminates fixed axes and selects the entries for the preconditioner.
pub fn finish<R: Real>(params: &Params<R>, sum: Block<R>, free: V4<R>, axes_above: V3<R>) -> [V4<R>; 4] {
    let axes = V3::from4(free);
    let inertia = M3::diagonal(V3::splat(params.inertia * free[3]));
    let masked = |m: M3<R>, right: V3<R>| {
        M3([m.0[0].times(axes) * right.x, m.0[1].times(axes) * right.y, m.0[2].times(axes) * right.z])
    };
    let fixed = M3::diagonal(V3::splat(R::one()) - axes);
    let mut d = masked(sum.d * params.stiffness_factor + inertia, axes) + fixed;
    let mut g = masked(sum.g * params.stiffness_factor, axes_above);
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
