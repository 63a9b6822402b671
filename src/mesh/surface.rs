//! The skin's surface: faces of remaining cells without a neighbour, and both sides of each severed link; of a mesh, its outside
//! likewise; of an embedded surface, its triangles.

use super::{
    Carved, Corner, Distance, Face, Grid, MaterialPoint, Outside, Parts, Pit, TetrahedralParts, Thinned, Tissue,
};
use crate::kernels::Params;

/// Edge defects of a surface; both are 0 for an uncut body.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Edges {
    /// Edges shared by more than two faces: parts that touch along an edge and share its nodes.
    pub nonmanifold: usize,
    /// Edges not traversed equally often in both directions: the surface has a hole there.
    pub open: usize,
}

/// Remaining cells and their connectivity.
#[derive(Clone, Debug)]
pub struct Surface {
    of: Grid, // grid of the body
    params: Params<f64>,
    /// `[cell]` false if removed.
    pub alive: Vec<bool>,
    /// Tetrahedra of a mesh.
    tetrahedra: Option<TetrahedralParts>,
    /// Severed links and duplicated nodes.
    pub parts: Parts,
    /// Space that tools have carved out of the cells.
    pit: Pit,
}

/// Corners of the six faces (outward, VTK numbers) with the step to the neighbour.
const FACES: [([usize; 4], [isize; 3]); 6] = [
    ([0, 4, 7, 3], [-1, 0, 0]),
    ([1, 2, 6, 5], [1, 0, 0]),
    ([0, 1, 5, 4], [0, -1, 0]),
    ([2, 3, 7, 6], [0, 1, 0]),
    ([0, 3, 2, 1], [0, 0, -1]),
    ([4, 5, 6, 7], [0, 0, 1]),
];

impl Surface {
    /// Surface of an uncut grid.
    pub fn new(grid: &Grid) -> Self {
        Self::with_reserve(grid, grid.params())
    }

    /// The same with room for the splits that the parameters allow.
    pub fn with_reserve(grid: &Grid, params: Params<f64>) -> Self {
        let alive = (0..params.cell_count as usize).map(|cell| grid.is_present(cell)).collect();
        let reserve = params.node_count as usize - grid.node_count();
        let tetrahedra = grid.unstructured.as_ref().map(|of| TetrahedralParts::new(of.clone(), reserve));
        Self { of: grid.clone(), params, alive, tetrahedra, parts: Parts::new(params), pit: Pit::default() }
    }

    /// Grid of the body.
    pub fn grid(&self) -> &Grid {
        &self.of
    }

    /// Parameters, with the sizes of the table of split nodes.
    pub fn params(&self) -> &Params<f64> {
        &self.params
    }

    /// Tetrahedra of a mesh as they are cut; none of a grid.
    pub fn tetrahedra(&self) -> Option<&TetrahedralParts> {
        self.tetrahedra.as_ref()
    }

    /// The same, to cut them.
    pub fn tetrahedra_mut(&mut self) -> Option<&mut TetrahedralParts> {
        self.tetrahedra.as_mut()
    }

    /// `[tetrahedron]` of a mesh, false if removed; empty for a grid.
    pub fn present(&self) -> &[bool] {
        self.tetrahedra.as_ref().map_or(&[], |of| of.present())
    }

    /// Ids of the eight corners of a cell as it is cut now; of a tetrahedron of a mesh its four, twice.
    pub fn corners_of(&self, cell: usize) -> [usize; 8] {
        match &self.tetrahedra {
            Some(of) => {
                let [a, b, c, d] = of.corners()[cell];
                [a, b, c, d, a, b, c, d].map(|node| node as usize)
            }
            None => self.parts.corners(cell),
        }
    }

    /// `[tetrahedron]` of a mesh: its nodes as it is cut now; empty for a grid.
    pub fn corners_of_tetrahedra(&self) -> &[[u32; 4]] {
        self.tetrahedra.as_ref().map_or(&[], |of| of.corners())
    }

