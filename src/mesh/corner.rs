//! Positions of the wound's surface corners, and their motion with the nodes of their own component.
//!
//! Of a grid here, of a mesh of tetrahedra in [`super::TetrahedralParts`]. A corner belongs to a node `n`. Its rest position is `X_n + o`, where `o` is the mean of the crossings of the cut links around the node.
//! All duplicates of a node share `o`, so a closed wound has no gap. The corner moves with the hexahedron around it, `u = Σ_a N_a(ξ) u_a`
//! over the eight nodes of one cell of its component: of those around the node, the one that the corner is inside, or nearest to. Where the
//! crossings lie outside the component's cells, `N_a` is extrapolated (by half a cell at most, along each axis).

use super::Grid;
use super::parts::{Parts, corner_number, octant};
use super::point::trilinear;

/// Corner of the surface: see the module.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corner {
    /// Offset from the rest position of its node, m.
    pub offset: [f64; 3],
    /// Nodes that it moves with.
    pub nodes: [u32; 8],
    /// Interpolation weights of the nodes; their sum is 1.
    pub weights: [f64; 8],
}

impl Corner {
    /// Displacement `Σ_a N_a u_a` of the corner from those of the nodes.
    pub fn moved(&self, motion: impl Fn(u32) -> [f64; 3]) -> [f64; 3] {
        let of = self.nodes.map(motion);
        std::array::from_fn(|axis| (0..8).map(|a| self.weights[a] * of[a][axis]).sum())
    }
}

impl Parts {
    /// Offset of the surface corner from the node's rest position, m: the mean of the crossings of the cut links around it. On the outside
    /// of the body without the component that would leave it. Zero where no link is cut.
    pub fn offset(&self, grid: &Grid, node: usize) -> [f64; 3] {
        let zero = [0.0; 3];
        let Some(c) = self.params.grid_coordinates(&self.table, node).filter(|_| !self.crossings.is_empty()) else {
            return zero;
        };
        let (mut sum, mut count) = (zero, 0.0);
        let steps = grid.around(c[2]);
        // sum of the crossings over the links between the octants
        for n in 0..8 {
            for (axis, bit) in [(0, 2), (1, 4), (2, 1)] {
                let Some((cell, _)) = self.cell_in(c, n).filter(|_| n & bit == 0) else { continue };
                let Some(at) = self.crossings.get(&(3 * cell as u32 + axis as u32)) else { continue };
                let o = octant(n);
                for m in 0..3 {
                    // from the centre of the cell to that of its neighbour
                    let centre = |beyond: usize| if beyond == 1 { 0.5 * steps[m][1] } else { -0.5 * steps[m][0] };
                    sum[m] += if m == axis { centre(0) + at * (centre(1) - centre(0)) } else { centre(o[m]) };
                }
                count += 1.0;
            }
        }
        if count == 0.0 {
            return zero;
        }
        // nodes on the outside stay on it
        let size = [self.params.nodes_x, self.params.nodes_y, self.params.nodes_z].map(|n| n as usize - 1);
        std::array::from_fn(|m| if c[m] == 0 || c[m] == size[m] { 0.0 } else { sum[m] / count })
    }

