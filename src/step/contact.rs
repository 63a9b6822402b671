//! The contact part of a step: rows, compliance `W`, forces, correction and its passes.

use super::rows::{Rows, energy, in_world};
use super::{Simulation, StepReport};
use crate::collide::Contact;
use crate::constraints::{self, Law, solve};
use crate::error::Result;
use crate::haptic::Reduced;
use crate::instrument::Free;
use crate::linear::Outcome;
use crate::scene::{self, Correction, Loop, Who};
use glam::{DMat3, DVec3};
use std::collections::BTreeMap;

/// Contacts of a step and how their forces were found.
#[derive(Clone, Debug, Default)]
pub struct ContactReport {
    /// What touched and what was tied.
    pub contacts: Vec<Contact>,
    /// Faces that the broad phase gave to the narrow phase, over all pairs.
    pub candidates: usize,
    /// Most that a contact's gap is below its resting gap at the step's start, m.
    pub depth: f64,
    /// Corrections solved.
    pub passes: u32,
    /// Relative change of the forces that one more pass would make.
    pub residual: f64,
    /// Largest change of a force that one more projection would make, the violations as they are after the correction, N.
    pub residual_n: f64,
    /// Largest violation of complementarity then: penetration, and slip of what should stick, m.
    pub residual_m: f64,
    /// Compliance columns solved.
    pub columns: u32,
    /// Largest iterations over them.
    pub column_iterations: u32,
    /// `[contact × 3]` N
    pub forces: Vec<f64>,
    /// `[contact]` how far the first body has moved over the second in the step, m.
    pub slips: Vec<DVec3>,
    /// Force on each rigid body, N.
    pub on_tool: Vec<[f64; 3]>,
}

impl ContactReport {
    /// Contacts, ties left out.
    pub fn count(&self) -> usize {
        self.contacts.iter().filter(|c| !matches!(c.law, Law::Hold { .. })).count()
    }

    /// Force on a body from another, or from all, N.
    pub fn force(&self, on: Who, from: Option<Who>) -> DVec3 {
        let mut sum = DVec3::ZERO;
        for (c, f) in self.contacts.iter().zip(self.forces.chunks_exact(3)) {
            let force = c.axes[0] * f[0] + c.axes[1] * f[1] + c.axes[2] * f[2];
            for (side, sign) in [(0, 1.0), (1, -1.0)] {
                if c.on[side] == on && from.is_none_or(|from| c.on[1 - side] == from) {
                    sum += force * sign;
                }
            }
        }
        sum
    }
}

/// Gauss–Seidel sweeps per contact solve at most, and the relative residuals that are wanted and enough. With 1e-5 wanted, two kilograms
/// on a gram jump by 3 % of their weight; friction on redundant contacts does not always end at 1e-8, nor do pieces of an edge that share
/// nodes end at 1e-5. What is enough is a tenth of the least tolerance of the passes that scenes take.
const MAX_SWEEPS: u32 = 10_000;
const SWEEP_TOLERANCES: [f64; 2] = [1e-8, 1e-4];

/// Share of their tolerance that columns are solved to where the laws have no solution on what they make up together.
const FINER: f64 = 0.01;

/// A pass that leaves more than this share of the last one's residual shows that the compliance has aged too much.
const SLOW: f64 = 0.5;

/// Forces on nodes of a deformable body, N.
pub(super) type NodeForces = Vec<(u32, [f64; 3])>;

/// What a step's solves have found, before the bodies take it over.
pub(super) struct Resolved {
    /// How the free motion of each deformable body was solved.
    pub free: Vec<Outcome>,
    /// Forces on nodes of each deformable body; none where nothing touches.
    pub forces: Option<Vec<NodeForces>>,
    /// Force of each contact by its name, N.
    pub contact_forces: BTreeMap<([Who; 2], usize), DVec3>,
}

/// The contact problem of a step.
struct Problem<'a> {
    law: scene::Contact,
    rows: Rows<'a>,
    laws: Vec<Law>,
    free: &'a [Free],
    /// `[body]` nodes that rows act on, sorted.
    nodes: Vec<Vec<u32>>,
    /// `[body][node]` inverse blocks of `A`, for the uncoupled correction.
    blocks: Vec<Vec<DMat3>>,
    /// `[row × row]` m/N
    w: Vec<f64>,
    /// `[row]` at the free positions, m.
    violation: Vec<f64>,
    /// What the step's forces on the bodies amount to, N: forces of a share of it are as good as none.
    load: f64,
}

