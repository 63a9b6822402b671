//! Small dense algebra, generic over f32 and f64, for the CPU path and the kernels' twins.
//!
//! Buffers hold [`V4`], a plain array (16 bytes in f32, as WGSL's `vec4<f32>`); arithmetic is done on [`V3`] and [`M3`].

pub mod elementary;
pub mod random;
pub mod wide;

use bytemuck::Pod;
use std::fmt::Debug;
use std::iter::Sum;
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};
use wide::{Lanes, Packed};

/// What [`V3`] and [`M3`] consist of: a scalar, or the scalars of several cells in a register ([`wide::Packed`]).
///
/// Code on numbers has no branches that depend on values but those of [`Number::all_at_least`].
pub trait Number:
    Copy
    + Debug
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
{
    /// A constant, rounded; of the kind of `self`, whose value is not used.
    fn like(self, value: f64) -> Self;
    /// Square root.
    fn sqrt(self) -> Self;
    /// Natural logarithm.
    fn ln(self) -> Self;
    /// Exponential.
    fn exp(self) -> Self;
    /// Absolute value.
    fn abs(self) -> Self;
    /// Larger of two.
    fn max(self, other: Self) -> Self;
    /// Smaller of two.
    fn min(self, other: Self) -> Self;
    /// `above` where `self ≥ bound`, `below` elsewhere, and for NaN.
    fn pick(self, bound: Self, above: Self, below: Self) -> Self;
    /// `self ≥ bound` everywhere.
    fn all_at_least(self, bound: Self) -> bool;
}

/// Scalar type, f32 or f64.
pub trait Real:
    Number + Default + PartialOrd + Pod + wide::Wide + Send + Sync + Sum + SubAssign + MulAssign + DivAssign + 'static
{
    /// Name for reports: `f32` or `f64`.
    const NAME: &'static str;
    /// Distance from 1 to the next larger number.
    const EPSILON: Self;
    /// Least positive number with all its digits.
    const MIN_POSITIVE: Self;
    /// Rounds an f64.
    fn of(value: f64) -> Self;
    /// Widens to f64.
    fn f64(self) -> f64;
    /// Neither infinite nor NaN.
    fn is_finite(self) -> bool;
    /// 0.
    fn zero() -> Self {
        Self::default()
    }
    /// 1.
    fn one() -> Self {
        Self::of(1.0)
    }
}

macro_rules! real {
    ($t:ty, $name:literal, $ln:path, $exp:path) => {
        impl Number for $t {
            #[inline(always)]
            fn like(self, value: f64) -> Self {
                value as $t
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                self.sqrt()
            }
            fn ln(self) -> Self {
                $ln(self)
            }
            fn exp(self) -> Self {
                $exp(self)
            }
            #[inline(always)]
            fn abs(self) -> Self {
                self.abs()
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                // of 0 and −0, std's method may return either, depending on the processor
                if self.is_nan() || other > self { other } else { self }
            }
            #[inline(always)]
            fn min(self, other: Self) -> Self {
                if self.is_nan() || other < self { other } else { self }
            }
            #[inline(always)]
            fn pick(self, bound: Self, above: Self, below: Self) -> Self {
                if self >= bound { above } else { below }
            }
            #[inline(always)]
            fn all_at_least(self, bound: Self) -> bool {
                self >= bound
            }
        }
        impl Real for $t {
            const NAME: &'static str = $name;
            const EPSILON: Self = <$t>::EPSILON;
            const MIN_POSITIVE: Self = <$t>::MIN_POSITIVE;
            fn of(value: f64) -> Self {
                value as $t
            }
            fn f64(self) -> f64 {
                f64::from(self)
            }
            fn is_finite(self) -> bool {
                self.is_finite()
            }
        }
    };
}
real!(f32, "f32", elementary::ln_f32, elementary::exp_f32);
real!(f64, "f64", elementary::ln, elementary::exp);

/// Four numbers as stored in buffers.
pub type V4<R> = [R; 4];

/// Numbers rounded to a precision.
pub fn round<R: Real, const N: usize>(a: &[f64; N]) -> [R; N] {
    a.map(R::of)
}