    /// Surface corner at a node; a node without a cut link or without cells is its own corner.
    pub fn corner(&self, grid: &Grid, node: usize) -> Corner {
        let offset = self.offset(grid, node);
        let mut own = Corner { offset, nodes: [node as u32; 8], weights: [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0] };
        let Some(c) = self.params.grid_coordinates(&self.table, node).filter(|_| offset != [0.0; 3]) else {
            return own;
        };
        let steps = grid.around(c[2]);
        let mut least = f64::INFINITY;
        // of the component's cells, the one that the corner is inside, or nearest to
        for n in 0..8 {
            let cell = self.cell_in(c, n).map(|(cell, _)| self.corners(cell));
            let (sides, at_node) = (octant(n), corner_number(octant(n).map(|side| 1 - side)));
            let Some(corners) = cell.filter(|corners| corners[at_node] == node) else { continue };
            // natural coordinates in the cell, 0 to 1 along each axis
            let natural: [f64; 3] = std::array::from_fn(|m| (1 - sides[m]) as f64 + offset[m] / steps[m][sides[m]]);
            let outside: f64 = natural.iter().map(|t| (t - t.clamp(0.0, 1.0)).powi(2)).sum();
            if outside < least {
                least = outside;
                own.nodes = corners.map(|id| id as u32);
                own.weights = trilinear(natural);
            }
        }
        own
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::Params;

    const CELLS: usize = 6;

    fn grid() -> Grid {
        Grid {
            cells: [CELLS, CELLS, 3],
            nodes: [CELLS + 1, CELLS + 1, 4],
            edge: [1e-3, 0.7e-3],
            heights: vec![0.0, 0.6e-3, 1.1e-3, 1.2e-3],
            layer_of: vec![0, 1, 2],
            unstructured: None,
            embedded: None,
        }
    }

    /// A cut across y from x = 0 to the middle, one level of cells less than through, that wanders along y as it goes.
    fn cut() -> (Grid, Parts) {
        let grid = grid();
        let params = Params { extra_columns: 20, split_cells: 200, touched_nodes: 400, ..grid.params() };
        let mut parts = Parts::new(Params { node_count: params.node_count + 20 * params.nodes_z, ..params });
        let hits: Vec<(u32, f64)> = (0..4)
            .flat_map(|i| (1..3).map(move |k| (i, k)))
            .map(|(i, k)| (3 * params.cell_id([i, 2, k]) as u32 + 1, [0.15, 0.4, 0.7, 0.95][i]))
            .collect();
        let change = parts.cut(&hits);
        assert!(change.refused == 0 && change.copies.len() > 4, "{change:?}");
        (grid, parts)
    }

    fn nodes(grid: &Grid, parts: &Parts) -> Vec<usize> {
        let copies = (0..grid.node_count()).flat_map(|n| parts.copies(n)).map(|n| n as usize);
        (0..grid.node_count()).chain(copies).collect()
    }

    fn rest(grid: &Grid, parts: &Parts, node: usize) -> [f64; 3] {
        grid.rest(parts.original(node))
    }

    #[test]
    fn weights_give_linear_fields_at_the_corner() {
        let (grid, parts) = cut();
        let field =
            |x: [f64; 3]| [0, 1, 2].map(|k| 0.3 + [2.0, -1.0, 0.5][k] * x[0] - 3.0 * x[1] + [1.0, 4.0, -2.0][k] * x[2]);
        let mut beside = 0;
        for node in nodes(&grid, &parts) {
            let corner = parts.corner(&grid, node);
            beside += usize::from(corner.offset != [0.0; 3]);
            let sum: f64 = corner.weights.iter().sum();
            assert!((sum - 1.0).abs() < 1e-14, "node {node}: {sum}");
            let x = rest(&grid, &parts, node);
            let wanted = field([0, 1, 2].map(|k| x[k] + corner.offset[k]));
            let found = corner.moved(|n| field(rest(&grid, &parts, n as usize)));
            for k in 0..3 {
                // products and sums of eight terms of the field's size, 0.3
                assert!((found[k] - wanted[k]).abs() < 1e-14, "node {node}: {found:?} for {wanted:?}");
            }
            let at_node = field(x);
            assert!(corner.offset == [0.0; 3] || (at_node[0] - wanted[0]).abs() > 1e-6, "the field tells no offset");
        }
        assert!(beside > 15, "only {beside} corners beside their nodes");
    }

    #[test]
    fn a_corner_moves_with_its_own_part_alone() {
        let (grid, parts) = cut();
        for node in nodes(&grid, &parts) {
            let corner = parts.corner(&grid, node);
            let own = parts.cells_of(node);
            let cell = own.iter().find(|cell| parts.corners(**cell).map(|n| n as u32) == corner.nodes);
            assert!(corner.offset == [0.0; 3] || cell.is_some(), "node {node} moves with {:?}", corner.nodes);
            // at most half a cell outside the hexahedron along each axis
            assert!(corner.weights.iter().all(|w| w.abs() <= 1.5f64.powi(3)), "{:?}", corner.weights);
        }
    }

    #[test]
    fn a_closed_wound_has_no_gap_and_parts_as_its_lips_do() {
        let (grid, parts) = cut();
        let lips: Vec<[usize; 2]> =
            (0..grid.node_count()).flat_map(|n| parts.copies(n).into_iter().map(move |c| [n, c as usize])).collect();
        assert!(lips.len() > 4, "{lips:?}");
        let shift = [0.1e-3, 0.4e-3, -0.05e-3];
        for pair in lips {
            let corner = pair.map(|node| parts.corner(&grid, node));
            let position = |k: usize| [0, 1, 2].map(|m| rest(&grid, &parts, pair[k])[m] + corner[k].offset[m]);
            let gap = (0..3).map(|m| (position(0)[m] - position(1)[m]).abs()).fold(0.0, f64::max);
            assert!(gap < 1e-15 && corner[0].offset != [0.0; 3], "{gap} m at {pair:?}");
            // each lip's own nodes moved, nothing else: it goes along, the other stays where none of its nodes is one of them
            let side = parts.cells_of(pair[1]);
            let moved_nodes: Vec<usize> = side.iter().flat_map(|cell| parts.corners(*cell)).collect();
            let motion = |n: u32| if moved_nodes.contains(&(n as usize)) { shift } else { [0.0; 3] };
            let moved = corner[1].moved(motion);
            assert!((0..3).all(|m| (moved[m] - shift[m]).abs() < 1e-17), "{moved:?}");
            assert_ne!(corner[0].moved(motion), moved, "the lips move together at {pair:?}");
        }
    }
}
