//! Sides of the skin that samples of tools are on, from step to step: of the axes of round tools, of the points of tools of lines and of blunt
//! tools. (A blade cuts its own way in; its samples, blunt blades and the corners of boxes have the nearest surface.)
//!
//! What is inside has come in through the surface: the way from where a sample was last outside, carried by the skin since, enters the
//! surface. The nearest surface alone cannot tell: in skin that is pressed flat the far side is the nearest, and near a fold of cells that are
//! crushed at an edge points outside are classified as inside. Nor can that way alone, where a fold springs back: to enter, the nearest
//! surface or the way in the world must agree. A sample inside is pushed out along the normal of the nearest surface that looks to where it
//! came in. A sample without a past has the nearest surface alone.
//!
//! Tools dragged over held edges of a block of 8 × 8 × 4 mm, 100 or 30 kPa, along random ways, and how many the skin threw, by more than 1.7
//! times the force of the hand's spring and 1.5 N (by 10 to 60 N mostly):
//!
//! | tool | of | nearest surface alone | by the way in |
//! | --- | --- | --- | --- |
//! | sphere | 80 | 21 | 0 |
//! | capsule | 40 | 7 | 4 |
//! | points | 60 | 19 | 0 |
//! | points and lines | 60 | 21 | 3 |
//! | sphere that carves, anywhere | 40 | 8 | 1 |
//!
//! The capsules hook into a corner that is held on two sides, between walls that cannot give way; warnings say so. The others are thrown by 1 to
//! 2 N. Tried: leaving, too, only where two of the three agree, and only surfaces that the sample is behind; then 9 to 16 of the 60 tools of
//! lines are thrown, since the surface that they are pushed out of is chosen from step to step.
//! Source: own; sides carried in time instead of continuous collision detection (Provot 1997).
//! Units: m.

use super::{Patch, meets};
use crate::mesh::MaterialPoint;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Cosine below which a surface is turned away from where a sample came in.
const FACING: f64 = 0.1;
/// Distance from the surface within which a sample is on it, m: it counts as having been this far outside. Above the rounding of positions.
const ON: f64 = 1e-6;
/// Difference of two ways' shares below which they meet the surface at one point: on an edge or a node.
const SAME: f64 = 1e-9;

/// Side of the skin that a sample of a tool was on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Side {
    /// It was inside.
    inside: bool,
    /// Where it was, m.
    at: DVec3,
    /// Point of the surface nearest to it; of a sample inside, of the surface that it is pushed out of.
    on_skin: MaterialPoint,
    /// From there to the sample, m; of a sample inside or on the surface, just out of it.
    away: DVec3,
}

/// Sides of deformable bodies that samples were on, by tool, body and sample; `None` outside and out of reach.
pub type Sides = BTreeMap<(usize, usize, usize), Option<Side>>;

/// Sides of the samples of one tool, by their numbers.
pub type OfSamples = Vec<(usize, Option<Side>)>;

/// Projection on the surface: triangle, weights, signed distance (negative inside), outward unit normal.
pub type Projection = (usize, [f64; 3], f64, DVec3);

impl Side {
    /// Of a sample by its projection.
    pub fn of(patch: &Patch, at: DVec3, (triangle, weights, distance, normal): Projection) -> Self {
        let away = match () {
            () if distance.abs() < ON => patch.face_normal(triangle) * ON,
            () if distance < 0.0 => normal * ON,
            () => at - patch.position(triangle, weights),
        };
        Self { inside: distance < 0.0, at, on_skin: patch.material_point(triangle, weights), away }
    }

    /// The position outside that it has on the skin as it is now; none where the patch does not reach.
    fn outside(&self, patch: &Patch, position: &dyn Fn(u32) -> DVec3) -> Option<DVec3> {
        if !self.on_skin.nodes().all(|node| patch.ids.binary_search(&node).is_ok()) {
            return None;
        }
        // weights in f32 do not add up to 1
        let at: DVec3 = self.on_skin.0.iter().map(|(node, weight)| position(*node) * *weight).sum();
        Some(at / self.on_skin.0.iter().map(|(_, weight)| weight).sum::<f64>() + self.away)
    }
}

