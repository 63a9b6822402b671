//! One time step, written once over [`Backend`](crate::backend::Backend):
//!
//! 1. contacts at the step's start (the search is widened by the rigid bodies' motion), and the ties;
//! 2. free motion of every body, loose columns of `A⁻¹` at nodes that rows newly act on;
//! 3. violations `δ` at the free positions, forces λ by Gauss–Seidel on `W λ + δ`;
//! 4. correction: `A Δx = Jᵀλ` solved accurately, δ taken again, until the laws hold;
//! 5. integration, the rigid bodies' motion, the cut by what an edge swept.
//!
//! With displacement increments Δx = h·v' as unknowns, implicit Euler with Rayleigh damping is `A Δx = b`, `A = (1 + h r_M)/h² M + (1 + r_K/h)
//! K`, `b = f_ext − f_int + M v/h` ([`crate::kernels::rhs`], M lumped, uniform or consistent; springs to rest positions are part of `f_int`
//! and `K`, [`crate::bodies::Anchors`]): external forces and inertia stand in one right-hand side, so nothing is lost to f32. `A` is never
//! assembled, except by the CPU path when a scene asks for a factor of it ([`crate::bodies::grid::direct`]). Newmark's method and symplectic
//! Euler have other factors in the same `A` and `b` ([`crate::bodies::Step`]). A hyperelastic body has a tangent per cell, kept on the CPU path
//! and taken anew in each product on a GPU, and its steps are solved by Newton's method.
//!
//! Contacts: a tree of boxes over tiles of each body, refitted to the bounds that the device reports ([`crate::collide::broad`]), gives the few
//! faces whose nodes are read back; sphere, capsule, point, line and box have their own narrow phase. The compliance at the nodes that rows
//! reach, columns of `A⁻¹` solved loosely, is kept from step to step, learns in each pass, and is renewed by batches where it has aged.
//! Forces come from the laws on `W λ + δ`, `W = Σ J C Jᵀ` over the bodies; since δ is taken again after each accurate correction, λ does not
//! depend on how loose the columns are. The edge of a blade is held by what the tissue bears (toughness × length); beyond that it goes on,
//! and the links or springs that it sweeps are cut; what a held piece passes is swept when it lets go. Its flats push the walls aside with at
//! most what would split the tissue before the edge, and the lips of a wound may rest on each other ([`crate::collide::lips`]).
//!
//! f32 carries a step to about 10⁻⁶ of its displacement, whatever its recurrence promises; with `refinements` it ends at the rounding of the
//! displacement itself, 2·10⁻⁸.
//!
//! Each body has its own free motion; only rows couple bodies. A scene without contact reads nothing back here. What goes wrong
//! numerically is counted in [`StepReport`], never mended in silence.

mod body;
mod contact;
mod find;
mod finite;
mod incise;
mod refused;
mod rows;
mod state;

pub use body::{Body, Measured, needs, start};
pub use contact::ContactReport;
pub use refused::Refused;
pub use state::State;

use crate::backend::{Device, Query, Snapshot};
use crate::bodies::Totals;
use crate::bodies::rigid::{Instrument, UnconstrainedMotion};
use crate::collide::Contact;
use crate::error::Result;
use crate::gpu::Gpu;
use crate::haptic::Reduced;
use crate::linear::Outcome;
use crate::math::larger;
use crate::scene::{BodyId, ProbeKind, Scene};
use body::Known;
use contact::Resolved;
use glam::DVec3;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Where the skin is computed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// The twins in f64.
    Cpu64,
    /// The twins in f32.
    Cpu32,
    /// WGSL on the first adapter whose name contains the text, or the first of all.
    Gpu(Option<String>),
}

impl Place {
    /// Backend and precision.
    pub fn words(&self) -> [&'static str; 2] {
        match self {
            Self::Cpu64 => ["cpu", "f64"],
            Self::Cpu32 => ["cpu", "f32"],
            Self::Gpu(_) => ["gpu", "f32"],
        }
    }
}

/// Numerical trouble, counted by name.
pub type Warnings = BTreeMap<&'static str, u32>;

