//! Neo-Hookean bricks on the CPU path: per-cell tangents, their product, and the places of Newton's method ([`super::super::newton`]).
//!
//! What touches is solved with one linearisation per step, at the step's start: contact columns and correction then share one matrix;
//! over steps at rest that is Newton's method too.

use super::CpuBackend;
use crate::backend::newton::{Attempt, Descent, SHIFTS, newton, raised};
use crate::backend::{FREE, Nonlinear, Target, Wanted};
use crate::error::{Error, Result};
use crate::kernels::collect_product::collect_product;
use crate::kernels::{PARALLEL, Params};
use crate::linear::Outcome;
use crate::math::{Real, V4, norm, round, widen};
use crate::model::{self, Model, NeoHookean};
use rayon::prelude::*;

/// The law's arrays.
pub(super) struct Neo<R> {
    law: NeoHookean,
    params: Params<f64>,
    /// For sums of cells' forces: with the share of the change of forces over a step that it sees.
    sums: Params<R>,
    /// `[cell]` tangents by rows, N/m
    tangent: Vec<[[R; 24]; 24]>,
    end_share: f64,
    /// `r_K/h`, and what has been added for tangents that are not positive.
    pub damping: f64,
    pub shift: f64,
    pub count: Nonlinear,
}

impl<R: Real> Neo<R> {
    /// Of a model with that law.
    pub fn new(law: &NeoHookean, model: &Model) -> Self {
        let (params, end_share) = (model.params::<f64>(), model.step.end_share());
        let tangent = vec![[[R::zero(); 24]; 24]; params.cell_count as usize];
        let damping = params.stiffness_factor - end_share;
        let sums = Params { stiffness_factor: R::of(end_share), ..model.params() };
        Self { law: law.clone(), params, sums, tangent, end_share, damping, shift: 0.0, count: Nonlinear::default() }
    }

    pub fn newton(&self) -> bool {
        self.law.newton
    }

    /// Forces at `u`, `[node]` N.
    pub fn forces(&self, u: &[V4<f64>]) -> Result<Vec<V4<f64>>> {
        self.law.forces(&self.params, u).map_err(|cell| Error::InsideOut { cell: self.params.cell_at(cell) })
    }

    /// Takes the tangents at `u`, where no cell is inside out.
    pub fn linearise(&mut self, u: &[V4<f64>]) {
        let Self { law, params, tangent, .. } = self;
        tangent.par_iter_mut().enumerate().with_min_len(PARALLEL / 32).for_each(|(cell, k)| {
            if let Some(state) = law.cell(params, u, cell) {
                *k = model::tangent(&state).map(|row| row.map(R::of));
            }
        });
    }

    /// `w += P σ K_T z`; returns what is added to `z·w`.
    pub fn add_product(&self, free: &[V4<R>], z: &[V4<R>], w: &mut [V4<R>]) -> R {
        let params = &self.params;
        let one = |(cell, k): (usize, &[[R; 24]; 24])| {
            let corners = params.corners(cell);
            let mut at = [R::zero(); 24];
            (0..24).for_each(|n| at[n] = z[corners[n / 3]][n % 3]);
            let row = |k: &[R; 24]| {
                let mut sum = R::zero();
                (0..24).for_each(|n| sum += k[n] * at[n]);
                sum
            };
            let out: [R; 24] = std::array::from_fn(|n| row(&k[n]));
            out
        };
        let cells: Vec<[R; 24]> = self.tangent.par_iter().enumerate().with_min_len(PARALLEL / 32).map(one).collect();
        collect_product(&self.sums, cells.as_flattened(), free, z, w)
    }
}

/// A place on the way to a step's solution.
#[derive(Clone)]
struct Trial<R> {
    /// `[node]` m
    dx: Vec<V4<R>>,
    /// `[node]` −∇Π, N
    rest: Vec<V4<R>>,
}

impl<R: Real> CpuBackend<R> {
    fn neo(&mut self) -> Option<&mut Neo<R>> {
        self.law.bricks_mut()?.neo.as_deref_mut()
    }

    /// Bytes of the cells' tangents.
    pub(super) fn tangent_bytes(&self) -> u64 {
        let neo = self.law.bricks().and_then(|bricks| bricks.neo.as_ref());
        neo.map_or(0, |neo| size_of_val(&neo.tangent[..]) as u64)
    }

    /// Counts of the step so far.
    pub(super) fn count(&self) -> Nonlinear {
        let neo = self.law.bricks().and_then(|bricks| bricks.neo.as_ref());
        neo.map(|neo| neo.count).unwrap_or_default()
    }

    /// One linearisation for every slot; the free motion, which comes first in a step, finds out whether it is positive.
    pub(super) fn solve_linearised(
        &mut self,
        wanted: &[Wanted],
        pick: &[(usize, u32)],
    ) -> Result<(Vec<Outcome>, Vec<[f64; 3]>)> {
        let n = self.node_count;
        let b = self.r[..n].to_vec();
        let mut found = self.solve_slots(wanted, pick)?;
        let free = wanted.iter().position(|w| w.slot == FREE);
        for _ in 0..SHIFTS {
            let broken = free.is_some_and(|k| found.0[k].broken(self.max_iterations));
            if !broken {
                break;
            }
            self.raise();
            self.r[..n].copy_from_slice(&b);
            self.x[..n].fill([R::zero(); 4]);
            found = self.solve_slots(wanted, pick)?;
        }
        Ok(found)
    }

