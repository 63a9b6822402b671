//! Sides of the skin that samples of tools are on, from step to step: of the axes of round tools, of the points of tools of lines and of blunt
//! tools. (A blade cuts its own way in.)
//!
//! What is inside has come in through the surface: the way from where a sample was last outside, carried by the skin since, enters the
//! surface once more than it leaves it. The nearest point of the surface alone cannot tell: in skin that is pressed flat the far side is the
//! nearest, and over a fold of cells that are crushed at an edge all of the air is inside. Nor can that way alone, where a fold springs back:
//! the nearest point or the way in the world must agree. A sample inside is pushed out along the normal of the nearest surface that looks to
//! where it came in. The first step of a run has the nearest surface alone; what was away from the skin is outside.
//!
//! Tools dragged over held edges of a block of 8 × 8 × 4 mm, 100 or 30 kPa, along random ways, and how many the skin threw, by more than 1.7
//! times the force of the hand's spring and 1.5 N (by 10 to 60 N mostly):
//!
//! | tool | of | nearest surface alone | now |
//! | --- | --- | --- | --- |
//! | sphere | 80 | 21 | 0 |
//! | capsule | 40 | 7 | 3 |
//! | points | 60 | 19 | 0 |
//! | points and lines | 60 | 21 | 2 |
//! | sphere that carves, anywhere | 40 | 8 | 1 |
//!
//! The three capsules hook into a corner that is held on two sides, between walls that cannot give way; warnings say so.
//! Units: m.

use super::{Patch, meets};
use crate::mesh::MaterialPoint;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Cosine below which a surface is turned away from where a sample came in.
const FACING: f64 = 0.1;
/// How far out of the surface a sample inside counts as having come in, m; above the rounding of positions.
const JUST_OUT: f64 = 1e-6;

/// Side of the skin that a sample of a tool was on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Side {
    /// It was inside.
    inside: bool,
    /// Where it was, m.
    at: DVec3,
    /// Point of the surface nearest to it; of a sample inside, of the surface that it is pushed out of.
    on_skin: MaterialPoint,
    /// From there to the sample, m; of a sample inside, just out of the surface.
    away: DVec3,
}

/// Sides of deformable bodies that samples were on, by tool, body and sample; none of samples away from the skin.
pub type Sides = BTreeMap<(usize, usize, usize), Side>;

/// Projection on the surface: triangle, weights, signed distance (negative inside), outward unit normal.
pub type Projection = (usize, [f64; 3], f64, DVec3);

impl Side {
    /// Of a sample by its projection.
    pub fn of(patch: &Patch, at: DVec3, (triangle, weights, distance, normal): Projection) -> Self {
        let inside = distance < 0.0;
        let away = if inside { normal * JUST_OUT } else { at - patch.position(triangle, weights) };
        Self { inside, at, on_skin: patch.material_point(triangle, weights), away }
    }

    /// The position outside that it has on the skin as it is now; none where the patch does not reach.
    fn outside(&self, patch: &Patch, position: &dyn Fn(u32) -> DVec3) -> Option<DVec3> {
        let at: DVec3 = self.on_skin.0.iter().map(|(node, weight)| position(*node) * *weight).sum();
        self.on_skin.nodes().all(|node| patch.has(node)).then_some(at + self.away)
    }
}

/// Sides of one tool's samples at one body in the last step, and the present positions of the body's nodes.
pub struct Last<'a> {
    sides: Option<&'a Sides>,
    pair: (usize, usize),
    position: &'a dyn Fn(u32) -> DVec3,
}

impl<'a> Last<'a> {
    /// Of a tool and a body.
    pub fn new(sides: &'a Sides, pair: (usize, usize), position: &'a dyn Fn(u32) -> DVec3) -> Self {
        Self { sides: Some(sides), pair, position }
    }

    /// Before the first step.
    pub fn none() -> Self {
        Self { sides: None, pair: (0, 0), position: &|_| DVec3::ZERO }
    }

    /// Projection of a sample by the side that it was on.
    pub fn project(&self, patch: &Patch, sample: usize, point: DVec3) -> Projection {
        let nearest = patch.project(point);
        let Some(sides) = self.sides else { return nearest };
        let Some(last) = sides.get(&(self.pair.0, self.pair.1, sample)) else { return patch.project_outside(point) };
        // relative to the skin it has entered; relative to where the skin is now too, or the nearest surface says so as well
        let enters = |from: DVec3| patch.entered(from, point) > 0;
        let inside = match last.outside(patch, self.position) {
            Some(outside) => enters(outside) && (last.inside || nearest.2 < 0.0 || enters(last.at)),
            None => last.inside && nearest.2 < 0.0,
        };
        match inside {
            true => patch.project_inside(point, nearest, last.away.normalize_or_zero()),
            false => patch.project_outside(point),
        }
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

    /// Whether a node is one of its corners.
    fn has(&self, node: u32) -> bool {
        let of_faces = || self.quarters.iter().any(|face| face.contains(&node));
        self.triangles.iter().any(|triangle| triangle.contains(&node)) || of_faces()
    }

    /// How often a way enters the surface, less how often it leaves.
    pub fn entered(&self, from: DVec3, to: DVec3) -> i32 {
        let way = to - from;
        let enters = |triangle: u32| {
            let (_, at) = meets(&self.corners[triangle as usize], from, way)?;
            let against = self.face_normal(triangle as usize).dot(way) < 0.0;
            (0.0..=1.0).contains(&at).then_some(if against { 1 } else { -1 })
        };
        self.near(from.min(to), from.max(to)).into_iter().filter_map(enters).sum()
    }
}
