//! A first guess of the contact correction from the columns at hand: `x_1 = c_1 x_1 + Σ_{j≥2} c_j x_j`.
//!
//! Units: x_1 m, columns m/N, c N (c_1 without unit).

use super::Source;
use crate::math::{Real, V4};

/// The shader.
pub const SOURCE: Source =
    Source { name: "combine", wgsl: include_str!("combine.wgsl"), params: super::Params::<f32>::FIELDS };

/// Sums the columns into slot 1.
pub fn combine<R: Real>(
    node_count: usize,
    coefficient: &[R], // [slot]
    x: &mut [V4<R>],   // [slot][node]
) {
    for i in 0..node_count {
        let mut sum = [R::zero(); 4];
        for (slot, c) in coefficient.iter().enumerate().skip(1) {
            if *c != R::zero() {
                for n in 0..3 {
                    sum[n] += *c * x[slot * node_count + i][n];
                }
            }
        }
        x[node_count + i] = sum;
    }
}
