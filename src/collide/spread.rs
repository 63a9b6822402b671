//! Contacts of points with an extent: the tip presses the skin over a disc about the nearest point, as a ball does.
//!
//! A point force on an elastic solid has no finite displacement: the finer the cells, the deeper the point sinks, and on cells of one size
//! three times as deep at a node as in the middle of a face. Under Hertz's pressure `∝ √(1 − r²/a²)` on a disc of radius `a` a half space
//! sinks by `(2a² − r²) 3F/(8 a³ E*)`, `E* = E/(1 − ν²)` (Johnson, Contact Mechanics, 1985, eq. 3.41); its mean weighted by the pressure is
//! `3F/(5 a E*)`. The tip stands at this mean level. Points on rings, each with the same force, sample the disc. Each point's nodes spread
//! its force further, so the rings are drawn in to allow for the disc of a single point.

use super::Patch;
use crate::math::elementary::{cbrt, cos, sin};
use crate::mesh::MaterialPoint;
use glam::DVec3;
use std::collections::BTreeMap;

/// Points per side of a face: their nodes join them to one disc.
const DENSITY: f64 = 2.0;
/// Most rings.
const RINGS: f64 = 16.0;
/// Radius of the disc that a single point stands for, in sides of a square face.
const OWN: f64 = 0.45;
/// Cosine of 60°: faces turned farther from the contact's normal are around a corner, or on another lip of a wound.
const FACING: f64 = 0.5;

/// The skin under a disc.
pub(super) struct Disc {
    /// Its material point.
    pub material_point: MaterialPoint,
    /// Its mean position, m.
    pub position: DVec3,
    /// Its mean outward normal.
    pub normal: DVec3,
}

/// Points on the unit disc that carry equal forces under Hertz's pressure, on rings of equal force.
fn disc(rings: u32) -> impl Iterator<Item = (f64, f64)> {
    let around = 4 * rings.max(2);
    (0..rings * around).map(move |k| {
        let share = (f64::from(k / around) + 0.5) / f64::from(rings);
        let radius = (1.0 - cbrt((1.0 - share) * (1.0 - share))).sqrt();
        let angle = std::f64::consts::TAU * f64::from(k % around) / f64::from(around);
        (radius * cos(angle), radius * sin(angle))
    })
}

impl Patch {
    /// Disc on the surface about a point of a triangle; none if faces are too large to tell it from a point.
    pub(super) fn disc(&self, triangle: usize, weights: [f64; 3], radius: f64) -> Option<Disc> {
        let own = OWN * self.side(triangle);
        let rings = radius * radius - own * own;
        if radius == 0.0 || rings <= 0.0 {
            return None;
        }
        let (rings, centre, normal) = (rings.sqrt(), self.position(triangle, weights), self.face_normal(triangle));
        let (along, across) = normal.any_orthonormal_pair();
        let mut sum: BTreeMap<u32, f64> = BTreeMap::new();
        let (mut positions, mut normals, mut count) = (DVec3::ZERO, DVec3::ZERO, 0.0);
        for (s, t) in disc((DENSITY * rings / self.side(triangle)).clamp(2.0, RINGS).ceil() as u32) {
            let (other, its, ..) = self.project(centre + (along * s + across * t) * rings);
            let faces = self.face_normal(other).dot(normal) > FACING;
            let (triangle, weights) = if faces { (other, its) } else { (triangle, weights) };
            positions += self.position(triangle, weights);
            normals += self.face_normal(triangle);
            count += 1.0;
            self.material_point(triangle, weights)
                .0
                .iter()
                .for_each(|(node, weight)| *sum.entry(*node).or_default() += weight);
        }
        let material_point = MaterialPoint(sum.into_iter().map(|(node, weight)| (node, weight / count)).collect());
        Some(Disc { material_point, position: positions / count, normal: normals.normalize_or(normal) })
    }

    /// Side of the square face of which the triangle is a half or a quarter, m.
    fn side(&self, triangle: usize) -> f64 {
        let [a, b, c] = self.corners[triangle];
        let triangles = if self.quarters.is_empty() { 2.0 } else { 4.0 };
        (0.5 * triangles * (b - a).cross(c - a).length()).sqrt()
    }
}