/// An array itself, if it is in this precision.
pub fn same<R: Real, S: Real>(a: &[V4<R>]) -> Option<&[V4<S>]> {
    (R::NAME == S::NAME).then(|| bytemuck::cast_slice(a))
}

/// The same of an array to be written.
pub fn same_mut<R: Real, S: Real>(a: &mut [V4<R>]) -> Option<&mut [V4<S>]> {
    (R::NAME == S::NAME).then(|| bytemuck::cast_slice_mut(a))
}

/// Vectors widened to f64.
pub fn widen<R: Real>(a: &[V4<R>]) -> Vec<V4<f64>> {
    a.iter().map(|v| v.map(Real::f64)).collect()
}

/// Maximum that propagates NaN.
pub fn larger(a: f64, b: f64) -> f64 {
    if b > a || b.is_nan() { b } else { a }
}

/// `Σ a b`, in eight partial sums that do not wait for each other; their order is the same on every machine. Inlined always,
/// for [`wide::Task`]s.
#[inline(always)]
pub fn inner_product(a: &[f64], b: &[f64]) -> f64 {
    const PARTS: usize = 8;
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<PARTS>(), b.as_chunks::<PARTS>());
    let mut parts = [0.0; PARTS];
    for (a, b) in a.iter().zip(b) {
        for k in 0..PARTS {
            parts[k] += a[k] * b[k];
        }
    }
    for (part, (a, b)) in parts.iter_mut().zip(a_rest.iter().zip(b_rest)) {
        *part += a * b;
    }
    let [p, q, r, s, t, u, v, w] = parts;
    ((p + t) + (r + v)) + ((q + u) + (s + w))
}

/// Euclidean norm of a field, without the fourth components.
pub fn norm(a: &[V4<f64>]) -> f64 {
    a.iter().map(|v| v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sum::<f64>().sqrt()
}

/// A vector of three numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct V3<R> {
    /// First component.
    pub x: R,
    /// Second component.
    pub y: R,
    /// Third component.
    pub z: R,
}

impl<N: Number> V3<N> {
    /// From components.
    #[inline(always)]
    pub fn new(x: N, y: N, z: N) -> Self {
        Self { x, y, z }
    }
    /// The first three numbers of a buffer entry.
    #[inline(always)]
    pub fn from4(a: V4<N>) -> Self {
        Self::new(a[0], a[1], a[2])
    }
    /// As a buffer entry, with the fourth number.
    #[inline(always)]
    pub fn pad(self, w: N) -> V4<N> {
        [self.x, self.y, self.z, w]
    }
    /// All three equal.
    #[inline(always)]
    pub fn splat(a: N) -> Self {
        Self::new(a, a, a)
    }
    /// Scalar product.
    #[inline(always)]
    pub fn dot(self, o: Self) -> N {
        self.x * o.x + self.y * o.y + self.z * o.z
    }
    /// Vector product.
    #[inline(always)]
    pub fn cross(self, o: Self) -> Self {
        Self::new(self.y * o.z - self.z * o.y, self.z * o.x - self.x * o.z, self.x * o.y - self.y * o.x)
    }
    /// Euclidean norm.
    #[inline(always)]
    pub fn length(self) -> N {
        self.dot(self).sqrt()
    }
    /// Component by component.
    #[inline(always)]
    pub fn times(self, o: Self) -> Self {
        Self::new(self.x * o.x, self.y * o.y, self.z * o.z)
    }
    /// `self ⊗ o`.
    #[inline(always)]
    pub fn outer(self, o: Self) -> M3<N> {
        M3([self * o.x, self * o.y, self * o.z])
    }
}

impl<R: Real> V3<R> {
    /// Rounds a triple of f64.
    pub fn of(a: [f64; 3]) -> Self {
        Self::new(R::of(a[0]), R::of(a[1]), R::of(a[2]))
    }
    /// Widened to f64.
    pub fn f64(self) -> [f64; 3] {
        [self.x.f64(), self.y.f64(), self.z.f64()]
    }
    /// Zero.
    pub fn zero() -> Self {
        Self::default()
    }
    /// The same in every lane of a register.
    #[inline(always)]
    pub fn packed<L: Lanes<R>>(self, lanes: L) -> V3<Packed<R, L>> {
        V3::new(Packed::splat(lanes, self.x), Packed::splat(lanes, self.y), Packed::splat(lanes, self.z))
    }
}

