//! Forces, strain, stress and volume of single cells on the host, in f64: what probes read.
//!
//! Forces are those of [`crate::kernels::forces`] or of the hyperelastic law at the cell's present rotation, and `r_K R K Rᵀ v`, the damping
//! that the step has with the rotations of its start.
//!
//! Stress: with `ε = sym(Rᵀ F) − I + e` (`e` the pre-strain, `R` the rotation of the cell's mean gradient) the Cauchy stress of the small
//! strains, rotated: `R (λ tr ε I + 2 μ ε) Rᵀ`; `tr ε` of [`Element::Bbar`] is the cell's mean, as in its matrix. Of a hyperelastic law
//! `P' Fᵀ/J + p I`, with `P'` at the point and the cell's mean pressure `p` ([`crate::kernels::hyperelastic`]). Strain `(FᵀF − I)/2` is that of the
//! displacements. [`Element::Enhanced`] takes both at the cell's centre, where its inner modes have no strain.
//!
//! Where a small-strain law ends: strain at which its force differs from that of the neo-Hookean law by 5 %, one cell (tests/verify/elements.rs
//! measures this), as the Frobenius norm of the Green–Lagrange strain of a corotational cell or of the displacement gradient of a linear one:
//!
//! | ν | stretched, corotational | compressed | sheared | stretched, linear | compressed | sheared |
//! | --- | --- | --- | --- | --- | --- | --- |
//! | 0.3 | 0.075 | 0.068 | 0.30 | 0.073 | 0.070 | – |
//! | 0.45 | 0.066 | 0.062 | 0.14 | 0.065 | 0.063 | – |
//! | 0.49 | 0.064 | 0.060 | 0.064 | 0.063 | 0.061 | – |
//!
//! Stretched and compressed along one axis with free sides: force on the cell; simple shear: the shear force, which linear cells have in
//! common with the neo-Hookean law. The strain is that of the cell's mean gradient from the stress-free shape. Cells beyond 0.06 are
//! counted (`strain_beyond_law`). In confined compression 5 % is reached at 0.035 for ν 0.49.
//! Units: u m, edges m, strain 1, stress Pa, f N.

use super::{Hexahedra, element};
use crate::bodies::{Model, Moved, Wound};
use crate::kernels::deformation::{Point, field_gradients};
use crate::kernels::forces::rest_corner;
use crate::kernels::{PARALLEL, polar};
use crate::math::{M3, V3, V4, rotation_matrix, rotation_minus_identity};
use crate::scene::Element;
use rayon::prelude::*;

/// The quaternion of no rotation.
const UNTURNED: V4<f64> = [0.0, 0.0, 0.0, 1.0];

/// Least volume ratio in `P' Fᵀ/J`, since a cell that is flat has no Cauchy stress.
const FLAT: f64 = 1e-6;

/// Strain up to which the small-strain laws are within 5 % of the neo-Hookean one; see the module.
const SMALL: f64 = 0.06;

/// The centre of a cell.
const CENTRE: [f64; 3] = [0.5; 3];

/// Whether a small-strain law is strained beyond `SMALL` at a displacement gradient (NaN counts).
pub fn beyond(change: M3<f64>, corotational: bool) -> bool {
    let [a, b, c] = if corotational { element::green_lagrange(change).0 } else { change.0 };
    let norm = (a.dot(a) + b.dot(b) + c.dot(c)).sqrt();
    norm > SMALL || norm.is_nan()
}

impl Hexahedra {
    /// Rotation of a cell at its corners' displacements.
    fn rotation(&self, edges: [f64; 3], u: &[V3<f64>; 8]) -> V4<f64> {
        match self.corotational {
            0 => UNTURNED,
            _ => polar::polar(M3::identity() + element::displacement_gradient(edges, u, CENTRE), UNTURNED),
        }
    }

