//! The keys of `report.json`, in the order in which they are written.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What a run did, as `report.json` has it. A number that was not measured is `null`.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Report {
    /// Scene file.
    pub scene: String,
    /// `cpu` or `gpu`.
    pub backend: String,
    /// Adapter; on the CPU path the threads and the precision.
    pub adapter: String,
    /// Driver and version; empty on the CPU path.
    pub driver: String,
    /// Nodes of the body.
    pub nodes: usize,
    /// Bricks of the uncut body; 0 for a body of springs.
    pub hexes: usize,
    /// Tetrahedra.
    pub tets: usize,
    /// Springs of the uncut body.
    #[serde(rename = "springs")]
    pub spring_count: usize,
    /// Degrees of freedom: axes of nodes that nothing holds.
    pub dof: usize,
    /// s
    pub step_s: f64,
    /// Steps done.
    pub steps: u32,
    /// What ended the run before its last step; empty when nothing did.
    pub error: String,
    /// Whole run with its files and pictures, s.
    pub wall_s: f64,
    /// Time of a step, ms. Steps whose residual was checked in f64 are left out, unless all were.
    pub step_ms: Spread,
    /// Free motion.
    pub solver: SolverReport,
    /// Most contacts in a step.
    pub contacts_max: usize,
    /// Energy of the deformable bodies.
    pub energy_j: EnergyReport,
    /// Most cells inside out at once, at the start, before a step that was checked in f64, or at the end; none without a deformable body.
    pub inverted_cells_max: Option<u32>,
    /// Largest force on a tool at the end of a step, N.
    pub contact_force_n_max: f64,
    /// How the contact forces were found.
    pub contact: Passes,
    /// The 1 kHz side.
    pub haptic: HapticReport,
    /// The cut.
    pub cut: CutReport,
    /// Trouble by name, counted over the steps; what did not occur has no key.
    pub warnings: BTreeMap<String, u64>,
    /// Arrays of the body.
    pub memory_bytes: Memory,
    /// Last value of each probe, SI.
    pub probes: BTreeMap<String, f64>,
}

/// Median, 99th percentile and largest.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Spread {
    /// Half of the values are not larger.
    pub median: Option<f64>,
    /// 99 of 100 are not larger.
    pub p99: Option<f64>,
    /// The largest.
    pub max: Option<f64>,
}

/// The solver of the free motion.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct SolverReport {
    /// `cg`, `pcg`, or `none` of explicit steps.
    pub kind: String,
    /// The scene's word for it.
    pub preconditioner: String,
    /// Per step.
    pub iterations_mean: f64,
    /// In one step.
    pub iterations_max: u32,
    /// Newton iterations in one step; 0 where the law is linear in a step.
    pub newton_iterations_max: u32,
    /// `compensated` or `plain`.
    pub sums: String,
    /// Rounds of iterative refinement, over all steps.
    pub refinements: u64,
    /// Steps whose load is so small that `floor_n` decided when to stop.
    pub at_floor: u64,
    /// Largest relative residual at the end of the other steps, as the recurrence has it; with refinement in f64.
    pub residual_max: f64,
    /// Largest relative residual of the steps that were checked in f64.
    pub residual_true: Option<f64>,
}

/// Kinetic and elastic energy, and what gravity and dead loads have to give ([`crate::bodies::energy`]), of all deformable bodies, J; `null`
/// without one.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct EnergyReport {
    /// Before the first step.
    pub start: Option<f64>,
    /// The largest at the start, before a step that was checked in f64, or at the end.
    pub max: Option<f64>,
    /// After the last step.
    pub end: Option<f64>,
}

/// Contacts in detail: what was looked at, and the corrections per step with contact.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Passes {
    /// Mean over the steps with contact.
    pub passes_mean: f64,
    /// In one step.
    pub passes_max: u32,
    /// Largest change of a force at the end of a step that one more projection would make, N.
    pub residual_n_max: f64,
    /// Largest violation of complementarity at the end of a step: penetration, and slip of what should stick, m.
    pub residual_m_max: f64,
    /// Most faces of the skin that the broad phase gave to the narrow phase in a step, over all tools.
    pub candidates_max: usize,
    /// Most that a contact's gap was below its resting gap at the start of a step, mm: how deep tool and skin overlapped.
    pub depth_mm_max: f64,
}

