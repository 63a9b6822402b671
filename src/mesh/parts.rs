//! Connectivity under cuts: severed links between face-neighbour cells, and the connected components of cells around each node.
//!
//! The up to eight cells around a node are connected by the links between them. When a cut disconnects them, each component gets a node of
//! its own: one keeps the node, the others get duplicates (virtual nodes) from a reserve ([`crate::kernels::split`]), so no volume is lost.
//! A component that is divided again keeps its duplicate for one of its parts.
//!
//! The smoother works by z-columns, so duplicates of one node column should be consecutive in one duplicate column. The component that
//! keeps a node is therefore the one that shares most cells with that column's nodes right above and below; ties go to the one whose lowest
//! cell comes last by y, then x, then z. The others join the duplicate column that they share most cells with. They open a new one if they
//! share none, and use any with a free node if the reserve is used up or seven stand beside the node's column: a node has at most seven
//! duplicates. A vertical cut thus gives two complete columns. A horizontal cut has no such order: the upper component keeps the node, and
//! the lower one gets a duplicate without a neighbour at the next z-level, which is smoothed alone. Skin has its thin stiff layers on top,
//! where the coupling between z-levels matters most; with the opposite choice an undermined patch took three times as many iterations.
//!
//! A link whose cut would set free a piece of fewer than [`FRAGMENT`] cells holds. Cuts that cross leave such crumbs between the steps of the
//! grid, which no tissue has: too small to move as bodies, and so light (0.2 mg a cell) that what a solve leaves over throws them out of the
//! wound.
//!
//! Crossed links store the position of the crossing. A corner of the wound lies at the mean of the crossings around it, which gives a
//! smooth wound in a grid of boxes.
//! Source: Frisken-Gibson 1999 (linked cells); Molino, Bao, Fedkiw 2004 (virtual nodes); Dick, Georgii, Westermann 2011 (hexahedra); Ju,
//! Losasso, Schaefer, Warren 2002 (one vertex per dual cell at the mean of its edges' crossings).

use crate::kernels::split::NONE;
use crate::kernels::{Params, corner};
use std::collections::{BTreeMap, BTreeSet};

/// Maximum number of duplicates of a node, which has eight cells around it.
const COPIES: usize = 7;

/// Fewest cells of a piece that a cut sets free: two a side.
pub const FRAGMENT: usize = 8;

/// Changes by a cut.
#[derive(Clone, Debug, Default)]
pub struct Change {
    /// Severed links: cell and axis.
    pub links: Vec<(u32, usize)>,
    /// Number of links that stay intact because the reserve is used up.
    pub refused: u32,
    /// Number of links that stay intact because they alone hold a cell, or a piece too small to be free.
    pub holding: u32,
    /// New duplicates, each with the node whose state it copies, as of before the cut.
    pub copies: Vec<[u32; 2]>,
    /// Words of the table with their new values, each once.
    pub words: Vec<(u32, u32)>,
    /// Nodes whose cells have changed, sorted.
    pub nodes: Vec<u32>,
}

/// Severed links and duplicated nodes: see the module.
#[derive(Clone, Debug)]
pub struct Parts {
    pub(super) params: Params<f64>,
    pub(super) table: Vec<u32>,
    severed: Vec<u8>, // [cell] bit per axis: the link to the neighbour at +axis
    pub(super) crossings: BTreeMap<u32, f64>,
    used: usize,         // number of duplicate columns
    occupied: Vec<bool>, // [duplicate column][z-level]
    cells: Vec<u32>,     // split cells, in order of their rows
    touched: BTreeSet<u32>,
}

/// Changes by severing one link and the counts before it, for undoing them if the reserve runs out half-way.
struct Trial {
    used: usize,
    cells: usize,
    touched: usize,
    words: Vec<(usize, u32)>, // with their previous values
    copies: Vec<[u32; 2]>,
}

/// Offset of a cell around a node; the cell's number is z + 2 x + 4 y, 1 beyond the node, 0 before it.
pub(super) fn octant(n: usize) -> [usize; 3] {
    [n >> 1 & 1, n >> 2, n & 1]
}

/// Number of an offset among a cell's corners (VTK order).
pub(super) fn corner_number([x, y, z]: [usize; 3]) -> usize {
    (x ^ y) + 2 * y + 4 * z
}

