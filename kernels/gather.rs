//! Gathers the values that the host reads: `picked_k = source[ids_k]` from `k = first` on.

use super::Source;
use crate::math::{Real, V4};

/// The shader.
pub const SOURCE: Source =
    Source { name: "gather", wgsl: include_str!("gather.wgsl"), params: &["count", "first", "pad_0", "pad_1"] };

/// Copies by index.
pub fn gather<R: Real>(
    first: u32,
    ids: &[u32],          // [picked] into source
    source: &[V4<R>],     // any
    picked: &mut [V4<R>], // [picked]
) {
    for k in first as usize..ids.len() {
        picked[k] = source[ids[k] as usize];
    }
}
