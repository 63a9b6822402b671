//! What a cut leaves: severed links and split nodes, or cells and springs that are gone; masses, and the measures of the wound.
//!
//! Bricks: links are severed and nodes split ([`Parts`](crate::mesh::Parts)); each copy has the mass that its cells give it. Or, where the
//! scene asks for it, a crossed link removes the cell in whose half the blade crossed it. Springs: a crossed spring is gone; a cell counts as open
//! when two or more of its four edges along one axis are gone. A node without live cells (bricks) or springs (springs) leaves the system.
//! Lumped and consistent masses go with their cells; a uniform mass goes with its node, as SOFA's UniformMass does by default.

use crate::kernels::cut::Hit;
use crate::math::V4;
use crate::mesh::{Change, Surface};
use crate::model::Model;
use crate::scene::Mass;

/// Totals for the report.
#[derive(Clone, Copy, Debug, Default)]
pub struct Totals {
    /// Removed cells.
    pub hexes: usize,
    /// Removed springs.
    pub springs: usize,
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
            springs: self.springs + other.springs,
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
    live_cells: Vec<u32>,
    live_springs: Vec<u32>,
    spring_gone: Vec<bool>,
    all: Extent,
    top: Extent,
}

/// Box around open cells at rest, m.
#[derive(Clone, Copy, Debug)]
struct Extent {
    low: [f64; 3],
    high: [f64; 3],
}

impl Extent {
    const NONE: Self = Self { low: [f64::INFINITY; 3], high: [f64::NEG_INFINITY; 3] };

    fn add(&mut self, p: &[f64; 3]) {
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
    /// An uncut body.
    pub fn new(model: &Model) -> Self {
        let params = model.grid.params::<f64>();
        let count = model.grid.node_count();
        let mut live_cells = vec![0; count];
        for cell in 0..model.grid.cell_count() {
            for node in params.corners(cell) {
                live_cells[node] += 1;
            }
        }
        let springs = model.springs.as_ref();
        Self {
            surface: Surface::with_reserve(model.params()),
            totals: Totals::default(),
            open: vec![],
            free: model.free.clone(),
            rest: model.rest.iter().copied().chain(std::iter::repeat([0.0; 3])).take(model.node_count()).collect(),
            live_cells,
            live_springs: springs.map_or(vec![], |s| s.first.windows(2).map(|w| w[1] - w[0]).collect()),
            spring_gone: vec![false; springs.map_or(0, |s| s.ends.len())],
            all: Extent::NONE,
            top: Extent::NONE,
        }
    }

    /// Takes hits (in the order of segments) over; returns what has to go.
    pub fn apply(&mut self, model: &Model, hits: &[Hit<f64>]) -> Removal {
        let removal = match (&model.springs, model.extra_columns) {
            (Some(_), _) => self.cut_springs(model, hits),
            (None, 0) => self.cut_links(model, hits),
            _ => self.split(model, hits),
        };
        if self.totals.links + self.open.len() > 0 {
            self.totals.length = self.all.length();
            self.totals.length_top = self.top.length();
            self.totals.depth = model.position[2] + model.grid.thickness() - self.all.low[2];
        }
        removal
    }

    fn open_cell(&mut self, model: &Model, cell: u32, axis: usize) {
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

    fn leave(&mut self, node: u32, removal: &mut Removal) {
        let at = node as usize;
        self.free[at] = [0.0; 4];
        removal.free.retain(|(n, _)| *n != node);
        removal.free.push((node, self.free[at]));
    }

    /// Severs links and splits nodes.
    fn split(&mut self, model: &Model, hits: &[Hit<f64>]) -> Removal {
        let links: Vec<(u32, f64)> = hits.iter().map(|hit| (hit.segment, hit.at)).collect();
        let Change { links, refused, copies, words, nodes } = self.surface.parts.cut(&links);
        let params = model.grid.params::<f64>();
        let shape = |cell: usize| model.shape[model.grid.layer_of[params.cell_at(cell)[2]] as usize];
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
        for a in (0..8).filter(|a| crate::kernels::corner(*a)[axis] == 1) {
            let at = &model.rest[corners[a]];
            self.all.add(at);
            if topmost {
                self.top.add(at);
            }
        }
    }

    fn cut_links(&mut self, model: &Model, hits: &[Hit<f64>]) -> Removal {
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
            let h = model.shape[model.grid.layer_of[params.cell_at(cell as usize)[2]] as usize];
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
            let corner_mass = model.shape[model.grid.layer_of[params.cell_at(cell as usize)[2]] as usize][3];
            for node in params.corners(cell as usize) {
                self.live_cells[node] -= 1;
                if self.live_cells[node] == 0 {
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

    fn cut_springs(&mut self, model: &Model, hits: &[Hit<f64>]) -> Removal {
        let Some(springs) = &model.springs else {
            return Removal::default();
        };
        let params = model.grid.params::<f64>();
        let mut removal = Removal::default();
        for hit in hits {
            let spring = hit.segment as usize;
            if std::mem::replace(&mut self.spring_gone[spring], true) {
                continue;
            }
            removal.springs.push(spring as u32);
            self.totals.springs += 1;
            let [a, b] = springs.ends[spring].map(|n| n as usize);
            for node in [a, b] {
                self.live_springs[node] -= 1;
                if self.live_springs[node] == 0 {
                    self.leave(node as u32, &mut removal);
                }
            }
            let (p, q) = (params.node_at(a), params.node_at(b));
            let along: Vec<usize> = (0..3).filter(|n| p[*n] != q[*n]).collect();
            if let [axis] = along[..] {
                self.edge_cut(model, springs, a, axis, &mut removal);
            }
        }
        removal
    }

    /// A grid edge from node `a` along `axis` is gone: opens cells around it that have lost two edges along that axis.
    fn edge_cut(
        &mut self,
        model: &Model,
        springs: &crate::model::Springs,
        a: usize,
        axis: usize,
        removal: &mut Removal,
    ) {
        let params = model.grid.params::<f64>();
        let at = params.node_at(a);
        let stride = [1, params.nodes_x as usize, (params.nodes_x * params.nodes_y) as usize];
        let gone = |first: usize| {
            let second = (first + stride[axis]) as u32;
            let range = springs.first[first] as usize..springs.first[first + 1] as usize;
            springs.half[range].iter().any(|h| h[0] == second && self.spring_gone[h[1] as usize])
        };
        let level = at[2].min(model.grid.cells[2] - 1);
        let h = model.shape[model.grid.layer_of[level] as usize];
        self.totals.area += h[0] * h[1] * h[2] / h[axis];
        let mut opened = vec![];
        for corner in 0..8 {
            let o = crate::kernels::corner(corner);
            if o[axis] == 1 {
                continue;
            }
            let Some(cell) = params.cell_below(at, corner) else {
                continue;
            };
            if !self.surface.alive[cell] {
                continue;
            }
            let corners = params.corners(cell);
            let lost = (0..8).filter(|k| crate::kernels::corner(*k)[axis] == 0).filter(|k| gone(corners[*k])).count();
            if lost >= 2 {
                opened.push(cell as u32);
            }
        }
        for cell in opened {
            self.open_cell(model, cell, axis);
            removal.cells.push(cell);
        }
    }
}
