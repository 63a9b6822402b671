//! Vector updates of the conjugate gradients, one reduction per iteration (Chronopoulos, Gear 1989).
//!
//! First (`state` 1): `x = z`, `r −= w`, with the initial guess `z` and `w = A z`. Then, with `z = M⁻¹ r`, `w = A z`: `p = z + β p`,
//! `s = w + β s`, `x += α p`, `r −= α s`. Returns `r·r` of the new residual.
//! Units: x p z m; r s w N.

use super::advance::Scalars;
use super::{PARALLEL, Source};
use crate::math::wide::{Lanes, Task, dot_product};
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
            let (z, w) = (z[span.clone()].as_flattened(), w[span].as_flattened());
            let [x, p, s, r] = [x, p, s, r].map(<[V4<R>]>::as_flattened_mut);
            R::widest(Updated { scalars, z, w, x, p, s, r })
        })
        .collect();
    sums.into_iter().sum()
}

/// Nodes of one thread, as numbers.
struct Updated<'a, R> {
    scalars: &'a Scalars<R>,
    z: &'a [R],
    w: &'a [R],
    x: &'a mut [R],
    p: &'a mut [R],
    s: &'a mut [R],
    r: &'a mut [R],
}

impl<R: Real> Task<R> for Updated<'_, R> {
    type Output = R;

    #[inline(always)]
    fn run<L: Lanes<R>>(self, _: L) -> R {
        let Updated { scalars: Scalars { state, alpha, beta, .. }, z, w, x, p, s, r } = self;
        let count = z.len();
        let (w, x, p, s, r) = (&w[..count], &mut x[..count], &mut p[..count], &mut s[..count], &mut r[..count]);
        if *state == R::one() {
            x.copy_from_slice(z);
            for i in 0..count {
                r[i] -= w[i];
            }
        } else {
            if *beta == R::zero() {
                p.copy_from_slice(z);
                s.copy_from_slice(w);
            } else {
                for i in 0..count {
                    p[i] = z[i] + *beta * p[i];
                    s[i] = w[i] + *beta * s[i];
                }
            }
            for i in 0..count {
                x[i] += *alpha * p[i];
                r[i] -= *alpha * s[i];
            }
        }
        dot_product(r, r)
    }
}