impl Problem<'_> {
    /// Value of a node in a body's list.
    fn at(&self, values: &[Vec<[f64; 3]>], body: usize, node: u32) -> DVec3 {
        let found = self.nodes[body].binary_search(&node);
        found.map_or(DVec3::ZERO, |k| DVec3::from_array(values[body][k]))
    }

    /// Violations once forces have moved nodes by `moved` and rigid bodies by what they give.
    fn after(&self, lambda: &[f64], moved: &[Vec<[f64; 3]>]) -> Vec<f64> {
        let given: Vec<(DVec3, DVec3)> =
            (0..).zip(self.free).map(|(number, free)| free.gives(self.rows.on_rigid(number, lambda))).collect();
        let opening = |row| self.rows.opening(row, |number| given[number], |body, node| self.at(moved, body, node));
        self.violation.iter().enumerate().map(|(row, v)| v + opening(row)).collect()
    }

    /// Violations without force, by the model `W`, of those `found` under `lambda`.
    fn without_force(&self, found: &[f64], lambda: &[f64]) -> Vec<f64> {
        let product = |line: &[f64]| line.iter().zip(lambda).map(|(w, l)| w * l).sum::<f64>();
        found.iter().zip(self.w.chunks_exact(lambda.len())).map(|(f, line)| f - product(line)).collect()
    }

    /// Forces that the laws ask for where the violations are `found` under `lambda`, by the model `W`: the violations without force,
    /// the relative change of the forces (in the energy's norm: redundant contacts may share a force in many ways, which means
    /// nothing; 0 where it is a negligible share of the step's load), and whether the solve converged.
    fn judge(&self, found: &[f64], lambda: &[f64]) -> (Vec<f64>, f64, bool) {
        let shifted = self.without_force(found, lambda);
        let mut next = lambda.to_vec();
        let ended = solve(&self.laws, &self.w, &shifted, &mut next, SWEEP_TOLERANCES, MAX_SWEEPS);
        let change: Vec<f64> = next.iter().zip(lambda).map(|(a, b)| a - b).collect();
        let total = energy(&self.w, lambda);
        let negligible = change.iter().all(|c| c.abs() <= self.law.tolerance * self.load);
        let size = if total > 0.0 && !negligible { (energy(&self.w, &change) / total).sqrt() } else { 0.0 };
        (shifted, size, ended.converged)
    }
}

impl Simulation {
    /// Solves free motion and contact together; with `held` forces are those of the last step, and not solved for.
    pub(super) fn resolve(
        &mut self,
        law: scene::Contact,
        contacts: Vec<Contact>,
        free: &[Free],
        held: bool,
        report: &mut StepReport,
    ) -> Result<Resolved> {
        let (mut problem, ended) = self.pose(law, &contacts, free, report)?;
        let mut lambda = self.first_forces(&problem, held);
        let (found, shifted) = match law.forces {
            Loop::Constraints if !held => self.close(&mut problem, &mut lambda, report)?,
            _ => {
                let moved = self.correct(&problem, &lambda, report)?;
                (problem.after(&lambda, &moved), problem.violation.clone())
            }
        };
        if law.forces == Loop::Constraints {
            let left = constraints::residual(&problem.laws, &problem.w, &shifted, &lambda);
            (report.contact.residual_n, report.contact.residual_m) = (left.force, left.gap);
            report.warn("contact_rows_dropped", left.dropped);
        }
        self.move_tools(&problem, &lambda, report);
        self.hand_over(&problem, &found, &lambda);
        let forces = (0..self.bodies.len()).map(|body| problem.rows.on_nodes(body, &lambda)).collect();
        let contact_forces =
            contacts.iter().zip(lambda.chunks_exact(3)).map(|(c, f)| (c.id(), in_world(c, f))).collect();
        report.contact.slips = contacts
            .iter()
            .zip(found.chunks_exact(3))
            .map(|(c, f)| in_world(c, &[f[0] - c.gap[0], f[1] - c.gap[1], f[2] - c.gap[2]]))
            .collect();
        report.contact.contacts = contacts;
        report.contact.forces = lambda;
        Ok(Resolved { free: ended, forces: Some(forces), contact_forces })
    }

