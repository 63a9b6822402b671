//! Rotations of a coarse level's cells: the mean of the up to four child cells, and the fraction of the coarse cell that they fill.
//!
//! Multigrid coarsens x and y by two and keeps z. The length of a quaternion is `s^¼`, where `s` is the remaining fraction of the cell.
//! With `|q|²` times the rotation matrix, `R K Rᵀ` is then `s` times the rotated stiffness: `q_c = s_c^¼ Σ s_i q̂_i / |Σ s_i q̂_i|`,
//! `s_c = Σ s_i / 4`. A cell that was removed or lies outside the finer grid (odd sizes) has `s = 0`. The coarse operator needs no
//! assembled matrix: one 24×24 matrix per level and layer, `Σ PᵀKP` over the four children (`bodies::grid::levels`), rotated and scaled per
//! cell.
//!
//! The stiffness `y ⊗ y` of a hyperelastic cell's mean volume ([`super::linearised`]) has `y_c = Σ s_i (y_1, y_2, 2 y_3)_i / Σ s_i`: a coarse cell
//! has four times the volume and twice the edges along x and y. (The four volumes apart from their mean stay in `Σ PᵀKP`.) The same holds
//! for `p` of the tension.

use super::linearised::{self, HYPERELASTIC};
use super::{Params, Source};
use crate::math::{Real, V4};

/// The shader.
pub const SOURCE: Source =
    Source { name: "coarsen", wgsl: include_str!("coarsen.wgsl"), params: Params::<f32>::FIELDS };

/// Computes the coarse level's rotations.
pub fn coarsen<R: Real>(
    params: &Params<R>,            // of the finer level
    rotation: &[V4<R>],            // [cell] quaternion
    coarse_rotation: &mut [V4<R>], // [coarse cell] quaternion
) {
    let [cells_x, cells_y, _] = params.coarse_cells();
    let count = cells_x * cells_y * params.cells_z as usize;
    let (coarse_rotation, rows) = coarse_rotation.split_at_mut(count);
    let mut rows = rows.as_chunks_mut::<3>().0.iter_mut();
    for (cell, out) in coarse_rotation.iter_mut().enumerate() {
        let mut sums = [[R::zero(); 4]; 3];
        let (x, y, z) = (cell % cells_x, cell / cells_x % cells_y, cell / (cells_x * cells_y));
        let mut sum = [R::zero(); 4];
        let mut share = R::zero();
        for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let (fine_x, fine_y) = (2 * x + dx, 2 * y + dy);
            if fine_x >= params.cells_x as usize || fine_y >= params.cells_y as usize {
                continue;
            }
            let fine = params.cell_id([fine_x, fine_y, z]);
            let q = rotation[fine];
            let squared = dot(q, q);
            if squared == R::zero() {
                continue;
            }
            // s q̂ = |q|⁴ q/|q|; q and −q are the same rotation
            let mut weight = squared * squared.sqrt();
            if dot(q, sum) < R::zero() {
                weight = -weight;
            }
            for n in 0..4 {
                sum[n] += weight * q[n];
            }
            share += squared * squared;
            if params.corotational >= HYPERELASTIC {
                let own = linearised::rows(params, rotation, fine);
                for (sum, row) in sums.iter_mut().zip(own) {
                    sum.iter_mut().zip(row).for_each(|(sum, y)| *sum += *y * squared * squared);
                }
            }
        }
        if let Some(rows) = rows.next() {
            let mean = if share > R::zero() { R::one() / share } else { R::zero() };
            let factors = [mean, mean, mean + mean];
            *rows = [0, 1, 2].map(|n| sums[n].map(|y| y * factors[n]));
        }
        let squared = dot(sum, sum);
        *out = [R::zero(); 4];
        if squared > R::zero() {
            let length = (R::of(0.25) * share).sqrt().sqrt() / squared.sqrt();
            *out = sum.map(|c| c * length);
        }
    }
}

fn dot<R: Real>(a: V4<R>, b: V4<R>) -> R {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]
}
