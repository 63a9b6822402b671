//! Neo-Hookean law at a Gauss point, without the volumetric term (see [`super::hyperelastic`]).
//!
//! `W = μ/2 (I₁ − 3 − 2 ln J)`, `P = μ (F − F⁻ᵀ)`, `dP = μ (H + F⁻ᵀ Hᵀ F⁻ᵀ)` for the change `H` of `F`. The energy is evaluated as
//! `μ/2 (|h|² − 2 (J − 1 − tr h) + 2 (J − 1 − ln J))`, the stress as `μ (h + (1 − F⁻ᵀ))`, so that small strains lose no digits.
//! Source: Bonet, Wood 2008, section 6.4.
//! Units: μ Pa, W J/m³, P Pa.

use super::deformation::{Point, log_volume};
use crate::math::{M3, Number};

/// The law in WGSL.
pub const WGSL: &str = include_str!("neo_hookean.wgsl");

/// W
#[inline(always)]
pub fn energy<N: Number>(mu: N, p: &Point<N>) -> N {
    let two = mu.like(2.0);
    let squares = p.h.dot(p.h);
    mu.like(0.5) * mu * (squares - two * p.second_order + two * log_volume(p.dilatation)[1])
}

/// P
#[inline(always)]
pub fn stress<N: Number>(mu: N, p: &Point<N>) -> M3<N> {
    (p.h + p.complement) * mu
}

/// dP
#[inline(always)]
pub fn tangent<N: Number>(mu: N, p: &Point<N>, change: M3<N>) -> M3<N> {
    (change + p.log_gradient * change.transpose() * p.log_gradient) * mu
}