/// What happened in a step.
#[derive(Clone, Debug, Default)]
pub struct StepReport {
    /// End of the step, s.
    pub time: f64,
    /// Free motion.
    pub free: Outcome,
    /// Rounds of iterative refinement.
    pub refinements: u32,
    /// Newton iterations of a body whose law is not linear; the most of the bodies and of the parts of a step.
    pub newton_iterations: u32,
    /// Accurate corrections of this step, summed iterations.
    pub correction_iterations: u32,
    /// The solve was asked for no more than the absolute floor.
    pub at_floor: bool,
    /// Relative residual after the last solve that counts, as its recurrence has it.
    pub residual: f64,
    /// Relative residual in f64, when it was asked for.
    pub true_residual: Option<f64>,
    /// The deformable bodies as the checked step found them; none of an unchecked one.
    pub measured: Option<Measured>,
    /// Contacts and their solve.
    pub contact: ContactReport,
    /// Links or springs cut in this step.
    pub severed: u32,
    /// Widest parting of the lips of the wound near the tool, m.
    pub opening: f64,
    /// Deepest overlap of the lips of the wound at the step's start, m.
    pub overlap: f64,
    /// Probe values, in the scene's order, SI.
    pub probes: Vec<f64>,
    /// Trouble in this step.
    pub warnings: Warnings,
}

impl StepReport {
    /// Counts trouble.
    fn warn(&mut self, name: &'static str, count: u32) {
        if count > 0 {
            *self.warnings.entry(name).or_default() += count;
        }
    }

    /// Takes in the part of a step that came after this one: the later state, the trouble and the work of both.
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
        self.opening = self.opening.max(before.opening);
        self.overlap = self.overlap.max(before.overlap);
        let (old, new) = (&before.contact, &mut self.contact);
        new.passes = new.passes.max(old.passes);
        new.columns += old.columns;
        new.column_iterations = new.column_iterations.max(old.column_iterations);
        new.residual = larger(old.residual, new.residual);
        new.candidates = new.candidates.max(old.candidates);
        new.depth = larger(old.depth, new.depth);
        new.residual_n = larger(old.residual_n, new.residual_n);
        new.residual_m = larger(old.residual_m, new.residual_m);
        for (name, count) in before.warnings {
            self.warn(name, count);
        }
    }
}

/// Above 1 by more than what a square and its root round in f32.
const AT_FLOOR: f64 = 1.0 + 1e-5;

/// A running scene.
pub struct Simulation {
    /// The deformable bodies, as the scene lists them.
    pub bodies: Vec<Body>,
    /// The rigid bodies: tools, then those that no hand holds.
    pub tools: Vec<Instrument>,
    /// Contact problem of each rigid body after the last step.
    pub reduced: Vec<Reduced>,
    /// s
    pub time: f64,
    scene: Scene,
    /// What the deformable bodies run on; none for the CPU path.
    gpu: Option<Arc<Gpu>>,
    /// The CPU path is in f32.
    single: bool,
    probes: Vec<Prepared>,
    ties: Vec<find::Tie>,
    tied: BTreeSet<(BodyId, usize, u32)>,
    held: incise::Held,
    fronts: incise::Fronts,
    /// How deep each sample of a rigid body was inside each deformable body at the last step, m ([`find`]).
    depths: BTreeMap<(usize, usize, usize), f64>,
    /// Force of each contact by its name, N.
    last_forces: BTreeMap<([BodyId; 2], usize), DVec3>,
    load_changes: Vec<f64>,
    step_number: u64,
    epoch: u32,
}

/// A simulation may be made in one thread and run in another.
const _: fn() = || {
    fn is_send<T: Send>() {}
    is_send::<Simulation>();
};

/// A probe and the nodes that it needs.
struct Prepared {
    kind: ProbeKind,
    nodes: Vec<u32>,
}

impl Simulation {
    /// Prepares a scene on a place.
    ///
    /// # Errors
    /// When a model is too large, no adapter fits, or something is tied to what is not there.
    pub fn new(scene: &Scene, place: &Place) -> Result<Self> {
        scene.check()?; // before an adapter is asked for
        let gpu = match place {
            Place::Gpu(text) if !scene.skins.is_empty() => Some(Arc::new(Gpu::open(text.as_deref())?)),
            _ => None,
        };
        Self::on(scene, gpu, *place == Place::Cpu32)
    }

    /// Prepares a scene on a device that is open already, which other simulations and the caller may use as well.
    ///
    /// # Errors
    /// As [`Simulation::new`].
    pub fn with_gpu(scene: &Scene, gpu: Arc<Gpu>) -> Result<Self> {
        scene.check()?;
        Self::on(scene, Some(gpu), false)
    }

