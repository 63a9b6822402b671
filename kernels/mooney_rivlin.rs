//! Compressible Mooney–Rivlin law at a Gauss point, without the volumetric term (see [`super::hyperelastic`]).
//!
//! `W = c₁₀ (J^(−2/3) I₁ − 3) + c₀₁ (J^(−4/3) I₂ − 3)`, `I₁ = tr C`, `I₂ = ½ (I₁² − tr C²)`, `C = FᵀF`; at small strain its shear modulus
//! is `2 (c₁₀ + c₀₁)`. With `e = C − 1`, `I₁ = 3 (1 + i₁)`, `I₂ = 3 (1 + i₂)`, `s = tr(e) 1 − e` and `B = F⁻ᵀ`:
//!
//! `P = 2 c₁₀ J^(−2/3) (F − B − i₁ B) + c₀₁ J^(−4/3) (4 (F − B) + 2 F s − 4 i₂ B)`,
//!
//! and the energy is `3 c₁₀ (exp x₁ − 1) + 3 c₀₁ (exp x₂ − 1)`, `x₁ = ln(1 + i₁) − ⅔ ln J`, `x₂ = ln(1 + i₂) − 4/3 ln J`. Their terms of
//! first order in the strain are cancelled analytically, so that small strains lose no digits. For the change `H` of `F`, with `t = B:H`:
//!
//! `dP₁ = 2 c₁₀ J^(−2/3) (H − ⅔ t (F − B − i₁ B) − ⅔ (F:H) B + (1 + i₁) B Hᵀ B)`,
//! `dP₂ = c₀₁ J^(−4/3) (−4/3 t Q + 2 dD − 4/3 (2 D:H) B + 4 (1 + i₂) B Hᵀ B)`,
//!
//! `D = I₁ F − F C = F (2 + s)`, `Q = 2 D − 4 (1 + i₂) B`, `dD = 2 (F:H) F + H (2 + s) − F (HᵀF + FᵀH)`.
//! Source: Mooney 1940; Rivlin 1948; Bonet, Wood 2008, section 6.5 (isochoric invariants). SOFA's `MooneyRivlin` is the same law.
//! Units: c₁₀ c₀₁ Pa, W J/m³, P Pa.

use super::deformation::{EXTENDED, LOG_EXTENDED, Point, exponential, log_volume, logarithm, pick};
use crate::math::{M3, Number};

/// The law in WGSL.
pub const WGSL: &str = include_str!("mooney_rivlin.wgsl");

/// Invariants for stress and energy.
struct Invariants<N> {
    /// F
    f: M3<N>,
    /// `tr(e) 1 − e`
    s: M3<N>,
    /// `½ (tr² e − tr e²)`
    second: N,
    i1: N,
    i2: N,
}

impl<N: Number> Invariants<N> {
    #[inline(always)]
    fn of(p: &Point<N>) -> Self {
        let one = p.dilatation.like(1.0);
        let (two, half, third) = (one.like(2.0), one.like(0.5), one.like(1.0 / 3.0));
        let e = p.green();
        let trace = e.trace();
        let squares = e.dot(e);
        let second = half * (trace * trace - squares);
        let (i1, i2) = (trace * third, (two * trace + second) * third);
        let s = (e * -one).plus(trace);
        Self { f: p.gradient(), s, second, i1, i2 }
    }
}

/// `S = J^(−2/3)`, which the extension of `ln J` below `J = ε` would let grow exponentially: there it is its own tangent at `ε`.
struct Isochoric<N> {
    /// S
    scale: N,
    /// `J − 1 + 3/2 ln S`
    beyond: N,
    /// `−3/2 ∂(ln S)/∂F`: `F⁻ᵀ` above `J = ε`.
    log_gradient: M3<N>,
    /// 1 less that.
    complement: M3<N>,
}

impl<N: Number> Isochoric<N> {
    #[inline(always)]
    fn of(p: &Point<N>) -> Self {
        let one = p.dilatation.like(1.0);
        let (least, two_thirds, volume) = (one.like(EXTENDED), one.like(2.0 / 3.0), one + p.dilatation);
        let [log, beyond] = log_volume(p.dilatation);
        let scale = N::exp(-two_thirds * log);
        if volume.all_at_least(least) {
            return Self { scale, beyond, log_gradient: p.log_gradient, complement: p.complement };
        }
        // relative to the scale at ε, where the volume is smaller
        let grown = (one + two_thirds * (least - volume) / least).max(one);
        let log = one.like(LOG_EXTENDED) - one.like(1.5) * N::ln(grown);
        let extended = N::exp(-two_thirds * one.like(LOG_EXTENDED)) * grown;
        let log_gradient = p.log_gradient * (one / grown);
        let complement = pick(volume, least, p.complement, (log_gradient * -one).plus(one));
        let scale = volume.pick(least, scale, extended);
        Self { scale, beyond: volume.pick(least, beyond, p.dilatation - log), log_gradient, complement }
    }
}

