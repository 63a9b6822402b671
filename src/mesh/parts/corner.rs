//! Where the corners of the wound's surface lie, and how they move with the nodes of their own part.
//!
//! A corner lies beside its node `n`, at rest at `X_n + o`, `o` the mean of the crossings of the cut links around the node; all copies of
//! a node have the same `o`, so a wound that is closed has no gap. It moves as the brick around it does, `u = Σ_a N_a(ξ) u_a` over the
//! eight nodes of one cell that has the node as a corner and is of its part: the one in whose octant `o` points most nearly. Where the
//! crossings lie beyond the part's own cells, `N_a` goes on beyond the brick (by half a cell at most, along each axis).

use super::{Parts, corner_number, octant};
use crate::kernels::corner;
use crate::mesh::Grid;

/// A corner of the surface: see the module.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corner {
    /// From the rest position of its node, m.
    pub offset: [f64; 3],
    /// Nodes that it moves with.
    pub nodes: [u32; 8],
    /// Share of each of their motions; their sum is 1.
    pub weights: [f64; 8],
}

impl Corner {
    /// The motion `Σ_a N_a u_a` of the corner, of what the nodes move by.
    pub fn moved(&self, motion: impl Fn(u32) -> [f64; 3]) -> [f64; 3] {
        let of = self.nodes.map(motion);
        std::array::from_fn(|axis| (0..8).map(|a| self.weights[a] * of[a][axis]).sum())
    }
}

impl Parts {
    /// Where the wound's surface has a node, from the node's rest position, m: the mean of the crossings of the cut links around it, on
    /// the outside of the body without what would leave it. Zero where no link is cut.
    pub fn offset(&self, grid: &Grid, node: usize) -> [f64; 3] {
        let zero = [0.0; 3];
        let Some(c) = self.params.place(&self.table, node).filter(|_| !self.crossings.is_empty()) else {
            return zero;
        };
        let (mut sum, mut count) = (zero, 0.0);
        let steps = grid.around(c[2]);
        for n in 0..8 {
            for (axis, bit) in [(0, 2), (1, 4), (2, 1)] {
                let Some((cell, _)) = self.cell_in(c, n).filter(|_| n & bit == 0) else { continue };
                let Some(at) = self.crossings.get(&(3 * cell as u32 + axis as u32)) else { continue };
                let o = octant(n);
                for m in 0..3 {
                    // from the centre of the cell to that of its neighbour
                    let place = |beyond: usize| if beyond == 1 { 0.5 * steps[m][1] } else { -0.5 * steps[m][0] };
                    sum[m] += if m == axis { place(0) + at * (place(1) - place(0)) } else { place(o[m]) };
                }
                count += 1.0;
            }
        }
        if count == 0.0 {
            return zero;
        }
        let size = [self.params.nodes_x, self.params.nodes_y, self.params.nodes_z].map(|n| n as usize - 1);
        std::array::from_fn(|m| if c[m] == 0 || c[m] == size[m] { 0.0 } else { sum[m] / count })
    }

    /// The corner that the surface has at a node; a node beside no cut link, or of no cell, is its own corner.
    pub fn corner(&self, grid: &Grid, node: usize) -> Corner {
        let offset = self.offset(grid, node);
        let mut own = Corner { offset, nodes: [node as u32; 8], weights: [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0] };
        let Some(c) = self.params.place(&self.table, node).filter(|_| offset != [0.0; 3]) else {
            return own;
        };
        let steps = grid.around(c[2]);
        let mut least = f64::INFINITY;
        for n in 0..8 {
            let cell = self.cell_in(c, n).map(|(cell, _)| self.corners(cell));
            let (sides, at_node) = (octant(n), corner_number(octant(n).map(|side| 1 - side)));
            let Some(corners) = cell.filter(|corners| corners[at_node] == node) else { continue };
            // place in the cell, 0 to 1 along each axis
            let place: [f64; 3] = std::array::from_fn(|m| (1 - sides[m]) as f64 + offset[m] / steps[m][sides[m]]);
            let outside: f64 = place.iter().map(|t| (t - t.clamp(0.0, 1.0)).powi(2)).sum();
            if outside < least {
                least = outside;
                own.nodes = corners.map(|id| id as u32);
                own.weights = std::array::from_fn(|a| {
                    (0..3).map(|m| if corner(a)[m] == 1 { place[m] } else { 1.0 - place[m] }).product()
                });
            }
        }
        own
    }
}
