//! Forked columns: node columns of a cut grid in which a vertical edge of a cell joins nodes of different z-columns.
//!
//! Where a wound ends inside the tissue, two nodes lie above one: the column goes on with one of them, and the other is the lowest of a column of
//! duplicates. (Or two below one, where it is closed further up.) The kernels solve each z-column by itself and leave out the edges between them
//! ([`crate::kernels::blocks`]), which in thin layers are the stiffest of all. On the finest level of the CPU path the smoother therefore solves all
//! nodes at such an (x, y) together and exactly. Iterations to 10⁻⁵ of the load in incision_shapes.toml: 6 before the cut; after its first two cuts
//! 16, without this 32; while a flap is cut 21, and 24.
//! Tried: virtual cells on the coarse levels (Dick, Georgii, Westermann 2011). After two cuts 24 without this and 16 with it, as with this alone; on the
//! flap 15 with it, at the tolerance of shipped scenes no time gained.
//!
//! Factored as block LDLᵀ of 3×3 blocks from the top down: fill-in only where a node lies above two.
//! Source: Golub, Van Loan 2013, section 4.5; elimination of trees: George, Liu 1981.

use crate::kernels::Params;
use crate::kernels::blocks::{Block, finish, is_chained, masked, of_corner, unpack};
use crate::kernels::factor::inverse_of_definite;
use crate::kernels::linearised::{HYPERELASTIC, Rows};
use crate::kernels::split::NONE;
use crate::math::{M3, Real, V3, V4, rotation_matrix};
use rayon::prelude::*;
use std::ops::Range;

/// All forked columns of a body.
pub struct Forks<R> {
    all: Vec<Fork<R>>,
}

/// The nodes at one (x, y), numbered from the top down.
struct Fork<R> {
    /// Ids of the nodes.
    nodes: Vec<u32>,
    /// Vertical edges of the cells around.
    edges: Vec<Edge>,
    /// `[node]` where its couplings end; those of a node follow those of the one before.
    ends: Vec<usize>,
    /// Number of the later node of each coupling.
    to: Vec<usize>,
    /// `[node]` `D`, then `D'⁻¹`
    diagonal: Vec<M3<R>>,
    /// `[coupling]` `U`, from the later node to the earlier one, then `G = D'⁻¹ U`
    coupling: Vec<M3<R>>,
}

/// A vertical edge of a cell.
struct Edge {
    cell: usize,
    /// Its lower corner.
    corner: usize,
    /// Numbers of the upper and the lower node.
    nodes: [usize; 2],
}

/// At a node of a fork: the load and then `M⁻¹(r − w)`, and `d` and `z` before the smoothing step.
pub type Before<R> = [V4<R>; 3];

impl<R> Default for Forks<R> {
    fn default() -> Self {
        Self { all: vec![] }
    }
}

impl<R: Real> Forks<R> {
    /// Those of a table of split nodes, without factors.
    pub fn new(params: &Params<R>, split: &[u32]) -> Self {
        let extra = (params.extra_columns as usize).min(split.len());
        let mut columns: Vec<u32> = split[..extra].iter().copied().filter(|parent| *parent != NONE).collect();
        columns.sort_unstable();
        columns.dedup();
        Self {
            all: columns
                .par_iter()
                .with_min_len(16)
                .filter_map(|column| Fork::new(params, split, *column as usize))
                .collect(),
        }
    }

    /// Nodes of each, from the top down.
    pub fn nodes(&self) -> impl Iterator<Item = &[u32]> {
        self.all.iter().map(|fork| &fork.nodes[..])
    }

    /// Factors all of them; arguments as of [`crate::kernels::blocks::blocks`].
    pub fn factor(
        &mut self,
        params: &Params<R>,
        stiffness: &[M3<R>],
        layer_of: &[u32],
        rotation: &[V4<R>],
        dofs: &[V4<R>],
    ) {
        let one = |fork: &mut Fork<R>| fork.factor(params, stiffness, layer_of, rotation, dofs);
        self.all.par_iter_mut().with_min_len(8).for_each(one);
    }

    /// Solves with `r − w`, with `r` alone from a zero guess, before the smoothing step that takes the columns apart.
    pub fn solve(&self, fresh: bool, [r, w, d, z]: [&[V4<R>]; 4], out: &mut Vec<Before<R>>) {
        out.clear();
        for fork in &self.all {
            let first = out.len();
            let load = |n: usize| std::array::from_fn(|c| if fresh { r[n][c] } else { r[n][c] - w[n][c] });
            out.extend(fork.nodes.iter().map(|n| *n as usize).map(|n| [load(n), d[n], z[n]]));
            fork.solve(&mut out[first..]);
        }
    }

    /// Replaces what the step has found; returns what that changes of `r·z`.
    pub fn replace(
        &self,
        before: &[Before<R>],
        params: &Params<R>,
        r: &[V4<R>],
        d: &mut [V4<R>],
        z: &mut [V4<R>],
    ) -> R {
        let mut change = R::zero();
        let nodes = self.all.iter().flat_map(|fork| &fork.nodes).map(|node| *node as usize);
        for (node, [solution, old_d, old_z]) in nodes.zip(before) {
            let found = z[node];
            for c in 0..3 {
                let [kept, sum] = if params.fresh == 1 { [R::zero(); 2] } else { [old_d[c] * params.keep, old_z[c]] };
                d[node][c] = solution[c] * params.gain + kept;
                z[node][c] = sum + d[node][c];
                change += r[node][c] * (z[node][c] - found[c]);
            }
        }
        change
    }
}