/// W
#[inline(always)]
pub fn energy<N: Number>([c10, c01]: [N; 2], p: &Point<N>) -> N {
    let Invariants { second, i1, i2, .. } = Invariants::of(p);
    let (third, two_thirds) = (c10.like(1.0 / 3.0), c10.like(2.0 / 3.0));
    // |h|² − 2 (J − 1 − tr h): second-order part of tr e − 2 (J − 1)
    let left = p.h.dot(p.h) - c10.like(2.0) * p.second_order;
    let beyond = Isochoric::of(p).beyond;
    let x1 = left * third - logarithm(i1)[1] + two_thirds * beyond;
    let x2 = left * two_thirds + second * third - logarithm(i2)[1] + c10.like(4.0 / 3.0) * beyond;
    c10.like(3.0) * (c10 * exponential(x1) + c01 * exponential(x2))
}

/// P
#[inline(always)]
pub fn stress<N: Number>([c10, c01]: [N; 2], p: &Point<N>) -> M3<N> {
    let Invariants { f, s, i1, i2, .. } = Invariants::of(p);
    let Isochoric { scale, log_gradient, complement, .. } = Isochoric::of(p);
    let (two, four) = (c10.like(2.0), c10.like(4.0));
    let difference = p.h + complement;
    let p1 = difference - log_gradient * i1;
    let p2 = difference * four + f * s * two - log_gradient * (four * i2);
    p1 * (two * c10 * scale) + p2 * (c01 * scale * scale)
}

/// Stiffening of the small-strain tangent ([`super::hyperelastic::Cell::linearised`]) where that of a neo-Hookean material is `g`:
///
/// `(c₁₀ S I₁/3 g + c₀₁ S² max(1, ½ I₂ g − ½ + max(0, |F|²/3 − 1)))/(c₁₀ + c₀₁)`, `S = J^(−2/3)`.
///
/// The largest eigenvalue of `dP`, at principal stretches of 0.08 to 12 and volumes of 0.5 to 2, is 0.6 to 2.0 times that of the result (c₀₁ a
/// quarter of the sum; 1.8 and 2.3 with one constant alone); with `g` it is up to 50 times as large, and steps diverge.
#[inline(always)]
pub fn stiffening<N: Number>([c10, c01]: [N; 2], p: &Point<N>, g: N) -> N {
    let Invariants { f, i1, i2, .. } = Invariants::of(p);
    let scale = Isochoric::of(p).scale;
    let (zero, half, one) = (c10.like(0.0), c10.like(0.5), c10.like(1.0));
    let stretched = (f.dot(f) / c10.like(3.0) - one).max(zero);
    let second = (c10.like(1.5) * (one + i2) * g - half + stretched).max(one);
    (c10 * scale * (one + i1) * g + c01 * scale * scale * second) / (c10 + c01)
}

/// dP
#[inline(always)]
pub fn tangent<N: Number>([c10, c01]: [N; 2], p: &Point<N>, change: M3<N>) -> M3<N> {
    let Invariants { f, s, i1, i2, .. } = Invariants::of(p);
    let Isochoric { scale, log_gradient, complement, .. } = Isochoric::of(p);
    let (one, two, four) = (c10.like(1.0), c10.like(2.0), c10.like(4.0));
    let (two_thirds, four_thirds) = (c10.like(2.0 / 3.0), c10.like(4.0 / 3.0));
    let (t, along) = (log_gradient.dot(change), f.dot(change));
    let crossed = log_gradient * change.transpose() * log_gradient;
    let difference = p.h + complement - log_gradient * i1;
    let d1 = change - difference * (two_thirds * t) - log_gradient * (two_thirds * along) + crossed * (one + i1);
    let inner = s.plus(two);
    let d = f * inner;
    let q = d * two - log_gradient * (four * (one + i2));
    let dc = change.transpose() * f + f.transpose() * change;
    let dd = f * (two * along) + change * inner - f * dc;
    let d2 = q * (-four_thirds * t) + dd * two - log_gradient * (two * four_thirds * d.dot(change))
        + crossed * (four * (one + i2));
    d1 * (two * c10 * scale) + d2 * (c01 * scale * scale)
}
