//! Neo-Hookean law at a Gauss point, without the volumetric term (see [`super::hyperelastic`]).
//!
//! `W = μ/2 (I₁ − 3 − 2 ln J)`, `P = μ (F − F⁻ᵀ)`, `dP = μ (H + F⁻ᵀ Hᵀ F⁻ᵀ)` for the change `H` of `F`. The energy is evaluated as
//! `μ/2 (|h|² − 2 (J − 1 − tr h) + 2 (J − 1 − ln J))`, the stress as `μ (h + (1 − F⁻ᵀ))`, so that small strains lose no digits.
//! Source: Bonet, Wood 2008, section 6.4.
//! Units: μ Pa, W J/m³, P Pa.

use super::deformation::{Point, log_volume};
use crate::math::{M3, Real};

/// The law in WGSL.
pub const WGSL: &str = include_str!("neo_hookean.wgsl");

/// W
pub fn energy<R: Real>(mu: R, p: &Point<R>) -> R {
    let two = R::of(2.0);
    let squares = p.h.dot(p.h);
    R::of(0.5) * mu * (squares - two * p.second_order + two * log_volume(p.dilatation)[1])
}

/// P
pub fn stress<R: Real>(mu: R, p: &Point<R>) -> M3<R> {
    (p.h + p.complement) * mu
}

/// dP
pub fn tangent<R: Real>(mu: R, p: &Point<R>, change: M3<R>) -> M3<R> {
    (change + p.log_gradient * change.transpose() * p.log_gradient) * mu
}
