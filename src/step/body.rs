//! Running deformable body: its model, its state on a backend, its wound and its compliance.

mod compliance;
mod known;
mod loose;
mod refine;
mod start;

pub use compliance::Compliance;
pub(super) use known::Known;
pub use start::{needs, start};

use super::in_full::NOT_IN_FULL;
use super::{Part, StepReport};
use crate::backend::{Backend, CORRECTION, Device, FREE, GpuBackend, Query, Snapshot, SolveRequest, Target, on_cpu};
use crate::bodies::{self, Equations, Model, Solved, Totals, Wound, law_residual, out_of_balance, residual};
use crate::collide::broad::Boxes;
use crate::collide::lips::Faces;
use crate::collide::{self, Aabb, Patch, Resistance};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::kernels::cut::Hit;
use crate::linear::Outcome;
use crate::math::{V4, larger, norm};
use crate::mesh::{Carved, Corner, Face, MaterialPoint};
use crate::scene::{Scene, Solver};
use compliance::AtRest;
pub(super) use compliance::{MOST_AT_ONCE, RestShape, Solving};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use start::{check_step, right_hand_sides};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

/// See the module.
pub struct Body {
    /// The constant arrays.
    pub model: Model,
    /// The wound: what has been cut so far.
    pub wound: Wound,
    pub(super) backend: Box<dyn Backend>,
    pub(super) compliance: Compliance,
    pub(super) at_rest: AtRest,
    pub(super) located: Located,
    /// What has been read of the present state.
    pub(super) known: Known,
    pub(super) boxes: Boxes,
    /// Bound on its motion in the present step: that of the last step plus the fall under gravity and the motion by its paths, m.
    pub(super) travel: f64,
    pub(super) first_motion: f64,
    fall: f64,
    /// Largest motion by its paths in the present step, m.
    driven: f64,
    /// Its loads are set on the present nodes.
    pub(super) loaded: bool,
    /// Accelerations of the nodes on paths over the present step, mass damping included, m/s².
    pub(super) accelerations: BTreeMap<u32, [f64; 3]>,
    /// Displacements of the nodes that follower pressures act on, at the start of the step, of one in full at its end, m.
    pub(super) pressed: BTreeMap<u32, [f64; 3]>,
    /// Its constraints leave a rigid-body mode free.
    pub(super) floats: bool,
    /// `[loose piece]` sum of its loads, N.
    loose_loads: Vec<DVec3>,
    /// `[loose piece]` sum of the contact forces that the initial guess of the correction has, N.
    pushed: Vec<DVec3>,
    /// Most nodes whose compliance is kept.
    pub(super) near: usize,
    /// Lips of its wound, if they may rest on each other.
    pub(super) lips: Option<Faces>,
    /// Nodes of the scene's attachments.
    pub(super) tied: Vec<u32>,
    /// Its cuts, in order; applied to the uncut body they give the wound.
    pub(super) cuts: Vec<Cut>,
    /// Its steps are solved in full ([`Scene::in_full`]).
    pub(super) in_full: bool,
    /// Its nodes, or the present step's solution for them, contain non-finite values.
    pub(super) non_finite: bool,
    /// `[node]` magnitude of the true residual of the last step, N, if that was checked; otherwise empty.
    pub(crate) residual: Vec<f64>,
}

/// Change of a body's cells.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) enum Cut {
    /// Hits of a blade's sweep.
    Swept(Vec<Hit<f64>>),
    /// Cells that a tool has carved.
    Carved(Vec<u32>),
    /// Space that a tool has carved.
    Space(Carved),
}

/// A floating body or piece resists a common push of its nodes by inertia alone, 10⁻³ to 10⁻⁵ of its stiffness, so the same residual is a share of
/// its motion larger by that much. With 1 the passes on a stack of five blocks never converge; with this factor one suffices.
const FLOATING_FACTOR: f64 = 1e-4;

/// Surroundings of the present step: faces near each tool, each other deformable body and each wall, and their positions.
#[derive(Default)]
pub(super) struct Located {
    pub faces: Vec<Vec<Face>>,
    pub patches: Vec<Option<Patch>>,
    /// Nodes of the corners, attachments and lips, with their displacements, m.
    pub nodes: Vec<u32>,
    pub u: Vec<[f64; 3]>,
    /// Nodes of the faces, with the positions of the surface corners there, m.
    pub corners: Vec<u32>,
    pub corner_positions: Vec<DVec3>,
}

