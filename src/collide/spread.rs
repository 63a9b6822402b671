//! Contacts of points that have an extent: the skin is pressed over a disc about the nearest place, as a ball presses it.
//!
//! A force at a point of an elastic solid has no finite answer: the finer the cells, the further the point sinks, and on cells of one size
//! three times as far at a node as in the middle of a face. Under Hertz's pressure `∝ √(1 − r²/a²)` on a disc of radius `a` a half space sinks
//! by `(2a² − r²) 3F/(8 a³ E*)`, `E* = E/(1 − ν²)` (Johnson, Contact Mechanics, 1985, eq. 3.41), in the mean over the pressure by
//! `3F/(5 a E*)`. The tip stands at this mean level. Places on rings that bear the same each stand for the disc; a place's own nodes spread its
//! share further, so the rings are drawn in by what a single place has of its own.

use super::Patch;
use crate::math::elementary::{cbrt, cos, sin};
use crate::mesh::MaterialPoint;
use glam::DVec3;
use std::collections::BTreeMap;

/// Places per side of a face: their own nodes join them to one disc.
const DENSITY: f64 = 2.0;
/// Rings at most.
const RINGS: f64 = 16.0;
/// Radius of the disc that one place stands for, in the side of a square face.
const OWN: f64 = 0.45;
/// Faces that are turned from the contact's normal by more than 60° are round a corner, or another lip of a wound.
const FACING: f64 = 0.5;

/// The skin under a disc.
pub(super) struct Disc {
    /// Its nodes.
    pub spot: MaterialPoint,
    /// Its mean place, m.
    pub place: DVec3,
    /// Its mean outward normal.
    pub normal: DVec3,
}

/// Places on a disc of radius 1 that bear the same each under Hertz's pressure, on rings that bear the same each.
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
    /// A disc on the surface about a place of a triangle; none where faces are too large for it to tell from a place.
    pub(super) fn disc(&self, triangle: usize, weights: [f64; 3], radius: f64) -> Option<Disc> {
        let own = OWN * self.side(triangle);
        let rings = radius * radius - own * own;
        if radius == 0.0 || rings <= 0.0 {
            return None;
        }
        let (rings, centre, normal) = (rings.sqrt(), self.place(triangle, weights), self.face_normal(triangle));
        let (along, across) = normal.any_orthonormal_pair();
        let mut sum: BTreeMap<u32, f64> = BTreeMap::new();
        let (mut places, mut normals, mut count) = (DVec3::ZERO, DVec3::ZERO, 0.0);
        for (s, t) in disc((DENSITY * rings / self.side(triangle)).clamp(2.0, RINGS).ceil() as u32) {
            let (other, its, ..) = self.project(centre + (along * s + across * t) * rings);
            let faces = self.face_normal(other).dot(normal) > FACING;
            let (triangle, weights) = if faces { (other, its) } else { (triangle, weights) };
            places += self.place(triangle, weights);
            normals += self.face_normal(triangle);
            count += 1.0;
            self.spot(triangle, weights).0.iter().for_each(|(node, weight)| *sum.entry(*node).or_default() += weight);
        }
        let spot = MaterialPoint(sum.into_iter().map(|(node, weight)| (node, weight / count)).collect());
        Some(Disc { spot, place: places / count, normal: normals.normalize_or(normal) })
    }

    /// Side of a square face of which the triangle is a half, or a quarter, m.
    fn side(&self, triangle: usize) -> f64 {
        let [a, b, c] = self.corners[triangle];
        let triangles = if self.quarters.is_empty() { 2.0 } else { 4.0 };
        (0.5 * triangles * (b - a).cross(c - a).length()).sqrt()
    }
}
