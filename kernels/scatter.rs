//! Scatters values from the host into a device array: `destination[ids_k] = values_k`. No id may occur twice.

use super::Source;
use crate::math::{Real, V4};

/// The shader.
pub const SOURCE: Source =
    Source { name: "scatter", wgsl: include_str!("scatter.wgsl"), params: &["count", "pad_0", "pad_1", "pad_2"] };

/// Writes by index.
pub fn scatter<R: Real>(
    ids: &[u32],               // [entry] into destination, each once
    values: &[V4<R>],          // [entry]
    destination: &mut [V4<R>], // any
) {
    for (id, value) in ids.iter().zip(values) {
        destination[*id as usize] = *value;
    }
}
