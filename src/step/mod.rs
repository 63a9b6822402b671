//! One time step, written once over [`Backend`](crate::backend::Backend):
//!
//! 1. find the contacts at the start of the step (the search margin grows with the motion of the rigid bodies) and add the attachments;
//! 2. provide columns of `A⁻¹` at the nodes that rows act on, loosely solved or borrowed; predict the contact forces λ₀ by them from those of the
//!    last step; solve the motion of every body under λ₀;
//! 3. evaluate the violations `δ` of the moved bodies, solve for the forces λ on `W (λ − λ₀) + δ` ([`crate::constraints`]);
//! 4. correct: solve `A Δx = Jᵀ(λ − λ₀)` accurately, evaluate δ again, repeat until the laws hold;
//! 5. integrate, move the rigid bodies, cut what an edge has swept.
//!
//! With the displacement increments Δx = h·v' as unknowns, implicit Euler with Rayleigh damping is `A Δx = b`,
//! `A = (1 + h r_M)/h² M + (1 + r_K/h) K`, `b = f_ext − f_int + M v/h` ([`crate::kernels::rhs`]; M lumped, uniform or consistent;
//! rest-shape springs, [`crate::bodies::RestSprings`], are part of `f_int` and `K`). External forces and inertia stand in one right-hand side,
//! so nothing is lost to f32. `A` is never assembled, except on the CPU path when a scene asks for its factor
//! ([`crate::bodies::grid::direct`]). Newmark's method, the midpoint rule and symplectic Euler have other factors in the same `A` and `b`
//! ([`crate::bodies::Step`]). A hyperelastic body has its own `f_int` and the linearised `K` of
//! [`crate::kernels::hyperelastic::Cell::linearised`]; where nothing may touch and no pressure follows, Newton's method solves its step
//! with the consistent tangent.
//!
//! Contacts: a bounding-box tree over tiles of each body, refitted to the bounds that the device reports ([`crate::collide::broad`]), gives
//! the few faces whose nodes are read back; sphere, capsule, point, line and box have their own narrow phase. The compliance at the nodes
//! of rows, columns of `A⁻¹` solved loosely, is kept from step to step and renewed in batches as it ages; each pass updates `W`. The laws
//! give the forces on `W λ + δ`, `W = Σ J C Jᵀ` over the bodies. δ is evaluated again after each accurate correction, so λ does not depend
//! on the columns' tolerance. Tissue holds a blade's edge up to its resistance (toughness × length); beyond it the edge advances, and the
//! links or springs that it sweeps are cut. What a held piece passes is swept when the tissue lets go. The blade's flats push the walls
//! aside with at most the force that would split the tissue ahead of the edge; the lips of a wound may rest on each other
//! ([`crate::collide::lips`]).
//!
//! f32 solves a step to about 10⁻⁶ of its displacement, however small the recurrence's residual; with `refinements` the error falls to the
//! rounding of the displacement itself, 2·10⁻⁸.
//!
//! Each body has its own unconstrained motion; only rows couple bodies. Without contact a step reads back the outcome of its solve, the
//! nodes that follower pressures act on, and the probes alone (`cutis inspect` lists the read-backs). Numerical trouble is counted in [`StepReport`], never repaired in silence.

mod balance;
mod body;
mod contact;
mod costs;
mod deadline;
mod energy;
mod find;
mod finite;
mod in_full;
mod incise;
mod probes;
mod refused;
mod rows;
mod state;
mod warnings;

pub use body::{Body, needs, start};
pub use contact::{ContactPoint, ContactReport, PointKind};
pub use costs::{Costs, Part};
pub use energy::{Booked, Measured};
pub use refused::Refused;
pub use state::State;
pub use warnings::{WARNINGS, Warning, Warnings, warning};

