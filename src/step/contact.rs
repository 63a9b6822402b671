//! The contact part of a step: rows, compliance `W`, forces, correction and its passes.

use super::{COLUMNS, Simulation, StepReport};
use crate::backend::{CORRECTION, FREE, Target, Wanted};
use crate::collide::Contact;
use crate::constraints::{Law, solve};
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
    /// Corrections solved.
    pub passes: u32,
    /// Relative change of the forces that one more pass would make.
    pub residual: f64,
    /// Largest iterations over the columns.
    pub column_iterations: u32,
    /// `[contact × 3]` N
    pub forces: Vec<f64>,
    /// Force on each tool, N.
    pub on_tool: Vec<[f64; 3]>,
}

/// Columns keep their slot while their contact lasts, so that the last solution is the next start.
#[derive(Clone, Debug, Default)]
pub struct Slots {
    taken: BTreeMap<(usize, usize), usize>,
}

impl Slots {
    /// First slot of each contact, and the slots that are new.
    fn assign(&mut self, contacts: &[Contact]) -> (Vec<usize>, Vec<usize>) {
        self.taken.retain(|id, _| contacts.iter().any(|c| c.id == *id));
        let mut fresh = vec![];
        let slots = contacts
            .iter()
            .map(|c| {
                if let Some(slot) = self.taken.get(&c.id) {
                    return *slot;
                }
                let used: Vec<usize> = self.taken.values().copied().collect();
                let slot = (0..).map(|k| COLUMNS + 3 * k).find(|s| !used.contains(s)).unwrap_or(COLUMNS);
                self.taken.insert(c.id, slot);
                fresh.extend(slot..slot + 3);
                slot
            })
            .collect();
        (slots, fresh)
    }
}

/// Passes at most; two are usual (force error 0.3 % and less after the second), redundant contacts take more.
const MAX_PASSES: u32 = 16;
/// Gauss–Seidel sweeps per contact solve at most, and the relative change at which it stops.
const MAX_SWEEPS: u32 = 2000;
const SWEEP_TOLERANCE: f64 = 1e-5;

