//! Neo-Hookean bricks on the CPU path: per-cell tangents, their product, and Newton's method for a step.
//!
//! A step is the least of `Π(Δx) = ½ Δx·(inertia M + (r_K/h) K₀) Δx + σ (W(u + Δx) − f(u)·Δx) − b·Δx`, `σ` the integrator's share of the end
//! (1, or ½ for Newmark), `K₀` the small-strain bricks turned with the cells, which Rayleigh's damping and the preconditioner take. Newton:
//! `(inertia M + (r_K/h) K₀ + σ K_T) e = −∇Π`, solved by the conjugate gradients to a share of the residual that falls with it, so that
//! convergence stays quadratic; then `Δx += t e`, `t` halved until `Π` falls enough (Armijo) and no cell is inside out. Where the
//! gradients break down the tangent is not positive: `K₀` is added to it, ten times more each time, until they end (counted).
//! What touches is solved with one linearisation per step, at the step's start: contact columns and correction then share one matrix;
//! over steps at rest that is Newton's method too.
//! Source: Nocedal, Wright 2006, chapters 3 and 7 (line search, inexact Newton); Eisenstat, Walker 1996 (the falling share).

use super::CpuBackend;
use super::arrays::Elastic;
use crate::backend::{FREE, Nonlinear, Target, Wanted};
use crate::error::{Error, Result};
use crate::kernels::{PARALLEL, Params};
use crate::linear::Outcome;
use crate::math::{Real, V4, norm, round, widen};
use crate::model::NeoHookean;
use rayon::prelude::*;

/// Newton iterations of a step at most; 3 to 10 are usual, a bar that buckles by half its length takes 46.
const MOST: u32 = 100;
/// Largest share of its residual that an iteration's solve leaves: less costs more inside, more costs more iterations.
const SHARE: f64 = 0.1;
/// Armijo's share of the promised fall.
const FALL: f64 = 1e-4;
/// Halvings of a step at most: 10⁻⁹ of it.
const HALVINGS: u32 = 30;
/// First share of `K₀` that is added to a tangent that is not positive, and how often ten times more is tried.
const SHIFT: f64 = 0.1;
const SHIFTS: u32 = 5;

/// The law's arrays.
pub(super) struct Neo<R> {
    law: NeoHookean,
    params: Params<f64>,
    /// `[cell]` tangents by rows, N/m
    tangent: Vec<[[R; 24]; 24]>,
    /// Share of the change of forces over a step that it sees.
    end_share: f64,
    /// `r_K/h`, and what has been added for tangents that are not positive.
    pub damping: f64,
    pub shift: f64,
    pub count: Nonlinear,
}

impl<R: Real> Neo<R> {
    pub fn new(law: NeoHookean, params: Params<f64>, end_share: f64) -> Self {
        let tangent = vec![[[R::zero(); 24]; 24]; params.cell_count as usize];
        let damping = params.stiffness_factor - end_share;
        Self { law, params, tangent, end_share, damping, shift: 0.0, count: Nonlinear::default() }
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
                *k = state.tangent().map(|row| row.map(R::of));
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
        let share = R::of(self.end_share);
        let mut dot = R::zero();
        for (node, w) in w.iter_mut().enumerate() {
            let c = params.node_at(node);
            let mut sum = [R::zero(); 3];
            for a in 0..8 {
                if let Some(cell) = params.cell_below(c, a) {
                    (0..3).for_each(|n| sum[n] += cells[cell][3 * a + n]);
                }
            }
            for n in 0..3 {
                let more = share * sum[n] * free[node][n];
                w[n] += more;
                dot += z[node][n] * more;
            }
        }
        dot
    }
}

/// A place on the way to a step's solution.
struct Trial<R> {
    /// `[node]` m
    dx: Vec<V4<R>>,
    /// J
    potential: f64,
    /// `[node]` −∇Π, N
    rest: Vec<V4<R>>,
}

impl<R: Real> CpuBackend<R> {
    fn neo(&mut self) -> Option<&mut Neo<R>> {
        match &mut self.law {
            Elastic::Bricks(bricks) => bricks.neo.as_deref_mut(),
            Elastic::Springs { .. } => None,
        }
    }

    /// Bytes of the cells' tangents.
    pub(super) fn tangent_bytes(&self) -> u64 {
        match &self.law {
            Elastic::Bricks(bricks) => bricks.neo.as_ref().map_or(0, |n| size_of_val(&n.tangent[..]) as u64),
            Elastic::Springs { .. } => 0,
        }
    }

