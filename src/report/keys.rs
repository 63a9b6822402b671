//! Keys of `report.json`, in output order.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Report of a run, as in `report.json`. A number that was not measured is `null`.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Report {
    /// Scene file.
    pub scene: String,
    /// `cpu` or `gpu`.
    pub backend: String,
    /// Adapter; on the CPU path the number of threads and the precision.
    pub adapter: String,
    /// Driver and version; empty on the CPU path.
    pub driver: String,
    /// Nodes of the uncut bodies.
    pub nodes: usize,
    /// Hexahedra of the uncut bodies; 0 for springs and tetrahedra.
    pub hexes: usize,
    /// Tetrahedra of the uncut bodies.
    pub tets: usize,
    /// Springs of the uncut bodies.
    #[serde(rename = "springs")]
    pub spring_count: usize,
    /// Unconstrained degrees of freedom.
    pub dof: usize,
    /// s
    pub step_s: f64,
    /// Completed steps.
    pub steps: u32,
    /// Error that ended the run early; empty without one.
    pub error: String,
    /// Wall time of the whole run with its files and pictures, s.
    pub wall_s: f64,
    /// Time of a step, ms. Steps whose residual was checked in f64 are excluded, unless all were.
    pub step_ms: Spread,
    /// What a step costs, by part.
    pub costs: CostReport,
    /// Solver of the unconstrained motion.
    pub solver: SolverReport,
    /// Largest number of contacts in a step.
    pub contacts_max: usize,
    /// Energy of the bodies, work and dissipation.
    pub energy_j: EnergyReport,
    /// Largest number of inverted cells at once: at the start, before a step that was checked in f64, or at the end; `null` without a
    /// deformable body.
    pub inverted_cells_max: Option<u32>,
    /// Largest force on a tool at the end of a step, N.
    pub contact_force_n_max: f64,
    /// Contact solver.
    pub contact: Passes,
    /// Haptic loop.
    pub haptic: HapticReport,
    /// Cut.
    pub cut: CutReport,
    /// Warnings by name, counted over the steps; without those that did not occur.
    pub warnings: BTreeMap<String, u64>,
    /// Memory of the arrays.
    pub memory_bytes: Memory,
    /// Last value of each probe, SI.
    pub probes: BTreeMap<String, f64>,
}

/// Median, 99th percentile and maximum.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Spread {
    /// Half of the values are at most this.
    pub median: Option<f64>,
    /// 99 of 100 values are at most this.
    pub p99: Option<f64>,
    /// Maximum.
    pub max: Option<f64>,
}

/// Work and time of the steps ([`crate::step::Costs`]). On a GPU, waiting for the device belongs to the part that waits.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct CostReport {
    /// Compliance columns solved.
    pub columns: Share,
    /// Passes of the contact solve.
    pub passes: Share,
    /// Iterations of all solves, V-cycles with the multigrid preconditioner; a batch of columns counts once.
    pub iterations: Share,
    /// Row updates of the contact laws' solves.
    pub row_updates: Share,
    /// Links and springs tested against swept edges.
    pub cut_tests: Share,
    /// Search for contacts, ms.
    pub search_ms: Share,
    /// Unconstrained motion, ms.
    pub free_ms: Share,
    /// Compliance columns, ms.
    pub columns_ms: Share,
    /// Corrections by contact forces, ms.
    pub corrections_ms: Share,
    /// Contact laws, ms.
    pub laws_ms: Share,
    /// Reduced contact problems for the haptic loop, ms.
    pub hand_over_ms: Share,
    /// Cutting, ms.
    pub cut_ms: Share,
    /// The remainder: loads, acceptance of the step, probes, checks in f64, ms.
    pub other_ms: Share,
}

/// Mean, 99th percentile and maximum over the steps.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Share {
    /// Mean.
    pub mean: f64,
    /// 99 of 100 steps have at most this.
    pub p99: f64,
    /// Maximum.
    pub max: f64,
}