    /// The outside of the remaining tetrahedra of a mesh; none of a grid.
    pub fn outside(&self) -> Option<&Outside> {
        self.tetrahedra.as_ref().map(|of| of.outside())
    }

    /// Duplicates of a node that a cut has made.
    pub fn copies(&self, node: usize) -> Vec<u32> {
        self.tetrahedra.as_ref().map_or_else(|| self.parts.copies(node), |of| of.copies(node))
    }

    /// Original of a duplicate; the node itself if it is none.
    pub fn original(&self, node: usize) -> usize {
        self.tetrahedra.as_ref().map_or_else(|| self.parts.original(node), |of| of.original(node))
    }

    /// True for a node that is no duplicate, and for a duplicate that has been taken.
    pub fn in_use(&self, node: usize) -> bool {
        self.tetrahedra.as_ref().map_or_else(|| self.parts.in_use(node), |of| of.in_use(node))
    }

    /// True if space was carved out of it.
    pub fn has_pit(&self) -> bool {
        !self.pit.is_empty()
    }

    /// Share of a present cell that tools have left, 1 for a whole one.
    pub fn share(&self, cell: usize) -> f64 {
        self.pit.share(cell)
    }

    /// `[cell]` shares of the cells or tetrahedra that are left; empty where tools have carved no space.
    pub fn shares(&self) -> Vec<f64> {
        let all = if self.pit.is_empty() { &[] } else { self.tissue().alive };
        all.iter().enumerate().map(|(cell, here)| if *here { self.share(cell) } else { 0.0 }).collect()
    }

