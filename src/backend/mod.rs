//! A backend stores the state of one deformable body and runs kernels on it: [`CpuBackend`] in f32 or f64, [`GpuBackend`] in f32.
//!
//! One step, as driven by `step`: [`Backend::begin`] (rotations, forces, right-hand side, preconditioner); [`Backend::solve`] for the
//! unconstrained motion, for compliance columns and for the contact correction, whose right-hand sides [`Backend::set_rows`] sets; then
//! [`Backend::finish`]. Arrays over right-hand sides are `[rhs][node]`, where `rhs` is the index of one: [`FREE`] is the
//! unconstrained motion, [`CORRECTION`] the contact correction, compliance columns start at [`FIRST_COLUMN`]. A solution stays there
//! and is the initial guess of the next solve.

mod conserve;
mod cpu;
mod gpu;
mod newton;

pub use crate::bodies::Snapshot;
pub use cpu::CpuBackend;
pub use gpu::GpuBackend;

use crate::bodies::{Model, Removal};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::kernels::cut::Hit;
use crate::linear::Outcome;
use crate::math::V4;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Right-hand side index of the unconstrained motion.
pub const FREE: usize = 0;
/// Right-hand side index of the contact correction.
pub const CORRECTION: usize = 1;
/// Right-hand side index of the first compliance column.
pub const FIRST_COLUMN: usize = 2;

/// Assertion message: swept quads need the segment positions that `finish(.., cuts = true)` saves.
const NOT_KEPT: &str = "a cut follows a step that has kept where the segments were";

/// A [`CpuBackend`] in f32 (`single`) or f64. Code elsewhere that names its type is compiled with all of its kernels once more.
pub fn on_cpu(
    single: bool,
    model: &Model,
    needs: Needs,
    max_iterations: u32,
    floor: f64,
    start: &Snapshot,
) -> Box<dyn Backend> {
    match single {
        true => Box::new(CpuBackend::<f32>::new(model, needs, max_iterations, floor, start)),
        false => Box::new(CpuBackend::<f64>::new(model, needs, max_iterations, floor, start)),
    }
}

/// Arrays that a scene needs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Needs {
    /// There are tools: allocate the correction and the bounding boxes of the skin's tiles.
    pub contact: bool,
    /// Compliance columns solved at once; 0 for uncoupled correction.
    pub columns: usize,
    /// Maximum number of nodes near the tools whose values are read from each column.
    pub near: usize,
    /// Segments can be cut.
    pub cutting: bool,
    /// Elements may break by themselves.
    pub breaking: bool,
    /// The host reads 3×3 blocks of `A` (uncoupled correction).
    pub node_blocks: bool,
    /// Steps are solved with the defect of their linearisation.
    pub in_full: bool,
}

impl Needs {
    /// Number of stored right-hand sides.
    pub fn right_hand_sides(&self) -> usize {
        if self.contact { FIRST_COLUMN + self.columns } else { 1 }
    }
}

/// Stopping criterion of a solve.
#[derive(Clone, Copy, Debug)]
pub enum Target {
    /// Residual norm relative to the step's load.
    OfLoad(f64),
    /// Residual norm, N.
    Absolute(f64),
    /// Residual norm, N, with a limit on the iterations.
    Loose(f64, u32),
}

impl Target {
    /// Maximum number of iterations, given the solver's own limit.
    pub fn iterations(self, most: u32) -> u32 {
        if let Self::Loose(_, own) = self { own.min(most) } else { most }
    }
}

/// Vector of a right-hand side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Vector {
    /// N
    RightHandSide,
    /// m
    Solution,
}

/// Solve request for one right-hand side.
#[derive(Clone, Copy, Debug)]
pub struct SolveRequest {
    /// Right-hand side index.
    pub rhs: usize,
    /// Stopping criterion.
    pub target: Target,
}

/// Values of the present state that the host reads at once.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Query {
    /// Nodes whose displacements are read.
    pub displacements: Vec<u32>,
    /// Nodes whose velocities are read.
    pub velocities: Vec<u32>,
    /// Nodes whose elastic forces of the last [`Backend::begin`] are read.
    pub elastic_forces: Vec<u32>,
    /// The bounds of the tiles are read.
    pub bounds: bool,
    /// Quads swept in the step just finished, four corners each, m. The step must have saved the segment positions ([`Backend::finish`]).
    pub quads: Vec<[f64; 3]>,
}

/// Answer to a [`Query`].
#[derive(Clone, Debug, Default)]
pub struct Values {
    /// `[asked]` m
    pub displacements: Vec<[f64; 3]>,
    /// `[asked]` m/s
    pub velocities: Vec<[f64; 3]>,
    /// `[asked]` N
    pub elastic_forces: Vec<[f64; 3]>,
    /// Minimum and maximum displacement of each tile ([`crate::kernels::bounds`]), m; the fourth component of the minimum counts non-finite
    /// nodes. Empty without tools.
    pub bounds: Vec<[V4<f64>; 2]>,
    /// Segments that the quads crossed, each once, in ascending order.
    pub hits: Vec<Hit<f64>>,
}

/// Solver statistics of a nonlinear law for one step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Nonlinear {
    /// Newton iterations; 0 if the step is linearised once.
    pub iterations: u32,
    /// Number of indefinite tangents that had to be shifted.
    pub indefinite: u32,
    /// `τ` of [`crate::bodies::Step::elastic_at`], where a midpoint step has needed another one.
    pub elastic_at: Option<f64>,
}

