//! Copies the values of nodes to their new duplicates: `values[copy] = values[source]` for every right-hand side.
//!
//! No duplicate is another's source within one call, so the order does not matter.

use super::Source;
use crate::math::V4;

/// The shader.
pub const SOURCE: Source =
    Source { name: "duplicate", wgsl: include_str!("duplicate.wgsl"), params: &["count", "stride", "pad_0", "pad_1"] };

/// All slots of an array.
pub fn duplicate<R: Copy>(
    stride: usize,        // nodes of a slot
    pairs: &[[u32; 2]],   // [entry] copy, source
    values: &mut [V4<R>], // [slot][node] any
) {
    for slot in values.chunks_exact_mut(stride) {
        for [copy, source] in pairs {
            slot[*copy as usize] = slot[*source as usize];
        }
    }
}