    /// Counts of the step so far.
    pub(super) fn count(&self) -> Nonlinear {
        match &self.law {
            Elastic::Bricks(bricks) => bricks.neo.as_ref().map(|n| n.count).unwrap_or_default(),
            Elastic::Springs { .. } => Nonlinear::default(),
        }
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
            neo.shift = if neo.shift == 0.0 { SHIFT } else { 10.0 * neo.shift };
            neo.count.indefinite += 1;
        }
    }

    /// The free motion by Newton's method; the slot's right-hand side is the step's `b`, its solution the increment.
    pub(super) fn newton(&mut self, tolerance: f64) -> Result<Outcome> {
        let n = self.node_count;
        let b = self.r[..n].to_vec();
        let target = (tolerance * self.load_squared.f64().sqrt()).max(self.floor);
        let start = vec![[R::zero(); 4]; n];
        let Some(mut here) = self.trial(&b, start)? else { unreachable!("forces at the step's start were taken") };
        let mut size = norm(&widen(&here.rest));
        let first = size;
        let mut iterations = 0;
        let mut newton = 0;
        while size > target && newton < MOST {
            newton += 1;
            let place = self.moved(&here.dx);
            if let Some(neo) = self.neo() {
                neo.linearise(&place);
            }
            let wanted = (SHARE * size * (size / first).min(1.0)).max(0.1 * target);
            let (outcome, direction) = self.direction(&here.rest, wanted)?;
            iterations += outcome.iterations;
            let Some(next) = self.search(&b, &here, &direction)? else {
                break;
            };
            here = next;
            size = norm(&widen(&here.rest));
        }
        if let Some(neo) = self.neo() {
            neo.count.iterations = newton;
            neo.shift = 0.0;
        }
        self.x[..n].copy_from_slice(&here.dx);
        Ok(Outcome { iterations, converged: size <= target, residual: size, target })
    }

    /// `u + Δx` in f64.
    fn moved(&self, dx: &[V4<R>]) -> Vec<V4<f64>> {
        let sum = |(u, d): (&V4<R>, &V4<R>)| std::array::from_fn(|n| u[n].f64() + d[n].f64());
        self.u.iter().zip(dx).map(sum).collect()
    }

    /// Potential and residual at an increment; `None` where a cell is inside out.
    fn trial(&mut self, b: &[V4<R>], dx: Vec<V4<R>>) -> Result<Option<Trial<R>>> {
        let place = self.moved(&dx);
        let Elastic::Bricks(bricks) = &self.law else { return Ok(None) };
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
        Ok(Some(Trial { dx, potential, rest }))
    }

    /// Solves for Newton's direction to a residual, N, raising the tangent until it is positive.
    fn direction(&mut self, rest: &[V4<R>], residual: f64) -> Result<(Outcome, Vec<V4<R>>)> {
        let n = self.node_count;
        if let Some(neo) = self.neo() {
            neo.shift = 0.0;
        }
        let wanted = [Wanted { slot: FREE, target: Target::Absolute(residual) }];
        let mut spent = 0;
        for attempt in 0..=SHIFTS {
            self.r[..n].copy_from_slice(rest);
            self.x[..n].fill([R::zero(); 4]);
            let mut outcome = self.solve_slots(&wanted, &[])?.0[0];
            spent += outcome.iterations;
            if !outcome.broken(self.max_iterations) || attempt == SHIFTS {
                outcome.iterations = spent;
                return Ok((outcome, self.x[..n].to_vec()));
            }
            self.raise();
        }
        unreachable!("the last attempt returns")
    }

    /// The first of the halved steps that lets the potential fall; `None` where none does: what is left is rounding.
    fn search(&mut self, b: &[V4<R>], here: &Trial<R>, direction: &[V4<R>]) -> Result<Option<Trial<R>>> {
        let product = |(r, e): (&V4<R>, &V4<R>)| (0..3).map(|n| r[n].f64() * e[n].f64()).sum::<f64>();
        let promised: f64 = here.rest.iter().zip(direction).map(product).sum();
        let size = norm(&widen(&here.rest));
        let mut t = 1.0;
        for _ in 0..HALVINGS {
            let along = |(d, e): (&V4<R>, &V4<R>)| round(&[0, 1, 2, 3].map(|n| d[n].f64() + t * e[n].f64()));
            let dx: Vec<V4<R>> = here.dx.iter().zip(direction).map(along).collect();
            if let Some(next) = self.trial(b, dx)? {
                let falls = next.potential <= here.potential - FALL * t * promised;
                // near the end a fall is below the potential's rounding, and the residual still tells
                let closer = t == 1.0 && norm(&widen(&next.rest)) < 0.5 * size;
                if promised > 0.0 && (falls || closer) {
                    return Ok(Some(next));
                }
            }
            t *= 0.5;
        }
        Ok(None)
    }
}
