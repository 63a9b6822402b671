//! Contact solve of a step: constraint rows, compliance `W`, forces and correction. [`passes`] has its passes.

mod passes;
mod points;

pub use points::{ContactPoint, PointKind};

use super::body::{MOST_AT_ONCE, Solving};
use super::in_full::{Next, add_up};
use super::rows::Rows;
use super::{Body, Part, Simulation, StepReport};
use crate::bodies::rigid::UnconstrainedMotion;
use crate::collide::Contact;
use crate::constraints::Law;
use crate::error::Result;
use crate::haptic::Reduced;
use crate::linear::Outcome;
use crate::scene::{self, BodyId, Correction, Loop};
use glam::{DMat3, DVec3};
use passes::Observation;
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// Contacts of a step and how their forces were solved for.
#[derive(Clone, Debug, Default)]
pub struct ContactReport {
    /// Contacts and the rows of attachments.
    pub contacts: Vec<Contact>,
    /// Faces that the broad phase gave to the narrow phase, over all pairs.
    pub candidates: usize,
    /// Largest amount by which a contact's gap is below its rest gap at the start of the step, m.
    pub depth: f64,
    /// Corrections solved.
    pub passes: u32,
    /// Relative change of the forces that one more pass would cause.
    pub residual: f64,
    /// Largest force change that one more projection would cause, with the violations after the correction, N.
    pub residual_n: f64,
    /// Largest violation of complementarity after the correction: penetration, slip of a sticking contact, m.
    pub residual_m: f64,
    /// The step was due ([`Simulation::finish_by`]) before its passes had converged, and what they leave can be felt.
    pub shortened: bool,
    /// Compliance columns solved.
    pub columns: u32,
    /// Most iterations of any batch of them.
    pub column_iterations: u32,
    /// `[contact]` forces along its axes, 0 along those without a row, N.
    pub forces: Vec<[f64; 3]>,
    /// `[contact]` displacement of the first body relative to the second in the step, m.
    pub slips: Vec<DVec3>,
    /// Force on each rigid body, N.
    pub on_tool: Vec<[f64; 3]>,
}

impl ContactReport {
    /// Number of contacts, constraints excluded.
    pub fn count(&self) -> usize {
        self.contacts.iter().filter(|c| !c.law.is_constraint()).count()
    }

    /// Largest force on a rigid body, N.
    pub fn largest_on_tools(&self) -> f64 {
        self.on_tool.iter().map(|force| DVec3::from_array(*force).length()).fold(0.0, f64::max)
    }

    /// Force on a body from another one, or from all, N.
    pub fn force(&self, on: BodyId, from: Option<BodyId>) -> DVec3 {
        let mut sum = DVec3::ZERO;
        for (c, along) in self.contacts.iter().zip(&self.forces) {
            let force = c.in_world(*along);
            for (side, sign) in [(0, 1.0), (1, -1.0)] {
                if c.on[side] == on && from.is_none_or(|from| c.on[1 - side] == from) {
                    sum += force * sign;
                }
            }
        }
        sum
    }
}

/// Forces at nodes of a deformable body, N.
pub(super) type NodeForces = Vec<(u32, [f64; 3])>;

/// Result of a step's solves, before the bodies accept it.
pub(super) struct Resolved {
    /// Solve of each deformable body's unconstrained motion.
    pub free: Vec<Outcome>,
    /// Forces at nodes of each deformable body; none without contact.
    pub forces: Option<Vec<NodeForces>>,
    /// Force of each contact by its id, N.
    pub contact_forces: BTreeMap<([BodyId; 2], usize), DVec3>,
}

/// The contact problem of a step.
struct Problem<'a> {
    pub law: scene::Contact,
    pub rows: Rows<'a>,
    pub laws: Vec<Law>,
    free: &'a [UnconstrainedMotion],
    /// `[body]` nodes that rows act on, sorted.
    nodes: Vec<Vec<u32>>,
    /// `[body][node]` inverse blocks of `A`, for the uncoupled correction.
    blocks: Vec<Vec<DMat3>>,
    /// `W` of the bodies' compliance columns, `[row × row]` m/N.
    pub columns: Vec<f64>,
    /// Observations of the passes so far.
    pub observations: Vec<Observation>,
    /// `W` of the columns, updated by the observations, m/N.
    pub w: Vec<f64>,
    /// `[row]` forces of the last step, as far as they are included, N.
    last: Vec<f64>,
    /// `[row]` forces in the solve of the unconstrained motion: predicted ones, those of the last step, of penalties, or zero; N.
    pub included: Vec<f64>,
    /// `[contact]` displacement of the first body relative to the second by that solve, m: without forces on rigid bodies, with the
    /// included ones on deformable bodies.
    free_slips: Vec<DVec3>,
    /// Norm of the step's load on the bodies, N, the largest over them; forces below a small share of it are negligible.
    pub load: f64,
}

