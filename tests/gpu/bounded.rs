//! A number in f64 that carries a bound on what f32 may have made of it: the kernels' twins, run on it, give each output together with
//! the error that a GPU is allowed to have there.
//!
//! Running error analysis: with `|â − a| ≤ e_a`, each operation adds the carried error and its own rounding,
//! `a ± b`: `e_a + e_b + ulp (t_a + t_b)`, where `t` is the sum of the `|terms|` of a chain of additions, so that the bound holds in
//! whatever order the chain is summed; `a b`: `|a| e_b + |b| e_a + e_a e_b + ulp |a b|`; and so on. Fusing a product into a sum only
//! drops roundings. So the scale of every bound comes from the terms of the case, never from the result.
//! Source: Higham 2002, Accuracy and Stability of Numerical Algorithms, section 3.3 (running error analysis). Differs: `t` instead of
//! `|a ± b|`, and the roundings of WGSL (specification, section 15.7.4 "Floating point accuracy"): `+ − ×` 1 ulp (rounded
//! correctly, but in either direction), `/` 2.5 ulp, `sqrt` = 1 / inverseSqrt: 2 + 2.5 ulp, `log` 3 ulp, `exp` 3 + 2 |x| ulp; subnormal results may be flushed to zero.

use bytemuck::{Pod, Zeroable};
use cutis::math::wide::Wide;
use cutis::math::{Number, Real};
use std::cell::Cell;
use std::cmp::Ordering;
use std::iter::Sum;
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

/// One unit in the last place of f32, relative.
const ULP: f64 = f32::EPSILON as f64;
/// Of a division, ulp.
const DIVISION: f64 = 2.5;
/// Of a square root, ulp.
const SQUARE_ROOT: f64 = 4.5;
/// Of a logarithm, ulp.
const LOGARITHM: f64 = 3.0;
/// Of an exponential, ulp, beside 2 |x|.
const EXPONENTIAL: f64 = 3.0;
/// What flushing a subnormal result loses.
const FLUSHED: f64 = f32::MIN_POSITIVE as f64;

thread_local! {
    static UNCERTAIN: Cell<usize> = const { Cell::new(0) };
}

/// How many comparisons since the last call f32 might decide otherwise; where it is not 0, a branch may differ.
pub fn uncertain_comparisons() -> usize {
    UNCERTAIN.take()
}

/// See the module.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct Bounded {
    /// In f64.
    pub value: f64,
    /// Sum of the absolute terms of the chain of additions that made it.
    terms: f64,
    /// Bound on |f32 − value|.
    pub error: f64,
}

impl Bounded {
    /// A value whose bound was derived elsewhere.
    pub fn with_error(value: f64, error: f64) -> Self {
        Self { value, terms: value.abs(), error }
    }
}

fn rounded(value: f64, carried: f64, ulps: f64) -> Bounded {
    Bounded { value, terms: value.abs(), error: carried + ulps * ULP * (value.abs() + carried) + FLUSHED }
}

fn sum(a: Bounded, b: Bounded, value: f64) -> Bounded {
    let (carried, terms) = (a.error + b.error, a.terms + b.terms);
    Bounded { value, terms, error: carried + ULP * (terms + carried) + FLUSHED }
}

impl Add for Bounded {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        sum(self, o, self.value + o.value)
    }
}
impl Sub for Bounded {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        sum(self, o, self.value - o.value)
    }
}
impl Mul for Bounded {
    type Output = Self;
    fn mul(self, o: Self) -> Self {
        let carried = self.value.abs() * o.error + o.value.abs() * self.error + self.error * o.error;
        rounded(self.value * o.value, carried, 1.0)
    }
}
impl Div for Bounded {
    type Output = Self;
    fn div(self, o: Self) -> Self {
        let value = self.value / o.value;
        // a divisor that may be zero bounds nothing
        let least = (o.value.abs() - o.error).max(0.0);
        rounded(value, (self.error + value.abs() * o.error) / least, DIVISION)
    }
}
impl Neg for Bounded {
    type Output = Self;
    fn neg(self) -> Self {
        Self { value: -self.value, ..self }
    }
}

macro_rules! assign {
    ($($trait:ident $fn:ident $op:tt),*) => {$(
        impl $trait for Bounded {
            fn $fn(&mut self, o: Self) {
                *self = *self $op o;
            }
        }
    )*};
}
assign!(AddAssign add_assign +, SubAssign sub_assign -, MulAssign mul_assign *, DivAssign div_assign /);

impl Sum for Bounded {
    fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
        all.fold(Self::default(), |a, b| a + b)
    }
}

impl PartialEq for Bounded {
    fn eq(&self, o: &Self) -> bool {
        self.partial_cmp(o) == Some(Ordering::Equal)
    }
}
impl PartialOrd for Bounded {
    fn partial_cmp(&self, o: &Self) -> Option<Ordering> {
        let (distance, error) = ((self.value - o.value).abs(), self.error + o.error);
        if error > 0.0 && distance <= error {
            UNCERTAIN.set(UNCERTAIN.get() + 1);
        }
        self.value.partial_cmp(&o.value)
    }
}

impl Wide for Bounded {
    fn mul_add(self, b: Self, c: Self) -> Self {
        // the bound of two roundings holds for one too
        self * b + c
    }
}

impl Number for Bounded {
    fn like(self, value: f64) -> Self {
        Self::of(value)
    }
    fn sqrt(self) -> Self {
        // |√a − √b| ≤ √|a − b|, and ≤ |a − b| / √a
        let root = self.value.sqrt();
        let carried = self.error.sqrt().min(self.error / root);
        rounded(root, carried, SQUARE_ROOT)
    }
    fn ln(self) -> Self {
        // outside 1/2 … 2, where WGSL promises ulps
        let least = (self.value - self.error).max(0.0);
        rounded(self.value.ln(), self.error / least, LOGARITHM)
    }
    fn exp(self) -> Self {
        let value = self.value.exp();
        rounded(value, value * self.error.exp_m1(), EXPONENTIAL + 2.0 * self.value.abs())
    }
    fn abs(self) -> Self {
        Self { value: self.value.abs(), ..self }
    }
    fn max(self, o: Self) -> Self {
        let (larger, other) = if self.value >= o.value { (self, o) } else { (o, self) };
        // the GPU's numbers may be three times as far off as the twin's, and cannot be in another order beyond that
        let apart = larger.value - other.value > 3.0 * (larger.error + other.error);
        Self { error: if apart { larger.error } else { larger.error.max(other.error) }, ..larger }
    }
    fn min(self, o: Self) -> Self {
        -(-self).max(-o)
    }
    fn pick(self, bound: Self, above: Self, below: Self) -> Self {
        if self >= bound { above } else { below }
    }
    fn all_at_least(self, bound: Self) -> bool {
        self >= bound
    }
}

impl Real for Bounded {
    const NAME: &'static str = "f64 with a bound for f32";
    // the twins' own tolerances are those of f32
    const EPSILON: Self = Self { value: ULP, terms: ULP, error: 0.0 };
    const MIN_POSITIVE: Self = Self { value: f32::MIN_POSITIVE as f64, terms: f32::MIN_POSITIVE as f64, error: 0.0 };
    fn of(value: f64) -> Self {
        Self { value, terms: value.abs(), error: (value - f64::from(value as f32)).abs() }
    }
    fn f64(self) -> f64 {
        self.value
    }
    fn is_finite(self) -> bool {
        self.value.is_finite()
    }
}
