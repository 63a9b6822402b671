//! Rotation of each cell: the one that maximises `tr(Rᵀ F)` ([`super::polar`]), `F = I + Σ_a u_a ⊗ ∇N_a` the mean deformation gradient,
//! starting from the last step's value.
//!
//! Units: u m, rotation unit quaternion (0 for a removed cell, which stays 0).

use super::polar::polars;
use super::{Params, Source, corner};
use crate::math::{M3, Real, V3, V4};

/// The shader.
pub const SOURCE: Source =
    Source { name: "rotations", wgsl: include_str!("rotations.wgsl"), params: Params::<f32>::FIELDS };

/// Updates all rotations from displacements.
pub fn rotations<R: Real>(
    params: &Params<R>,
    shape: &[V4<R>],        // [layer] cell edges m, mass of one corner kg
    layer_of: &[u32],       // [cells_z] layer
    split: &[u32],          // see `split`
    u: &[V4<R>],            // [node] m
    rotation: &mut [V4<R>], // [cell] quaternion
) {
    rotate_cells(params, shape, layer_of, split, u, 0, &mut rotation[..params.cell_count as usize]);
}

/// Cells from `first` on of [`rotations`].
pub fn rotate_cells<R: Real>(
    params: &Params<R>,
    shape: &[V4<R>],
    layer_of: &[u32],
    split: &[u32],
    u: &[V4<R>],
    first: usize,
    rotation: &mut [V4<R>],
) {
    let cells = first..first + rotation.len();
    let gradients: Vec<M3<R>> = cells.map(|cell| mean_gradient(params, shape, layer_of, split, u, cell)).collect();
    polars(&gradients, rotation);
}

/// `F = I + Σ_a u_a ⊗ ∇N_a` of a cell, at its centre.
pub fn mean_gradient<R: Real>(
    params: &Params<R>,
    shape: &[V4<R>],
    layer_of: &[u32],
    split: &[u32],
    u: &[V4<R>],
    cell: usize,
) -> M3<R> {
    let level = params.cell_at(cell)[2];
    let h = V3::from4(shape[layer_of[level] as usize]);
    let quarter = R::of(0.25);
    let g = V3::new(quarter / h.x, quarter / h.y, quarter / h.z);
    let mut f = M3::identity();
    for (a, node) in params.corner_nodes(split, cell).into_iter().enumerate() {
        let o = corner(a);
        let sign = |i: usize| if o[i] == 1 { R::one() } else { -R::one() };
        let gradient = V3::new(sign(0) * g.x, sign(1) * g.y, sign(2) * g.z);
        f = f + V3::from4(u[node]).outer(gradient);
    }
    f
}