impl Problem<'_> {
    /// Value at a node of a body's list; zero at other nodes, and without lists.
    fn at(&self, values: &[Vec<[f64; 3]>], body: usize, node: u32) -> DVec3 {
        let found = values.get(body).and_then(|values| Some(values[self.nodes[body].binary_search(&node).ok()?]));
        found.map_or(DVec3::ZERO, DVec3::from_array)
    }

    /// Motion of a rigid body without contact: translation and rotation.
    fn unconstrained(&self, number: usize) -> (DVec3, DVec3) {
        (self.free[number].translation, self.free[number].rotation)
    }

    /// `[contact]` slips of the step under forces, of which the included ones have moved the nodes and the rest moves them by `moved`, m.
    pub fn slips_after(&self, lambda: &[f64], moved: &[Vec<[f64; 3]>]) -> Vec<DVec3> {
        let displacements: Vec<(DVec3, DVec3)> = (0..)
            .zip(self.free)
            .map(|(number, free)| free.displacement_under(self.rows.on_rigid(number, lambda)))
            .collect();
        let slips = self.rows.slips(|number| displacements[number], |body, node| self.at(moved, body, node));
        self.free_slips.iter().zip(slips).map(|(free, slip)| *free + slip).collect()
    }
}

impl Simulation {
    /// Solves the unconstrained motion and the contact problem; with `reuse_forces`, forces are those of the last step and not solved for.
    pub(super) fn resolve(
        &mut self,
        law: scene::Contact,
        contacts: Vec<Contact>,
        free: &[UnconstrainedMotion],
        reuse_forces: bool,
        report: &mut StepReport,
    ) -> Result<Resolved> {
        let first = self.first_forces(&law, &contacts, reuse_forces);
        let mut problem = self.assemble(law, &contacts, free, &first, report)?;
        let iterates = law.forces == Loop::Constraints && !reuse_forces;
        let in_time = !self.deadline.excludes_pass(Instant::now(), Duration::ZERO);
        if iterates && in_time && law.correction == Correction::Exact {
            self.predict(&mut problem, report);
        }
        let clock = Instant::now();
        let mut ended = self.solve_unconstrained(&mut problem, None, report)?;
        let (of_step, at_first) = (ended.clone(), problem.included.clone());
        let ties = problem.laws.iter().any(Law::is_constraint);
        let mut changed = true; // by the last solve of the unconstrained motion
        let mut longest = Duration::ZERO;
        let (lambda, slips) = loop {
            let passes = report.contact.passes;
            let (lambda, slips) = match iterates {
                true => self.iterate(&mut problem, ties && changed, report)?,
                false => {
                    let moved = self.correct(&problem, &first, law.tolerance, report)?;
                    let slips = problem.slips_after(&first, &moved);
                    (first.clone(), slips)
                }
            };
            // in full: again with the defect that these forces leave
            longest = longest.max(clock.elapsed() / (1 + report.newton_iterations));
            let before = match self.next(changed || report.contact.passes > passes, true, longest, report)? {
                Next::End => break (lambda, slips),
                Next::Again => {
                    problem.included = lambda;
                    Some(&of_step[..])
                }
                Next::Linearised => {
                    problem.forget();
                    problem.included.clone_from(&at_first);
                    None
                }
            };
            let again = self.solve_unconstrained(&mut problem, before, report)?;
            changed = add_up(&mut ended, &again);
        };
        self.move_tools(&problem, &lambda, report);
        let clock = Instant::now();
        self.publish_reduced(&problem, &slips, &lambda);
        report.costs.spend(Part::HandOver, clock);
        let forces = (0..self.bodies.len()).map(|body| problem.rows.on_nodes(body, &lambda)).collect();
        let mut by_contact = problem.rows.by_contact(&lambda);
        let contact_forces = contacts.iter().zip(&by_contact).map(|(c, f)| (c.id(), c.in_world(*f))).collect();
        // ties come last; what they leave open, springs bear
        let solved = contacts.iter().zip(&slips).zip(&mut by_contact);
        for (tie, ((contact, slip), forces)) in self.ties.iter().rev().zip(solved.rev()) {
            tie.add_spring(contact, *slip, forces);
        }
        report.contact.slips = slips;
        report.contact.contacts = contacts;
        report.contact.forces = by_contact;
        Ok(Resolved { free: ended, forces: Some(forces), contact_forces })
    }

