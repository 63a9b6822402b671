//! Stiffness of a hyperelastic cell's volume, `y ⊗ y`: nine numbers `y` in the patterns 1, 2 and 4 of the cell's frame ([`super::product`]);
//! text shared by the shaders.
//!
//! `y` is the gradient of the cell's present volume ([`super::hyperelastic::Cell::linearised`]). It stands after the quaternions in the
//! array of rotations, `[cell × 3]` rows.

use super::{Params, corner};
use crate::math::{Real, V3, V4};

/// Text shared by the shaders that have rotations.
pub const WGSL: &str = include_str!("volume.wgsl");

/// `params.corotational` from which cells are hyperelastic.
pub const HYPERELASTIC: u32 = 2;

/// Rows `y` of a cell.
pub fn rows<'a, R: Real>(params: &Params<R>, rotation: &'a [V4<R>], cell: usize) -> &'a [V4<R>] {
    &rotation[params.cell_count as usize + 3 * cell..][..3]
}

/// `Σ_n ± y_n` of a corner, in the cell's frame; lower corners have the positive sign.
pub fn slope<R: Real>(rows: [V3<R>; 3], a: usize) -> V3<R> {
    let signed = |n: usize| rows[n] * R::of(if corner(a)[n] == 0 { 1.0 } else { -1.0 });
    signed(0) + signed(1) + signed(2)
}

/// The same of a cell's rows.
pub fn slope_of<R: Real>(params: &Params<R>, rotation: &[V4<R>], cell: usize, a: usize) -> V3<R> {
    let own = rows(params, rotation, cell);
    slope([0, 1, 2].map(|n| V3::from4(own[n])), a)
}
