//! The contact part of a step: rows, compliance `W`, forces, correction and its passes.

use super::compliance::Compliance;
use super::{Simulation, StepReport};
use crate::backend::{CORRECTION, FREE, Target, Wanted};
use crate::collide::Contact;
use crate::constraints::{self, Law, solve};
use crate::error::Result;
use crate::haptic::Reduced;
use crate::instrument::Free;
use crate::scene::Correction;
use glam::{DMat3, DVec3};
use std::collections::BTreeMap;

/// Contacts of a step and how their forces were found.
#[derive(Clone, Debug, Default)]
pub struct ContactReport {
    /// How many.
    pub count: usize,
    /// Faces of the skin that the broad phase gave to the narrow phase, over all tools.
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
    /// `[contact]` how far the tool has moved over the skin in the step, m.
    pub slips: Vec<DVec3>,
    /// Force on each tool, N.
    pub on_tool: Vec<[f64; 3]>,
}

/// Passes at most; two are usual (force error 0.3 % and less after the second), redundant contacts take more.
const MAX_PASSES: u32 = 16;
/// Gauss–Seidel sweeps per contact solve at most (the incision takes 20, and 477 once), and the relative residual at which it stops.
const MAX_SWEEPS: u32 = 2000;
const SWEEP_TOLERANCE: f64 = 1e-5;

/// A pass that leaves more than this share of the last one's residual shows that the compliance has aged too much.
const SLOW: f64 = 0.5;

/// One row: contact `k`, axis `n`.
struct Rows<'a> {
    contacts: &'a [Contact],
    arms: Vec<DVec3>,
}

impl Rows<'_> {
    fn count(&self) -> usize {
        3 * self.contacts.len()
    }
    fn axis(&self, row: usize) -> DVec3 {
        self.contacts[row / 3].axes[row % 3]
    }
    fn tool(&self, row: usize) -> usize {
        self.contacts[row / 3].id.0
    }
    fn lever(&self, row: usize) -> DVec3 {
        self.arms[row / 3].cross(self.axis(row))
    }
    /// `J v` of the skin at a contact's node values.
    fn on_skin(&self, row: usize, values: impl Fn(u32) -> DVec3) -> f64 {
        let c = &self.contacts[row / 3];
        (0..3).map(|k| -c.weights[k] * self.axis(row).dot(values(c.nodes[k]))).sum()
    }
    /// `Jᵀλ` of the skin, nodes each once.
    fn forces(&self, lambda: &[f64]) -> Vec<(u32, DVec3)> {
        let mut sum: BTreeMap<u32, DVec3> = BTreeMap::new();
        for (row, force) in lambda.iter().enumerate() {
            let c = &self.contacts[row / 3];
            for k in 0..3 {
                *sum.entry(c.nodes[k]).or_default() -= self.axis(row) * (c.weights[k] * force);
            }
        }
        sum.into_iter().collect()
    }
    /// The skin's part of `W` from blocks between nodes, by rows.
    fn compliance(&self, between: &dyn Fn(u32, u32) -> DMat3) -> Vec<f64> {
        let count = self.count();
        let mut w = vec![0.0; count * count];
        for (i, a) in self.contacts.iter().enumerate() {
            for (j, b) in self.contacts.iter().enumerate().take(i + 1) {
                let mut block = DMat3::ZERO; // b gives under a
                for (k, l) in (0..9).map(|n| (n / 3, n % 3)) {
                    block += between(a.nodes[k], b.nodes[l]) * (a.weights[k] * b.weights[l]);
                }
                for (m, n) in (0..9).map(|n| (n / 3, n % 3)) {
                    let value = b.axes[n].dot(block * a.axes[m]);
                    w[(3 * i + m) * count + 3 * j + n] = value;
                    w[(3 * j + n) * count + 3 * i + m] = value;
                }
            }
        }
        w
    }
    /// `W` of skin and tools.
    fn with_tool(&self, skin: &[f64], free: &[Free]) -> Vec<f64> {
        let count = self.count();
        (0..count * count).map(|k| skin[k] + self.tool_compliance(k / count, k % count, free)).collect()
    }
    /// The tool's part of `W`.
    fn tool_compliance(&self, i: usize, j: usize, free: &[Free]) -> f64 {
        if self.tool(i) != self.tool(j) {
            return 0.0;
        }
        let f = &free[self.tool(i)];
        f.compliance * self.axis(i).dot(self.axis(j)) + self.lever(i).dot(f.angular_compliance * self.lever(j))
    }
}

