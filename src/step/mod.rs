//! One time step, written once over [`Backend`]:
//!
//! 1. contacts at the step's start (the search is widened by the tool's motion);
//! 2. free motion of the skin, loose columns of `A⁻¹` at nodes that the tools newly reach; the tool's free motion;
//! 3. violations `δ` at the free positions, forces λ by Gauss–Seidel on `W λ + δ`;
//! 4. correction: `A Δx = Jᵀλ` solved accurately, δ taken again, until the contact law holds;
//! 5. integration, the tool's motion, the cut by what the edge swept.
//!
//! A scene without contact reads nothing back here. What goes wrong numerically is counted in [`StepReport`], never mended in silence.

mod compliance;
mod contact;
mod incise;
mod refine;
mod start;

pub use contact::ContactReport;
pub use start::{needs, start};

use crate::backend::{Backend, CORRECTION, CpuBackend, Device, FREE, GpuBackend, Snapshot, Target, Wanted};
use crate::collide::{self, Contact, Patch, Search};
use crate::cut::{Totals, Wound};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::haptic::Reduced;
use crate::instrument::{Free, Instrument};
use crate::linear::Outcome;
use crate::math::V4;
use crate::model::{Model, Solved, true_residual};
use crate::scene::{ProbeKind, Scene};
use compliance::Compliance;
use glam::DVec3;
use std::collections::BTreeMap;

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
    /// Accurate corrections of this step, summed iterations.
    pub correction_iterations: u32,
    /// The solve was asked for no more than the absolute floor.
    pub at_floor: bool,
    /// Relative residual after the last solve that counts, as its recurrence has it.
    pub residual: f64,
    /// Relative residual in f64, when it was asked for.
    pub true_residual: Option<f64>,
    /// Contacts and their solve.
    pub contact: ContactReport,
    /// Links or springs cut in this step.
    pub severed: u32,
    /// Widest parting of the lips of the wound near the tool, m.
    pub opening: f64,
    /// Probe values, in the scene's order, SI.
    pub probes: Vec<f64>,
    /// Trouble in this step.
    pub warnings: Warnings,
}

/// Above 1 by more than what a square and its root round in f32.
const AT_FLOOR: f64 = 1.0 + 1e-5;

/// A running scene.
pub struct Simulation {
    /// The constant arrays.
    pub model: Model,
    /// The body as cut so far.
    pub wound: Wound,
    /// The tools.
    pub tools: Vec<Instrument>,
    /// Contact problem of each tool after the last step.
    pub reduced: Vec<Reduced>,
    /// s
    pub time: f64,
    scene: Scene,
    backend: Box<dyn Backend>,
    probes: Vec<Prepared>,
    compliance: Compliance,
    held: incise::Held,
    load_changes: Vec<f64>,
    step_number: u32,
    epoch: u32,
    reach: f64,
}

struct Prepared {
    nodes: Vec<u32>,
    axis: usize,
    reaction: bool,
}

impl Simulation {
    /// Prepares a scene on a place.
    ///
    /// # Errors
    /// When the model is too large or no adapter fits.
    pub fn new(scene: &Scene, place: &Place) -> Result<Self> {
        let needs = needs(scene);
        let gpu = match place {
            Place::Gpu(text) => Some(Gpu::open(text.as_deref())?),
            Place::Cpu64 | Place::Cpu32 => None,
        };
        if let Some(gpu) = &gpu {
            // a grid that does not fit is refused before the host spends minutes on it
            let [x, y] = scene.skin.cells.map(|c| u64::from(c) + 1);
            let z: u64 = scene.skin.layers.iter().map(|l| u64::from(l.cells)).sum();
            gpu.fits("x", x * y * (z + 1) * 16 * needs.slots() as u64)?;
        }
        let model = Model::new(scene)?;
        let start = start(scene, &model);
        let (cap, floor) = (scene.solver.max_iterations, scene.solver.floor);
        let backend: Box<dyn Backend> = match (place, gpu) {
            (_, Some(gpu)) => Box::new(GpuBackend::new(gpu, &model, needs, cap, floor, &start)?),
            (Place::Cpu32, _) => Box::new(CpuBackend::<f32>::new(&model, needs, cap, floor, &start)),
            _ => Box::new(CpuBackend::<f64>::new(&model, needs, cap, floor, &start)),
        };
        let prepare = |kind: &ProbeKind| match kind {
            ProbeKind::Displacement { point, axis } => {
                Prepared { nodes: vec![model.grid.nearest(*point) as u32], axis: *axis, reaction: false }
            }
            ProbeKind::Reaction { region, axis } => {
                Prepared { nodes: model.nodes_in(region), axis: *axis, reaction: true }
            }
        };
        let tools: Vec<Instrument> = scene.tools.iter().map(Instrument::new).collect();
        let reach = start.u.iter().flatten().fold(model.grid.thickness(), |m, u| m.max(u.abs()));
        Ok(Self {
            wound: Wound::new(&model),
            reduced: tools.iter().map(|t| Reduced::free(t.position, t.rotation, 0)).collect(),
            tools,
            time: 0.0,
            backend,
            probes: scene.probes.iter().map(|p| prepare(&p.kind)).collect(),
            compliance: Compliance::default(),
            held: incise::Held::new(),
            load_changes: scene.loads.iter().flat_map(|l| [l.start, l.end]).collect(),
            step_number: 0,
            epoch: 0,
            reach,
            scene: scene.clone(),
            model,
        })
    }

