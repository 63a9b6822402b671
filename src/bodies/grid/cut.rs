//! Cuts through hexahedra, and carving. Links between cells are severed and nodes are duplicated ([`Parts`](crate::mesh::Parts)); each
//! duplicate gets the mass of its cells. Alternatively, a crossed link removes the cell in whose half the blade crossed it. A node without
//! cells leaves the system.
//!
//! Arrays and the product over the grid stay unchanged: cells with duplicates among their corners are added one by one
//! ([`crate::kernels::split_product`]), the smoother includes the duplicate columns (joined to the grid's by [`super::forks`]), and the
//! coarse levels ignore the cut. Unused duplicates are at the end of all arrays, and no kernel runs over them. Connected components are
//! found on the host, where the hits are anyway: 0.03 ms of a cutting step of the default scene, as much as one empty round trip to a device.
//! Source: severed links between cells: Frisken-Gibson 1999 (linked volumes); node duplication per connected component: Molino, Bao,
//! Fedkiw 2004 (virtual nodes); Dick, Georgii, Westermann 2011 (hexahedra).

use super::Hyperelastic;
use crate::bodies::{Model, Removal, Wound};
use crate::kernels::corner;
use crate::kernels::cut::Hit;
use crate::mesh::{Carved, Change, FRAGMENT, LEAST};
use crate::scene::Mass;

impl Wound {
    /// Severs links and duplicates nodes.
    pub(super) fn split(&mut self, model: &Model, hits: &[Hit<f64>]) -> Removal {
        let links: Vec<(u32, f64)> = hits.iter().map(|hit| (hit.segment, hit.at)).collect();
        let Change { links, refused, holding, copies, words, nodes } = self.surface.parts.cut(&links);
        let params = model.grid.params::<f64>();
        let shape = |cell: usize| model.shape[model.grid.layer(cell)];
        // area and extent of the severed faces
        for (cell, axis) in &links {
            let h = shape(*cell as usize);
            self.totals.area += h[0] * h[1] * h[2] / h[*axis];
            self.measure(model, *cell as usize, *axis);
        }
        self.totals.links += links.len();
        self.totals.refused += refused as usize;
        self.totals.holding += holding as usize;
        self.totals.copies += copies.len();
        let mut removal = Removal { copies, words, ..Removal::default() };
        // rest positions of duplicates
        for [copy, source] in &removal.copies {
            self.rest[*copy as usize] = self.rest[*source as usize];
        }
        // masses in proportion to the cells that a node keeps
        for node in nodes {
            let parts = &self.surface.parts;
            let original = parts.original(node as usize);
            let whole = model.dofs[original];
            let around = |node: usize| parts.cells_of(node).into_iter().map(|cell| shape(cell)[3]).sum::<f64>();
            let corners = around(node as usize);
            // a uniform mass is divided by the cells' corner masses
            let all = match model.mass {
                Mass::Uniform => (0..8)
                    .filter_map(|a| params.cell_below(params.node_at(original), a))
                    .map(|cell| shape(cell)[3])
                    .sum(),
                Mass::Lumped | Mass::Consistent => whole[3],
            };
            self.dofs[node as usize] = [whole[0], whole[1], whole[2], whole[3] * corners / all];
            removal.dofs.push((node, self.dofs[node as usize]));
        }
        removal
    }

    /// Extends the wound by the face of a severed link.
    fn measure(&mut self, model: &Model, cell: usize, axis: usize) {
        let params = model.grid.params::<f64>();
        let topmost = params.cell_at(cell)[2] + 1 == model.grid.cells[2];
        let corners = params.corners(cell);
        for a in (0..8).filter(|a| corner(*a)[axis] == 1) {
            let at = &model.rest[corners[a]];
            self.all.add(at);
            if topmost {
                self.top.add(at);
            }
        }
    }

    /// Removes one cell for each crossed link.
    pub(super) fn remove_cells(&mut self, model: &Model, hits: &[Hit<f64>]) -> Removal {
        let params = model.grid.params::<f64>();
        let step = [1, params.cells_x, params.cells_x * params.cells_y];
        let mut removal = Removal::default();
        let mut opened = vec![];
        // severed links: the cell of the crossed half is removed, unless one side is already gone
        for hit in hits {
            let (cell, axis) = (hit.segment / 3, (hit.segment % 3) as usize);
            let other = cell + step[axis];
            if !self.surface.alive[cell as usize] || !self.surface.alive[other as usize] {
                continue;
            }
            let h = model.shape[model.grid.layer(cell as usize)];
            self.totals.links += 1;
            self.totals.area += h[0] * h[1] * h[2] / h[axis];
            let gone = if hit.at > 0.5 { other } else { cell };
            if removal.cells.contains(&gone) {
                continue;
            }
            removal.cells.push(gone);
            opened.push((gone, axis));
        }
        for (cell, axis) in opened {
            self.open_cell(model, cell, axis);
            self.take_cell(model, cell, &mut removal);
        }
        removal
    }

