//! Table of split nodes of a cut body, as read by all kernels.
//!
//! A node whose cells are no longer connected exists once per connected component: as the grid's node, and as duplicates (virtual nodes).
//! Duplicates lie in *extra columns*, z-columns in addition to the grid's, each assigned to one of its node columns (its *parent*): node
//! `k` of an extra column duplicates the node at z-level `k` of the parent. Unused nodes of an extra column have an empty DOF mask and no
//! mass.
//!
//! Nodes are numbered grid first, then bundle by bundle of [`BUNDLE`] extra columns (the last bundle has the rest). Each bundle is laid out
//! like a grid of one row: level by level, the columns of a level side by side. Columns are taken in order, so the nodes in use are the
//! first ones of all arrays: beyond the last bundle with a used column everything keeps its initial value, and no kernel runs there.
//!
//! A *split cell* has a duplicate among its corners. It has a row of eight node ids, one per corner; other cells have the corners of the
//! grid. *Touched* nodes are the corners of split cells.
//!
//! One array of 32-bit words, empty where nothing can be split (`params.extra_columns` 0): `parent [extra column]` node column, or
//! [`NONE`]; `next [extra column]` and `first [node column]`, 1 + the next extra column of the same parent, or 0; `row [cell]`, 1 + its row
//! in `corners`, or 0; `touched [touched_nodes]` node ids, then [`NONE`]; `corners [split_cells × 8]`.
//! Source: Molino, Bao, Fedkiw 2004 (virtual nodes); Dick, Georgii, Westermann 2011 (hexahedra).

use super::{Params, corner};
use crate::math::Real;

/// Text that [`super::text`] adds to kernels that bind `split`.
pub const WGSL: &str = include_str!("split.wgsl");

/// Number of extra columns laid out together, equal to the number that the CPU path processes at once.
pub const BUNDLE: usize = super::PART;

/// Marks the absence of a column or node.
pub const NONE: u32 = u32::MAX;

/// A cell around a node.
#[derive(Clone, Copy, Debug)]
pub struct Around {
    /// The node's corner of it.
    pub corner: usize,
    /// Its number.
    pub cell: usize,
    /// Its coordinate along z.
    pub level: usize,
}

/// Offsets of the table's sections, in words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// `next [extra column]`; `parent` begins at 0.
    pub next: usize,
    /// `first [node column]`
    pub first: usize,
    /// `row [cell]`
    pub row: usize,
    /// `touched [touched_nodes]`
    pub touched: usize,
    /// `corners [split_cells × 8]`
    pub corners: usize,
    /// Total number of words.
    pub words: usize,
}