use crate::backend::{Device, Snapshot};
use crate::bodies::Totals;
use crate::bodies::rigid::{Instrument, UnconstrainedMotion};
use crate::bodies::tetrahedra::with_meshes;
use crate::collide::{Contact, sides};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::haptic::Reduced;
use crate::linear::Outcome;
use crate::math::larger;
use crate::scene::{BodyId, Integrator, Scene, Skin};
use body::Known;
use contact::{NodeForces, Resolved};
use deadline::Deadline;
use glam::DVec3;
use in_full::{Next, add_up};
use probes::Prepared;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// Backend and precision of the deformable bodies.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Platform {
    /// CPU: the kernels' twins in f64.
    Cpu64,
    /// CPU: the kernels' twins in f32.
    Cpu32,
    /// GPU: WGSL on the first adapter whose name contains the text, or on the first of all.
    Gpu(Option<String>),
}

impl Platform {
    /// Backend and precision.
    pub fn backend_and_precision(&self) -> [&'static str; 2] {
        match self {
            Self::Cpu64 => ["cpu", "f64"],
            Self::Cpu32 => ["cpu", "f32"],
            Self::Gpu(_) => ["gpu", "f32"],
        }
    }
}

/// Result of a step.
#[derive(Clone, Debug, Default)]
pub struct StepReport {
    /// End of the step, s.
    pub time: f64,
    /// Solve of the unconstrained motion, worst over the bodies.
    pub free: Outcome,
    /// Rounds of iterative refinement.
    pub refinements: u32,
    /// Newton iterations of a nonlinear body, the maximum over bodies and substeps; in a step that is solved in full how often its defect was
    /// evaluated, 12 times at most.
    pub newton_iterations: u32,
    /// Iterations of this step's accurate corrections, summed.
    pub correction_iterations: u32,
    /// Every solve of the unconstrained motion stopped at the absolute floor.
    pub at_floor: bool,
    /// Relative residual of the unconstrained motion's solve, by its recurrence; after refinement in f64.
    pub residual: f64,
    /// Relative residual in f64, if the step is checked.
    pub true_residual: Option<f64>,
    /// What the step leaves of the equations of its laws, relative to its load, in f64, if it is checked ([`crate::bodies::law_residual`]).
    pub law_residual: f64,
    /// Measures of the bodies at the start of the last substep, if the step is checked.
    pub measured: Option<Measured>,
    /// Contacts and their solve.
    pub contact: ContactReport,
    /// Links or springs cut in this step.
    pub severed: u32,
    /// Cells carved in this step.
    pub carved: u32,
    /// Widest opening of the wound near the tool, m.
    pub opening: f64,
    /// Deepest overlap of the wound's lips at the start of the step, m.
    pub overlap: f64,
    /// Probe values in the scene's order, SI.
    pub probes: Vec<f64>,
    /// What the step cost.
    pub costs: Costs,
    /// Trouble in this step.
    pub warnings: Warnings,
}

impl StepReport {
    /// Counts trouble.
    fn warn(&mut self, name: &'static str, count: u32) {
        debug_assert!(warning(name).is_some(), "{name} is in no row of `WARNINGS`");
        if count > 0 {
            *self.warnings.entry(name).or_default() += count;
        }
    }

    /// Merges a later substep: its state, and the trouble and the work of both.
    fn followed_by(&mut self, later: Self) {
        let before = std::mem::replace(self, later);
        self.free.iterations += before.free.iterations;
        self.free.converged &= before.free.converged;
        self.refinements += before.refinements;
        self.newton_iterations = self.newton_iterations.max(before.newton_iterations);
        self.correction_iterations += before.correction_iterations;
        self.residual = larger(before.residual, self.residual);
        self.at_floor &= before.at_floor;
        self.severed += before.severed;
        self.carved += before.carved;
        self.opening = self.opening.max(before.opening);
        self.overlap = self.overlap.max(before.overlap);
        self.costs = self.costs.and(before.costs);
        let (old, new) = (&before.contact, &mut self.contact);
        new.passes = new.passes.max(old.passes);
        new.columns += old.columns;
        new.column_iterations = new.column_iterations.max(old.column_iterations);
        new.residual = larger(old.residual, new.residual);
        new.candidates = new.candidates.max(old.candidates);
        new.depth = larger(old.depth, new.depth);
        new.shortened |= old.shortened;
        new.residual_n = larger(old.residual_n, new.residual_n);
        new.residual_m = larger(old.residual_m, new.residual_m);
        for (name, count) in before.warnings {
            self.warn(name, count);
        }
    }
}