/// Solver of the unconstrained motion.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct SolverReport {
    /// `cg`, `pcg`, or `none` for explicit steps.
    pub kind: String,
    /// Name as in scene files.
    pub preconditioner: String,
    /// Per step.
    pub iterations_mean: f64,
    /// In one step.
    pub iterations_max: u32,
    /// Largest number of Newton iterations in a step, or of its repetitions with contact; 0 if the law is linear in a step.
    pub newton_iterations_max: u32,
    /// `compensated` or `plain`.
    pub sums: String,
    /// Rounds of iterative refinement, over all steps.
    pub refinements: u64,
    /// Steps with a load so small that `floor_n` was the stopping criterion.
    pub at_floor: u64,
    /// Largest relative residual of the other steps, by the recurrence; with refinement in f64.
    pub residual_max: f64,
    /// Largest relative residual of the steps that were checked in f64.
    pub residual_true: Option<f64>,
    /// Largest share of a step's load that its linearisation of a hyperelastic or corotational law left, over the steps that were checked in f64. Near 1 skin
    /// creeps where it should spring: take shorter steps, `newton = true`, or a smaller ratio of Poisson.
    pub law_residual: Option<f64>,
}

/// Energy of the deformable and the free rigid bodies, J ([`crate::bodies::energy`]); `null` without one. `start` is before the first step,
/// `max` the maximum over the start, all steps checked in f64 (before the step), and the end, `end` after the last step. Between start and end
/// `end − start = work_in − dissipated`, each summed over its keys. `energy.csv` has the same over time.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct EnergyReport {
    /// Kinetic, elastic and potential energy before the first step.
    pub start: Option<f64>,
    /// Its maximum.
    pub max: Option<f64>,
    /// After the last step.
    pub end: Option<f64>,
    /// Kinetic energy.
    pub kinetic: Extremes,
    /// Elastic energy of elements and rest-shape springs.
    pub elastic: Extremes,
    /// Potential of gravity and of the dead loads that act: 0 in the rest shape, of a rigid body at the origin.
    pub potential: Extremes,
    /// Work done on the bodies ([`crate::step::Booked`]).
    pub work_in: WorkReport,
    /// Energy that they lost.
    pub dissipated: DissipationReport,
}

/// A kind of energy at the start, at its maximum and at the end, J.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Extremes {
    /// Before the first step.
    pub start: Option<f64>,
    /// Maximum over the checked steps.
    pub max: Option<f64>,
    /// After the last step.
    pub end: Option<f64>,
}

/// Work done on the bodies until the end, J.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct WorkReport {
    /// By loads that begin, change or end: what a constant load does in between is potential.
    pub loads: Option<f64>,
    /// By hands, through the contacts of their tools.
    pub hands: Option<f64>,
    /// By contacts that part what overlaps at the start of a step.
    pub overlaps: Option<f64>,
}

/// Energy that the bodies lost until the end, J.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct DissipationReport {
    /// By friction.
    pub friction: Option<f64>,
    /// By cutting: forces of blades on the tissue that they open.
    pub cutting: Option<f64>,
    /// By contacts that close a gap.
    pub impact: Option<f64>,
    /// By Rayleigh damping and the dampers of springs; `null` where not every step was checked (`true_residual_every`).
    pub damping: Option<f64>,
    /// The remainder: by the integrator, by removed cells, and by damping where that is not known. Negative where a run has made energy;
    /// `null` where boundaries on paths, follower pressures or tools in static steps have done work, which is not booked.
    pub numerical: Option<f64>,
}

/// Contact statistics: detection, and correction passes per step with contact.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Passes {
    /// Mean over the steps with contact.
    pub passes_mean: f64,
    /// In one step.
    pub passes_max: u32,
    /// Largest change of a force by one more projection at the end of a step, N.
    pub residual_n_max: f64,
    /// Largest violation of complementarity at the end of a step: penetration, and slip of sticking contacts, m.
    pub residual_m_max: f64,
    /// Largest number of faces passed from broad to narrow phase in a step, over all tools.
    pub candidates_max: usize,
    /// Largest amount by which a gap was below its resting gap at the start of a step, mm: the overlap of tool and skin.
    pub depth_mm_max: f64,
}

