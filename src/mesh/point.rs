//! Material points: what moves with a few nodes.

use super::{Embedded, Grid, Unstructured};
use crate::kernels::corner;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A material point of a deformable body: node ids, each once, with their weights, which sum to 1. `u = Σ_a N_a u_a`, and a force on it
/// acts on the nodes by the same weights. Empty for a side that no deformable body has.
///
/// Most have up to eight nodes (a node, a point of a triangle, of a face or of a hexahedron); the skin under a blunt tip has more.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MaterialPoint(pub Vec<(u32, f64)>);

impl MaterialPoint {
    /// A node.
    pub fn node(id: u32) -> Self {
        Self(vec![(id, 1.0)])
    }

    /// Nodes with their weights; those without weight are left out.
    pub fn of<const N: usize>(nodes: [u32; N], weights: [f64; N]) -> Self {
        Self(nodes.into_iter().zip(weights).filter(|(_, weight)| *weight != 0.0).collect())
    }

    /// The same where what stands for nodes are points themselves.
    #[must_use]
    pub fn through(self, of: impl Fn(u32) -> Self) -> Self {
        let mut sum: BTreeMap<u32, f64> = BTreeMap::new();
        for (id, weight) in self.0 {
            of(id).0.into_iter().for_each(|(node, part)| *sum.entry(node).or_default() += weight * part);
        }
        Self(sum.into_iter().collect())
    }

    /// Its nodes.
    pub fn nodes(&self) -> impl Iterator<Item = u32> {
        self.0.iter().map(|(node, _)| *node)
    }
}

/// Trilinear shape functions `N_a` at a point of a cell, with coordinates 0 to 1 along each axis; they extrapolate beyond it.
pub fn trilinear(natural: [f64; 3]) -> [f64; 8] {
    std::array::from_fn(|a| (0..3).map(|m| if corner(a)[m] == 1 { natural[m] } else { 1.0 - natural[m] }).product())
}

/// Weight below which a node has none: coordinates in scenes are rounded.
const NONE: f64 = 1e-9;

/// The tetrahedron of a mesh at a rest position in its frame, outside of it the nearest, and the weights of its corners.
fn tetrahedron_at(unstructured: &Unstructured, at: [f64; 3]) -> (usize, [f64; 4]) {
    let (e, weights) = unstructured.mesh.nearest(at);
    (e, weights.map(|weight| if weight.abs() < NONE { 0.0 } else { weight }))
}

/// The point of a mesh at a rest position in its frame; outside of it by the shape functions of the nearest tetrahedron.
fn of_tetrahedron(unstructured: &Unstructured, at: [f64; 3]) -> MaterialPoint {
    let (e, weights) = tetrahedron_at(unstructured, at);
    MaterialPoint::of(unstructured.mesh.tetrahedra()[e], weights)
}

impl Embedded {
    /// A point of the surface as its nodes.
    pub fn point(&self, point: u32) -> MaterialPoint {
        MaterialPoint::of(self.nodes[point as usize], self.weights[point as usize])
    }
}

impl Grid {
    /// The material point at a rest position in the frame of a mesh, or nearest to it; none of a grid.
    pub fn point_of_mesh(&self, at: [f64; 3]) -> Option<MaterialPoint> {
        self.unstructured.as_ref().map(|unstructured| of_tetrahedron(unstructured, at))
    }

    /// The tetrahedron of a mesh at a rest position in its frame, or nearest to it, and the weights of its corners; none of a grid.
    pub fn tetrahedron_at(&self, at: [f64; 3]) -> Option<(usize, [f64; 4])> {
        self.unstructured.as_ref().map(|unstructured| tetrahedron_at(unstructured, at))
    }

    /// The material point at a rest position in the grid's frame; none outside of it, or where an embedded surface leaves no cell.
    pub fn material_point(&self, at: [f64; 3]) -> Option<MaterialPoint> {
        if let Some(unstructured) = &self.unstructured {
            return unstructured.mesh.holds(at).then(|| of_tetrahedron(unstructured, at));
        }
        let half = |axis: usize| 0.5 * self.cells[axis] as f64;
        let inside = |axis: usize| (0.0..=self.cells[axis] as f64).contains(&(at[axis] / self.edge[axis] + half(axis)));
        if !(inside(0) && inside(1) && (self.heights[0]..=self.thickness()).contains(&at[2])) {
            return None;
        }
        let (cell, natural) = match &self.embedded {
            Some(_) => self.present_at(at)?,
            None => self.cell_at(at),
        };
        let corners = self.params::<f64>().corners(cell).map(|id| id as u32);
        Some(MaterialPoint::of(corners, trilinear(natural)))
    }

    /// A present cell at a rest position in the grid's frame, of several the one with the largest share of the body, with the natural
    /// coordinates there; none where every cell there is gone.
    pub fn present_at(&self, at: [f64; 3]) -> Option<(usize, [f64; 3])> {
        let cells = self.cells_at(at).into_iter().filter(|(cell, _)| self.is_present(*cell));
        cells.max_by(|a, b| self.share(a.0).total_cmp(&self.share(b.0)))
    }

    /// The cell at a finite rest position in the grid's frame, with its natural coordinates there, 0 to 1; outside of the grid those of the
    /// nearest position of its box.
    pub fn cell_at(&self, at: [f64; 3]) -> (usize, [f64; 3]) {
        let mut cell = [0; 3];
        let mut natural = [0.0; 3];
        for axis in 0..2 {
            let count = self.cells[axis];
            let along = (at[axis] / self.edge[axis] + 0.5 * count as f64).clamp(0.0, count as f64);
            cell[axis] = (along as usize).min(count - 1);
            natural[axis] = along - cell[axis] as f64;
        }
        let height = at[2].clamp(self.heights[0], self.thickness());
        let above = self.heights.partition_point(|level| *level <= height);
        cell[2] = above.clamp(1, self.heights.len() - 1) - 1;
        natural[2] = (height - self.heights[cell[2]]) / (self.heights[cell[2] + 1] - self.heights[cell[2]]);
        (self.params::<f64>().cell_id(cell), natural)
    }
}

