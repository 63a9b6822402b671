//! Deformation at a Gauss point of a hexahedron, and functions of it that are accurate at small strains; text shared by the shaders of
//! hyperelastic laws.
//!
//! `F = I + h`, `h = Σ_a u_a ⊗ ∇N_a`, `J = det F`. The code uses `h` instead of `F` and `J − 1` instead of `J`, so that small strains lose
//! no digits. One corner's displacement is subtracted first; it does not affect the gradients.
//! Units: u m, gradients 1/m.

use super::corner;
use crate::math::{M3, Real, V3};

/// Text shared by the shaders of hyperelastic laws.
pub const WGSL: &str = include_str!("deformation.wgsl");

/// `∇N_a` at Gauss point `p`, the one nearest to corner `p`, from the inverse edges of a cell, 1/m.
pub fn gradient<R: Real>(inverse: V3<R>, a: usize, p: usize) -> V3<R> {
    let away = 1.0 / 3.0f64.sqrt();
    let (own, other) = (corner(a), corner(p));
    let weight = |n: usize| R::of(0.5 * if own[n] == other[n] { 1.0 + away } else { 1.0 - away });
    let sign = |n: usize| if own[n] == 1 { R::one() } else { -R::one() };
    let (x, y, z) = (weight(0), weight(1), weight(2));
    V3::new(sign(0) * y * z, sign(1) * x * z, sign(2) * x * y).times(inverse)
}

/// `Σ_a v_a ⊗ ∇N_a` of a field with values `v` at the corners, at all Gauss points.
pub fn field_gradients<R: Real>(inverse: V3<R>, at: &[V3<R>; 8]) -> [M3<R>; 8] {
    let pattern = sign_patterns(by_bits(at.map(|v| v - at[0])));
    let mut out = [M3::zero(); 8];
    for (axis, (scales, own)) in scales_of_axes(inverse).into_iter().enumerate() {
        let columns = signed_sums(std::array::from_fn(|n| pattern[own[n]] * scales[n]));
        (0..8).for_each(|p| out[p].0[axis] = columns[beside(axis, p)]);
    }
    out
}

/// `Σ_p P_p ∇N_a` at each corner, of matrices at the Gauss points: the transpose of [`field_gradients`].
pub fn corner_sums<R: Real>(inverse: V3<R>, matrices: &[M3<R>; 8]) -> [V3<R>; 8] {
    let mut pattern = [V3::zero(); 8];
    for (axis, (scales, own)) in scales_of_axes(inverse).into_iter().enumerate() {
        let mut columns = [V3::zero(); 4];
        (0..8).for_each(|p| columns[beside(axis, p)] += matrices[p].0[axis]);
        let sums = signed_sums(columns);
        (0..4).for_each(|n| pattern[own[n]] += sums[n] * scales[n]);
    }
    by_bits(sign_patterns(pattern))
}

/// Factors of a derivative along each axis, and the patterns they belong to: with `±` the signs of a Gauss point along the two other axes
/// and `g = 1/√3`, `∂_x v = −(v_1 ± g v_3 ± g v_5 ± ± g² v_7)/(4 h_x)`, `v_P` the sign patterns.
fn scales_of_axes<R: Real>(inverse: V3<R>) -> [([R; 4], [usize; 4]); 3] {
    let away = 1.0 / 3.0f64.sqrt();
    let scales = |inverse: R| [1.0, away, away, away * away].map(|g| inverse * R::of(-0.25 * g));
    [(scales(inverse.x), [1, 3, 5, 7]), (scales(inverse.y), [2, 3, 6, 7]), (scales(inverse.z), [4, 5, 6, 7])]
}

/// Place of Gauss point `p` among the four signs of the axes beside `axis`.
fn beside(axis: usize, p: usize) -> usize {
    let at = corner(p);
    match axis {
        0 => at[1] + 2 * at[2],
        1 => at[0] + 2 * at[2],
        _ => at[0] + 2 * at[1],
    }
}

/// `[v_0 ± v_1 ± v_2 ± ± v_3]` for the four pairs of signs, ++ first; its own transpose.
fn signed_sums<R: Real>([a, b, c, d]: [V3<R>; 4]) -> [V3<R>; 4] {
    let (x, y, z, w) = (a + b, a - b, c + d, c - d);
    [x + z, y + w, x - z, y - w]
}

/// Corners in VTK's order from bits x + 2y + 4z, or the other way.
fn by_bits<T>([a, b, c, d, e, f, g, h]: [T; 8]) -> [T; 8] {
    [a, b, d, c, e, f, h, g]
}

