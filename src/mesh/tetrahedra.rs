//! Tetrahedra of a body: of its mesh, or six to each cell of its grid, along the cell's diagonal, with the grid's nodes.
//! Source: Kuhn 1960 (six simplices of a cube).

use super::{Grid, Unstructured};
use crate::kernels::corner;

/// Tetrahedra per cell.
pub const PER_CELL: usize = 6;

/// Tetrahedra of a cell by the cell's corners: each goes from the first corner to the opposite one along the axes in one of their six
/// orders.
fn of_cell() -> [[usize; 4]; PER_CELL] {
    let at = |axes: &[usize]| {
        let place: [usize; 3] = std::array::from_fn(|n| usize::from(axes.contains(&n)));
        (0..8).find(|a| corner(*a) == place).unwrap_or_else(|| unreachable!("a cell has every corner"))
    };
    let path = |[x, y, z]: [usize; 3]| [at(&[]), at(&[x]), at(&[x, y]), at(&[x, y, z])];
    // the odd orders are mirrored
    let odd = |order| {
        let [a, b, c, d] = path(order);
        [a, c, b, d]
    };
    [path([0, 1, 2]), path([1, 2, 0]), path([2, 0, 1]), odd([0, 2, 1]), odd([1, 0, 2]), odd([2, 1, 0])]
}

impl Grid {
    /// Tetrahedra with their layers: of the mesh, or six to each cell.
    pub fn tetrahedra(&self) -> Vec<([u32; 4], usize)> {
        if let Some(Unstructured { mesh, .. }) = self.unstructured.as_deref() {
            return mesh
                .tetrahedra()
                .iter()
                .zip(mesh.layers())
                .map(|(corners, layer)| (*corners, *layer as usize))
                .collect();
        }
        let params = self.params::<f64>();
        let split = of_cell();
        let of = |cell: usize| {
            let (corners, layer) = (params.corners(cell).map(|id| id as u32), self.layer(cell));
            split.map(|tetrahedron| (tetrahedron.map(|a| corners[a]), layer))
        };
        (0..self.cell_count()).flat_map(of).collect()
    }

    /// Number of [`Grid::tetrahedra`].
    pub fn tetrahedron_count(&self) -> usize {
        match &self.unstructured {
            Some(unstructured) => unstructured.mesh.tetrahedra().len(),
            None => PER_CELL * self.cell_count(),
        }
    }

    /// Layer of one of [`Grid::tetrahedra`].
    pub fn tetrahedron_layer(&self, e: usize) -> usize {
        self.layer(if self.unstructured.is_some() { e } else { e / PER_CELL })
    }

    /// Number of pairs of an edge of [`Grid::tetrahedra`] and a layer of one around it.
    pub fn tetrahedron_edges(&self) -> usize {
        if self.unstructured.is_some() {
            let ends = |(corners, layer): ([u32; 4], usize)| {
                PAIRS.map(|pair| {
                    let [a, b] = pair.map(|k| corners[k]);
                    (a.min(b), a.max(b), layer)
                })
            };
            let mut all: Vec<_> = self.tetrahedra().into_iter().flat_map(ends).collect();
            all.sort_unstable();
            all.dedup();
            return all.len();
        }
        let ([x, y, z], [nx, ny, nz]) = (self.cells, self.nodes);
        let in_plane = x * ny + nx * y + x * y;
        let borders = self.layer_of.windows(2).filter(|w| w[0] != w[1]).count();
        in_plane * (nz + borders) + z * (nx * ny + x * ny + nx * y) + x * y * z
    }
}

/// Pairs of corners that are the edges of a tetrahedron.
pub const PAIRS: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];
