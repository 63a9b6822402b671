//! Small dense algebra, generic over f32 and f64, for the CPU path and the kernels' twins.
//!
//! Buffers hold [`V4`], a plain array (16 bytes in f32, as WGSL's `vec4<f32>`); arithmetic is done on [`V3`] and [`M3`].

pub mod elementary;
pub mod mirrors;
pub mod random;
pub mod wide;

use bytemuck::Pod;
use std::fmt::Debug;
use std::iter::Sum;
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

/// Scalar type, f32 or f64.
pub trait Real:
    Copy
    + Debug
    + Default
    + PartialOrd
    + Pod
    + wide::Wide
    + Send
    + Sync
    + Sum
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
    + MulAssign
    + DivAssign
    + 'static
{
    /// Name for reports: `f32` or `f64`.
    const NAME: &'static str;
    /// Distance from 1 to the next larger number.
    const EPSILON: Self;
    /// Rounds an f64.
    fn of(value: f64) -> Self;
    /// Widens to f64.
    fn f64(self) -> f64;
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
        impl Real for $t {
            const NAME: &'static str = $name;
            const EPSILON: Self = <$t>::EPSILON;
            fn of(value: f64) -> Self {
                value as $t
            }
            fn f64(self) -> f64 {
                f64::from(self)
            }
            fn sqrt(self) -> Self {
                self.sqrt()
            }
            fn ln(self) -> Self {
                $ln(self)
            }
            fn exp(self) -> Self {
                $exp(self)
            }
            fn abs(self) -> Self {
                self.abs()
            }
            fn max(self, other: Self) -> Self {
                // of 0 and −0, std's method may return either, depending on the processor
                if self.is_nan() || other > self { other } else { self }
            }
            fn min(self, other: Self) -> Self {
                if self.is_nan() || other < self { other } else { self }
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
    if a >= b { a } else { b }
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

impl<R: Real> V3<R> {
    /// From components.
    pub fn new(x: R, y: R, z: R) -> Self {
        Self { x, y, z }
    }
    /// Rounds a triple of f64.
    pub fn of(a: [f64; 3]) -> Self {
        Self::new(R::of(a[0]), R::of(a[1]), R::of(a[2]))
    }
    /// The first three numbers of a buffer entry.
    pub fn from4(a: V4<R>) -> Self {
        Self::new(a[0], a[1], a[2])
    }
    /// As a buffer entry, with the fourth number.
    pub fn pad(self, w: R) -> V4<R> {
        [self.x, self.y, self.z, w]
    }
    /// Widened to f64.
    pub fn f64(self) -> [f64; 3] {
        [self.x.f64(), self.y.f64(), self.z.f64()]
    }
    /// All three equal.
    pub fn splat(a: R) -> Self {
        Self::new(a, a, a)
    }
    /// Zero.
    pub fn zero() -> Self {
        Self::default()
    }
    /// Scalar product.
    pub fn dot(self, o: Self) -> R {
        self.x * o.x + self.y * o.y + self.z * o.z
    }
    /// Vector product.
    pub fn cross(self, o: Self) -> Self {
        Self::new(self.y * o.z - self.z * o.y, self.z * o.x - self.x * o.z, self.x * o.y - self.y * o.x)
    }
    /// Euclidean norm.
    pub fn length(self) -> R {
        self.dot(self).sqrt()
    }
    /// Component by component.
    pub fn times(self, o: Self) -> Self {
        Self::new(self.x * o.x, self.y * o.y, self.z * o.z)
    }
    /// `self ⊗ o`.
    pub fn outer(self, o: Self) -> M3<R> {
        M3([self * o.x, self * o.y, self * o.z])
    }
}

macro_rules! componentwise {
    ($trait:ident, $fn:ident, $op:tt) => {
        impl<R: Real> $trait for V3<R> {
            type Output = Self;
            fn $fn(self, o: Self) -> Self {
                Self::new(self.x $op o.x, self.y $op o.y, self.z $op o.z)
            }
        }
    };
}
componentwise!(Add, add, +);
componentwise!(Sub, sub, -);

impl<R: Real> Neg for V3<R> {
    type Output = Self;
    fn neg(self) -> Self {
        Self::new(-self.x, -self.y, -self.z)
    }
}
impl<R: Real> Mul<R> for V3<R> {
    type Output = Self;
    fn mul(self, s: R) -> Self {
        Self::new(self.x * s, self.y * s, self.z * s)
    }
}
impl<R: Real> AddAssign for V3<R> {
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}

/// A 3×3 matrix as three columns.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct M3<R>(pub [V3<R>; 3]);

impl<R: Real> M3<R> {
    /// Identity.
    pub fn identity() -> Self {
        Self::diagonal(V3::splat(R::one()))
    }
    /// Zero.
    pub fn zero() -> Self {
        Self::default()
    }
    /// Diagonal matrix.
    pub fn diagonal(d: V3<R>) -> Self {
        let o = R::zero();
        Self([V3::new(d.x, o, o), V3::new(o, d.y, o), V3::new(o, o, d.z)])
    }
    /// Transposed.
    pub fn transpose(self) -> Self {
        let [a, b, c] = self.0;
        Self([V3::new(a.x, b.x, c.x), V3::new(a.y, b.y, c.y), V3::new(a.z, b.z, c.z)])
    }
    /// Trace.
    pub fn trace(self) -> R {
        self.0[0].x + self.0[1].y + self.0[2].z
    }
    /// `Σ A_ij B_ij`.
    pub fn dot(self, o: Self) -> R {
        (0..3).map(|k| self.0[k].dot(o.0[k])).sum()
    }
    /// Determinant.
    pub fn determinant(self) -> R {
        self.0[0].dot(self.0[1].cross(self.0[2]))
    }
    /// Inverse by cofactors; the matrix must be regular.
    pub fn inverse(self) -> Self {
        let [a, b, c] = self.0;
        let (r0, r1, r2) = (b.cross(c), c.cross(a), a.cross(b));
        let s = R::one() / a.dot(r0);
        Self([r0 * s, r1 * s, r2 * s]).transpose()
    }
    /// From rows of f64.
    pub fn of_rows(rows: [[f64; 3]; 3]) -> Self {
        Self(rows.map(V3::of)).transpose()
    }
}

impl<R: Real> Mul<V3<R>> for M3<R> {
    type Output = V3<R>;
    fn mul(self, v: V3<R>) -> V3<R> {
        self.0[0] * v.x + self.0[1] * v.y + self.0[2] * v.z
    }
}
impl<R: Real> Mul for M3<R> {
    type Output = Self;
    fn mul(self, o: Self) -> Self {
        Self(o.0.map(|c| self * c))
    }
}
impl<R: Real> Mul<R> for M3<R> {
    type Output = Self;
    fn mul(self, s: R) -> Self {
        Self(self.0.map(|c| c * s))
    }
}
impl<R: Real> Add for M3<R> {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        Self([self.0[0] + o.0[0], self.0[1] + o.0[1], self.0[2] + o.0[2]])
    }
}
impl<R: Real> Sub for M3<R> {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        Self([self.0[0] - o.0[0], self.0[1] - o.0[1], self.0[2] - o.0[2]])
    }
}

/// `|q|²` times the rotation matrix of a quaternion (x, y, z, w): the rotation for a unit quaternion, 0 for that of a removed cell.
pub fn rotation_matrix<R: Real>(q: V4<R>) -> M3<R> {
    let two = R::of(2.0);
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
pub fn quaternion_product<R: Real>(a: V4<R>, b: V4<R>) -> V4<R> {
    let (u, v) = (V3::from4(a), V3::from4(b));
    (v * a[3] + u * b[3] + u.cross(v)).pad(a[3] * b[3] - u.dot(v))
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
