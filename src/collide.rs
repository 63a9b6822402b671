//! Finds contacts between a tool's samples and the skin's surface, on parry3d.
//!
//! Only the surface near the tool is looked at ([`broad`]). Each sample is projected on that patch (point–triangle, the nearest feature); the patch's pseudo-normals tell inside from
//! outside, so a point that is already inside is pushed out. The flats of a blade look along ± their normal alone: a ray from the
//! blade's middle plane to the first wall that faces it. parry3d works in f32 and finds triangle and place on it; gaps and normals are
//! then taken from f64 positions.
//! Units: m.

mod blade;
pub mod bodies;
pub mod broad;
mod cast;
mod centres;
pub mod features;
pub mod lips;
pub mod round;
mod spread;

pub use blade::Resistance;

use crate::bodies::rigid::{Instrument, Role};
use crate::constraints::Law;
use crate::mesh::{MaterialPoint, Quad};
use crate::scene::{BodyId, Filter, Plane};
use glam::DVec3;
use parry3d::bounding_volume::BoundingVolume;
use parry3d::math::Vector;
use parry3d::query::PointQueryWithLocation;
use parry3d::shape::{TriMesh, TriMeshFlags, Triangle, TrianglePointLocation};

/// A contact or a constraint between two points that move.
#[derive(Clone, Debug)]
pub struct Contact {
    /// The two bodies; forces act on the first along the axes and on the second against them.
    pub on: [BodyId; 2],
    /// Where on each of them, if it is deformable.
    pub points: [MaterialPoint; 2],
    /// Sample of the pair: with it, what a contact is called from step to step.
    pub feature: usize,
    /// Where they touch, world, m.
    pub point: DVec3,
    /// Unit directions; the rows of the law are along the first of them, and measure the motion of the first body relative to the second.
    pub axes: [DVec3; 3],
    /// Violations along them at the step's start, m.
    pub gap: [f64; 3],
    /// How far the sample is inside the surface at the step's start, m; 0 of one outside.
    pub depth: f64,
    /// Bounds.
    pub law: Law,
}

impl Contact {
    /// A rigid body's sample on a place of a deformable body; rows and law are still to be set.
    pub fn on_skin(tool: usize, feature: usize, skin: usize, spot: MaterialPoint, point: DVec3) -> Self {
        Self {
            on: [BodyId::Rigid(tool), BodyId::Deformable(skin)],
            points: [MaterialPoint::default(), spot],
            feature,
            point,
            axes: DVec3::AXES,
            gap: [0.0; 3],
            depth: 0.0,
            law: Law::contact(0.0),
        }
    }

    /// Values along its axes as a vector.
    pub fn in_world(&self, along: [f64; 3]) -> DVec3 {
        self.axes[0] * along[0] + self.axes[1] * along[1] + self.axes[2] * along[2]
    }

    /// What it is called from step to step.
    pub fn id(&self) -> ([BodyId; 2], usize) {
        (self.on, self.feature)
    }
}

/// Numbers of the search.
#[derive(Clone, Copy, Debug)]
pub struct Search {
    /// Contacts are made within this distance, m.
    pub alarm: f64,
    /// Resting gap of points and flats, m.
    pub distance: f64,
    /// μ
    pub friction: f64,
    /// For round tools and tools of points and lines.
    pub filter: Filter,
    /// How far normal cones are widened: sine of the angle.
    pub angle_cone: f64,
}

/// A box along the world's axes, f32.
pub use parry3d::bounding_volume::Aabb;

/// The box between two corners, wider by a margin on all sides, m.
pub fn area(low: DVec3, high: DVec3, margin: f64) -> Aabb {
    wider(&Aabb::new(to_f32(low), to_f32(high)), margin)
}

/// A box with a margin on all sides; without one where the margin is not a number, as of a motion that overflowed.
pub fn wider(area: &Aabb, margin: f64) -> Aabb {
    area.loosened(margin.max(0.0) as f32)
}

/// A box elsewhere.
pub fn moved(area: &Aabb, by: DVec3) -> Aabb {
    // added in f64 and rounded outward by the loosening, so that what the box held stays in it
    let [low, high] = [area.mins, area.maxs].map(|corner| corner.as_dvec3() + by);
    let rounding = f64::from(f32::EPSILON) * low.abs().max(high.abs()).max_element();
    self::area(low, high, rounding)
}

/// Box of a tool over a step: its samples with what is around them (a round tool's radius, half a blade's thickness), widened. A tool
/// without samples touches nothing; its box is around its origin.
pub fn tool_box(tool: &Instrument, margin: f64) -> Aabb {
    let thick = tool.edge.as_ref().map_or(0.0, |edge| edge.half_thickness);
    let around = tool.lines.as_ref().map_or(thick, |lines| lines.radius).max(tool.tip_radius);
    let margin = margin + tool.round.map_or(around, |round| round.radius);
    let points = tool.samples.iter().map(|s| to_f32(tool.at(s.position)));
    let first = tool.samples.first().map_or(tool.position, |s| tool.at(s.position));
    wider(&Aabb::from_points(points.chain([to_f32(first)])), margin)
}

