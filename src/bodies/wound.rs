//! Result of a cut: severed links and duplicated nodes, or removed cells and springs; masses and measures of the wound.
//!
//! Lumped and consistent masses belong to the cells; a uniform mass belongs to the node, as in SOFA's UniformMass by default.

use super::Model;
use crate::kernels::cut::Hit;
use crate::kernels::tetrahedra::{Arrays, Changes};
use crate::math::V4;
use crate::mesh::{Carved, Surface, parted};
use std::sync::Arc;

/// Totals for the report.
#[derive(Clone, Copy, Debug, Default)]
pub struct Totals {
    /// Removed cells.
    pub hexahedra: usize,
    /// Volume at rest of the removed cells and tetrahedra, and of space carved out of others, m³.
    pub volume: f64,
    /// Removed springs.
    pub springs_removed: usize,
    /// Removed tetrahedra, with those that springs hold together no more.
    pub tetrahedra: usize,
    /// Severed face links.
    pub links: usize,
    /// Links that the blade crossed but that stay intact because the reserve of duplicate nodes is used up.
    pub refused: usize,
    /// Crossings of links that stay intact because they alone hold a cell, or a piece of too few cells.
    pub holding: usize,
    /// Duplicated nodes.
    pub copies: usize,
    /// Cut area on one side, m²: the sum of the faces of severed links, or of the faces that belong to cut springs along an axis; of a mesh of
    /// springs estimated from the number of cut ones.
    pub area: f64,
    /// Extent of the wound along x or y, whichever is longer, at rest, m: of removed or open cells, or of the faces of severed links.
    pub length: f64,
    /// The same for the topmost layer of cells: the length of the wound seen from above, m.
    pub length_top: f64,
    /// Depth of the lowest point of the wound below the skin's top, at rest, m.
    pub depth: f64,
}

impl Totals {
    /// Sum over two wounds; the larger depth.
    pub fn and(self, other: Self) -> Self {
        Self {
            hexahedra: self.hexahedra + other.hexahedra,
            volume: self.volume + other.volume,
            springs_removed: self.springs_removed + other.springs_removed,
            tetrahedra: self.tetrahedra + other.tetrahedra,
            links: self.links + other.links,
            refused: self.refused + other.refused,
            holding: self.holding + other.holding,
            copies: self.copies + other.copies,
            area: self.area + other.area,
            length: self.length + other.length,
            length_top: self.length_top + other.length_top,
            depth: self.depth.max(other.depth),
        }
    }
}

/// Changes that a backend applies after a cut.
#[derive(Clone, Debug, Default)]
pub struct Removal {
    /// Cell ids, or tetrahedra.
    pub cells: Vec<u32>,
    /// Spring ids.
    pub springs: Vec<u32>,
    /// Duplicated nodes, each with the node whose state it copies.
    pub copies: Vec<[u32; 2]>,
    /// Words to write into the table of split nodes; of tetrahedra into the list of their corners.
    pub words: Vec<(u32, u32)>,
    /// New DOF masks and masses of nodes in use.
    pub dofs: Vec<(u32, V4<f64>)>,
    /// Cells that have lost a share of their volume, with their factors on the stiffness of their layer.
    pub scale: Vec<(u32, f64)>,
    /// Operator of tetrahedra, and where it has changed.
    pub operator: Option<(Arc<Arrays<f64>>, Changes)>,
    /// Nodes of pieces that nothing holds from now on.
    pub loose: Vec<u32>,
}

/// State of the cut body.
#[derive(Clone, Debug)]
pub struct Wound {
    /// Remaining cells and their surface.
    pub surface: Surface,
    /// Measures.
    pub totals: Totals,
    /// Open cells with the axis across the cut, in order of opening.
    pub open: Vec<(u32, usize)>,
    /// `[node]` current DOF mask and mass.
    pub dofs: Vec<V4<f64>>,
    /// `[node]` rest position, m; a duplicate has that of its original; then `[point]` those of an embedded surface.
    pub rest: Vec<[f64; 3]>,
    /// `[node of the grid]` number of remaining elements around it.
    pub(super) live: Vec<u32>,
    /// `[spring]` true if it is cut.
    pub(super) spring_gone: Vec<bool>,
    /// Operator of tetrahedra as they are cut; none before the first cut.
    pub(super) operator: Option<Arc<Arrays<f64>>>,
    pub(super) all: Extent,
    pub(super) top: Extent,
    /// Pieces that nothing holds; not of springs.
    pub loose: Vec<Loose>,
}

/// Piece of a body that a cut has set free ([`crate::mesh`]).
#[derive(Clone, Debug, Default)]
pub struct Loose {
    /// Its cells, in ascending order; some may have gone since.
    cells: Vec<usize>,
    /// Its nodes, in ascending order.
    pub nodes: Vec<u32>,
}

/// Bounding box of the wound at rest, m.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    low: [f64; 3],
    high: [f64; 3],
}

impl Extent {
    const NONE: Self = Self { low: [f64::INFINITY; 3], high: [f64::NEG_INFINITY; 3] };

    /// Extends the box to a point.
    pub fn add(&mut self, p: &[f64; 3]) {
        for n in 0..3 {
            self.low[n] = self.low[n].min(p[n]);
            self.high[n] = self.high[n].max(p[n]);
        }
    }
    /// Length along x or y, whichever is longer.
    fn length(&self) -> f64 {
        (self.high[0] - self.low[0]).max(self.high[1] - self.low[1]).max(0.0)
    }
}

impl Wound {
    /// Mass of the nodes, kg.
    pub fn mass_of_nodes(&self) -> f64 {
        self.dofs.iter().map(|f| f[3]).sum()
    }