    /// Adds more of `K₀`.
    fn raise(&mut self) {
        if let Some(neo) = self.neo() {
            neo.shift = raised(neo.shift);
            neo.count.indefinite += 1;
        }
    }

    /// The free motion by Newton's method; the slot's right-hand side is the step's `b`, its solution the increment.
    pub(super) fn newton(&mut self, tolerance: f64) -> Result<Outcome> {
        let (n, floor) = (self.node_count, self.floor);
        let zeros = vec![[R::zero(); 4]; n];
        let still = Trial { dx: zeros.clone(), rest: zeros.clone() };
        let b = self.r[..n].to_vec();
        let mut descent = Search { body: self, b, here: still.clone(), tried: still, direction: zeros };
        let (outcome, own) = newton(&mut descent, tolerance, floor)?;
        let dx = descent.here.dx;
        self.x[..n].copy_from_slice(&dx);
        if let Some(neo) = self.neo() {
            neo.count.iterations = own;
            neo.shift = 0.0;
        }
        Ok(outcome)
    }

    /// `u + Δx` in f64.
    fn moved(&self, dx: &[V4<R>]) -> Vec<V4<f64>> {
        let sum = |(u, d): (&V4<R>, &V4<R>)| std::array::from_fn(|n| u[n].f64() + d[n].f64());
        self.u.iter().zip(dx).map(sum).collect()
    }

    /// Potential and residual at an increment; `None` where a cell is inside out.
    fn trial(&mut self, b: &[V4<R>], dx: Vec<V4<R>>) -> Result<Option<(f64, Trial<R>)>> {
        let place = self.moved(&dx);
        let Some(bricks) = self.law.bricks() else { return Ok(None) };
        let Some(neo) = &bricks.neo else { return Ok(None) };
        let Some(energy) = neo.law.energy(&neo.params, &place) else { return Ok(None) };
        let forces = neo.forces(&place)?;
        let params = Params { stiffness_factor: R::of(neo.damping), ..self.params };
        let mut rest = vec![[R::zero(); 4]; dx.len()];
        let linear = bricks.linear_product(&params, &self.free, &dx, &mut rest, &mut self.space[FREE].scratch);
        let mut potential = 0.5 * linear.f64() + neo.end_share * energy;
        for i in 0..dx.len() {
            for n in 0..3 {
                let change = neo.end_share * (forces[i][n] - self.f[i][n].f64());
                let axis = self.free[i][n].f64();
                potential -= dx[i][n].f64() * (b[i][n].f64() + neo.end_share * self.f[i][n].f64());
                rest[i][n] = R::of((b[i][n].f64() - rest[i][n].f64() - change) * axis);
            }
        }
        Ok(Some((potential, Trial { dx, rest })))
    }
}

/// A body on its way, with the step's right-hand side.
struct Search<'a, R: Real> {
    body: &'a mut CpuBackend<R>,
    b: Vec<V4<R>>,
    here: Trial<R>,
    tried: Trial<R>,
    direction: Vec<V4<R>>,
}

impl<R: Real> Descent for Search<'_, R> {
    fn attempt(&mut self, share: f64) -> Result<Option<Attempt>> {
        let along =
            |(d, e): (&V4<R>, &V4<R>)| round(&std::array::from_fn::<f64, 4, _>(|n| d[n].f64() + share * e[n].f64()));
        let dx: Vec<V4<R>> = self.here.dx.iter().zip(&self.direction).map(along).collect();
        let Some((potential, tried)) = self.body.trial(&self.b, dx)? else {
            return Ok(None);
        };
        let product = |(r, e): (&V4<R>, &V4<R>)| (0..3).map(|n| r[n].f64() * e[n].f64()).sum::<f64>();
        let promise = self.here.rest.iter().zip(&self.direction).map(product).sum();
        let size = norm(&widen(&tried.rest));
        self.tried = tried;
        Ok(Some(Attempt { potential, noise: 0.0, size, promise }))
    }

    fn take(&mut self) {
        std::mem::swap(&mut self.here, &mut self.tried);
    }

    fn direction(&mut self, residual: f64) -> Result<Outcome> {
        let place = self.body.moved(&self.here.dx);
        if let Some(neo) = self.body.neo() {
            neo.linearise(&place);
            neo.shift = 0.0;
        }
        let (body, n) = (&mut *self.body, self.b.len());
        let wanted = [Wanted { slot: FREE, target: Target::Absolute(residual) }];
        let mut spent = 0;
        for attempt in 0..=SHIFTS {
            body.r[..n].copy_from_slice(&self.here.rest);
            body.x[..n].fill([R::zero(); 4]);
            let mut outcome = body.solve_slots(&wanted, &[])?.0[0];
            spent += outcome.iterations;
            if !outcome.broken(body.max_iterations) || attempt == SHIFTS {
                outcome.iterations = spent;
                self.direction.copy_from_slice(&body.x[..n]);
                return Ok(outcome);
            }
            body.raise();
        }
        unreachable!("the last attempt returns")
    }

    fn load(&self) -> f64 {
        self.body.load_squared.f64().sqrt()
    }

    fn inside_out(&self) -> Error {
        unreachable!("forces at the step's start were taken")
    }
}
