//! A deformable body as it runs: its model, its state on a backend, how it was cut, how it gives.

mod compliance;
mod known;
mod refine;
mod start;

pub use compliance::Compliance;
pub(super) use known::Known;
pub use start::{needs, start};

use super::{Simulation, StepReport};
use crate::backend::{Backend, CORRECTION, CpuBackend, Device, FREE, GpuBackend, Query, Snapshot, Target, Wanted};
use crate::bodies::{Model, Solved, energy, inverted_cells, residual};
use crate::bodies::{Totals, Wound};
use crate::collide::broad::Boxes;
use crate::collide::lips::Lips;
use crate::collide::{self, Aabb, Patch, Resistance};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::kernels::cut::Hit;
use crate::linear::Outcome;
use crate::math::{V4, larger, norm};
use crate::mesh::{Corner, Quad};
use crate::scene::{Scene, Solver};
use compliance::AtRest;
use glam::DVec3;
use start::{check_step, slots};
use std::sync::Arc;

/// See the module.
pub struct Body {
    /// The constant arrays.
    pub model: Model,
    /// The body as cut so far.
    pub wound: Wound,
    pub(super) backend: Box<dyn Backend>,
    pub(super) compliance: Compliance,
    pub(super) at_rest: AtRest,
    pub(super) located: Located,
    /// What has been read of the present state.
    pub(super) known: Known,
    pub(super) boxes: Boxes,
    /// How far it may move in the present step: as far as in the last one, and what gravity adds, m.
    pub(super) travel: f64,
    pub(super) first_motion: f64,
    fall: f64,
    /// Its dead loads are where its nodes are.
    pub(super) loaded: bool,
    /// Share of the scene's column tolerance that this body's columns are solved to.
    pub(super) looseness: f64,
    /// Nodes that its compliance is remembered of at most.
    pub(super) near: usize,
    /// The lips of its wound, where they are to rest on each other.
    pub(super) lips: Option<Vec<Lips>>,
    /// Nodes of the scene's ties.
    pub(super) tied: Vec<u32>,
    /// What was cut, hits by hits: the wound is what they make of the uncut body.
    pub(super) cuts: Vec<Vec<Hit<f64>>>,
    /// Some of its nodes, or what a solve of the present step has found for them, are non-finite.
    pub(super) lost: bool,
}

/// A body that nothing holds resists a push of all its nodes by its inertia alone, which is 10⁻³ to 10⁻⁵ of its stiffness: the same
/// residual is that much more of its motion. With 1 the passes on a stack of five blocks never close in; with this one suffices.
const OF_FLOATING: f64 = 1e-4;

/// Share of the largest below which a pivot of the held motions counts as none.
const NONE: f64 = 1e-9;

/// Whether the body can move as a rigid one: what its held axes and anchors see of the six rigid motions leaves one out.
fn floats(model: &Model) -> bool {
    let mut seen = [[0.0; 6]; 6]; // Σ rᵀr over held axes, r what they see of shifts and of turns (in units of a metre)
    let length = model.extent();
    for (node, (free, rest)) in model.free.iter().zip(&model.rest).enumerate() {
        let anchored = model.anchors.nodes.binary_search(&(node as u32)).is_ok();
        let at = (DVec3::from_array(*rest) - DVec3::from_array(model.position)) / length;
        for axis in (0..3).filter(|axis| anchored || free[*axis] == 0.0) {
            let shift = DVec3::AXES[axis];
            let turn = at.cross(shift);
            let row = [shift.x, shift.y, shift.z, turn.x, turn.y, turn.z];
            (0..36).for_each(|k| seen[k / 6][k % 6] += row[k / 6] * row[k % 6]);
        }
    }
    let largest = (0..6).map(|k| seen[k][k]).fold(0.0, f64::max);
    for k in 0..6 {
        // symmetric elimination, the largest pivot first
        let Some(pivot) = (k..6).max_by(|a, b| seen[*a][*a].total_cmp(&seen[*b][*b])) else { return true };
        if seen[pivot][pivot] <= NONE * largest {
            return true;
        }
        seen.swap(k, pivot);
        seen.iter_mut().for_each(|row| row.swap(k, pivot));
        for i in k + 1..6 {
            let factor = seen[i][k] / seen[k][k];
            (k..6).for_each(|j| seen[i][j] -= factor * seen[k][j]);
        }
    }
    false
}

