//! Springs from nodes to their rest positions: which nodes, how stiff, and what they add to the system matrix and to the energy.
//!
//! `A` gains `k (1 + r_K/h)` on the diagonal of an anchored node, the same along each axis, as a mass of `k (1 + r_K/h) / ((1 + h r_M)/h²)`
//! would (with another integrator, what [`Step`] has in place of these two): so the kernels of `A` are given that mass on top of the node's own, and weight and inertia on the right-hand side the own mass
//! alone.
//! Units: N/m, kg, m.

use super::{Model, Step};
use crate::math::{V3, V4};
use crate::scene::Anchor;
use std::collections::BTreeMap;

/// Anchored nodes of a body.
#[derive(Clone, Debug, Default)]
pub struct Anchors {
    /// Rising, each once.
    pub nodes: Vec<u32>,
    /// `[anchor]` N/m; where regions overlap their sum.
    pub stiffness: Vec<f64>,
}

/// `s²`: mass in `A` of a stiffness of 1 N/m.
pub fn rate(step: &Step) -> f64 {
    step.stiffness_factor() / step.inertia()
}

impl Anchors {
    /// From a scene's regions; `nodes_in` says which nodes one has.
    pub fn new(list: &[Anchor], nodes_in: impl Fn(&Anchor) -> Vec<u32>) -> Self {
        let mut sum: BTreeMap<u32, f64> = BTreeMap::new();
        for anchor in list {
            for node in nodes_in(anchor) {
                *sum.entry(node).or_default() += anchor.stiffness;
            }
        }
        let (nodes, stiffness) = sum.into_iter().unzip();
        Self { nodes, stiffness }
    }

    /// Free axes and mass of a node as `A` has them; a node that has left the system (no mass) stays out.
    pub fn in_system(&self, rate: f64, node: u32, free: V4<f64>) -> V4<f64> {
        let [x, y, z, mass] = free;
        match self.nodes.binary_search(&node) {
            Ok(k) if mass > 0.0 => [x, y, z, mass + rate * self.stiffness[k]],
            _ => free,
        }
    }

    /// `[node]` the same of all nodes.
    pub fn all_in_system(&self, rate: f64, free: &[V4<f64>]) -> Vec<V4<f64>> {
        let mut out = free.to_vec();
        for node in &self.nodes {
            out[*node as usize] = self.in_system(rate, *node, free[*node as usize]);
        }
        out
    }

    /// `½ Σ k |u|²` over the anchors whose nodes `stay` in the system, J.
    pub fn energy(&self, u: &[V4<f64>], stay: impl Fn(usize) -> bool) -> f64 {
        let one = |(node, k): (&u32, &f64)| {
            let d = V3::from4(u[*node as usize]);
            if stay(*node as usize) { 0.5 * k * d.dot(d) } else { 0.0 }
        };
        self.nodes.iter().zip(&self.stiffness).map(one).sum()
    }
}

impl Model {
    /// `[node]` free axes and masses as `A` has them.
    pub fn in_system(&self) -> Vec<V4<f64>> {
        self.anchors.all_in_system(rate(&self.step), &self.free)
    }
}
