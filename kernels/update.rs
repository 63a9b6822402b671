//! Vector updates of the conjugate gradients, one reduction per iteration (Chronopoulos, Gear 1989).
//!
//! First (`state` 1): `x = z`, `r −= w`, with the initial guess `z` and `w = A z`. Then, with `z = M⁻¹ r`, `w = A z`: `p = z + β p`,
//! `s = w + β s`, `x += α p`, `r −= α s`. Returns `r·r` of the new residual.
//! Units: x p z m; r s w N.

use super::advance::Scalars;
use super::{PARALLEL, Source};
use crate::math::{Real, V4};
use rayon::prelude::*;

/// The shader.
pub const SOURCE: Source =
    Source { name: "update", wgsl: include_str!("update.wgsl"), params: super::Params::<f32>::FIELDS };

/// One right-hand side; returns `r·r`.
pub fn update<R: Real>(
    scalars: &Scalars<R>,
    z: &[V4<R>],     // [node] m
    w: &[V4<R>],     // [node] N
    x: &mut [V4<R>], // [node] m
    p: &mut [V4<R>], // [node] m
    s: &mut [V4<R>], // [node] N
    r: &mut [V4<R>], // [node] N
) -> R {
    let parts = x.par_chunks_mut(PARALLEL).zip(p.par_chunks_mut(PARALLEL)).zip(s.par_chunks_mut(PARALLEL));
    let sums: Vec<R> = parts
        .zip(r.par_chunks_mut(PARALLEL))
        .enumerate()
        .map(|(n, (((x, p), s), r))| {
            let span = n * PARALLEL..n * PARALLEL + x.len();
            update_part(scalars, &z[span.clone()], &w[span], x, p, s, r)
        })
        .collect();
    sums.into_iter().sum()
}

fn update_part<R: Real>(
    scalars: &Scalars<R>,
    z: &[V4<R>],
    w: &[V4<R>],
    x: &mut [V4<R>],
    p: &mut [V4<R>],
    s: &mut [V4<R>],
    r: &mut [V4<R>],
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