/// Factor on the floor that allows for the rounding of a square and its root in f32.
const AT_FLOOR: f64 = 1.0 + 1e-5;

/// A running scene.
pub struct Simulation {
    /// The deformable bodies, in the scene's order.
    pub bodies: Vec<Body>,
    /// The rigid bodies: tools held by a hand, then free ones.
    pub tools: Vec<Instrument>,
    /// Reduced contact problem of each rigid body after the last step.
    pub reduced: Vec<Reduced>,
    /// s
    pub time: f64,
    scene: Scene,
    /// GPU of the deformable bodies; none on the CPU path.
    gpu: Option<Arc<Gpu>>,
    /// The CPU path computes in f32.
    single: bool,
    probes: Vec<Prepared>,
    ties: Vec<find::Tie>,
    tied: BTreeSet<(BodyId, usize, u32)>,
    postponed: incise::Postponed,
    fronts: incise::Fronts,
    /// Depth of each sample of a rigid body in each deformable body at the last step, m ([`find`]).
    depths: BTreeMap<(usize, usize, usize), f64>,
    /// Tool, body and sample of the contacts that the present step drops as unexplained: such a piece of edge cuts nothing of that body.
    unexplained: BTreeSet<(usize, usize, usize)>,
    /// Sides of deformable bodies that tools were on at the last step.
    sides: sides::Sides,
    /// Force of each contact by its id, N.
    last_forces: BTreeMap<([BodyId; 2], usize), DVec3>,
    /// How much contacts settle between where they are and [`Self::touched`], since solves of the present static step go to and fro.
    swings: u32,
    /// Contacts of round tools in the last solve of the present static step, by their ids.
    touched: BTreeMap<([BodyId; 2], usize), balance::Touched>,
    /// Slip of each contact by its id since it has borne a force in the present static step, m.
    slid: BTreeMap<([BodyId; 2], usize), DVec3>,
    load_changes: Vec<f64>,
    interrupt: Arc<AtomicBool>,
    deadline: Deadline,
    /// Work and dissipation so far.
    booked: Booked,
    /// The measure of least unexplained energy.
    least: Option<Measured>,
    step_number: u64,
    epoch: u32,
}

/// Asserts at compile time that a simulation can move between threads.
const _: fn() = || {
    fn is_send<T: Send>() {}
    is_send::<Simulation>();
};

impl Simulation {
    /// Prepares a scene on a backend.
    ///
    /// # Errors
    /// When a model is too large, no adapter fits, or an attachment's node has no material to hold it.
    pub fn new(scene: &Scene, platform: &Platform) -> Result<Self> {
        scene.check()?; // before an adapter is requested
        let gpu = match platform {
            Platform::Gpu(text) if !scene.skins.is_empty() => Some(Arc::new(Gpu::open(text.as_deref())?)),
            _ => None,
        };
        Self::on(scene, gpu, *platform == Platform::Cpu32)
    }

    /// Prepares a scene on an open device, which other simulations and the caller may share.
    ///
    /// # Errors
    /// As [`Simulation::new`].
    pub fn with_gpu(scene: &Scene, gpu: Arc<Gpu>) -> Result<Self> {
        scene.check()?;
        Self::on(scene, Some(gpu), false)
    }

