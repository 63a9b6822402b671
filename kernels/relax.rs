//! One step of the smoother: Chebyshev acceleration of the exact column solves.
//!
//! `d = keep d + gain M⁻¹ (r − w)`, `z += d`, `w = A z`; with `fresh` the initial guess is zero: `z = d = gain M⁻¹ r`. `M⁻¹` solves each
//! z-column exactly ([`super::columns`]); `w` is overwritten. Returns `r·z`, which the conjugate gradients need after the last step.
//! Coefficients: `bodies::grid::multigrid`. Source: Adams, Brezina, Hu, Tuminaro 2003 (polynomial smoothing).
//! Units: r w N; z d m.

use super::columns::solve_columns;
use super::{Levels, Params, Source, by_columns, parts_at_once};
use crate::math::{Real, V3, V4};
use rayon::prelude::*;

/// The shader.
pub const SOURCE: Source = Source { name: "relax", wgsl: include_str!("relax.wgsl"), params: Params::<f32>::FIELDS };

/// One right-hand side.
pub fn relax<R: Real>(
    params: &Params<R>,
    block: &[V4<R>], // [node × 4] packed D'⁻¹, G
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
    let fresh = params.fresh == 1;
    let parts = by_columns(w, columns).into_par_iter().zip(by_columns(d, columns)).zip(by_columns(z, columns));
    let one_part = |(part, ((w, d), z)): (usize, ((Levels<_>, Levels<_>), Levels<_>))| -> R {
        let [mut w, mut d, mut z]: [Levels<V4<R>>; 3] = [w, d, z];
        let pushed = |r, w| if fresh { r } else { r - w };
        solve_columns(columns, part, block, r, &mut w, pushed, |[k, c], _, solution| {
            let mut change = solution * params.gain;
            let mut sum = change;
            if !fresh {
                change += V3::from4(d[k][c]) * params.keep;
                sum = V3::from4(z[k][c]) + change;
            }
            d[k][c] = change.pad(R::zero());
            z[k][c] = sum.pad(R::zero());
            sum
        })
    };
    let sums: Vec<R> = parts.enumerate().with_min_len(parts_at_once(params)).map(one_part).collect();
    sums.into_iter().sum()
}
