//! Copies the values of nodes to their new duplicates: `values[copy] = values[source]` for every right-hand side.
//!
//! No duplicate is another's source within one call, so the order does not matter.

use super::Source;
use crate::math::V4;

/// The shader.
pub const SOURCE: Source =
    Source { name: "duplicate", wgsl: include_str!("duplicate.wgsl"), params: &["count", "stride", "pad_0", "pad_1"] };

/// All right-hand sides of an array.
pub fn duplicate<R: Copy>(
    stride: usize,        // nodes of a right-hand side
    pairs: &[[u32; 2]],   // [entry] copy, source
    values: &mut [V4<R>], // [rhs][node] any
) {
    for own in values.chunks_exact_mut(stride) {
        for [copy, source] in pairs {
            own[*copy as usize] = own[*source as usize];
        }
    }
}
