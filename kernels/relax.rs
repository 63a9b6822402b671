//! One step of the smoother: Chebyshev acceleration of the exact column solves.
//!
//! `d = keep d + gain M⁻¹ (r − w)`, `z += d`, `w = A z`; with `fresh` the initial guess is zero: `z = d = gain M⁻¹ r`. `M⁻¹` solves each
//! z-column exactly ([`super::columns`]); `w` is overwritten. Returns `r·z`, which the conjugate gradients need after the last step.
//! Coefficients: `bodies::grid::multigrid`. Source: Adams, Brezina, Hu, Tuminaro 2003 (polynomial smoothing).
//! Units: r w N; z d m.

use super::columns::{Components, Ends, solve_columns};
use super::{Levels, PART, Params, Source, by_columns, parts_at_once};
use crate::math::{Real, V3, V4};
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
    let parts = by_columns(w, columns).into_par_iter().zip(by_columns(d, columns)).zip(by_columns(z, columns));
    let one_part = |(part, ((w, d), z)): (usize, ((Levels<_>, Levels<_>), Levels<_>))| -> R {
        let [mut w, d, z]: [Levels<V4<R>>; 3] = [w, d, z];
        let mut gamma = [R::zero(); PART];
        let ends = Relaxed { params, r: &r[part * PART..], d, z, gamma: &mut gamma };
        solve_columns(columns, part, block, &mut w, ends);
        gamma.into_iter().sum()
    };
    let sums: Vec<R> = parts.enumerate().with_min_len(parts_at_once(params)).map(one_part).collect();
    sums.into_iter().sum()
}

/// The nodes of a part.
struct Relaxed<'a, R> {
    params: &'a Params<R>,
    r: &'a [V4<R>], // from its first column on
    d: Levels<'a, V4<R>>,
    z: Levels<'a, V4<R>>,
    gamma: &'a mut [R; PART], // [column] r·z
}

impl<R: Real> Ends<R> for Relaxed<'_, R> {
    #[inline(always)]
    fn load(&mut self, level: usize, w: &[V4<R>], load: &mut Components<R>) {
        let r = &self.r[level * self.params.columns()..][..w.len()];
        for n in 0..3 {
            if self.params.fresh == 1 {
                load[n].iter_mut().zip(r).for_each(|(load, r)| *load = r[n]);
            } else {
                load[n].iter_mut().zip(r).zip(w).for_each(|((load, r), w)| *load = r[n] - w[n]);
            }
        }
    }

    #[inline(always)]
    fn take(&mut self, level: usize, _: &mut [V4<R>], solution: &Components<R>) {
        let (keep, gain) = (self.params.keep, self.params.gain);
        let (d, z) = (&mut *self.d[level], &mut *self.z[level]);
        let r = &self.r[level * self.params.columns()..][..z.len()];
        for c in 0..z.len().min(PART) {
            let mut change = V3::new(solution[0][c], solution[1][c], solution[2][c]) * gain;
            let mut sum = change;
            if self.params.fresh != 1 {
                change += V3::from4(d[c]) * keep;
                sum = V3::from4(z[c]) + change;
            }
            d[c] = change.pad(R::zero());
            z[c] = sum.pad(R::zero());
            self.gamma[c] += V3::from4(r[c]).dot(sum);
        }
    }
}
