//! Contribution of split cells (`split`) to `w = A z`, and the rows of duplicate nodes; `product` leaves both out.
//!
//! `w_i += P_i s Σ_c (R_c K R_cᵀ z)_i` over the split cells at node `i`; for a duplicate with its inertia `m_i (1 + h r_M)/h² z_i`,
//! starting from zero. A cut affects few cells, so they are processed individually: the shader gathers at each touched node, the twin
//! processes as many cells at once as a register holds and scatters, with the same mirror blocks as `product`.
//! Units: z m, w N, K N/m.

use super::linearised::{HYPERELASTIC, rows};
use super::product::{LANES, Modes, cell_forces};
use super::{Params, Source};
use crate::math::wide::{Lanes, Task};
use crate::math::{Real, V3, V4};

/// The shader.
pub const SOURCE: Source =
    Source { name: "split_product", wgsl: include_str!("split_product.wgsl"), params: Params::<f32>::FIELDS };

/// One right-hand side; returns the increment of `z·w`.
pub fn split_product<R: Real>(
    params: &Params<R>,
    modes: &[Modes<R>], // [layer] N/m
    layer_of: &[u32],   // [cells_z] layer
    rotation: &[V4<R>], // [cell] quaternion
    dofs: &[V4<R>],     // [node] 1 free, 0 fixed, per axis; mass kg
    split: &[u32],      // see `split`
    cells: &[u32],      // split cells, by their rows in the table
    z: &[V4<R>],        // [node] m
    w: &mut [V4<R>],    // [node] N
) -> R {
    let mut dot = R::zero();
    for node in params.touched(split).iter().map(|n| *n as usize).filter(|n| *n >= params.grid_nodes()) {
        let own = V3::from4(z[node]);
        let out = (own * (params.inertia * dofs[node][3])).times(V3::from4(dofs[node]));
        w[node] = out.pad(R::zero());
        dot += own.dot(out);
    }
    let corners = split.get(params.layout().corners..).unwrap_or_default();
    dot + R::widest(Cells { params, modes, layer_of, rotation, dofs, corners, cells, z, w })
}

struct Cells<'a, R> {
    params: &'a Params<R>,
    modes: &'a [Modes<R>],
    layer_of: &'a [u32],
    rotation: &'a [V4<R>],
    dofs: &'a [V4<R>],
    corners: &'a [u32],
    cells: &'a [u32],
    z: &'a [V4<R>],
    w: &'a mut [V4<R>],
}

/// Corners in VTK's order from bits x + 2y + 4z.
const BY_BITS: [usize; 8] = [0, 1, 3, 2, 4, 5, 7, 6];

impl<R: Real> Task<R> for Cells<'_, R> {
    type Output = R;

    #[inline(always)]
    fn run<L: Lanes<R>>(self, lanes: L) -> R {
        let Cells { params, modes, layer_of, rotation, dofs, corners, cells, z, w } = self;
        let level_cells = (params.cells_x * params.cells_y) as usize;
        let layer = |cell: u32| layer_of[cell as usize / level_cells] as usize;
        let mut sum = R::zero();
        let mut first = 0;
        while first < cells.len() {
            // cells of one layer, up to a full register
            let own = layer(cells[first]);
            let count = cells[first..].iter().take(L::COUNT).take_while(|cell| layer(**cell) == own).count();
            // gather rotations and corner values, one cell per lane
            let mut at = [[[R::zero(); LANES]; 3]; 8];
            let mut q = [[R::zero(); LANES]; 4];
            let mut y = [[[R::zero(); LANES]; 4]; 3];
            let hyperelastic = params.corotational >= HYPERELASTIC;
            for lane in 0..count {
                for n in 0..4 {
                    q[n][lane] = rotation[cells[first + lane] as usize][n];
                }
                if hyperelastic {
                    let own = rows(params, rotation, cells[first + lane] as usize);
                    for (row, own) in y.iter_mut().zip(own) {
                        row.iter_mut().zip(own).for_each(|(to, value)| to[lane] = *value);
                    }
                }
                for c in 0..8 {
                    let node = corners[(first + lane) * 8 + BY_BITS[c]] as usize;
                    for n in 0..3 {
                        at[c][n][lane] = z[node][n];
                    }
                }
            }
            // forces of the cells
            let zero = lanes.splat(R::zero());
            let (mut rotations, mut at_corner, mut linearised) = ([zero; 4], [[zero; 3]; 8], [[zero; 4]; 3]);
            // loops, since `map` of arrays of registers is a call that copies them
            for n in 0..4 {
                rotations[n] = lanes.load(&q[n]);
            }
            for c in 0..8 {
                for n in 0..3 {
                    at_corner[c][n] = lanes.load(&at[c][n]);
                }
            }
            if hyperelastic {
                for n in 0..3 {
                    for i in 0..4 {
                        linearised[n][i] = lanes.load(&y[n][i]);
                    }
                }
            }
            let linearised = if hyperelastic { Some(linearised) } else { None };
            let force = cell_forces(lanes, &modes[own], rotations, at_corner, [zero; 3], [zero; 3], linearised);
            for c in 0..8 {
                for n in 0..3 {
                    lanes.store(force[c][n], &mut at[c][n]);
                }
            }
            // scatter to the nodes, in the order of the cells
            for lane in 0..count {
                for c in 0..8 {
                    let node = corners[(first + lane) * 8 + BY_BITS[c]] as usize;
                    for n in 0..3 {
                        let out = at[c][n][lane] * params.stiffness_factor * dofs[node][n];
                        w[node][n] += out;
                        sum += z[node][n] * out;
                    }
                }
            }
            first += count;
        }
        sum
    }
}
