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

use super::deformation::{EXTENDED, LOG_EXTENDED, Point, exponential, log_volume, logarithm};
use crate::math::{M3, Real};

/// The law in WGSL.
pub const WGSL: &str = include_str!("mooney_rivlin.wgsl");

/// Invariants for stress and energy.
struct Invariants<R> {
    /// F
    f: M3<R>,
    /// `tr(e) 1 − e`
    s: M3<R>,
    /// `½ (tr² e − tr e²)`
    second: R,
    i1: R,
    i2: R,
}

impl<R: Real> Invariants<R> {
    fn of(p: &Point<R>) -> Self {
        let (two, half, third) = (R::of(2.0), R::of(0.5), R::of(1.0 / 3.0));
        let e = p.green();
        let trace = e.trace();
        let squares = e.dot(e);
        let second = half * (trace * trace - squares);
        let (i1, i2) = (trace * third, (two * trace + second) * third);
        let s = M3::identity() * trace - e;
        Self { f: M3::identity() + p.h, s, second, i1, i2 }
    }
}

/// `S = J^(−2/3)`, which the extension of `ln J` below `J = ε` would let grow exponentially: there it is its own tangent at `ε`.
struct Isochoric<R> {
    /// S
    scale: R,
    /// `J − 1 + 3/2 ln S`
    beyond: R,
    /// `−3/2 ∂(ln S)/∂F`: `F⁻ᵀ` above `J = ε`.
    log_gradient: M3<R>,
    /// 1 less that.
    complement: M3<R>,
}

impl<R: Real> Isochoric<R> {
    fn of(p: &Point<R>) -> Self {
        let (least, two_thirds) = (R::of(EXTENDED), R::of(2.0 / 3.0));
        let volume = R::one() + p.dilatation;
        let [log, beyond] = log_volume(p.dilatation);
        if volume >= least {
            let (log_gradient, complement) = (p.log_gradient, p.complement);
            return Self { scale: R::exp(-two_thirds * log), beyond, log_gradient, complement };
        }
        // relative to the scale at ε
        let grown = R::one() + two_thirds * (least - volume) / least;
        let log = R::of(LOG_EXTENDED) - R::of(1.5) * R::ln(grown);
        let scale = R::exp(-two_thirds * R::of(LOG_EXTENDED)) * grown;
        let log_gradient = p.log_gradient * (R::one() / grown);
        Self { scale, beyond: p.dilatation - log, log_gradient, complement: M3::identity() - log_gradient }
    }
}

/// W
pub fn energy<R: Real>([c10, c01]: [R; 2], p: &Point<R>) -> R {
    let Invariants { second, i1, i2, .. } = Invariants::of(p);
    let (three, two_thirds) = (R::of(3.0), R::of(2.0 / 3.0));
    // |h|² − 2 (J − 1 − tr h): second-order part of tr e − 2 (J − 1)
    let left = p.h.dot(p.h) - R::of(2.0) * p.second_order;
    let beyond = Isochoric::of(p).beyond;
    let x1 = left * R::of(1.0 / 3.0) - logarithm(i1)[1] + two_thirds * beyond;
    let x2 = left * two_thirds + second * R::of(1.0 / 3.0) - logarithm(i2)[1] + R::of(4.0 / 3.0) * beyond;
    three * (c10 * exponential(x1) + c01 * exponential(x2))
}

/// P
pub fn stress<R: Real>([c10, c01]: [R; 2], p: &Point<R>) -> M3<R> {
    let Invariants { f, s, i1, i2, .. } = Invariants::of(p);
    let Isochoric { scale, log_gradient, complement, .. } = Isochoric::of(p);
    let (two, four) = (R::of(2.0), R::of(4.0));
    let difference = p.h + complement;
    let p1 = difference - log_gradient * i1;
    let p2 = difference * four + f * s * two - log_gradient * (four * i2);
    p1 * (two * c10 * scale) + p2 * (c01 * scale * scale)
}

/// dP
pub fn tangent<R: Real>([c10, c01]: [R; 2], p: &Point<R>, change: M3<R>) -> M3<R> {
    let Invariants { f, s, i1, i2, .. } = Invariants::of(p);
    let Isochoric { scale, log_gradient, complement, .. } = Isochoric::of(p);
    let (one, two, four) = (R::one(), R::of(2.0), R::of(4.0));
    let (two_thirds, four_thirds) = (R::of(2.0 / 3.0), R::of(4.0 / 3.0));
    let (t, along) = (log_gradient.dot(change), f.dot(change));
    let crossed = log_gradient * change.transpose() * log_gradient;
    let difference = p.h + complement - log_gradient * i1;
    let d1 = change - difference * (two_thirds * t) - log_gradient * (two_thirds * along) + crossed * (one + i1);
    let inner = M3::identity() * two + s;
    let d = f * inner;
    let q = d * two - log_gradient * (four * (one + i2));
    let dc = change.transpose() * f + f.transpose() * change;
    let dd = f * (two * along) + change * inner - f * dc;
    let d2 = q * (-four_thirds * t) + dd * two - log_gradient * (two * four_thirds * d.dot(change))
        + crossed * (four * (one + i2));
    d1 * (two * c10 * scale) + d2 * (c01 * scale * scale)
}