    /// Assembles rows and `W`, with the compliance columns that are missing.
    fn assemble<'a>(
        &mut self,
        law: scene::Contact,
        contacts: &'a [Contact],
        free: &'a [UnconstrainedMotion],
        first: &[f64],
        report: &mut StepReport,
    ) -> Result<Problem<'a>> {
        let rows = Rows::new(contacts, &self.tools);
        let included = match law.correction {
            Correction::Exact => first.to_vec(),
            _ => vec![0.0; first.len()],
        };
        // nodes of each body, and its compliance at them
        let (mut nodes, mut blocks) = (vec![], vec![]);
        let solving = self.solving(&law);
        for (number, body) in self.bodies.iter_mut().enumerate() {
            let own = rows.nodes(number);
            blocks.push(body.prepare_compliance(&law, &own, solving, report)?);
            nodes.push(own);
        }
        // the problem, with the columns that there are
        let laws = contacts.iter().map(|c| c.law).collect();
        let mut problem = Problem {
            law,
            rows,
            laws,
            free,
            nodes,
            blocks,
            columns: vec![],
            observations: vec![],
            w: vec![],
            last: included.clone(),
            included,
            free_slips: vec![],
            load: 0.0,
        };
        let clock = Instant::now();
        problem.columns = self.compliance_of(&problem);
        problem.w.clone_from(&problem.columns);
        report.costs.spend(Part::Laws, clock);
        Ok(problem)
    }

    /// Predicts the step's forces before any body is solved for, by `W` and the motion that nodes keep under constant forces
    /// ([`Simulation::kept`]): the hands' motion, which is known, changes the forces most. With the prediction in the solve of the
    /// unconstrained motion, what is left for the corrections is its error. Where the laws cannot be solved for quickly, and with attachments,
    /// whose forces follow the bodies' own motion more than any hand's, the forces of the last step stay. (Sheets tied to each other used up
    /// their passes.)
    ///
    /// Passes and iterations per step with the forces of the last step and with the prediction: incision 1.9 and 7.0, 1.7 and 6.4;
    /// needle_press 0.7 and 5.1, 0.5 and 3.8; dental_probe 1.1 and 6.5, 0.8 and 5.4; nodule 3.0 and 17.8, 2.3 and 13.4; incision_shapes 2.3 and
    /// 18.9, 2.1 and 17.8.
    fn predict(&self, problem: &mut Problem, report: &mut StepReport) {
        if problem.laws.iter().any(Law::is_constraint) {
            return;
        }
        let keeps = |body: usize, node: u32| {
            let known = &self.bodies[body].known;
            debug_assert!(known.v.contains_key(&node), "the search has read the velocities of all nodes of contacts");
            DVec3::from_array(known.moved(node as usize)[1].f64()) * self.kept(body, node)
        };
        problem.free_slips = problem.rows.slips(|number| problem.unconstrained(number), keeps).collect();
        let found = problem.rows.violations(&problem.slips_after(&problem.included, &[]));
        problem.predict(&found, &mut report.costs);
    }

    /// Solves the unconstrained motion under the included forces; finds the slips by it. With what the solves `before` ended in, they go on from
    /// there to the same residuals.
    ///
    /// What is left for the corrections is the change of the forces from the included ones, a small part of them.
    fn solve_unconstrained(
        &mut self,
        problem: &mut Problem,
        before: Option<&[Outcome]>,
        report: &mut StepReport,
    ) -> Result<Vec<Outcome>> {
        let (mut ended, mut picked) = (vec![], vec![]);
        for (number, body) in self.bodies.iter_mut().enumerate() {
            let forces = problem.rows.on_nodes(number, &problem.included);
            let before = before.map(|before| before[number]);
            let (outcome, values) =
                body.solve_free(&self.scene.solver, before, &forces, &problem.nodes[number], report)?;
            body.reset_correction()?;
            ended.push(outcome);
            picked.push(values);
        }
        let clock = Instant::now();
        problem.load = ended.iter().map(|e| e.target / self.scene.solver.tolerance).fold(0.0, f64::max);
        let moved = |body: usize, node: u32| problem.at(&picked, body, node);
        problem.free_slips = problem.rows.slips(|number| problem.unconstrained(number), moved).collect();
        report.costs.spend(Part::Laws, clock);
        Ok(ended)
    }

    /// How a step solves columns: the first one all, since attachments are there from the start; one with a deadline has time for few.
    fn solving(&self, law: &scene::Contact) -> Solving {
        let all = self.step_number == 1;
        let at_once = if self.deadline.is_set() && !all { 1 } else { MOST_AT_ONCE };
        Solving { tolerance: law.column_tolerance, at_once, all }
    }

    /// `W` of the bodies' present compliance.
    fn compliance_of(&self, problem: &Problem) -> Vec<f64> {
        let correction = problem.law.correction;
        let among = |(body, nodes): (&Body, &Vec<u32>)| match correction {
            Correction::Exact => body.compliance.positive(nodes),
            _ => vec![],
        };
        let among: Vec<Vec<DMat3>> = self.bodies.iter().zip(&problem.nodes).map(among).collect();
        let between = |body: usize, i: usize, j: usize| {
            let nodes = &problem.nodes[body];
            match correction {
                Correction::Exact => among[body][i * nodes.len() + j],
                Correction::Precomputed => self.bodies[body].at_rest.block(nodes[i], nodes[j]),
                Correction::Uncoupled if i == j => problem.blocks[body][i],
                Correction::Uncoupled => DMat3::ZERO,
            }
        };
        problem.rows.compliance(&problem.nodes, &between, problem.free)
    }

    /// Initial forces: those of the last step, by contact id. The penalty loop's forces are final, unless those of the last step are
    /// reused (`reuse_forces`).
    fn first_forces(&self, law: &scene::Contact, contacts: &[Contact], reuse_forces: bool) -> Vec<f64> {
        let forces = if reuse_forces { Loop::Constraints } else { law.forces };
        let mut out = vec![];
        for contact in contacts {
            let along = match forces {
                Loop::Penalty(stiffness) if contact.law.is_constraint() => contact.gap.map(|gap| -stiffness * gap),
                Loop::Penalty(stiffness) => [stiffness * (-contact.gap[0]).max(0.0), 0.0, 0.0],
                Loop::Constraints => {
                    let last = self.last_forces.get(&contact.id()).copied().unwrap_or_default();
                    contact.axes.map(|axis| axis.dot(last))
                }
            };
            out.extend(&along[..contact.law.rows()]);
        }
        out
    }

    /// Displacement of the rows' nodes under contact forces beyond the included ones, `[body][node]` m, solved to a share of the forces;
    /// the backends keep the correction of all nodes.
    fn correct(
        &mut self,
        problem: &Problem,
        lambda: &[f64],
        share: f64,
        report: &mut StepReport,
    ) -> Result<Vec<Vec<[f64; 3]>>> {
        let tolerance = self.scene.solver.tolerance.min(share);
        let change = passes::less(lambda, &problem.included);
        let mut out = vec![];
        for (number, body) in self.bodies.iter_mut().enumerate() {
            let (nodes, forces) = (&problem.nodes[number], problem.rows.on_nodes(number, &change));
            let size = |lambda: &[f64]| problem.rows.norm_on_nodes(number, lambda);
            let scale = size(lambda).max(size(&problem.last));
            out.push(match problem.law.correction {
                Correction::Uncoupled => {
                    let force = |n: &u32| forces.binary_search_by_key(n, |f| f.0).map_or([0.0; 3], |k| forces[k].1);
                    let blocks = problem.blocks[number].iter();
                    let moved = nodes.iter().zip(blocks).map(|(n, m)| (*m * DVec3::from_array(force(n))).to_array());
                    let moved: Vec<[f64; 3]> = moved.collect();
                    let list: Vec<_> = nodes.iter().copied().zip(moved.iter().copied()).collect();
                    body.backend.set_correction(&list)?;
                    moved
                }
                _ => body.correct(nodes, &forces, tolerance * scale, report)?,
            });
            body.non_finite |= !out[number].iter().flatten().all(|c| c.is_finite());
        }
        Ok(out)
    }

    fn move_tools(&mut self, problem: &Problem, lambda: &[f64], report: &mut StepReport) {
        let h = self.step_size();
        for (number, (tool, free)) in self.tools.iter_mut().zip(problem.free).enumerate() {
            let (force, torque) = problem.rows.on_rigid(number, lambda);
            let (translation, rotation) = free.displacement_under((force, torque));
            tool.advance(free.translation + translation, free.rotation + rotation, h);
            report.contact.on_tool.push(force.to_array());
        }
    }

    /// Share of a held body's displacement in a step that the next one repeats under constant forces. It creeps by its viscosity alone: `K x + τ K ẋ = f` in implicit Euler has `Δx' = τ/(τ + h) Δx`, τ the
    /// Rayleigh stiffness damping.
    fn repeats(&self, body: usize) -> f64 {
        let viscosity = self.scene.skins[body].rayleigh_stiffness;
        viscosity / (viscosity + self.step_size())
    }

    /// Displacement that a deformable body's node keeps in a step under constant forces, per velocity, s.
    fn kept(&self, body: usize, node: u32) -> f64 {
        let h = self.step_size();
        match (h.is_finite(), self.bodies[body].falls(node)) {
            (true, true) => h,
            (true, false) => h * self.repeats(body),
            (false, _) => 0.0,
        }
    }

    /// Rate at which the relative motion of a step continues under constant forces, 1/s. A rigid body keeps its velocity.
    fn extrapolation_rate(&self, on: [BodyId; 2]) -> f64 {
        let ratio = |who: &BodyId| match who {
            BodyId::Deformable(body) => self.repeats(*body),
            _ => 1.0,
        };
        on.iter().map(ratio).fold(1.0, f64::min) / self.step_size()
    }

    /// Publishes the reduced contact problem of each tool to the haptic loop.
    fn publish_reduced(&mut self, problem: &Problem, slips: &[DVec3], lambda: &[f64]) {
        let rows = &problem.rows;
        let found = rows.violations(slips);
        let count = rows.count();
        for (number, tool) in self.tools.iter().enumerate() {
            // rows of this tool, with its sign in each
            let sides: Vec<(usize, f64)> = (0..count)
                .filter_map(|row| rows.side(row, BodyId::Rigid(number)).map(|(sign, _)| (row, sign)))
                .collect();
            // sticking and cutting restart at the end of the step; gaps continue
            let remaining = |row: usize| match rows.contact(row) {
                (Contact { law: Law::Coulomb { .. }, .. }, 0) => found[row],
                // an edge that has retreated advances freely up to its front
                (Contact { law: Law::Cut { .. }, .. }, 0) => found[row].max(0.0),
                _ => 0.0,
            };
            // displacement of the tool over the step
            let free = &problem.free[number];
            let (translation, rotation) = free.displacement_under(rows.on_rigid(number, lambda));
            let motion = [free.translation + translation, free.rotation + rotation];
            // the gap's motion beyond the tool's own continues; a cutting edge does not follow the skin's motion
            let rate = |row: usize| match (rows.contact(row), rows.of_rigid(row, number)) {
                ((contact @ Contact { law: Law::Coulomb { .. }, .. }, along), Some((axis, angular))) => {
                    let opened = found[row] - contact.gap[along] - axis.dot(motion[0]) - angular.dot(motion[1]);
                    self.extrapolation_rate(contact.on) * opened
                }
                _ => 0.0,
            };
            // compliance without the tool's own part
            let compliance = |i: usize, j: usize| problem.columns[i * count + j] - rows.rigid_part(i, j, number, free);
            let touching = rows.contacts.iter().filter(|contact| contact.on.contains(&BodyId::Rigid(number)));
            self.reduced[number] = Reduced {
                position: tool.position,
                rotation: tool.rotation,
                axes: sides.iter().map(|(row, sign)| rows.axis(*row) * *sign).collect(),
                arms: sides.iter().map(|(row, _)| rows.arm_of(*row, number)).collect(),
                laws: touching.map(|contact| contact.law).collect(),
                compliance: sides
                    .iter()
                    .flat_map(|(i, _)| sides.iter().map(move |(j, _)| compliance(*i, *j)))
                    .collect(),
                violation: sides.iter().map(|(row, _)| remaining(*row)).collect(),
                rate: sides.iter().map(|(row, _)| rate(*row)).collect(),
                force: sides.iter().map(|(row, _)| lambda[*row]).collect(),
                epoch: self.epoch,
            };
        }
    }
}