/// The haptic side. Under the scene's clock nothing is late, and what only a clock can show is `null`. Of several devices: the largest of
/// sizes and energies out, sums of counts.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct HapticReport {
    /// Ticks per second.
    pub rate_hz: f64,
    /// Time between ticks, µs.
    pub period_us: Periods,
    /// What a tick took, µs.
    pub tick_us: Periods,
    /// Age of the contact problem at a tick: since the hand was looked at for the step that made it, ms.
    pub coupling_age_ms: Periods,
    /// Deadlines that went by without a tick.
    pub missed: Option<u64>,
    /// Ticks that are not in `haptic.csv`, because who writes it was too slow.
    pub records_lost: Option<u64>,
    /// What went wrong on the way to the devices: messages of no use, connections lost.
    pub device_faults: Option<u64>,
    /// Steps that began after their time.
    pub late_steps: Option<u64>,
    /// Most Gauss–Seidel sweeps of a tick.
    pub sweeps_max: u32,
    /// Ticks whose time for sweeps was used up.
    pub out_of_time: u64,
    /// Readings that were no poses, or of places beyond the workspace; the last pose was kept.
    pub unsound: u64,
    /// Ticks whose force was no number; none was given.
    pub non_finite: u64,
    /// Ticks on a contact problem so old that the force fades.
    pub late_ticks: u64,
    /// Ticks on a contact problem from before a cut.
    pub stale_ticks: u64,
    /// Ticks that asked for more than the device can give, or may.
    pub clamped: u64,
    /// Times that the force faded because the simulation was late.
    pub fades: u64,
    /// Times that the force stopped because a device was lost.
    pub stops: u64,
    /// Largest force on the hand, N.
    pub force_n_max: f64,
    /// Largest change of that force from one tick to the next, N.
    pub force_jump_n_max: f64,
    /// The same at the first tick after a cut has come in, N.
    pub cut_jump_n: f64,
    /// Most energy that the device has given the hand at any time, less what it took before; J. A passive one never gives any.
    pub energy_out_j: f64,
    /// The same along the same motions without the passivity controller, J.
    pub energy_uncontrolled_j: f64,
    /// What the controller took out, J.
    pub energy_damped_j: f64,
}

/// Order statistics of a time.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Periods {
    /// Median.
    pub p50: Option<f64>,
    /// 99th percentile.
    pub p99: Option<f64>,
    /// 999 of 1000 are not longer.
    pub p99_9: Option<f64>,
    /// The longest.
    pub max: Option<f64>,
}

/// What was cut. Lengths and areas are those of the unloaded skin. Links that hold since `cut_reserve_columns` are used up are counted in
/// `warnings.cut_reserve_exhausted`.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct CutReport {
    /// Removed bricks.
    pub hexes_removed: usize,
    /// Removed tetrahedra.
    pub tets_removed: usize,
    /// Removed springs.
    pub springs_removed: usize,
    /// Severed links between bricks.
    pub links_severed: usize,
    /// Node copies in use.
    pub node_copies: usize,
    /// Pieces that the bodies of bricks are in at the end of the run.
    pub pieces: Option<usize>,
    /// Edges of their surface at the end of the run where more than one pair of faces meet.
    pub nonmanifold_edges: Option<usize>,
    /// One side of the cut.
    pub area_mm2: f64,
    /// Extent along x or y, whichever is longer.
    pub length_mm: f64,
    /// The same of what is open at the top.
    pub length_top_mm: f64,
    /// Below the top.
    pub depth_mm: f64,
    /// Widest parting of the lips near the tool during the run, beyond the width of removed bricks.
    pub opening_mm_max: f64,
    /// Deepest overlap of the lips during the run.
    pub overlap_mm_max: f64,
}

/// Bytes of arrays.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Memory {
    /// On the GPU; 0 on the CPU path.
    pub device: u64,
    /// Constant arrays, and on the CPU path the state.
    pub host: u64,
}
