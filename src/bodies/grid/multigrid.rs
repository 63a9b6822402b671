//! Geometric multigrid on the CPU, built from the kernels' twins: one V-cycle preconditions the conjugate gradients.
//!
//! On each level: pre-smooth, restrict the residual to the next coarser level, prolongate the correction, post-smooth. The smoother solves
//! each z-column of nodes exactly (layers are thin, so the coupling along z is stiff), accelerated by Chebyshev polynomials on `[λ/20, λ]`,
//! with the bound `λ` of `bodies::grid::levels`. The coarsest level gets one longer polynomial.
//!
//! Iterations to 10⁻³ and 10⁻⁶ of the load on grids of 16² and 32² cells by 5 and 23 levels: 5–6 and 10–11 at ν 0.45, 9–12 and 22–25 at
//! ν 0.49 (`tests/verify/multigrid.rs`). Tried and rejected, with the same degree on all levels: 1 (14 and 31 iterations at 16×16×5, ν 0.45),
//! 2 (7 and 16) and 4 (4 and 9), which cost as many products; Chebyshev polynomials of the fourth kind (no better); more sweeps on the
//! coarsest level (no effect); four-colour Gauss–Seidel over columns (in the prototype a little less work than degree 2, with four times
//! the dispatches).
//! On a cut grid the columns at one (x, y) may have to be solved together ([`super::forks`]; CPU path only: on a device each by itself).
//! On the CPU path the cycle is in f32 also where the conjugate gradients are in f64, which keep the solution's precision: the same
//! iterations up to ν 0.4999 (94 of 94 at 10⁻⁴), an eighth less time for a step of the incision.
//! Source: Brandt 1977; line smoothing with semi-coarsening: Schaffer 1998; Chebyshev recurrence: Saad 2003, algorithm 12.1.

use super::element;
use super::forks::Forks;
use super::levels::Level;
use crate::bodies::Model;
use crate::bodies::cpu::LevelWork;
use crate::kernels::blocks::blocks;
use crate::kernels::coarsen::coarsen;
use crate::kernels::factor::factor;
use crate::kernels::product::{Frames, LANES, Modes, cell_groups, product};
use crate::kernels::prolongation::prolongation;
use crate::kernels::relax::relax;
use crate::kernels::restriction::restriction;
use crate::kernels::split_product::split_product;
use crate::kernels::{PARALLEL, Params};
use crate::math::wide::{Lanes, MOST, Task, dot_product};
use crate::math::{M3, Real, V4, same, same_mut};
use rayon::prelude::*;

/// Smoothing steps before and after the correction on the finest level. 2 needs a third more iterations, 4 a fifth fewer; both take the same
/// time in total.
const DEGREE: usize = 3;
/// The same on the levels below it. Iterations and time of a step in incision.toml, nodule.toml and a grid of 22 × 22 × 23 cells (CPU, f64, two
/// threads): with 3, 0.96 to 1.01 and 1.05 to 1.08; with 1, 1.0 to 1.2 and 0.94 to 1.1; with 2 and 1 below the second level, 1.01 to 1.24 and 0.99 to
/// 1.09.
const COARSE_DEGREE: usize = 2;
/// The smoother targets eigenvalues from `λ/SPREAD` up; coarse levels treat the rest. At 8 the iteration count grows by a seventh.
const SPREAD: f64 = 20.0;
/// Steps and eigenvalue ratio of the polynomial on the coarsest level, which has 2×2 columns of cells; 40 steps change no iteration count.
const COARSEST_DEGREE: usize = 4;
const COARSEST_SPREAD: f64 = 15.0;

/// Coefficients (keep, gain) of a Chebyshev polynomial on `[largest/spread, largest]`, one pair per step.
pub fn chebyshev(largest: f64, spread: f64, degree: usize) -> Vec<[f64; 2]> {
    let (theta, delta) = (0.5 * largest * (1.0 + 1.0 / spread), 0.5 * largest * (1.0 - 1.0 / spread));
    let sigma = theta / delta;
    let mut rho = 1.0 / sigma;
    let mut out = vec![[0.0, 1.0 / theta]];
    for _ in 1..degree {
        let next = 1.0 / (2.0 * sigma - rho);
        out.push([next * rho, 2.0 * next / delta]);
        rho = next;
    }
    out
}

