//! Material points: what moves with a few nodes.

use super::Grid;
use crate::kernels::corner;

/// A material point of a deformable body: node ids, each once, with their weights, which sum to 1. `u = Σ_a N_a u_a`, and a force on it
/// acts on the nodes by the same weights. Empty for a side that no deformable body has.
///
/// Most have up to eight nodes (a node, a point of a triangle, of a face or of a hexahedron); the skin under a blunt tip has more.
#[derive(Clone, Debug, Default, PartialEq)]
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

    /// Its nodes.
    pub fn nodes(&self) -> impl Iterator<Item = u32> {
        self.0.iter().map(|(node, _)| *node)
    }
}

/// Trilinear shape functions `N_a` at a point of a cell, with coordinates 0 to 1 along each axis; they extrapolate beyond it.
pub(super) fn trilinear(natural: [f64; 3]) -> [f64; 8] {
    std::array::from_fn(|a| (0..3).map(|m| if corner(a)[m] == 1 { natural[m] } else { 1.0 - natural[m] }).product())
}

impl Grid {
    /// The material point at a rest position in the grid's frame; none outside of it.
    pub fn material_point(&self, at: [f64; 3]) -> Option<MaterialPoint> {
        let mut cell = [0; 3];
        let mut natural = [0.0; 3];
        for axis in 0..2 {
            let along = at[axis] / self.edge[axis] + 0.5 * self.cells[axis] as f64;
            if !(0.0..=self.cells[axis] as f64).contains(&along) {
                return None;
            }
            cell[axis] = (along as usize).min(self.cells[axis] - 1);
            natural[axis] = along - cell[axis] as f64;
        }
        if !(self.heights[0]..=self.thickness()).contains(&at[2]) {
            return None;
        }
        let above = self.heights.partition_point(|height| *height <= at[2]);
        cell[2] = above.clamp(1, self.heights.len() - 1) - 1;
        natural[2] = (at[2] - self.heights[cell[2]]) / (self.heights[cell[2] + 1] - self.heights[cell[2]]);
        let params = self.params::<f64>();
        let corners = params.corners(params.cell_id(cell)).map(|id| id as u32);
        Some(MaterialPoint::of(corners, trilinear(natural)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Skin;

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