/// Sums of eight corners by sign pattern ([`super::product`]), both by bits, lower corners positive; its own transpose.
fn sign_patterns<R: Real>([a, b, c, d, e, f, g, h]: [V3<R>; 8]) -> [V3<R>; 8] {
    let (below, above) = (signed_sums([a, b, c, d]), signed_sums([e, f, g, h]));
    std::array::from_fn(|n| if n < 4 { below[n] + above[n] } else { below[n - 4] - above[n - 4] })
}

/// Terms of the logarithm's series: the relative error is 10⁻¹⁵ where `J` is 2 or ½.
const TERMS: usize = 13;

/// `ln(1 + g)` and `g − ln(1 + g)`, both without cancellation: `ln(1 + g) = 2 artanh s`, `g = 2s/(1 − s)`, `s = g/(2 + g)`.
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

/// Volume ratio `ε` below which laws are extended: see [`log_volume`].
pub const EXTENDED: f64 = 0.1;
/// `ln ε`.
pub(super) const LOG_EXTENDED: f64 = -std::f64::consts::LN_10;

/// `φ(1 + g)` and `g − φ`. `φ = ln J`; below `J = ε` it is the tangent of `ln J` at `ε`, so that energies and forces are finite, continuous
/// and restoring through `J = 0`.
pub fn log_volume<R: Real>(g: R) -> [R; 2] {
    let least = R::of(EXTENDED);
    let volume = R::one() + g;
    if volume >= least {
        return logarithm(g);
    }
    let log = R::of(LOG_EXTENDED) + (volume - least) / least;
    [log, g - log]
}

/// `φ'(1 + g)`.
pub fn log_volume_slope<R: Real>(g: R) -> R {
    let least = R::of(EXTENDED);
    let volume = R::one() + g;
    R::one() / volume.max(least)
}

/// `φ'² + φ φ''`: derivative of `φ φ'`, `(1 − ln J)/J²` above `J = ε`.
pub fn log_volume_stiffness<R: Real>(g: R) -> R {
    let (least, volume) = (R::of(EXTENDED), R::one() + g);
    if volume >= least { (R::one() - log_volume(g)[0]) / (volume * volume) } else { R::one() / (least * least) }
}

/// Deformation at a Gauss point.
#[derive(Clone, Copy, Default)]
pub struct Point<R> {
    /// Displacement gradient.
    pub h: M3<R>,
    /// `J − 1`.
    pub dilatation: R,
    /// `J − 1 − tr h`, the nonlinear part of `J − 1`.
    pub second_order: R,
    /// `cof F = J F⁻ᵀ`.
    pub cofactor: M3<R>,
    /// `1 − ∂φ/∂F`, without cancellation at small strains.
    pub complement: M3<R>,
    /// `∂φ/∂F = φ' cof F`: `F⁻ᵀ` above `J = ε`.
    pub log_gradient: M3<R>,
}

impl<R: Real> Point<R> {
    /// From the displacement gradient.
    pub fn new(h: M3<R>) -> Self {
        let [a, b, c] = h.0;
        let minors = (a.x * b.y - b.x * a.y) + (a.x * c.z - c.x * a.z) + (b.y * c.z - c.y * b.z);
        let second_order = minors + a.dot(b.cross(c));
        let dilatation = h.trace() + second_order;
        // cof F = 1 + tr h 1 − hᵀ + cof h, so J 1 − cof F = (J − 1 − tr h) 1 + hᵀ − cof h
        let own = M3([b.cross(c), c.cross(a), a.cross(b)]);
        let difference = M3::identity() * second_order + h.transpose() - own;
        let [a, b, c] = (M3::identity() + h).0;
        let cofactor = M3([b.cross(c), c.cross(a), a.cross(b)]);
        let slope = log_volume_slope(dilatation);
        let log_gradient = cofactor * slope;
        let whole = R::one() + dilatation >= R::of(EXTENDED);
        let complement = if whole { difference * slope } else { M3::identity() - log_gradient };
        Self { h, dilatation, second_order, cofactor, complement, log_gradient }
    }

    /// `C − 1`, twice the Green–Lagrange strain, without cancellation at small strains.
    pub fn green(&self) -> M3<R> {
        self.h + self.h.transpose() + self.h.transpose() * self.h
    }

    /// Whether the volume is not a positive, finite number.
    pub fn inverted(&self) -> bool {
        let volume = R::one() + self.dilatation;
        !(volume > R::zero() && volume.is_finite())
    }
}

/// `exp(x) − 1`, without cancellation.
pub fn exponential<R: Real>(x: R) -> R {
    if x.abs() > R::of(0.25) {
        return R::exp(x) - R::one();
    }
    let mut sum = R::zero();
    for n in (1..=POWERS).rev() {
        sum = (x + x * sum) * R::of(1.0 / n as f64);
    }
    sum
}

/// Terms of its series: the error is 10⁻¹⁶ at ¼.
const POWERS: usize = 12;
