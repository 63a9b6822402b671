//! A backend holds the state of the deformable body and runs kernels on it: [`CpuBackend`] in f32 or f64, [`GpuBackend`] in f32.
//!
//! One step, as `step` drives it: [`Backend::begin`] (rotations, forces, right-hand side, preconditioner), then [`Backend::solve`]
//! for the free motion, for compliance columns and for the correction, their right-hand sides set by [`Backend::set_rows`], then
//! [`Backend::finish`]. Arrays over right-hand sides are `[slot][node]`: slot [`FREE`] is the free motion, [`CORRECTION`] the contact
//! correction, columns from [`FIRST_COLUMN`] on. Solutions stay in their slot and are the next solve's start.

mod cpu;
mod gpu;
mod newton;

pub use crate::bodies::Snapshot;
pub use cpu::CpuBackend;
pub use gpu::GpuBackend;

use crate::bodies::Removal;
use crate::error::Result;
use crate::gpu::Gpu;
use crate::kernels::cut::Hit;
use crate::linear::Outcome;
use crate::math::V4;

/// Slot of the free motion.
pub const FREE: usize = 0;
/// Slot of the contact correction.
pub const CORRECTION: usize = 1;
/// First slot of the contact columns.
pub const FIRST_COLUMN: usize = 2;

/// What a cut without the segments' places before the step would be.
const NOT_KEPT: &str = "a cut follows a step that has kept where the segments were";

/// Which arrays a scene needs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Needs {
    /// There are tools: a correction slot, and bounds of the skin's tiles.
    pub contact: bool,
    /// Compliance columns that are solved at once; 0 with uncoupled correction.
    pub columns: usize,
    /// Nodes near the tools whose values are picked from each column, at most.
    pub near: usize,
    /// Segments can be cut.
    pub cutting: bool,
    /// 3×3 blocks of `A` are read by the host (uncoupled correction).
    pub node_blocks: bool,
}

impl Needs {
    /// Right-hand sides that are kept.
    pub fn slots(&self) -> usize {
        if self.contact { FIRST_COLUMN + self.columns } else { 1 }
    }
}

/// What a slot is solved to.
#[derive(Clone, Copy, Debug)]
pub enum Target {
    /// Relative to the step's load.
    OfLoad(f64),
    /// Residual norm, N.
    Absolute(f64),
    /// The same, or as near to it as so many iterations come.
    Loose(f64, u32),
}

impl Target {
    /// Iterations at most, of those that the solver may take.
    pub fn iterations(self, most: u32) -> u32 {
        if let Self::Loose(_, own) = self { own.min(most) } else { most }
    }
}

/// A vector of a slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Vector {
    /// N
    RightHandSide,
    /// m
    Solution,
}

/// One slot of a solve.
#[derive(Clone, Copy, Debug)]
pub struct Wanted {
    /// Slot number.
    pub slot: usize,
    /// When to stop.
    pub target: Target,
}

/// Work on a law that is not linear, of one step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Nonlinear {
    /// Newton iterations; 0 where the step is one linearisation.
    pub iterations: u32,
    /// Tangents that were not positive and had to be raised.
    pub indefinite: u32,
}

/// The device's name for reports.
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
    /// Runs on the CPU in the end.
    pub software: bool,
    /// How the conjugate gradients sum: `compensated`, or `plain` where the device loses what compensates.
    pub sums: &'static str,
    /// Bytes on the device.
    pub device_bytes: u64,
}

/// Runs the kernels. Methods that read back wait for the device; the others may return before it is done.
pub trait Backend: Send {
    /// What it runs on.
    fn device(&self) -> Device;
    /// Sets the dead loads, `[node]` N.
    fn set_load(&mut self, load: &[[f64; 3]]);
    /// Rotations, elastic forces, right-hand side of the free motion, preconditioner.
    ///
    /// # Errors
    /// When the device fails, as every method here.
    fn begin(&mut self) -> Result<()>;
    /// Sets the right-hand sides of columns: (slot, node, N) entries; slots named in `slots` are zeroed first, no entry occurs twice.
    fn set_rows(&mut self, slots: &[usize], entries: &[(usize, u32, [f64; 3])]) -> Result<()>;
    /// Sets a slot's right-hand side, `[node]` N, or its solution and next start, `[node]` m.
    fn set_vector(&mut self, which: Vector, slot: usize, values: &[V4<f64>]) -> Result<()>;
    /// Starts columns from zero instead of from what their slot last held.
    fn forget(&mut self, slots: &[usize]) -> Result<()>;
    /// Solves slots together and picks values of `x` at (slot, node).
    fn solve(&mut self, wanted: &[Wanted], pick: &[(usize, u32)]) -> Result<(Vec<Outcome>, Vec<[f64; 3]>)>;
    /// Writes the correction itself at some nodes (uncoupled correction), zero elsewhere, m.
    fn set_correction(&mut self, nodes: &[(u32, [f64; 3])]) -> Result<()>;
    /// Diagonal 3×3 blocks of `A` at nodes, by rows, N/m.
    fn node_blocks(&mut self, nodes: &[u32]) -> Result<Vec<[[f64; 3]; 3]>>;
    /// Ends the step; `corrected` says that the correction slot counts, `cuts` that [`Backend::cut`] may follow: where the segments are
    /// before the step is kept only then.
    fn finish(&mut self, corrected: bool, cuts: bool) -> Result<()>;
    /// What a law that is not linear took since the last [`Backend::begin`].
    fn nonlinear(&self) -> Nonlinear {
        Nonlinear::default()
    }
    /// Displacements at nodes, m.
    fn displacements(&mut self, nodes: &[u32]) -> Result<Vec<[f64; 3]>>;
    /// Least and greatest displacement of each tile ([`crate::kernels::bounds`]), m; the fourth component of the first is the number of
    /// its nodes that are nowhere. Empty where there are no tools.
    fn bounds(&mut self) -> Result<Vec<[V4<f64>; 2]>>;
    /// Elastic forces at nodes as of the last [`Backend::begin`], N.
    fn elastic_forces(&mut self, nodes: &[u32]) -> Result<Vec<[f64; 3]>>;
    /// Segments crossed by swept quads in the step just finished, in their order, each once; quads as four corners each, m. That step
    /// must have kept where they were before it ([`Backend::finish`]).
    fn cut(&mut self, quads: &[[f64; 3]]) -> Result<Vec<Hit<f64>>>;
    /// Puts the body where a step may start: `[node]` displacement, m, and velocity, m/s, and `[cell]` rotation, none of springs.
    fn set_state(&mut self, u: &[V4<f64>], v: &[V4<f64>], rotation: &[V4<f64>]) -> Result<()>;
    /// Takes over what a cut has changed.
    fn remove(&mut self, removal: &Removal) -> Result<()>;
    /// All state.
    fn snapshot(&mut self) -> Result<Snapshot>;
    /// The GPU that it runs on; none of the CPU path.
    fn gpu(&self) -> Option<&Gpu> {
        None
    }
    /// Hands over what is recorded and not yet submitted.
    fn flush(&mut self) {}
    /// Solution of a slot, `[node]` m.
    fn solution(&mut self, slot: usize) -> Result<Vec<V4<f64>>>;
}