impl Parts {
    /// Connectivity of an uncut grid; `params` limit the number of splits.
    pub fn new(params: Params<f64>) -> Self {
        let layout = params.layout();
        let extra = params.extra_columns as usize;
        let can_split = extra > 0;
        let mut table = vec![0; if can_split { layout.words } else { 0 }];
        if can_split {
            table[..layout.next].fill(NONE);
            table[layout.touched..].fill(NONE);
        }
        Self {
            table,
            severed: vec![0; if can_split { params.cell_count as usize } else { 0 }],
            crossings: BTreeMap::new(),
            used: 0,
            occupied: vec![false; extra * params.nodes_z as usize],
            cells: vec![],
            touched: BTreeSet::new(),
            params,
        }
    }

    /// Table for the kernels.
    pub fn table(&self) -> &[u32] {
        &self.table
    }

    /// Split cells, in order of their rows in the table.
    pub fn split_cells(&self) -> &[u32] {
        &self.cells
    }

    /// Ids of the eight corners of a cell.
    pub fn corners(&self, cell: usize) -> [usize; 8] {
        self.params.corner_nodes(&self.table, cell)
    }

    /// Original of a duplicate, a node of the grid; the node itself if it is no duplicate.
    pub fn original(&self, node: usize) -> usize {
        self.params.grid_coordinates(&self.table, node).map_or(node, |c| self.params.node_id(c))
    }

    /// Duplicates of a node of the grid.
    pub fn copies(&self, node: usize) -> Vec<u32> {
        let [x, y, level] = self.params.node_at(node);
        let beside = self.params.extra_columns_beside(&self.table, x + self.params.nodes_x as usize * y);
        let taken = beside.filter(|e| self.occupied[e * self.params.nodes_z as usize + level]);
        taken.map(|e| self.params.copy_id(e, level) as u32).collect()
    }

    /// Parent node columns of the duplicate columns in use.
    pub fn parents(&self) -> &[u32] {
        &self.table[..self.used]
    }

    /// True if the link of a cell to its neighbour at +axis is cut.
    pub fn is_severed(&self, cell: usize, axis: usize) -> bool {
        self.severed.get(cell).is_some_and(|bits| bits >> axis & 1 == 1)
    }

    /// Cut links: cell, axis, and position of the crossing along the link, 0 to 1.
    pub fn cuts(&self) -> impl Iterator<Item = (u32, usize, f64)> {
        self.crossings.iter().map(|(link, at)| (link / 3, (link % 3) as usize, *at))
    }

    /// Neighbour at +axis.
    pub fn beyond(&self, cell: usize, axis: usize) -> Option<usize> {
        let p = &self.params;
        let mut at = p.cell_at(cell);
        at[axis] += 1;
        (at[axis] < [p.cells_x, p.cells_y, p.cells_z][axis] as usize).then(|| p.cell_id(at))
    }

    /// Cell in octant `n` of the node at `c`, and the node's corner number in it.
    pub(super) fn cell_in(&self, c: [usize; 3], n: usize) -> Option<(usize, usize)> {
        let o = octant(n).map(|b| 1 - b);
        Some((self.params.cell_below(c, corner_number(o))?, corner_number(o)))
    }

    /// Component of each octant of a node, named by its lowest octant; octants without a cell are components of their own.
    fn parts_at(&self, c: [usize; 3]) -> [usize; 8] {
        let mut part = [0, 1, 2, 3, 4, 5, 6, 7];
        // a name propagates to the last octant within seven links
        for _ in 0..7 {
            for n in 0..8 {
                for (axis, bit) in [(0, 2), (1, 4), (2, 1)] {
                    if n & bit != 0 {
                        continue;
                    }
                    let (Some((cell, _)), Some(_)) = (self.cell_in(c, n), self.cell_in(c, n | bit)) else {
                        continue;
                    };
                    if !self.is_severed(cell, axis) {
                        let least = part[n].min(part[n | bit]);
                        (part[n], part[n | bit]) = (least, least);
                    }
                }
            }
        }
        part
    }