    /// What tools carve.
    fn tissue(&self) -> Tissue<'_> {
        let tetrahedra = self.tetrahedra.as_ref();
        Tissue { of: &self.of, tetrahedra, alive: tetrahedra.map_or(&self.alive, |of| of.present()) }
    }

    /// Makes what carving needs, once.
    pub(crate) fn prepare(&mut self) {
        self.tetrahedra.iter_mut().for_each(TetrahedralParts::prepare);
    }

    /// Removes space from the cells or tetrahedra; returns those that have lost something.
    pub(crate) fn carve(&mut self, carved: &Carved) -> Vec<Thinned> {
        self.prepare();
        self.pit.carve(carved)
    }

    /// Parts of some present cells that are reached, in ascending order, and of faces there ([`Pit::reached`]), once [`Self::prepare`]d.
    pub(crate) fn reached(
        &self,
        near: (&[u32], &[Face]),
        moved: &(dyn Fn(u32) -> [f64; 3] + Sync),
        of: &Distance,
    ) -> Carved {
        self.pit.reached(self.tissue(), near, moved, of)
    }

    /// Points at the border of what was carved ([`Pit::extent`]).
    pub(crate) fn extent(&self, carved: &Carved) -> Vec<([f64; 3], bool)> {
        self.pit.extent(self.tissue(), carved)
    }

    /// A cell or tetrahedron and the present ones that touch it in a face, an edge or a corner.
    pub(crate) fn beside(&self, cell: usize) -> Vec<usize> {
        if let Some(of) = &self.tetrahedra {
            return of.corners()[cell].iter().flat_map(|node| of.around(*node)).collect();
        }
        let at = self.params.cell_at(cell);
        let size = [self.params.cells_x, self.params.cells_y, self.params.cells_z].map(|n| n as usize);
        let range = |n: usize| at[n].saturating_sub(1)..(at[n] + 2).min(size[n]);
        let all = range(2).flat_map(|k| range(1).flat_map(move |j| range(0).map(move |i| [i, j, k])));
        all.map(|at| self.params.cell_id(at)).filter(|cell| self.alive[*cell]).collect()
    }

    /// The present cells or tetrahedra that are linked to one over its faces.
    pub(crate) fn linked(&self, cell: usize) -> Vec<usize> {
        match &self.tetrahedra {
            Some(of) => (0..4).filter_map(|opposite| of.beyond(cell, opposite)).collect(),
            None => self.parts.linked(cell).filter(|other| self.alive[*other]).collect(),
        }
    }

    /// The two cells or tetrahedra of a link.
    pub(crate) fn ends_of_link(&self, link: usize) -> [usize; 2] {
        match &self.tetrahedra {
            Some(of) => of.mesh().links.ends(link),
            None => [Some(link / 3), self.parts.beyond(link / 3, link % 3)].map(|cell| cell.unwrap_or(link / 3)),
        }
    }

    /// A point of corners of the surface as one of nodes: corners on carved space move with those of a cell.
    pub fn on_nodes(&self, point: MaterialPoint) -> MaterialPoint {
        if self.pit.is_empty() {
            return point;
        }
        point.through(|node| match self.pit.corner(self.tissue(), node as usize) {
            Some(corner) => MaterialPoint::of(corner.nodes, corner.weights),
            None => MaterialPoint::node(node),
        })
    }

    /// Surface corner at a node; points of an embedded surface are numbered after the nodes.
    pub fn corner(&self, node: usize) -> Corner {
        if let Some(embedded) = &self.of.embedded
            && let Some(point) = node.checked_sub(self.params.node_count as usize)
        {
            return Corner { offset: [0.0; 3], nodes: embedded.nodes[point], weights: embedded.weights[point] };
        }
        let carved = self.pit.corner(self.tissue(), node);
        let cut = || self.tetrahedra.as_ref().map_or_else(|| self.parts.corner(&self.of, node), |of| of.corner(node));
        carved.unwrap_or_else(cut)
    }

    /// Remaining cells, each with its layer and corner nodes.
    pub fn live_cells(&self) -> impl Iterator<Item = (usize, [usize; 8])> {
        let live = (0..self.alive.len()).filter(|cell| self.alive[*cell]);
        live.map(|cell| (self.of.layer(cell), self.parts.corners(cell)))
    }

    /// Share of a cell's neighbours in the grid that it is still linked to, 0 to 1; 1 without neighbours.
    pub fn linked_share(&self, cell: usize) -> f64 {
        if let Some(of) = &self.tetrahedra {
            return of.linked_share(cell);
        }
        let p = &self.params;
        let (at, size) = (p.cell_at(cell), [p.cells_x, p.cells_y, p.cells_z]);
        let sides = |axis: usize| usize::from(at[axis] > 0) + usize::from(at[axis] + 1 < size[axis] as usize);
        let all: usize = (0..3).map(sides).sum();
        let linked = self.parts.linked(cell).filter(|other| self.alive[*other]).count();
        if all > 0 { linked as f64 / all as f64 } else { 1.0 }
    }

    /// Number of connected pieces of the remaining cells, or tetrahedra.
    pub fn pieces(&self) -> usize {
        self.tetrahedra.as_ref().map_or_else(|| self.parts.pieces(&self.alive), |of| of.pieces())
    }

    /// Boundary faces of the cells with grid coordinates in `low..high`.
    pub fn quads(&self, low: [usize; 3], high: [usize; 3], out: &mut Vec<Face>) {
        for k in low[2]..high[2] {
            for j in low[1]..high[1] {
                for i in low[0]..high[0] {
                    self.cell_quads([i, j, k], out);
                }
            }
        }
    }

    /// All boundary faces.
    pub fn all(&self) -> Vec<Face> {
        if let Some(embedded) = &self.of.embedded {
            return embedded.outside.clone();
        }
        let p = &self.params;
        let mut out = self.outside().map_or(vec![], |outside| outside.faces.clone());
        self.quads([0; 3], [p.cells_x as usize, p.cells_y as usize, p.cells_z as usize], &mut out);
        out
    }

    /// Counts the edge defects.
    pub fn edges(&self) -> Edges {
        edges(&self.all())
    }

    fn cell_quads(&self, at: [usize; 3], out: &mut Vec<Face>) {
        let p = &self.params;
        let cell = p.cell_id(at);
        if !self.alive[cell] {
            return;
        }
        let size = [p.cells_x, p.cells_y, p.cells_z];
        let corners = self.parts.corners(cell);
        for (number, (face, step)) in FACES.into_iter().enumerate() {
            let mut next = at;
            let mut inside = true;
            for axis in 0..3 {
                let n = at[axis] as isize + step[axis];
                inside &= n >= 0 && n < size[axis] as isize;
                next[axis] = n.max(0) as usize;
            }
            // faces come in pairs, one per axis
            let other = p.cell_id(next);
            let wall = inside && (!self.alive[other] || self.parts.is_severed(cell.min(other), number / 2));
            if wall || !inside {
                out.push(Face { nodes: face.map(|a| corners[a] as u32), cell: cell as u32, wall });
            }
        }
    }
}

