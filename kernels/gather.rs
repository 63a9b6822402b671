//! Gathers the values that the host reads: `picked_k = source[ids_k]`.

use super::Source;
use crate::math::{Real, V4};

/// The shader.
pub const SOURCE: Source =
    Source { name: "gather", wgsl: include_str!("gather.wgsl"), params: &["count", "pad_0", "pad_1", "pad_2"] };

/// Copies by index.
pub fn gather<R: Real>(
    ids: &[u32],          // [picked] into source
    source: &[V4<R>],     // any
    picked: &mut [V4<R>], // [picked]
) {
    for (out, id) in picked.iter_mut().zip(ids) {
        *out = source[*id as usize];
    }
}