    /// Internal forces at the corners of a cell, with the damping of velocities `v`, N; `small` has the small-strain matrix of its layer,
    /// for a hyperelastic body without the stiffness of the mean volume.
    fn forces_of(
        &self,
        model: &Model,
        small: &element::Matrix,
        cell: usize,
        u: &[V3<f64>; 8],
        v: &[V3<f64>; 8],
    ) -> [V3<f64>; 8] {
        let layer = model.grid.layer(cell);
        let edges = model.grid.cell_edges(layer as u32);
        let q = self.rotation(edges, u);
        let (back, turn) = (rotation_matrix(q).transpose(), rotation_minus_identity(q).transpose());
        let state = self.hyperelastic.as_ref().map(|law| law.of_layer(layer, u));
        let rate = model.step.rayleigh_stiffness;
        // displacements that the matrix acts on, in the cell's frame; common ones first taken off, for which it has no force
        let (h, e) = (V3::of(edges), V3::from4(self.pre_strain[layer]));
        let mut d = [0.0; 24];
        for a in 0..8 {
            let x = rest_corner(h, a);
            let elastic = match state {
                Some(_) => V3::zero(),
                None => back * (u[a] - u[0]) + turn * x + e.times(x),
            };
            let local = elastic + back * (v[a] - v[0]) * rate;
            d[3 * a..3 * a + 3].copy_from_slice(&local.f64());
        }
        let row = |r: usize| small[r].iter().zip(&d).map(|(k, d)| k * d).sum::<f64>();
        let local = |a: usize| V3::new(row(3 * a), row(3 * a + 1), row(3 * a + 2));
        let ahead = rotation_matrix(q);
        let Some(state) = state else {
            return std::array::from_fn(|a| ahead * local(a));
        };
        // the volume's stiffness has its present direction
        let own = state.forces();
        let volume = state.linearised(None, q, &own).rows;
        let slopes: [V3<f64>; 8] = std::array::from_fn(|a| volume.slope(a));
        let change: f64 = slopes.iter().zip(d.as_chunks::<3>().0).map(|(slope, d)| slope.dot(V3::of(*d))).sum();
        let factor = self.hyperelastic.as_ref().map_or(1.0, |law| law.scale(cell));
        std::array::from_fn(|a| (own[a] + ahead * (local(a) + slopes[a] * change)) * factor)
    }

    /// `[asked]` forces of the present cells around nodes in ascending order, N.
    pub(super) fn forces_of_cells(&self, model: &Model, wound: &Wound, nodes: &[u32], moved: &Moved) -> Vec<[f64; 3]> {
        let parts = &wound.surface.parts;
        let around = nodes.iter().flat_map(|node| parts.cells_of(*node as usize));
        let mut cells: Vec<usize> = around.filter(|cell| wound.surface.alive[*cell]).collect();
        cells.sort_unstable();
        cells.dedup();
        let small = match &self.hyperelastic {
            Some(law) => &law.without_volume(&self.stiffness, 0),
            None => &self.stiffness,
        };
        let of_cell = |cell: &usize| {
            let (corners, small) = (parts.corners(*cell), &small[model.grid.layer(*cell)]);
            let moved = corners.map(moved);
            let forces = self.forces_of(model, small, *cell, &moved.map(|m| m[0]), &moved.map(|m| m[1]));
            (corners, forces.map(|force| force * wound.surface.share(*cell)))
        };
        let forces: Vec<_> = cells.par_iter().with_min_len(PARALLEL / 32).map(of_cell).collect();
        let mut sums = vec![V3::zero(); nodes.len()];
        for (corners, forces) in forces {
            for (corner, force) in corners.into_iter().zip(forces) {
                if let Ok(k) = nodes.binary_search(&(corner as u32)) {
                    sums[k] += force;
                }
            }
        }
        sums.into_iter().map(V3::f64).collect()
    }

    /// Whether a small-strain law is strained beyond [`SMALL`] at a cell's mean deformation gradient (NaN counts): see the module.
    pub(super) fn beyond_small(&self, layer: usize, gradient: M3<f64>) -> bool {
        if self.hyperelastic.is_some() {
            return false;
        }
        let stretch = M3::diagonal(V3::from4(self.pre_strain[layer]) + V3::splat(1.0));
        beyond(gradient * stretch - M3::identity(), self.corotational != 0)
    }

