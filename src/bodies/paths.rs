//! Prescribed paths: held nodes whose prescribed displacement depends on time.
//!
//! At the end of each step a node is where its path has it at that time: its increment over the step is given, and the others follow from
//! `A Δx = b` with it ([`crate::kernels::prescribe`]). Where regions overlap, the last boundary of the scene holds an axis.

use super::Model;
use super::rigid::along;
use crate::scene::{Boundary, Scene};
use glam::DVec3;

/// Held nodes of a body that follow paths.
#[derive(Clone, Debug, Default)]
pub struct Paths {
    /// Node ids in ascending order.
    pub nodes: Vec<u32>,
    /// `[entry]` boundary of the scene whose path each axis follows, if any.
    boundaries: Vec<[Option<usize>; 3]>,
}

impl Paths {
    /// Takes a node with the boundaries that hold its axes; `None` where the axis is free.
    pub(super) fn take(&mut self, scene: &Scene, node: usize, holding: [Option<usize>; 3]) {
        let moving = holding.map(|held| held.filter(|k| !scene.boundaries[*k].path.is_empty()));
        if moving.iter().any(Option::is_some) {
            self.nodes.push(node as u32);
            self.boundaries.push(moving);
        }
    }

    /// `[entry]` displacements by the paths at a time, m.
    fn displacements(&self, scene: &Scene, time: f64) -> Vec<[f64; 3]> {
        let of =
            |boundary: &Boundary| along(&boundary.path, time).map_or([0.0; 3], |(position, _)| position.to_array());
        let paths: Vec<[f64; 3]> = scene.boundaries.iter().map(of).collect();
        let entry = |axes: &[Option<usize>; 3]| [0, 1, 2].map(|n| axes[n].map_or(0.0, |boundary| paths[boundary][n]));
        self.boundaries.iter().map(entry).collect()
    }
}

impl Model {
    /// `[entry of its paths]` prescribed displacements along fixed axes at a time, m.
    pub fn prescribed_at(&self, scene: &Scene, time: f64) -> Vec<[f64; 3]> {
        let moved = self.paths.displacements(scene, time);
        let sum = |(node, moved): (&u32, &[f64; 3])| {
            let fixed = self.prescribed[*node as usize];
            [0, 1, 2].map(|n| fixed[n] + moved[n])
        };
        self.paths.nodes.iter().zip(&moved).map(sum).collect()
    }

    /// `[entry of its paths]` inertia per mass that a step ending at a given time gives the nodes, `(v' − v)/h + r_M v'`, m/s²; nothing before the
    /// start of the scene moves, and static steps have none.
    pub fn driven_accelerations(&self, scene: &Scene, end: f64) -> Vec<[f64; 3]> {
        let (h, drag) = (self.step.step, self.step.rayleigh_mass);
        let moving = if self.step.momentum_factor() == 0.0 { 0.0 } else { 1.0 };
        let [before, from, to] = [2.0, 1.0, 0.0].map(|k| self.paths.displacements(scene, (end - k * h).max(0.0)));
        let one = |entry: usize| {
            [0, 1, 2].map(|n| {
                let velocity = |a: &[[f64; 3]], b: &[[f64; 3]]| (b[entry][n] - a[entry][n]) / h;
                let (old, new) = (velocity(&before, &from), velocity(&from, &to));
                moving * ((new - old) / h + drag * new)
            })
        };
        (0..self.paths.nodes.len()).map(one).collect()
    }

    /// Largest distance that its paths move a node between two times, m.
    pub fn driven(&self, scene: &Scene, from: f64, to: f64) -> f64 {
        let distance = |boundary: &Boundary| {
            let [a, b] = [from, to].map(|time| along(&boundary.path, time).map_or(DVec3::ZERO, |pose| pose.0));
            a.distance(b)
        };
        scene.boundaries.iter().filter(|b| b.body == self.body).map(distance).fold(0.0, f64::max)
    }
}
