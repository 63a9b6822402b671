//! Test of compensated summation on the device: 64 cases at start-up; sums of the conjugate gradients are compensated only if all are
//! right.
//!
//! `s = a + b`, `part = s − a`, `error = (a − (s − part)) + (b − part)`: in IEEE arithmetic `a + b = s + error` exactly. A shader compiler
//! may simplify `error` to zero. To prevent this, each intermediate result is XORed with a zero that is known at run time only (without it,
//! 59 of 64 cases fail on lavapipe).
//! Source: Knuth 1969, section 4.2.2; Møller 1965.

use super::Source;
use crate::math::Real;

/// The shader.
pub const SOURCE: Source =
    Source { name: "probe", wgsl: include_str!("probe.wgsl"), params: super::Params::<f32>::FIELDS };

/// Number of cases.
pub const CASES: usize = 64;

/// Pairs of both signs and many sizes whose sums have rounding errors from zero to nearly half a unit in the last place.
pub fn cases() -> Vec<[f32; 4]> {
    let case = |k: usize| {
        let a = (1.0 + 0.013 * k as f32) * if k.is_multiple_of(3) { -1.0 } else { 1.0 };
        let b = (0.7 + 0.031 * k as f32) * 0.5f32.powi(k as i32 % 24);
        [a, b, 0.0, 0.0]
    };
    (0..CASES).map(case).collect()
}

/// Rounding error of each `a + b`.
pub fn probe<R: Real>(
    cases: &[[R; 4]], // a, b, 0, 0
    errors: &mut [R],
) {
    for (error, [a, b, ..]) in errors.iter_mut().zip(cases) {
        let sum = *a + *b;
        let part = sum - *a;
        let other = sum - part;
        *error = (*a - other) + (*b - part);
    }
}
