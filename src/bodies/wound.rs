//! What a cut leaves: severed links and split nodes, or cells and springs that are gone; masses, and the measures of the wound.
//!
//! Lumped and consistent masses go with their cells; a uniform mass goes with its node, as SOFA's UniformMass does by default.

use super::Model;
use crate::kernels::cut::Hit;
use crate::math::V4;
use crate::mesh::Surface;

/// Totals for the report.
#[derive(Clone, Copy, Debug, Default)]
pub struct Totals {
    /// Removed cells.
    pub hexes: usize,
    /// Removed springs.
    pub springs_removed: usize,
    /// Severed face links.
    pub links: usize,
    /// Links that the blade crossed and that hold because the reserve of copies is used up.
    pub refused: usize,
    /// Copies of nodes.
    pub copies: usize,
    /// Cut area on one side, m²: each severed link (or spring along an axis) stands for its face.
    pub area: f64,
    /// Extent of the open cells along x or y, whichever is longer, m (rest positions).
    pub length: f64,
    /// The same of the open cells of the topmost level alone: the wound as one sees it from above, m.
    pub length_top: f64,
    /// Depth of the deepest open cell's floor under the skin's top, m (rest positions).
    pub depth: f64,
}

impl Totals {
    /// Of two wounds together.
    pub fn and(self, other: Self) -> Self {
        Self {
            hexes: self.hexes + other.hexes,
            springs_removed: self.springs_removed + other.springs_removed,
            links: self.links + other.links,
            refused: self.refused + other.refused,
            copies: self.copies + other.copies,
            area: self.area + other.area,
            length: self.length + other.length,
            length_top: self.length_top + other.length_top,
            depth: self.depth.max(other.depth),
        }
    }
}

/// What a backend has to change.
#[derive(Clone, Debug, Default)]
pub struct Removal {
    /// Cell ids.
    pub cells: Vec<u32>,
    /// Spring ids.
    pub springs: Vec<u32>,
    /// Copies, each with the node that it takes its state from.
    pub copies: Vec<[u32; 2]>,
    /// Words of the table of split nodes.
    pub words: Vec<(u32, u32)>,
    /// New free axes and masses, of nodes that are in use.
    pub free: Vec<(u32, V4<f64>)>,
}

/// The body as cut so far.
#[derive(Clone, Debug)]
pub struct Wound {
    /// Live cells and their surface.
    pub surface: Surface,
    /// Measures.
    pub totals: Totals,
    /// Open cells with the axis across the cut, in the order they opened.
    pub open: Vec<(u32, usize)>,
    /// `[node]` free axes and mass now.
    pub free: Vec<V4<f64>>,
    /// `[node]` rest position, of a copy that of the node that it stands for, m.
    pub rest: Vec<[f64; 3]>,
    /// `[node of the grid]` elements that are left around it.
    pub(super) live: Vec<u32>,
    /// `[spring]` it is gone.
    pub(super) spring_gone: Vec<bool>,
    pub(super) all: Extent,
    pub(super) top: Extent,
}

/// Box around open cells at rest, m.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    low: [f64; 3],
    high: [f64; 3],
}

impl Extent {
    const NONE: Self = Self { low: [f64::INFINITY; 3], high: [f64::NEG_INFINITY; 3] };

    /// Widens it to a point.
    pub fn add(&mut self, p: &[f64; 3]) {
        for n in 0..3 {
            self.low[n] = self.low[n].min(p[n]);
            self.high[n] = self.high[n].max(p[n]);
        }
    }
    /// Along x or y, whichever is longer.
    fn length(&self) -> f64 {
        (self.high[0] - self.low[0]).max(self.high[1] - self.low[1]).max(0.0)
    }
}

impl Wound {
    /// Mass of the nodes, kg.
    pub(super) fn mass_of_nodes(&self) -> f64 {
        self.free.iter().map(|f| f[3]).sum()
    }

    /// An uncut body.
    pub fn new(model: &Model) -> Self {
        Self {
            surface: Surface::with_reserve(&model.grid, model.params()),
            totals: Totals::default(),
            open: vec![],
            free: model.free.clone(),
            rest: model.rest.iter().copied().chain(std::iter::repeat([0.0; 3])).take(model.node_count()).collect(),
            live: model.mechanics().around_nodes(model),
            spring_gone: vec![false; model.elements().spring_count],
            all: Extent::NONE,
            top: Extent::NONE,
        }
    }

    /// Takes hits (in the order of segments) over; returns what has to go.
    pub fn apply(&mut self, model: &Model, hits: &[Hit<f64>]) -> Removal {
        let removal = model.mechanics().cut(model, self, hits);
        if self.totals.links + self.open.len() > 0 {
            self.totals.length = self.all.length();
            self.totals.length_top = self.top.length();
            self.totals.depth = model.position[2] + model.grid.thickness() - self.all.low[2];
        }
        removal
    }

    /// A cell that counts as open, with the axis across the cut.
    pub(super) fn open_cell(&mut self, model: &Model, cell: u32, axis: usize) {
        self.surface.alive[cell as usize] = false;
        self.open.push((cell, axis));
        let params = model.grid.params::<f64>();
        let topmost = params.cell_at(cell as usize)[2] + 1 == model.grid.cells[2];
        for node in params.corners(cell as usize) {
            self.all.add(&model.rest[node]);
            if topmost {
                self.top.add(&model.rest[node]);
            }
        }
    }

    /// A node without elements leaves the system.
    pub(super) fn leave(&mut self, node: u32, removal: &mut Removal) {
        let at = node as usize;
        self.free[at] = [0.0; 4];
        removal.free.retain(|(n, _)| *n != node);
        removal.free.push((node, self.free[at]));
    }
}
