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
use crate::math::{M3, Number, V3};

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
struct Family<N> {
    /// A
    structure: M3<N>,
    /// W, dW/dE, d²W/dE²
    response: [N; 3],
}

impl<N: Number> Fibres<N> {
    /// `κ 1 + (1 − 3κ) a ⊗ a` of a family.
    #[inline(always)]
    pub fn structure(&self, family: usize) -> M3<N> {
        let [x, y] = self.directions[family];
        let a = V3::new(x, y, x.like(0.0));
        let along = x.like(1.0) - x.like(3.0) * self.dispersion;
        (a.outer(a) * along).plus(self.dispersion)
    }

    /// W, dW/dE and d²W/dE² at a strain of the fibres.
    #[inline(always)]
    fn response(&self, strain: N) -> [N; 3] {
        let (zero, one, two) = (strain.like(0.0), strain.like(1.0), strain.like(2.0));
        let [k1, k2] = [self.stiffness, self.growth];
        let within = strain.min((strain.like(MOST_EXPONENT) / k2).sqrt()).max(zero);
        let exponent = k2 * within * within;
        let grown = exponential(exponent);
        let (slope, curvature) = (k1 * within * (one + grown), k1 * (one + grown) * (one + two * exponent));
        let beyond = strain - within;
        let energy = k1 / (two * k2) * grown + (slope + curvature * beyond / two) * beyond;
        // pressed fibres carry nothing
        let slope = slope + curvature * beyond;
        [zero.pick(strain, zero, energy), zero.pick(strain, zero, slope), zero.pick(strain, zero, curvature)]
    }

    /// Both families at a deformation.
    #[inline(always)]
    fn families(&self, p: &Point<N>) -> [Family<N>; 2] {
        let e = p.green();
        let [first, second] = [self.structure(0), self.structure(1)];
        [
            Family { response: self.response(first.dot(e)), structure: first },
            Family { response: self.response(second.dot(e)), structure: second },
        ]
    }
}

/// W
#[inline(always)]
pub fn energy<N: Number>(mu: N, fibres: &Fibres<N>, p: &Point<N>) -> N {
    let [first, second] = fibres.families(p);
    neo_hookean::energy(mu, p) + first.response[0] + second.response[0]
}

/// P
#[inline(always)]
pub fn stress<N: Number>(mu: N, fibres: &Fibres<N>, p: &Point<N>) -> M3<N> {
    let (f, two) = (p.gradient(), mu.like(2.0));
    let mut sum = neo_hookean::stress(mu, p);
    for family in fibres.families(p) {
        sum = sum + f * family.structure * (two * family.response[1]);
    }
    sum
}

/// dP
#[inline(always)]
pub fn tangent<N: Number>(mu: N, fibres: &Fibres<N>, p: &Point<N>, change: M3<N>) -> M3<N> {
    let (f, two, four) = (p.gradient(), mu.like(2.0), mu.like(4.0));
    let mut sum = neo_hookean::tangent(mu, p, change);
    for Family { structure, response: [_, slope, curvature] } in fibres.families(p) {
        let pull = f * structure;
        sum = sum + (change * structure * (two * slope) + pull * (four * curvature * pull.dot(change)));
    }
    sum
}

/// What the fibres add to the factor of [`super::hyperelastic::Cell::linearised`]: that by which stretched fibres are stiffer than at rest,
/// the stiffness that their tension gives across them, `w (1 − 2κ)/μ`, and that of fibres which have turned against the cell,
/// `2 w' |B − g A|²/μ` with `B = (U − 1) A`, `g = B:A/A:A`, and `(C − 1)/2` in place of `U − 1`.
#[inline(always)]
pub fn stiffening<N: Number>(mu: N, fibres: &Fibres<N>, p: &Point<N>) -> N {
    let (zero, one, two) = (mu.like(0.0), mu.like(1.0), mu.like(2.0));
    let half = p.green() * mu.like(0.5);
    let mut sum = zero;
    for Family { structure, response: [_, slope, curvature] } in fibres.families(p) {
        let stretched = half * structure;
        let grown = stretched.dot(structure) / structure.dot(structure);
        let turned = stretched + structure * -grown;
        let stiffer = curvature * (one + grown) * (one + grown) / fibres.stiffness - one;
        let more =
            stiffer.max(zero) + (slope * (one - two * fibres.dispersion) + two * curvature * turned.dot(turned)) / mu;
        sum += zero.pick(slope, zero, more);
    }
    sum
}