    /// Severs links (`3·cell + axis`, position along the link) in the given order; links that are already cut keep their state.
    pub fn cut(&mut self, hits: &[(u32, f64)]) -> Change {
        let mut change = Change::default();
        let mut words = BTreeSet::new();
        for (link, at) in hits {
            let (cell, axis) = ((link / 3) as usize, (link % 3) as usize);
            let Some(beyond) = self.beyond(cell, axis).filter(|_| !self.is_severed(cell, axis)) else { continue };
            if self.severed.is_empty() {
                change.refused += 1; // no reserve at all
                continue;
            }
            self.severed[cell] |= 1 << axis;
            if [cell, beyond].into_iter().any(|cell| self.is_fragment(cell)) {
                self.severed[cell] &= !(1 << axis);
                change.holding += 1;
                continue;
            }
            let mut trial = self.trial();
            // duplicate the four nodes of the face; undo everything if the reserve does not suffice
            let around = self.face(cell, axis).map(|node| self.params.node_at(node));
            if around.into_iter().any(|c| self.divide(c, &mut trial).is_none()) {
                self.take_back(trial);
                self.severed[cell] &= !(1 << axis);
                change.refused += 1;
                continue;
            }
            self.crossings.insert(*link, *at);
            change.links.push((cell as u32, axis));
            words.extend(trial.words.iter().map(|(word, _)| *word as u32));
            change.copies.extend(trial.copies);
        }
        let nodes: BTreeSet<u32> = change.copies.iter().flatten().copied().collect();
        // the source of a new duplicate may be new itself
        let sources: BTreeMap<u32, u32> = change.copies.iter().map(|[copy, source]| (*copy, *source)).collect();
        for [_, source] in &mut change.copies {
            while let Some(older) = sources.get(source) {
                *source = *older;
            }
        }
        change.words = words.into_iter().map(|word| (word, self.table[word as usize])).collect();
        change.nodes = nodes.into_iter().collect();
        change
    }

    /// Grid nodes of the face between a cell and its neighbour at +axis.
    fn face(&self, cell: usize, axis: usize) -> [usize; 4] {
        let corners = self.params.corners(cell);
        let mut beyond = (0..8).filter(|a| corner(*a)[axis] == 1).map(|a| corners[a]);
        std::array::from_fn(|_| beyond.next().expect("a face has four corners"))
    }

    fn trial(&self) -> Trial {
        let (used, cells, touched) = (self.used, self.cells.len(), self.touched.len());
        Trial { used, cells, touched, words: vec![], copies: vec![] }
    }

    /// Undoes the changes.
    fn take_back(&mut self, trial: Trial) {
        let first = self.params.layout().touched;
        for node in &self.table[first + trial.touched..first + self.touched.len()] {
            self.touched.remove(node);
        }
        for (word, before) in trial.words.into_iter().rev() {
            self.table[word] = before;
        }
        for (e, level) in trial.copies.iter().map(|[copy, _]| self.params.copy_at(*copy as usize)) {
            self.occupied[e * self.params.nodes_z as usize + level] = false;
        }
        self.cells.truncate(trial.cells);
        self.used = trial.used;
    }

    /// Gives each component at a node its own node; `None` if the reserve does not suffice.
    fn divide(&mut self, c: [usize; 3], trial: &mut Trial) -> Option<()> {
        let part = self.parts_at(c);
        // components of each node, in order of their lowest octants
        let mut of_node: BTreeMap<usize, Vec<Vec<(usize, usize)>>> = BTreeMap::new();
        for name in 0..8 {
            let own: Vec<(usize, usize)> =
                (0..8).filter(|n| part[*n] == name).filter_map(|n| self.cell_in(c, n)).collect();
            if let Some((cell, a)) = own.first() {
                of_node.entry(self.corners(*cell)[*a]).or_default().push(own);
            }
        }
        for (node, mut parts) in of_node {
            // the component with most cells in the node's column keeps the node, the others get duplicates
            let column = self.column_of(node);
            let shared = |own: &[(usize, usize)]| self.shares(own, column);
            let most = parts.iter().map(|own| shared(own)).max().unwrap_or(0);
            let keeper = parts.iter().rposition(|own| shared(own) == most).unwrap_or(0);
            parts.remove(keeper);
            for own in parts {
                let copy = self.take_copy(c, &own, trial)? as u32;
                trial.copies.push([copy, node as u32]);
                for (cell, a) in own {
                    self.set_corner(cell, a, copy, trial)?;
                }
            }
        }
        Some(())
    }

