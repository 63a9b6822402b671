//! Regular grid of hexahedra in layers: z-ranges of one grid that share their interface nodes, so layers are perfectly bonded. It may carry a
//! surface that its cells are cut by ([`Embedded`]). Or, in its place, the nodes of a mesh of tetrahedra.

use super::{Embedded, Unstructured};
use crate::kernels::Params;
use crate::scene::{Region, Skin, TetrahedralMesh};
use std::sync::Arc;

/// Geometry of the grid: x fastest, then y, then z. The origin is the centre of the bottom face. Of a mesh of tetrahedra its nodes in one
/// row, each a column of its own, without cells.
#[derive(Clone, Debug)]
pub struct Grid {
    /// Cells along each axis.
    pub cells: [usize; 3],
    /// Nodes along each axis.
    pub nodes: [usize; 3],
    /// Cell edges along x and y, m; of a mesh the extent along them.
    pub edge: [f64; 2],
    /// `[z-level]` height of each level of nodes, m.
    pub heights: Vec<f64>,
    /// `[cells_z]` layer of each level of cells.
    pub layer_of: Vec<u32>,
    /// The mesh of tetrahedra that the nodes are of, if they are of one.
    pub unstructured: Option<Arc<Unstructured>>,
    /// The surface that the grid carries, if it does not fill its box.
    pub embedded: Option<Arc<Embedded>>,
}

impl Grid {
    /// Grid of a skin without what is embedded in it, or the nodes of its mesh.
    pub(super) fn whole(skin: &Skin) -> Self {
        if let Some(mesh) = &skin.mesh {
            return Self::of_mesh(mesh);
        }
        let mut heights = vec![0.0];
        let mut layer_of = vec![];
        let mut bottom = 0.0;
        for (index, layer) in skin.layers.iter().enumerate() {
            for k in 1..=layer.cells {
                heights.push(bottom + layer.thickness * f64::from(k) / f64::from(layer.cells));
                layer_of.push(index as u32);
            }
            bottom += layer.thickness;
        }
        let cells = [skin.cells[0] as usize, skin.cells[1] as usize, layer_of.len()];
        Self {
            cells,
            nodes: cells.map(|c| c + 1),
            edge: [skin.size[0] / cells[0] as f64, skin.size[1] / cells[1] as f64],
            heights,
            layer_of,
            unstructured: None,
            embedded: None,
        }
    }

    /// The nodes of a mesh in one row, each a column of its own, without cells: the tetrahedra of the mesh are its elements.
    fn of_mesh(mesh: &Arc<TetrahedralMesh>) -> Self {
        let [x, y, z] = mesh.size();
        Self {
            cells: [0; 3],
            nodes: [mesh.nodes().len(), 1, 1],
            edge: [x, y],
            heights: vec![0.0, z],
            layer_of: vec![],
            unstructured: Some(Arc::new(Unstructured::new(mesh))),
            embedded: None,
        }
    }

    /// Number of nodes.
    pub fn node_count(&self) -> usize {
        self.nodes.iter().product()
    }

    /// Number of hexahedral cells.
    pub fn cell_count(&self) -> usize {
        self.cells.iter().product()
    }

    /// Layer of a cell, or of a tetrahedron of the mesh.
    pub fn layer(&self, cell: usize) -> usize {
        if let Some(unstructured) = &self.unstructured {
            return unstructured.mesh.layers()[cell] as usize;
        }
        self.layer_of[cell / (self.cells[0] * self.cells[1])] as usize
    }

    /// Extent along x and y, m.
    pub fn size(&self) -> [f64; 2] {
        match self.unstructured {
            Some(_) => self.edge,
            None => [0, 1].map(|n| self.edge[n] * self.cells[n] as f64),
        }
    }

    /// Total thickness, m.
    pub fn thickness(&self) -> f64 {
        self.heights[self.heights.len() - 1]
    }

    /// Rest position of a node, m.
    pub fn rest(&self, node: usize) -> [f64; 3] {
        if let Some(unstructured) = &self.unstructured {
            return unstructured.mesh.nodes()[node];
        }
        let [i, j, k] = self.params::<f64>().node_at(node);
        let along = |i: usize, axis: usize| (i as f64 - 0.5 * self.cells[axis] as f64) * self.edge[axis];
        [along(i, 0), along(j, 1), self.heights[k]]
    }

    /// Edges of a layer's cells, m; 0 without a cell.
    pub fn cell_edges(&self, layer: u32) -> [f64; 3] {
        let first = self.layer_of.iter().position(|l| *l == layer);
        first.map_or([0.0; 3], |k| [self.edge[0], self.edge[1], self.heights[k + 1] - self.heights[k]])
    }

