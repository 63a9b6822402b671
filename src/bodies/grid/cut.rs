//! Cuts through hexahedra: links between cells are severed and nodes split ([`Parts`](crate::mesh::Parts)); each copy has the mass that its
//! cells give it. Or, where the scene asks for it, a crossed link removes the cell in whose half the blade crossed it. A node without
//! live cells leaves the system.
//!
//! Arrays and the product over the grid stay as they are: cells with copies among their corners are added one by one
//! ([`crate::kernels::split_product`]), the smoother runs over extra columns, and the coarse levels ignore the cut. Places that no copy has
//! taken are the last of all arrays, and nothing runs over them. Parts are found on the host, where the hits are anyway: 0.03 ms of a cutting
//! step of the default scene, as much as one empty round trip to a device takes.
//! Source: severed links between cells: Frisken-Gibson 1999 (linked volumes); copies of nodes for the parts around them: Molino, Bao,
//! Fedkiw 2004 (virtual nodes); Dick, Georgii, Westermann 2011 (hexahedra).

use crate::bodies::{Model, Removal, Wound};
use crate::kernels::corner;
use crate::kernels::cut::Hit;
use crate::mesh::Change;
use crate::scene::Mass;

impl Wound {
    /// Severs links and splits nodes.
    pub(super) fn split(&mut self, model: &Model, hits: &[Hit<f64>]) -> Removal {
        let links: Vec<(u32, f64)> = hits.iter().map(|hit| (hit.segment, hit.at)).collect();
        let Change { links, refused, copies, words, nodes } = self.surface.parts.cut(&links);
        let params = model.grid.params::<f64>();
        let shape = |cell: usize| model.shape[model.grid.layer(cell)];
        for (cell, axis) in &links {
            let h = shape(*cell as usize);
            self.totals.area += h[0] * h[1] * h[2] / h[*axis];
            self.measure(model, *cell as usize, *axis);
        }
        self.totals.links += links.len();
        self.totals.refused += refused as usize;
        self.totals.copies += copies.len();
        let mut removal = Removal { copies, words, ..Removal::default() };
        for [copy, source] in &removal.copies {
            self.rest[*copy as usize] = self.rest[*source as usize];
        }
        for node in nodes {
            let parts = &self.surface.parts;
            let original = parts.original(node as usize);
            let whole = model.free[original];
            let around = |node: usize| parts.cells_of(node).into_iter().map(|cell| shape(cell)[3]).sum::<f64>();
            let corners = around(node as usize);
            // a uniform mass is shared by the cells' volumes
            let all = match model.mass {
                Mass::Uniform => (0..8)
                    .filter_map(|a| params.cell_below(params.node_at(original), a))
                    .map(|cell| shape(cell)[3])
                    .sum(),
                Mass::Lumped | Mass::Consistent => whole[3],
            };
            self.free[node as usize] = [whole[0], whole[1], whole[2], whole[3] * corners / all];
            removal.free.push((node, self.free[node as usize]));
        }
        removal
    }

    /// Takes the face of a severed link into the extent of the wound.
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

    /// Removes a cell for each crossed link.
    pub(super) fn remove_cells(&mut self, model: &Model, hits: &[Hit<f64>]) -> Removal {
        let params = model.grid.params::<f64>();
        let step = [1, params.cells_x, params.cells_x * params.cells_y];
        let mut removal = Removal::default();
        let mut opened = vec![];
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
            self.totals.hexes += 1;
            let corner_mass = model.shape[model.grid.layer(cell as usize)][3];
            for node in params.corners(cell as usize) {
                self.live[node] -= 1;
                if self.live[node] == 0 {
                    self.leave(node as u32, &mut removal);
                } else {
                    self.free[node][3] -= if model.mass == Mass::Uniform { 0.0 } else { corner_mass };
                    removal.free.retain(|(n, _)| *n as usize != node);
                    removal.free.push((node as u32, self.free[node]));
                }
            }
        }
        removal
    }
}
