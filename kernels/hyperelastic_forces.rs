//! Energy and internal forces of each hyperelastic cell; formula and source in [`super::hyperelastic`].
//!
//! An inverted cell has the energy [`INVERTED_ENERGY`] and the forces of the extended law, a removed cell has none.
//! The unit quaternions take the length of [`Cell::linearised`], and the rows after them its stiffness of the volume, unless
//! `params.corotational` is less than [`HYPERELASTIC`] (trial points).
//! Units: displacement m, material Pa, energy J, force N.

use super::hyperelastic::{Cell, Cells, FibreRows, Material, STIFFENED};
use super::linearised::HYPERELASTIC;
use super::{Params, Source};
use crate::math::wide::{Lanes, MOST, Packed, Task};
use crate::math::{Number, Real, V3, V4};
use std::ops::Range;

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
    scale: &[R],             // [cell] factor on the layer's stiffness, or one for all
    split: &[u32],           // see `split`
    rotation: &mut [V4<R>],  // [cell] quaternion, 0 of a dead cell; [cell × 3] `y`
    displacement: &[V4<R>],  // [node] displacement, m
    corner_force: &mut [R],  // [cell][corner][axis] N
    energy: &mut [R],        // [cell] J
) {
    let count = params.cell_count as usize;
    let (quaternions, rows) = rotation.split_at_mut(count);
    let linearised = params.corotational >= HYPERELASTIC && !rows.is_empty();
    corner_force[..24 * count].fill(R::zero());
    energy[..count].fill(R::zero());
    let unit = quaternions.to_vec();
    let alive = |cell: usize| (unit[cell] != [R::zero(); 4]).then_some(unit[cell]);
    let cells = Cells { params, shape, material, fibres, pre_strain, layer_of, scale, split, displacement };
    cells.respond(0..count, Wanted { energy: true, linearised }, &alive, &mut |cell, found| {
        energy[cell] = if found.inverted { R::of(f64::from(INVERTED_ENERGY)) } else { found.energy };
        corner_force[24 * cell..24 * (cell + 1)].copy_from_slice(found.force.as_flattened());
        if linearised {
            quaternions[cell] = unit[cell].map(|c| c * found.length);
            rows[3 * cell..3 * (cell + 1)].copy_from_slice(&found.rows);
        }
    });
}

/// What is wanted of cells beside their forces.
#[derive(Clone, Copy, Debug, Default)]
pub struct Wanted {
    /// The energy.
    pub energy: bool,
    /// The linearisation.
    pub linearised: bool,
}

/// Response of a cell to its displacements.
#[derive(Clone, Copy, Debug, Default)]
pub struct Response<R> {
    /// `[corner]` internal forces, N.
    pub force: [[R; 3]; 8],
    /// Energy, J, if wanted.
    pub energy: R,
    /// The volume is not positive at some Gauss point.
    pub inverted: bool,
    /// Length of the quaternion by the linearisation, if wanted.
    pub length: R,
    /// Rows of the linearisation, if wanted.
    pub rows: [V4<R>; 3],
}

impl<R: Real> Cells<'_, R> {
    /// Calls `take` with the response of each cell of a range that has a rotation, as many at once as a register holds.
    pub fn respond(
        &self,
        cells: Range<usize>,
        wanted: Wanted,
        rotation: &dyn Fn(usize) -> Option<V4<R>>,
        take: &mut dyn FnMut(usize, &Response<R>),
    ) {
        let mut start = cells.start;
        while start < cells.end {
            let layer = self.layer(start);
            let alike = (start..cells.end).take_while(|cell| self.layer(*cell) == layer).count();
            let present = (start..start + alike).filter_map(|cell| Some((cell, rotation(cell)?)));
            let present: Vec<(usize, V4<R>)> = present.collect();
            R::widest(Responses { cells: self, material: self.material(layer), present: &present, wanted, take });
            start += alike;
        }
    }
}

/// Responses of cells of one layer.
struct Responses<'a, R> {
    cells: &'a Cells<'a, R>,
    material: Material<R>,
    /// Cells, with their rotations.
    present: &'a [(usize, V4<R>)],
    wanted: Wanted,
    take: &'a mut dyn FnMut(usize, &Response<R>),
}

impl<R: Real> Task<R> for Responses<'_, R> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<R>>(self, lanes: L) {
        let Self { cells, wanted, .. } = self;
        let material = self.material.packed(lanes);
        let factor = Packed::splat(lanes, cells.params.stiffness_factor);
        let factor = (cells.params.corotational == STIFFENED).then_some(factor);
        for group in self.present.chunks(L::COUNT) {
            // displacements and rotations by component; lanes without a cell repeat the last one
            let (mut moved, mut turned) = ([[[R::zero(); MOST]; 3]; 8], [[R::zero(); MOST]; 4]);
            for i in 0..L::COUNT {
                let (cell, q) = group[i.min(group.len() - 1)];
                for (moved, u) in moved.iter_mut().zip(cells.corners(cell)) {
                    (moved[0][i], moved[1][i], moved[2][i]) = (u.x, u.y, u.z);
                }
                for (turned, c) in turned.iter_mut().zip(q) {
                    turned[i] = c;
                }
            }
            let mut corners = [material.edges; 8];
            for (corner, [x, y, z]) in corners.iter_mut().zip(&moved) {
                *corner = V3::new(Packed::load(lanes, x), Packed::load(lanes, y), Packed::load(lanes, z));
            }
            let state = Cell::new(material, &corners);
            let forces = state.forces();
            // results by component, into the arrays of the displacements
            for ([x, y, z], force) in moved.iter_mut().zip(&forces) {
                force.x.store(x);
                force.y.store(y);
                force.z.store(z);
            }
            let [mut energy, mut upright, mut length] = [[R::zero(); MOST]; 3];
            state.upright.store(&mut upright);
            if wanted.energy {
                state.energy().store(&mut energy);
            }
            let mut rows = [[[R::zero(); MOST]; 4]; 3];
            if wanted.linearised {
                let [x, y, z, w] = &turned;
                let q = [x, y, z, w].map(|c| Packed::load(lanes, c));
                let found = state.linearised(factor, q, &forces);
                found.stiffening.sqrt().sqrt().store(&mut length);
                for (row, own) in rows.iter_mut().zip(found.rows.packed()) {
                    for (row, own) in row.iter_mut().zip(own) {
                        own.store(row);
                    }
                }
            }
            for (i, (cell, _)) in group.iter().enumerate() {
                // the rows are those of any scale: the quaternion's length scales them with the rest
                let scale = cells.scale(*cell);
                let mut found = Response {
                    energy: energy[i] * scale,
                    inverted: upright[i] == R::zero(),
                    length: length[i] * scale.sqrt().sqrt(),
                    ..Response::default()
                };
                for (force, moved) in found.force.as_flattened_mut().iter_mut().zip(moved.as_flattened()) {
                    *force = moved[i] * scale;
                }
                for (row, own) in found.rows.as_flattened_mut().iter_mut().zip(rows.as_flattened()) {
                    *row = own[i];
                }
                (self.take)(*cell, &found);
            }
        }
    }
}