/// The part of a body's box that may touch a wall; none when it is clear of it.
pub fn slab(plane: &Plane, area: &Aabb, search: &Search) -> Option<Aabb> {
    let (through, normal) = (DVec3::from_array(plane.through), DVec3::from_array(plane.normal));
    let (centre, half) = (area.center().as_dvec3(), area.half_extents().as_dvec3());
    let reach = normal.abs().dot(half);
    let gap = normal.dot(centre - through) - reach - search.alarm - search.distance;
    if gap > 0.0 {
        return None;
    }
    // along an axis that the wall is square to, only the part near it
    let mut near = *area;
    if let Some(axis) = (0..3).find(|n| normal[*n].abs() > 1.0 - 1e-9) {
        let end = (through[axis] + normal[axis] * (search.alarm + search.distance)) as f32;
        match normal[axis] > 0.0 {
            true => near.maxs[axis] = near.maxs[axis].min(end),
            false => near.mins[axis] = near.mins[axis].max(end),
        }
    }
    Some(near)
}

/// A patch of skin where it is now.
pub struct Patch {
    mesh: TriMesh,
    /// Node ids; none where faces are four triangles about their centre, which is no node.
    triangles: Vec<[u32; 3]>,
    /// Of those faces.
    quarters: Vec<[u32; 4]>,
    cells: Vec<u32>,
    walls: Vec<bool>,
    corners: Vec<[DVec3; 3]>,
    origin: DVec3,
}

fn to_f32(p: DVec3) -> Vector {
    p.as_vec3()
}

/// A face in two: by its other diagonal where the first folds one half over, as in a quad with a reflex corner, such as the lip of a wound
/// may have. (Over a half that lies face down all of the air counted as inside.)
fn halves(face: &Quad, position: impl Fn(u32) -> DVec3) -> [[u32; 3]; 2] {
    let [a, b, c, d] = face.nodes;
    let folds = |halves: [[u32; 3]; 2]| {
        let [first, second] = halves.map(|half| {
            let [p, q, r] = half.map(&position);
            (q - p).cross(r - p)
        });
        first.dot(second) < 0.0
    };
    let (first, other) = (face.triangles(), [[a, b, d], [b, c, d]]);
    if folds(first) && !folds(other) { other } else { first }
}

impl Patch {
    /// From faces and the present position of their nodes; `None` when there are no faces.
    pub fn new(faces: &[Quad], position: impl Fn(u32) -> DVec3) -> Option<Self> {
        let mut ids: Vec<u32> = faces.iter().flat_map(|q| q.nodes).collect();
        ids.sort_unstable();
        ids.dedup();
        let origin = position(*ids.first()?);
        let local = |id: u32| ids.binary_search(&id).unwrap_or(0) as u32;
        let vertices = ids.iter().map(|id| to_f32(position(*id) - origin)).collect();
        let triangles: Vec<[u32; 3]> = faces.iter().flat_map(|q| halves(q, &position)).collect();
        let indices = triangles.iter().map(|t| t.map(local)).collect();
        let mesh = TriMesh::with_flags(vertices, indices, TriMeshFlags::ORIENTED).ok()?;
        let cells = faces.iter().flat_map(|q| [q.cell; 2]).collect();
        let walls = faces.iter().flat_map(|q| [q.wall; 2]).collect();
        let corners = triangles.iter().map(|t| t.map(&position)).collect();
        Some(Self { mesh, triangles, quarters: vec![], cells, walls, corners, origin })
    }

    /// Nearest place, and how far it is, m.
    pub fn nearest(&self, point: DVec3) -> (MaterialPoint, f64) {
        let (triangle, weights, distance, _) = self.project(point);
        (self.spot(triangle, weights), distance.abs())
    }

    fn place(&self, triangle: usize, weights: [f64; 3]) -> DVec3 {
        let c = &self.corners[triangle];
        c[0] * weights[0] + c[1] * weights[1] + c[2] * weights[2]
    }

    fn face_normal(&self, triangle: usize) -> DVec3 {
        let [a, b, c] = self.corners[triangle];
        (b - a).cross(c - a).normalize_or_zero()
    }

