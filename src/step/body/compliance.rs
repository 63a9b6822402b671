//! Compliance of the skin at the nodes under the tools, kept on the host from step to step.
//!
//! `C_ab` is the 3×3 block of `A⁻¹` between nodes `a` and `b`: how far `b` gives under one newton at `a`. Three columns of `A⁻¹` per node,
//! solved loosely (the passes of the contact solve take the true violations, so `C` decides how many passes, not where they end). Rows
//! of contacts are sums over their face's nodes, `W = J C Jᵀ`, so a contact may slide over its triangle and `C` stays: only nodes that
//! the tools newly reach cost solves. What was solved in earlier steps has aged by the rotations since. A pass that closes in slowly
//! has one batch of columns solved anew, the oldest: all at once took 30 to 70 times a step's time.

use super::Body;
use crate::backend::{Backend, CORRECTION, CpuBackend, FIRST_COLUMN, Needs, Snapshot, Target, Wanted};
use crate::bodies::Model;
use crate::error::Result;
use crate::scene::{self, Correction};
use crate::step::StepReport;
use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Columns solved at once: two nodes' three axes. More would cost every node of the body 112 bytes each on the device.
pub const COLUMNS: usize = 6;
/// Steps that a node's columns are kept for after the last contact near it: contacts flicker between triangles.
const KEPT: u32 = 20;

/// Iterations of a batch at most, of those that the easiest took. A node of a crumb that hangs on by an edge asks for hundreds (1.6 s of a
/// step), and what it gives need not be known so well: passes take the true violations.
const BEYOND: u32 = 3;

/// Nodes that are kept at most, for a scene's number of contacts of four nodes each; beyond it the longest unused are dropped.
pub fn most_nodes(max_contacts: u32) -> usize {
    16 * max_contacts as usize
}

/// See the module.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Compliance {
    known: BTreeMap<u32, Known>,
    step: u32,
    /// Iterations that the easiest batch of columns took.
    usual: Option<u32>,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Known {
    used: u32,                     // step of the last contact
    solved: u32,                   // step of its columns; 0: not yet
    towards: BTreeMap<u32, DMat3>, // every known node, m/N
}

impl Compliance {
    /// Has the columns of these nodes (sorted), solving those that are missing to `tolerance` of their newton; remembers at most `most`
    /// nodes.
    ///
    /// # Errors
    /// When the device fails.
    pub fn prepare(
        &mut self,
        backend: &mut dyn Backend,
        nodes: &[u32],
        tolerance: f64,
        most: usize,
        report: &mut StepReport,
    ) -> Result<()> {
        self.step += 1;
        let step = self.step;
        for node in nodes {
            self.known.entry(*node).or_default().used = step;
        }
        let mut by_use: Vec<(u32, u32)> = self.known.iter().map(|(n, k)| (k.used, *n)).collect();
        by_use.sort_unstable();
        let surplus = by_use.len().saturating_sub(most);
        let old = by_use.iter().take_while(|(used, _)| used + KEPT < step).count();
        let gone: Vec<u32> = by_use.iter().take(old.max(surplus)).map(|(_, n)| *n).collect();
        for node in gone {
            self.known.remove(&node);
            for known in self.known.values_mut() {
                known.towards.remove(&node);
            }
        }
        self.complete(backend, tolerance, report)
    }

    /// Solves the columns of all nodes that have none.
    fn complete(&mut self, backend: &mut dyn Backend, tolerance: f64, report: &mut StepReport) -> Result<()> {
        let all: Vec<u32> = self.known.keys().copied().collect();
        let missing: Vec<u32> = self.known.iter().filter(|(_, k)| k.solved == 0).map(|(n, _)| *n).collect();
        for pair in missing.chunks(COLUMNS / 3) {
            let budget = self.usual.map_or(u32::MAX, |usual| BEYOND * usual);
            let slots: Vec<usize> = (FIRST_COLUMN..FIRST_COLUMN + 3 * pair.len()).collect();
            let axis = |slot: usize| DVec3::AXES[(slot - FIRST_COLUMN) % 3].to_array();
            let node = |slot: usize| pair[(slot - FIRST_COLUMN) / 3];
            let entries: Vec<_> = slots.iter().map(|s| (*s, node(*s), axis(*s))).collect();
            let wanted: Vec<Wanted> =
                slots.iter().map(|s| Wanted { slot: *s, target: Target::Loose(tolerance, budget) }).collect();
            let pick: Vec<(usize, u32)> = slots.iter().flat_map(|s| all.iter().map(|n| (*s, *n))).collect();
            backend.forget(&slots)?;
            backend.set_rows(&slots, &entries)?;
            let (outcomes, picked) = backend.solve(&wanted, &pick)?;
            report.contact.columns += slots.len() as u32;
            let most = outcomes.iter().map(|o| o.iterations).max().unwrap_or(0);
            report.contact.column_iterations = report.contact.column_iterations.max(most);
            // nodes that are held take none
            if most > 0 {
                self.usual = Some(self.usual.map_or(most, |usual| usual.min(most)));
            }
            if outcomes.iter().any(|o| o.broken(budget)) {
                *report.warnings.entry("columns_not_converged").or_default() += 1;
            }
            for (k, node) in pair.iter().enumerate() {
                for (b, other) in all.iter().enumerate() {
                    let column = |axis: usize| DVec3::from_array(picked[(3 * k + axis) * all.len() + b]);
                    self.set(*node, *other, DMat3::from_cols(column(0), column(1), column(2)));
                }
            }
        }
        Ok(())
    }