/// Share by which `W`'s diagonal is raised. Samples closer than the skin's triangles make `W` singular, and loose columns make it
/// slightly indefinite there; raised by more than that error, the sweeps converge (at 0 one solve in ten does not). The passes take
/// the true violations, so the result does not depend on it.
const RAISED: f64 = 0.001;

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

        // free motion and columns
        let exact = law.correction == Correction::Exact;
        let mut wanted = vec![Wanted { slot: FREE, target: Target::OfLoad(self.scene.solver.tolerance) }];
        let mut pick: Vec<(usize, u32)> = nodes.iter().map(|n| (FREE, *n)).collect();
        let mut columns = vec![];
        if exact {
            let (slots, fresh) = self.slots.assign(contacts);
            columns = slots.iter().flat_map(|s| [*s, s + 1, s + 2]).collect();
            let mut entries = vec![];
            for (row, slot) in columns.iter().enumerate() {
                let c = &contacts[row / 3];
                let norm = c.weights.iter().map(|w| w * w).sum::<f64>().sqrt();
                wanted.push(Wanted { slot: *slot, target: Target::Absolute(law.column_tolerance * norm) });
                for k in 0..3 {
                    entries.push((*slot, c.nodes[k], (rows.axis(row) * -c.weights[k]).to_array()));
                }
                pick.extend(nodes.iter().map(|n| (*slot, *n)));
            }
            self.backend.forget(&fresh)?;
            self.backend.set_rows(&columns, &entries)?;
        }
        let (outcomes, picked) = self.backend.solve(&wanted, &pick)?;
        report.free = outcomes[0];
        report.contact.column_iterations = outcomes[1..].iter().map(|o| o.iterations).max().unwrap_or(0);
        if outcomes[1..].iter().any(|o| !o.converged) {
            *report.warnings.entry("columns_not_converged").or_default() += 1;
        }

        // compliance and violations
        let blocks = if exact { vec![] } else { self.backend.node_blocks(&nodes)? };
        let inverse: Vec<DMat3> = blocks.iter().map(|b| DMat3::from_cols_array_2d(b).inverse()).collect();
        let mut skin = vec![0.0; count * count];
        for i in 0..count {
            for j in 0..count {
                skin[i * count + j] = if exact {
                    rows.on_skin(i, |n| at(&picked, (j + 1) * nodes.len(), n))
                } else {
                    let push = rows.forces_of(j);
                    rows.on_skin(i, |n| {
                        let k = nodes.binary_search(&n).unwrap_or(0);
                        inverse[k] * push.iter().find(|p| p.0 == n).map_or(DVec3::ZERO, |p| p.1)
                    })
                };
            }
        }
        symmetrise(&mut skin, count);
        let mut w: Vec<f64> =
            (0..count * count).map(|k| skin[k] + rows.tool_compliance(k / count, k % count, free)).collect();
        if exact {
            (0..count).for_each(|i| w[i * count + i] *= 1.0 + RAISED);
        }
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
                let total = forces.iter().map(|f| f.1.length_squared()).sum::<f64>().sqrt();
                let coefficients: Vec<(usize, f64)> = columns.iter().copied().zip(lambda.iter().copied()).collect();
                self.backend.correct(&nodal, &coefficients, false)?;
                let target = Target::Absolute(self.scene.solver.tolerance * total);
                let pick: Vec<(usize, u32)> = nodes.iter().map(|n| (CORRECTION, *n)).collect();
                let (outcome, moved) = self.backend.solve(&[Wanted { slot: CORRECTION, target }], &pick)?;
                report.correction_iterations += outcome[0].iterations;
                if !outcome[0].converged {
                    *report.warnings.entry("solver_not_converged").or_default() += 1;
                }
                moved
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
            let product = |i: usize| (0..count).map(|j| w[i * count + j] * lambda[j]).sum::<f64>();
            shifted = (0..count).map(|i| found[i] - product(i)).collect();
            let mut next = lambda.clone();
            solve(&laws, &w, &shifted, &mut next, SWEEP_TOLERANCE, MAX_SWEEPS);
            // in the energy's norm: redundant contacts may share a force in many ways, which means nothing
            let change: Vec<f64> = next.iter().zip(&lambda).map(|(a, b)| a - b).collect();
            let total = energy(&w, &lambda);
            report.contact.residual = if total > 0.0 { (energy(&w, &change) / total).sqrt() } else { 0.0 };
            if report.contact.residual <= law.tolerance || !exact {
                break;
            }
            if report.contact.passes >= MAX_PASSES {
                *report.warnings.entry("contact_passes_exhausted").or_default() += 1;
                break;
            }
        }
        self.move_tools(&rows, free, &lambda, report);
        self.hand_over(&rows, &laws, &skin, &found, &lambda);
        report.contact.count = contacts.len();
        report.contact.forces = lambda;
        Ok(forces.into_iter().map(|(n, f)| (n, f.to_array())).collect())
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

impl Rows<'_> {
    /// `Jᵀ` of one row.
    fn forces_of(&self, row: usize) -> Vec<(u32, DVec3)> {
        let c = &self.contacts[row / 3];
        (0..3).map(|k| (c.nodes[k], self.axis(row) * -c.weights[k])).collect()
    }
}

/// `λᵀ W λ`, N·m.
fn energy(w: &[f64], lambda: &[f64]) -> f64 {
    let rows = w.chunks_exact(lambda.len().max(1)).zip(lambda);
    rows.map(|(line, l)| l * line.iter().zip(lambda).map(|(w, m)| w * m).sum::<f64>()).sum::<f64>().max(0.0)
}

fn symmetrise(w: &mut [f64], count: usize) {
    for i in 0..count {
        for j in 0..i {
            let mean = 0.5 * (w[i * count + j] + w[j * count + i]);
            (w[i * count + j], w[j * count + i]) = (mean, mean);
        }
    }
}
