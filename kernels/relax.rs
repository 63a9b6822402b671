//! One step of the smoother: Chebyshev acceleration of the exact column solves.
//!
//! `d = keep d + gain M⁻¹ (r − w)`, `z += d`, `w = A z`; with `fresh` the initial guess is zero: `z = d = gain M⁻¹ r`. `M⁻¹` solves each
//! z-column exactly ([`super::columns`]); `w` is overwritten. Returns `r·z`, which the conjugate gradients need after the last step.
//! Coefficients: `bodies::grid::multigrid`. Source: Adams, Brezina, Hu, Tuminaro 2003 (polynomial smoothing).
//! Units: r w N; z d m.

use super::columns::{Components, Ends, from_nodes, solve_columns};
use super::{PART, Params, Source, by_columns, parts_at_once};
use crate::math::{Real, V4};
use rayon::prelude::*;

/// The shader.
pub const SOURCE: Source = Source { name: "relax", wgsl: include_str!("relax.wgsl"), params: Params::<f32>::FIELDS };

/// One right-hand side.
pub fn relax<R: Real>(
    params: &Params<R>,
    block: &[V4<R>], // [node × 4] D'⁻¹, G by component
    r: &[V4<R>],     // [node] N
    w: &mut [V4<R>], // [node] N
    d: &mut [V4<R>], // [node] m
    z: &mut [V4<R>], // [node] m
) -> R {
    let of_set = |(first, set): (usize, Params<R>)| {
        let nodes = first..first + set.node_count as usize;
        let block = &block[nodes.start * 4..nodes.end * 4];
        relax_set(&set, block, &r[nodes.clone()], &mut w[nodes.clone()], &mut d[nodes.clone()], &mut z[nodes])
    };
    params.column_sets().map(of_set).sum()
}

fn relax_set<R: Real>(
    params: &Params<R>,
    block: &[V4<R>],
    r: &[V4<R>],
    w: &mut [V4<R>],
    d: &mut [V4<R>],
    z: &mut [V4<R>],
) -> R {
    let columns = params.columns();
    let ((mut w, levels), (mut d, _), (mut z, _)) =
        (by_columns(w, columns), by_columns(d, columns), by_columns(z, columns));
    let pieces = w.par_chunks_exact_mut(levels).zip(d.par_chunks_exact_mut(levels)).zip(z.par_chunks_exact_mut(levels));
    let one_part = |(part, ((w, d), z)): (usize, ((&mut [_], &mut [_]), &mut [_]))| -> R {
        let mut gamma = [R::zero(); PART];
        let ends = Relaxed { params, r: &r[part * PART..], d, z, gamma: &mut gamma };
        solve_columns(columns, part, block, w, ends);
        gamma.into_iter().sum()
    };
    let sums: Vec<R> = pieces.enumerate().with_min_len(parts_at_once(params)).map(one_part).collect();
    sums.into_iter().sum()
}

/// The nodes of a part.
struct Relaxed<'a, 'b, R> {
    params: &'a Params<R>,
    r: &'a [V4<R>],               // from its first column on
    d: &'a mut [&'b mut [V4<R>]], // [level][column]
    z: &'a mut [&'b mut [V4<R>]],
    gamma: &'a mut [R; PART], // [column] r·z
}

impl<R: Real> Ends<R> for Relaxed<'_, '_, R> {
    #[inline(always)]
    fn load(&mut self, level: usize, w: &[V4<R>], load: &mut Components<R>) {
        let r = &self.r[level * self.params.columns()..][..w.len()];
        if self.params.fresh == 1 {
            from_nodes(r.len(), |c, n| r[c][n], load);
        } else {
            from_nodes(r.len(), |c, n| r[c][n] - w[c][n], load);
        }
    }

    #[inline(always)]
    fn take(&mut self, level: usize, _: &mut [V4<R>], solution: &Components<R>) {
        let (keep, gain) = (self.params.keep, self.params.gain);
        let (d, z) = (&mut *self.d[level], &mut *self.z[level]);
        let count = z.len().min(PART);
        let r = &self.r[level * self.params.columns()..][..count];
        let (d, z, gamma) = (&mut d[..count], &mut z[..count], &mut self.gamma[..count]);
        let [x, y, up] = solution.each_ref().map(|plane| &plane[..count]);
        if self.params.fresh == 1 {
            for c in 0..count {
                d[c] = [x[c] * gain, y[c] * gain, up[c] * gain, R::zero()];
                z[c] = d[c];
            }
        } else {
            for c in 0..count {
                let [before, sum] = [d[c], z[c]];
                let change =
                    [x[c] * gain + before[0] * keep, y[c] * gain + before[1] * keep, up[c] * gain + before[2] * keep];
                d[c] = [change[0], change[1], change[2], R::zero()];
                z[c] = [sum[0] + change[0], sum[1] + change[1], sum[2] + change[2], R::zero()];
            }
        }
        for c in 0..count {
            gamma[c] += r[c][0] * z[c][0] + r[c][1] * z[c][1] + r[c][2] * z[c][2];
        }
    }
}