/// Coefficients of one smoothing on a level, counted from the finest (0), of `levels`.
pub fn steps(largest: f64, level: usize, levels: usize) -> Vec<[f64; 2]> {
    let (spread, degree) = match level {
        _ if level + 1 == levels => (COARSEST_SPREAD, COARSEST_DEGREE),
        0 => (SPREAD, DEGREE),
        _ => (SPREAD, COARSE_DEGREE),
    };
    chebyshev(largest, spread, degree)
}

/// Arrays of a body that the finest level of its multigrid is made of, in the body's precision.
#[derive(Clone, Copy)]
pub struct Finest<'a, R> {
    /// Sizes.
    pub params: &'a Params<R>,
    /// `[node]` DOF mask (1 free, 0 fixed) and mass, kg
    pub dofs: &'a [V4<R>],
    /// `[cells_z]` layer
    pub layer_of: &'a [u32],
    /// `[cell]` quaternion
    pub rotation: &'a [V4<R>],
    /// The same for the product.
    pub frames: &'a Frames<R>,
    /// Table of split nodes and the split cells in order of their rows.
    pub split: (&'a [u32], &'a [u32]),
}

/// Operator of one level.
pub struct Operator<'a, R> {
    /// Sizes.
    pub params: Params<R>,
    /// `[node]` DOF mask (1 free, 0 fixed) and mass, kg
    pub dofs: &'a [V4<R>],
    /// `[node × 4]` factored z-columns
    pub block: &'a [V4<R>],
    /// Smoothing coefficients (keep, gain).
    pub steps: &'a [[R; 2]],
    /// `[layer]` element matrices as mirror blocks, N/m
    pub modes: &'a [Modes<R>],
    /// `[cells_z]` layer
    pub layer_of: &'a [u32],
    /// `[cell]` quaternion
    pub rotation: &'a [V4<R>],
    /// The same for the product.
    pub frames: &'a Frames<R>,
    /// Table of split nodes and the split cells in order of their rows; finest level only.
    pub split: (&'a [u32], &'a [u32]),
    /// Columns that the smoother does not take apart; finest level only.
    forks: Option<&'a Forks<R>>,
}

/// Arrays of all levels, finest first, in precision `S`. Those that the body has in the same precision stay empty in the finest.
pub struct Hierarchy<S> {
    levels: Vec<Arrays<S>>,
    forks: Forks<S>,
    /// The table of split nodes is new or was changed by a cut since the last refresh.
    pub cut: bool,
}

struct Arrays<R> {
    params: Params<R>,
    stiffness: Vec<M3<R>>,
    modes: Vec<Modes<R>>,
    steps: Vec<[R; 2]>,
    rotation: Vec<V4<R>>,
    frames: Frames<R>,
    dofs: Vec<V4<R>>,
    block: Vec<V4<R>>,
}

impl<S: Real> Hierarchy<S> {
    /// Levels of a model's grid; `None` if it does not use multigrid.
    pub fn new(model: &Model) -> Option<Self> {
        let multigrid = model.hexahedra().multigrid.as_ref()?;
        let levels = 1 + multigrid.coarse.len();
        let rounded = |largest: f64, level: usize| steps(largest, level, levels).iter().map(|s| s.map(S::of)).collect();
        let of = |(number, level): (usize, &Level)| {
            let params: Params<S> = level.params(model.params());
            Arrays {
                stiffness: element::blocks(&level.stiffness),
                modes: element::rounded_modes(&level.stiffness),
                steps: rounded(level.largest, 1 + number),
                rotation: vec![[S::zero(); 4]; params.frames()],
                frames: Frames::default(),
                dofs: level.dofs.iter().map(|f| f.map(S::of)).collect(),
                block: vec![[S::zero(); 4]; params.node_count as usize * 4],
                params,
            }
        };
        // nodal arrays with room for the reserve
        let finest = Arrays {
            stiffness: model.system_blocks(),
            modes: model.modes(),
            steps: rounded(multigrid.largest, 0),
            rotation: vec![],
            frames: Frames::default(),
            dofs: vec![],
            block: Vec::with_capacity(4 * model.node_count()),
            params: model.params(),
        };
        let levels = std::iter::once(finest).chain(multigrid.coarse.iter().enumerate().map(of)).collect();
        Some(Self { levels, forks: Forks::default(), cut: true })
    }

