//! Deformation at a Gauss point of a hexahedron, and functions of it that are accurate at small strains; text shared by the shaders of
//! hyperelastic laws.
//!
//! `F = I + h`, `h = Σ_a u_a ⊗ ∇N_a`, `J = det F`. The code uses `h` instead of `F` and `J − 1` instead of `J`, so that small strains lose
//! no digits. One corner's displacement is subtracted first; it does not affect the gradients.
//! Units: u m, gradients 1/m.

use super::corner;
use crate::math::{M3, Number, Real, V3};

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
#[inline(always)]
pub fn field_gradients<N: Number>(inverse: V3<N>, at: &[V3<N>; 8]) -> [M3<N>; 8] {
    let mut from_first = *at;
    for v in &mut from_first {
        *v = *v - at[0];
    }
    let pattern = sign_patterns(by_bits(from_first));
    let mut out = [M3([pattern[0]; 3]); 8];
    for axis in 0..3 {
        let (scales, own) = scales_of_axis(inverse, axis);
        let mut scaled = [pattern[0]; 4];
        for n in 0..4 {
            scaled[n] = pattern[own[n]] * scales[n];
        }
        let columns = signed_sums(scaled);
        for p in 0..8 {
            out[p].0[axis] = columns[beside(axis, p)];
        }
    }
    out
}

/// `Σ_p P_p ∇N_a` at each corner, of matrices at the Gauss points: the transpose of [`field_gradients`].
#[inline(always)]
pub fn corner_sums<N: Number>(inverse: V3<N>, matrices: &[M3<N>; 8]) -> [V3<N>; 8] {
    let zero = V3::splat(inverse.x.like(0.0));
    let mut pattern = [zero; 8];
    for axis in 0..3 {
        let (scales, own) = scales_of_axis(inverse, axis);
        let mut columns = [zero; 4];
        for p in 0..8 {
            columns[beside(axis, p)] += matrices[p].0[axis];
        }
        let sums = signed_sums(columns);
        for n in 0..4 {
            pattern[own[n]] += sums[n] * scales[n];
        }
    }
    by_bits(sign_patterns(pattern))
}

/// Factors of a derivative along an axis, and the patterns they belong to: with `±` the signs of a Gauss point along the two other axes
/// and `g = 1/√3`, `∂_x v = −(v_1 ± g v_3 ± g v_5 ± ± g² v_7)/(4 h_x)`, `v_P` the sign patterns.
#[inline(always)]
fn scales_of_axis<N: Number>(inverse: V3<N>, axis: usize) -> ([N; 4], [usize; 4]) {
    let away = 1.0 / 3.0f64.sqrt();
    let (inverse, own) = match axis {
        0 => (inverse.x, [1, 3, 5, 7]),
        1 => (inverse.y, [2, 3, 6, 7]),
        _ => (inverse.z, [4, 5, 6, 7]),
    };
    let scale = |g: f64| inverse * inverse.like(-0.25 * g);
    ([scale(1.0), scale(away), scale(away), scale(away * away)], own)
}

/// Place of Gauss point `p` among the four signs of the axes beside `axis`.
#[inline(always)]
fn beside(axis: usize, p: usize) -> usize {
    let at = corner(p);
    match axis {
        0 => at[1] + 2 * at[2],
        1 => at[0] + 2 * at[2],
        _ => at[0] + 2 * at[1],
    }
}

/// `[v_0 ± v_1 ± v_2 ± ± v_3]` for the four pairs of signs, ++ first; its own transpose.
#[inline(always)]
fn signed_sums<N: Number>([a, b, c, d]: [V3<N>; 4]) -> [V3<N>; 4] {
    let (x, y, z, w) = (a + b, a - b, c + d, c - d);
    [x + z, y + w, x - z, y - w]
}

/// Corners in VTK's order from bits x + 2y + 4z, or the other way.
#[inline(always)]
fn by_bits<T>([a, b, c, d, e, f, g, h]: [T; 8]) -> [T; 8] {
    [a, b, d, c, e, f, h, g]
}

/// Sums of eight corners by sign pattern ([`super::product`]), both by bits, lower corners positive; its own transpose.
#[inline(always)]
fn sign_patterns<N: Number>([a, b, c, d, e, f, g, h]: [V3<N>; 8]) -> [V3<N>; 8] {
    let (below, above) = (signed_sums([a, b, c, d]), signed_sums([e, f, g, h]));
    let mut out = [a; 8];
    for n in 0..4 {
        (out[n], out[n + 4]) = (below[n] + above[n], below[n] - above[n]);
    }
    out
}

/// Terms of the logarithm's series: the relative error is 10⁻¹⁵ where `J` is 2 or ½.
const TERMS: usize = 13;

/// `ln(1 + g)` and `g − ln(1 + g)`, both without cancellation: `ln(1 + g) = 2 artanh s`, `g = 2s/(1 − s)`, `s = g/(2 + g)`.
#[inline(always)]
pub fn logarithm<N: Number>(g: N) -> [N; 2] {
    let two = g.like(2.0);
    let s = g / (two + g);
    let t = s * s;
    let mut tail = g.like(0.0);
    for n in (1..TERMS).rev() {
        tail = tail * t + g.like(1.0 / (2 * n + 1) as f64);
    }
    let tail = two * s * t * tail;
    let series = [two * s + tail, s * g - tail];
    let (most, size) = (g.like(1.0 / 3.0), s.abs());
    if most.all_at_least(size) {
        return series;
    }
    let ln = N::ln(g.like(1.0) + g);
    [most.pick(size, series[0], ln), most.pick(size, series[1], g - ln)]
}