/// Sides of one tool's samples at one body in the last step, and the present positions of the body's nodes.
pub struct Last<'a> {
    sides: &'a Sides,
    pair: (usize, usize),
    position: &'a dyn Fn(u32) -> DVec3,
}

impl<'a> Last<'a> {
    /// Of a tool and a body.
    pub fn new(sides: &'a Sides, pair: (usize, usize), position: &'a dyn Fn(u32) -> DVec3) -> Self {
        Self { sides, pair, position }
    }

    /// Of samples without a past.
    pub fn none() -> Self {
        static NONE: Sides = Sides::new();
        Self { sides: &NONE, pair: (0, 0), position: &|_| DVec3::ZERO }
    }

    /// Projection of a sample by the side that it was on.
    pub fn project(&self, patch: &Patch, sample: usize, point: DVec3) -> Projection {
        let nearest = patch.project(point);
        let distance = nearest.2;
        let last = match self.sides.get(&(self.pair.0, self.pair.1, sample)) {
            Some(Some(last)) if distance.abs() >= ON => last,
            Some(None) => return patch.project_outside(point),
            _ => return nearest,
        };
        // relative to the skin it has entered; to enter it, in the world too, or the nearest surface says so
        let enters = |from: DVec3| patch.entered(from, point) > 0;
        let inside = match last.outside(patch, self.position) {
            Some(outside) => enters(outside) && (last.inside || distance < 0.0 || enters(last.at)),
            None => distance < 0.0 && (last.inside || enters(last.at)),
        };
        match inside {
            true => patch.project_inside(point, nearest, last.away.normalize_or_zero()),
            false => patch.project_outside(point),
        }
    }

    /// Sides of the tool's samples where there is no skin around it: those inside are still there, the others are out of reach.
    pub fn away(&self) -> OfSamples {
        let from = (self.pair.0, self.pair.1, 0);
        let own = self.sides.range(from..=(self.pair.0, self.pair.1, usize::MAX));
        own.map(|((.., sample), side)| (*sample, side.clone().filter(|side| side.inside))).collect()
    }
}

impl Patch {
    /// As [`Patch::project`], of a point that is outside.
    pub fn project_outside(&self, point: DVec3) -> Projection {
        let (triangle, weights, distance, normal) = self.project(point);
        match distance < 0.0 {
            true => (triangle, weights, -distance, -normal),
            false => (triangle, weights, distance, normal),
        }
    }

    /// Projection of a point inside on the nearest surface that looks to `side`, or its `nearest` one.
    fn project_inside(&self, point: DVec3, nearest: Projection, side: DVec3) -> Projection {
        if nearest.2 < 0.0 && nearest.3.dot(side) > FACING {
            return nearest;
        }
        let facing = |triangle: usize| {
            let normal = self.face_normal(triangle);
            let weights = self.nearest_on(triangle, point);
            let away = point - self.position(triangle, weights);
            (normal.dot(side) > FACING).then_some((triangle, weights, away, normal))
        };
        // of triangles that meet in the nearest point, the one that looks there most
        let farther = |a: &(usize, [f64; 3], DVec3, DVec3), b: &(usize, [f64; 3], DVec3, DVec3)| {
            let [(first, up), (second, other)] =
                [a, b].map(|(.., away, normal)| (away.length(), away.dot(*normal).abs()));
            first.total_cmp(&second).then(other.total_cmp(&up))
        };
        let found = (0..self.corners.len()).filter_map(facing).min_by(farther);
        found.map_or(nearest, |(triangle, weights, away, normal)| {
            let out = (-away).try_normalize().filter(|out| out.dot(normal) > 0.0).unwrap_or(normal);
            (triangle, weights, -away.length(), out)
        })
    }