    /// Nearest place: triangle, weights, signed distance (negative inside), outward unit normal.
    pub fn project(&self, point: DVec3) -> (usize, [f64; 3], f64, DVec3) {
        let local = to_f32(point - self.origin);
        let (projection, (triangle, location)) = self.mesh.project_local_point_and_get_location(local, false);
        let triangle = triangle as usize;
        let weights = match location {
            TrianglePointLocation::OnSolid => [1.0 / 3.0; 3],
            other => other.barycentric_coordinates().map_or([1.0 / 3.0; 3], |w| w.map(f64::from)),
        };
        let away = point - self.place(triangle, weights);
        let distance = away.length();
        // below f32's resolution of the patch the direction is noise
        let noise = 1e-6 * f64::from(self.mesh.local_aabb().half_extents().max_element());
        let sign = if projection.is_inside { -1.0 } else { 1.0 };
        let normal = if distance > noise { away * (sign / distance) } else { self.face_normal(triangle) };
        (triangle, weights, sign * distance, normal)
    }

    /// Whether a point is inside, or nearer to a wall of the wound than to the outside.
    pub fn in_wound(&self, point: DVec3) -> bool {
        let (triangle, _, distance, _) = self.project(point);
        distance <= 0.0 || self.walls[triangle]
    }

    /// How far the deepest of the tool's samples that look for the nearest place is inside, m; 0 when all are outside.
    pub fn deepest(&self, tool: &Instrument) -> f64 {
        let sinks = |role: Role| !matches!(role, Role::Flat(_));
        let depth = |p: DVec3| -self.project(tool.at(p)).2;
        tool.samples.iter().filter(|s| sinks(s.role)).map(|s| depth(s.position)).fold(0.0, f64::max)
    }

    /// Weights of the place of a triangle that is nearest to a point.
    fn nearest_on(&self, triangle: usize, point: DVec3) -> [f64; 3] {
        let [a, b, c] = self.corners[triangle].map(|p| to_f32(p - self.origin));
        let (_, location) =
            Triangle::new(a, b, c).project_local_point_and_get_location(to_f32(point - self.origin), false);
        location.barycentric_coordinates().map_or([1.0 / 3.0; 3], |w| w.map(f64::from))
    }

    /// Triangles that may meet a box, in rising order.
    pub fn near(&self, low: DVec3, high: DVec3) -> Vec<u32> {
        // corners are rounded to f32 relative to the patch's origin, by half a millionth of it at most
        let slack = 1e-6 * f64::from(self.mesh.local_aabb().half_extents().max_element());
        let area = wider(&Aabb::new(to_f32(low - self.origin), to_f32(high - self.origin)), slack);
        let mut found: Vec<u32> = self.mesh.bvh().intersect_aabb(&area).collect();
        found.sort_unstable();
        found
    }
}

/// Contacts of one tool's samples with a patch of a deformable body. `travel` is how far a sample may move in the step; `resistance`
/// gives what the tissue of a cell bears; `retreat` how far a piece of edge has gone back from where it has cut to, m, if it has cut.
pub fn contacts(
    (number, tool): (usize, &Instrument),
    (body, patch): (usize, &Patch),
    search: &Search,
    travel: f64,
    resistance: impl Fn(u32) -> Resistance,
    retreat: impl Fn(usize) -> Option<f64>,
) -> Vec<Contact> {
    let mut out = vec![];
    for (index, sample) in tool.samples.iter().enumerate() {
        let point = tool.at(sample.position);
        let reach = search.alarm + travel;
        let found = match (sample.role, &tool.edge) {
            (Role::Edge { length, .. }, Some(edge)) if tool.sharp => {
                blade::edge_contact(tool, edge, patch, point, length, reach, search, &resistance, retreat(index))
            }
            (Role::Flat(flat), Some(edge)) => {
                blade::flat_contact(tool, edge, patch, point, flat, travel, search, &resistance)
            }
            _ => point_contact(patch, point, tool.tip_radius, reach, search),
        };
        let on_skin = |f: Found| {
            let contact = Contact::on_skin(number, index, body, f.spot, f.point);
            Contact { axes: f.axes, gap: [f.gap, 0.0, 0.0], depth: f.depth, law: f.law, ..contact }
        };
        out.extend(found.map(on_skin));
    }
    out
}

/// A sample's contact, without the names of the bodies.
struct Found {
    spot: MaterialPoint,
    point: DVec3,
    axes: [DVec3; 3],
    gap: f64,
    depth: f64,
    law: Law,
}

/// A normal and two directions across it.
pub fn frame(normal: DVec3) -> [DVec3; 3] {
    let (t, s) = normal.any_orthonormal_pair();
    [normal, t, s]
}

fn point_contact(patch: &Patch, point: DVec3, radius: f64, reach: f64, search: &Search) -> Option<Found> {
    let (triangle, weights, distance, normal) = patch.project(point);
    let disc = patch.disc(triangle, weights, radius);
    let (spot, distance, normal) = match disc {
        Some(disc) => (disc.spot, disc.normal.dot(point - disc.place), disc.normal),
        None => (patch.spot(triangle, weights), distance, normal),
    };
    (distance < reach + search.distance).then(|| Found {
        spot,
        point,
        axes: frame(normal),
        gap: distance - search.distance,
        depth: (-distance).max(0.0),
        law: Law::contact(search.friction),
    })
}
