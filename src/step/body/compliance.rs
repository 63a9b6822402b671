//! Compliance of the skin at the nodes under the tools, kept on the host from step to step.
//!
//! `C_ab` is the 3×3 block of `A⁻¹` between nodes `a` and `b`: the displacement of `b` under one newton at `a`. A node takes three columns
//! of `A⁻¹`, solved loosely: the passes of the contact solve use the true violations, so `C` decides how many passes they take, not their
//! result. With columns to 0.3 instead of 0.05, `incision_shapes` takes 2.4 passes a step instead of 2.3, 42 % of the time for columns, a
//! third in the step with most of them, and 81 % in all; to 0.5 the same. The default is 0.2, two iterations: the residual of many redundant
//! rows grows beyond it (64 points on 25 nodes: 1.6e-7, 9.5e-7, 4.2e-6 N for 0.05, 0.2, 0.3).
//!
//! Columns are solved in batches, one in each slow pass; a node that contacts newly reach borrows its columns from the nearest node of its piece
//! that has some, at the same relative positions: those of held skin are a thousandth of what a crumb has that has come off, which they threw by
//! 12 mm. Columns and passes per step of the incision: 1.6 and 1.56 where each new node is solved for in
//! turn, 0.60 and 1.76 where it borrows, with 6.7 and 6.9 iterations; the needle and the probe solve one batch in all. Blade edges and tips
//! reach up to ten nodes at once: solved at once, a step spent up to 69 ms in 27 columns. Without any batch in slow passes the incision takes
//! 2.28 passes and 8.0 iterations. With at most one in a step, a wound that is pressed uses up all passes, and a block that falls by 10 mm
//! goes through a bed of 4 mm.
//!
//! Rows of contacts are sums over the nodes of a face, `W = J C Jᵀ`, so `C` stays valid while a contact slides over its triangle. Columns of
//! earlier steps age with the rotations since. In a slow pass the borrowed and the oldest are solved; all at once took 30 to 70 times a
//! step's time.
//!
//! `A⁻¹` is positive definite, a `C` of loose, aged and borrowed columns need not be: nodes near each other move together many times more
//! than apart, and the difference of their columns is less than the columns' error. [`Compliance::positive`] is the nearest that the step
//! uses. (With a `C` that was negative along a change of the forces, passes took the change for none and ended: incision.toml left up to
//! 1.5e-2 N and 12 µm, incision_shapes.toml 20 µm; now 6e-4 N and 1.6 µm, 5.2 µm.)

use super::{Body, FLOATING_FACTOR};
use crate::backend::{Backend, CORRECTION, CpuBackend, FIRST_COLUMN, Needs, Snapshot, SolveRequest, Target};
use crate::bodies::{Loose, Model, Wound};
use crate::error::Result;
use crate::scene::{self, Correction};
use crate::step::{Part, StepReport};
use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::time::Instant;

/// Columns solved at once: three axes of two nodes. Each further one costs every node of the body 112 bytes on the device.
pub const COLUMNS: usize = 6;
/// Most nodes whose columns are solved at once.
pub const MOST_AT_ONCE: usize = COLUMNS / 3;
/// Number of steps for which a node's columns are kept after its last contact: contacts flicker between triangles.
const KEPT: u32 = 20;

/// Nodes around one whose columns are solved, towards which they are kept for those who borrow them: about two rings of cells.
const AROUND: usize = 100;

/// Most iterations of a batch, relative to the easiest one. A node of a crumb that hangs on by an edge takes hundreds (1.6 s of a step),
/// and its compliance need not be that accurate: passes use the true violations. Nodes of loose pieces have no such bound: their columns are
/// worth nothing before the piece moves as a whole, and a piece that `[[attach]]` holds was thrown by metres.
const BEYOND: u32 = 3;