impl Located {
    /// Position of the surface corner at a node, if it was located, m.
    pub fn corner_position(&self, node: u32) -> Option<DVec3> {
        self.corners.binary_search(&node).ok().map(|k| self.corner_positions[k])
    }

    /// Displacement of a node, m; 0 if it was not read.
    fn displacement(&self, node: u32) -> [f64; 3] {
        self.nodes.binary_search(&node).map_or([0.0; 3], |k| self.u[k])
    }
}

/// Motion of a body in the first step by its initial velocity, m.
pub(super) fn first_motion(scene: &Scene, number: usize) -> f64 {
    DVec3::from_array(scene.skins[number].velocity).length() * scene.time.part()
}

/// What pictures and files show of the cells.
#[cfg(feature = "program")]
impl Body {
    /// `[cell]` share of a cell's links or springs that are intact.
    pub(crate) fn alive_shares(&self) -> Vec<f64> {
        self.of_present(|cell| self.model.mechanics().alive_share(&self.model, &self.wound, cell))
    }

    /// `[cell]` factor on the stiffness of its layer, by inclusions.
    pub(crate) fn stiffness_factors(&self) -> Vec<f64> {
        self.of_present(|cell| self.model.mechanics().stiffness_factor(cell))
    }

    /// Values of the cells, or of the tetrahedra of a mesh, 0 for those that are gone.
    fn of_present(&self, of: impl Fn(usize) -> f64) -> Vec<f64> {
        let surface = &self.wound.surface;
        let here = if self.model.unstructured().is_some() { surface.present() } else { &surface.alive };
        here.iter().enumerate().map(|(cell, here)| if *here { of(cell) } else { 0.0 }).collect()
    }
}