/// Volume ratio `ε` below which laws are extended: see [`log_volume`].
pub const EXTENDED: f64 = 0.1;
/// `ln ε`.
pub(super) const LOG_EXTENDED: f64 = -std::f64::consts::LN_10;

/// `φ(1 + g)` and `g − φ`. `φ = ln J`; below `J = ε` it is the tangent of `ln J` at `ε`, so that energies and forces are finite, continuous
/// and restoring through `J = 0`.
#[inline(always)]
pub fn log_volume<N: Number>(g: N) -> [N; 2] {
    let least = g.like(EXTENDED);
    let volume = g.like(1.0) + g;
    let tangent = g.like(LOG_EXTENDED) + (volume - least) / least;
    let [log, beyond] = logarithm(g);
    [volume.pick(least, log, tangent), volume.pick(least, beyond, g - tangent)]
}

/// `φ'(1 + g)`.
#[inline(always)]
pub fn log_volume_slope<N: Number>(g: N) -> N {
    let one = g.like(1.0);
    one / (one + g).max(g.like(EXTENDED))
}

/// `φ'² + φ φ''`: derivative of `φ φ'`, `(1 − ln J)/J²` above `J = ε`.
#[inline(always)]
pub fn log_volume_stiffness<N: Number>(g: N) -> N {
    let (one, least) = (g.like(1.0), g.like(EXTENDED));
    let volume = one + g;
    volume.pick(least, (one - log_volume(g)[0]) / (volume * volume), one / (least * least))
}

/// `φ φ'` at a mean dilatation `J̄ − 1`.
#[inline(always)]
pub fn volume_pressure<N: Number>(mean: N) -> N {
    log_volume(mean)[0] * log_volume_slope(mean)
}

/// `φ'² + φ φ''`, at least `(0.6 − ln J̄/5) φ'²`, above a tenth: in a volume that grows, `p ∂²v/∂u²` of the tension adds up to
/// `(2/3 ln J̄) φ'²`, so the true tangent has `(1 − ln J̄/3) φ'²` in all where the first term has `(1 − ln J̄) φ'²`.
#[inline(always)]
pub fn volume_stiffness<N: Number>(mean: N) -> N {
    let [log, slope] = [log_volume(mean)[0], log_volume_slope(mean)];
    let least = (log.like(0.6) - log.like(0.2) * log).max(log.like(0.1)).min(log.like(0.6));
    log_volume_stiffness(mean).max(least * slope * slope)
}

/// Matrix `above` where `volume ≥ least`, `below` elsewhere.
#[inline(always)]
pub(super) fn pick<N: Number>(volume: N, least: N, above: M3<N>, below: M3<N>) -> M3<N> {
    let mut out = above;
    for (column, below) in out.0.iter_mut().zip(below.0) {
        column.x = volume.pick(least, column.x, below.x);
        column.y = volume.pick(least, column.y, below.y);
        column.z = volume.pick(least, column.z, below.z);
    }
    out
}

/// Deformation at a Gauss point.
#[derive(Clone, Copy)]
pub struct Point<N> {
    /// Displacement gradient.
    pub h: M3<N>,
    /// `J − 1`.
    pub dilatation: N,
    /// `J − 1 − tr h`, the nonlinear part of `J − 1`.
    pub second_order: N,
    /// `cof F = J F⁻ᵀ`.
    pub cofactor: M3<N>,
    /// `1 − ∂φ/∂F`, without cancellation at small strains.
    pub complement: M3<N>,
    /// `∂φ/∂F = φ' cof F`: `F⁻ᵀ` above `J = ε`.
    pub log_gradient: M3<N>,
}

impl<N: Number> Point<N> {
    /// From the displacement gradient.
    #[inline(always)]
    pub fn new(h: M3<N>) -> Self {
        let [a, b, c] = h.0;
        let one = a.x.like(1.0);
        let own = h.cofactors();
        let minors = (a.x * b.y - b.x * a.y) + (a.x * c.z - c.x * a.z) + (b.y * c.z - c.y * b.z);
        let second_order = minors + a.dot(own.0[0]);
        let dilatation = h.trace() + second_order;
        // cof F = 1 + tr h 1 − hᵀ + cof h, so J 1 − cof F = (J − 1 − tr h) 1 + hᵀ − cof h
        let difference = h.transpose().plus(second_order) - own;
        let cofactor = h.plus(one).cofactors();
        let slope = log_volume_slope(dilatation);
        let log_gradient = cofactor * slope;
        let mut complement = difference * slope;
        let (volume, least) = (one + dilatation, one.like(EXTENDED));
        if !volume.all_at_least(least) {
            complement = pick(volume, least, complement, (log_gradient * -one).plus(one));
        }
        Self { h, dilatation, second_order, cofactor, complement, log_gradient }
    }

    /// Deformation gradient.
    #[inline(always)]
    pub fn gradient(&self) -> M3<N> {
        self.h.plus(self.dilatation.like(1.0))
    }

    /// `C − 1`, twice the Green–Lagrange strain, without cancellation at small strains.
    #[inline(always)]
    pub fn green(&self) -> M3<N> {
        self.h + self.h.transpose() + self.h.transpose() * self.h
    }
}

/// `exp(x) − 1`, without cancellation.
#[inline(always)]
pub fn exponential<N: Number>(x: N) -> N {
    let mut sum = x.like(0.0);
    for n in (1..=POWERS).rev() {
        sum = (x + x * sum) * x.like(1.0 / n as f64);
    }
    let (most, size) = (x.like(0.25), x.abs());
    if most.all_at_least(size) {
        return sum;
    }
    most.pick(size, sum, N::exp(x) - x.like(1.0))
}

/// Terms of its series: the error is 10⁻¹⁶ at ¼.
const POWERS: usize = 12;