/// Least compliance of a node among others that are held, as a share of its own. With 0.01, sheets of ν 0.45 that are tied at 25 nodes use up their
/// passes (from 0.0003 to 0.003 they do not). Passes, mean and most, with 0.001, 0.003, 0.01: incision.toml 1.90, 1.87, 1.87 and 5, 6, 6, pad.toml
/// 2.60, 2.45, 2.73 and 7, incision_shapes.toml 2.25, 2.18, 2.21 and 14, 9, 10.
const LEAST: f64 = 0.003;

/// How the columns of a step are solved.
#[derive(Clone, Copy, Debug)]
pub struct Solving {
    /// Residual relative to one newton.
    pub tolerance: f64,
    /// Nodes of a batch, at most [`MOST_AT_ONCE`].
    pub at_once: usize,
    /// All that are missing, not only a first batch that others borrow from.
    pub all: bool,
}

/// Most nodes that are kept, for a scene's number of contacts of four nodes each; beyond it the longest unused are dropped.
pub fn most_nodes(max_contacts: u32) -> usize {
    16 * max_contacts as usize
}

/// Rest positions of a body's nodes, and what of it floats.
#[derive(Clone, Copy)]
pub struct RestShape<'a> {
    /// `[node]` m, duplicates last
    pub positions: &'a [[f64; 3]],
    /// Number of nodes that are no duplicates.
    pub originals: usize,
    /// The whole body floats.
    pub floats: bool,
    /// Pieces that nothing holds.
    pub loose: &'a [Loose],
}

impl<'a> RestShape<'a> {
    /// Of a body.
    pub fn of(model: &Model, wound: &'a Wound, floats: bool) -> Self {
        Self { positions: &wound.rest, originals: model.rest.len(), floats, loose: &wound.loose }
    }

    /// Number of the loose piece that a node belongs to.
    fn piece_of(&self, node: u32) -> Option<usize> {
        self.loose.iter().position(|piece| piece.nodes.binary_search(&node).is_ok())
    }
}

/// See the module.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Compliance {
    known: BTreeMap<u32, Known>,
    step: u32,
    /// Iterations of the easiest batch of columns.
    usual: Option<u32>,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Known {
    used: u32,                     // step of the last contact
    solved: u32,                   // step in which its columns were solved; 0: not yet
    towards: BTreeMap<u32, DMat3>, // to every kept node, and to those around if solved, m/N
}

impl Compliance {
    /// Provides the columns of these nodes (sorted) of a body, which are solved if all are asked for, or borrowed; one batch is solved where
    /// none can lend. Keeps at most `most` nodes.
    ///
    /// # Errors
    /// When the device fails.
    pub fn prepare(
        &mut self,
        backend: &mut dyn Backend,
        (nodes, rest_shape): (&[u32], RestShape),
        solving: Solving,
        most: usize,
        report: &mut StepReport,
    ) -> Result<()> {
        self.step += 1;
        let step = self.step;
        // note the use
        for node in nodes {
            self.known.entry(*node).or_default().used = step;
        }
        // drop nodes unused for long, and the surplus
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
        // solve those in use first
        let missing = self.known.iter().filter(|(_, k)| k.solved == 0);
        let mut missing: Vec<(bool, u32)> = missing.map(|(node, k)| (k.used != step, *node)).collect();
        missing.sort_unstable();
        let missing: Vec<u32> = missing.into_iter().map(|(_, node)| node).collect();
        if solving.all {
            for batch in missing.chunks(solving.at_once) {
                self.solve(backend, rest_shape, batch, solving.tolerance, report)?;
            }
        } else {
            // one batch of each piece where none can lend
            let mut of_piece: BTreeMap<Option<usize>, Vec<u32>> = BTreeMap::new();
            let in_use = missing.iter().filter(|node| self.known[*node].used == step);
            in_use.for_each(|node| of_piece.entry(rest_shape.piece_of(*node)).or_default().push(*node));
            self.lenders().for_each(|lender| drop(of_piece.remove(&rest_shape.piece_of(lender))));
            for batch in of_piece.values() {
                let batch = &batch[..batch.len().min(solving.at_once)];
                self.solve(backend, rest_shape, batch, solving.tolerance, report)?;
            }
        }
        self.borrow(rest_shape);
        Ok(())
    }

