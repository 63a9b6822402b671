//! A compressible neo-Hookean brick: energy, and the forces that its corners must be held with; what the shaders of the law share.
//!
//! `W = μ/2 (I₁ − 3 − 2 ln J) + λ/2 (ln J̄)²` per volume at rest, `F = I + h`, `h = Σ_a u_a ⊗ G_a` at 2×2×2 Gauss points, `G_a = ∇N_a`, `J = det
//! F`, and in the volumetric term the mean dilatation `J̄ = v/V` of the cell (Q1/P0: one pressure a cell), so that nearly incompressible
//! layers do not lock. `v = ∫ det F dV` is exact at these points. With `g_a = F⁻ᵀ G_a`, `c_a = ∂v/∂u_a = Σ w J g_a`, `p = λ ln J̄/J̄`:
//!
//! `f_a = Σ w μ (F G_a − g_a) + p c_a`.
//!
//! `h` stands for `F` and `J − 1` for `J`, and the energy is taken as `μ/2 (|h|² − 2 (J − 1 − tr h) + 2 (J − 1 − ln J))`, so that small
//! strains lose no digits; one corner's displacement is taken off first, which the gradients do not see.
//! Source: Simo, Taylor, Pister 1985 (mean dilatation at finite strain); Bonet, Wood 2008, section 6.4 (the law). Differs: the mean in
//! the λ-term alone, not in a modified F, which keeps the law's own form of the μ-term.
//! Units: u m, edges m, λ μ Pa, W J, f N.

use super::{Params, corner};
use crate::math::{M3, Real, V3, V4};

/// Text that the shaders of this law share.
pub const WGSL: &str = include_str!("neo.wgsl");

/// What the law needs of a layer.
#[derive(Clone, Copy, Debug)]
pub struct Material<R> {
    /// Edges of a cell, m.
    pub edges: V3<R>,
    /// Pa
    pub lambda: R,
    /// Pa
    pub mu: R,
}

impl<R: Real> Material<R> {
    /// From a layer's `shape` and `lame`.
    pub fn of(shape: V4<R>, lame: V4<R>) -> Self {
        Self { edges: V3::from4(shape), lambda: lame[0], mu: lame[1] }
    }
}

/// `∇N_a` at Gauss point `p`, which lies nearest to corner `p`, for the inverse edges of a cell, 1/m.
pub fn gradient<R: Real>(inverse: V3<R>, a: usize, p: usize) -> V3<R> {
    let away = 1.0 / 3.0f64.sqrt();
    let (own, other) = (corner(a), corner(p));
    let weight = |n: usize| R::of(0.5 * if own[n] == other[n] { 1.0 + away } else { 1.0 - away });
    let sign = |n: usize| if own[n] == 1 { R::one() } else { -R::one() };
    let (x, y, z) = (weight(0), weight(1), weight(2));
    V3::new(sign(0) * y * z, sign(1) * x * z, sign(2) * x * y).times(inverse)
}

/// Terms of the series of a logarithm: 10⁻¹⁵ of it is left where `J` is 2 or ½.
const TERMS: usize = 13;

/// `ln(1 + g)` and `g − ln(1 + g)`, neither with cancellation: `ln(1 + g) = 2 artanh s`, `g = 2s/(1 − s)`, `s = g/(2 + g)`.
pub fn logarithm<R: Real>(g: R) -> [R; 2] {
    let two = R::of(2.0);
    let s = g / (two + g);
    if s.abs() > R::of(1.0 / 3.0) {
        let ln = R::ln(R::one() + g);
        return [ln, g - ln];
    }
    let t = s * s;
    let mut tail = R::zero();
    for n in (1..TERMS).rev() {
        tail = tail * t + R::of(1.0 / (2 * n + 1) as f64);
    }
    let tail = two * s * t * tail;
    [two * s + tail, s * g - tail]
}

/// State of a Gauss point.
#[derive(Clone, Copy, Default)]
pub struct Point<R> {
    /// Displacement gradient.
    pub h: M3<R>,
    /// `J − 1`.
    pub growth: R,
    /// `J − 1 − tr h`.
    pub bend: R,
    /// `F⁻ᵀ`.
    pub back: M3<R>,
}