    fn set(&mut self, a: u32, b: u32, block: DMat3) {
        let block = if a == b { (block + block.transpose()) * 0.5 } else { block };
        let step = self.step;
        if let Some(known) = self.known.get_mut(&b) {
            known.towards.insert(a, block.transpose());
        }
        if let Some(known) = self.known.get_mut(&a) {
            known.towards.insert(b, block);
            known.solved = step;
        }
    }

    /// Forgets the columns of nodes that a cut has changed; the next `prepare` solves them anew. The others have aged, no more: away from
    /// the cut it changes little, and passes that do not close in renew them.
    pub fn forget(&mut self, nodes: impl Iterator<Item = u32>) {
        for node in nodes {
            if self.known.remove(&node).is_some() {
                self.known.values_mut().for_each(|known| {
                    known.towards.remove(&node);
                });
            }
        }
    }

    /// Solves the columns of one batch of nodes anew: of those in use the oldest, of these the ones under the largest
    /// `forces`. False where all are of the present step.
    ///
    /// # Errors
    /// When the device fails.
    pub fn renew(
        &mut self,
        backend: &mut dyn Backend,
        forces: &[(u32, [f64; 3])],
        tolerance: f64,
        report: &mut StepReport,
    ) -> Result<bool> {
        let size = |node: u32| {
            let found = forces.binary_search_by_key(&node, |f| f.0);
            found.map_or(0.0, |k| DVec3::from_array(forces[k].1).length_squared())
        };
        let aged = self.known.iter().filter(|(_, k)| k.used == self.step && k.solved != self.step);
        let mut old: Vec<(u32, f64, u32)> = aged.map(|(node, k)| (k.solved, size(*node), *node)).collect();
        old.sort_by(|a, b| a.0.cmp(&b.0).then(b.1.total_cmp(&a.1)).then(a.2.cmp(&b.2)));
        old.truncate(COLUMNS / 3);
        for (_, _, node) in &old {
            if let Some(known) = self.known.get_mut(node) {
                known.solved = 0;
            }
        }
        self.complete(backend, tolerance, report)?;
        Ok(!old.is_empty())
    }

    /// How node `b` gives under one newton at `a`, m/N; both have been prepared.
    pub fn block(&self, a: u32, b: u32) -> DMat3 {
        self.known.get(&a).and_then(|k| k.towards.get(&b)).copied().unwrap_or(DMat3::ZERO)
    }
}

/// The compliance of a body at rest, whatever it does later: the columns of one matrix, by its factor in f64 on the host (bricks), or to
/// [`EXACT`] (springs). Filled as nodes are reached.
#[derive(Default)]
pub struct AtRest {
    backend: Option<Box<CpuBackend<f64>>>,
    pub known: Compliance,
}

/// Residual of the columns at rest, relative to their newton.
const EXACT: f64 = 1e-9;
/// Iterations that springs may take to it.
const ITERATIONS: u32 = 100_000;

impl AtRest {
    /// Has the columns of these nodes; see [`Compliance::prepare`].
    ///
    /// # Errors
    /// None that the host's path gives.
    pub fn prepare(&mut self, model: &Model, nodes: &[u32], most: usize, report: &mut StepReport) -> Result<()> {
        let backend = match &mut self.backend {
            Some(backend) => backend,
            none => {
                let rest = model.exact();
                let zero = vec![[0.0; 4]; model.node_count()];
                let start = Snapshot { u: zero.clone(), v: zero, ..Snapshot::default() };
                let needs = Needs { contact: true, columns: COLUMNS, near: most, ..Needs::default() };
                let mut backend = CpuBackend::new(&rest, needs, ITERATIONS, 0.0, &start);
                backend.begin()?;
                none.insert(Box::new(backend))
            }
        };
        self.known.prepare(backend.as_mut(), nodes, EXACT, most, report)
    }

    /// As [`Compliance::block`].
    pub fn block(&self, a: u32, b: u32) -> DMat3 {
        self.known.block(a, b)
    }
}

impl Body {
    /// Has how these nodes give; returns the inverse blocks of `A` that the uncoupled correction takes for it.
    pub(in crate::step) fn prepare_compliance(
        &mut self,
        law: &scene::Contact,
        nodes: &[u32],
        report: &mut StepReport,
    ) -> Result<Vec<DMat3>> {
        match law.correction {
            Correction::Exact => {
                let backend = self.backend.as_mut();
                let tolerance = law.column_tolerance * self.looseness;
                self.compliance.prepare(backend, nodes, tolerance, self.near, report)?;
            }
            Correction::Precomputed => self.at_rest.prepare(&self.model, nodes, self.near, report)?,
            Correction::Uncoupled => {
                let blocks = self.backend.node_blocks(nodes)?;
                return Ok(blocks.iter().map(|b| DMat3::from_cols_array_2d(b).inverse()).collect());
            }
        }
        Ok(vec![])
    }

    /// The body's displacement at nodes under contact forces, solved to a tolerance of the forces, m.
    pub(in crate::step) fn correct(
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
        report.warn("solver_not_converged", u32::from(!outcome[0].converged));
        self.lost |= !outcome[0].residual.is_finite();
        Ok(moved)
    }
}
