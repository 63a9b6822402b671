//! Finds contacts between a tool's samples and the skin's surface, on parry3d.
//!
//! Only the surface near the tool is looked at: faces of live cells whose rest box, widened by how far the skin has moved, meets the
//! tool's box. Each sample is projected on that patch (point–triangle, the nearest feature); the patch's pseudo-normals tell inside from
//! outside, so a point that is already inside is pushed out. The flats of a blade look along ± their normal alone: a ray from the
//! blade's middle plane to the first wall that faces it. parry3d works in f32 and finds triangle and place on it; gaps and normals are
//! then taken from f64 positions.
//! Units: m.

pub mod features;
pub mod round;

use crate::constraints::Law;
use crate::instrument::{Edge, Instrument, Role};
use crate::mesh::{Grid, Quad, Surface};
use crate::scene::Filter;
use glam::DVec3;
use parry3d::bounding_volume::{Aabb, BoundingVolume};
use parry3d::math::Vector;
use parry3d::query::details::RayCast;
use parry3d::query::{PointQueryWithLocation, Ray};
use parry3d::shape::{FeatureId, TriMesh, TriMeshFlags, TrianglePointLocation};

/// One contact: three rows between a tool's point and a point of the skin.
#[derive(Clone, Copy, Debug)]
pub struct Contact {
    /// Tool and sample: what a contact is called from step to step.
    pub id: (usize, usize),
    /// Surface triangle, node ids.
    pub nodes: [u32; 3],
    /// Place on it.
    pub weights: [f64; 3],
    /// Where the tool is touched, world, m.
    pub point: DVec3,
    /// Unit directions of the three rows; motion of the tool along them, relative to the skin, is what they measure.
    pub axes: [DVec3; 3],
    /// Violation of row 0 at the step's start, m.
    pub gap: f64,
    /// Bounds.
    pub law: Law,
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

/// Box of a tool's samples over a step, widened.
pub fn tool_box(tool: &Instrument, margin: f64) -> Aabb {
    let radius = tool.round.map_or(0.0, |round| round.radius) + tool.lines.as_ref().map_or(0.0, |lines| lines.radius);
    let margin = margin + radius;
    let points = tool.samples.iter().map(|s| to_f32(tool.at(s.position)));
    Aabb::from_points(points).loosened(margin as f32)
}

/// Faces that the box may meet when no node has moved by more than `reach`.
pub fn faces_near(grid: &Grid, surface: &Surface, area: &Aabb, reach: f64) -> Vec<Quad> {
    let area = area.loosened(reach as f32);
    let (low, high) = (area.mins.as_dvec3(), area.maxs.as_dvec3());
    if low.z > grid.thickness() || high.z < 0.0 {
        return vec![];
    }
    let mut range = [[0usize; 3]; 2];
    for axis in 0..2 {
        let cells = grid.cells[axis];
        let at = |x: f64| x / grid.edge[axis] + 0.5 * cells as f64;
        if at(high[axis]) < 0.0 || at(low[axis]) > cells as f64 {
            return vec![];
        }
        range[0][axis] = at(low[axis]).floor().clamp(0.0, cells as f64) as usize;
        range[1][axis] = at(high[axis]).ceil().clamp(0.0, cells as f64) as usize;
    }
    let levels = &grid.heights;
    range[0][2] = levels.partition_point(|z| *z < low.z).saturating_sub(1);
    range[1][2] = levels.partition_point(|z| *z <= high.z).min(grid.cells[2]);
    let mut out = vec![];
    surface.quads(range[0], range[1], &mut out);
    out
}

/// A patch of skin where it is now.
pub struct Patch {
    mesh: TriMesh,
    triangles: Vec<[u32; 3]>,
    cells: Vec<u32>,
    corners: Vec<[DVec3; 3]>,
    origin: DVec3,
}

fn to_f32(p: DVec3) -> Vector {
    p.as_vec3()
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
        let triangles: Vec<[u32; 3]> = faces.iter().flat_map(|q| q.triangles()).collect();
        let indices = triangles.iter().map(|t| t.map(local)).collect();
        let mesh = TriMesh::with_flags(vertices, indices, TriMeshFlags::ORIENTED).ok()?;
        let cells = faces.iter().flat_map(|q| [q.cell; 2]).collect();
        let corners = triangles.iter().map(|t| t.map(&position)).collect();
        Some(Self { mesh, triangles, cells, corners, origin })
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

    /// Triangles that may meet a box, in rising order.
    pub fn near(&self, low: DVec3, high: DVec3) -> Vec<u32> {
        // corners are rounded to f32 relative to the patch's origin, by half a millionth of it at most
        let slack = 1e-6 * f64::from(self.mesh.local_aabb().half_extents().max_element());
        let area = Aabb::new(to_f32(low - self.origin), to_f32(high - self.origin)).loosened(slack as f32);
        let mut found: Vec<u32> = self.mesh.bvh().intersect_aabb(&area).collect();
        found.sort_unstable();
        found
    }

    /// The first thing along a ray, if it is a wall that faces the ray: triangle, weights, distance.
    pub fn cast(&self, from: DVec3, direction: DVec3, reach: f64) -> Option<(usize, [f64; 3], f64)> {
        let ray = Ray::new(to_f32(from - self.origin), to_f32(direction));
        let hit = self.mesh.cast_local_ray_and_get_normal(&ray, reach as f32, false)?;
        let count = self.triangles.len();
        let FeatureId::Face(face) = hit.feature else {
            return None;
        };
        let triangle = face as usize % count;
        let [a, b, c] = self.corners[triangle];
        let normal = (b - a).cross(c - a);
        let facing = normal.dot(direction);
        if facing > -FACING * normal.length() {
            return None; // seen from behind (the sample is inside the tissue), or at a glance
        }
        let distance = normal.dot(a - from) / facing;
        let p = from + direction * distance;
        let area = normal.length_squared();
        let v = normal.dot((p - a).cross(c - a)) / area;
        let w = normal.dot((b - a).cross(p - a)) / area;
        Some((triangle, [1.0 - v - w, v, w], distance))
    }
}

/// Contacts of one tool with a patch. `travel` is how far a sample may move in the step; `resistance` gives the force per length that
/// the tissue of a cell bears, N/m.
pub fn contacts(
    number: usize,
    tool: &Instrument,
    patch: &Patch,
    search: &Search,
    travel: f64,
    resistance: impl Fn(u32) -> f64,
) -> Vec<Contact> {
    let mut out = vec![];
    for (index, sample) in tool.samples.iter().enumerate() {
        let point = tool.at(sample.position);
        let reach = search.alarm + travel;
        let contact = match (sample.role, &tool.edge) {
            (Role::Edge { length, .. }, Some(edge)) => {
                edge_contact(tool, edge, patch, point, length, reach, search, &resistance)
            }
            (Role::Flat { side }, Some(edge)) => flat_contact(tool, edge, patch, point, side, reach, search),
            _ => point_contact(patch, point, reach, search),
        };
        out.extend(contact.map(|c| Contact { id: (number, index), ..c }));
    }
    out
}

fn frame(normal: DVec3) -> [DVec3; 3] {
    let (t, s) = normal.any_orthonormal_pair();
    [normal, t, s]
}

fn point_contact(patch: &Patch, point: DVec3, reach: f64, search: &Search) -> Option<Contact> {
    let (triangle, weights, distance, normal) = patch.project(point);
    (distance < reach + search.distance).then(|| Contact {
        id: (0, 0),
        nodes: patch.triangles[triangle],
        weights,
        point,
        axes: frame(normal),
        gap: distance - search.distance,
        law: Law::Coulomb { friction: search.friction, bound: f64::INFINITY },
    })
}

/// A flat rests against walls that are turned to it by less than 60°; at a glance the distance along the ray means nothing.
const FACING: f64 = 0.5;
/// Walls whose normal lies closer than this to the blade's normal are the flats' business.
const SIDEWAYS: f64 = 0.7;

fn edge_contact(
    tool: &Instrument,
    edge: &Edge,
    patch: &Patch,
    point: DVec3,
    length: f64,
    reach: f64,
    search: &Search,
    resistance: &impl Fn(u32) -> f64,
) -> Option<Contact> {
    let (triangle, weights, distance, normal) = patch.project(point);
    if distance >= reach {
        return None;
    }
    let nodes = patch.triangles[triangle];
    let bound = resistance(patch.cells[triangle]) * length;
    let [forward, along, side] = [edge.forward, edge.along, edge.normal].map(|a| tool.rotation * a);
    let base = Contact {
        id: (0, 0),
        nodes,
        weights,
        point,
        axes: [-forward, along, side],
        gap: 0.0,
        law: Law::Cut { radius: bound },
    };
    if distance <= 0.0 {
        // inside: held by the tissue where it is
        return Some(base);
    }
    if normal.dot(side).abs() > SIDEWAYS || normal.dot(forward) > 0.0 {
        return None; // beside or behind the edge
    }
    let law = Law::Coulomb { friction: search.friction, bound };
    Some(Contact { axes: frame(normal), gap: distance, law, ..base })
}

fn flat_contact(
    tool: &Instrument,
    edge: &Edge,
    patch: &Patch,
    point: DVec3,
    side: f64,
    reach: f64,
    search: &Search,
) -> Option<Contact> {
    let direction = tool.rotation * edge.normal * side;
    let (triangle, weights, distance) = patch.cast(point, direction, edge.half_thickness + reach + search.distance)?;
    Some(Contact {
        id: (0, 0),
        nodes: patch.triangles[triangle],
        weights,
        point: point + direction * edge.half_thickness,
        axes: frame(-direction),
        gap: distance - edge.half_thickness - search.distance,
        law: Law::Coulomb { friction: search.friction, bound: f64::INFINITY },
    })
}