    /// Of a scene that has passed [`Scene::check`].
    fn on(scene: &Scene, gpu: Option<Arc<Gpu>>, single: bool) -> Result<Self> {
        let body = |number| Body::new(scene, number, gpu.as_ref(), single);
        let bodies = (0..scene.skins.len()).map(body).collect::<Result<Vec<_>>>()?;
        let prepare = |kind: &ProbeKind| {
            let nodes = match kind {
                ProbeKind::Displacement { body, point, .. } => vec![bodies[*body].model.nearest(*point)],
                ProbeKind::Reaction { body, region, .. } => bodies[*body].model.nodes_in(region),
                _ => vec![],
            };
            Prepared { kind: kind.clone(), nodes }
        };
        let tools: Vec<Instrument> = scene.tools.iter().map(|t| Instrument::new(t, scene.time.gravity)).collect();
        let mut simulation = Self {
            reduced: tools.iter().map(|t| Reduced::free(t.position, t.rotation, 0)).collect(),
            tools,
            time: 0.0,
            probes: scene.probes.iter().map(|p| prepare(&p.kind)).collect(),
            ties: vec![],
            tied: BTreeSet::new(),
            held: incise::Held::new(),
            fronts: incise::Fronts::new(),
            depths: BTreeMap::new(),
            last_forces: BTreeMap::new(),
            load_changes: scene.loads.iter().flat_map(|l| [l.start, l.end]).collect(),
            step_number: 0,
            epoch: 0,
            scene: scene.clone(),
            gpu,
            single,
            bodies,
        };
        simulation.ties = find::ties(&simulation, scene)?;
        for tie in &simulation.ties {
            tie.note(&mut simulation.bodies, &mut simulation.tied);
        }
        Ok(simulation)
    }

    /// What the deformable bodies run on; of rigid bodies alone, the CPU.
    pub fn device(&self) -> Device {
        let rigid =
            Device { backend: "cpu", precision: "f64", adapter: "rigid bodies alone".into(), ..Device::default() };
        let mut device = self.bodies.first().map_or(rigid, Body::device);
        device.device_bytes = self.bodies.iter().map(|b| b.device().device_bytes).sum();
        device
    }

    /// Begins or ends timing by the devices' own clocks.
    pub fn time_device(&mut self, on: bool) {
        self.gpu.iter().for_each(|gpu| gpu.time_passes(on));
    }

    /// How long the devices were busy since this was last asked, s; none where nothing says so.
    ///
    /// # Errors
    /// When a device fails.
    pub fn device_time(&mut self) -> Result<Option<f64>> {
        self.bodies.iter_mut().for_each(|body| body.backend.flush());
        self.gpu.as_ref().map_or(Ok(None), |gpu| gpu.busy(gpu.batch()))
    }

    /// Fields of every deformable body.
    ///
    /// # Errors
    /// When a device fails.
    pub fn snapshots(&mut self) -> Result<Vec<Snapshot>> {
        self.bodies.iter_mut().map(Body::snapshot).collect()
    }

    /// Measures of all wounds together.
    pub fn totals(&self) -> Totals {
        self.bodies.iter().map(Body::totals).fold(Totals::default(), Totals::and)
    }

    /// Counts the steps that have cut; a [`Reduced`] problem of an older epoch is from before the last cut.
    pub fn epoch(&self) -> u32 {
        self.epoch
    }

    /// Length of what is advanced at once, s.
    fn step_size(&self) -> f64 {
        self.scene.time.part()
    }

    /// Advances by one step; `check` asks for the true residual.
    ///
    /// # Errors
    /// When the device fails or a blade cuts more in a step than can be taken back.
    pub fn step(&mut self, check: bool) -> Result<StepReport> {
        let parts = self.scene.time.substeps;
        let mut report = self.advance(check && parts == 1)?;
        for part in 2..=parts {
            report.followed_by(self.advance(check && part == parts)?);
        }
        Ok(report)
    }