    /// Column of a node; grid columns come first.
    fn column_of(&self, node: usize) -> usize {
        let (columns, grid) = (self.params.columns(), self.params.grid_nodes());
        if node < grid { node % columns } else { columns + self.params.copy_at(node).0 }
    }

    /// Number of cells of a component whose corner right above or below lies in a column.
    fn shares(&self, own: &[(usize, usize)], column: usize) -> usize {
        own.iter().filter(|(cell, a)| self.column_of(self.corners(*cell)[a ^ 4]) == column).count()
    }

    /// Takes a duplicate of the node at `c` for a component.
    fn take_copy(&mut self, c: [usize; 3], own: &[(usize, usize)], trial: &mut Trial) -> Option<usize> {
        let levels = self.params.nodes_z as usize;
        let parent = c[0] + self.params.nodes_x as usize * c[1];
        let mut best: Option<(usize, usize)> = None; // shared cells, duplicate column
        let mut beside = 0;
        for e in self.params.extra_columns_beside(&self.table, parent) {
            beside += 1;
            let shared = self.shares(own, self.params.columns() + e);
            if !self.occupied[e * levels + c[2]] && best.is_none_or(|(most, _)| shared > most) {
                best = Some((shared, e));
            }
        }
        let joined = best.filter(|(shared, _)| *shared > 0 || beside >= COPIES).map(|(_, e)| e);
        let e = joined.or_else(|| self.take_column(parent, trial)).or(best.map(|(_, e)| e))?;
        self.occupied[e * levels + c[2]] = true;
        Some(self.params.copy_id(e, c[2]))
    }

    /// Opens a duplicate column beside a node column.
    fn take_column(&mut self, parent: usize, trial: &mut Trial) -> Option<usize> {
        let (e, extra) = (self.used, self.params.extra_columns as usize);
        if e == extra {
            return None;
        }
        self.used += 1;
        self.set(e, parent as u32, trial);
        let layout = self.params.layout();
        self.set(layout.next + e, self.table[layout.first + parent], trial);
        self.set(layout.first + parent, e as u32 + 1, trial);
        Some(e)
    }

    fn set(&mut self, word: usize, value: u32, trial: &mut Trial) {
        trial.words.push((word, std::mem::replace(&mut self.table[word], value)));
    }

    fn set_corner(&mut self, cell: usize, a: usize, node: u32, trial: &mut Trial) -> Option<()> {
        let layout = self.params.layout();
        if self.table[layout.row + cell] == 0 {
            if self.cells.len() == self.params.split_cells as usize {
                return None;
            }
            self.cells.push(cell as u32);
            self.set(layout.row + cell, self.cells.len() as u32, trial);
            for (b, corner) in self.params.corners(cell).into_iter().enumerate() {
                self.set(layout.corners + (self.cells.len() - 1) * 8 + b, corner as u32, trial);
                self.touch(corner as u32, trial)?;
            }
        }
        let row = self.table[layout.row + cell] as usize - 1;
        self.set(layout.corners + row * 8 + a, node, trial);
        self.touch(node, trial)
    }

    fn touch(&mut self, node: u32, trial: &mut Trial) -> Option<()> {
        if self.touched.contains(&node) {
            return Some(());
        }
        if self.touched.len() == self.params.touched_nodes as usize {
            return None;
        }
        self.set(self.params.layout().touched + self.touched.len(), node, trial);
        self.touched.insert(node);
        Some(())
    }

    /// True for a node of the grid and for a duplicate that has been taken.
    pub fn in_use(&self, node: usize) -> bool {
        node < self.params.grid_nodes() || !self.cells_of(node).is_empty()
    }

    /// Cells around a node.
    pub fn cells_of(&self, node: usize) -> Vec<usize> {
        let Some(c) = self.params.grid_coordinates(&self.table, node) else {
            return vec![];
        };
        let own = (0..8).filter_map(|n| self.cell_in(c, n));
        own.filter(|(cell, a)| self.corners(*cell)[*a] == node).map(|(cell, _)| cell).collect()
    }
}

impl Parts {
    /// Cells to which a cell is linked.
    pub fn linked(&self, cell: usize) -> impl Iterator<Item = usize> {
        let strides = [1, self.params.cells_x as usize, (self.params.cells_x * self.params.cells_y) as usize];
        let at = self.params.cell_at(cell);
        (0..3).flat_map(move |axis| {
            let before = (at[axis] > 0).then(|| cell - strides[axis]).filter(|b| !self.is_severed(*b, axis));
            before.into_iter().chain(self.beyond(cell, axis).filter(|_| !self.is_severed(cell, axis)))
        })
    }