fn edges(quads: &[Face]) -> Edges {
    let mut sides: Vec<([u32; 2], bool)> = vec![];
    for face in quads {
        sides.extend(face.edges().map(|[a, b]| ([a.min(b), a.max(b)], a < b)));
    }
    sides.sort_unstable();
    let mut found = Edges::default();
    for at_edge in sides.chunk_by(|a, b| a.0 == b.0) {
        let forward = at_edge.iter().filter(|(_, forward)| *forward).count();
        found.nonmanifold += usize::from(at_edge.len() > 2);
        found.open += usize::from(2 * forward != at_edge.len());
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;

    #[test]
    fn every_directed_edge_is_met_by_its_reverse() {
        let grid = Grid {
            cells: [3, 3, 2],
            nodes: [4, 4, 3],
            edge: [1.0, 1.0],
            heights: vec![0.0, 1.0, 2.0],
            layer_of: vec![0, 0],
            unstructured: None,
            embedded: None,
        };
        let mut surface = Surface::new(&grid);
        surface.alive[13] = false;
        let mut edges: HashMap<(u32, u32), i32> = HashMap::new();
        for quad in surface.all() {
            for n in 0..4 {
                let (a, b) = (quad.nodes[n], quad.nodes[(n + 1) % 4]);
                *edges.entry((a.min(b), a.max(b))).or_default() += if a < b { 1 } else { -1 };
            }
        }
        assert!(edges.values().all(|n| *n == 0));
        assert_eq!(surface.all().len(), 2 * (9 + 6 + 6) + 4);
    }

    /// Three cells along each axis, with a reserve.
    fn splittable() -> Surface {
        let grid = Grid {
            cells: [3, 3, 3],
            nodes: [4, 4, 4],
            edge: [1.0, 1.0],
            heights: vec![0.0, 1.0, 2.0, 3.0],
            layer_of: vec![0; 3],
            unstructured: None,
            embedded: None,
        };
        let params = Params { extra_columns: 16, split_cells: 100, touched_nodes: 400, ..grid.params::<f64>() };
        Surface::with_reserve(&grid, params)
    }

    #[test]
    fn a_cut_leaves_no_hole_and_edges_are_counted_where_its_parts_still_share_them() {
        let mut surface = splittable();
        assert_eq!(surface.edges(), Edges::default());
        let cell = |surface: &Surface, at| surface.params.cell_id(at) as u32;
        // half through along x: two links of the top level
        let links = [[0, 0, 2], [0, 1, 2]].map(|at| (3 * cell(&surface, at), 0.5));
        surface.parts.cut(&links);
        assert_eq!(surface.edges(), Edges::default());
        // a slit in the bottom alone: the nodes between its links, and below, are of one part still, so four faces meet at two edges
        let mut slit = splittable();
        let links = [[0, 1, 0], [0, 1, 1]].map(|at| (3 * cell(&slit, at), 0.5));
        slit.parts.cut(&links);
        assert_eq!(slit.edges(), Edges { nonmanifold: 2, open: 0 });
        // the counter-test: a face that is not there leaves its four edges open
        assert_eq!(edges(&slit.all()[1..]).open, 4);
    }
}