/// Distance from a node, in edges of its cell, within which a coordinate counts as the node's: coordinates in scenes are rounded, −0.8333 mm
/// where the node is at −10/12 mm. With a larger one a point would be moved by more than its last decimal.
const AT_NODE: f64 = 1e-4;

impl Grid {
    /// Cells that contain a rest position in the grid's frame, each with the position's natural coordinates in it, 0 to 1 along each axis:
    /// one, or up to eight where it lies on a face, an edge or a corner. A position outside counts as the nearest one of the grid's box;
    /// it must be finite.
    pub fn cells_at(&self, at: [f64; 3]) -> Vec<(usize, [f64; 3])> {
        // along x and y in cells, along z by the levels' heights
        let along = |axis: usize| (at[axis] / self.edge[axis] + 0.5 * self.cells[axis] as f64, self.cells[axis]);
        let levels = self.heights.len() - 1;
        let level = self.heights.partition_point(|height| *height <= at[2]).clamp(1, levels) - 1;
        let up = (at[2] - self.heights[level]) / (self.heights[level + 1] - self.heights[level]);
        let rows = [along(0), along(1), (level as f64 + up, levels)].map(|(place, count)| places(place, count));
        let params = self.params::<f64>();
        let mut out = vec![];
        for (k, z) in &rows[2] {
            for (j, y) in &rows[1] {
                out.extend(rows[0].iter().map(|(i, x)| (params.cell_id([*i, *j, *k]), [*x, *y, *z])));
            }
        }
        out
    }
}

/// Intervals of a row of `count` unit intervals that contain a place, with its coordinate in each.
fn places(place: f64, count: usize) -> Vec<(usize, f64)> {
    let place = place.clamp(0.0, count as f64);
    let node = place.round();
    if (place - node).abs() > AT_NODE {
        let below = (place as usize).min(count - 1);
        return vec![(below, place - below as f64)];
    }
    let node = node as usize;
    let before = node.checked_sub(1).map(|below| (below, 1.0));
    before.into_iter().chain((node < count).then_some((node, 0.0))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Skin;

    #[test]
    fn a_position_on_a_corner_is_in_all_its_cells_and_outside_it_is_the_nearest() {
        let grid = Grid::new(&Skin::default());
        let node = grid.params::<f64>().node_id([1, 1, 1]);
        let at = grid.rest(node);
        let found = grid.cells_at(at);
        assert_eq!(found.len(), 8, "{found:?}");
        for (cell, place) in &found {
            let corner = (0..8).find(|a| corner(*a).map(|c| c as f64) == *place).expect("a corner");
            assert_eq!(grid.params::<f64>().corners(*cell)[corner], node);
        }
        // within the rounding of a decimal it is the node, beyond it is not
        let edge = grid.edge[0];
        assert_eq!(grid.cells_at([at[0] + 0.9 * AT_NODE * edge, at[1], at[2]]).len(), 8);
        assert_eq!(grid.cells_at([at[0] + 1.5 * AT_NODE * edge, at[1], at[2]]).len(), 4);
        // between nodes the weights give the position back
        for share in [0.013, 0.4, 0.77] {
            let inside = [0, 1, 2].map(|n| at[n] + share * [grid.edge[0], grid.edge[1], 0.1e-3][n]);
            let [(cell, place)] = grid.cells_at(inside)[..] else { panic!("one cell") };
            let weights = trilinear(place);
            let corners = grid.params::<f64>().corners(cell);
            for axis in 0..3 {
                let back: f64 = corners.iter().zip(weights).map(|(n, w)| w * grid.rest(*n)[axis]).sum();
                assert!((back - inside[axis]).abs() < 1e-15, "{back} for {inside:?}");
            }
        }
        let far = grid.cells_at([1.0, -1.0, 1.0]);
        assert_eq!(
            far,
            vec![(grid.params::<f64>().cell_id([grid.cells[0] - 1, 0, grid.cells[2] - 1]), [1.0, 0.0, 1.0])]
        );
    }

    #[test]
    fn weights_give_the_point_back_and_outside_there_is_none() {
        let grid = Grid::new(&Skin::default());
        let size = [0, 1].map(|n| grid.edge[n] * grid.cells[n] as f64);
        let shares = [0.0, 0.13, 0.5, 0.77, 1.0];
        for (i, j, k) in (0..125).map(|n| (n % 5, n / 5 % 5, n / 25)) {
            let at = [(shares[i] - 0.5) * size[0], (shares[j] - 0.5) * size[1], shares[k] * grid.thickness()];
            let point = grid.material_point(at).expect("inside");
            assert!(point.0.len() <= 8 && (point.0.iter().map(|(_, w)| w).sum::<f64>() - 1.0).abs() < 1e-12);
            for axis in 0..3 {
                let back: f64 = point.0.iter().map(|(node, w)| w * grid.rest(*node as usize)[axis]).sum();
                assert!((back - at[axis]).abs() < 1e-12, "{at:?}: {back} along {axis}");
            }
        }
        for axis in 0..3 {
            let mut at = [0.0, 0.0, 0.5 * grid.thickness()];
            at[axis] = 1.0;
            assert_eq!(grid.material_point(at), None);
            at[axis] = f64::NAN;
            assert_eq!(grid.material_point(at), None);
        }
    }
}