/// What is near other bodies and where it is, of the present step: faces near each tool, each other deformable body, each wall.
#[derive(Default)]
pub(super) struct Located {
    pub faces: Vec<Vec<Quad>>,
    pub patches: Vec<Option<Patch>>,
    /// Nodes of the corners, ties and lips, and their displacements, m.
    pub nodes: Vec<u32>,
    pub u: Vec<[f64; 3]>,
    /// Nodes of the faces, and the places of the surface's corners there, m.
    pub corners: Vec<u32>,
    pub places: Vec<DVec3>,
}

impl Located {
    /// Place of the surface's corner at a node, if that was located, m.
    pub fn place(&self, node: u32) -> Option<DVec3> {
        self.corners.binary_search(&node).ok().map(|k| self.places[k])
    }

    /// Displacement of a node, 0 of one that was not read, m.
    fn displacement(&self, node: u32) -> [f64; 3] {
        self.nodes.binary_search(&node).map_or([0.0; 3], |k| self.u[k])
    }
}

/// How far a body may move in the first step by the velocity that it starts with, m.
pub(super) fn first_motion(scene: &Scene, number: usize) -> f64 {
    DVec3::from_array(scene.skins[number].velocity).length() * scene.time.part()
}

impl Body {
    /// Puts a scene's deformable body of that number on a device; none for the CPU path, in f64 or, if `single`, f32.
    ///
    /// # Errors
    /// When the model is too large.
    pub(super) fn new(scene: &Scene, number: usize, gpu: Option<&Arc<Gpu>>, single: bool) -> Result<Self> {
        let skin = &scene.skins[number];
        if let Some(gpu) = gpu {
            // a grid that does not fit is refused before the host spends minutes on it
            let [x, y] = skin.cells.map(|c| u64::from(c) + 1);
            let z: u64 = skin.layers.iter().map(|l| u64::from(l.cells)).sum();
            gpu.fits("x", x * y * (z + 1) * 16 * slots(scene) as u64)?;
        }
        let model = Model::new(scene, number)?;
        check_step(scene, &model)?;
        let needs = needs(scene, &model);
        let start = start(scene, &model);
        let (cap, floor) = (scene.solver.max_iterations, scene.solver.floor);
        let backend: Box<dyn Backend> = match gpu {
            Some(gpu) => Box::new(GpuBackend::new(gpu.clone(), &model, needs, cap, floor, &start)?),
            None if single => Box::new(CpuBackend::<f32>::new(&model, needs, cap, floor, &start)),
            None => Box::new(CpuBackend::<f64>::new(&model, needs, cap, floor, &start)),
        };
        let part = scene.time.part();
        let (fall, looseness) = match floats(&model) {
            true => (DVec3::from_array(scene.time.gravity).length() * part.powi(2), OF_FLOATING),
            false => (0.0, 1.0),
        };
        let wound = Wound::new(&model);
        Ok(Self {
            boxes: Boxes::new(&wound.surface),
            wound,
            compliance: Compliance::default(),
            at_rest: AtRest::default(),
            located: Located::default(),
            known: Known::default(),
            backend,
            travel: 0.0,
            first_motion: first_motion(scene, number),
            fall,
            loaded: false,
            looseness,
            near: needs.near,
            lips: scene.contact.is_some_and(|contact| contact.lips).then(Vec::new),
            tied: vec![],
            cuts: vec![],
            lost: false,
            model,
        })
    }

    /// What it runs on.
    pub fn device(&self) -> Device {
        self.backend.device()
    }

    /// The GPU that it runs on; none on the CPU path.
    pub fn gpu(&self) -> Option<&Gpu> {
        self.backend.gpu()
    }

    /// All its state.
    ///
    /// # Errors
    /// When the device fails.
    pub fn snapshot(&mut self) -> Result<Snapshot> {
        self.backend.snapshot()
    }

    /// Measures of its wound.
    pub fn totals(&self) -> Totals {
        self.wound.totals
    }

    /// Where the middle of its bottom is at rest, m.
    pub(super) fn place(&self) -> DVec3 {
        DVec3::from_array(self.model.position)
    }