    /// How often a way enters the surface, less how often it leaves.
    pub fn entered(&self, from: DVec3, to: DVec3) -> i32 {
        let way = to - from;
        let meets = |triangle: u32| {
            let (_, at) = meets(&self.corners[triangle as usize], from, way)?;
            let enters = self.face_normal(triangle as usize).dot(way) < 0.0;
            (0.0..=1.0).contains(&at).then_some((at, if enters { 1 } else { -1 }))
        };
        let mut met: Vec<(f64, i32)> = self.near(from.min(to), from.max(to)).into_iter().filter_map(meets).collect();
        // triangles that meet where the way goes through count once
        met.sort_by(|a, b| a.1.cmp(&b.1).then(a.0.total_cmp(&b.0)));
        met.dedup_by(|a, b| a.1 == b.1 && a.0 - b.0 < SAME);
        met.iter().map(|(_, enters)| enters).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Face;

    /// Side of a face, m.
    const CELL: f64 = 1e-3;

    /// Top and bottom of a plate of 4 × 4 faces, `thickness` m thick, that rises along x by a third; its nodes.
    fn plate(thickness: f64) -> (Patch, Vec<DVec3>) {
        let at = |k: u32| (f64::from(k) - 2.0) * CELL;
        let node = |n: u32, z: f64| DVec3::new(at(n % 5), at(n / 5), at(n % 5) / 3.0 + z);
        let nodes: Vec<DVec3> = (0..25).map(|n| node(n, 0.0)).chain((0..25).map(|n| node(n, -thickness))).collect();
        let corner = |k: u32| k % 4 + 5 * (k / 4);
        let top = (0..16).map(|k| Face { nodes: [0, 1, 6, 5].map(|n| corner(k) + n), cell: 0, wall: false });
        let bottom = (0..16).map(|k| Face { nodes: [0, 5, 6, 1].map(|n| 25 + corner(k) + n), cell: 0, wall: false });
        let faces: Vec<Face> = top.chain(bottom).collect();
        (Patch::new(&faces, |id| nodes[id as usize]).expect("there are faces"), nodes)
    }

    /// Projections of a sample that takes these heights above the top of a plate in turn, over a point that is on an edge of no triangle.
    fn followed(thickness: f64, heights: &[f64]) -> Vec<Projection> {
        let (patch, nodes) = plate(thickness);
        let position = |id: u32| nodes[id as usize];
        let up = DVec3::new(-1.0, 0.0, 3.0).normalize();
        let mut sides = Sides::new();
        let step = |height: &f64| {
            let point = DVec3::new(0.3e-3, 0.1e-3, 0.1e-3) + up * *height;
            let found = Last::new(&sides, (0, 0), &position).project(&patch, 0, point);
            sides.insert((0, 0, 0), Some(Side::of(&patch, point, found)));
            found
        };
        heights.iter().map(step).collect()
    }

    #[test]
    fn a_sample_that_rests_on_the_surface_is_held_when_it_goes_in() {
        let up = DVec3::new(-1.0, 0.0, 3.0).normalize();
        for rest in [1e-9, 3e-10, 0.0, -3e-10, -1e-9, 4e-7, -4e-7] {
            let found = followed(3e-3, &[1e-4, rest, rest, -1e-5, -1e-4, -2e-5]);
            for (_, _, distance, normal) in &found[3..] {
                assert!(*distance < 0.0 && normal.dot(up) > 0.99, "{rest}: {found:?}");
            }
        }
        // and free when it comes out
        let out = followed(3e-3, &[1e-4, -1e-4, 1e-4])[2];
        assert!(out.2 > 0.0 && out.3.dot(up) > 0.99, "{out:?}");
    }

    #[test]
    fn a_sample_deep_in_a_thin_plate_is_pushed_back_to_its_side() {
        let up = DVec3::new(-1.0, 0.0, 3.0).normalize();
        let found = followed(2e-4, &[1e-4, -1.2e-4, -1.5e-4, -1.8e-4]);
        for (_, _, distance, normal) in &found[1..] {
            assert!(*distance < 0.0 && normal.dot(up) > 0.99, "{found:?}");
        }
        // the counter-test: by the nearest surface it is pushed on
        let (patch, _) = plate(2e-4);
        assert!(patch.project(DVec3::new(0.3e-3, 0.1e-3, 0.1e-3) - up * 1.5e-4).3.dot(up) < 0.0);
    }
}