    /// Solves the columns of one batch of nodes.
    fn solve(
        &mut self,
        backend: &mut dyn Backend,
        rest_shape: RestShape,
        batch: &[u32],
        tolerance: f64,
        report: &mut StepReport,
    ) -> Result<()> {
        let clock = Instant::now();
        let around = batch.iter().flat_map(|node| nearest(rest_shape, *node));
        let mut all: Vec<u32> = self.known.keys().copied().chain(around).collect();
        all.sort_unstable();
        all.dedup();
        let budget = self.usual.map_or(u32::MAX, |usual| BEYOND * usual);
        // one unit force per column
        let rhs_ids: Vec<usize> = (FIRST_COLUMN..FIRST_COLUMN + 3 * batch.len()).collect();
        let axis = |rhs: usize| DVec3::AXES[(rhs - FIRST_COLUMN) % 3].to_array();
        let node = |rhs: usize| batch[(rhs - FIRST_COLUMN) / 3];
        let entries: Vec<_> = rhs_ids.iter().map(|s| (*s, node(*s), axis(*s))).collect();
        let loose = |rhs: usize| rest_shape.piece_of(node(rhs)).is_some();
        let limit = |rhs: usize| if loose(rhs) { u32::MAX } else { budget };
        let target = |rhs: usize| {
            let moves = rest_shape.floats || loose(rhs);
            Target::Loose(if moves { FLOATING_FACTOR * tolerance } else { tolerance }, limit(rhs))
        };
        let wanted: Vec<SolveRequest> =
            rhs_ids.iter().map(|rhs| SolveRequest { rhs: *rhs, target: target(*rhs) }).collect();
        let pick: Vec<(usize, u32)> = rhs_ids.iter().flat_map(|s| all.iter().map(|n| (*s, *n))).collect();
        // solve from zero, reading every known node
        backend.reset_initial_guess(&rhs_ids)?;
        backend.set_rows(&rhs_ids, &entries)?;
        let (outcomes, picked) = backend.solve(&wanted, &pick)?;
        report.contact.columns += rhs_ids.len() as u32;
        let most = outcomes.iter().map(|o| o.iterations).max().unwrap_or(0);
        report.contact.column_iterations = report.contact.column_iterations.max(most);
        report.costs.iterations += most;
        // columns of fixed nodes take no iterations
        if most > 0 {
            self.usual = Some(self.usual.map_or(most, |usual| usual.min(most)));
        }
        if outcomes.iter().zip(&rhs_ids).any(|(outcome, rhs)| outcome.broken(limit(*rhs))) {
            report.warn("columns_not_converged", 1);
        }
        // store the blocks
        for (k, node) in batch.iter().enumerate() {
            for (b, other) in all.iter().enumerate() {
                let column = |axis: usize| DVec3::from_array(picked[(3 * k + axis) * all.len() + b]);
                self.set(*node, *other, DMat3::from_cols(column(0), column(1), column(2)));
            }
            if let Some(known) = self.known.get_mut(node) {
                known.solved = self.step;
            }
        }
        report.costs.spend(Part::Columns, clock);
        Ok(())
    }

    fn set(&mut self, a: u32, b: u32, block: DMat3) {
        let block = if a == b { (block + block.transpose()) * 0.5 } else { block };
        if let Some(known) = self.known.get_mut(&b) {
            known.towards.insert(a, block.transpose());
        }
        if let Some(known) = self.known.get_mut(&a) {
            known.towards.insert(b, block);
        }
    }

    /// Nodes with columns of their own; fixed ones have no compliance to lend.
    fn lenders(&self) -> impl Iterator<Item = u32> {
        let moves = |node: &u32, known: &Known| known.towards.get(node).is_some_and(|own| *own != DMat3::ZERO);
        self.known.iter().filter(move |(node, k)| k.solved > 0 && moves(node, k)).map(|(node, _)| *node)
    }