/// Description of the device for reports.
#[derive(Clone, Debug, Default)]
pub struct Device {
    /// `cpu` or `gpu`.
    pub backend: &'static str,
    /// `f32` or `f64`.
    pub precision: &'static str,
    /// Adapter, or the CPU's threads.
    pub adapter: String,
    /// Driver and version; empty on the CPU.
    pub driver: String,
    /// True for a software adapter, which runs on the CPU.
    pub software: bool,
    /// Summation in the conjugate gradients: `compensated`, or `plain` where the device's arithmetic defeats compensation.
    pub sums: &'static str,
    /// Size of the arrays on the device, bytes.
    pub device_bytes: u64,
}

/// Runs the kernels for one body. Methods that read back wait for the device; the others may return earlier.
pub trait Backend: Send {
    /// Description of the device.
    fn device(&self) -> Device;
    /// Has a flag, once set, end every solve at its present iterations with [`Error::Interrupted`](crate::error::Error::Interrupted).
    fn interrupt_by(&mut self, flag: Arc<AtomicBool>);
    /// Sets the loads, `[node]` N.
    fn set_load(&mut self, load: &[[f64; 3]]);
    /// Prescribes displacements of nodes at the end of the step along their fixed axes, m; after [`Backend::begin`], each node once.
    fn prescribe(&mut self, nodes: &[u32], target: &[[f64; 3]]) -> Result<()>;
    /// Starts a step: rotations, elastic forces, right-hand side of the unconstrained motion, preconditioner.
    ///
    /// # Errors
    /// Here and in every method: if the device fails.
    fn begin(&mut self) -> Result<()>;
    /// Adds forces at nodes, N, to the right-hand side of the unconstrained motion; after [`Backend::begin`], each node once.
    fn add_forces(&mut self, entries: &[(u32, [f64; 3])]) -> Result<()>;
    /// Sets the right-hand side of the unconstrained motion anew, with the defect of the step's linearisation at the increment by its solves so
    /// far ([`crate::kernels::defect`]) and without added forces. That increment, of which the contact correction is part if `corrected`, is the
    /// initial guess.
    fn add_defect(&mut self, corrected: bool) -> Result<()>;
    /// Sets right-hand sides of compliance columns from (rhs, node, N) entries; zeroes `rhs_ids` first. No entry may occur twice.
    fn set_rows(&mut self, rhs_ids: &[usize], entries: &[(usize, u32, [f64; 3])]) -> Result<()>;
    /// Sets a right-hand side, `[node]` N, or a solution, which is also the next initial guess, `[node]` m.
    fn set_vector(&mut self, which: Vector, rhs: usize, values: &[V4<f64>]) -> Result<()>;
    /// Resets the initial guesses of these right-hand sides to zero.
    fn reset_initial_guess(&mut self, rhs_ids: &[usize]) -> Result<()>;
    /// Adds displacements at nodes, m, each once, to the initial guess of a right-hand side. That of a body with a nonlinear law is what
    /// the step's motion begins with there; elsewhere it begins at rest.
    fn advance_guess(&mut self, rhs: usize, entries: &[(u32, [f64; 3])]) -> Result<()>;
    /// Solves several right-hand sides together and returns values of `x` at (right-hand side, node).
    fn solve(&mut self, requests: &[SolveRequest], pick: &[(usize, u32)]) -> Result<(Vec<Outcome>, Vec<[f64; 3]>)>;
    /// Sets the correction directly at some nodes and to zero elsewhere, m (uncoupled correction).
    fn set_correction(&mut self, nodes: &[(u32, [f64; 3])]) -> Result<()>;
    /// Diagonal 3×3 blocks of `A` at nodes, by rows, N/m.
    fn node_blocks(&mut self, nodes: &[u32]) -> Result<Vec<[[f64; 3]; 3]>>;
    /// Ends the step. `corrected` adds the contact correction, and the sum is the next initial guess of [`FREE`]; `cuts` saves the segment
    /// positions before the step, as swept quads need them.
    fn finish(&mut self, corrected: bool, cuts: bool) -> Result<()>;
    /// Statistics of a nonlinear law since the last [`Backend::begin`].
    fn nonlinear(&self) -> Nonlinear {
        Nonlinear::default()
    }
    /// Reads values of the state, all together.
    fn read(&mut self, query: &Query) -> Result<Values>;
    /// Sets the state at the start of a step: `[node]` displacement, m, and velocity, m/s, and `[cell]` rotation (empty for springs).
    fn set_state(&mut self, u: &[V4<f64>], v: &[V4<f64>], rotation: &[V4<f64>]) -> Result<()>;
    /// Applies the changes of a cut.
    fn remove(&mut self, removal: &Removal) -> Result<()>;
    /// Reads the complete state.
    fn snapshot(&mut self) -> Result<Snapshot>;
    /// Displacements of all nodes, `[node]` m.
    fn displacements(&mut self) -> Result<Vec<V4<f64>>>;
    /// GPU of this backend; `None` on the CPU path.
    fn gpu(&self) -> Option<&Gpu> {
        None
    }
    /// Submits recorded commands.
    fn flush(&mut self) {}
    /// Solution of a right-hand side, `[node]` m.
    fn solution(&mut self, rhs: usize) -> Result<Vec<V4<f64>>>;
}