    /// Prepares a scene that has passed [`Scene::check`].
    fn on(scene: &Scene, gpu: Option<Arc<Gpu>>, single: bool) -> Result<Self> {
        let scene = &*with_meshes(scene)?;
        let body = |number| Body::new(scene, number, gpu.as_ref(), single);
        let bodies = (0..scene.skins.len()).map(body).collect::<Result<Vec<_>>>()?;
        let tools: Vec<Instrument> = scene.tools.iter().map(|t| Instrument::new(t, scene.time.gravity)).collect();
        let mut simulation = Self {
            reduced: tools.iter().map(|t| Reduced::free(t.position, t.rotation, 0)).collect(),
            tools,
            time: 0.0,
            probes: scene.probes.iter().map(|p| Prepared::new(p.kind.clone())).collect(),
            ties: vec![],
            tied: BTreeSet::new(),
            postponed: incise::Postponed::new(),
            fronts: incise::Fronts::new(),
            depths: BTreeMap::new(),
            unexplained: BTreeSet::new(),
            sides: sides::Sides::new(),
            last_forces: BTreeMap::new(),
            swings: 0,
            touched: BTreeMap::new(),
            slid: BTreeMap::new(),
            load_changes: scene.loads.iter().flat_map(|l| [l.start, l.end]).collect(),
            interrupt: Arc::default(),
            deadline: Deadline::default(),
            booked: Booked::default(),
            least: None,
            step_number: 0,
            epoch: 0,
            scene: scene.clone(),
            gpu,
            single,
            bodies,
        };
        simulation.probes.iter_mut().for_each(|probe| probe.find(&simulation.bodies));
        simulation.ties = find::ties(&simulation, scene)?;
        for tie in &simulation.ties {
            tie.note(&mut simulation.bodies, &mut simulation.tied);
        }
        Ok(simulation)
    }

    /// Device of the deformable bodies; the CPU if all bodies are rigid.
    pub fn device(&self) -> Device {
        let rigid =
            Device { backend: "cpu", precision: "f64", adapter: "rigid bodies alone".into(), ..Device::default() };
        let mut device = self.bodies.first().map_or(rigid, Body::device);
        device.device_bytes = self.bodies.iter().map(|b| b.device().device_bytes).sum();
        device
    }

    /// GPU that the deformable bodies are on.
    pub fn gpu(&self) -> Option<&Gpu> {
        self.gpu.as_deref()
    }

    /// Starts or stops timing by the device's own clock.
    pub fn time_device(&mut self, on: bool) {
        self.gpu.iter().for_each(|gpu| gpu.time_passes(on));
    }

    /// Time that the device was busy since the last call, s; none if the backend does not measure it.
    ///
    /// # Errors
    /// When a device fails.
    pub fn device_time(&mut self) -> Result<Option<f64>> {
        self.bodies.iter_mut().for_each(|body| body.backend.flush());
        self.gpu.as_ref().map_or(Ok(None), |gpu| gpu.busy(gpu.batch()))
    }

    /// State arrays of every deformable body.
    ///
    /// # Errors
    /// When a device fails.
    pub fn snapshots(&mut self) -> Result<Vec<Snapshot>> {
        self.bodies.iter_mut().map(Body::snapshot).collect()
    }

    /// Has a flag, once set, end the present step or the next one at its present solves, with
    /// [`Error::Interrupted`](crate::error::Error::Interrupted); the state is then between two steps, and cannot be continued.
    pub fn interrupt_by(&mut self, flag: &Arc<AtomicBool>) {
        self.interrupt = flag.clone();
        self.bodies.iter_mut().for_each(|body| body.backend.interrupt_by(flag.clone()));
    }

    /// Has the next step end by a time, if it can: its contact forces are then solved for by fewer passes, at least one, and with columns
    /// that there are. What they leave is in its report, and the step after it starts from there. Static steps take their time.
    pub fn finish_by(&mut self, end: Instant) {
        let takes_time = self.step_size().is_finite();
        self.deadline.set(takes_time.then_some(end));
    }

    /// Totals over all wounds.
    pub fn totals(&self) -> Totals {
        self.bodies.iter().map(Body::totals).fold(Totals::default(), Totals::and)
    }

    /// Number of cuts so far, counted by body and step; a [`Reduced`] problem of an older epoch is from before the last cut.
    pub fn epoch(&self) -> u32 {
        self.epoch
    }

    /// Length of a substep, s; infinite for static steps, in which tools have neither inertia nor damping.
    fn step_size(&self) -> f64 {
        match self.scene.time.integrator {
            Integrator::Static => f64::INFINITY,
            _ => self.scene.time.part(),
        }
    }

    /// Time whose loads act in the present step, s.
    fn loaded_at(&self) -> f64 {
        match self.scene.time.integrator {
            Integrator::Static => self.time,
            _ => (self.step_number - 1) as f64 * self.scene.time.part(),
        }
    }

