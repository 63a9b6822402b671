//! Coarse levels of geometric multigrid: x and y coarsened by two, z kept; one 24×24 matrix per level and layer, never assembled.
//!
//! A coarse cell's matrix is `Σ PᵀKP` over its four children (Galerkin), with the bilinear interpolation `P` from its corners to theirs.
//! This is the operator of an assembled Galerkin product at rest, so it inherits B-bar's cure for locking (rediscretised coarse hexahedra
//! lock: 81 iterations instead of 39 at ν = 0.499). It is rotated by the children's mean rotation and scaled by the fraction of children
//! left.
//!
//! The smoother needs an upper bound of the eigenvalues of `M⁻¹A`, where `M` has the z-column blocks of `A`. It is found cell by cell: let
//! `D` be the part of a cell's `K` within its four vertical edges, then `zᵀAz = Σ z_cᵀ K z_c ≤ max λ(K, D) Σ z_cᵀ D z_c = max λ(K, D) zᵀMz`
//! (Wathen 1987). Rotations transform `K` and `D` alike; a cut or a fixed node removes the same terms from both sums; lumped inertia adds
//! the same to both, and a consistent mass adds at most [`OF_MASS`] times as much. The bound follows from the element matrix alone and
//! always holds. (Coarse levels use lumped masses.)

use super::element::{Matrix, modes};
use crate::kernels::product::tiles;
use crate::kernels::{Params, corner};
use crate::math::Real;
use crate::math::elementary::{acos, cos};
use crate::mesh::Grid;

/// Maximum number of cells along x and y of the coarsest level, which is solved by smoothing alone.
pub const COARSEST: usize = 2;

/// `λ(M, D)` of a consistent mass: 3/2 along x times 3/2 along y. Lumped masses have 1.
pub const OF_MASS: f64 = 2.25;

/// `λ(c ⊗ c, D)` of the stiffness of a hyperelastic cell's volume, whatever its direction: `(Σ c_e·z_e)² ≤ 4 Σ (c_e·z_e)²` over the four
/// vertical edges.
pub const OF_VOLUME: f64 = 4.0;

/// One level below the finest.
#[derive(Clone, Debug)]
pub struct Level {
    /// Cells along each axis.
    pub cells: [usize; 3],
    /// `[layer]` N/m
    pub stiffness: Vec<Matrix>,
    /// `[node]` DOF mask per axis (1 free, 0 fixed) and mass, kg; empty in a model of sizes.
    pub dofs: Vec<[f64; 4]>,
    /// Upper bound of the eigenvalues of `M⁻¹A`.
    pub largest: f64,
}

impl Level {
    /// Kernel parameters with this level's sizes; other values as on the finest level.
    pub fn params<R: Real>(&self, finest: Params<R>) -> Params<R> {
        let [cells_x, cells_y, cells_z] = self.cells.map(|c| c as u32);
        let mut params = Params {
            nodes_x: cells_x + 1,
            nodes_y: cells_y + 1,
            nodes_z: cells_z + 1,
            node_count: (cells_x + 1) * (cells_y + 1) * (cells_z + 1),
            cells_x,
            cells_y,
            cells_z,
            cell_count: cells_x * cells_y * cells_z,
            extra_columns: 0,
            split_cells: 0,
            touched_nodes: 0,
            ..finest
        };
        params.product_groups = tiles(&params) as u32;
        params
    }
}

/// Levels below a grid, in order of coarsening; empty if the grid itself is coarse. Without `dofs` they have none either.
pub fn levels(grid: &Grid, stiffness: &[Matrix], dofs: &[[f64; 4]]) -> Vec<Level> {
    let mut out: Vec<Level> = vec![];
    let mut cells = grid.cells;
    while cells[0].max(cells[1]) > COARSEST {
        let (fine, fine_dofs): (&[Matrix], &[[f64; 4]]) = match out.last() {
            Some(level) => (&level.stiffness, &level.dofs),
            None => (stiffness, dofs),
        };
        let stiffness: Vec<Matrix> = fine.iter().map(galerkin).collect();
        let (dofs, coarse) = coarse_dofs(cells, fine_dofs);
        out.push(Level { cells: coarse, largest: largest(&stiffness), stiffness, dofs });
        cells = coarse;
    }
    out
}

/// `Σ PᵀKP` over the four children of a coarse cell.
fn galerkin(k: &Matrix) -> Matrix {
    let mut out = [[0.0; 24]; 24];
    for child in [[0, 0], [1, 0], [0, 1], [1, 1]] {
        // [child's corner][parent's corner]
        let weight = |a: usize, b: usize| {
            let (o, p) = (corner(a), corner(b));
            let along = |n: usize| {
                let at = 0.5 * (child[n] + o[n]) as f64;
                if p[n] == 1 { at } else { 1.0 - at }
            };
            if o[2] == p[2] { along(0) * along(1) } else { 0.0 }
        };
        let p: [[f64; 8]; 8] = std::array::from_fn(|a| std::array::from_fn(|b| weight(a, b)));
        for (row, col) in (0..576).map(|n| (n / 24, n % 24)) {
            let (a, i, c, j) = (row / 3, row % 3, col / 3, col % 3);
            for (b, e) in (0..64).map(|n| (n / 8, n % 8)) {
                out[3 * b + i][3 * e + j] += p[a][b] * k[row][col] * p[c][e];
            }
        }
    }
    out
}