    /// Gives nodes in use without columns those of the nearest node that has some, of the same piece: the compliance towards another in use is
    /// the lender's towards the one at the nearest relative position. Loose pieces move neither each other nor the rest.
    fn borrow(&mut self, rest_shape: RestShape) {
        let position = |node: u32| DVec3::from_array(rest_shape.positions[node as usize]);
        let lenders: Vec<(u32, Option<usize>)> = self.lenders().map(|node| (node, rest_shape.piece_of(node))).collect();
        let in_use = self.known.iter().filter(|(_, k)| k.used == self.step);
        let in_use: Vec<(u32, bool, Option<usize>)> =
            in_use.map(|(node, k)| (*node, k.solved > 0, rest_shape.piece_of(*node))).collect();
        let mut loans: BTreeMap<u32, Vec<(DVec3, DMat3)>> = BTreeMap::new();
        for (node, _, piece) in in_use.iter().copied().filter(|(_, solved, _)| !solved) {
            let far = |lender: &u32| position(*lender).distance_squared(position(node));
            let of_piece = lenders.iter().filter(|(_, other)| *other == piece).map(|(lender, _)| *lender);
            let Some(lender) = of_piece.min_by(|a, b| far(a).total_cmp(&far(b))) else { continue };
            let own = self.known[&lender].towards.get(&lender).copied();
            // what it lends, with the position of each relative to it
            let lent = loans.entry(lender).or_insert_with(|| {
                let lends = |to: u32| to != lender && rest_shape.piece_of(to) == piece;
                let lent = self.known[&lender].towards.iter().filter(|(to, _)| lends(**to));
                lent.map(|(to, block)| (position(*to) - position(lender), *block)).collect()
            });
            for (other, ..) in in_use.iter().copied().filter(|(other, _, of)| *other != node && *of == piece) {
                if !self.known[&node].towards.contains_key(&other) {
                    // the solved columns of the other node may reach this one; of two nodes of a wound's lips none is the other
                    let known = self.known[&other].towards.get(&node).map(DMat3::transpose);
                    let wanted = position(other) - position(node);
                    let off = |(to, _): &&(DVec3, DMat3)| to.distance_squared(wanted);
                    let nearest = || lent.iter().min_by(|a, b| off(a).total_cmp(&off(b))).map(|(_, block)| *block);
                    if let Some(block) = known.or_else(nearest) {
                        self.set(node, other, block);
                    }
                }
            }
            if let Some(own) = own {
                self.set(node, node, own);
            }
        }
    }

    /// Drops the columns of nodes that a cut has changed or set free; they borrow others until slow passes solve them anew. The others only
    /// age: away from the cut they change little, and slow passes renew them.
    pub fn invalidate(&mut self, nodes: impl Iterator<Item = u32>) {
        let gone: BTreeSet<u32> = nodes.collect();
        self.known.retain(|node, _| !gone.contains(node));
        self.known.values_mut().for_each(|known| known.towards.retain(|node, _| !gone.contains(node)));
    }

    /// Solves the columns of one batch of nodes anew: of the nodes in use those with the oldest columns, among these the ones under the
    /// largest `forces`. False if all columns are of the present step.
    ///
    /// # Errors
    /// When the device fails.
    pub fn renew(
        &mut self,
        backend: &mut dyn Backend,
        rest_shape: RestShape,
        forces: &[(u32, [f64; 3])],
        solving: Solving,
        report: &mut StepReport,
    ) -> Result<bool> {
        let size = |node: u32| {
            let found = forces.binary_search_by_key(&node, |f| f.0);
            found.map_or(0.0, |k| DVec3::from_array(forces[k].1).length_squared())
        };
        let aged = self.known.iter().filter(|(_, k)| k.used == self.step && k.solved != self.step);
        let mut old: Vec<(u32, f64, u32)> = aged.map(|(node, k)| (k.solved, size(*node), *node)).collect();
        old.sort_by(|a, b| a.0.cmp(&b.0).then(b.1.total_cmp(&a.1)).then(a.2.cmp(&b.2)));
        let old: Vec<u32> = old.into_iter().map(|(_, _, node)| node).take(solving.at_once).collect();
        if old.is_empty() {
            return Ok(false);
        }
        self.solve(backend, rest_shape, &old, solving.tolerance, report)?;
        Ok(true)
    }