    /// Advances by one step; `check` evaluates the true residual as well.
    ///
    /// # Errors
    /// When the device fails, a state becomes non-finite, or a blade cuts more in a step than can be read back.
    pub fn step(&mut self, check: bool) -> Result<StepReport> {
        // within the pool of the CPU path's threads: entered from outside, each of a step's thousand loops would wake and wait for it
        rayon::scope(|_| {
            let parts = self.scene.time.substeps;
            let mut advance = |part: u32| {
                self.deadline.begin(Instant::now(), parts + 1 - part);
                self.advance(check && part == parts)
            };
            let mut report = advance(1)?;
            for part in 2..=parts {
                report.followed_by(advance(part)?);
            }
            self.deadline.pass_by();
            Ok(report)
        })
    }

    fn advance(&mut self, check: bool) -> Result<StepReport> {
        let begin = self.time;
        self.step_number += 1;
        self.time = self.step_number as f64 * self.scene.time.part();
        self.book_loads()?;
        match self.scene.time.integrator {
            Integrator::Static => self.balance(check),
            _ => Ok(self.solve_from(begin, check)?.0),
        }
    }

    /// Step that ends at the present time, with the loads at `begin`; also the contact forces at the bodies' nodes.
    fn solve_from(&mut self, begin: f64, check: bool) -> Result<(StepReport, Option<Vec<NodeForces>>)> {
        let h = self.step_size();
        let start = Instant::now();
        let mut report = StepReport { time: self.time, ..StepReport::default() };
        // set loads where they change; checked steps keep the state at their start
        // start of the previous step exactly as that step computed it: begin − h rounds otherwise
        let before_that = (self.step_number as f64 - 2.0) * self.scene.time.part();
        let changed = |t: &f64| *t <= begin && *t > before_that;
        let loaded = self.step_number == 1 || self.load_changes.iter().any(changed);
        let refined = self.scene.solver.refinements > 0;
        let mut before: Vec<Option<Snapshot>> = vec![];
        for body in &mut self.bodies {
            body.residual.clear();
            body.drive(&self.scene, [self.time - self.scene.time.part(), self.time]);
            body.loaded &= !loaded;
            body.press(&self.scene, begin, None)?;
            before.push(if check || refined { Some(body.snapshot()?) } else { None });
        }
        if check {
            self.measure_start(begin, &before, &mut report);
        }
        // unconstrained motion of the rigid bodies, contacts at the start of the step
        let free: Vec<UnconstrainedMotion> = self.tools.iter().map(|t| t.unconstrained_motion(self.time, h)).collect();
        self.hands_are_finite(&free)?;
        let clock = Instant::now();
        let contacts = match self.scene.contact {
            Some(law) => self.find_contacts(&law, &free, &mut report)?,
            None => vec![],
        };
        report.costs.spend(Part::Search, clock);
        let clock = Instant::now();
        for body in &mut self.bodies {
            body.begin(&self.scene, self.time)?;
        }
        report.costs.spend(Part::Free, clock);
        // unconstrained motion and contact; solved again without warm starts if the result is non-finite
        let old = self.tools.clone();
        let mut solved = self.solve(contacts, &free, false, &mut report)?;
        if self.non_finite_body(&solved).is_some() {
            solved = self.solve_again(&old, &free, &mut report)?;
        }
        let Resolved { free: mut ended, forces, contact_forces } = solved;
        self.last_forces = contact_forces;
        if !h.is_finite() {
            self.keep_contacts(&report.contact);
        }
        // the bodies accept the step; checked ones are verified in f64
        let cuts = self.edges_meet_skin(&report.contact.contacts);
        self.book_step(&old, &report);
        let mut damped = 0.0;
        for (number, (body, before)) in self.bodies.iter_mut().zip(before).enumerate() {
            if let Some(before) = before {
                let forces = forces.as_ref().map(|forces| forces[number].as_slice());
                damped += body.verify(before, forces, &self.scene, (begin, check), &mut ended[number], &mut report)?;
            }
            body.backend.finish(forces.is_some(), cuts)?;
            body.known = Known::default();
            let work = body.backend.nonlinear();
            report.newton_iterations = report.newton_iterations.max(work.iterations);
            report.warn("tangent_indefinite", work.indefinite);
            report.warn("midpoint_moved", u32::from(work.elastic_at.is_some()));
        }
        self.book_damping(check.then_some(damped));
        self.summarise_solves(&ended, &mut report);
        // cut what the edges swept, carve, then read the probes
        let [blades, carvers] =
            [self.scene.tools.iter().any(|t| t.blade.is_some()), self.scene.tools.iter().any(|t| t.carve.is_some())];
        let breaks = self.scene.skins.iter().any(Skin::breaks);
        if blades || carvers || breaks {
            let clock = Instant::now();
            if blades {
                self.incise(&old, cuts, &mut report)?;
            }
            if carvers {
                self.carve(&mut report)?;
            }
            if breaks {
                self.break_springs(&mut report)?;
            }
            report.costs.spend(Part::Cut, clock);
        }
        self.read_probes(begin, forces.as_deref(), &mut report)?;
        self.probes_are_finite(&report)?;
        report.costs.close(start);
        self.deadline.end(Instant::now(), check);
        Ok((report, forces))
    }

