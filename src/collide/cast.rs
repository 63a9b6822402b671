//! Ray cast to the first wall, in f64; parry3d's tree finds the candidate triangles.

use super::Patch;
use glam::DVec3;

/// Cosine of 60°: a flat rests on walls turned to it by less; at grazing incidence the distance along the ray means nothing.
const FACING: f64 = 0.5;

impl Patch {
    /// First triangle along a ray within `reach`, if it faces the ray: triangle, weights, distance. `None` if the ray leaves the tissue
    /// first (it started inside) or meets the surface at grazing incidence.
    pub fn cast(&self, from: DVec3, direction: DVec3, reach: f64) -> Option<(usize, [f64; 3], f64)> {
        let to = from + direction * reach;
        let hit = |triangle: u32| {
            let (weights, distance) = meets(&self.corners[triangle as usize], from, direction)?;
            (0.0..=reach).contains(&distance).then_some((triangle as usize, weights, distance))
        };
        let hits = self.near(from.min(to), from.max(to)).into_iter().filter_map(hit);
        let first = hits.min_by(|a, b| a.2.total_cmp(&b.2))?;
        let facing = self.face_normal(first.0).dot(direction) < -FACING;
        facing.then_some(first)
    }
}

/// Share of a triangle's edge by which a line may miss it and still hit: two triangles leave no gap where they meet.
const SEAM: f64 = 1e-9;

/// Intersection of a line with a triangle: weights and signed distance along the line; `None` edge on. Source: Möller, Trumbore 1997.
fn meets([a, b, c]: &[DVec3; 3], from: DVec3, direction: DVec3) -> Option<([f64; 3], f64)> {
    let (ab, ac, offset) = (*b - *a, *c - *a, from - *a);
    let (across, around) = (direction.cross(ac), offset.cross(ab));
    let volume = ab.dot(across);
    let (v, w, distance) = (offset.dot(across) / volume, direction.dot(around) / volume, ac.dot(around) / volume);
    let inside = v >= -SEAM && w >= -SEAM && v + w <= 1.0 + SEAM; // false for NaN
    inside.then_some(([1.0 - v - w, v, w], distance))
}