    /// `[a × b]` displacement of each of the prepared `nodes` (sorted) under one newton at each other, m/N, made positive definite.
    ///
    /// Elimination in the order of the largest pivots (Cholesky) leaves at each step what the other nodes move where those eliminated are
    /// held. A coupling that would leave one less than [`LEAST`] of its own compliance is within the columns' error, and is cut to the size
    /// that leaves just that; a node's own compliance along each axis stays. (Pivots that are raised instead, as in Schnabel, Eskow 1990, or what is left
    /// without coupling, change entries by several times the columns' error.)
    pub fn positive(&self, nodes: &[u32]) -> Vec<DMat3> {
        let count = nodes.len();
        let mut blocks: Vec<DMat3> = nodes.iter().flat_map(|a| nodes.iter().map(|b| self.block(*a, *b))).collect();
        let entry = |i: usize, j: usize| (i / 3 * count + j / 3, i % 3, j % 3);
        let at = |blocks: &[DMat3], i: usize, j: usize| {
            let (block, column, row) = entry(i, j);
            blocks[block].col(column)[row]
        };
        // fixed axes have no compliance
        let mut order: Vec<usize> = (0..3 * count).filter(|i| at(&blocks, *i, *i) > 0.0).collect();
        let size = order.len();
        let mut left: Vec<f64> = order.iter().flat_map(|i| order.iter().map(|j| at(&blocks, *i, *j))).collect();
        let mut least: Vec<f64> = (0..size).map(|i| LEAST * left[i * (size + 1)]).collect();
        // above and on the diagonal
        for k in 0..size {
            let share = |i: &usize| left[i * (size + 1)] / least[*i];
            let largest = (k..size).max_by(|a, b| share(a).total_cmp(&share(b))).unwrap_or(k);
            order.swap(k, largest);
            least.swap(k, largest);
            left.swap(k * (size + 1), largest * (size + 1));
            (k + 1..largest).for_each(|i| left.swap(k * size + i, i * size + largest));
            (largest + 1..size).for_each(|j| left.swap(k * size + j, largest * size + j));
            let pivot = left[k * (size + 1)];
            let mut line = left[k * size + k + 1..(k + 1) * size].to_vec();
            for (j, coupling) in (k + 1..size).zip(&mut line) {
                let most = (pivot * (left[j * (size + 1)] - least[j]).max(0.0)).sqrt();
                let off = coupling.min(most).max(-most) - *coupling;
                if off != 0.0 {
                    *coupling += off;
                    for (block, column, row) in [entry(order[k], order[j]), entry(order[j], order[k])] {
                        blocks[block].col_mut(column)[row] += off;
                    }
                }
            }
            for (n, i) in (k + 1..size).enumerate() {
                let factor = line[n] / pivot;
                let rest = &mut left[i * (size + 1)..(i + 1) * size];
                rest.iter_mut().zip(&line[n..]).for_each(|(left, coupling)| *left -= factor * coupling);
            }
        }
        blocks
    }

    /// Displacement of node `b` under one newton at `a`, m/N; both have been prepared.
    pub fn block(&self, a: u32, b: u32) -> DMat3 {
        self.known.get(&a).and_then(|k| k.towards.get(&b)).copied().unwrap_or(DMat3::ZERO)
    }
}

/// Nodes nearest to one at rest, of its loose piece if it belongs to one.
fn nearest(rest_shape: RestShape, node: u32) -> Vec<u32> {
    let position = |node: u32| DVec3::from_array(rest_shape.positions[node as usize]);
    let far = |other: &u32| position(*other).distance_squared(position(node));
    let mut all: Vec<u32> = match rest_shape.piece_of(node) {
        Some(piece) => rest_shape.loose[piece].nodes.clone(),
        None => (0..rest_shape.originals as u32).collect(),
    };
    if all.len() > AROUND {
        all.select_nth_unstable_by(AROUND, |a, b| far(a).total_cmp(&far(b)).then(a.cmp(b)));
        all.truncate(AROUND);
    }
    let piece = rest_shape.piece_of(node);
    all.retain(|other| rest_shape.piece_of(*other) == piece);
    all
}

