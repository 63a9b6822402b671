//! Applies the factored columns ([`super::columns`]): `z = M⁻¹ r`; returns the dot product `r·z` for the conjugate gradients.
//!
//! Units: r N, z m.

use super::columns::{Components, Ends, solve_columns};
use super::{Levels, PART, Params, Source, by_columns, parts_at_once};
use crate::math::{Real, V3, V4};
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
    let one_part = |(part, mut z): (usize, Levels<V4<R>>)| -> R {
        let mut gamma = [R::zero(); PART];
        let ends = Preconditioned { columns, r: &r[part * PART..], gamma: &mut gamma };
        solve_columns(columns, part, block, &mut z, ends);
        gamma.into_iter().sum()
    };
    let sums: Vec<R> =
        by_columns(z, columns).into_par_iter().enumerate().with_min_len(parts_at_once(params)).map(one_part).collect();
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
        for n in 0..3 {
            load[n].iter_mut().zip(r).for_each(|(load, r)| *load = r[n]);
        }
    }

    #[inline(always)]
    fn take(&mut self, level: usize, z: &mut [V4<R>], solution: &Components<R>) {
        let r = &self.r[level * self.columns..][..z.len()];
        for c in 0..z.len().min(PART) {
            let own = V3::new(solution[0][c], solution[1][c], solution[2][c]);
            z[c] = own.pad(R::zero());
            self.gamma[c] += V3::from4(r[c]).dot(own);
        }
    }
}
