//! The CPU path's conjugate gradients over the slots of a solve.

use super::arrays::{Bricks, Elastic, Inverse, Space};
use super::{CpuBackend, request};
use crate::backend::Wanted;
use crate::error::Result;
use crate::kernels::springs_product;
use crate::linear::{Outcome, Slot, solve};
use crate::math::{Real, V3, V4, widen};
use rayon::prelude::*;

impl<R: Real> CpuBackend<R> {
    /// Solves the linear systems of slots, and picks values.
    pub(super) fn solve_slots(
        &mut self,
        wanted: &[Wanted],
        pick: &[(usize, u32)],
    ) -> Result<(Vec<Outcome>, Vec<[f64; 3]>)> {
        let n = self.node_count;
        if let Elastic::Bricks(Bricks { direct: Some(direct), rotation, .. }) = &mut self.law
            && !direct.current
        {
            direct.factor(&widen(rotation), &widen(&self.free))?;
        }
        let (params, free, block, law) = (&self.params, &self.free, &self.block, &self.law);
        let (load, floor, max_iterations) = (self.load_squared, self.floor, self.max_iterations);
        let inverse = match law {
            Elastic::Bricks(b) => b.inverse(params, free, block),
            Elastic::Springs { .. } => Inverse::Columns { params, block },
        };
        let arrays = (
            self.x.par_chunks_mut(n),
            self.r.par_chunks_mut(n),
            self.p.par_chunks_mut(n),
            self.s.par_chunks_mut(n),
            self.z.par_chunks_mut(n),
            self.w.par_chunks_mut(n),
            self.space.par_iter_mut(),
        );
        let mut done: Vec<(usize, Outcome)> = arrays
            .into_par_iter()
            .enumerate()
            .filter_map(|(slot, arrays)| Some((wanted.iter().find(|w| w.slot == slot)?, arrays)))
            .map(|(want, (x, r, p, s, z, w, Space { scratch, levels: work }))| {
                let product = |z: &[V4<R>], w: &mut [V4<R>]| match law {
                    Elastic::Bricks(b) => b.multiply(params, free, z, w, scratch),
                    Elastic::Springs { first, half, tangent, .. } => {
                        springs_product::springs_product(params, first, half, tangent, free, z, w)
                    }
                };
                let request = request(want.target, floor);
                let outcome = solve(
                    Slot { x, r, p, s, z, w },
                    &request,
                    load,
                    want.target.iterations(max_iterations),
                    product,
                    |r: &[V4<R>], z: &mut [V4<R>]| inverse.apply(work, r, z),
                );
                (want.slot, outcome)
            })
            .collect();
        done.sort_by_key(|(slot, _)| *slot);
        let find = |w: &Wanted| done.iter().find(|d| d.0 == w.slot).map(|d| d.1).unwrap_or_default();
        let outcomes = wanted.iter().map(find).collect();
        let picked = pick.iter().map(|(slot, node)| V3::from4(self.x[slot * n + *node as usize]).f64()).collect();
        Ok((outcomes, picked))
    }
}