    /// Updates all levels from a body's arrays: rotations and factored columns.
    pub fn refresh<R: Real>(&mut self, of: Finest<R>) {
        let (finest, coarse) = self.levels.split_at_mut(1);
        let finest = &mut finest[0];
        finest.params = of.params.rounded();
        // copies in another precision
        if same::<R, S>(of.dofs).is_none() {
            replace(&mut finest.dofs, of.dofs);
            replace(&mut finest.rotation, of.rotation);
            finest.frames.update(&finest.params, &finest.rotation, of.split.0);
        }
        let Arrays { params, stiffness, block, dofs, rotation, .. } = finest;
        let (dofs, rotation) = (same(of.dofs).unwrap_or(dofs), same(of.rotation).unwrap_or(rotation));
        block.resize(4 * params.node_count as usize, [S::zero(); 4]);
        let (forks, cut) = (&mut self.forks, std::mem::take(&mut self.cut));
        let finest_level = || {
            blocks(params, stiffness, of.layer_of, rotation, dofs, of.split.0, block);
            factor(params, block);
            if cut {
                *forks = Forks::new(params, of.split.0);
            }
            forks.factor(params, stiffness, of.layer_of, rotation, dofs);
        };
        // they ask for the finest level's rotations alone, not for its columns
        let coarse_levels = || {
            let mut finer = (*params, rotation);
            for level in coarse {
                coarsen(&finer.0, finer.1, &mut level.rotation);
                level.frames.update(&level.params, &level.rotation, &[]);
                blocks(
                    &level.params,
                    &level.stiffness,
                    of.layer_of,
                    &level.rotation,
                    &level.dofs,
                    &[],
                    &mut level.block,
                );
                factor(&level.params, &mut level.block);
                finer = (level.params, &level.rotation);
            }
        };
        rayon::join(finest_level, coarse_levels);
    }

    /// Operators of all levels, finest first, after [`Hierarchy::refresh`] with the same arrays.
    pub fn operators<'a, R: Real>(&'a self, of: Finest<'a, R>) -> Vec<Operator<'a, S>> {
        let mut operators: Vec<Operator<S>> = self.levels.iter().map(|level| level.operator(of.layer_of)).collect();
        let finest = &mut operators[0];
        finest.dofs = same(of.dofs).unwrap_or(finest.dofs);
        finest.rotation = same(of.rotation).unwrap_or(finest.rotation);
        finest.frames = of.frames.same().unwrap_or(finest.frames);
        finest.split = of.split;
        finest.forks = Some(&self.forks);
        operators
    }

    /// Size, bytes.
    pub fn bytes(&self) -> usize {
        let of = |level: &Arrays<S>| {
            let arrays = [&level.rotation, &level.dofs, &level.block];
            arrays.iter().map(|a| a.capacity() * size_of::<V4<S>>()).sum::<usize>() + level.frames.bytes()
        };
        self.levels.iter().map(of).sum()
    }
}

impl<S: Real> Arrays<S> {
    fn operator<'a>(&'a self, layer_of: &'a [u32]) -> Operator<'a, S> {
        Operator {
            params: self.params,
            dofs: &self.dofs,
            block: &self.block,
            steps: &self.steps,
            modes: &self.modes,
            layer_of,
            rotation: &self.rotation,
            frames: &self.frames,
            split: (&[], &[]),
            forks: None,
        }
    }
}

/// Replaces an array by one in another precision.
fn replace<R: Real, S: Real>(to: &mut Vec<V4<S>>, from: &[V4<R>]) {
    to.clear();
    to.extend(from.iter().map(|v| v.map(|c| S::of(c.f64()))));
}

