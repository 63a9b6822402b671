//! Diagnostics of a body's state, in f64 on the CPU: energy, inverted cells, and the true residual of a step solved by any backend.
//!
//! `E = ½ vᵀMv + E_elastic(u) − Σ m g·u − Σ f·u` over nodes, with the dead loads `f` that act now: 0 for a body at rest in its rest shape
//! without pre-strain. With constant loads and boundary conditions and no contact, implicit Euler dissipates `E`. A load that begins,
//! changes or ends changes it by `−Δf·u`, which [`crate::step`] books as work, with that of contacts. The elastic force `R K d` omits the
//! derivative of the rotations with respect to `u`, so it is the gradient of `E_elastic` where the strain of a cell is uniform, and
//! otherwise for small strains only (Müller, Gross 2004).

use super::{Holds, Model, Wound, rate};
use crate::kernels::rotations::mean_gradient;
use crate::kernels::{ahead, momentum, rest_springs, rhs};
use crate::math::{M3, V3, V4, norm};
use crate::scene::{Integrator, Mass};
use serde::{Deserialize, Serialize};

/// State of a body as its backend holds it, for checks and output, in f64.
#[derive(Clone, Debug, Default)]
pub struct Snapshot {
    /// `[node]` displacement, m.
    pub u: Vec<V4<f64>>,
    /// `[node]` velocity, m/s.
    pub v: Vec<V4<f64>>,
    /// `[cell]` rotation quaternion, 0 for a removed cell; empty for springs.
    pub rotation: Vec<V4<f64>>,
    /// `[node]` DOF mask and mass.
    pub dofs: Vec<V4<f64>>,
    /// Table of split nodes ([`crate::kernels::split`]), of tetrahedra the list of their corners; empty where none can be split.
    pub split: Vec<u32>,
    /// `[spring]` law; empty for hexahedra.
    pub law: Vec<V4<f64>>,
    /// `[cell]` share of its volume that tools have left; empty where they have carved no space.
    pub shares: Vec<f64>,
}

impl Snapshot {
    /// Number of nodes with a non-finite displacement.
    pub fn non_finite(&self) -> usize {
        self.u.iter().filter(|u| u.iter().any(|c| !c.is_finite())).count()
    }
}

/// Equations that a step is measured by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Equations {
    /// Those of the law's linearisation at the start of the step.
    #[default]
    Linearised,
    /// Those of the law itself, with damping by its linearisation: of steps that are solved in full ([`crate::scene::Scene::in_full`]).
    InFull,
    /// Those of the law itself, with damping that is not stiffened.
    Law,
}

/// Step solved by a backend.
#[derive(Clone, Debug, Default)]
pub struct Solved {
    /// State at the start of the step.
    pub start: Snapshot,
    /// `[node]` dead loads, N.
    pub load: Vec<V4<f64>>,
    /// `[node]` contact forces of the step, N.
    pub contact: Vec<V4<f64>>,
    /// `[node]` displacement increment found, m.
    pub dx: Vec<V4<f64>>,
    /// The equations that it has to solve.
    pub equations: Equations,
    /// `τ` of [`super::Step::elastic_at`], where the step has needed another one.
    pub elastic_at: Option<f64>,
}

/// Elastic energy of a state with that of the rest-shape springs, `½ Σ k |u|²`, J; `rotation` as stored by the kernels (0 for removed
/// cells), at the state's displacements or its own.
pub fn elastic_energy(model: &Model, state: &Snapshot, rotation: &[V4<f64>]) -> f64 {
    let mechanics = model.mechanics();
    let of_rest_springs =
        model.rest_springs.energy(&state.u, mechanics.stays(model, rotation, &state.split, &state.law));
    of_rest_springs + mechanics.energy(model, state, rotation)
}

/// Energy of bodies, J.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Energy {
    /// ½ vᵀMv; of rigid bodies with the rotation.
    pub kinetic: f64,
    /// Of cells or springs, and of rest-shape springs.
    pub elastic: f64,
    /// Of gravity and dead loads: 0 at rest positions, of rigid bodies at the origin.
    pub potential: f64,
    /// Sum of the magnitudes of the potential's terms: what rounding is relative to.
    pub weight: f64,
}

impl Energy {
    /// Kinetic, elastic and potential energy, J.
    pub fn total(&self) -> f64 {
        self.kinetic + self.elastic + self.potential
    }