macro_rules! componentwise {
    ($trait:ident, $fn:ident, $op:tt) => {
        impl<N: Number> $trait for V3<N> {
            type Output = Self;
            #[inline(always)]
            fn $fn(self, o: Self) -> Self {
                Self::new(self.x $op o.x, self.y $op o.y, self.z $op o.z)
            }
        }
        impl<N: Number> $trait for M3<N> {
            type Output = Self;
            #[inline(always)]
            fn $fn(self, o: Self) -> Self {
                Self([self.0[0] $op o.0[0], self.0[1] $op o.0[1], self.0[2] $op o.0[2]])
            }
        }
    };
}
componentwise!(Add, add, +);
componentwise!(Sub, sub, -);

impl<N: Number> Neg for V3<N> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self::new(-self.x, -self.y, -self.z)
    }
}
impl<N: Number> Mul<N> for V3<N> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, s: N) -> Self {
        Self::new(self.x * s, self.y * s, self.z * s)
    }
}
impl<N: Number> AddAssign for V3<N> {
    #[inline(always)]
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}

/// A 3×3 matrix as three columns.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct M3<R>(pub [V3<R>; 3]);

impl<N: Number> M3<N> {
    /// Diagonal matrix.
    #[inline(always)]
    pub fn diagonal(d: V3<N>) -> Self {
        let o = d.x.like(0.0);
        Self([V3::new(d.x, o, o), V3::new(o, d.y, o), V3::new(o, o, d.z)])
    }
    /// With a number added along the diagonal.
    #[inline(always)]
    pub fn plus(self, s: N) -> Self {
        self.plus_diagonal(V3::splat(s))
    }
    /// With a diagonal matrix added.
    #[inline(always)]
    pub fn plus_diagonal(self, d: V3<N>) -> Self {
        let [a, b, c] = self.0;
        Self([V3::new(a.x + d.x, a.y, a.z), V3::new(b.x, b.y + d.y, b.z), V3::new(c.x, c.y, c.z + d.z)])
    }
    /// Transposed.
    #[inline(always)]
    pub fn transpose(self) -> Self {
        let [a, b, c] = self.0;
        Self([V3::new(a.x, b.x, c.x), V3::new(a.y, b.y, c.y), V3::new(a.z, b.z, c.z)])
    }
    /// Trace.
    #[inline(always)]
    pub fn trace(self) -> N {
        self.0[0].x + self.0[1].y + self.0[2].z
    }
    /// `Σ A_ij B_ij`.
    #[inline(always)]
    pub fn dot(self, o: Self) -> N {
        self.0[0].dot(o.0[0]) + self.0[1].dot(o.0[1]) + self.0[2].dot(o.0[2])
    }
    /// Cofactors: `det A` times the transposed inverse.
    #[inline(always)]
    pub fn cofactors(self) -> Self {
        let [a, b, c] = self.0;
        Self([b.cross(c), c.cross(a), a.cross(b)])
    }
    /// Determinant.
    #[inline(always)]
    pub fn determinant(self) -> N {
        self.0[0].dot(self.0[1].cross(self.0[2]))
    }
}

impl<R: Real> M3<R> {
    /// Identity.
    pub fn identity() -> Self {
        Self::diagonal(V3::splat(R::one()))
    }
    /// Zero.
    pub fn zero() -> Self {
        Self::default()
    }
    /// Inverse by cofactors; the matrix must be regular.
    pub fn inverse(self) -> Self {
        let own = self.cofactors();
        (own * (R::one() / self.0[0].dot(own.0[0]))).transpose()
    }
    /// The same in every lane of a register.
    #[inline(always)]
    pub fn packed<L: Lanes<R>>(self, lanes: L) -> M3<Packed<R, L>> {
        M3([self.0[0].packed(lanes), self.0[1].packed(lanes), self.0[2].packed(lanes)])
    }
    /// From rows of f64.
    pub fn of_rows(rows: [[f64; 3]; 3]) -> Self {
        Self(rows.map(V3::of)).transpose()
    }
}