    /// Takes an emptied cell's mass from its nodes; a node without cells leaves the system.
    fn take_cell(&mut self, model: &Model, cell: u32, removal: &mut Removal) {
        let [hx, hy, hz, whole] = model.shape[model.grid.layer(cell as usize)];
        let share = self.surface.share(cell as usize);
        let corner_mass = whole * share;
        self.totals.hexahedra += 1;
        self.totals.volume += hx * hy * hz * share;
        for node in model.grid.params::<f64>().corners(cell as usize) {
            self.live[node] -= 1;
            if self.live[node] == 0 {
                self.leave(node as u32, removal);
            } else {
                self.dofs[node][3] -= if model.mass == Mass::Uniform { 0.0 } else { corner_mass };
                removal.dofs.retain(|(n, _)| *n as usize != node);
                removal.dofs.push((node as u32, self.dofs[node]));
            }
        }
    }

    /// Removes cells, then what they leave that no tissue has: cells that meet the others around a node or an edge in an edge or a corner
    /// alone, of which only the most that share faces stay (Sase et al. 2015), and pieces of fewer than [`FRAGMENT`] cells.
    pub(super) fn carve_cells(&mut self, model: &Model, cells: &[u32]) -> Removal {
        let mut removal = Removal::default();
        let mut next: Vec<u32> = cells.to_vec();
        while !next.is_empty() {
            next.sort_unstable();
            next.dedup();
            next.retain(|cell| self.surface.alive[*cell as usize]);
            for cell in &next {
                self.empty_cell(model, *cell);
                self.take_cell(model, *cell, &mut removal);
                removal.cells.push(*cell);
            }
            next = self.hanging(model, &next);
        }
        removal
    }

    /// Removes space: the cells that were reached lose stiffness and mass with their volume, and those with less than [`LEAST`] left
    /// are removed as by [`Self::carve_cells`].
    pub(super) fn carve_space_of(&mut self, model: &Model, law: &Hyperelastic, carved: &Carved) -> Removal {
        let thinned = self.surface.carve(carved);
        if thinned.is_empty() {
            return Removal::default();
        }
        let params = model.grid.params::<f64>();
        let mut nodes: Vec<usize> = vec![];
        for own in &thinned {
            let [hx, hy, hz, _] = model.shape[model.grid.layer(own.cell as usize)];
            self.totals.volume += hx * hy * hz * (own.before - own.after);
            nodes.extend(params.corners(own.cell as usize));
        }
        let gone: Vec<u32> = thinned.iter().filter(|own| own.after < LEAST).map(|own| own.cell).collect();
        // extents are of the space, not of the cells that go with it
        let before = (self.all, self.top);
        let mut removal = self.carve_cells(model, &gone);
        (self.all, self.top) = before;
        self.measure_space(model, carved);
        let left = thinned.iter().filter(|own| self.surface.alive[own.cell as usize]);
        removal.scale = left.map(|own| (own.cell, law.scale(own.cell as usize) * own.after)).collect();
        // masses of nodes in use, from the cells that they have
        nodes.sort_unstable();
        nodes.dedup();
        for node in nodes.into_iter().filter(|node| self.live[*node] > 0) {
            if model.mass != Mass::Uniform {
                let around = self.surface.parts.cells_of(node).into_iter().filter(|cell| self.surface.alive[*cell]);
                let mass = |cell: usize| model.shape[model.grid.layer(cell)][3] * self.surface.share(cell);
                self.dofs[node][3] = around.map(mass).sum();
            }
            removal.dofs.retain(|(other, _)| *other as usize != node);
            removal.dofs.push((node as u32, self.dofs[node]));
        }
        removal
    }

    /// Cells that hang by an edge or a corner, or in a piece too small, after the removal of others.
    fn hanging(&self, model: &Model, removed: &[u32]) -> Vec<u32> {
        let params = model.grid.params::<f64>();
        let alive = |cell: usize| self.surface.alive[cell];
        let neighbours = |cell: usize| self.surface.parts.linked(cell).filter(|other| alive(*other));
        // piece of a set of cells that share faces, up to a number of them
        let piece = |first: usize, within: &dyn Fn(usize) -> bool, most: usize| {
            let mut found = vec![first];
            let mut seen = 0;
            while seen < found.len() && found.len() < most {
                let more: Vec<usize> = neighbours(found[seen]).filter(|c| within(*c) && !found.contains(c)).collect();
                found.extend(more);
                seen += 1;
            }
            found
        };
        let mut out: Vec<u32> = vec![];
        let mut nodes: Vec<usize> = removed.iter().flat_map(|cell| params.corners(*cell as usize)).collect();
        nodes.sort_unstable();
        nodes.dedup();
        for node in nodes {
            let at = params.node_at(node);
            // the cells around the node, and around the edges that begin there: two across an edge may share faces with others alone
            for axis in [None, Some(0), Some(1), Some(2)] {
                let holds = |a: &usize| axis.is_none_or(|axis| corner(*a)[axis] == 0);
                let mut around: Vec<usize> =
                    (0..8).filter(holds).filter_map(|a| params.cell_below(at, a)).filter(|c| alive(*c)).collect();
                let mut best: Vec<usize> = vec![];
                while let Some(first) = around.first().copied() {
                    let found = piece(first, &|cell| around.contains(&cell), usize::MAX);
                    around.retain(|cell| !found.contains(cell));
                    let less = if found.len() > best.len() { std::mem::replace(&mut best, found) } else { found };
                    out.extend(less.iter().map(|cell| *cell as u32));
                }
            }
        }
        for cell in removed.iter().flat_map(|cell| neighbours(*cell as usize)) {
            let found = piece(cell, &|_| true, FRAGMENT);
            if found.len() < FRAGMENT {
                out.extend(found.iter().map(|cell| *cell as u32));
            }
        }
        out
    }
}
