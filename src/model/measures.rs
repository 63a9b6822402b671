//! What a body's state amounts to, in f64 on the CPU: its energy, and how many of its cells are inside out.
//!
//! `E = ½ vᵀMv + E_elastic(u) − Σ m g·u − Σ f·u` over nodes, `f` the dead loads that act now: 0 for a body at rest in its rest shape
//! without pre-strain. While loads and boundaries stay as they are and nothing touches, `E` is what implicit Euler takes from. A load that
//! begins or ends changes it by `f·u`; what contacts, ties and moved boundaries hold is not in it.
//! The elastic force is `R K d` and leaves out how the rotations change with `u`, so that it is the gradient of `E_elastic` for small
//! strains alone (Müller, Gross 2004): strained by much, a body may gain or lose a share of `E` in the order of its strain.

use super::{Model, Solved, elastic_energy};
use crate::kernels::momentum;
use crate::kernels::rotations::{mean_gradient, rotations};
use crate::math::{V3, V4};
use crate::scene::Mass;

/// Total energy of a state, J; `dx` and `contact` are not looked at.
pub fn energy(model: &Model, state: &Solved) -> f64 {
    let mut rotation = state.rotation.clone();
    if model.corotational {
        let layers = &model.grid.layer_of;
        rotations(&model.params(), &model.shapes(), layers, &state.split, &state.u, &mut rotation);
    }
    let g = V3::of(model.step.gravity);
    let momenta = mean_velocities(model, state);
    let of_node = |node: usize| {
        let [u, v, mean, load] = [state.u[node], state.v[node], momenta[node], state.load[node]].map(V3::from4);
        let mass = state.free[node][3];
        0.5 * mass * v.dot(mean) - mass * g.dot(u) - load.dot(u)
    };
    let of_nodes: f64 = (0..state.u.len()).map(of_node).sum();
    of_nodes + elastic_energy(model, &state.u, &rotation, &state.split, &state.law)
}

/// `[node]` velocities that masses of nodes multiply to the momentum, m/s.
fn mean_velocities(model: &Model, state: &Solved) -> Vec<V4<f64>> {
    let mut mean = state.v.clone();
    if model.mass == Mass::Consistent {
        let Solved { rotation, split, free, v, .. } = state;
        let layers = &model.grid.layer_of;
        momentum::momentum(&model.params(), &model.shapes(), layers, split, rotation, free, v, &mut mean);
    }
    mean
}

/// Cells whose mean deformation gradient has a determinant of 0 or less, or none; dead ones are not counted, cells of springs are.
pub fn inverted_cells(model: &Model, state: &Solved) -> u32 {
    let (params, shapes) = (model.params::<f64>(), model.shapes::<f64>());
    let alive = |cell: &usize| state.rotation.get(*cell) != Some(&[0.0; 4]);
    let upright = |cell: usize| {
        let f = mean_gradient(&params, &shapes, &model.grid.layer_of, &state.split, &state.u, cell);
        f.determinant() > 0.0 // not so when it is no number
    };
    let cells = (0..params.cell_count as usize).filter(alive);
    cells.filter(|cell| !upright(*cell)).count() as u32
}
