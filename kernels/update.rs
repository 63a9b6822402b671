//! Vector updates of the conjugate gradients, one reduction per iteration (Chronopoulos, Gear 1989).
//!
//! First (`state` 1): `x = z`, `r −= w`, where `z` is the start and `w = A z`. Then, with `z = M⁻¹ r`, `w = A z`:
//! `p = z + β p`, `s = w + β s`, `x += α p`, `r −= α s`.
//! Leaves `r·r` of the new residual.
//! Units: x p z m; r s w N.

use super::Source;
use crate::math::{Real, V4};

/// The shader.
pub const SOURCE: Source =
    Source { name: "update", wgsl: include_str!("update.wgsl"), params: super::Params::<f32>::FIELDS };

/// One slot; returns `r·r`.
pub fn update<R: Real>(
    scalars: &super::advance::Scalars<R>,
    z: &[V4<R>],     // [node] m
    w: &[V4<R>],     // [node] N
    x: &mut [V4<R>], // [node] m
    p: &mut [V4<R>], // [node] m
    s: &mut [V4<R>], // [node] N
    r: &mut [V4<R>], // [node] N
) -> R {
    let (alpha, beta) = (scalars.alpha, scalars.beta);
    let mut residual = R::zero();
    if scalars.state == R::one() {
        for i in 0..z.len() {
            x[i] = z[i];
            for n in 0..3 {
                r[i][n] -= w[i][n];
                residual += r[i][n] * r[i][n];
            }
        }
        return residual;
    }
    for i in 0..z.len() {
        for n in 0..3 {
            let (mut pn, mut sn) = (z[i][n], w[i][n]);
            if beta != R::zero() {
                pn += beta * p[i][n];
                sn += beta * s[i][n];
            }
            p[i][n] = pn;
            s[i][n] = sn;
            x[i][n] += alpha * pn;
            r[i][n] -= alpha * sn;
            residual += r[i][n] * r[i][n];
        }
    }
    residual
}