impl<R: Real> Point<R> {
    /// From the displacement gradient; `None` where the volume is not positive.
    fn new(h: M3<R>) -> Option<Self> {
        let [a, b, c] = h.0;
        let minors = (a.x * b.y - b.x * a.y) + (a.x * c.z - c.x * a.z) + (b.y * c.z - c.y * b.z);
        let bend = minors + a.dot(b.cross(c));
        let growth = h.trace() + bend;
        let volume = R::one() + growth;
        if !(volume > R::zero() && volume.is_finite()) {
            return None;
        }
        let [a, b, c] = (M3::identity() + h).0;
        let back = M3([b.cross(c), c.cross(a), a.cross(b)]) * (R::one() / volume);
        Some(Self { h, growth, bend, back })
    }
}

/// Gradient of a field with values at the corners, at Gauss point `p`.
pub fn field_gradient<R: Real>(inverse: V3<R>, at: &[V3<R>; 8], p: usize) -> M3<R> {
    let mut sum = M3::zero();
    for a in 1..8 {
        sum = sum + (at[a] - at[0]).outer(gradient(inverse, a, p));
    }
    sum
}

/// A cell under displacements of its corners.
pub struct Cell<R> {
    /// By the corner nearest to them.
    pub points: [Point<R>; 8],
    /// Of a Gauss point, m³.
    pub weight: R,
    /// `J̄ − 1`.
    pub mean_growth: R,
    /// Of its layer.
    pub material: Material<R>,
    /// 1/edges, 1/m.
    pub inverse: V3<R>,
}

impl<R: Real> Cell<R> {
    /// From the corners' displacements, m; `None` when it is inside out somewhere.
    pub fn new(material: Material<R>, u: &[V3<R>; 8]) -> Option<Self> {
        let edges = material.edges;
        let inverse = V3::new(R::one() / edges.x, R::one() / edges.y, R::one() / edges.z);
        let mut points = [Point::default(); 8];
        let mut sum = R::zero();
        for (p, point) in points.iter_mut().enumerate() {
            *point = Point::new(field_gradient(inverse, u, p))?;
            sum += point.growth;
        }
        let eighth = R::of(0.125);
        let weight = edges.x * edges.y * edges.z * eighth;
        Some(Self { points, weight, mean_growth: sum * eighth, material, inverse })
    }

    /// J
    pub fn energy(&self) -> R {
        let two = R::of(2.0);
        let mut sum = R::zero();
        for p in &self.points {
            let squares = p.h.0.iter().map(|c| c.dot(*c)).sum::<R>();
            sum += squares - two * p.bend + two * logarithm(p.growth)[1];
        }
        let log = logarithm(self.mean_growth)[0];
        let half = R::of(0.5);
        self.weight * (half * self.material.mu * sum + R::of(4.0) * self.material.lambda * log * log)
    }

    /// `λ ln J̄/J̄`, Pa.
    pub fn pressure(&self) -> R {
        self.material.lambda * logarithm(self.mean_growth)[0] / (R::one() + self.mean_growth)
    }

    /// `∂v/∂u_a`, m².
    pub fn growing(&self) -> [V3<R>; 8] {
        let mut out = [V3::zero(); 8];
        for (n, p) in self.points.iter().enumerate() {
            let pushed = p.back * (self.weight * (R::one() + p.growth));
            for (a, c) in out.iter_mut().enumerate() {
                *c += pushed * gradient(self.inverse, a, n);
            }
        }
        out
    }

    /// Forces that the corners must be held with, N.
    pub fn forces(&self) -> [V3<R>; 8] {
        let pressure = self.pressure();
        let mut out = self.growing().map(|c| c * pressure);
        for (n, p) in self.points.iter().enumerate() {
            // F G − g = h G + (1 − F⁻ᵀ) G
            let stress = (p.h + (M3::identity() - p.back)) * (self.weight * self.material.mu);
            for (a, force) in out.iter_mut().enumerate() {
                *force += stress * gradient(self.inverse, a, n);
            }
        }
        out
    }
}

/// Displacements of a cell's corners.
pub fn at_corners<R: Real>(params: &Params<R>, u: &[V4<R>], cell: usize) -> [V3<R>; 8] {
    params.corners(cell).map(|n| V3::from4(u[n]))
}