impl<R: Real> Params<R> {
    /// Number of node columns of the grid.
    pub fn columns(&self) -> usize {
        (self.nodes_x * self.nodes_y) as usize
    }
    /// Number of nodes of the grid, without duplicates.
    pub fn grid_nodes(&self) -> usize {
        self.columns() * self.nodes_z as usize
    }
    /// Offsets of the table's sections.
    pub fn layout(&self) -> Layout {
        let extra = self.extra_columns as usize;
        let row = 2 * extra + self.columns();
        let touched = row + self.cell_count as usize;
        let corners = touched + self.touched_nodes as usize;
        Layout { next: extra, first: 2 * extra, row, touched, corners, words: corners + 8 * self.split_cells as usize }
    }
    /// Number of extra columns in an array of `node_count` nodes.
    pub fn extra_allocated(&self) -> usize {
        (self.node_count as usize - self.grid_nodes()) / self.nodes_z as usize
    }
    /// Number of extra columns in bundles that have at least one column in use.
    pub fn extra_in_use(&self, split: &[u32]) -> usize {
        let extra = (self.extra_columns as usize).min(split.len());
        let used = split[..extra].iter().position(|parent| *parent == NONE).unwrap_or(extra);
        used.next_multiple_of(BUNDLE).min(extra)
    }
    /// Number of nodes of the grid and of these bundles.
    pub fn nodes_in_use(&self, split: &[u32]) -> usize {
        self.grid_nodes() + self.extra_in_use(split) * self.nodes_z as usize
    }
    /// First column of an extra column's bundle, and the bundle's number of columns.
    fn bundle(&self, e: usize) -> (usize, usize) {
        let first = e / BUNDLE * BUNDLE;
        (first, (self.extra_columns as usize - first).min(BUNDLE))
    }
    /// Node at a z-level of an extra column.
    pub fn copy_id(&self, e: usize, level: usize) -> usize {
        let (first, width) = self.bundle(e);
        self.grid_nodes() + first * self.nodes_z as usize + level * width + e - first
    }
    /// Extra column and z-level of a duplicate node.
    pub fn copy_at(&self, node: usize) -> (usize, usize) {
        let (rest, levels) = (node - self.grid_nodes(), self.nodes_z as usize);
        let (first, width) = self.bundle(rest / levels);
        let within = rest - first * levels;
        (first + within % width, within / width)
    }
    /// The grid's columns, then the bundles of `node_count` nodes, each as a grid of its own, with its first node.
    pub fn column_sets(&self) -> impl Iterator<Item = (usize, Self)> {
        let own = Self { node_count: self.grid_nodes() as u32, extra_columns: 0, ..*self };
        let bundles = (0..self.extra_allocated()).step_by(BUNDLE).map(move |e| {
            let width = self.bundle(e).1 as u32;
            (self.copy_id(e, 0), Self { nodes_x: width, nodes_y: 1, node_count: width * self.nodes_z, ..own })
        });
        std::iter::once((0, own)).chain(bundles)
    }
    /// True if a cell has duplicates among its corners.
    pub fn is_split(&self, split: &[u32], cell: usize) -> bool {
        self.extra_columns > 0 && split[self.layout().row + cell] != 0
    }
    /// Ids of the eight corners of a cell.
    pub fn corner_nodes(&self, split: &[u32], cell: usize) -> [usize; 8] {
        if self.extra_columns > 0 {
            let layout = self.layout();
            let row = split[layout.row + cell] as usize;
            if row > 0 {
                let first = layout.corners + (row - 1) * 8;
                return std::array::from_fn(|a| split[first + a] as usize);
            }
        }
        self.corners(cell)
    }
    /// Grid coordinates of a node, or of a duplicate's original; `None` in an extra column that is not in use.
    pub fn grid_coordinates(&self, split: &[u32], node: usize) -> Option<[usize; 3]> {
        let columns = self.columns();
        let (column, level) = if node < self.grid_nodes() {
            (node % columns, node / columns)
        } else {
            let (e, level) = self.copy_at(node);
            if split[e] == NONE {
                return None;
            }
            (split[e] as usize, level)
        };
        Some([column % self.nodes_x as usize, column / self.nodes_x as usize, level])
    }
    /// Cells around a node, by its corner number in each; none for an unused duplicate.
    pub fn cells_around<'a>(&'a self, split: &'a [u32], node: usize) -> impl Iterator<Item = Around> + 'a {
        let coordinates = self.grid_coordinates(split, node);
        (0..8).filter_map(move |a| {
            let at = coordinates?;
            let cell = self.cell_below(at, a)?;
            // only split cells have other corners than the grid's nodes
            let here = match self.is_split(split, cell) {
                true => self.corner_nodes(split, cell)[a] == node,
                false => node < self.grid_nodes(),
            };
            here.then(|| Around { corner: a, cell, level: at[2] - corner(a)[2] })
        })
    }
    /// Extra columns of a parent, latest first.
    pub fn extra_columns_beside(&self, split: &[u32], column: usize) -> impl Iterator<Item = usize> {
        let layout = self.layout();
        let first = if self.extra_columns > 0 { split[layout.first + column] } else { 0 };
        let number = |next: u32| (next as usize).checked_sub(1);
        std::iter::successors(number(first), move |e| number(split[layout.next + e]))
    }
    /// Node above in the same column; at the top, an id beyond the last node of its kind.
    pub fn above(&self, node: usize) -> usize {
        node + if node < self.grid_nodes() { self.columns() } else { self.bundle(self.copy_at(node).0).1 }
    }
    /// Touched nodes.
    pub fn touched<'a>(&self, split: &'a [u32]) -> &'a [u32] {
        if self.extra_columns == 0 {
            return &[];
        }
        let layout = self.layout();
        let all = &split[layout.touched..layout.corners];
        &all[..all.iter().position(|node| *node == NONE).unwrap_or(all.len())]
    }
}

/// Split cells, in order of their rows in the table.
pub fn split_cells<R: Real>(params: &Params<R>, split: &[u32]) -> Vec<u32> {
    if params.extra_columns == 0 {
        return vec![];
    }
    let row = params.layout().row;
    let rows = &split[row..row + params.cell_count as usize];
    let mut own: Vec<(u32, u32)> =
        (0u32..).zip(rows).filter(|(_, row)| **row > 0).map(|(cell, row)| (*row, cell)).collect();
    own.sort_unstable();
    own.into_iter().map(|(_, cell)| cell).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn copies_are_numbered_bundle_by_bundle_without_a_hole() {
        let extra = 2 * BUNDLE as u32 + 11;
        let grid = Params::<f64> { nodes_x: 3, nodes_y: 5, nodes_z: 4, ..Params::default() };
        let params = Params { extra_columns: extra, node_count: 60 + 4 * extra, ..grid };
        let mut ids: Vec<usize> = vec![];
        for (e, level) in (0..extra as usize).flat_map(|e| (0..4).map(move |level| (e, level))) {
            let node = params.copy_id(e, level);
            assert_eq!(params.copy_at(node), (e, level));
            assert!(level == 3 || params.above(node) == params.copy_id(e, level + 1));
            ids.push(node);
        }
        ids.sort_unstable();
        assert_eq!(ids, (60..params.node_count as usize).collect::<Vec<_>>());
    }

    #[test]
    fn the_nodes_in_use_are_the_first_ones() {
        let extra = 2 * BUNDLE as u32 + 11;
        let params = Params::<f64> { nodes_x: 3, nodes_y: 5, nodes_z: 4, extra_columns: extra, ..Params::default() };
        let columns = |used: usize| {
            let split: Vec<u32> = (0..extra as usize).map(|e| if e < used { 7 } else { NONE }).collect();
            assert!((0..used).all(|e| (0..4).all(|level| params.copy_id(e, level) < params.nodes_in_use(&split))));
            (params.nodes_in_use(&split) - 60) / 4
        };
        assert_eq!([0, 1, BUNDLE, BUNDLE + 1].map(columns), [0, BUNDLE, BUNDLE, 2 * BUNDLE]);
        assert_eq!(columns(extra as usize), extra as usize, "the last bundle has what is left");
    }
}