/// Zeroed work vectors for each level, for vectors in precision `R`; in the same precision the finest level has no `r` and `z` of its own.
pub fn workspaces<R: Real, S: Real>(levels: &[Operator<S>]) -> Vec<LevelWork<S>> {
    let of = |(number, level): (usize, &Operator<S>)| {
        let zeros = |count: usize| vec![[S::zero(); 4]; count];
        let count = level.params.node_count as usize;
        let kept = if number == 0 && R::NAME == S::NAME { 0 } else { count };
        let scratch = vec![[[[S::zero(); LANES]; 3]; 8]; cell_groups(&level.params)];
        LevelWork { scratch, r: zeros(kept), z: zeros(kept), d: zeros(count), w: zeros(count), before: vec![] }
    };
    levels.iter().enumerate().map(of).collect()
}

impl<R: Real> Operator<'_, R> {
    /// `w = A z`
    fn multiply(&self, z: &[V4<R>], work: &mut LevelWork<R>) {
        let LevelWork { w, scratch, .. } = work;
        let (split, cells) = self.split;
        product(&self.params, self.modes, self.layer_of, self.frames, self.dofs, z, w, scratch);
        if !cells.is_empty() {
            // duplicates that no cell has reached: the relaxation leaves in `w` what it computed for others
            w[self.params.grid_nodes()..].fill([R::zero(); 4]);
            split_product(&self.params, self.modes, self.layer_of, self.rotation, self.dofs, split, cells, z, w);
        }
    }

    /// All smoothing steps for `A z = r`, starting from zero or from `z`; returns `r·z`.
    fn smooth(&self, from_zero: bool, r: &[V4<R>], z: &mut [V4<R>], work: &mut LevelWork<R>) -> R {
        let mut gamma = R::zero();
        for (n, [keep, gain]) in self.steps.iter().enumerate() {
            let fresh = from_zero && n == 0;
            if !fresh {
                self.multiply(z, work);
            }
            let params = Params { fresh: u32::from(fresh), keep: *keep, gain: *gain, ..self.params };
            let LevelWork { w, d, before, .. } = &mut *work;
            if let Some(forks) = self.forks {
                forks.solve(fresh, [r, w, d, z], before);
            }
            gamma = relax(&params, self.block, r, w, d, z);
            if let Some(forks) = self.forks {
                gamma += forks.replace(before, &params, r, d, z);
            }
        }
        gamma
    }
}

/// `z = M⁻¹ r` by one V-cycle in precision `S` for vectors in precision `R`; returns `r·z`.
pub fn apply<R: Real, S: Real>(levels: &[Operator<S>], work: &mut [LevelWork<S>], r: &[V4<R>], z: &mut [V4<R>]) -> R {
    if let (Some(r), Some(z)) = (same(r), same_mut(z)) {
        return R::of(cycle(levels, work, r, z).f64());
    }
    // of a size from 1 to 2, since a motion that fades away leaves the range of f32 long before that of f64
    let of_chunk = |r: &[V4<R>]| R::widest(Largest(r.as_flattened()));
    let size = r.par_chunks(PARALLEL).map(of_chunk).collect::<Vec<R>>().into_iter().fold(R::zero(), R::max);
    if size == R::zero() {
        z.fill([R::zero(); 4]);
        return R::zero();
    }
    let size = R::of(power_of_two(size.f64()));
    let (mut own_r, mut own_z) = (std::mem::take(&mut work[0].r), std::mem::take(&mut work[0].z));
    own_r.par_chunks_mut(PARALLEL).zip(r.par_chunks(PARALLEL)).for_each(|(to, from)| {
        let (from, to) = (from.as_flattened(), to.as_flattened_mut());
        R::widest(Rounded { from, factor: R::one() / size, to });
    });
    cycle(levels, work, &own_r, &mut own_z);
    let chunks = z.par_chunks_mut(PARALLEL).zip(own_z.par_chunks(PARALLEL)).zip(r.par_chunks(PARALLEL));
    let gammas = chunks.map(|((z, own), r)| {
        R::widest(Widened { from: own.as_flattened(), factor: size, to: z.as_flattened_mut(), r: r.as_flattened() })
    });
    let sums: Vec<R> = gammas.collect();
    (work[0].r, work[0].z) = (own_r, own_z);
    sums.into_iter().sum()
}