impl Body {
    /// Puts deformable body `number` of a scene on a GPU; without one on the CPU path, in f64 or, if `single`, f32.
    ///
    /// # Errors
    /// When the model is too large or the step unstable.
    pub(super) fn new(scene: &Scene, number: usize, gpu: Option<&Arc<Gpu>>, single: bool) -> Result<Self> {
        let skin = &scene.skins[number];
        if let Some(gpu) = gpu {
            // refuse a grid that does not fit before the host spends minutes on it
            let [x, y] = skin.cells.map(|c| u64::from(c) + 1);
            let z: u64 = skin.layers.iter().map(|l| u64::from(l.cells)).sum();
            gpu.fits("x", x * y * (z + 1) * 16 * right_hand_sides(scene) as u64)?;
        }
        // model and initial state on the backend
        let model = Model::new(scene, number)?;
        check_step(scene, &model)?;
        let needs = needs(scene, &model);
        let start = start(scene, &model);
        let (cap, floor) = (scene.solver.max_iterations, scene.solver.floor);
        let backend: Box<dyn Backend> = match gpu {
            Some(gpu) => Box::new(GpuBackend::new(gpu.clone(), &model, needs, cap, floor, &start)?),
            None => on_cpu(single, &model, needs, cap, floor, &start),
        };
        // a floating body falls
        let part = scene.time.part();
        let floats = model.floats();
        let fall = if floats { DVec3::from_array(scene.time.gravity).length() * part.powi(2) } else { 0.0 };
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
            driven: 0.0,
            loaded: false,
            accelerations: BTreeMap::new(),
            pressed: BTreeMap::new(),
            floats,
            loose_loads: vec![],
            pushed: vec![],
            near: needs.near,
            in_full: needs.in_full,
            lips: scene.contact.is_some_and(|contact| contact.lips).then(Vec::new),
            tied: vec![],
            cuts: vec![],
            non_finite: false,
            residual: vec![],
            model,
        })
    }

    /// Device of its backend.
    pub fn device(&self) -> Device {
        self.backend.device()
    }

    /// GPU of its backend; none on the CPU path.
    pub fn gpu(&self) -> Option<&Gpu> {
        self.backend.gpu()
    }

    /// Reads its complete state.
    ///
    /// # Errors
    /// When the device fails.
    pub fn snapshot(&mut self) -> Result<Snapshot> {
        Ok(Snapshot { shares: self.wound.surface.shares(), ..self.backend.snapshot()? })
    }

    /// Totals of its wound.
    pub fn totals(&self) -> Totals {
        self.wound.totals
    }

    /// Centre of its bottom at rest, m.
    pub(super) fn origin(&self) -> DVec3 {
        DVec3::from_array(self.model.position)
    }

    /// Refits the boxes of the broad phase to the present positions.
    pub(super) fn refit_boxes(&mut self) -> Result<()> {
        self.read(Query { bounds: true, ..Query::default() })?;
        let bounds = self.known.bounds.as_deref().unwrap_or_default();
        let non_finite = self.boxes.refit(&self.wound.surface, bounds);
        let first = std::mem::replace(&mut self.first_motion, 0.0);
        self.travel = self.boxes.moved().max(first) + self.fall + self.driven;
        self.non_finite = non_finite > 0;
        Ok(())
    }

    /// Bounding box, enlarged by a margin.
    pub(super) fn area(&self, margin: f64) -> Aabb {
        let [low, high] = self.boxes.all();
        collide::area(self.origin() + low, self.origin() + high, margin)
    }

    /// Faces whose boxes a box meets.
    pub(super) fn faces_near(&self, area: &Aabb) -> Vec<Face> {
        self.boxes.faces(&self.wound.surface, &collide::moved(area, -self.origin()))
    }

    /// Finds the positions of these faces' corners, of attachments' nodes and of the wound's lips. The first `patched` lists of faces
    /// become patches; those marked in `about_centres` have four triangles per face.
    pub(super) fn locate(&mut self, faces: Vec<Vec<Face>>, patched: usize, about_centres: &[bool]) -> Result<()> {
        // corners of the faces, each once
        let mut corners: Vec<u32> = faces.iter().flatten().flat_map(|q| q.nodes).collect();
        corners.sort_unstable();
        corners.dedup();
        let surface = &self.wound.surface;
        let moving: Vec<Corner> = corners.iter().map(|n| surface.corner(*n as usize)).collect();
        // nodes to read: of attachments, lips and corners
        let mut nodes = self.tied.clone();
        nodes.extend(self.lips.iter().flatten().flat_map(|lip| &lip.cell).flatten());
        nodes.extend(moving.iter().flat_map(|corner| corner.nodes));
        nodes.sort_unstable();
        nodes.dedup();
        // displacements, velocities for the prediction of forces; then corner positions
        self.read(Query { displacements: nodes.clone(), velocities: nodes.clone(), ..Query::default() })?;
        let u = nodes.iter().map(|node| self.known.u[node]).collect();
        self.located = Located { nodes, u, ..Located::default() };
        let position = |(node, corner): (&u32, &Corner)| {
            let moved = corner.moved(|id| self.located.displacement(id));
            [self.wound.rest[*node as usize], corner.offset, moved].map(DVec3::from_array).iter().sum()
        };
        self.located.corner_positions = corners.iter().zip(&moving).map(position).collect();
        self.located.corners = corners;
        // patches of the first lists
        let position = |id| self.position(id);
        let patch = |(k, faces): (usize, &Vec<Face>)| match about_centres.get(k) {
            Some(true) => Patch::about_centres(faces, position),
            _ => Patch::new(faces, position),
        };
        self.located.patches = faces.iter().take(patched).enumerate().map(patch).collect();
        self.located.faces = faces;
        Ok(())
    }

    /// Resistance of a cell's tissue to a blade.
    pub(super) fn resistance(&self, cell: u32) -> Resistance {
        let (model, layer) = (&self.model, self.model.layer(cell as usize));
        Resistance { edge: model.toughness[layer], splitting: model.splitting[layer], cell: model.cell_width() }
    }

    /// Position of the surface corner at a node, m: in a wound it lies beside the node ([`crate::mesh::Corner`]). The node's own if not
    /// located.
    ///
    /// Rows act on the corner's own node. A step's motion of the corner therefore differs from that in its rows, by the offset times the
    /// gradient of the motion. The geometry is evaluated anew at each step, so the difference does not accumulate.
    pub(super) fn position(&self, node: u32) -> DVec3 {
        self.located.corner_position(node).unwrap_or_else(|| self.node_position(node))
    }

    /// Position of a node itself, m; at rest if it was not read.
    pub(super) fn node_position(&self, node: u32) -> DVec3 {
        DVec3::from_array(self.wound.rest[node as usize]) + DVec3::from_array(self.located.displacement(node))
    }

    /// Position of a material point by its nodes, m; they are at rest if they were not read.
    pub(super) fn position_of(&self, point: &MaterialPoint) -> DVec3 {
        point.0.iter().map(|(node, weight)| self.node_position(*node) * *weight).sum()
    }

    /// Solves the unconstrained motion under forces at nodes, N; returns its values at `nodes`. With what a solve of the step `before` has ended
    /// in, it goes on from there to the same residual.
    pub(super) fn solve_free(
        &mut self,
        solver: &Solver,
        before: Option<Outcome>,
        forces: &[(u32, [f64; 3])],
        nodes: &[u32],
        report: &mut StepReport,
    ) -> Result<(Outcome, Vec<[f64; 3]>)> {
        let clock = Instant::now();
        if !forces.is_empty() {
            self.backend.add_forces(forces)?;
        }
        let target = match before {
            // a body that was at rest had no load; now contact forces are
            Some(before) => {
                let pushed = forces.iter().map(|(_, f)| DVec3::from_array(*f).length_squared()).sum::<f64>().sqrt();
                Target::Absolute(before.target.max(solver.tolerance * pushed))
            }
            None => {
                self.guess_fall(forces)?;
                Target::OfLoad(solver.tolerance)
            }
        };
        let wanted = [SolveRequest { rhs: FREE, target }];
        let pick: Vec<(usize, u32)> = nodes.iter().map(|n| (FREE, *n)).collect();
        let (outcomes, picked) = self.backend.solve(&wanted, &pick)?;
        // a non-finite solution has a non-finite residual
        self.non_finite = !outcomes[0].residual.is_finite() || !picked.iter().flatten().all(|c| c.is_finite());
        report.costs.iterations += outcomes[0].iterations;
        report.costs.spend(Part::Free, clock);
        Ok((outcomes[0], picked))
    }

    /// Displacement increment of the step by all its solves, `[node]` m.
    pub(super) fn increment(&mut self, corrected: bool) -> Result<Vec<V4<f64>>> {
        let mut dx = self.backend.solution(FREE)?;
        if corrected {
            refine::add(&mut dx, &self.backend.solution(CORRECTION)?, 1.0);
        }
        Ok(dx)
    }

    /// `[node]` loads at a given time, with follower pressures on the shape that they were last set on, N.
    pub(super) fn load_at(&self, scene: &Scene, time: f64) -> Vec<[f64; 3]> {
        let displacement = |node: usize| self.pressed.get(&(node as u32)).copied().unwrap_or_default();
        self.model.load_on(&scene.loads, time, |cell| self.wound.surface.corners_of(cell), displacement)
    }

    /// Sets the load at a given time with follower pressures on the shape at the start of the step, or on that at its end by its solves
    /// (`end`: whether a correction is part of these). Changes nothing without such pressures, but for a load that is still to be set.
    pub(super) fn press(&mut self, scene: &Scene, time: f64, end: Option<bool>) -> Result<()> {
        let nodes = self.followed_nodes(scene, time);
        if !nodes.is_empty() {
            self.read(Query { displacements: nodes.clone(), ..Query::default() })?;
            let moved = end.map(|corrected| self.increment(corrected)).transpose()?;
            let by = |node: u32| moved.as_ref().map_or(DVec3::ZERO, |dx| DVec3::from_slice(&dx[node as usize]));
            let shape = |node: u32| (node, (DVec3::from_array(self.known.u[&node]) + by(node)).to_array());
            self.pressed = nodes.iter().map(|node| shape(*node)).collect();
        }
        if !nodes.is_empty() || !self.loaded {
            self.set_load(&self.load_at(scene, time));
            self.loaded = true;
        }
        Ok(())
    }

    fn followed_nodes(&self, scene: &Scene, time: f64) -> Vec<u32> {
        self.model.followed_nodes(&scene.loads, time, |cell| self.wound.surface.corners_of(cell))
    }

    /// Has the search for contacts reach as far as the paths move its nodes in a step.
    pub(super) fn drive(&mut self, scene: &Scene, [from, to]: [f64; 2]) {
        self.driven = self.model.driven(scene, from, to);
    }

    /// Starts a step that ends at a given time.
    pub(super) fn begin(&mut self, scene: &Scene, end: f64) -> Result<()> {
        self.backend.begin()?;
        if self.model.paths.nodes.is_empty() {
            return Ok(());
        }
        let (target, accelerations) =
            (self.model.prescribed_at(scene, end), self.model.driven_accelerations(scene, end));
        let (mut nodes, mut entries): (Vec<u32>, Vec<usize>) = (vec![], vec![]);
        for (entry, node) in self.model.paths.nodes.iter().enumerate() {
            nodes.push(*node);
            nodes.extend(self.wound.surface.copies(*node as usize));
            entries.resize(nodes.len(), entry);
        }
        let target: Vec<[f64; 3]> = entries.iter().map(|entry| target[*entry]).collect();
        self.accelerations = nodes.iter().zip(&entries).map(|(node, entry)| (*node, accelerations[*entry])).collect();
        // without a warm start the initial residual is what loads and paths drive, which the tolerance is relative to
        self.backend.reset_initial_guess(&[FREE])?;
        self.backend.prescribe(&nodes, &target)
    }

    /// Starts a step anew, without what its solves have found, with the loads of its start; it ends at `end`.
    pub(super) fn restart(&mut self, scene: &Scene, [loaded_at, end]: [f64; 2]) -> Result<()> {
        self.backend.reset_initial_guess(&[FREE])?;
        self.press(scene, loaded_at, None)?;
        self.begin(scene, end)
    }

    /// The same, padded for the kernels' twins.
    pub(super) fn padded_load_at(&self, scene: &Scene, time: f64) -> Vec<V4<f64>> {
        self.load_at(scene, time).iter().map(|l| [l[0], l[1], l[2], 0.0]).collect()
    }

    /// Equations of the step for a check in f64; `dx` is left empty.
    pub(super) fn solved(&self, start: Snapshot, contact: &[(u32, [f64; 3])], scene: &Scene, time: f64) -> Solved {
        let mut forces = vec![[0.0; 4]; start.u.len()];
        for (node, [x, y, z]) in contact {
            forces[*node as usize] = [*x, *y, *z, 0.0];
        }
        Solved { start, load: self.padded_load_at(scene, time), contact: forces, ..Solved::default() }
    }

    /// Forces out of balance at the present state under contact forces, relative to the largest ([`out_of_balance`]); 0 below the solver's
    /// floor.
    pub(super) fn out_of_balance(&mut self, contact: &[(u32, [f64; 3])], scene: &Scene, time: f64) -> Result<f64> {
        let state = self.snapshot()?;
        let at = |node: u32| [0, 1, 2].map(|n| state.u[node as usize][n]);
        self.pressed = self.followed_nodes(scene, time).into_iter().map(|node| (node, at(node))).collect();
        let (left, largest) = out_of_balance(&self.model, &self.solved(state, contact, scene, time));
        // where nothing loads the body, rounding is all that is left
        Ok(if left <= scene.solver.floor { 0.0 } else { left / largest })
    }

    /// Refines and checks the step's solution; `before` is the state at its start. Returns the energy that a checked step has damped, J.
    pub(super) fn verify(
        &mut self,
        before: Snapshot,
        contact: Option<&[(u32, [f64; 3])]>,
        scene: &Scene,
        (time, check): (f64, bool),
        free: &mut Outcome,
        report: &mut StepReport,
    ) -> Result<f64> {
        let corrected = contact.is_some();
        let refined = scene.solver.refinements > 0;
        let mut solved = self.solved(before, contact.unwrap_or_default(), scene, time);
        if self.in_full && !report.warnings.contains_key(NOT_IN_FULL) {
            solved.equations = Equations::InFull;
        }
        // iterative refinement
        solved.dx = self.increment(corrected)?;
        solved.elastic_at = self.backend.nonlinear().elastic_at;
        if refined {
            self.refine(&mut solved, &scene.solver, corrected, free, report)?;
        }
        if check && refined {
            solved.dx = self.increment(corrected)?; // as the backend has rounded it
        }
        // true residual and damping in f64
        let mut damped = 0.0;
        if check {
            damped = if self.model.damps() { bodies::damped(&self.model, &self.wound, &solved) } else { 0.0 };
            let (residual_force, load) = residual(&self.model, &solved);
            self.residual = residual_force.iter().map(|f| DVec3::from_slice(f).length()).collect();
            let (left, wanted) = (norm(&residual_force), (scene.solver.tolerance * load).max(scene.solver.floor));
            report.warn("residual_true_above_tolerance", u32::from(larger(left, 2.0 * wanted) != 2.0 * wanted));
            let residual = if load == 0.0 { 0.0 } else { left / load };
            report.true_residual = Some(report.true_residual.map_or(residual, |worst| larger(worst, residual)));
            // a load at the floor is rounding
            if scene.solver.tolerance * load > scene.solver.floor {
                report.law_residual = larger(report.law_residual, law_residual(&self.model, solved));
            }
        }
        Ok(damped)
    }
}
