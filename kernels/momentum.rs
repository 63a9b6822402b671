//! Nodal velocity of a consistent mass: `v̄_i = (M v)_i / m_i`, so that `M v = m v̄` with nodal masses.
//!
//! `v̄_i = v_i + Σ_c Σ_b m_ab (v_b − v_i) / m_i`, `m_ab = ρ V/8 · 8/27 · 2⁻ᵈ`, `d` the number of axes along which corners `a` and `b` of
//! the cell differ: `∫ ρ N_a N_b dV` of a trilinear box. The sum over `b` is `ρ V/8`, so `m_i` is also the lumped mass, a translation has
//! one velocity, and gravity on M equals gravity on `m`. Rotations cancel, since each block of M is a multiple of the identity.
//! Source: Archer 1963 (consistent mass); differs from SOFA's MeshMatrixMass, which has 1/20 on the diagonal and 1/40 along edges only.
//! Units: v m/s, masses kg.

use super::split::Around;
use super::{Params, Source, corner};
use crate::math::{Real, V3, V4};

/// The shader.
pub const SOURCE: Source =
    Source { name: "momentum", wgsl: include_str!("momentum.wgsl"), params: Params::<f32>::FIELDS };

/// `8/27 · 2⁻ᵈ`: fraction of a corner's mass that couples corners `a` and `b`.
pub fn share<R: Real>(a: usize, b: usize) -> R {
    let (a, b) = (corner(a), corner(b));
    let differ = (0..3).filter(|n| a[*n] != b[*n]).count();
    R::of([8.0, 4.0, 2.0, 1.0][differ]) / R::of(27.0)
}

/// Velocities of all nodes.
pub fn momentum<R: Real>(
    params: &Params<R>,
    shape: &[V4<R>],      // [layer] cell edges m, mass of one corner kg
    layer_of: &[u32],     // [cells_z] layer
    split: &[u32],        // see `split`
    rotation: &[V4<R>],   // [cell] quaternion
    dofs: &[V4<R>],       // [node] 1 free, 0 fixed, per axis; mass kg
    v: &[V4<R>],          // [node] m/s
    mean_v: &mut [V4<R>], // [node] m/s
) {
    for (i, out) in mean_v.iter_mut().enumerate() {
        *out = mean_velocity(params, shape, layer_of, split, rotation, dofs, v, i).pad(R::zero());
    }
}

/// One node of [`momentum`].
pub fn mean_velocity<R: Real>(
    params: &Params<R>,
    shape: &[V4<R>],
    layer_of: &[u32],
    split: &[u32],
    rotation: &[V4<R>],
    dofs: &[V4<R>],
    v: &[V4<R>],
    i: usize,
) -> V3<R> {
    let own = V3::from4(v[i]);
    let mut sum = V3::zero();
    for Around { corner: a, cell, level } in params.cells_around(split, i) {
        if rotation[cell] == [R::zero(); 4] {
            continue;
        }
        let mut local = V3::zero();
        for (b, node) in params.corner_nodes(split, cell).into_iter().enumerate() {
            local += (V3::from4(v[node]) - own) * share(a, b);
        }
        sum += local * shape[layer_of[level] as usize][3];
    }
    // a node that has left the system has no mass and no cells
    let mass = dofs[i][3];
    let rate = if mass > R::zero() { R::one() / mass } else { R::zero() };
    own + sum * rate
}