    /// An uncut body.
    pub fn new(model: &Model) -> Self {
        Self {
            surface: Surface::with_reserve(&model.grid, model.params()),
            totals: Totals::default(),
            open: vec![],
            dofs: model.dofs.clone(),
            rest: model.rest_of_surface(),
            live: model.mechanics().around_nodes(model),
            spring_gone: vec![false; model.elements().spring_count],
            operator: None,
            all: Extent::NONE,
            top: Extent::NONE,
            loose: vec![],
        }
    }

    /// Applies hits (sorted by segment); returns the changes for the backend.
    pub fn apply(&mut self, model: &Model, hits: &[Hit<f64>]) -> Removal {
        let mut removal = model.mechanics().cut(model, self, hits);
        self.extend(model);
        if model.elements().spring_count == 0 {
            let ends = hits.iter().flat_map(|hit| self.surface.ends_of_link(hit.segment as usize)).collect();
            removal.loose = self.set_free(model, ends);
        }
        removal
    }

    /// Removes cells; returns the changes for the backend.
    pub fn carve(&mut self, model: &Model, cells: &[u32]) -> Removal {
        let mut removal = model.mechanics().carve(model, self, cells);
        self.extend(model);
        removal.loose = self.set_free(model, removal.cells.iter().map(|cell| *cell as usize).collect());
        removal
    }

    /// Removes space; returns the changes for the backend.
    pub fn carve_space(&mut self, model: &Model, carved: &Carved) -> Removal {
        let mut removal = model.mechanics().carve_space(model, self, carved);
        self.extend(model);
        removal.loose = self.set_free(model, removal.cells.iter().map(|cell| *cell as usize).collect());
        removal
    }

    /// Finds the pieces that changes at these cells have set free; returns the nodes of those that were none before.
    fn set_free(&mut self, model: &Model, changed: Vec<usize>) -> Vec<u32> {
        let surface = &self.surface;
        let here = if surface.present().is_empty() { &surface.alive } else { surface.present() };
        // cells that are gone stand for those around them
        let around = |cell: &usize| if here[*cell] { vec![*cell] } else { surface.beside(*cell) };
        let mut seeds: Vec<usize> = changed.iter().flat_map(around).collect();
        seeds.sort_unstable();
        seeds.dedup();
        let held = |cell: usize| {
            surface.corners_of(cell).into_iter().any(|node| {
                let original = surface.original(node) as u32;
                self.dofs[node][..3].contains(&0.0) || model.rest_springs.nodes.binary_search(&original).is_ok()
            })
        };
        let mut found = parted(&seeds, |cell| surface.linked(cell), held);
        found.retain(|cells| !self.loose.iter().any(|piece| piece.cells == *cells));
        // a piece that has parted again is gone
        let before = |piece: &Loose| found.iter().all(|cells| piece.cells.binary_search(&cells[0]).is_err());
        self.loose.retain(before);
        let freed = self.loose.len()..self.loose.len() + found.len();
        let parted = found.into_iter().map(|cells| Loose { cells, nodes: vec![] });
        self.loose.extend(parted);
        for piece in &mut self.loose {
            if piece.nodes.is_empty() || changed.iter().any(|cell| piece.cells.binary_search(cell).is_ok()) {
                let present = piece.cells.iter().filter(|cell| here[**cell]);
                piece.nodes = present.flat_map(|cell| surface.corners_of(*cell)).map(|node| node as u32).collect();
                piece.nodes.sort_unstable();
                piece.nodes.dedup();
            }
        }
        let nodes = self.loose[freed].iter().flat_map(|piece| piece.nodes.iter().copied()).collect();
        self.loose.retain(|piece| !piece.nodes.is_empty());
        nodes
    }

    /// Rest position of the surface's corner at a node, m.
    pub fn rest_of_corner(&self, node: u32) -> [f64; 3] {
        let (at, offset) = (self.rest[node as usize], self.surface.corner(node as usize).offset);
        [0, 1, 2].map(|n| at[n] + offset[n])
    }

    /// Measures the wound.
    fn extend(&mut self, model: &Model) {
        if self.totals.links + self.open.len() + self.totals.hexahedra + self.totals.tetrahedra > 0
            || self.totals.volume > 0.0
        {
            self.totals.length = self.all.length();
            self.totals.length_top = self.top.length();
            self.totals.depth = model.position[2] + model.grid.thickness() - self.all.low[2];
        }
    }

    /// Extends the wound by space that was carved.
    pub(super) fn measure_space(&mut self, model: &Model, carved: &Carved) {
        for (at, topmost) in self.surface.extent(carved) {
            let at = [0, 1, 2].map(|n| at[n] + model.position[n]);
            self.all.add(&at);
            if topmost {
                self.top.add(&at);
            }
        }
    }

    /// Marks a cell as open; `axis` points across the cut.
    pub(super) fn open_cell(&mut self, model: &Model, cell: u32, axis: usize) {
        self.open.push((cell, axis));
        self.empty_cell(model, cell);
    }

    /// Takes a cell out of the body and extends the wound by it.
    pub(super) fn empty_cell(&mut self, model: &Model, cell: u32) {
        self.surface.alive[cell as usize] = false;
        let params = model.grid.params::<f64>();
        let topmost = params.cell_at(cell as usize)[2] + 1 == model.grid.cells[2];
        for node in params.corners(cell as usize) {
            self.all.add(&model.rest[node]);
            if topmost {
                self.top.add(&model.rest[node]);
            }
        }
    }

    /// Takes a node without elements out of the system.
    pub(super) fn leave(&mut self, node: u32, removal: &mut Removal) {
        let at = node as usize;
        self.dofs[at] = [0.0; 4];
        removal.dofs.retain(|(n, _)| *n != node);
        removal.dofs.push((node, self.dofs[at]));
    }
}