    /// Sum.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self {
            kinetic: self.kinetic + other.kinetic,
            elastic: self.elastic + other.elastic,
            potential: self.potential + other.potential,
            weight: self.weight + other.weight,
        }
    }
}

/// Energy of a state under dead loads, `[node]` N.
pub fn energy(model: &Model, state: &Snapshot, load: &[V4<f64>]) -> Energy {
    let rotation = model.mechanics().rotations(model, state);
    let g = V3::of(model.step.gravity);
    let momenta = mean_velocities(model, state);
    let elastic = elastic_energy(model, state, &rotation);
    let mut sum = Energy { elastic, ..Energy::default() };
    for node in 0..state.u.len() {
        let [u, v, mean, load] = [state.u[node], state.v[node], momenta[node], load[node]].map(V3::from4);
        let mass = state.dofs[node][3];
        let potential = -mass * g.dot(u) - load.dot(u);
        sum.kinetic += 0.5 * mass * v.dot(mean);
        sum.potential += potential;
        sum.weight += potential.abs();
    }
    sum
}

impl Model {
    /// Whether Rayleigh damping or springs dissipate in its steps.
    pub fn damps(&self) -> bool {
        let own = self.mechanics().damps() || self.step.rayleigh_mass > 0.0 || self.step.rayleigh_stiffness > 0.0;
        own && self.step.integrator != Integrator::Static
    }
}

/// Energy that Rayleigh damping (and that of springs) dissipates over an implicit step at its mean velocity, J: `Δxᵀ C Δx/h` with the
/// damping matrix of the step's start.
pub fn damped(model: &Model, wound: &Wound, solved: &Solved) -> f64 {
    let h = model.step.step;
    let nodes: Vec<u32> = (0..solved.dx.len() as u32).collect();
    let mean: Vec<V4<f64>> = solved.dx.iter().map(|d| d.map(|c| c / h)).collect();
    let momenta = mean_velocities(model, &Snapshot { v: mean.clone(), ..solved.start.clone() });
    let of = |factor: f64| {
        let moved = |node: usize| [V3::from4(solved.start.u[node]), V3::from4(mean[node]) * factor];
        model.mechanics().forces_at(model, wound, &nodes, &moved)
    };
    let mut sum = 0.0;
    for (node, (moving, still)) in of(1.0).into_iter().zip(of(0.0)).enumerate() {
        let [dx, mean] = [solved.dx[node], momenta[node]].map(V3::from4);
        let spring =
            model.rest_springs.nodes.binary_search(&(node as u32)).map_or(0.0, |k| model.rest_springs.stiffness[k]);
        let drag = mean * (model.step.rayleigh_mass * solved.start.dofs[node][3]);
        sum += dx.dot(V3::of(moving) - V3::of(still) + drag) + model.step.rayleigh_stiffness * spring / h * dx.dot(dx);
    }
    sum
}

/// `[node]` velocities which, multiplied by the nodal masses, give the momentum, m/s.
fn mean_velocities(model: &Model, state: &Snapshot) -> Vec<V4<f64>> {
    let mut mean = state.v.clone();
    if model.mass == Mass::Consistent {
        let Snapshot { split, rotation, dofs, v, .. } = state;
        let layers = &model.grid.layer_of;
        momentum::momentum(&model.params(), &model.shapes(), layers, split, rotation, dofs, v, &mut mean);
    }
    mean
}

/// Number of cells strained beyond their law ([`super::Mechanics::beyond_law`]).
pub fn beyond_law(model: &Model, state: &Snapshot) -> u32 {
    model.mechanics().count_cells(model, state, &|layer, f| model.mechanics().beyond_law(layer, f))
}

/// Number of cells whose mean deformation gradient has no positive determinant (non-finite ones count). Removed cells are skipped; the grid
/// cells of springs are included.
pub fn inverted_cells(model: &Model, state: &Snapshot) -> u32 {
    let upright = |f: M3<f64>| f.determinant() > 0.0; // false for NaN
    model.mechanics().count_cells(model, state, &|_, f| !upright(f))
}

/// [`super::Mechanics::count_cells`] of the grid's cells.
pub(super) fn count_cells(model: &Model, state: &Snapshot, holds: &Holds) -> u32 {
    let (params, shapes) = (model.params::<f64>(), model.shapes::<f64>());
    let alive = |cell: &usize| state.rotation.get(*cell) != Some(&[0.0; 4]);
    let gradient = |cell| mean_gradient(&params, &shapes, &model.grid.layer_of, &state.split, &state.u, cell);
    (0..params.cell_count as usize).filter(alive).filter(|cell| holds(model.grid.layer(*cell), gradient(*cell))).count()
        as u32
}