impl Simulation {
    /// Solves free motion and contact together; returns nodal contact forces.
    pub(super) fn resolve(
        &mut self,
        contacts: &[Contact],
        free: &[Free],
        report: &mut StepReport,
    ) -> Result<Vec<(u32, [f64; 3])>> {
        let Some(law) = self.scene.contact else {
            return Ok(vec![]);
        };
        let arms = contacts.iter().map(|c| c.point - self.tools[c.id.0].position).collect();
        let rows = Rows { contacts, arms };
        let laws: Vec<Law> = contacts.iter().map(|c| c.law).collect();
        let count = rows.count();
        let mut nodes: Vec<u32> = contacts.iter().flat_map(|c| c.nodes).collect();
        nodes.sort_unstable();
        nodes.dedup();
        let at = |values: &[[f64; 3]], offset: usize, node: u32| {
            DVec3::from_array(values[offset + nodes.binary_search(&node).unwrap_or(0)])
        };

        // free motion, and the compliance of the nodes that the tools newly reach
        let exact = law.correction == Correction::Exact;
        let wanted = [Wanted { slot: FREE, target: Target::OfLoad(self.scene.solver.tolerance) }];
        let pick: Vec<(usize, u32)> = nodes.iter().map(|n| (FREE, *n)).collect();
        let (outcomes, picked) = self.backend.solve(&wanted, &pick)?;
        report.free = outcomes[0];
        let (backend, compliance) = (self.backend.as_mut(), &mut self.compliance);
        let inverse: Vec<DMat3> = if exact {
            compliance.prepare(backend, &nodes, law.column_tolerance, law.max_contacts, report)?;
            vec![]
        } else {
            let blocks = backend.node_blocks(&nodes)?;
            blocks.iter().map(|b| DMat3::from_cols_array_2d(b).inverse()).collect()
        };
        let between = |compliance: &Compliance, a: u32, b: u32| match nodes.binary_search(&a) {
            Ok(k) if !exact && a == b => inverse[k],
            _ => compliance.between(a, b),
        };
        let mut skin = rows.compliance(&|a, b| between(&self.compliance, a, b));
        let mut w = rows.with_tool(&skin, free);
        let violation: Vec<f64> = (0..count)
            .map(|i| {
                let gap = if i % 3 == 0 { contacts[i / 3].gap } else { 0.0 };
                let f = &free[rows.tool(i)];
                gap + rows.axis(i).dot(f.shift) + rows.lever(i).dot(f.turn) + rows.on_skin(i, |n| at(&picked, 0, n))
            })
            .collect();

        // forces, correction, passes
        let mut lambda = vec![0.0; count];
        let mut shifted = violation.clone();
        let mut found;
        let mut forces;
        loop {
            let ended = solve(&laws, &w, &shifted, &mut lambda, SWEEP_TOLERANCE, MAX_SWEEPS);
            if !ended.converged {
                *report.warnings.entry("contact_not_converged").or_default() += 1;
            }
            forces = rows.forces(&lambda);
            let nodal: Vec<(u32, [f64; 3])> = forces.iter().map(|(n, f)| (*n, f.to_array())).collect();
            report.contact.passes += 1;
            let moved = if exact {
                self.correct(&nodes, &nodal, self.scene.solver.tolerance.min(law.tolerance), report)?
            } else {
                let moved: Vec<DVec3> = nodes
                    .iter()
                    .zip(&inverse)
                    .map(|(n, m)| *m * forces.iter().find(|f| f.0 == *n).map_or(DVec3::ZERO, |f| f.1))
                    .collect();
                let list: Vec<_> = nodes.iter().copied().zip(moved.iter().map(|m| m.to_array())).collect();
                self.backend.set_correction(&list)?;
                list.into_iter().map(|l| l.1).collect()
            };
            // violations as they are now, then what the compliance model leaves unexplained
            let tool_part = |i: usize| (0..count).map(|j| rows.tool_compliance(i, j, free) * lambda[j]).sum::<f64>();
            found = (0..count)
                .map(|i| violation[i] + rows.on_skin(i, |n| at(&moved, 0, n)) + tool_part(i))
                .collect::<Vec<f64>>();
            let mut next = lambda.clone();
            let before = report.contact.residual;
            let residual = |w: &[f64], next: &mut Vec<f64>| {
                let product = |i: usize| (0..count).map(|j| w[i * count + j] * lambda[j]).sum::<f64>();
                let shifted: Vec<f64> = (0..count).map(|i| found[i] - product(i)).collect();
                let ended = solve(&laws, w, &shifted, next, SWEEP_TOLERANCE, MAX_SWEEPS);
                // in the energy's norm: redundant contacts may share a force in many ways, which means nothing
                let change: Vec<f64> = next.iter().zip(&lambda).map(|(a, b)| a - b).collect();
                let total = energy(w, &lambda);
                let size = if total > 0.0 { (energy(w, &change) / total).sqrt() } else { 0.0 };
                (shifted, size, ended.converged)
            };
            let (mut left, mut size, settled) = residual(&w, &mut next);
            let slow = report.contact.passes > 1 && size > SLOW * before;
            if exact && size > law.tolerance && (slow || !settled) && self.compliance.aged() {
                self.compliance.renew(self.backend.as_mut(), law.column_tolerance, report)?;
                skin = rows.compliance(&|a, b| between(&self.compliance, a, b));
                w = rows.with_tool(&skin, free);
                next.clone_from(&lambda);
                (left, size, _) = residual(&w, &mut next);
            }
            (shifted, report.contact.residual) = (left, size);
            if report.contact.residual <= law.tolerance || !exact {
                break;
            }
            if report.contact.passes >= MAX_PASSES {
                *report.warnings.entry("contact_passes_exhausted").or_default() += 1;
                break;
            }
        }
        let left = constraints::residual(&laws, &w, &shifted, &lambda);
        (report.contact.residual_n, report.contact.residual_m) = (left.force, left.gap);
        if left.dropped > 0 {
            *report.warnings.entry("contact_rows_dropped").or_default() += left.dropped;
        }
        self.move_tools(&rows, free, &lambda, report);
        self.hand_over(&rows, &laws, &skin, &found, &lambda);
        report.contact.count = contacts.len();
        report.contact.slips = contacts
            .iter()
            .zip(found.chunks_exact(3))
            .map(|(c, f)| c.axes[0] * (f[0] - c.gap) + c.axes[1] * f[1] + c.axes[2] * f[2])
            .collect();
        report.contact.forces = lambda;
        Ok(forces.into_iter().map(|(n, f)| (n, f.to_array())).collect())
    }

