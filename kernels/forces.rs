//! Elastic forces of the hexahedra, gathered per node.
//!
//! `f_i = Σ_c R_c Σ_b K_ab (R_cᵀ u_b + (R_cᵀ − I) X_b + e∘X_b)`: the internal force, so the body acts with −f. `e` is the pre-strain of the
//! layer (elastic strain at rest, along the cell's axes), so `e∘X_b` is the displacement that it stands for. `X_b` is the corner's rest
//! position relative to the cell's centre; with displacements, f32 loses nothing far from the origin. The node's own displacement is
//! subtracted first: K has no force for a translation, but in f32 a body displaced by its own length would get an error of `ε K u`. The
//! step uses the corotated stiffness R K Rᵀ as the Jacobian ∂f/∂u. It omits the derivative of `R_c`, so a strained or pre-strained body has
//! no geometric stiffness: the error of one step is about the strain, and the steps converge to the equilibrium of `f`.
//! Source: Müller, Gross 2004 (corotational elements); K from `bodies::grid::element`.
//! Units: u m, K N/m, f N.

use super::split::Around;
use super::{Params, Source, corner};
use crate::math::{M3, Real, V3, V4, rotation_matrix, rotation_minus_identity};

/// The shader.
pub const SOURCE: Source = Source { name: "forces", wgsl: include_str!("forces.wgsl"), params: Params::<f32>::FIELDS };

/// Rest position of corner `b` from the centre of a cell with edges `h`.
pub fn rest_corner<R: Real>(h: V3<R>, b: usize) -> V3<R> {
    let o = corner(b);
    let sign = |i: usize| R::of(o[i] as f64 - 0.5);
    V3::new(sign(0) * h.x, sign(1) * h.y, sign(2) * h.z)
}

/// Elastic forces.
pub fn forces<R: Real>(
    params: &Params<R>,
    shape: &[V4<R>],      // [layer] cell edges m, mass of one corner kg
    pre_strain: &[V4<R>], // [layer] elastic strain at rest along x, y, z
    stiffness: &[M3<R>],  // [layer × 64] blocks a×8+b, N/m
    layer_of: &[u32],     // [cells_z] layer
    split: &[u32],        // see `split`
    u: &[V4<R>],          // [node] m
    rotation: &[V4<R>],   // [cell] quaternion
    f: &mut [V4<R>],      // [node] N
) {
    for (i, out) in f.iter_mut().enumerate() {
        *out = node_force(params, shape, pre_strain, stiffness, layer_of, split, u, rotation, i).pad(R::zero());
    }
}

/// One node of [`forces`].
pub fn node_force<R: Real>(
    params: &Params<R>,
    shape: &[V4<R>],
    pre_strain: &[V4<R>],
    stiffness: &[M3<R>],
    layer_of: &[u32],
    split: &[u32],
    u: &[V4<R>],
    rotation: &[V4<R>],
    i: usize,
) -> V3<R> {
    let own = V3::from4(u[i]);
    let mut sum = V3::zero();
    for Around { corner: a, cell, level } in params.cells_around(split, i) {
        let q = rotation[cell];
        if q == [R::zero(); 4] {
            continue;
        }
        let layer = layer_of[level] as usize;
        let h = V3::from4(shape[layer]);
        let e = V3::from4(pre_strain[layer]);
        let r = rotation_matrix(q);
        let change = rotation_minus_identity(q).transpose();
        // force in the cell's frame
        let mut local = V3::zero();
        for (b, node) in params.corner_nodes(split, cell).into_iter().enumerate() {
            let x = rest_corner(h, b);
            let pulled = V3::new(e.x * x.x, e.y * x.y, e.z * x.z);
            let stretch = r.transpose() * (V3::from4(u[node]) - own) + change * x + pulled;
            local += stiffness[layer * 64 + a * 8 + b] * stretch;
        }
        sum += r * local;
    }
    sum
}
