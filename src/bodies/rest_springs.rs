//! Rest-shape springs (an elastic foundation): nodes, stiffness, and their terms in the system matrix and in the energy.
//!
//! A spring adds `k (1 + r_K/h)` to the diagonal of `A`, the same along each axis, and so does a mass of `k (1 + r_K/h) / ((1 + h r_M)/h²)`
//! (for implicit Euler; [`Step`] has both factors for the others). The kernels that use `A` therefore get this equivalent mass on top of
//! the nodal mass; weight and inertia on the right-hand side use the nodal mass alone.
//! Units: N/m, kg, m.

use super::{Model, Step};
use crate::math::{V3, V4};
use crate::mesh::Grid;
use crate::scene::{Attachment, BodyId, Integrator, Mass, RestSpring, Scene};
use std::collections::BTreeMap;

/// Rest-shape springs of a body.
#[derive(Clone, Debug, Default)]
pub struct RestSprings {
    /// Node ids in ascending order, without duplicates.
    pub nodes: Vec<u32>,
    /// `[spring]` N/m; summed where regions overlap.
    pub stiffness: Vec<f64>,
}

/// Equivalent mass per unit of stiffness in `A`, s².
pub fn rate(step: &Step) -> f64 {
    step.stiffness_factor() / step.inertia()
}

/// Stiffness of the rest-shape spring at each node that `[[attach]]` ties to the world or a wall, where ties alone hold the body, N/m; 0 for
/// other ties, in explicit steps, and with a consistent mass matrix, which has no diagonal to add it to.
///
/// Where the tie holds they exert nothing, so they change no result: they are the augmented Lagrangian's (Hestenes, Powell 1969). Without
/// them the compliance of a body that ties alone hold is that of one that floats, and what its nodes move relative to each other is lost in
/// it: 78 nodes of a side of layered skin used up their passes from the fourth step on, and the skin was thrown. With 1, 10, 100 and 1000 N/m
/// a node: thrown, 2.6, 2.1 and 1.95 passes. They are as stiff as a cell of the stiffest layer.
fn of_tie(scene: &Scene, tie: &Attachment, grid: &Grid) -> f64 {
    let skin = &scene.skins[tie.body];
    let held = scene.boundaries.iter().any(|of| of.body == tie.body)
        || scene.rest_springs.iter().any(|of| of.body == tie.body);
    let still = !held && matches!(tie.to, BodyId::World | BodyId::Plane(_)) && tie.slide.is_none();
    let explicit = scene.time.integrator == Integrator::SymplecticEuler; // its critical step would be shorter
    if !still || explicit || skin.mass == Mass::Consistent {
        return 0.0;
    }
    skin.layers.iter().map(|layer| layer.young).fold(0.0, f64::max) * grid.cell_width()
}

impl Model {
    /// Stiffness of the rest-shape spring at each node of a tie of this body, N/m; 0 without.
    pub fn stiffness_of_tie(&self, scene: &Scene, tie: &Attachment) -> f64 {
        of_tie(scene, tie, &self.grid)
    }
}

/// Rest-shape springs of a body: the scene's, and those of ties.
pub fn of_body(scene: &Scene, body: usize, grid: &Grid) -> Vec<RestSpring> {
    let own = scene.rest_springs.iter().filter(|spring| spring.body == body).cloned();
    let ties = scene.attachments.iter().filter(|tie| tie.body == body);
    let ties = ties.map(|tie| RestSpring { body, region: tie.region.clone(), stiffness: of_tie(scene, tie, grid) });
    own.chain(ties.filter(|spring| spring.stiffness > 0.0)).collect()
}

impl RestSprings {
    /// From the scene's regions; `nodes_in` lists the nodes of one.
    pub fn new(list: &[RestSpring], nodes_in: impl Fn(&RestSpring) -> Vec<u32>) -> Self {
        let mut sum: BTreeMap<u32, f64> = BTreeMap::new();
        for springs in list {
            for node in nodes_in(springs) {
                *sum.entry(node).or_default() += springs.stiffness;
            }
        }
        let (nodes, stiffness) = sum.into_iter().unzip();
        Self { nodes, stiffness }
    }

    /// DOF mask and mass of a node as in `A`; a node that has left the system (mass 0) is returned unchanged.
    pub fn in_system(&self, rate: f64, node: u32, dofs: V4<f64>) -> V4<f64> {
        let [x, y, z, mass] = dofs;
        match self.nodes.binary_search(&node) {
            Ok(k) if mass > 0.0 => [x, y, z, mass + rate * self.stiffness[k]],
            _ => dofs,
        }
    }

    /// `[node]` DOF masks and masses of all nodes as in `A`.
    pub fn all_in_system(&self, rate: f64, dofs: &[V4<f64>]) -> Vec<V4<f64>> {
        let mut out = dofs.to_vec();
        for node in &self.nodes {
            out[*node as usize] = self.in_system(rate, *node, dofs[*node as usize]);
        }
        out
    }

    /// `½ Σ k |u|²` over the springs whose nodes `stay` in the system, J.
    pub fn energy(&self, u: &[V4<f64>], stay: impl Fn(usize) -> bool) -> f64 {
        let one = |(node, k): (&u32, &f64)| {
            let d = V3::from4(u[*node as usize]);
            if stay(*node as usize) { 0.5 * k * d.dot(d) } else { 0.0 }
        };
        self.nodes.iter().zip(&self.stiffness).map(one).sum()
    }
}

impl Model {
    /// `[node]` DOF masks and masses as in `A`.
    pub fn in_system(&self) -> Vec<V4<f64>> {
        self.rest_springs.all_in_system(rate(&self.step), &self.dofs)
    }
}
