//! Sum of corner forces at a node: `f_i = Σ f_(c,a)` over the cells `c` whose corner `a` is the node; shared by kernels.
//!
//! The order of the sum is fixed, so that runs are repeatable. The shaders of Newton's method, whose
//! bodies are not cut, share a text that knows no split nodes (`residual` has no binding left for their table); `collect` has its own.
//! Units: N.

use super::Params;
use super::split::Around;
use crate::math::{Real, V3};

/// Text shared by the shaders that read corner forces.
pub const WGSL: &str = include_str!("collected.wgsl");

/// Sum of the corner forces at one node.
pub fn collected<R: Real>(params: &Params<R>, split: &[u32], corner_force: &[R], node: usize) -> V3<R> {
    let mut sum = V3::zero();
    for Around { corner, cell, .. } in params.cells_around(split, node) {
        let k = cell * 24 + corner * 3;
        sum += V3::new(corner_force[k], corner_force[k + 1], corner_force[k + 2]);
    }
    sum
}