/// Compliance of a body at rest, independent of its later state: columns of one matrix, by its factor in f64 on the host (hexahedra) or
/// solved to [`EXACT`] (others), within the bound on iterations of others. Computed as nodes are reached.
#[derive(Default)]
pub struct AtRest {
    backend: Option<Box<CpuBackend<f64>>>,
    pub known: Compliance,
}

/// Relative residual of the columns at rest.
const EXACT: f64 = 1e-9;
/// Most iterations of springs to reach it.
const ITERATIONS: u32 = 100_000;

impl AtRest {
    /// Provides the columns of these nodes; see [`Compliance::prepare`].
    ///
    /// # Errors
    /// Those of [`Compliance::prepare`]; a CPU backend gives none.
    pub fn prepare(
        &mut self,
        model: &Model,
        (nodes, rest_shape): (&[u32], RestShape),
        most: usize,
        report: &mut StepReport,
    ) -> Result<()> {
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
        let solving = Solving { tolerance: EXACT, at_once: MOST_AT_ONCE, all: true };
        self.known.prepare(backend.as_mut(), (nodes, rest_shape), solving, most, report)
    }

    /// As [`Compliance::block`].
    pub fn block(&self, a: u32, b: u32) -> DMat3 {
        self.known.block(a, b)
    }
}

impl Body {
    /// Whether nothing holds a node: its body or its piece of it keeps its velocity.
    pub(in crate::step) fn falls(&self, node: u32) -> bool {
        let rest_shape = RestShape::of(&self.model, &self.wound, self.floats);
        rest_shape.floats || rest_shape.piece_of(node).is_some()
    }

    /// Provides the compliance of these nodes; returns the inverse blocks of `A` that the uncoupled correction uses instead.
    pub(in crate::step) fn prepare_compliance(
        &mut self,
        law: &scene::Contact,
        nodes: &[u32],
        solving: Solving,
        report: &mut StepReport,
    ) -> Result<Vec<DMat3>> {
        match law.correction {
            Correction::Exact => {
                let backend = self.backend.as_mut();
                let rest_shape = RestShape::of(&self.model, &self.wound, self.floats);
                self.compliance.prepare(backend, (nodes, rest_shape), solving, self.near, report)?;
            }
            Correction::Precomputed => {
                self.at_rest.prepare(
                    &self.model,
                    (nodes, RestShape::of(&self.model, &self.wound, false)),
                    self.near,
                    report,
                )?;
            }
            Correction::Uncoupled => {
                let blocks = self.backend.node_blocks(nodes)?;
                return Ok(blocks.iter().map(|b| DMat3::from_cols_array_2d(b).inverse()).collect());
            }
        }
        Ok(vec![])
    }