    /// What the skin runs on.
    pub fn device(&self) -> Device {
        self.backend.device()
    }

    /// All state of the skin.
    ///
    /// # Errors
    /// When the device fails.
    pub fn snapshot(&mut self) -> Result<Snapshot> {
        self.backend.snapshot()
    }

    /// Measures of the wound.
    pub fn totals(&self) -> Totals {
        self.wound.totals
    }

    /// Advances by one step; `check` asks for the true residual.
    ///
    /// # Errors
    /// When the device fails or a blade cuts more in a step than can be taken back.
    pub fn step(&mut self, check: bool) -> Result<StepReport> {
        let h = self.scene.time.step;
        let begin = self.time;
        self.step_number += 1;
        self.time = f64::from(self.step_number) * h;
        let mut report = StepReport { time: self.time, ..StepReport::default() };
        let changed = |t: &f64| *t <= begin && *t > begin - h;
        if self.step_number == 1 || self.load_changes.iter().any(changed) {
            self.backend.set_load(&self.model.load_at(&self.scene.loads, begin));
        }
        let refined = self.scene.solver.refinements > 0;
        let before = if check || refined { Some(self.backend.snapshot()?) } else { None };
        let free: Vec<Free> = self.tools.iter().map(|t| t.free_motion(self.time, h)).collect();
        let contacts = self.find_contacts(&free, &mut report)?;
        self.backend.begin()?;
        let tolerance = self.scene.solver.tolerance;
        let old = self.tools.clone();
        let correction = if contacts.is_empty() {
            let wanted = [Wanted { slot: FREE, target: Target::OfLoad(tolerance) }];
            report.free = self.backend.solve(&wanted, &[])?.0[0];
            for (tool, free) in self.tools.iter_mut().zip(&free) {
                tool.advance(free.shift, free.turn, h);
            }
            for (reduced, tool) in self.reduced.iter_mut().zip(&self.tools) {
                *reduced = Reduced::free(tool.position, tool.rotation, self.epoch);
            }
            vec![]
        } else {
            self.resolve(&contacts, &free, &mut report)?
        };
        let corrected = !contacts.is_empty();
        if let Some(before) = before {
            let mut solved = self.solved(before, &correction, begin);
            solved.dx = self.increment(corrected)?;
            if refined {
                self.refine(&mut solved, corrected, &mut report)?;
            }
            if check && refined {
                solved.dx = self.increment(corrected)?; // as the backend has rounded it
            }
            report.true_residual = check.then(|| true_residual(&self.model, &solved));
        }
        // at the floor the load is so small that a share of it says nothing
        report.at_floor = report.free.target <= self.scene.solver.floor * AT_FLOOR;
        report.residual = match report.at_floor || report.free.target == 0.0 {
            true => 0.0,
            false => report.free.residual / report.free.target * tolerance,
        };
        if !report.free.converged {
            *report.warnings.entry("solver_not_converged").or_default() += 1;
        }
        self.backend.finish(corrected)?;
        if self.scene.tools.iter().any(|t| t.blade.is_some()) {
            self.incise(&old, &contacts, &mut report)?;
        }
        self.read_probes(&mut report)?;
        Ok(report)
    }

