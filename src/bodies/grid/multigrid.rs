//! Geometric multigrid on the CPU, built from the kernels' twins: one V-cycle preconditions the conjugate gradients.
//!
//! On each level: pre-smooth, restrict the residual to the next coarser level, prolongate the correction, post-smooth. The smoother solves
//! each z-column of nodes exactly (layers are thin, so the coupling along z is stiff), accelerated by Chebyshev polynomials on `[λ/20, λ]`,
//! with the bound `λ` of `bodies::grid::levels`. The coarsest level gets one longer polynomial.
//!
//! Iterations to 10⁻³ and 10⁻⁶ of the load on any grid: 4–5 and 9–11 at ν 0.45, 8–11 and 20–24 at ν 0.49 (`benches/results`). Tried and
//! rejected: degrees 1 (14 and 31 iterations at 16×16×5, ν 0.45), 2 (7 and 16) and 4 (4 and 9), which cost as many products; Chebyshev
//! polynomials of the fourth kind (no better); more sweeps on the coarsest level (no effect); four-colour Gauss–Seidel over columns (in the
//! prototype a little less work than degree 2, with four times the dispatches).
//! Source: Brandt 1977; line smoothing with semi-coarsening: Schaffer 1998; Chebyshev recurrence: Saad 2003, algorithm 12.1.

use super::element;
use super::levels::Level;
use crate::bodies::Model;
use crate::bodies::cpu::LevelWork;
use crate::kernels::Params;
use crate::kernels::blocks::blocks;
use crate::kernels::coarsen::coarsen;
use crate::kernels::factor::factor;
use crate::kernels::product::{Frames, LANES, Modes, cell_groups, product};
use crate::kernels::prolongation::prolongation;
use crate::kernels::relax::relax;
use crate::kernels::restriction::restriction;
use crate::kernels::split_product::split_product;
use crate::math::{M3, Real, V4};

/// Smoothing steps before and after the correction. 2 needs a third more iterations, 4 a fifth fewer; both take the same time in total.
pub const DEGREE: usize = 3;
/// The smoother targets eigenvalues from `λ/SPREAD` up; coarse levels treat the rest. At 8 the iteration count grows by a seventh.
const SPREAD: f64 = 20.0;
/// Steps and eigenvalue ratio of the polynomial on the coarsest level, which has 2×2 columns of cells; 40 steps change no iteration count.
pub const COARSEST_DEGREE: usize = 4;
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

/// Coefficients of one smoothing on a level.
pub fn steps(largest: f64, coarsest: bool) -> Vec<[f64; 2]> {
    if coarsest { chebyshev(largest, COARSEST_SPREAD, COARSEST_DEGREE) } else { chebyshev(largest, SPREAD, DEGREE) }
}

/// Operator of one level.
pub struct Operator<'a, R> {
    /// Sizes.
    pub params: Params<R>,
    /// `[node]` DOF mask (1 free, 0 fixed) and mass, kg
    pub free: &'a [V4<R>],
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
}

/// Arrays of all coarse levels.
pub struct Hierarchy<R> {
    steps: Vec<[R; 2]>, // of the finest level
    coarse: Vec<Coarse<R>>,
}

struct Coarse<R> {
    params: Params<R>,
    stiffness: Vec<M3<R>>,
    modes: Vec<Modes<R>>,
    steps: Vec<[R; 2]>,
    rotation: Vec<V4<R>>,
    frames: Frames<R>,
    free: Vec<V4<R>>,
    block: Vec<V4<R>>,
}