    /// Free motion, the compliance of what rows newly act on, and the violations.
    fn pose<'a>(
        &mut self,
        law: scene::Contact,
        contacts: &'a [Contact],
        free: &'a [Free],
        report: &mut StepReport,
    ) -> Result<(Problem<'a>, Vec<Outcome>)> {
        let rows = Rows::new(contacts, &self.tools);
        let mut nodes = vec![];
        let (mut ended, mut picked, mut blocks) = (vec![], vec![], vec![]);
        for (number, body) in self.bodies.iter_mut().enumerate() {
            let own = rows.nodes(number);
            let (outcome, values) = body.solve_free(&self.scene.solver, &own)?;
            ended.push(outcome);
            picked.push(values);
            blocks.push(body.give(&law, &own, report)?);
            nodes.push(own);
        }
        let laws = contacts.iter().map(|c| c.law).collect();
        let load = ended.iter().map(|e| e.target / self.scene.solver.tolerance).fold(0.0, f64::max);
        let mut problem = Problem { law, rows, laws, free, nodes, blocks, w: vec![], violation: vec![], load };
        problem.w = self.compliance_of(&problem);
        problem.violation = (0..problem.rows.count())
            .map(|row| {
                let rigid = |number: usize| (free[number].shift, free[number].turn);
                let gap = contacts[row / 3].gap[row % 3];
                gap + problem.rows.opening(row, rigid, |body, node| problem.at(&picked, body, node))
            })
            .collect();
        Ok((problem, ended))
    }

    /// `W` as the bodies know it now.
    fn compliance_of(&self, problem: &Problem) -> Vec<f64> {
        let between = |body: usize, a: u32, b: u32| match problem.law.correction {
            Correction::Exact => self.bodies[body].compliance.between(a, b),
            Correction::Precomputed => self.bodies[body].at_rest.between(a, b),
            Correction::Uncoupled => match problem.nodes[body].binary_search(&a) {
                Ok(k) if a == b => problem.blocks[body][k],
                _ => DMat3::ZERO,
            },
        };
        problem.rows.compliance(&between, problem.free)
    }

    /// Where the solve starts: the last step's forces of contacts that are still there; or all that there is to the penalty loop, unless
    /// the last step's are to be `held`.
    fn first_forces(&self, problem: &Problem, held: bool) -> Vec<f64> {
        let forces = if held { Loop::Constraints } else { problem.law.forces };
        let mut out = vec![];
        for contact in problem.rows.contacts {
            out.extend(match (forces, contact.law) {
                (Loop::Penalty(stiffness), Law::Hold { held }) => {
                    [0, 1, 2].map(|k| if held[k] { -stiffness * contact.gap[k] } else { 0.0 })
                }
                (Loop::Penalty(stiffness), _) => [stiffness * (-contact.gap[0]).max(0.0), 0.0, 0.0],
                (Loop::Constraints, _) => {
                    let last = self.last_forces.get(&contact.id()).copied().unwrap_or_default();
                    contact.axes.map(|axis| axis.dot(last))
                }
            });
        }
        out
    }

    /// Forces, correction, passes: until the laws hold on the true violations. Returns these, and those without force.
    fn close(
        &mut self,
        problem: &mut Problem,
        lambda: &mut [f64],
        report: &mut StepReport,
    ) -> Result<(Vec<f64>, Vec<f64>)> {
        let law = problem.law;
        let mut shifted = problem.violation.clone();
        let mut last: Option<Vec<f64>> = None; // violations under `lambda`, after a pass
        loop {
            let start = lambda.to_vec();
            let mut ended = solve(&problem.laws, &problem.w, &shifted, lambda, SWEEP_TOLERANCES, MAX_SWEEPS);
            if !ended.converged && self.renew(problem, FINER, report)? {
                // columns of different age, or loose ones of nodes that hardly differ, need not make a compliance together
                lambda.copy_from_slice(&start);
                if let Some(found) = &last {
                    shifted = problem.without_force(found, lambda);
                }
                ended = solve(&problem.laws, &problem.w, &shifted, lambda, SWEEP_TOLERANCES, MAX_SWEEPS);
            }
            report.warn("contact_not_converged", u32::from(!ended.converged));
            report.contact.passes += 1;
            let moved = self.correct(problem, lambda, report)?;
            // violations as they are now, then what the compliance model leaves unexplained
            let found = problem.after(lambda, &moved);
            let before = report.contact.residual;
            let (mut left, mut size, settled) = problem.judge(&found, lambda);
            let slow = report.contact.passes > 1 && size > SLOW * before;
            if size > law.tolerance && (slow || !settled) && self.aged(law) && self.renew(problem, 1.0, report)? {
                (left, size, _) = problem.judge(&found, lambda);
            }
            (shifted, report.contact.residual) = (left, size);
            if size <= law.tolerance || law.correction != Correction::Exact {
                return Ok((found, shifted));
            }
            if report.contact.passes >= law.max_passes {
                report.warn("contact_passes_exhausted", 1);
                return Ok((found, shifted));
            }
            last = Some(found);
        }
    }

    /// Whether columns of earlier steps are in use.
    fn aged(&self, law: scene::Contact) -> bool {
        law.correction == Correction::Exact && self.bodies.iter().any(|b| b.compliance.aged())
    }

    /// Solves all columns anew, to a share of the scene's tolerance; false where there are none.
    fn renew(&mut self, problem: &mut Problem, share: f64, report: &mut StepReport) -> Result<bool> {
        if problem.law.correction != Correction::Exact {
            return Ok(false);
        }
        for body in &mut self.bodies {
            let tolerance = problem.law.column_tolerance * body.looseness * share;
            body.compliance.renew(body.backend.as_mut(), tolerance, report)?;
        }
        problem.w = self.compliance_of(problem);
        Ok(true)
    }

    /// How far forces move the nodes that rows act on, `[body][node]` m; the backends keep the whole correction.
    fn correct(&mut self, problem: &Problem, lambda: &[f64], report: &mut StepReport) -> Result<Vec<Vec<[f64; 3]>>> {
        let tolerance = self.scene.solver.tolerance.min(problem.law.tolerance);
        let mut out = vec![];
        for (number, body) in self.bodies.iter_mut().enumerate() {
            let (nodes, forces) = (&problem.nodes[number], problem.rows.on_nodes(number, lambda));
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
                _ => body.correct(nodes, &forces, tolerance, report)?,
            });
            body.lost |= !out[number].iter().flatten().all(|c| c.is_finite());
        }
        Ok(out)
    }

    fn move_tools(&mut self, problem: &Problem, lambda: &[f64], report: &mut StepReport) {
        let h = self.step_size();
        for (number, (tool, free)) in self.tools.iter_mut().zip(problem.free).enumerate() {
            let (force, torque) = problem.rows.on_rigid(number, lambda);
            let (shift, turn) = free.gives((force, torque));
            tool.advance(free.shift + shift, free.turn + turn, h);
            report.contact.on_tool.push(force.to_array());
        }
    }

    /// How fast what one of two bodies has moved by in a step goes on under held forces, per s. What is rigid keeps its motion; skin creeps on
    /// by its viscosity alone: `K x + τ K ẋ = f` in implicit Euler has `Δx' = τ/(τ + h) Δx`, τ the Rayleigh damping by stiffness.
    fn goes_on(&self, on: [Who; 2]) -> f64 {
        let h = self.step_size();
        let memory = |who: &Who| match who {
            Who::Skin(body) => {
                let viscosity = self.scene.skins[*body].rayleigh_stiffness;
                viscosity / (viscosity + h)
            }
            _ => 1.0,
        };
        on.iter().map(memory).fold(1.0, f64::min) / h
    }

    /// The reduced contact problem of each tool, for the haptic side.
    fn hand_over(&mut self, problem: &Problem, found: &[f64], lambda: &[f64]) {
        let (rows, laws) = (&problem.rows, &problem.laws);
        let count = rows.count();
        for (number, tool) in self.tools.iter().enumerate() {
            let sides: Vec<(usize, f64)> =
                (0..count).filter_map(|row| rows.side(row, Who::Rigid(number)).map(|(sign, _)| (row, sign))).collect();
            // sticking and cutting start anew from where the step ended; gaps go on
            let remaining = |row: usize| match laws[row / 3] {
                Law::Coulomb { .. } if row.is_multiple_of(3) => found[row],
                // what an edge has gone back it may go on freely
                Law::Cut { .. } if row.is_multiple_of(3) => found[row].max(0.0),
                _ => 0.0,
            };
            let free = &problem.free[number];
            let (shift, turn) = free.gives(rows.on_rigid(number, lambda));
            let own = [free.shift + shift, free.turn + turn];
            // what the tool has not opened itself goes on; an edge that cuts has no hold on the skin's motion
            let rate = |row: usize| match (laws[row / 3], rows.of_rigid(row, number)) {
                (Law::Coulomb { .. }, Some((axis, lever))) => {
                    let contact = &rows.contacts[row / 3];
                    let opened = found[row] - contact.gap[row % 3] - axis.dot(own[0]) - lever.dot(own[1]);
                    self.goes_on(contact.on) * opened
                }
                _ => 0.0,
            };
            let give = |i: usize, j: usize| problem.w[i * count + j] - rows.rigid_part(i, j, number, free);
            self.reduced[number] = Reduced {
                position: tool.position,
                rotation: tool.rotation,
                axes: sides.iter().map(|(row, sign)| rows.axis(*row) * *sign).collect(),
                arms: sides.iter().map(|(row, _)| rows.contacts[row / 3].point - tool.position).collect(),
                laws: sides.iter().step_by(3).map(|(row, _)| laws[row / 3]).collect(),
                compliance: sides.iter().flat_map(|(i, _)| sides.iter().map(move |(j, _)| give(*i, *j))).collect(),
                violation: sides.iter().map(|(row, _)| remaining(*row)).collect(),
                rate: sides.iter().map(|(row, _)| rate(*row)).collect(),
                force: sides.iter().map(|(row, _)| lambda[*row]).collect(),
                epoch: self.epoch,
            };
        }
    }
}