    /// Displacement of nodes under changes of the contact forces, solved to a residual of `tolerance`, N; m.
    pub(in crate::step) fn correct(
        &mut self,
        nodes: &[u32],
        forces: &[(u32, [f64; 3])],
        tolerance: f64,
        report: &mut StepReport,
    ) -> Result<Vec<[f64; 3]>> {
        if forces.iter().flat_map(|f| f.1).all(|f| f == 0.0) {
            // no change: nothing to solve
            self.reset_correction()?;
            return Ok(vec![[0.0; 3]; nodes.len()]);
        }
        let clock = Instant::now();
        let entries: Vec<_> = forces.iter().map(|(n, f)| (CORRECTION, *n, *f)).collect();
        self.backend.set_rows(&[CORRECTION], &entries)?;
        self.guess_correction(forces)?;
        let wanted = [SolveRequest { rhs: CORRECTION, target: Target::Absolute(tolerance) }];
        let pick: Vec<(usize, u32)> = nodes.iter().map(|n| (CORRECTION, *n)).collect();
        let (outcome, moved) = self.backend.solve(&wanted, &pick)?;
        report.correction_iterations += outcome[0].iterations;
        report.costs.iterations += outcome[0].iterations;
        report.costs.spend(Part::Corrections, clock);
        report.warn("solver_not_converged", u32::from(!outcome[0].converged));
        self.non_finite |= !outcome[0].residual.is_finite();
        Ok(moved)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;

    /// Compliance of nodes on a line that fades with their distance, with an error in each block and without compliance of the last node.
    fn of_line(count: u32, error: f64) -> (Vec<u32>, Compliance) {
        let (nodes, mut random): (Vec<u32>, _) = ((0..count).collect(), Random::new(5));
        let mut compliance = Compliance::default();
        compliance.known.extend(nodes.iter().map(|node| (*node, Known::default())));
        for a in 0..count {
            for b in 0..=a {
                let fades = (-0.02 * f64::from(a - b)).exp() * f64::from(u8::from(a + 1 < count));
                let block = DMat3::from_diagonal(DVec3::new(1.0, 0.7, 0.4) * fades);
                let off = DMat3::from_cols_array(&[0.0; 9].map(|_| error * random.signed() * fades));
                compliance.set(a, b, block + off);
            }
        }
        (nodes, compliance)
    }

    /// Least `λᵀ C λ / λᵀ λ` over alternating and random forces, of matrix blocks.
    fn least(blocks: &[DMat3], count: usize) -> f64 {
        let mut random = Random::new(3);
        let mut worst = f64::INFINITY;
        for try_ in 0..2000 {
            let sign = |k: usize| if k.is_multiple_of(2) { 1.0 } else { -1.0 };
            let forces: Vec<DVec3> = (0..count)
                .map(|k| DVec3::from_array([0.0; 3].map(|_| sign(k) + f64::from(try_ % 7) * random.signed())))
                .collect();
            let pair = |(k, block): (usize, &DMat3)| forces[k % count].dot(*block * forces[k / count]);
            let energy: f64 = blocks.iter().enumerate().map(pair).sum();
            worst = worst.min(energy / forces.iter().map(|f| f.length_squared()).sum::<f64>());
        }
        worst
    }

    #[test]
    fn loose_columns_become_positive_and_good_ones_stay() {
        let (nodes, loose) = of_line(20, 0.1);
        let plain: Vec<DMat3> = nodes.iter().flat_map(|a| nodes.iter().map(|b| loose.block(*a, *b))).collect();
        let made = loose.positive(&nodes);
        assert!(least(&plain, 20) < -1e-3, "the counter-test: the loose columns are positive: {:e}", least(&plain, 20));
        assert!(least(&made, 20) > 0.0, "{:e}", least(&made, 20));
        let size = |block: &DMat3| block.to_cols_array().iter().fold(0.0f64, |most, c| most.max(c.abs()));
        let change = made.iter().zip(&plain).map(|(a, b)| size(&(*a - *b))).fold(0.0, f64::max);
        assert!(change < 0.5, "columns with errors of 0.1 change by {change}");
        let own = |blocks: &[DMat3], k: usize| [0, 1, 2].map(|axis| blocks[k * 21].col(axis)[axis]);
        assert!((0..20).all(|k| own(&made, k) == own(&plain, k)), "a node's own compliance changes");
        assert!((0..20).all(|k| made[19 * 20 + k] == DMat3::ZERO), "a fixed node moves");
        for (a, b) in (0..20).flat_map(|a| (0..20).map(move |b| (a, b))) {
            let off = size(&(made[a * 20 + b] - made[b * 20 + a].transpose()));
            assert!(off < 1e-12, "no symmetry between {a} and {b}: {off:e}");
        }
        let (nodes, good) = of_line(20, 0.0);
        let plain: Vec<DMat3> = nodes.iter().flat_map(|a| nodes.iter().map(|b| good.block(*a, *b))).collect();
        assert_eq!(good.positive(&nodes), plain);
    }
}