    /// Fits the boxes of the broad phase to the body as it is.
    pub(super) fn refit_boxes(&mut self) -> Result<()> {
        self.read(Query { bounds: true, ..Query::default() })?;
        let bounds = self.known.bounds.as_deref().unwrap_or_default();
        let lost = self.boxes.refit(&self.wound.surface, bounds);
        let first = std::mem::replace(&mut self.first_motion, 0.0);
        self.travel = self.boxes.moved().max(first) + self.fall;
        self.lost = lost > 0;
        Ok(())
    }

    /// Box around the body, wider by a margin.
    pub(super) fn area(&self, margin: f64) -> Aabb {
        let [low, high] = self.boxes.all();
        collide::area(self.place() + low, self.place() + high, margin)
    }

    /// Faces that a box may meet.
    pub(super) fn faces_near(&self, area: &Aabb) -> Vec<Quad> {
        self.boxes.faces(&self.wound.surface, &collide::moved(area, -self.place()))
    }

    /// Finds where the corners of these faces, the nodes of the ties and of the wound's lips, are; the first `patched` lists of faces
    /// are made patches of, those that `about_centres` names of four triangles a face.
    pub(super) fn locate(&mut self, faces: Vec<Vec<Quad>>, patched: usize, about_centres: &[bool]) -> Result<()> {
        let mut corners: Vec<u32> = faces.iter().flatten().flat_map(|q| q.nodes).collect();
        corners.sort_unstable();
        corners.dedup();
        let surface = &self.wound.surface;
        let moving: Vec<Corner> = corners.iter().map(|n| surface.corner(*n as usize)).collect();
        let mut nodes = self.tied.clone();
        nodes.extend(self.lips.iter().flatten().flatten().flatten());
        nodes.extend(moving.iter().flat_map(|corner| corner.nodes));
        nodes.sort_unstable();
        nodes.dedup();
        self.read(Query { displacements: nodes.clone(), ..Query::default() })?;
        let u = nodes.iter().map(|node| self.known.u[node]).collect();
        self.located = Located { nodes, u, ..Located::default() };
        let place = |(node, corner): (&u32, &Corner)| {
            let moved = corner.moved(|id| self.located.displacement(id));
            [self.wound.rest[*node as usize], corner.offset, moved].map(DVec3::from_array).iter().sum()
        };
        self.located.places = corners.iter().zip(&moving).map(place).collect();
        self.located.corners = corners;
        let position = |id| self.position(id);
        let patch = |(k, faces): (usize, &Vec<Quad>)| match about_centres.get(k) {
            Some(true) => Patch::about_centres(faces, position),
            _ => Patch::new(faces, position),
        };
        self.located.patches = faces.iter().take(patched).enumerate().map(patch).collect();
        self.located.faces = faces;
        Ok(())
    }

    /// What the tissue of a cell bears of a blade.
    pub(super) fn resistance(&self, cell: u32) -> Resistance {
        let (model, layer) = (&self.model, self.model.layer(cell as usize));
        Resistance { edge: model.toughness[layer], splitting: model.splitting[layer], cell: model.cell_width() }
    }

    /// Where the surface's corner at a node that was located is, m: beside the node in a wound ([`crate::mesh::Corner`]).
    ///
    /// Rows act on the corner's own node. So what a step moves the corner by differs from what its rows say of it, by the offset times
    /// the gradient of the step's motion; the geometry is taken anew at each step, and the difference does not add up.
    pub(super) fn position(&self, node: u32) -> DVec3 {
        self.located.place(node).unwrap_or_else(|| self.node_position(node))
    }

    /// Where a node itself is, of one that was not read at rest, m.
    pub(super) fn node_position(&self, node: u32) -> DVec3 {
        DVec3::from_array(self.wound.rest[node as usize]) + DVec3::from_array(self.located.displacement(node))
    }

    /// Solves the free motion, with values at nodes.
    pub(super) fn solve_free(&mut self, solver: &Solver, nodes: &[u32]) -> Result<(Outcome, Vec<[f64; 3]>)> {
        let wanted = [Wanted { slot: FREE, target: Target::OfLoad(solver.tolerance) }];
        let pick: Vec<(usize, u32)> = nodes.iter().map(|n| (FREE, *n)).collect();
        let (outcomes, picked) = self.backend.solve(&wanted, &pick)?;
        // a solution with a number that is none has such a residual
        self.lost = !outcomes[0].residual.is_finite() || !picked.iter().flatten().all(|c| c.is_finite());
        Ok((outcomes[0], picked))
    }

