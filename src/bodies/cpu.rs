//! The seam between a kind of deformable body and the solves of the CPU path.

use super::Removal;
use crate::error::Result;
use crate::kernels::Params;
use crate::kernels::product::CellForces;
use crate::math::{Real, V4};

/// Vectors that a solve of one right-hand side works in beside its own.
#[derive(Clone, Debug, Default)]
pub struct Workspace<R> {
    /// `[cell group]` of the product
    pub scratch: Vec<CellForces<R>>,
    /// Levels of multigrid, finest first; empty before the first use.
    pub levels: Vec<LevelWork<R>>,
}

/// Vectors of one level of multigrid; the finest level's `r` and `z` are those of the conjugate gradients.
#[derive(Clone, Debug, Default)]
pub struct LevelWork<R> {
    /// `[cell group]` of the product
    pub scratch: Vec<CellForces<R>>,
    /// `[node]` N
    pub r: Vec<V4<R>>,
    /// `[node]` m
    pub z: Vec<V4<R>>,
    /// `[node]` m
    pub d: Vec<V4<R>>,
    /// `[node]` N
    pub w: Vec<V4<R>>,
}

/// Applies `z = M⁻¹ r` for the conjugate gradients and returns `r·z`; any number of threads may ask at once.
pub type Preconditioner<'a, R> = Box<dyn Fn(&mut Vec<LevelWork<R>>, &[V4<R>], &mut [V4<R>]) -> R + Sync + 'a>;

/// Point of the line search of Newton's method.
#[derive(Clone, Debug)]
pub struct Trial<R> {
    /// Π, J.
    pub potential: f64,
    /// `[node]` −∇Π, N
    pub residual: Vec<V4<R>>,
}

/// How a step of a body is solved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Solution {
    /// Its equations are linear.
    Linear,
    /// They are not, and are linearised once, at the step's start.
    Linearised,
    /// They are not, and are solved by Newton's method.
    Newton,
}

/// What a solve needs of a body: its forces, its matrix `A` and what stands for the inverse. `free` is `[node]` 1 free, 0 held, per axis, and
/// mass as `A` has it, kg.
pub trait System<R: Real>: Send + Sync {
    /// Elastic forces of a step at displacements `at`, `[node]` N, which are `u` unless the step is explicit; turns the elements as they
    /// are at `u`.
    ///
    /// # Errors
    /// [`super::Refused::InsideOut`] of a hyperelastic body.
    fn forces(
        &mut self,
        params: &Params<R>,
        u: &[V4<R>],
        at: &[V4<R>],
        f: &mut [V4<R>],
        scratch: &mut [CellForces<R>],
    ) -> Result<()>;
    /// `[node]` velocities that a consistent mass sees, m/s; nothing where there is no room for them.
    fn mean_velocities(&self, _params: &Params<R>, _free: &[V4<R>], _v: &[V4<R>], _mean_v: &mut [V4<R>]) {}
    /// Diagonal and sub-diagonal 3×3 blocks of `A` along columns, `[node × 4]` packed, N/m.
    fn blocks(&self, params: &Params<R>, free: &[V4<R>], out: &mut [V4<R>]);
    /// Prepares the preconditioner for the step; `block` has the columns' factors afterwards.
    fn refresh(&mut self, params: &Params<R>, free: &[V4<R>], block: &mut [V4<R>]);
    /// Prepares what stands for `A⁻¹` right before a solve.
    ///
    /// # Errors
    /// [`super::Refused::NotPositive`] of a matrix that has no factor.
    fn factor(&mut self, _free: &[V4<R>]) -> Result<()> {
        Ok(())
    }
    /// `w = A z`; returns `z·w`.
    fn product(
        &self,
        params: &Params<R>,
        free: &[V4<R>],
        z: &[V4<R>],
        w: &mut [V4<R>],
        scratch: &mut [CellForces<R>],
    ) -> R;
    /// What stands for `A⁻¹`.
    fn preconditioner<'a>(
        &'a self,
        params: &'a Params<R>,
        free: &'a [V4<R>],
        block: &'a [V4<R>],
    ) -> Preconditioner<'a, R>;
    /// Vectors for one right-hand side.
    fn workspace(&self, params: &Params<R>) -> Workspace<R>;
    /// Displacements of the points that segments end at, m.
    fn points(&self, params: &Params<R>, u: &[V4<R>], points: &mut [V4<R>]);
    /// Takes over what a cut has changed.
    fn take(&mut self, params: &Params<R>, removal: &Removal);
    /// Nodes in use, of those that the parameters have room for.
    fn nodes_in_use(&self, params: &Params<R>) -> usize;
    /// `[element]` rotations; empty where none are kept.
    fn rotations(&self) -> Vec<V4<f64>>;
    /// Sets them.
    fn set_rotations(&mut self, rotation: &[V4<f64>]);
    /// `[spring]` law; empty where there are no springs.
    fn law(&self) -> Vec<V4<f64>>;
    /// Table of split nodes; empty where none can be split.
    fn split(&self) -> &[u32];
    /// Bytes of matrices of elements that change.
    fn tangent_bytes(&self) -> usize {
        0
    }
    /// How its steps are solved.
    fn solution(&self) -> Solution {
        Solution::Linear
    }
    /// Takes the tangents of elements at displacements, m.
    fn linearise(&mut self, _at: &[V4<f64>]) {}
    /// Share of the small-strain matrix that is added to tangents that are not positive.
    fn set_shift(&mut self, _shift: f64) {}
    /// Potential and residual at an increment `dx` from `u`, for the step's right-hand side `b` and forces `f` at its start; none where a
    /// cell is inside out.
    ///
    /// # Errors
    /// As [`System::forces`].
    fn trial(&self, _step: &Start<R>, _dx: &[V4<R>], _scratch: &mut [CellForces<R>]) -> Result<Option<Trial<R>>> {
        Ok(None)
    }
}

/// A step's start, as a trial point is measured from it.
pub struct Start<'a, R> {
    /// Sizes and factors.
    pub params: &'a Params<R>,
    /// `[node]` free axes and masses as `A` has them.
    pub free: &'a [V4<R>],
    /// `[node]` displacement, m
    pub u: &'a [V4<R>],
    /// `[node]` elastic force, N
    pub f: &'a [V4<R>],
    /// `[node]` right-hand side, N
    pub b: &'a [V4<R>],
}
