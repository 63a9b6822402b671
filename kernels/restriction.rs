//! Restriction of a level's residual to the next coarser one: `r_c = F_c Pᵀ (r − w)`, `w = A z`.
//!
//! `P` interpolates bilinearly in x and y: node `2i` of the finer level is node `i` of the coarser one, odd nodes lie between two. The
//! duplicates of a node share its unknown on the coarser level: a cut changes nothing there. `F` is the DOF mask. Units: N.

use super::{PARALLEL, Params, Source};
use crate::math::wide::{Lanes, Task};
use crate::math::{Real, V4};
use rayon::prelude::*;

/// The shader.
pub const SOURCE: Source =
    Source { name: "restriction", wgsl: include_str!("restriction.wgsl"), params: Params::<f32>::FIELDS };

/// One right-hand side.
pub fn restriction<R: Real>(
    params: &Params<R>,     // of the finer level
    coarse_dofs: &[V4<R>],  // [coarse node] 1 free, 0 fixed, per axis
    split: &[u32],          // see `split`
    r: &[V4<R>],            // [node] N
    w: &[V4<R>],            // [node] N
    coarse_r: &mut [V4<R>], // [coarse node] N
) {
    let coarse_x = params.coarse_cells()[0] + 1;
    let rows = (CHUNK / coarse_x).max(1);
    let some = |(chunk, out): (usize, &mut [V4<R>])| {
        R::widest(Rows { params, dofs: coarse_dofs, split, r, w, first: chunk * rows, out });
    };
    coarse_r.par_chunks_mut(rows * coarse_x).enumerate().for_each(some);
}

/// Coarse nodes that a thread takes at once: four times as many fine ones.
const CHUNK: usize = PARALLEL / 4;

/// Some rows of coarse nodes.
struct Rows<'a, R> {
    params: &'a Params<R>,
    dofs: &'a [V4<R>],
    split: &'a [u32],
    r: &'a [V4<R>],
    w: &'a [V4<R>],
    first: usize, // row
    out: &'a mut [V4<R>],
}

impl<R: Real> Task<R> for Rows<'_, R> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<R>>(self, _: L) {
        let Rows { params, dofs, split, r, w, first, out } = self;
        let [coarse_x, coarse_y, _] = params.coarse_cells().map(|c| c + 1);
        let [nodes_x, nodes_y] = [params.nodes_x as usize, params.nodes_y as usize];
        let halves = [0.5, 1.0, 0.5].map(R::of); // share of the fine nodes before, at and behind a coarse one
        // sums along y, with one node more on both sides
        let mut sums = vec![[R::zero(); 4]; nodes_x + 2];
        for (row, out) in (first..).zip(out.chunks_exact_mut(coarse_x)) {
            let (y, level) = (2 * (row % coarse_y), row / coarse_y);
            let inner = &mut sums[1..=nodes_x];
            inner.fill([R::zero(); 4]);
            for (y, weight) in (y.saturating_sub(1)..nodes_y.min(y + 2)).map(|at| (at, halves[at + 1 - y])) {
                let nodes = nodes_x * (y + nodes_y * level)..nodes_x * (y + 1 + nodes_y * level);
                let (r_row, w_row) = (r[nodes.clone()].as_flattened(), w[nodes].as_flattened());
                let sums = inner.as_flattened_mut();
                for n in 0..sums.len().min(r_row.len()).min(w_row.len()) {
                    sums[n] += (r_row[n] - w_row[n]) * weight;
                }
                if params.extra_columns > 0 {
                    for (x, sum) in inner.iter_mut().enumerate() {
                        for e in params.extra_columns_beside(split, nodes_x * y + x) {
                            let copy = params.copy_id(e, level);
                            for n in 0..3 {
                                sum[n] += (r[copy][n] - w[copy][n]) * weight;
                            }
                        }
                    }
                }
            }
            // along x
            let dofs = &dofs[row * coarse_x..][..coarse_x];
            for i in 0..coarse_x {
                // with an odd number of cells the last coarse node lies beyond the fine ones
                let behind = sums.get(2 * i + 2).copied().unwrap_or_default();
                let [before, at] = [sums[2 * i], sums[2 * i + 1]];
                for n in 0..3 {
                    out[i][n] = (before[n] * halves[0] + at[n] + behind[n] * halves[2]) * dofs[i][n];
                }
                out[i][3] = R::zero();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::prolongation::prolongation;
    use crate::math::random::Random;

    #[test]
    fn it_is_the_transpose_of_prolongation_on_odd_and_even_grids() {
        let mut random = Random::new(5);
        for [cells_x, cells_y] in [[1, 1], [1, 3], [3, 1], [7, 8], [8, 7], [22, 21]] {
            let [nodes_x, nodes_y, nodes_z] = [cells_x + 1, cells_y + 1, 3];
            let node_count = nodes_x * nodes_y * nodes_z;
            let params = Params::<f64> {
                nodes_x,
                nodes_y,
                nodes_z,
                node_count,
                cells_x,
                cells_y,
                cells_z: 2,
                ..Params::default()
            };
            let coarse = params.coarse_cells().map(|c| c + 1).iter().product();
            let mut vectors = |count: usize| -> Vec<V4<f64>> {
                (0..count).map(|_| [(); 3].map(|()| random.signed())).map(|[x, y, z]| [x, y, z, 0.0]).collect()
            };
            let dofs = |count| vec![[1.0; 4]; count];
            let fine = node_count as usize;
            let (r, w, z) = (vectors(fine), vectors(fine), vectors(coarse));
            let (mut restricted, mut prolonged) = (vec![[0.0; 4]; coarse], vec![[0.0; 4]; fine]);
            restriction(&params, &dofs(coarse), &[], &r, &w, &mut restricted);
            prolongation(&params, &dofs(fine), &[], &z, &mut prolonged);
            let dot = |a: &[V4<f64>], b: &[V4<f64>]| {
                a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| a * b).sum::<f64>()
            };
            let residual: Vec<V4<f64>> = r.iter().zip(&w).map(|(r, w)| std::array::from_fn(|n| r[n] - w[n])).collect();
            let [a, b] = [dot(&restricted, &z), dot(&residual, &prolonged)];
            assert!((a - b).abs() < 1e-12 * dot(&residual, &residual), "{cells_x} × {cells_y} cells: {a}, {b}");
        }
    }
}