    /// Green–Lagrange strain and Cauchy stress, Pa, at a point of a cell, natural coordinates in 0…1.
    pub(super) fn strain_and_stress_at(
        &self,
        model: &Model,
        cell: usize,
        u: &[V3<f64>; 8],
        natural: [f64; 3],
    ) -> [M3<f64>; 2] {
        let layer = model.grid.layer(cell);
        let edges = model.grid.cell_edges(layer as u32);
        let natural = if self.element == Element::Enhanced { CENTRE } else { natural };
        let gradient = element::displacement_gradient(edges, u, natural);
        let strain = element::green_lagrange(gradient);
        if let Some(law) = &self.hyperelastic {
            // from the stress-free cell: 1 + h = F (1 + e)
            let e = M3::diagonal(V3::from4(self.pre_strain[layer]));
            let (state, point) = (law.of_layer(layer, u), Point::new(gradient + e + gradient * e));
            let f = M3::identity() + point.h;
            let volume = (1.0 + point.dilatation).max(FLAT);
            let own = state.material.stress(&point) * f.transpose() * (1.0 / volume);
            // of the material: the share of the cell inside an embedded surface does not thin it
            let factor = law.scale(cell) / model.grid.share_factor(cell);
            return [strain, (own + M3::identity() * state.pressure()) * factor];
        }
        let q = self.rotation(edges, u);
        let (ahead, turn) = (rotation_matrix(q), rotation_minus_identity(q).transpose());
        // sym(Rᵀ F) − I = sym(Rᵀ h + (Rᵀ − I)), without the cancellation of the ones
        let pre_strain = M3::diagonal(V3::from4(self.pre_strain[layer]));
        let small = |gradient: M3<f64>| {
            let unturned = ahead.transpose() * gradient + turn;
            (unturned + unturned.transpose()) * 0.5 + pre_strain
        };
        let [lambda, mu] = self.moduli[layer];
        let mut local = small(gradient);
        let own = local.trace();
        if self.element == Element::Bbar {
            let mean = small(element::displacement_gradient(edges, u, CENTRE)).trace();
            local = local + M3::identity() * ((mean - own) / 3.0);
        }
        let stress = M3::identity() * (lambda * local.trace()) + local * (2.0 * mu);
        [strain, ahead * stress * ahead.transpose()]
    }
}

impl Wound {
    /// Volume of the present cells at rest, of those that a surface cuts or tools have carved their share, and its change at
    /// displacements `u`, `[node]` m, m³.
    pub fn volume(&self, model: &Model, u: &[V4<f64>]) -> [f64; 2] {
        if let Some(parts) = self.surface.tetrahedra() {
            return parts.volume(|e| self.surface.share(e), u);
        }
        let alive: Vec<usize> = (0..model.grid.cell_count()).filter(|cell| self.surface.alive[*cell]).collect();
        // det F is at most quadratic along each axis, so the Gauss points' mean is exact
        let of_cell = |cell: &usize| {
            let [x, y, z, _] = model.shape[model.grid.layer(*cell)];
            let inverse = V3::new(1.0 / x, 1.0 / y, 1.0 / z);
            let u = self.surface.parts.corners(*cell).map(|node| V3::from4(u[node]));
            let dilatation: f64 = field_gradients(inverse, &u).into_iter().map(|h| Point::new(h).dilatation).sum();
            let volume = x * y * z * model.grid.share(*cell) * self.surface.share(*cell);
            [volume, volume * dilatation / 8.0]
        };
        let each: Vec<[f64; 2]> = alive.par_iter().with_min_len(PARALLEL / 8).map(of_cell).collect();
        each.iter().fold([0.0; 2], |sum, own| [sum[0] + own[0], sum[1] + own[1]])
    }
}
