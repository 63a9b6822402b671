//! Applies the factored columns ([`super::columns`]): `z = M⁻¹ r`; returns the dot product `r·z` for the conjugate gradients.
//!
//! Units: r N, z m.

use super::columns::{Components, Ends, from_nodes, solve_columns};
use super::{PART, Params, Source, by_columns, parts_at_once};
use crate::math::{Real, V4};
use rayon::prelude::*;

/// The shader.
pub const SOURCE: Source =
    Source { name: "precondition", wgsl: include_str!("precondition.wgsl"), params: Params::<f32>::FIELDS };

/// One right-hand side; returns `r·z`.
pub fn precondition<R: Real>(
    params: &Params<R>,
    block: &[V4<R>], // [node × 4] D'⁻¹, G by component
    r: &[V4<R>],     // [node] N
    z: &mut [V4<R>], // [node] m
) -> R {
    let of_set = |(first, set): (usize, Params<R>)| {
        let nodes = first..first + set.node_count as usize;
        precondition_set(&set, &block[nodes.start * 4..nodes.end * 4], &r[nodes.clone()], &mut z[nodes])
    };
    params.column_sets().map(of_set).sum()
}

fn precondition_set<R: Real>(params: &Params<R>, block: &[V4<R>], r: &[V4<R>], z: &mut [V4<R>]) -> R {
    let columns = params.columns();
    let one_part = |(part, z): (usize, &mut [&mut [V4<R>]])| -> R {
        let mut gamma = [R::zero(); PART];
        let ends = Preconditioned { columns, r: &r[part * PART..], gamma: &mut gamma };
        solve_columns(columns, part, block, z, ends);
        gamma.into_iter().sum()
    };
    let (mut pieces, levels) = by_columns(z, columns);
    let parts = pieces.par_chunks_exact_mut(levels).enumerate().with_min_len(parts_at_once(params));
    let sums: Vec<R> = parts.map(one_part).collect();
    sums.into_iter().sum()
}

/// The nodes of a part.
struct Preconditioned<'a, R> {
    columns: usize,           // of all parts
    r: &'a [V4<R>],           // from its first column on
    gamma: &'a mut [R; PART], // [column] r·z
}

impl<R: Real> Ends<R> for Preconditioned<'_, R> {
    #[inline(always)]
    fn load(&mut self, level: usize, z: &[V4<R>], load: &mut Components<R>) {
        let r = &self.r[level * self.columns..][..z.len()];
        from_nodes(r.len(), |c, n| r[c][n], load);
    }

    #[inline(always)]
    fn take(&mut self, level: usize, z: &mut [V4<R>], solution: &Components<R>) {
        let r = &self.r[level * self.columns..][..z.len()];
        let count = z.len().min(PART);
        let [x, y, up] = solution.each_ref().map(|plane| &plane[..count]);
        let (z, r, gamma) = (&mut z[..count], &r[..count], &mut self.gamma[..count]);
        for c in 0..count {
            z[c] = [x[c], y[c], up[c], R::zero()];
            gamma[c] += r[c][0] * x[c] + r[c][1] * y[c] + r[c][2] * up[c];
        }
    }
}