    /// The skin's displacement at nodes under contact forces, solved to a tolerance of the forces, m.
    fn correct(
        &mut self,
        nodes: &[u32],
        forces: &[(u32, [f64; 3])],
        tolerance: f64,
        report: &mut StepReport,
    ) -> Result<Vec<[f64; 3]>> {
        let total = forces.iter().map(|f| DVec3::from_array(f.1).length_squared()).sum::<f64>().sqrt();
        if total == 0.0 {
            // nothing to solve for, and no share of nothing to solve to
            self.backend.forget(&[CORRECTION])?;
            return Ok(vec![[0.0; 3]; nodes.len()]);
        }
        let entries: Vec<_> = forces.iter().map(|(n, f)| (CORRECTION, *n, *f)).collect();
        self.backend.set_rows(&[CORRECTION], &entries)?;
        let wanted = [Wanted { slot: CORRECTION, target: Target::Absolute(tolerance * total) }];
        let pick: Vec<(usize, u32)> = nodes.iter().map(|n| (CORRECTION, *n)).collect();
        let (outcome, moved) = self.backend.solve(&wanted, &pick)?;
        report.correction_iterations += outcome[0].iterations;
        if !outcome[0].converged {
            *report.warnings.entry("solver_not_converged").or_default() += 1;
        }
        Ok(moved)
    }

    fn move_tools(&mut self, rows: &Rows, free: &[Free], lambda: &[f64], report: &mut StepReport) {
        let h = self.scene.time.step;
        for (number, (tool, free)) in self.tools.iter_mut().zip(free).enumerate() {
            let (mut force, mut torque) = (DVec3::ZERO, DVec3::ZERO);
            for (row, l) in lambda.iter().enumerate().filter(|(row, _)| rows.tool(*row) == number) {
                force += rows.axis(row) * *l;
                torque += rows.lever(row) * *l;
            }
            tool.advance(free.shift + force * free.compliance, free.turn + free.angular_compliance * torque, h);
            report.contact.on_tool.push(force.to_array());
        }
    }

    /// The reduced contact problem of each tool, for the haptic side.
    fn hand_over(&mut self, rows: &Rows, laws: &[Law], skin: &[f64], found: &[f64], lambda: &[f64]) {
        let count = rows.count();
        for (number, tool) in self.tools.iter().enumerate() {
            let own: Vec<usize> = (0..count).filter(|r| rows.tool(*r) == number).collect();
            // sticking and cutting start anew from where the step ended; gaps go on
            let remaining = |r: &usize| match laws[r / 3] {
                Law::Coulomb { .. } if r.is_multiple_of(3) => found[*r],
                _ => 0.0,
            };
            self.reduced[number] = Reduced {
                position: tool.position,
                rotation: tool.rotation,
                axes: own.iter().map(|r| rows.axis(*r)).collect(),
                arms: own.iter().map(|r| rows.contacts[r / 3].point - tool.position).collect(),
                laws: own.iter().step_by(3).map(|r| laws[r / 3]).collect(),
                compliance: own.iter().flat_map(|i| own.iter().map(move |j| skin[i * count + j])).collect(),
                violation: own.iter().map(remaining).collect(),
                force: own.iter().map(|r| lambda[*r]).collect(),
                epoch: self.epoch,
            };
        }
    }
}

/// `λᵀ W λ`, N·m.
fn energy(w: &[f64], lambda: &[f64]) -> f64 {
    let rows = w.chunks_exact(lambda.len().max(1)).zip(lambda);
    rows.map(|(line, l)| l * line.iter().zip(lambda).map(|(w, m)| w * m).sum::<f64>()).sum::<f64>().max(0.0)
}