impl<R: Real> Fork<R> {
    /// That of a column of the grid, if an edge there joins different columns.
    fn new(params: &Params<R>, split: &[u32], column: usize) -> Option<Self> {
        let [x, y] = [column % params.nodes_x as usize, column / params.nodes_x as usize];
        let (mut found, mut forked) = (vec![], false);
        for level in 0..params.cells_z as usize {
            for corner in 0..4 {
                let Some(cell) = params.cell_below([x, y, level], corner) else { continue };
                let corners = params.corner_nodes(split, cell);
                forked |= !is_chained(params, corners[corner], corner, &corners);
                found.push((cell, corner, [corners[corner + 4], corners[corner]]));
            }
        }
        if !forked {
            return None;
        }
        // nodes from the top down
        let level = |node: &u32| params.grid_coordinates(split, *node as usize).map(|at| std::cmp::Reverse(at[2]));
        let mut nodes: Vec<u32> = found.iter().flat_map(|(.., nodes)| nodes.map(|node| node as u32)).collect();
        nodes.sort_unstable_by_key(|node| (level(node), *node));
        nodes.dedup();
        let number = |node: usize| nodes.iter().position(|n| *n as usize == node).expect("a node of the column");
        let edges: Vec<Edge> =
            found.into_iter().map(|(cell, corner, of)| Edge { cell, corner, nodes: of.map(number) }).collect();
        // couplings with later nodes, and those of the fill-in
        let mut coupled: Vec<Vec<usize>> = vec![vec![]; nodes.len()];
        for Edge { nodes: [upper, lower], .. } in &edges {
            coupled[*upper].push(*lower);
        }
        for n in 0..nodes.len() {
            coupled[n].sort_unstable();
            coupled[n].dedup();
            let later = coupled[n].clone();
            for (i, first) in later.iter().enumerate() {
                coupled[*first].extend(&later[i + 1..]);
            }
        }
        let mut ends: Vec<usize> = coupled.iter().map(Vec::len).collect();
        (1..ends.len()).for_each(|n| ends[n] += ends[n - 1]);
        let to = coupled.concat();
        let diagonal = vec![M3::zero(); nodes.len()];
        Some(Self { edges, ends, diagonal, coupling: vec![M3::zero(); to.len()], to, nodes })
    }

    /// Couplings of a node with later ones.
    fn couplings(&self, node: usize) -> Range<usize> {
        node.checked_sub(1).map_or(0, |before| self.ends[before])..self.ends[node]
    }

    /// Number of the coupling of a node with a later one.
    fn coupling(&self, node: usize, later: usize) -> usize {
        let own = self.couplings(node);
        own.start + self.to[own].iter().position(|to| *to == later).expect("they are coupled")
    }

    fn factor(
        &mut self,
        params: &Params<R>,
        stiffness: &[M3<R>],
        layer_of: &[u32],
        rotation: &[V4<R>],
        dofs: &[V4<R>],
    ) {
        self.diagonal.fill(M3::zero());
        self.coupling.fill(M3::zero());
        // stiffness of the edges
        for n in 0..self.edges.len() {
            let Edge { cell, corner: a, nodes: [upper, lower] } = self.edges[n];
            let own = &stiffness[layer_of[params.cell_at(cell)[2]] as usize * 64..][..64];
            let rows = (params.corotational >= HYPERELASTIC).then(|| Rows::of(params, rotation, cell));
            let turned = rotation_matrix(rotation[cell]);
            let [below, between] = of_corner(a, own[a * 8 + a], own[a * 8 + a + 4], turned, rows);
            let [above, _] = of_corner(a + 4, own[(a + 4) * 9], own[(a + 4) * 9], turned, rows);
            self.diagonal[lower] = self.diagonal[lower] + below;
            self.diagonal[upper] = self.diagonal[upper] + above;
            let coupling = self.coupling(upper, lower);
            self.coupling[coupling] = self.coupling[coupling] + between.transpose();
        }
        // inertia and fixed axes
        for n in 0..self.nodes.len() {
            let own = dofs[self.nodes[n] as usize];
            let block = Block { d: self.diagonal[n], g: M3::zero() };
            self.diagonal[n] = unpack(&finish(params, block, own, V3::zero())).d;
            for coupling in self.couplings(n) {
                let later = V3::from4(dofs[self.nodes[self.to[coupling]] as usize]);
                self.coupling[coupling] =
                    masked(self.coupling[coupling] * params.stiffness_factor, V3::from4(own), later);
            }
        }
        // elimination
        for n in 0..self.nodes.len() {
            let inverse = inverse_of_definite(self.diagonal[n]);
            self.diagonal[n] = inverse;
            let own = self.couplings(n);
            for first in own.clone() {
                let upper = self.coupling[first].transpose();
                let g = inverse * self.coupling[first];
                let later = self.to[first];
                self.diagonal[later] = self.diagonal[later] - upper * g;
                for second in first + 1..own.end {
                    let between = self.coupling(later, self.to[second]);
                    self.coupling[between] = self.coupling[between] - upper * (inverse * self.coupling[second]);
                }
                self.coupling[first] = g;
            }
        }
    }

    /// Replaces loads by the solution, the first of each three values.
    fn solve(&self, values: &mut [Before<R>]) {
        let at = |values: &[Before<R>], n: usize| V3::from4(values[n][0]);
        for n in 0..self.nodes.len() {
            let own = at(values, n);
            for coupling in self.couplings(n) {
                let later = self.to[coupling];
                let left = at(values, later) - self.coupling[coupling].transpose() * own;
                values[later][0] = left.pad(R::zero());
            }
        }
        for n in (0..self.nodes.len()).rev() {
            let mut own = self.diagonal[n] * at(values, n);
            for coupling in self.couplings(n) {
                own = own - self.coupling[coupling] * at(values, self.to[coupling]);
            }
            values[n][0] = own.pad(R::zero());
        }
    }
}