/// Norms of the forces out of balance at the start of a static step, `b + Jᵀλ`, and of the largest of its parts, N: elastic forces at all
/// nodes, reactions included; rest-shape springs and dead loads.
pub fn out_of_balance(model: &Model, solved: &Solved) -> (f64, f64) {
    let still = Solved { dx: vec![[0.0; 4]; solved.start.u.len()], ..solved.clone() };
    let (rest, _, f) = equations(model, &still);
    let mut spring_forces = vec![[0.0; 4]; f.len()];
    let Snapshot { u, dofs, .. } = &still.start;
    rest_springs::rest_springs(&model.rest_springs.nodes, &model.rest_springs.stiffness, dofs, u, &mut spring_forces);
    let largest = [&f, &spring_forces, &still.load].map(|part| norm(part)).into_iter().fold(0.0, f64::max);
    (norm(&rest), largest)
}

/// `|b + Jᵀλ − A Δx|` relative to the load of the step (unconstrained motion and contact forces), all in f64.
pub fn true_residual(model: &Model, solved: &Solved) -> f64 {
    let (residual, load) = residual(model, solved);
    if load == 0.0 { 0.0 } else { norm(&residual) / load }
}

/// Residual of the nonlinear equations after a linearised step: the change of the elastic forces over the step, less that of the linearisation,
/// relative to the load of the step, in f64; of a step that is solved in full what it leaves of these. 0 for linear laws and where steps are solved
/// by Newton's method.
pub fn law_residual(model: &Model, solved: Solved) -> f64 {
    if !model.mechanics().linearised(model) {
        return 0.0;
    }
    let equations = match solved.equations {
        Equations::Linearised => Equations::Law,
        of_step => of_step,
    };
    true_residual(model, &Solved { equations, ..solved })
}

/// `b + Jᵀλ − A Δx`, `[node]` N, and the norm of the load of the step, N, all in f64.
pub fn residual(model: &Model, solved: &Solved) -> (Vec<V4<f64>>, f64) {
    let (residual, load, _) = equations(model, solved);
    (residual, load)
}

/// The same, and the elastic forces, `[node]` N.
fn equations(model: &Model, solved: &Solved) -> (Vec<V4<f64>>, f64, Vec<V4<f64>>) {
    let params = model.params::<f64>();
    let Snapshot { u, v, dofs, .. } = &solved.start;
    let count = u.len();
    let in_system = model.rest_springs.all_in_system(rate(&model.step), dofs);
    let mut at = u.clone(); // displacements at which elastic forces are evaluated
    ahead::ahead(&params, u, v, &mut at);
    let [f, w] = model.mechanics().forces_and_product(model, solved, &at, &in_system);
    let mean_v = mean_velocities(model, &solved.start);
    let mut b = vec![[0.0; 4]; count];
    let mut load = rhs::rhs(&params, &f, &mean_v, dofs, &solved.load, &mut b);
    rest_springs::rest_springs(&model.rest_springs.nodes, &model.rest_springs.stiffness, dofs, &at, &mut b);
    load += driven(model, solved, &at, &in_system);
    for i in 0..count {
        for n in 0..3 {
            let contact = solved.contact[i][n] * dofs[i][n];
            load += contact * contact;
            b[i][n] += contact - w[i][n];
        }
    }
    (b, load.sqrt(), f)
}

/// `|A Δx_c|²` on free axes with the increments of nodes on prescribed paths alone, N²: the load that these drive.
fn driven(model: &Model, solved: &Solved, at: &[V4<f64>], in_system: &[V4<f64>]) -> f64 {
    if model.paths.nodes.is_empty() {
        return 0.0;
    }
    let fixed = |(dx, dofs): (&V4<f64>, &V4<f64>)| std::array::from_fn(|n| if dofs[n] == 0.0 { dx[n] } else { 0.0 });
    let dx = solved.dx.iter().zip(&solved.start.dofs).map(fixed).collect();
    let [_, drive] = model.mechanics().forces_and_product(model, &Solved { dx, ..solved.clone() }, at, in_system);
    norm(&drive).powi(2)
}
