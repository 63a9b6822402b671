//! Interface between a kind of deformable body and the solver on the CPU path.

use super::Removal;
use crate::error::Result;
use crate::kernels::Params;
use crate::kernels::product::CellForces;
use crate::math::{Real, V4};

/// Work vectors for one right-hand side.
#[derive(Clone, Debug, Default)]
pub struct Workspace<R> {
    /// `[cell group]` scratch of the product
    pub scratch: Vec<CellForces<R>>,
    /// Multigrid levels, finest first; empty before the first use.
    pub levels: Vec<LevelWork<Cycle>>,
}

/// Precision of the V-cycle that preconditions the conjugate gradients, whatever theirs is: it changes the iterations, not the solution.
pub type Cycle = f32;

/// Work vectors of one multigrid level; the finest level uses `r` and `z` of the conjugate gradients where they have its precision.
#[derive(Clone, Debug, Default)]
pub struct LevelWork<R> {
    /// `[cell group]` scratch of the product
    pub scratch: Vec<CellForces<R>>,
    /// `[node]` N
    pub r: Vec<V4<R>>,
    /// `[node]` m
    pub z: Vec<V4<R>>,
    /// `[node]` m
    pub d: Vec<V4<R>>,
    /// `[node]` N
    pub w: Vec<V4<R>>,
    /// `[node of a fork]` values before a smoothing step
    pub before: Vec<[V4<R>; 3]>,
}

/// Applies `z = M⁻¹ r` for the conjugate gradients and returns `r·z`; may be called from any number of threads at once.
pub type Preconditioner<'a, R> = Box<dyn Fn(&mut Vec<LevelWork<Cycle>>, &[V4<R>], &mut [V4<R>]) -> R + Sync + 'a>;

/// Trial point of the line search in Newton's method.
#[derive(Clone, Debug)]
pub struct Trial<R> {
    /// Π, J.
    pub potential: f64,
    /// `[node]` −∇Π, N
    pub residual: Vec<V4<R>>,
    /// Work over the increment of the elastic forces and of the residual, and of inertia and damping, J ([`crate::kernels::residual`]).
    pub work: [f64; 2],
}

/// Interface of a body to the solver: forces, product with the system matrix `A`, and preconditioner. `dofs` is `[node]` the DOF mask per
/// axis (1 free, 0 fixed) and the mass as it enters `A`, kg.
pub trait System<R: Real>: Send + Sync {
    /// Elastic forces at displacements `at`, `[node]` N; updates the element rotations at `u`. `at` differs from `u` only in an explicit
    /// step.
    ///
    /// # Errors
    /// [`super::Refused::InvertedCell`] if a hyperelastic hexahedron is inverted.
    fn forces(
        &mut self,
        params: &Params<R>,
        u: &[V4<R>],
        at: &[V4<R>],
        f: &mut [V4<R>],
        scratch: &mut [CellForces<R>],
    ) -> Result<()>;
    /// Elastic forces at displacements, `[node]` N, of a hyperelastic law whose steps are linearised; the linearisation stays as it is. False
    /// of other laws.
    fn forces_of_law(&self, _params: &Params<R>, _at: &[V4<R>], _f: &mut [V4<R>]) -> bool {
        false
    }
    /// `[node]` velocities for a consistent mass, m/s: nodal mass times these is `M v`. Does nothing for other masses.
    fn mean_velocities(&self, _params: &Params<R>, _free: &[V4<R>], _v: &[V4<R>], _mean_v: &mut [V4<R>]) {}
    /// Diagonal and sub-diagonal 3×3 blocks of `A` along z-columns of nodes, `[node × 4]` packed, N/m.
    fn blocks(&self, params: &Params<R>, dofs: &[V4<R>], out: &mut [V4<R>]);
    /// Updates the preconditioner for the step.
    fn refresh(&mut self, params: &Params<R>, dofs: &[V4<R>]);
    /// Factors the direct solver's matrix before a solve; does nothing for other solvers.
    ///
    /// # Errors
    /// [`super::Refused::NotPositive`] if the matrix is not positive definite; [`super::Refused::DirectMemory`] without memory for its
    /// factor.
    fn factor(&mut self, _free: &[V4<R>]) -> Result<()> {
        Ok(())
    }
    /// `w = A z`; returns `z·w`.
    fn product(
        &self,
        params: &Params<R>,
        dofs: &[V4<R>],
        z: &[V4<R>],
        w: &mut [V4<R>],
        scratch: &mut [CellForces<R>],
    ) -> R;
    /// Preconditioner, or the exact inverse of the direct solver.
    fn preconditioner<'a>(&'a self, params: &'a Params<R>, dofs: &'a [V4<R>]) -> Preconditioner<'a, R>;
    /// Work vectors for one right-hand side.
    fn workspace(&self, params: &Params<R>) -> Workspace<R>;
    /// Displacements of the segments' end points, m.
    fn points(&self, params: &Params<R>, u: &[V4<R>], points: &mut [V4<R>]);
    /// Applies the changes of a cut.
    fn take(&mut self, params: &Params<R>, removal: &Removal);
    /// Number of nodes in use, out of those that the parameters reserve.
    fn nodes_in_use(&self, params: &Params<R>) -> usize;
    /// `[element]` rotations; empty where none are stored.
    fn rotations(&self) -> Vec<V4<f64>>;
    /// Sets the rotations.
    fn set_rotations(&mut self, rotation: &[V4<f64>]);
    /// `[spring]` law; empty without springs.
    fn law(&self) -> Vec<V4<f64>>;
    /// Table of split nodes; empty where no node can be split.
    fn split(&self) -> &[u32];
    /// Size of the stored tangents and of the preconditioner, bytes.
    fn stored_bytes(&self) -> usize;
    /// True if its steps are solved by Newton's method.
    fn newton(&self) -> bool {
        false
    }
    /// The first inverted cell of a body solved by Newton's method, at displacements, m.
    fn first_inverted(&self, _at: &[V4<f64>]) -> Option<super::Refused> {
        None
    }
    /// Elastic energy of a body solved by Newton's method, at displacements, J; infinite if a cell is inverted.
    fn energy(&self, _at: &[V4<f64>]) -> f64 {
        0.0
    }
    /// Sets `τ`: a step solved by Newton's method has the elastic forces at `u + τ Δx`.
    fn set_elastic_at(&mut self, _elastic_at: f64) {}
    /// Evaluates the element tangents at displacements, m.
    fn linearise(&mut self, _at: &[V4<f64>]) {}
    /// Sets the multiple of the small-strain matrix that is added when the tangent is not positive definite.
    fn set_shift(&mut self, _shift: f64) {}
    /// Potential and residual for an increment `dx`, for the right-hand side `b` and the forces `f` at the start of the step; `None` if a cell is
    /// inverted.
    ///
    /// # Errors
    /// As [`System::forces`].
    fn trial(&self, _step: &Start<R>, _dx: &[V4<R>], _scratch: &mut [CellForces<R>]) -> Result<Option<Trial<R>>> {
        Ok(None)
    }
}

/// State at the start of a step, from which a trial point is measured.
pub struct Start<'a, R> {
    /// Sizes and factors.
    pub params: &'a Params<R>,
    /// `[node]` DOF mask and mass as in `A`.
    pub dofs: &'a [V4<R>],
    /// `[node]` displacement, m
    pub u: &'a [V4<R>],
    /// `[node]` elastic force, N
    pub f: &'a [V4<R>],
    /// `[node]` right-hand side, N
    pub b: &'a [V4<R>],
}