    /// Solves the step and moves the tools; with `reuse_forces`, contact forces are those of the last step.
    fn solve(
        &mut self,
        contacts: Vec<Contact>,
        free: &[UnconstrainedMotion],
        reuse_forces: bool,
        report: &mut StepReport,
    ) -> Result<Resolved> {
        match self.scene.contact.filter(|_| !contacts.is_empty()) {
            Some(law) => self.resolve(law, contacts, free, reuse_forces, report),
            None => self.move_freely(free, report),
        }
    }

    /// Solves a step without contact.
    fn move_freely(&mut self, free: &[UnconstrainedMotion], report: &mut StepReport) -> Result<Resolved> {
        let h = self.step_size();
        let solver = self.scene.solver;
        let solves = self.bodies.iter_mut().map(|body| Ok(body.solve_free(&solver, None, &[], &[], report)?.0));
        let mut ended = solves.collect::<Result<Vec<Outcome>>>()?;
        // in full: again with the defect that these increments leave
        let (clock, of_step) = (Instant::now(), ended.clone());
        let mut changed = true;
        loop {
            let longest = clock.elapsed() / (1 + report.newton_iterations);
            let next = self.next(changed, false, longest, report)?;
            let (Next::Again | Next::Linearised) = next else { break };
            let solves = self.bodies.iter_mut().zip(&of_step).map(|(body, before)| match body.in_full {
                true => {
                    let before = (next == Next::Again).then_some(*before);
                    Ok(body.solve_free(&solver, before, &[], &[], report)?.0)
                }
                false => Ok(Outcome { iterations: 0, ..*before }),
            });
            let again = solves.collect::<Result<Vec<Outcome>>>()?;
            changed = add_up(&mut ended, &again);
        }
        for (tool, free) in self.tools.iter_mut().zip(free) {
            tool.advance(free.translation, free.rotation, h);
        }
        for (reduced, tool) in self.reduced.iter_mut().zip(&self.tools) {
            *reduced = Reduced::free(tool.position, tool.rotation, self.epoch);
        }
        Ok(Resolved { free: ended, forces: None, contact_forces: BTreeMap::new() })
    }

    /// Sums up the solves of the unconstrained motion: most iterations, worst residual.
    fn summarise_solves(&self, ended: &[Outcome], report: &mut StepReport) {
        let solver = &self.scene.solver;
        report.at_floor = !ended.is_empty();
        report.free.converged = true;
        for outcome in ended {
            // at the floor the load is too small for a relative residual to mean anything
            let at_floor = outcome.target <= solver.floor * AT_FLOOR;
            report.at_floor &= at_floor;
            if !at_floor && outcome.target != 0.0 {
                report.residual = larger(report.residual, outcome.residual / outcome.target * solver.tolerance);
            }
            report.warn("solver_not_converged", u32::from(!outcome.converged));
            report.free = Outcome {
                iterations: report.free.iterations.max(outcome.iterations),
                converged: report.free.converged && outcome.converged,
                residual: larger(report.free.residual, outcome.residual),
                target: report.free.target.max(outcome.target),
            };
        }
    }
}
