//! The CPU path's explicit step, and the elastic forces that every step begins with.

use super::CpuBackend;
use super::arrays::{Bricks, Elastic, Space};
use crate::backend::{FREE, Nonlinear, Wanted};
use crate::error::Result;
use crate::kernels::accelerate::accelerate;
use crate::kernels::product::elastic_forces;
use crate::kernels::{Params, forces, momentum, rotations, springs};
use crate::linear::Outcome;
use crate::math::{Real, V3, V4, round, widen};
use rayon::prelude::*;

impl<R: Real> Elastic<R> {
    /// Rotations of the cells at `u`, then elastic forces at `at`, which is `u` unless the step is explicit, N; a law of springs leaves its
    /// tangents.
    ///
    /// # Errors
    /// [`crate::error::Error::InsideOut`] of a neo-Hookean body.
    pub(super) fn forces(
        &mut self,
        params: &Params<R>,
        u: &[V4<R>],
        at: &[V4<R>],
        f: &mut [V4<R>],
        space: &mut Space<R>,
    ) -> Result<()> {
        let bricks = match self {
            Elastic::Bricks(bricks) => bricks,
            Elastic::Springs { rest, first, half, law, tangent } => {
                springs::springs(params, rest, at, first, half, law, f, tangent);
                return Ok(());
            }
        };
        let Bricks { shape, pre_strain, stiffness, elastic, layer_of, rotation, split, neo, .. } = bricks;
        if params.corotational == 1 {
            rotation.par_iter_mut().enumerate().for_each(|(cell, q)| {
                *q = rotations::rotate_cell(params, shape, layer_of, split, u, cell, *q);
            });
        }
        if let Some(neo) = neo {
            let place = widen(at);
            f.iter_mut().zip(neo.forces(&place)?).for_each(|(f, force)| *f = round(&force));
            (neo.shift, neo.count) = (0.0, Nonlinear::default());
            if !neo.newton() {
                neo.linearise(&place);
            }
            return Ok(());
        }
        elastic_forces(params, shape, pre_strain, elastic, layer_of, rotation, split, at, f, &mut space.scratch);
        for node in params.touched(split).iter().map(|n| *n as usize) {
            let force = forces::node_force(params, shape, pre_strain, stiffness, layer_of, split, at, rotation, node);
            f[node] = force.pad(R::zero());
        }
        Ok(())
    }

    /// Velocities that a consistent mass sees; nothing where there is no room for them.
    pub(super) fn mean_velocities(&self, params: &Params<R>, free: &[V4<R>], v: &[V4<R>], mean_v: &mut [V4<R>]) {
        let Elastic::Bricks(Bricks { shape, layer_of, split, rotation, .. }) = self else {
            return;
        };
        mean_v.par_iter_mut().enumerate().for_each(|(i, mean)| {
            *mean = momentum::mean_velocity(params, shape, layer_of, split, rotation, free, v, i).pad(R::zero());
        });
    }
}

impl<R: Real> CpuBackend<R> {
    /// The free motion of an explicit step, and its values at nodes: one division per node, exact.
    pub(super) fn accelerate(&mut self, wanted: &[Wanted], pick: &[(usize, u32)]) -> (Vec<Outcome>, Vec<[f64; 3]>) {
        accelerate(&self.params, &self.free, &self.r, &mut self.x);
        let outcome = Outcome::exact();
        let picked = pick.iter().map(|(slot, node)| V3::from4(self.x[slot * self.node_count + *node as usize]).f64());
        debug_assert!(wanted.iter().all(|w| w.slot == FREE), "explicit steps have no contact");
        (vec![outcome; wanted.len()], picked.collect())
    }
}