    /// Lowest and highest corner of a cell at rest, m.
    pub fn cell_box(&self, params: &Params<f64>, cell: usize) -> [[f64; 3]; 2] {
        let corners = params.corners(cell);
        [corners[0], corners[6]].map(|node| self.rest(node))
    }

    /// Natural coordinates of a rest position in a cell, 0 to 1 along each axis; beyond where it lies beside the cell.
    pub fn natural_in(&self, params: &Params<f64>, cell: usize, at: [f64; 3]) -> [f64; 3] {
        let [low, high] = self.cell_box(params, cell);
        [0, 1, 2].map(|n| (at[n] - low[n]) / (high[n] - low[n]))
    }

    /// Kernel parameters with the sizes set; everything else is zero.
    pub fn params<R: crate::math::Real>(&self) -> Params<R> {
        let [nodes_x, nodes_y, nodes_z] = self.nodes.map(|n| n as u32);
        let [cells_x, cells_y, cells_z] = self.cells.map(|n| n as u32);
        Params {
            nodes_x,
            nodes_y,
            nodes_z,
            node_count: self.node_count() as u32,
            cells_x,
            cells_y,
            cells_z,
            cell_count: self.cell_count() as u32,
            ..Params::default()
        }
    }

    /// Edges of the cells before and after a node at a z-level, along x, y, z, m; 0 along z where there is no cell.
    pub fn around(&self, level: usize) -> [[f64; 2]; 3] {
        let below = if level > 0 { self.heights[level] - self.heights[level - 1] } else { 0.0 };
        let above = self.heights.get(level + 1).map_or(0.0, |h| h - self.heights[level]);
        [[self.edge[0]; 2], [self.edge[1]; 2], [below, above]]
    }

    /// True if a node belongs to a region; nodes that no present cell has belong to none, and a group of an embedded surface has the nodes that its
    /// points move with.
    pub fn contains(&self, region: &Region, node: usize) -> bool {
        match &self.unstructured {
            Some(unstructured) => unstructured.mesh.node_is_in(node, region),
            None => match (&self.embedded, region) {
                (Some(embedded), _) if embedded.mass[node] == 0.0 => false,
                (Some(embedded), Region::Group(group)) => {
                    embedded.groups.iter().any(|own| own.name() == group.name() && own.holds(node))
                }
                _ => region.holds(self.rest(node), self.size(), self.thickness()),
            },
        }
    }

    /// True if a cell is there from the start: those outside of an embedded surface are not.
    pub fn is_present(&self, cell: usize) -> bool {
        self.embedded.as_ref().is_none_or(|embedded| embedded.share[cell] > 0.0)
    }

    /// True if a node is of a present cell.
    pub fn is_used(&self, node: usize) -> bool {
        self.embedded.as_ref().is_none_or(|embedded| embedded.mass[node] > 0.0)
    }

    /// Share of a cell's volume that belongs to the body.
    pub fn share(&self, cell: usize) -> f64 {
        self.embedded.as_ref().map_or(1.0, |embedded| embedded.share[cell])
    }

    /// Factor on the stiffness of a cell for that share.
    pub fn share_factor(&self, cell: usize) -> f64 {
        self.embedded.as_ref().map_or(1.0, |embedded| embedded.factor(cell))
    }

    /// Nodes of a region.
    pub fn nodes_in(&self, region: &Region) -> Vec<u32> {
        (0..self.node_count()).filter(|n| self.contains(region, *n)).map(|n| n as u32).collect()
    }

    /// Larger horizontal cell edge; of a mesh the mean width, m.
    pub fn cell_width(&self) -> f64 {
        self.unstructured.as_ref().map_or(self.edge[0].max(self.edge[1]), |of| of.mesh.cell_width())
    }

    /// Number of nodes of a region.
    pub fn count_in(&self, region: &Region) -> usize {
        (0..self.node_count()).filter(|n| self.contains(region, *n)).count()
    }

    /// Node nearest to a rest position.
    pub fn nearest(&self, point: [f64; 3]) -> usize {
        if self.unstructured.is_some() {
            let squared = |node: &usize| (0..3).map(|n| (self.rest(*node)[n] - point[n]).powi(2)).sum::<f64>();
            let nearer = |a: &usize, b: &usize| squared(a).total_cmp(&squared(b));
            return (0..self.node_count()).min_by(nearer).unwrap_or(0);
        }
        let along = |axis: usize| {
            let i = (point[axis] / self.edge[axis] + 0.5 * self.cells[axis] as f64).round();
            i.clamp(0.0, self.cells[axis] as f64) as usize
        };
        let level = (0..self.heights.len())
            .min_by(|a, b| (self.heights[*a] - point[2]).abs().total_cmp(&(self.heights[*b] - point[2]).abs()))
            .unwrap_or(0);
        self.params::<f64>().node_id([along(0), along(1), level])
    }
}
