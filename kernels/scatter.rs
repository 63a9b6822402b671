//! Scatters values from the host into a device array: `destination[ids_k] = values_k`, or `+=` with `params.add`. No id may occur twice.

use super::Source;
use crate::math::{Real, V4};

/// The shader.
pub const SOURCE: Source =
    Source { name: "scatter", wgsl: include_str!("scatter.wgsl"), params: &["count", "add", "pad_0", "pad_1"] };

/// Writes or adds by index.
pub fn scatter<R: Real>(
    add: bool,
    ids: &[u32],               // [entry] into destination, each once
    values: &[V4<R>],          // [entry]
    destination: &mut [V4<R>], // any
) {
    for (id, value) in ids.iter().zip(values) {
        let before = if add { destination[*id as usize] } else { [R::zero(); 4] };
        destination[*id as usize] = std::array::from_fn(|n| before[n] + value[n]);
    }
}
