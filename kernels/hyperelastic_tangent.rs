//! Products of the hyperelastic cells' tangents with a field: forces of each cell on its corners, assembled by `collect_product`.
//!
//! The derivative of [`super::hyperelastic`], in the same symbols; it is symmetric and may be indefinite. No matrix is stored: with
//! `H = Σ_b z_b ⊗ G_b` and `dP'` of the law
//!
//! `(K z)_a = Σ w [dP'(H) − p J F⁻ᵀ Hᵀ F⁻ᵀ + p J tr(F⁻¹ H) F⁻ᵀ] G_a + κ (1 − ln J̄)/(V J̄²) (Σ w J tr(F⁻¹ H)) c_a`,
//!
//! about 3000 operations per cell on 48 numbers, where a stored tangent takes at least 1200 bytes. (The CPU path stores tangents: it has
//! less arithmetic for its memory bandwidth.) An inverted cell contributes nothing.
//! Source: Bonet, Wood 2008, sections 6.4 and 8.6 (tangent with mean dilatation).
//! Units: displacement m, z m, force N, material Pa.

use super::deformation::{corner_sums, field_gradients, log_volume_stiffness};
use super::hyperelastic::{Cell, Cells, FibreRows, at_corners};
use super::{Params, Source};
use crate::math::{Number, Real, V3, V4};

/// The shader.
pub const SOURCE: Source = Source {
    name: "hyperelastic_tangent",
    wgsl: include_str!("hyperelastic_tangent.wgsl"),
    params: Params::<f32>::FIELDS,
};

impl<N: Number> Cell<N> {
    /// `κ (φ'² + φ φ'')(J̄)/V`, Pa/m³: derivative of the pressure with respect to the cell's volume.
    pub fn pressure_slope(&self) -> N {
        self.material.bulk * log_volume_stiffness(self.mean_dilatation) / (self.weight.like(8.0) * self.weight)
    }

    /// `K z`, N.
    pub fn product(&self, z: &[V3<N>; 8]) -> [V3<N>; 8] {
        let pressure = self.pressure();
        let mut volume = pressure.like(0.0);
        let mut stress = [self.points[0].h; 8];
        for ((p, change), stress) in self.points.iter().zip(field_gradients(self.inverse, z)).zip(&mut stress) {
            let log_gradient = p.log_gradient;
            let jacobian = volume.like(1.0) + p.dilatation;
            let relative_change = log_gradient.dot(change);
            let kirchhoff_pressure = pressure * jacobian;
            volume += self.weight * jacobian * relative_change;
            let crossed = log_gradient * change.transpose() * log_gradient;
            let volumetric = crossed * -kirchhoff_pressure + log_gradient * (kirchhoff_pressure * relative_change);
            *stress = (self.material.tangent(p, change) + volumetric) * self.weight;
        }
        let mut out = corner_sums(self.inverse, &stress);
        let pressure_change = self.pressure_slope() * volume;
        for (force, c) in out.iter_mut().zip(self.volume_gradient()) {
            *force += c * pressure_change;
        }
        out
    }
}

/// One right-hand side.
pub fn hyperelastic_tangent<R: Real>(
    params: &Params<R>,
    shape: &[V4<R>],         // [layer] cell edges m, mass of one corner kg
    material: &[V4<R>],      // [layer] κ, two constants Pa, the law's code
    fibres: &[FibreRows<R>], // [layer] directions; k₂, κ
    pre_strain: &[V4<R>],    // [layer] elastic strain at rest along x, y, z
    layer_of: &[u32],        // [cells_z] layer
    scale: &[R],             // [cell] factor on the layer's stiffness, or one for all
    displacement: &[V4<R>],  // [node] displacement, m
    z: &[V4<R>],             // [node] m
    corner_force: &mut [R],  // [cell][corner][axis] N
) {
    let cells = Cells { params, shape, material, fibres, pre_strain, layer_of, scale, split: &[], displacement };
    for (cell, force) in corner_force.chunks_exact_mut(24).enumerate() {
        let state = cells.state(cell);
        let own = if state.inverted() { [V3::zero(); 8] } else { state.product(&at_corners(params, z, cell)) };
        for (out, f) in force.chunks_exact_mut(3).zip(own) {
            out.copy_from_slice(&[f.x, f.y, f.z]);
        }
    }
}