    fn advance(&mut self, check: bool) -> Result<StepReport> {
        let h = self.step_size();
        let begin = self.time;
        self.step_number += 1;
        self.time = self.step_number as f64 * h;
        let mut report = StepReport { time: self.time, ..StepReport::default() };
        // loads are set where they have changed; checked steps keep the state at their start
        // the begin of the step before as that step had it: begin − h rounds otherwise
        let before_that = (self.step_number as f64 - 2.0) * h;
        let changed = |t: &f64| *t <= begin && *t > before_that;
        let loaded = self.step_number == 1 || self.load_changes.iter().any(changed);
        let refined = self.scene.solver.refinements > 0;
        let mut before = vec![];
        for body in &mut self.bodies {
            if loaded || !body.loaded {
                body.backend.set_load(&body.load_at(&self.scene, begin));
                body.loaded = true;
            }
            before.push(if check || refined { Some(body.backend.snapshot()?) } else { None });
        }
        // unconstrained motion of the rigid bodies, contacts at the step's start
        let free: Vec<UnconstrainedMotion> = self.tools.iter().map(|t| t.unconstrained_motion(self.time, h)).collect();
        self.hands_are_finite(&free)?;
        let contacts = match self.scene.contact {
            Some(law) => self.find_contacts(&law, &free, &mut report)?,
            None => vec![],
        };
        for body in &mut self.bodies {
            body.backend.begin()?;
        }
        // free motion and contact; once more without warm starts where that leaves the numbers
        let old = self.tools.clone();
        let mut solved = self.solve(contacts, &free, false, &mut report)?;
        if self.lost(&solved).is_some() {
            solved = self.solve_again(&old, &free, &mut report)?;
        }
        let Resolved { free: mut ended, forces, contact_forces } = solved;
        self.last_forces = contact_forces;
        // the bodies take the step over; checked ones are verified in f64
        let cuts = self.edges_meet_skin(&report.contact.contacts);
        for (number, (body, before)) in self.bodies.iter_mut().zip(before).enumerate() {
            if let Some(before) = before {
                let forces = forces.as_ref().map(|forces| forces[number].as_slice());
                body.verify(before, forces, &self.scene, (begin, check), &mut ended[number], &mut report)?;
            }
            body.backend.finish(forces.is_some(), cuts)?;
            body.known = Known::default();
            let work = body.backend.nonlinear();
            report.newton_iterations = report.newton_iterations.max(work.iterations);
            report.warn("tangent_indefinite", work.indefinite);
        }
        self.note_solves(&ended, &mut report);
        // what the edges swept is cut; then the probes
        if self.scene.tools.iter().any(|t| t.blade.is_some()) {
            self.incise(&old, cuts, &mut report)?;
        }
        self.read_probes(&mut report)?;
        self.probes_are_finite(&report)?;
        Ok(report)
    }

    /// Solves the step and moves the tools; `held` takes the contact forces of the last step as they were.
    fn solve(
        &mut self,
        contacts: Vec<Contact>,
        free: &[UnconstrainedMotion],
        held: bool,
        report: &mut StepReport,
    ) -> Result<Resolved> {
        match self.scene.contact.filter(|_| !contacts.is_empty()) {
            Some(law) => self.resolve(law, contacts, free, held, report),
            None => self.move_freely(free),
        }
    }

    /// A step in which nothing touches.
    fn move_freely(&mut self, free: &[UnconstrainedMotion]) -> Result<Resolved> {
        let h = self.step_size();
        let solver = self.scene.solver;
        let solves = self.bodies.iter_mut().map(|body| Ok(body.solve_free(&solver, &[])?.0));
        let ended = solves.collect::<Result<_>>()?;
        for (tool, free) in self.tools.iter_mut().zip(free) {
            tool.advance(free.shift, free.turn, h);
        }
        for (reduced, tool) in self.reduced.iter_mut().zip(&self.tools) {
            *reduced = Reduced::free(tool.position, tool.rotation, self.epoch);
        }
        Ok(Resolved { free: ended, forces: None, contact_forces: BTreeMap::new() })
    }

    /// How the free motions were solved: the most iterations, the worst residual.
    fn note_solves(&self, ended: &[Outcome], report: &mut StepReport) {
        let solver = &self.scene.solver;
        report.at_floor = !ended.is_empty();
        report.free.converged = true;
        for outcome in ended {
            // at the floor the load is so small that a share of it says nothing
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

    fn read_probes(&mut self, report: &mut StepReport) -> Result<()> {
        for (number, body) in self.bodies.iter_mut().enumerate() {
            body.read(query(&self.probes, number))?;
        }
        for probe in &self.probes {
            let sum = |values: &BTreeMap<u32, [f64; 3]>, axis: usize| probe.nodes.iter().map(|n| values[n][axis]).sum();
            report.probes.push(match probe.kind {
                ProbeKind::Displacement { body, axis, .. } => sum(&self.bodies[body].known.u, axis),
                ProbeKind::Reaction { body, axis, .. } => sum(&self.bodies[body].known.f, axis),
                ProbeKind::Position { body, axis } => self.tools[body].position[axis],
                ProbeKind::Velocity { body, axis } => self.tools[body].velocity[axis],
                ProbeKind::Force { on, from, axis } => report.contact.force(on, from)[axis],
            });
        }
        Ok(())
    }
}

/// What the probes ask of a body.
fn query(probes: &[Prepared], number: usize) -> Query {
    let mut query = Query::default();
    for probe in probes {
        match probe.kind {
            ProbeKind::Displacement { body, .. } if body == number => query.displacements.extend(&probe.nodes),
            ProbeKind::Reaction { body, .. } if body == number => query.elastic_forces.extend(&probe.nodes),
            _ => {}
        }
    }
    query
}
