//! Sum of corner forces at a node: `f_i = Σ f_(c,a)` over the cells `c` whose corner `a` is the node; shared by kernels.
//!
//! The order of the sum is fixed, so that runs are repeatable. For bodies without cuts only: no node is split.
//! Units: N.

use super::Params;
use crate::math::{Real, V3};

/// Text shared by the shaders that read corner forces.
pub const WGSL: &str = include_str!("collected.wgsl");

/// Sum of the corner forces at one node.
pub fn collected<R: Real>(params: &Params<R>, corner_force: &[R], node: usize) -> V3<R> {
    let c = params.node_at(node);
    let mut sum = V3::zero();
    for a in 0..8 {
        if let Some(cell) = params.cell_below(c, a) {
            let k = cell * 24 + a * 3;
            sum += V3::new(corner_force[k], corner_force[k + 1], corner_force[k + 2]);
        }
    }
    sum
}