impl<R: Real> Hierarchy<R> {
    /// Levels below a model's grid; `None` if it does not use multigrid.
    pub fn new(model: &Model) -> Option<Self> {
        let multigrid = model.hexahedra().multigrid.as_ref()?;
        let rounded = |largest: f64, coarsest: bool| steps(largest, coarsest).iter().map(|s| s.map(R::of)).collect();
        let levels = multigrid.coarse.len();
        let of = |(number, level): (usize, &Level)| {
            let params: Params<R> = level.params(model.params());
            Coarse {
                stiffness: element::blocks(&level.stiffness),
                modes: element::rounded_modes(&level.stiffness),
                steps: rounded(level.largest, number + 1 == levels),
                rotation: vec![[R::zero(); 4]; params.frames()],
                frames: Frames::default(),
                free: level.free.iter().map(|f| f.map(R::of)).collect(),
                block: vec![[R::zero(); 4]; params.node_count as usize * 4],
                params,
            }
        };
        let coarse = multigrid.coarse.iter().enumerate().map(of).collect();
        Some(Self { steps: rounded(multigrid.largest, levels == 0), coarse })
    }

    /// Updates rotations and factored columns of the coarse levels from the finest level's rotations.
    pub fn refresh(&mut self, params: &Params<R>, layer_of: &[u32], rotation: &[V4<R>]) {
        let mut finer = (*params, rotation);
        for level in &mut self.coarse {
            coarsen(&finer.0, finer.1, &mut level.rotation);
            level.frames.update(&level.params, &level.rotation, &[]);
            blocks(&level.params, &level.stiffness, layer_of, &level.rotation, &level.free, &[], &mut level.block);
            factor(&level.params, &mut level.block);
            finer = (level.params, &level.rotation);
        }
    }

    /// Operators of all levels, finest first; `finest` is given by the caller without its `steps`.
    pub fn operators<'a>(&'a self, finest: Operator<'a, R>) -> Vec<Operator<'a, R>> {
        let layer_of = finest.layer_of;
        let coarse = self.coarse.iter().map(|c| Operator {
            params: c.params,
            free: &c.free,
            block: &c.block,
            steps: &c.steps,
            modes: &c.modes,
            layer_of,
            rotation: &c.rotation,
            frames: &c.frames,
            split: (&[], &[]),
        });
        std::iter::once(Operator { steps: &self.steps, ..finest }).chain(coarse).collect()
    }
}

/// Zeroed work vectors for each level; the finest level has no `r` and `z` of its own.
pub fn workspaces<R: Real>(levels: &[Operator<R>]) -> Vec<LevelWork<R>> {
    let of = |(number, level): (usize, &Operator<R>)| {
        let zeros = |count: usize| vec![[R::zero(); 4]; count];
        let count = level.params.node_count as usize;
        let kept = if number == 0 { 0 } else { count };
        let scratch = vec![[[[R::zero(); LANES]; 3]; 8]; cell_groups(&level.params)];
        LevelWork { scratch, r: zeros(kept), z: zeros(kept), d: zeros(count), w: zeros(count) }
    };
    levels.iter().enumerate().map(of).collect()
}

impl<R: Real> Operator<'_, R> {
    /// `w = A z`
    fn multiply(&self, z: &[V4<R>], work: &mut LevelWork<R>) {
        let LevelWork { w, scratch, .. } = work;
        let (split, cells) = self.split;
        product(&self.params, self.modes, self.layer_of, self.frames, self.free, z, w, scratch);
        if !cells.is_empty() {
            split_product(&self.params, self.modes, self.layer_of, self.rotation, self.free, split, cells, z, w);
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
            gamma = relax(&params, self.block, r, &mut work.w, &mut work.d, z);
        }
        gamma
    }
}

/// `z = M⁻¹ r` by one V-cycle over levels, finest first; returns `r·z`.
pub fn cycle<R: Real>(levels: &[Operator<R>], work: &mut [LevelWork<R>], r: &[V4<R>], z: &mut [V4<R>]) -> R {
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
    restriction(&own.params, next.free, own.split.0, r, &here.w, &mut coarse_r);
    cycle(coarser, below, &coarse_r, &mut coarse_z);
    prolongation(&own.params, own.free, own.split.0, &coarse_z, z);
    (below[0].r, below[0].z) = (coarse_r, coarse_z);
    own.smooth(false, r, z, here)
}