    /// Contacts at the step's start, at most the scene's number, nearest first.
    fn find_contacts(&mut self, free: &[Free], report: &mut StepReport) -> Result<Vec<Contact>> {
        let Some(law) = self.scene.contact else {
            return Ok(vec![]);
        };
        let search = Search {
            alarm: law.alarm,
            distance: law.distance,
            friction: law.friction,
            filter: law.filter,
            angle_cone: law.angle_cone,
        };
        let mut found = vec![];
        let mut near = DVec3::ZERO;
        for (number, tool) in self.tools.iter().enumerate() {
            let span = tool.samples.iter().map(|s| s.position.length()).fold(0.0, f64::max);
            let travel = free[number].shift.length() + free[number].turn.length() * span;
            let area = collide::tool_box(tool, search.alarm + search.distance + travel);
            let faces = collide::faces_near(&self.model.grid, &self.wound.surface, &area, self.reach);
            let mut nodes: Vec<u32> = faces.iter().flat_map(|q| q.nodes).collect();
            nodes.sort_unstable();
            nodes.dedup();
            if nodes.is_empty() {
                continue;
            }
            let u = self.backend.displacements(&nodes)?;
            let position = |id: u32| {
                let k = nodes.binary_search(&id).unwrap_or(0);
                DVec3::from_array(self.model.rest[id as usize]) + DVec3::from_array(u[k])
            };
            for d in &u {
                near = near.max(DVec3::from_array(*d).abs());
            }
            if u.iter().flatten().any(|c| !c.is_finite()) {
                *report.warnings.entry("non_finite_nodes").or_default() += 1;
                continue;
            }
            self.note_opening(&nodes, &u, report);
            let Some(patch) = Patch::new(&faces, position) else {
                continue;
            };
            let (model, params) = (&self.model, self.model.grid.params::<f64>());
            let resistance = |cell: u32| {
                let level = params.cell_at(cell as usize)[2];
                model.toughness[model.grid.layer_of[level] as usize]
            };
            found.extend(match (&tool.round, &tool.lines) {
                (Some(round), _) => {
                    collide::round::contacts(number, tool, round, &faces, &patch, &position, &search, &free[number])
                }
                (None, Some(lines)) => collide::features::contacts(number, tool, lines, &patch, &search, &free[number]),
                (None, None) => collide::contacts(number, tool, &patch, &search, travel, resistance),
            });
        }
        // next step's faces: skin near the tool has moved this far; skin that is not near yet by less than its thickness
        self.reach = (near.max_element() + search.alarm).max(self.model.grid.thickness());
        let most = law.max_contacts as usize;
        if found.len() > most {
            *report.warnings.entry("contacts_dropped").or_default() += (found.len() - most) as u32;
            found.sort_by(|a, b| a.gap.total_cmp(&b.gap).then(a.id.cmp(&b.id)));
            found.truncate(most);
            found.sort_by_key(|c| c.id);
        }
        Ok(found)
    }

    /// What the solves have found together, `[node]` m.
    fn increment(&mut self, corrected: bool) -> Result<Vec<V4<f64>>> {
        let mut dx = self.backend.solution(FREE)?;
        if corrected {
            refine::add(&mut dx, &self.backend.solution(CORRECTION)?, 1.0);
        }
        Ok(dx)
    }

    /// The step's equations for a check in f64, without their solution.
    fn solved(&self, before: Snapshot, contact: &[(u32, [f64; 3])], time: f64) -> Solved {
        let mut forces = vec![[0.0; 4]; before.u.len()];
        for (node, [x, y, z]) in contact {
            forces[*node as usize] = [*x, *y, *z, 0.0];
        }
        let load = self.model.load_at(&self.scene.loads, time);
        Solved {
            u: before.u,
            v: before.v,
            rotation: before.rotation,
            free: before.free,
            law: before.law,
            load: load.iter().map(|l| [l[0], l[1], l[2], 0.0]).collect(),
            contact: forces,
            dx: vec![],
        }
    }

    fn read_probes(&mut self, report: &mut StepReport) -> Result<()> {
        let moved: Vec<u32> = self.probes.iter().filter(|p| !p.reaction).flat_map(|p| p.nodes.clone()).collect();
        let held: Vec<u32> = self.probes.iter().filter(|p| p.reaction).flat_map(|p| p.nodes.clone()).collect();
        let u = if moved.is_empty() { vec![] } else { self.backend.displacements(&moved)? };
        let f = if held.is_empty() { vec![] } else { self.backend.elastic_forces(&held)? };
        let (mut next_u, mut next_f) = (u.iter(), f.iter());
        for probe in &self.probes {
            let source = if probe.reaction { &mut next_f } else { &mut next_u };
            report.probes.push(source.by_ref().take(probe.nodes.len()).map(|v| v[probe.axis]).sum());
        }
        if report.probes.iter().any(|p| !p.is_finite()) {
            *report.warnings.entry("non_finite_nodes").or_default() += 1;
        }
        Ok(())
    }
}