/// Masses and DOF masks of a coarse level. A mask is that of the fine node at the same position, or of the last fine node where the coarse
/// cell extends beyond the grid; 1 where that node has no cell and one beside it does.
fn coarse_dofs(cells: [usize; 3], dofs: &[[f64; 4]]) -> (Vec<[f64; 4]>, [usize; 3]) {
    let coarse = [cells[0].div_ceil(2), cells[1].div_ceil(2), cells[2]];
    if dofs.is_empty() {
        return (vec![], coarse);
    }
    let (nodes, coarse_nodes) = (cells.map(|c| c + 1), coarse.map(|c| c + 1));
    let fine_at = |x: usize, y: usize, z: usize| x + nodes[0] * (y + nodes[1] * z);
    let mut out = vec![[0.0; 4]; coarse_nodes.iter().product()];
    for (i, slot) in out.iter_mut().enumerate() {
        let at = [i % coarse_nodes[0], i / coarse_nodes[0] % coarse_nodes[1], i / (coarse_nodes[0] * coarse_nodes[1])];
        let same = fine_at((2 * at[0]).min(cells[0]), (2 * at[1]).min(cells[1]), at[2]);
        slot[..3].copy_from_slice(&dofs[same][..3]);
    }
    let used = |fine: usize| dofs[fine][3] > 0.0;
    for (i, fine) in dofs.iter().enumerate() {
        let at = [i % nodes[0], i / nodes[0] % nodes[1], i / (nodes[0] * nodes[1])];
        for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let (x, y) = (at[0] / 2 + at[0] % 2 * dx, at[1] / 2 + at[1] % 2 * dy);
            out[x + coarse_nodes[0] * (y + coarse_nodes[1] * at[2])][3] += 0.25 * fine[3];
        }
    }
    // a coarse node beside used ones is free where its own fine node has no cell
    for (i, slot) in out.iter_mut().enumerate().filter(|(_, slot)| slot[3] > 0.0) {
        let at = [i % coarse_nodes[0], i / coarse_nodes[0] % coarse_nodes[1], i / (coarse_nodes[0] * coarse_nodes[1])];
        if !used(fine_at((2 * at[0]).min(cells[0]), (2 * at[1]).min(cells[1]), at[2])) {
            slot[..3].fill(1.0);
        }
    }
    (out, coarse)
}

/// Largest `λ(K, D)` over the layers.
pub fn largest(stiffness: &[Matrix]) -> f64 {
    let bound = |k: &Matrix| {
        let mut d = *k;
        for (row, col) in (0..576).map(|n| (n / 24, n % 24)) {
            let (o, p) = (corner(row / 3), corner(col / 3));
            if o[..2] != p[..2] {
                d[row][col] = 0.0;
            }
        }
        // both decouple into eight 3×3 blocks
        modes(k).iter().zip(&modes(&d)).map(|(k, d)| pencil(k, d)).fold(0.0, f64::max)
    };
    stiffness.iter().map(bound).fold(0.0, f64::max)
}

/// Largest λ of `k v = λ d v`, both symmetric 3×3, `d` positive definite.
fn pencil(k: &[[f64; 3]; 3], d: &[[f64; 3]; 3]) -> f64 {
    // Cholesky factor d = L Lᵀ, and the inverse of L by rows
    let mut l = [[0.0; 3]; 3];
    for i in 0..3 {
        for j in 0..=i {
            let sum: f64 = (0..j).map(|n| l[i][n] * l[j][n]).sum();
            l[i][j] = if i == j { (d[i][i] - sum).sqrt() } else { (d[i][j] - sum) / l[j][j] };
        }
    }
    let mut inverse = [[0.0; 3]; 3];
    for col in 0..3 {
        for i in col..3 {
            let sum: f64 = (col..i).map(|n| l[i][n] * inverse[n][col]).sum();
            inverse[i][col] = (f64::from(u8::from(i == col)) - sum) / l[i][i];
        }
    }
    // c = L⁻¹ k L⁻ᵀ
    let c: [[f64; 3]; 3] = std::array::from_fn(|i| {
        std::array::from_fn(|j| (0..9).map(|n| inverse[i][n / 3] * k[n / 3][n % 3] * inverse[j][n % 3]).sum())
    });
    // largest eigenvalue of c: root of the characteristic polynomial (Smith 1961)
    let mean = (c[0][0] + c[1][1] + c[2][2]) / 3.0;
    let mut shifted = c;
    (0..3).for_each(|n| shifted[n][n] -= mean);
    let size = (shifted.iter().flatten().map(|v| v * v).sum::<f64>() / 6.0).sqrt();
    if size == 0.0 {
        return mean;
    }
    let m = shifted.map(|row| row.map(|v| v / size));
    let determinant = m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1])
        - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
        + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
    mean + 2.0 * size * cos(acos((0.5 * determinant).clamp(-1.0, 1.0)) / 3.0)
}