/// Largest power of two that is not above a positive number: factors that round nothing.
fn power_of_two(size: f64) -> f64 {
    const EXPONENT: u64 = 0x7ff << 52;
    f64::from_bits(size.to_bits() & EXPONENT).max(f64::MIN_POSITIVE)
}

/// Largest number without its sign.
struct Largest<'a, R>(&'a [R]);

impl<R: Real> Task<R> for Largest<'_, R> {
    type Output = R;
    #[inline(always)]
    fn run<L: Lanes<R>>(self, _: L) -> R {
        let mut most = [R::zero(); MOST];
        let (chunks, rest) = self.0.as_chunks::<MOST>();
        for chunk in chunks {
            for n in 0..MOST {
                most[n] = most[n].max(chunk[n].abs());
            }
        }
        for n in 0..rest.len() {
            most[n] = most[n].max(rest[n].abs());
        }
        most.into_iter().fold(R::zero(), R::max)
    }
}

/// `to = factor from`, in another precision.
struct Rounded<'a, R, S> {
    from: &'a [R],
    factor: R,
    to: &'a mut [S],
}

impl<R: Real, S: Real> Task<R> for Rounded<'_, R, S> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes<R>>(self, _: L) {
        let Self { from, factor, to } = self;
        for i in 0..to.len().min(from.len()) {
            to[i] = S::of((from[i] * factor).f64());
        }
    }
}

/// `to = factor from`, in another precision; returns `r·to`.
struct Widened<'a, R, S> {
    from: &'a [S],
    factor: R,
    to: &'a mut [R],
    r: &'a [R],
}

impl<R: Real, S: Real> Task<R> for Widened<'_, R, S> {
    type Output = R;
    #[inline(always)]
    fn run<L: Lanes<R>>(self, _: L) -> R {
        let Self { from, factor, to, r } = self;
        for i in 0..to.len().min(from.len()) {
            to[i] = R::of(from[i].f64()) * factor;
        }
        dot_product(to, r)
    }
}

/// `z = M⁻¹ r` by one V-cycle over levels, finest first; returns `r·z`.
fn cycle<R: Real>(levels: &[Operator<R>], work: &mut [LevelWork<R>], r: &[V4<R>], z: &mut [V4<R>]) -> R {
    let (own, coarser) = (&levels[0], &levels[1..]);
    let (here, below) = work.split_at_mut(1);
    let here = &mut here[0];
    // pre-smoothing
    let gamma = own.smooth(true, r, z, here);
    let (Some(next), Some(work)) = (coarser.first(), below.first_mut()) else {
        return gamma;
    };
    own.multiply(z, here);
    // coarse correction of the residual
    let (mut coarse_r, mut coarse_z) = (std::mem::take(&mut work.r), std::mem::take(&mut work.z));
    restriction(&own.params, next.dofs, own.split.0, r, &here.w, &mut coarse_r);
    cycle(coarser, below, &coarse_r, &mut coarse_z);
    prolongation(&own.params, own.dofs, own.split.0, &coarse_z, z);
    (below[0].r, below[0].z) = (coarse_r, coarse_z);
    own.smooth(false, r, z, here)
}

#[cfg(test)]
mod tests {
    use super::power_of_two;

    #[test]
    fn factors_are_powers_of_two_within_a_factor_of_two() {
        for size in [f64::MIN_POSITIVE, 1e-300, 0.1, 1.0, 3.9, 4.0, 1e300, f64::MAX] {
            let factor = power_of_two(size);
            assert!(factor <= size && size < 2.0 * factor, "{size:e}: {factor:e}");
            assert!(factor * (1.0 / factor) == 1.0 && (1.0 / factor).is_finite(), "{size:e}: {factor:e}");
        }
        assert!(power_of_two(5e-324) > 0.0);
    }
}