impl<N: Number> Mul<V3<N>> for M3<N> {
    type Output = V3<N>;
    #[inline(always)]
    fn mul(self, v: V3<N>) -> V3<N> {
        self.0[0] * v.x + self.0[1] * v.y + self.0[2] * v.z
    }
}
impl<N: Number> Mul for M3<N> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        Self([self * o.0[0], self * o.0[1], self * o.0[2]])
    }
}
impl<N: Number> Mul<N> for M3<N> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, s: N) -> Self {
        Self([self.0[0] * s, self.0[1] * s, self.0[2] * s])
    }
}

/// `|q|²` times the rotation matrix of a quaternion (x, y, z, w): the rotation for a unit quaternion, 0 for that of a removed cell.
#[inline(always)]
pub fn rotation_matrix<N: Number>(q: V4<N>) -> M3<N> {
    let two = q[3].like(2.0);
    let [x, y, z, w] = q;
    let (xx, yy, zz, ww) = (x * x, y * y, z * z, w * w);
    let (xy, xz, yz) = (x * y, x * z, y * z);
    let (wx, wy, wz) = (w * x, w * y, w * z);
    M3([
        V3::new(ww + xx - yy - zz, two * (xy + wz), two * (xz - wy)),
        V3::new(two * (xy - wz), ww - xx + yy - zz, two * (yz + wx)),
        V3::new(two * (xz + wy), two * (yz - wx), ww - xx - yy + zz),
    ])
}

/// Rotation matrix minus identity, without cancellation at small angles.
pub fn rotation_minus_identity<R: Real>(q: V4<R>) -> M3<R> {
    let two = R::of(2.0);
    let [x, y, z, w] = q;
    let (xx, yy, zz) = (x * x, y * y, z * z);
    let (xy, xz, yz) = (x * y, x * z, y * z);
    let (wx, wy, wz) = (w * x, w * y, w * z);
    M3([
        V3::new(-two * (yy + zz), two * (xy + wz), two * (xz - wy)),
        V3::new(two * (xy - wz), -two * (xx + zz), two * (yz + wx)),
        V3::new(two * (xz + wy), two * (yz - wx), -two * (xx + yy)),
    ])
}

/// Product of two quaternions (x, y, z, w).
#[inline(always)]
pub fn quaternion_product<N: Number>(a: V4<N>, b: V4<N>) -> V4<N> {
    let (u, v) = (V3::from4(a), V3::from4(b));
    (v * a[3] + u * b[3] + u.cross(v)).pad(a[3] * b[3] - u.dot(v))
}

/// Solution of a positive definite system, by elimination.
pub fn solve_definite<const N: usize>(mut matrix: [[f64; N]; N], mut right: [f64; N]) -> [f64; N] {
    for k in 0..N {
        for row in k + 1..N {
            let factor = matrix[row][k] / matrix[k][k];
            (k..N).for_each(|l| matrix[row][l] -= factor * matrix[k][l]);
            right[row] -= factor * right[k];
        }
    }
    for k in (0..N).rev() {
        let known: f64 = (k + 1..N).map(|l| matrix[k][l] * right[l]).sum();
        right[k] = (right[k] - known) / matrix[k][k];
    }
    right
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inverse_times_matrix_is_identity() {
        let m = M3::<f64>::of_rows([[2.0, 1.0, 0.5], [0.1, 3.0, -1.0], [0.0, 0.4, 1.5]]);
        let d = m.inverse() * m - M3::identity();
        assert!(d.0.iter().all(|c| c.length() < 1e-15));
    }

    #[test]
    fn quaternion_matrix_rotates_as_the_product_of_quaternions() {
        let q = [0.5, -0.5, 0.5, 0.5];
        let v = V3::new(1.0, 2.0, 3.0);
        let p = quaternion_product(quaternion_product(q, v.pad(0.0)), [-0.5, 0.5, -0.5, 0.5]);
        assert!((rotation_matrix(q) * v - V3::from4(p)).length() < 1e-15);
        let small = rotation_matrix(q) - M3::identity() - rotation_minus_identity(q);
        assert!(small.0.iter().all(|c| c.length() < 1e-15));
    }
}
