//! Strains and stresses of tetrahedra, for probes, pictures and files.

use super::operator::{Arrays, is_removed};
use crate::bodies::grid::element::green_lagrange;
use crate::kernels::tetrahedra::{matrix, mean};
use crate::math::elementary::cbrt;
use crate::math::{M3, V4, rotation_matrix};

/// Least volume ratio in `P Fᵀ/J`, since a tetrahedron that is flat has no Cauchy stress.
const FLAT: f64 = 1e-6;

impl Arrays<f64> {
    /// `[tetrahedron]` Green–Lagrange strain and Cauchy stress, Pa, at displacements; 0 of removed ones. The stress is the one that the
    /// element's forces come from: of smoothed elements the means over its edges (deviator) and corners (pressure), turned back by its own
    /// rotation as far as theirs differ. The strain is of the same means.
    pub fn strains_and_stresses(&self, u: &[V4<f64>], corotational: bool) -> Vec<[M3<f64>; 2]> {
        let rotations = self.rotations(u, corotational);
        let mut scratch = self.scratch();
        let forces = self.corner_forces(1, u, &rotations, &mut scratch);
        let own = self.displacement_gradients(u);
        let means = self.mean_gradients(&own);
        let of = |e: usize| {
            if is_removed(&self.corners[e]) {
                return [M3::zero(); 2];
            }
            let strain = green_lagrange(means.as_ref().map_or(own[e], |means| means[e]));
            // the forces at corners 1 to 3 are V P ∇N_a
            let stress = matrix(forces, e) * matrix(&self.gradients, e).inverse();
            let turned = if self.is_hyperelastic() {
                let f = own[e] + M3::identity();
                stress * f.transpose() * f.determinant().max(FLAT).recip()
            } else {
                stress * rotation_matrix(rotations.element[e]).transpose()
            };
            [strain, (turned + turned.transpose()) * (0.5 / self.volume(e))]
        };
        (0..own.len()).map(of).collect()
    }

    /// `[tetrahedron]` mean over the edges of a smoothed element of the displacement gradients around them, with the mean over its corners of
    /// the volume ratios around these; none of plain ones.
    fn mean_gradients(&self, own: &[M3<f64>]) -> Option<Vec<M3<f64>>> {
        if !self.smoothed {
            return None;
        }
        let volume = |gradient: &M3<f64>| (*gradient + M3::identity()).determinant();
        let columns: Vec<V4<f64>> = own.iter().flat_map(|g| g.0.map(|column| column.pad(volume(g) - 1.0))).collect();
        let among = |first: &[u32], members: &[u32], k: usize, per_volume: f64| {
            mean(&self.gradients, &members[first[k] as usize..first[k + 1] as usize], &columns, per_volume)
        };
        let (first, members) = (&self.first_of_domain, &self.of_domain);
        let of_domain = |(k, [volume, _]): (usize, &[f64; 2])| among(first, members, k, 1.0 / volume).0;
        let of_domains: Vec<M3<f64>> = self.shear.iter().enumerate().map(of_domain).collect();
        let (corners, first, members, per_volume) = self.patches();
        let of_patch = |(i, per_volume): (usize, &f64)| among(first, members, i, *per_volume).1;
        let of_patches: Vec<f64> = per_volume.iter().enumerate().map(of_patch).collect();
        let of = |(e, own): (usize, &M3<f64>)| {
            if is_removed(&self.corners[e]) {
                return *own;
            }
            let domains = &self.domains[6 * e..6 * e + 6];
            let f = domains.iter().fold(M3::identity(), |sum, k| sum + of_domains[*k as usize] * (1.0 / 6.0));
            let wanted = 1.0 + corners[e].iter().map(|i| 0.25 * of_patches[*i as usize]).sum::<f64>();
            let ratio = wanted / f.determinant();
            // inverted ones have no mean
            let scaled = if ratio > 0.0 { f * cbrt(ratio) } else { f };
            scaled + M3::identity() * -1.0
        };
        Some(own.iter().enumerate().map(of).collect())
    }
}