/// Haptic loop. With the scene's clock nothing is late, and quantities that need the wall clock are `null`. For several devices: maxima of
/// magnitudes and of energies out, sums of counts.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct HapticReport {
    /// Ticks per second.
    pub rate_hz: f64,
    /// Time between ticks, µs.
    pub period_us: Periods,
    /// Duration of a tick, µs.
    pub tick_us: Periods,
    /// Age of the contact problem at a tick, since the hand pose of its step was sampled, ms.
    pub coupling_age_ms: Periods,
    /// Missed deadlines.
    pub missed: Option<u64>,
    /// Ticks missing in `haptic.csv`, because its writer was too slow.
    pub records_lost: Option<u64>,
    /// Faults of the devices: unusable messages, lost connections.
    pub device_faults: Option<u64>,
    /// Steps that began more than a tick late.
    pub late_steps: Option<u64>,
    /// Time by which the scene fell behind the wall clock because of them, and until the haptic threads had started, ms.
    pub behind_ms: Option<f64>,
    /// Steps that ended because they were due, with contact forces off by more than can be felt.
    pub shortened_steps: Option<u64>,
    /// Largest change of a force by one more projection at the end of one, N.
    pub shortened_n_max: Option<f64>,
    /// Largest penetration, or slip of sticking contacts, at the end of one, mm.
    pub shortened_mm_max: Option<f64>,
    /// Share of the ticks whose contact problem was older than two steps: than it gets when no step takes longer than its time.
    pub old_share: f64,
    /// Largest number of Gauss–Seidel sweeps in a tick.
    pub sweeps_max: u32,
    /// Ticks whose time budget for sweeps was used up.
    pub out_of_time: u64,
    /// Invalid readings, or readings beyond the workspace; the last pose was kept.
    pub unsound: u64,
    /// Ticks with a non-finite force; none was applied.
    pub non_finite: u64,
    /// Ticks with a contact problem so old that the force fades.
    pub late_ticks: u64,
    /// Ticks with a contact problem from before a cut.
    pub stale_ticks: u64,
    /// Ticks whose force or torque exceeded the limits of the device, the scene or the coupling.
    pub clamped: u64,
    /// Times the force faded because the simulation was late.
    pub fades: u64,
    /// Times the force stopped because a device was lost.
    pub stops: u64,
    /// Largest force on the hand, N.
    pub force_n_max: f64,
    /// Largest change of that force from one tick to the next, N.
    pub force_jump_n_max: f64,
    /// The same at the first tick after a cut, N.
    pub cut_jump_n: f64,
    /// Maximum over time of the energy given to the hand minus the energy received, J. A passive device never gives any.
    pub energy_out_j: f64,
    /// The same for the same motion without the passivity controller, J.
    pub energy_uncontrolled_j: f64,
    /// Energy removed by the controller, J.
    pub energy_damped_j: f64,
}

/// Order statistics of a time.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Periods {
    /// Median.
    pub p50: Option<f64>,
    /// 99th percentile.
    pub p99: Option<f64>,
    /// 999 of 1000 values are at most this.
    pub p99_9: Option<f64>,
    /// Maximum.
    pub max: Option<f64>,
}

/// Cut. Lengths and areas refer to the unloaded skin. Links that stay intact because `cut_reserve_columns` are used up count in
/// `warnings.cut_reserve_exhausted`.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct CutReport {
    /// Removed hexahedra.
    pub hexes_removed: usize,
    /// Volume at rest of the removed hexahedra and tetrahedra, and of what was carved out of others.
    pub removed_mm3: f64,
    /// Removed tetrahedra, with those that springs hold together no more.
    pub tets_removed: usize,
    /// Removed springs.
    pub springs_removed: usize,
    /// Severed links between hexahedra, or tetrahedra.
    pub links_severed: usize,
    /// Crossings of links that stay intact because they alone hold a piece of fewer than 8 cells or tetrahedra.
    pub links_held: usize,
    /// Duplicated nodes.
    pub node_copies: usize,
    /// Connected pieces of the bodies of hexahedra and of meshes of tetrahedra at the end of the run.
    pub pieces: Option<usize>,
    /// Edges of their surface shared by more than two faces at the end of the run.
    pub nonmanifold_edges: Option<usize>,
    /// Area of one side of the cut.
    pub area_mm2: f64,
    /// Extent along x or y, whichever is longer.
    pub length_mm: f64,
    /// The same of the wound at the top.
    pub length_top_mm: f64,
    /// Depth below the top.
    pub depth_mm: f64,
    /// Widest opening of the lips near the tool during the run, beyond the width of removed hexahedra.
    pub opening_mm_max: f64,
    /// Deepest overlap of the lips during the run.
    pub overlap_mm_max: f64,
}

/// Memory of arrays, bytes.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Memory {
    /// On the GPU; 0 on the CPU path.
    pub device: u64,
    /// Constant arrays, and on the CPU path the state.
    pub host: u64,
}