    /// Whether a cell is of a piece of fewer than [`FRAGMENT`] cells.
    fn is_fragment(&self, cell: usize) -> bool {
        let mut piece = vec![cell];
        let mut next = 0;
        while next < piece.len() && piece.len() < FRAGMENT {
            let own = piece[next];
            for other in self.linked(own) {
                if !piece.contains(&other) {
                    piece.push(other);
                }
            }
            next += 1;
        }
        piece.len() < FRAGMENT
    }

    /// Number of connected pieces of the remaining cells.
    pub fn pieces(&self, alive: &[bool]) -> usize {
        let mut seen: Vec<bool> = alive.iter().map(|live| !live).collect();
        let mut count = 0;
        let mut open = vec![];
        for first in 0..seen.len() {
            if std::mem::replace(&mut seen[first], true) {
                continue;
            }
            count += 1;
            open.push(first);
            while let Some(cell) = open.pop() {
                for next in self.linked(cell) {
                    if !std::mem::replace(&mut seen[next], true) {
                        open.push(next);
                    }
                }
            }
        }
        count
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Grid;

    /// Links of all faces between a box of cells and the rest, in order.
    fn around(parts: &Parts, cells: [std::ops::Range<usize>; 3]) -> Vec<(u32, f64)> {
        let inside = |cell: usize| (0..3).all(|n| cells[n].contains(&parts.params.cell_at(cell)[n]));
        let all = (0..parts.params.cell_count as usize).flat_map(|cell| (0..3).map(move |axis| (cell, axis)));
        let faces = all.filter(|(cell, axis)| parts.beyond(*cell, *axis).is_some_and(|b| inside(b) != inside(*cell)));
        faces.map(|(cell, axis)| ((3 * cell + axis) as u32, 0.5)).collect()
    }

    fn block() -> Parts {
        let grid = Grid {
            cells: [5, 5, 4],
            nodes: [6, 6, 5],
            edge: [1e-3, 1e-3],
            heights: vec![0.0, 1e-3, 2e-3, 3e-3, 4e-3],
            layer_of: vec![0; 4],
            unstructured: None,
            embedded: None,
        };
        let params = Params { extra_columns: 60, split_cells: 100, touched_nodes: 400, ..grid.params() };
        Parts::new(Params { node_count: params.node_count + 60 * params.nodes_z, ..params })
    }

    #[test]
    fn pieces_too_small_to_be_bodies_are_not_set_free() {
        let alive = [true; 100];
        // (a box of cells, links that hold it)
        for (cells, holding) in [
            ([0..1, 0..1, 3..4], 1),
            ([2..3, 2..3, 1..2], 1),
            ([0..5, 0..1, 3..4], 1),
            ([1..3, 1..3, 2..3], 1),
            ([1..3, 1..3, 2..4], 0),
            ([0..3, 0..3, 3..4], 0),
        ] {
            let mut parts = block();
            let links = around(&parts, cells.clone());
            let change = parts.cut(&links);
            assert_eq!((change.holding, change.refused), (holding, 0), "{cells:?}");
            assert_eq!(change.links.len() + holding as usize, links.len(), "{cells:?}");
            assert_eq!(parts.pieces(&alive), if holding > 0 { 1 } else { 2 }, "{cells:?}");
            // a second crossing is counted again and cuts nothing
            let again = parts.cut(&links);
            assert_eq!((again.holding, again.links.len()), (holding, 0), "{cells:?}");
        }
    }

    /// A piece that is cut smaller and smaller stays with the rest as soon as it is too small.
    #[test]
    fn a_free_piece_is_not_divided_into_fragments() {
        let mut parts = block();
        let links = around(&parts, [1..3, 1..3, 2..4]);
        parts.cut(&links);
        assert_eq!(parts.pieces(&[true; 100]), 2);
        let change = parts.cut(&around(&parts, [1..2, 1..3, 2..4]));
        assert_eq!((change.holding, change.links.len()), (1, 3), "four links between its halves");
        assert_eq!(parts.pieces(&[true; 100]), 2);
    }
}