    /// What the solves of a step have found together, `[node]` m.
    pub(super) fn increment(&mut self, corrected: bool) -> Result<Vec<V4<f64>>> {
        let mut dx = self.backend.solution(FREE)?;
        if corrected {
            refine::add(&mut dx, &self.backend.solution(CORRECTION)?, 1.0);
        }
        Ok(dx)
    }

    /// `[node]` dead loads at a time, N.
    pub(super) fn load_at(&self, scene: &Scene, time: f64) -> Vec<[f64; 3]> {
        self.model.load_on(&scene.loads, time, |cell| self.wound.surface.parts.corners(cell))
    }

    /// The same as the kernels' twins take them.
    fn padded_load_at(&self, scene: &Scene, time: f64) -> Vec<V4<f64>> {
        self.load_at(scene, time).iter().map(|l| [l[0], l[1], l[2], 0.0]).collect()
    }

    /// The step's equations for a check in f64, without their solution.
    pub(super) fn solved(&self, start: Snapshot, contact: &[(u32, [f64; 3])], scene: &Scene, time: f64) -> Solved {
        let mut forces = vec![[0.0; 4]; start.u.len()];
        for (node, [x, y, z]) in contact {
            forces[*node as usize] = [*x, *y, *z, 0.0];
        }
        Solved { start, load: self.padded_load_at(scene, time), contact: forces, dx: vec![] }
    }

    /// Refines and checks what a step has solved; `before` is the state at its start.
    pub(super) fn verify(
        &mut self,
        before: Snapshot,
        contact: Option<&[(u32, [f64; 3])]>,
        scene: &Scene,
        (time, check): (f64, bool),
        free: &mut Outcome,
        report: &mut StepReport,
    ) -> Result<()> {
        let corrected = contact.is_some();
        let refined = scene.solver.refinements > 0;
        let mut solved = self.solved(before, contact.unwrap_or_default(), scene, time);
        if check {
            let measured = Measured::of(&self.model, &solved.start, &solved.load);
            report.warn("inverted_cells", measured.inverted);
            report.warn("non_finite_energy", u32::from(!measured.energy.is_finite()));
            report.measured = Some(report.measured.unwrap_or_default().and(measured));
        }
        solved.dx = self.increment(corrected)?;
        if refined {
            self.refine(&mut solved, &scene.solver, corrected, free, report)?;
        }
        if check && refined {
            solved.dx = self.increment(corrected)?; // as the backend has rounded it
        }
        if check {
            let (rest, load) = residual(&self.model, &solved);
            let (left, wanted) = (norm(&rest), (scene.solver.tolerance * load).max(scene.solver.floor));
            report.warn("residual_true_above_tolerance", u32::from(larger(left, 2.0 * wanted) != 2.0 * wanted));
            let residual = if load == 0.0 { 0.0 } else { left / load };
            report.true_residual = Some(report.true_residual.map_or(residual, |worst| larger(worst, residual)));
        }
        Ok(())
    }
}

/// What the states of the deformable bodies amount to, together.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measured {
    /// Kinetic, elastic and potential, J ([`crate::bodies::energy`]).
    pub energy: f64,
    /// Cells that are inside out.
    pub inverted: u32,
}

impl Measured {
    /// Of one body.
    fn of(model: &Model, state: &Snapshot, load: &[V4<f64>]) -> Self {
        Self { energy: energy(model, state, load), inverted: inverted_cells(model, state) }
    }

    /// Both together.
    fn and(self, other: Self) -> Self {
        Self { energy: self.energy + other.energy, inverted: self.inverted + other.inverted }
    }
}

impl Simulation {
    /// What the deformable bodies amount to now, from their states.
    pub fn measure(&self, states: &[Snapshot]) -> Measured {
        let of = |(body, state): (&Body, &Snapshot)| {
            Measured::of(&body.model, state, &body.padded_load_at(&self.scene, self.time))
        };
        self.bodies.iter().zip(states).map(of).fold(Measured::default(), Measured::and)
    }
}
