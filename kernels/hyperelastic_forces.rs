//! Energy and internal forces of each hyperelastic cell; formula and source in [`super::hyperelastic`].
//!
//! An inverted cell has the energy [`INVERTED_ENERGY`] and the forces of the extended law, a removed cell has none.
//! The unit quaternions take the length of [`Cell::linearised`], and the rows after them its stiffness of the volume, unless
//! `params.corotational` is less than [`HYPERELASTIC`] (trial points).
//! Units: displacement m, material Pa, energy J, force N.

use super::hyperelastic::{Cell, FibreRows};
use super::linearised::HYPERELASTIC;
use super::{Params, Source};
use crate::math::{Real, V4};

/// The shader.
pub const SOURCE: Source = Source {
    name: "hyperelastic_forces",
    wgsl: include_str!("hyperelastic_forces.wgsl"),
    params: Params::<f32>::FIELDS,
};

/// Energy that marks an inverted cell, J.
pub const INVERTED_ENERGY: f32 = 1e38;

/// Forces and energies of all cells.
pub fn hyperelastic_forces<R: Real>(
    params: &Params<R>,
    shape: &[V4<R>],         // [layer] cell edges m, mass of one corner kg
    material: &[V4<R>],      // [layer] κ, two constants Pa, the law's code
    fibres: &[FibreRows<R>], // [layer] directions; k₂, κ
    pre_strain: &[V4<R>],    // [layer] elastic strain at rest along x, y, z
    layer_of: &[u32],        // [cells_z] layer
    split: &[u32],           // see `split`
    rotation: &mut [V4<R>],  // [cell] quaternion, 0 of a dead cell; [cell × 3] `y`
    displacement: &[V4<R>],  // [node] displacement, m
    corner_force: &mut [R],  // [cell][corner][axis] N
    energy: &mut [R],        // [cell] J
) {
    let count = params.cell_count as usize;
    let (rotation, rows) = rotation.split_at_mut(count);
    let mut rows = rows.as_chunks_mut::<3>().0.iter_mut();
    let cells = corner_force.as_chunks_mut::<24>().0.iter_mut().zip(energy).zip(rotation);
    for (cell, ((force, energy), q)) in cells.enumerate().take(count) {
        let rows = rows.next();
        (*energy, *force) = (R::zero(), [R::zero(); 24]);
        if *q == [R::zero(); 4] {
            continue;
        }
        let found = Cell::of(params, shape, material, fibres, pre_strain, layer_of, displacement, split, cell);
        *energy = if found.inverted { R::of(f64::from(INVERTED_ENERGY)) } else { found.energy() };
        let forces = found.forces();
        for (out, f) in force.chunks_exact_mut(3).zip(&forces) {
            out.copy_from_slice(&[f.x, f.y, f.z]);
        }
        if let Some(rows) = rows.filter(|_| params.corotational >= HYPERELASTIC) {
            let linearised = found.linearised(params, *q, &forces);
            let length = linearised.stiffening.sqrt().sqrt();
            *q = q.map(|c| c * length);
            *rows = linearised.rows.packed();
        }
    }
}
