//! Applies the factored columns: `z = M⁻¹ r`, with the dots `r·z` and `r·r` that the conjugate gradients need.
//!
//! Up: `y_k = r_k − G_{k−1}ᵀ y_{k−1}`; down: `z_k = D'_k⁻¹ y_k − G_k z_{k+1}`.
//! Units: r N, z m.

use super::blocks::unpack;
use super::{Params, Source};
use crate::math::{Real, V3, V4};

/// The shader.
pub const SOURCE: Source =
    Source { name: "precondition", wgsl: include_str!("precondition.wgsl"), params: Params::<f32>::FIELDS };

/// One slot; returns `r·z` and `r·r`.
pub fn precondition<R: Real>(
    params: &Params<R>,
    block: &[V4<R>], // [node × 4] packed D'⁻¹, G
    r: &[V4<R>],     // [node] N
    z: &mut [V4<R>], // [node] m
) -> [R; 2] {
    let columns = (params.nodes_x * params.nodes_y) as usize;
    let levels = params.nodes_z as usize;
    let mut dots = [R::zero(); 2];
    for column in 0..columns {
        let mut y = V3::zero(); // G_{k−1}ᵀ y_{k−1}
        for k in 0..levels {
            let i = column + k * columns;
            let own = V3::from4(r[i]) - y;
            z[i] = own.pad(R::zero());
            y = unpack(&block[i * 4..i * 4 + 4]).g.transpose() * own;
        }
        let mut above = V3::zero();
        for k in (0..levels).rev() {
            let i = column + k * columns;
            let own = unpack(&block[i * 4..i * 4 + 4]);
            above = own.d * V3::from4(z[i]) - own.g * above;
            z[i] = above.pad(R::zero());
            let residual = V3::from4(r[i]);
            dots[0] += residual.dot(above);
            dots[1] += residual.dot(residual);
        }
    }
    dots
}
