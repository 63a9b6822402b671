//! Holzapfel–Gasser–Ogden law at a Gauss point: a neo-Hookean matrix ([`super::neo_hookean`]) with two families of collagen fibres, without
//! the volumetric term (see [`super::hyperelastic`]).
//!
//! `W = W_neo + Σ_i k₁/(2k₂) (exp(k₂ Eᵢ²) − 1)` over the families with `Eᵢ > 0`: fibres that are pressed fold and carry nothing.
//! `Eᵢ = κ (I₁ − 3) + (1 − 3κ) (I₄ᵢ − 1)`, `I₄ᵢ = |F aᵢ|²`; `aᵢ` the mean direction of a family at rest, κ its dispersion: 0 all along `aᵢ`, ⅓
//! every way. With `w = dW/dE`, `Aᵢ = κ 1 + (1 − 3κ) aᵢ ⊗ aᵢ`:
//!
//! `P = P_neo + Σ 2 w F Aᵢ`, `dP = dP_neo + Σ (2 w H Aᵢ + 4 w' (F Aᵢ : H) F Aᵢ)` for the change `H` of `F`.
//!
//! `E` is taken from `C − 1`, so small strains lose no digits. Beyond `k₂ E² = 16` the energy is continued by its second-order expansion
//! there, so that a cell in disorder has finite forces.
//! Source: Holzapfel, Gasser, Ogden 2000; Gasser, Ogden, Holzapfel 2006 (dispersion). Differs: `I₁` and `I₄` are those of `C` itself, not of
//! its isochoric part, since isochoric fibres of compressible material would not be loaded by a change of volume (Nolan et al. 2014).
//! Units: μ k₁ Pa, W J/m³, P Pa; k₂, κ, E 1.

use super::deformation::{Point, exponential};
use super::neo_hookean;
use crate::math::{M3, Real, V3};

/// The law in WGSL.
pub const WGSL: &str = include_str!("holzapfel.wgsl");

/// Two families of fibres in the layer's plane.
#[derive(Clone, Copy, Debug)]
pub struct Fibres<R> {
    /// Unit vectors along x and y.
    pub directions: [[R; 2]; 2],
    /// k₁, Pa
    pub stiffness: R,
    /// k₂
    pub growth: R,
    /// κ
    pub dispersion: R,
}

/// `k₂ E²` up to which the law itself holds.
const MOST_EXPONENT: f64 = 16.0;

/// State of a family at a Gauss point.
struct Family<R> {
    /// A
    structure: M3<R>,
    /// W, dW/dE, d²W/dE²
    response: [R; 3],
}

impl<R: Real> Fibres<R> {
    /// `κ 1 + (1 − 3κ) a ⊗ a` of a family.
    pub fn structure(&self, family: usize) -> M3<R> {
        let [x, y] = self.directions[family];
        let a = V3::new(x, y, R::zero());
        let along = R::one() - R::of(3.0) * self.dispersion;
        M3::diagonal(V3::splat(self.dispersion)) + a.outer(a) * along
    }

    /// W, dW/dE and d²W/dE² at a strain of the fibres.
    fn response(&self, strain: R) -> [R; 3] {
        let (zero, one, two) = (R::zero(), R::one(), R::of(2.0));
        if strain <= zero {
            return [zero; 3];
        }
        let [k1, k2] = [self.stiffness, self.growth];
        let within = strain.min((R::of(MOST_EXPONENT) / k2).sqrt());
        let exponent = k2 * within * within;
        let grown = exponential(exponent);
        let (slope, curvature) = (k1 * within * (one + grown), k1 * (one + grown) * (one + two * exponent));
        let beyond = strain - within;
        let energy = k1 / (two * k2) * grown + (slope + curvature * beyond / two) * beyond;
        [energy, slope + curvature * beyond, curvature]
    }

    /// Both families at a deformation.
    fn families(&self, p: &Point<R>) -> [Family<R>; 2] {
        let e = p.green();
        [0, 1].map(|family| {
            let structure = self.structure(family);
            Family { response: self.response(structure.dot(e)), structure }
        })
    }
}

/// W
pub fn energy<R: Real>(mu: R, fibres: &Fibres<R>, p: &Point<R>) -> R {
    let [first, second] = fibres.families(p).map(|family| family.response[0]);
    neo_hookean::energy(mu, p) + first + second
}

/// P
pub fn stress<R: Real>(mu: R, fibres: &Fibres<R>, p: &Point<R>) -> M3<R> {
    let f = M3::identity() + p.h;
    let [first, second] = fibres.families(p).map(|family| f * family.structure * (R::of(2.0) * family.response[1]));
    neo_hookean::stress(mu, p) + first + second
}

/// dP
pub fn tangent<R: Real>(mu: R, fibres: &Fibres<R>, p: &Point<R>, change: M3<R>) -> M3<R> {
    let f = M3::identity() + p.h;
    let of_family = |family: Family<R>| {
        let [_, slope, curvature] = family.response;
        let pull = f * family.structure;
        change * family.structure * (R::of(2.0) * slope) + pull * (R::of(4.0) * curvature * pull.dot(change))
    };
    let [first, second] = fibres.families(p).map(of_family);
    neo_hookean::tangent(mu, p, change) + first + second
}

/// What the fibres add to the factor of [`super::hyperelastic::Cell::linearised`]: that by which stretched fibres are stiffer than at rest,
/// the stiffness that their tension gives across them, `w (1 − 2κ)/μ`, and that of fibres which have turned against the cell,
/// `2 w' |B − g A|²/μ` with `B = (U − 1) A`, `g = B:A/A:A`, and `(C − 1)/2` in place of `U − 1`.
pub fn stiffening<R: Real>(mu: R, fibres: &Fibres<R>, p: &Point<R>) -> R {
    let (zero, one, two) = (R::zero(), R::one(), R::of(2.0));
    let half = p.green() * R::of(0.5);
    let mut sum = zero;
    for Family { structure, response: [_, slope, curvature] } in fibres.families(p) {
        if slope > zero {
            let stretched = half * structure;
            let grown = stretched.dot(structure) / structure.dot(structure);
            let turned = stretched + structure * -grown;
            let stiffer = curvature * (one + grown) * (one + grown) / fibres.stiffness - one;
            sum += stiffer.max(zero)
                + (slope * (one - two * fibres.dispersion) + two * curvature * turned.dot(turned)) / mu;
        }
    }
    sum
}
