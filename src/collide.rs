//! Contacts between a tool's samples and the skin's surface, on parry3d.
//!
//! Only the surface near the tool is searched ([`broad`]). Each sample is projected on that patch (point–triangle, the nearest feature);
//! the patch's pseudo-normals and where it was ([`sides`]) tell inside from outside, so a point inside is pushed out. The flats of a blade
//! look along ± their normal alone: a ray from the blade's middle plane to the first wall that faces it. parry3d works in f32 and finds the triangle and the point on
//! it; gaps and normals are then computed from f64 positions.
//! Units: m.
//!
//! For tools of points a patch's faces are four triangles about their centre, the mean of their corners ([`Patch::about_centres`]). Faces
//! cut in two by one diagonal differ at mirror images of a point: a point of `scenes/hard/tools_many_points.toml` alone felt 28.9 and 40.0
//! mN at (±0.3, ±0.2) mm on cells of 1.4 mm. About the centre no diagonal is preferred. The centre is no node; a force on it acts on the
//! four corners alike. Blades, round tools and tools of lines use faces in two: their pieces meet several triangles at once.
//!
//! A blade's edge meets the tissue that it is to cut, its flats the walls of the cut.

pub mod bodies;
pub mod broad;
pub mod convex;
pub mod edges;
pub mod features;
pub mod lips;
pub mod round;
pub mod sides;
mod spread;

use crate::bodies::rigid::{Edge, Flat, Instrument, Role};
use crate::constraints::Law;
use crate::mesh::{Face, MaterialPoint};
use crate::scene::{BodyId, Filter, Plane};
use features::closest::on_segment;
use glam::DVec3;
use parry3d::bounding_volume::BoundingVolume;
use parry3d::math::Vector;
use parry3d::query::PointQueryWithLocation;
use parry3d::shape::{TriMesh, TriMeshFlags, Triangle, TrianglePointLocation};
use sides::{Last, OfSamples, Projection, Side};

/// Contact or constraint between two moving points.
#[derive(Clone, Debug)]
pub struct Contact {
    /// The two bodies; forces act on the first along the axes and on the second against them.
    pub on: [BodyId; 2],
    /// Material point on each, if it is deformable.
    pub points: [MaterialPoint; 2],
    /// Sample of the pair; with the bodies it identifies the contact from step to step.
    pub feature: usize,
    /// Contact point, world, m.
    pub point: DVec3,
    /// Unit directions. The law's rows are along the first of them and measure the motion of the first body relative to the second.
    pub axes: [DVec3; 3],
    /// Violations along them at the start of the step, m; of friction 0, or in a static step the slip of its earlier solves.
    pub gap: [f64; 3],
    /// Depth of the sample inside the surface at the start of the step, m; 0 outside.
    pub depth: f64,
    /// Law of the forces.
    pub law: Law,
}

impl Contact {
    /// Contact of a rigid body's sample with a material point of a deformable body; rows and law are still to be set.
    pub fn on_skin(tool: usize, feature: usize, skin: usize, material_point: MaterialPoint, point: DVec3) -> Self {
        Self {
            on: [BodyId::Rigid(tool), BodyId::Deformable(skin)],
            points: [MaterialPoint::default(), material_point],
            feature,
            point,
            axes: DVec3::AXES,
            gap: [0.0; 3],
            depth: 0.0,
            law: Law::contact(0.0),
        }
    }

    /// Contact with friction at a point; the material points are still to be set.
    fn between(on: [BodyId; 2], feature: usize, point: DVec3, normal: DVec3, gap: f64, search: &Search) -> Self {
        Self {
            on,
            points: [MaterialPoint::default(), MaterialPoint::default()],
            feature,
            point,
            axes: frame(normal),
            gap: [gap - search.distance, 0.0, 0.0],
            depth: (-gap).max(0.0),
            law: Law::contact(search.friction),
        }
    }

    /// Vector from components along its axes.
    pub fn in_world(&self, along: [f64; 3]) -> DVec3 {
        self.axes[0] * along[0] + self.axes[1] * along[1] + self.axes[2] * along[2]
    }

    /// Identity from step to step.
    pub fn id(&self) -> ([BodyId; 2], usize) {
        (self.on, self.feature)
    }
}

/// Parameters of the search.
#[derive(Clone, Copy, Debug)]
pub struct Search {
    /// Alarm distance: contacts are created below it, m.
    pub alarm: f64,
    /// Rest gap of points and flats, m.
    pub distance: f64,
    /// μ
    pub friction: f64,
    /// Filter for round tools and tools of points and lines.
    pub filter: Filter,
    /// Widening of normal cones, sine of the angle.
    pub angle_cone: f64,
}

/// Axis-aligned box, f32.
pub use parry3d::bounding_volume::Aabb;

/// Box between two corners, enlarged by a margin on all sides, m.
pub fn area(low: DVec3, high: DVec3, margin: f64) -> Aabb {
    wider(&Aabb::new(to_f32(low), to_f32(high)), margin)
}

/// Box enlarged by a margin on all sides; unchanged if the margin is NaN, as after a motion that overflowed.
pub fn wider(area: &Aabb, margin: f64) -> Aabb {
    area.loosened(margin.max(0.0) as f32)
}

/// Translated box.
pub fn moved(area: &Aabb, by: DVec3) -> Aabb {
    // added in f64 and loosened by the rounding, so that its content stays inside
    let [low, high] = [area.mins, area.maxs].map(|corner| corner.as_dvec3() + by);
    let rounding = f64::from(f32::EPSILON) * low.abs().max(high.abs()).max_element();
    self::area(low, high, rounding)
}

/// Box around a tool's samples with their extent (radius of a round tool, half thickness of a blade), enlarged by a margin. A tool without
/// samples touches nothing; its box is around its origin.
pub fn tool_box(tool: &Instrument, margin: f64) -> Aabb {
    let thick = tool.edge.as_ref().map_or(0.0, |edge| edge.half_thickness);
    let around = tool.lines.as_ref().map_or(thick, |lines| lines.radius).max(tool.tip_radius);
    let margin = margin + tool.round.map_or(around, |round| round.radius);
    let points = tool.samples.iter().map(|s| to_f32(tool.at(s.position)));
    let first = tool.samples.first().map_or(tool.position, |s| tool.at(s.position));
    wider(&Aabb::from_points(points.chain([to_f32(first)])), margin)
}

/// Signed distance of a position from a tool's round surface, or from its points, with the direction away from it, m.
pub fn distance_from(tool: &Instrument, at: DVec3) -> (f64, DVec3) {
    let from = |nearest: DVec3, radius: f64| ((at - nearest).length() - radius, (at - nearest).normalize_or_zero());
    if let Some(round) = &tool.round {
        let ends = round.ends.map(|end| tool.at(DVec3::from_array(end)));
        return from(ends[0].lerp(ends[1], on_segment(at, ends)), round.radius);
    }
    let radius = tool.lines.as_ref().map_or(0.0, |lines| lines.radius);
    let of_samples = tool.samples.iter().map(|sample| from(tool.at(sample.position), radius));
    of_samples.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::INFINITY, DVec3::ZERO))
}

/// Part of a body's box that may touch a wall; none if it is clear of it.
pub fn slab(plane: &Plane, area: &Aabb, search: &Search) -> Option<Aabb> {
    let (through, normal) = (DVec3::from_array(plane.through), DVec3::from_array(plane.normal));
    let (centre, half) = (area.center().as_dvec3(), area.half_extents().as_dvec3());
    let reach = normal.abs().dot(half);
    let gap = normal.dot(centre - through) - reach - search.alarm - search.distance;
    if gap > 0.0 {
        return None;
    }
    // a wall normal to an axis keeps only the part near it
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

/// Patch of skin at its present position.
pub struct Patch {
    mesh: TriMesh,
    /// Its nodes, sorted.
    ids: Vec<u32>,
    /// Node ids; empty if faces are four triangles about their centre, which is no node.
    triangles: Vec<[u32; 3]>,
    /// Nodes of such faces and their shares in its centre.
    quarters: Vec<([u32; 4], [f64; 4])>,
    cells: Vec<u32>,
    walls: Vec<bool>,
    corners: Vec<[DVec3; 3]>,
    origin: DVec3,
}

fn to_f32(p: DVec3) -> Vector {
    p.as_vec3()
}

/// Whether one half of a quad, split along the diagonal from its first corner, lies over the other.
fn folds([a, b, c, d]: [DVec3; 4]) -> bool {
    (b - a).cross(c - a).dot((c - a).cross(d - a)) < 0.0
}

/// Splits a face in two; along its other diagonal if the first folds one half over, as in a quad with a reflex corner, such as the lip of a
/// wound may have. (Below a half that lies face down all of the air counted as inside.)
fn halves(face: &Face, position: impl Fn(u32) -> DVec3) -> impl Iterator<Item = [u32; 3]> {
    let [a, b, c, d] = face.nodes;
    let [p, q, r, s] = face.nodes.map(&position);
    let (first, other) = ([[a, b, c], [a, c, d]], [[a, b, d], [b, c, d]]);
    let turned = !face.is_triangle() && folds([p, q, r, s]) && !folds([q, r, s, p]);
    if turned { other } else { first }.into_iter().take(face.triangles().count())
}

/// Shares of a quad's corners in its centre: their mean, or if a quarter about that would be folded over, the middle of the diagonal that
/// folds nothing.
fn centre(corners: [DVec3; 4]) -> [f64; 4] {
    let [a, b, c, d] = corners;
    let (normal, mean) = (area_normal(corners), (a + b + c + d) * 0.25);
    let over = |k: usize| (corners[k] - mean).cross(corners[(k + 1) % 4] - mean).dot(normal) < 0.0;
    match (0..4).any(over) {
        true if !folds([a, b, c, d]) => [0.5, 0.0, 0.5, 0.0],
        true if !folds([b, c, d, a]) => [0.0, 0.5, 0.0, 0.5],
        _ => [0.25; 4],
    }
}

impl Patch {
    /// Patch of faces at the present positions of their nodes; `None` without faces.
    pub fn new(faces: &[Face], position: impl Fn(u32) -> DVec3) -> Option<Self> {
        let mut ids: Vec<u32> = faces.iter().flat_map(|q| q.nodes).collect();
        ids.sort_unstable();
        ids.dedup();
        let origin = position(*ids.first()?);
        let local = |id: u32| ids.binary_search(&id).unwrap_or(0) as u32;
        let vertices = ids.iter().map(|id| to_f32(position(*id) - origin)).collect();
        let triangles: Vec<[u32; 3]> = faces.iter().flat_map(|q| halves(q, &position)).collect();
        let indices = triangles.iter().map(|t| t.map(local)).collect();
        let mesh = TriMesh::with_flags(vertices, indices, TriMeshFlags::ORIENTED).ok()?;
        let cells = faces.iter().flat_map(|q| q.triangles().map(|_| q.cell)).collect();
        let walls = faces.iter().flat_map(|q| q.triangles().map(|_| q.wall)).collect();
        let corners = triangles.iter().map(|t| t.map(&position)).collect();
        Some(Self { mesh, ids, triangles, quarters: vec![], cells, walls, corners, origin })
    }

    /// Nearest point of the surface and its distance, m.
    pub fn nearest(&self, point: DVec3) -> (MaterialPoint, f64) {
        let (triangle, weights, distance, _) = self.project(point);
        (self.material_point(triangle, weights), distance.abs())
    }

    /// The surface's point nearest to a point: where it is at rest, and its cell; `rest` gives corners' positions at rest.
    pub fn at_rest(&self, point: DVec3, rest: impl Fn(u32) -> DVec3) -> (DVec3, u32) {
        let (triangle, weights, ..) = self.project(point);
        let corners = self.material_point(triangle, weights).0;
        (corners.iter().map(|(node, weight)| rest(*node) * *weight).sum(), self.cells[triangle])
    }

    fn position(&self, triangle: usize, weights: [f64; 3]) -> DVec3 {
        let c = &self.corners[triangle];
        c[0] * weights[0] + c[1] * weights[1] + c[2] * weights[2]
    }

    fn face_normal(&self, triangle: usize) -> DVec3 {
        let [a, b, c] = self.corners[triangle];
        (b - a).cross(c - a).normalize_or_zero()
    }

    /// Projection on the surface: triangle, weights, signed distance (negative inside), outward unit normal.
    pub fn project(&self, point: DVec3) -> Projection {
        let local = to_f32(point - self.origin);
        let (projection, (triangle, location)) = self.mesh.project_local_point_and_get_location(local, false);
        let triangle = triangle as usize;
        let weights = match location {
            TrianglePointLocation::OnSolid => [1.0 / 3.0; 3],
            other => other.barycentric_coordinates().map_or([1.0 / 3.0; 3], |w| w.map(f64::from)),
        };
        let away = point - self.position(triangle, weights);
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

    /// Largest depth of the tool's samples that search for the nearest point (all but flats), m; 0 if all are outside.
    pub fn deepest(&self, tool: &Instrument) -> f64 {
        let sinks = |role: Role| !matches!(role, Role::Flat(_));
        let depth = |p: DVec3| -self.project(tool.at(p)).2;
        tool.samples.iter().filter(|s| sinks(s.role)).map(|s| depth(s.position)).fold(0.0, f64::max)
    }

    /// Weights of the point of a triangle nearest to a point.
    fn nearest_on(&self, triangle: usize, point: DVec3) -> [f64; 3] {
        let [a, b, c] = self.corners[triangle].map(|p| to_f32(p - self.origin));
        let (_, location) =
            Triangle::new(a, b, c).project_local_point_and_get_location(to_f32(point - self.origin), false);
        location.barycentric_coordinates().map_or([1.0 / 3.0; 3], |w| w.map(f64::from))
    }

    /// Triangles that may meet a box, in ascending order.
    pub fn near(&self, low: DVec3, high: DVec3) -> Vec<u32> {
        // corners are rounded to f32 relative to the origin of the patch, by at most half a millionth of its extent
        let slack = 1e-6 * f64::from(self.mesh.local_aabb().half_extents().max_element());
        let area = wider(&Aabb::new(to_f32(low - self.origin), to_f32(high - self.origin)), slack);
        let mut found: Vec<u32> = self.mesh.bvh().intersect_aabb(&area).collect();
        found.sort_unstable();
        found
    }
}

/// Contacts of one tool's samples with a patch of a deformable body. `travel` bounds a sample's motion in the step, m; `resistance` is that
/// of a cell's tissue; `retreat` the distance of a piece of edge behind the front of its cut, m, if it has cut.
pub fn contacts(
    (number, tool): (usize, &Instrument),
    (body, patch): (usize, &Patch),
    search: &Search,
    travel: f64,
    resistance: impl Fn(u32) -> Resistance,
    retreat: impl Fn(usize) -> Option<f64>,
    last: &Last,
) -> (Vec<Contact>, OfSamples) {
    let (mut out, mut sides) = (vec![], vec![]);
    for (index, sample) in tool.samples.iter().enumerate() {
        let point = tool.at(sample.position);
        let reach = search.alarm + travel;
        let found = match (sample.role, &tool.edge) {
            (Role::Edge { length, .. }, Some(edge)) if tool.sharp => {
                edge_contact(tool, edge, patch, point, length, reach, search, &resistance, retreat(index))
            }
            (Role::Flat(flat), Some(edge)) => flat_contact(tool, edge, patch, point, flat, travel, search, &resistance),
            _ => {
                let blunt = sample.role == Role::Point && tool.edge.is_none();
                let projection = if blunt { last.project(patch, index, point) } else { patch.project(point) };
                if blunt {
                    let near = projection.2 < reach + search.distance;
                    sides.push((index, near.then(|| Side::of(patch, point, projection))));
                }
                point_contact(patch, point, projection, tool.tip_radius, reach, search)
            }
        };
        let on_skin = |f: Found| {
            let contact = Contact::on_skin(number, index, body, f.material_point, f.point);
            Contact { axes: f.axes, gap: [f.gap, 0.0, 0.0], depth: f.depth, law: f.law, ..contact }
        };
        out.extend(found.map(on_skin));
    }
    (out, sides)
}

/// Contact of a sample, without the bodies.
struct Found {
    material_point: MaterialPoint,
    point: DVec3,
    axes: [DVec3; 3],
    gap: f64,
    depth: f64,
    law: Law,
}

/// Orthonormal frame: a normal and two tangents.
pub fn frame(normal: DVec3) -> [DVec3; 3] {
    let (t, s) = normal.any_orthonormal_pair();
    [normal, t, s]
}

/// Normal of a face times twice its area; of a triangle, whose last two corners are one, too.
fn area_normal([a, b, c, d]: [DVec3; 4]) -> DVec3 {
    (c - a).cross(d - b)
}

fn point_contact(
    patch: &Patch,
    point: DVec3,
    (triangle, weights, distance, normal): Projection,
    radius: f64,
    reach: f64,
    search: &Search,
) -> Option<Found> {
    let disc = patch.disc(triangle, weights, radius).filter(|disc| disc.normal.dot(normal) > 0.0);
    let (material_point, distance, normal) = match disc {
        Some(disc) => (disc.material_point, disc.normal.dot(point - disc.position), disc.normal),
        None => (patch.material_point(triangle, weights), distance, normal),
    };
    (distance < reach + search.distance).then(|| Found {
        material_point,
        point,
        axes: frame(normal),
        gap: distance - search.distance,
        depth: (-distance).max(0.0),
        law: Law::contact(search.friction),
    })
}

/// Cosine of 60°: a flat rests on walls turned to it by less; at grazing incidence the distance along the ray means nothing.
const FACING: f64 = 0.5;

impl Patch {
    /// Ray cast to the first wall, in f64; parry3d's tree finds the candidate triangles. First triangle along a ray within `reach`, if it
    /// faces the ray: triangle, weights, distance. `None` if the ray leaves the tissue first (it started inside) or meets the surface at
    /// grazing incidence.
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

impl Patch {
    /// Patch of faces at the present positions of their nodes, as [`Patch::new`]; `None` without faces. Triangles have no diagonal and stay
    /// whole.
    pub fn about_centres(faces: &[Face], position: impl Fn(u32) -> DVec3) -> Option<Self> {
        if faces.iter().any(Face::is_triangle) {
            return Self::new(faces, position);
        }
        let mut ids: Vec<u32> = faces.iter().flat_map(|q| q.nodes).collect();
        ids.sort_unstable();
        ids.dedup();
        let origin = position(*ids.first()?);
        let local = |id: u32| ids.binary_search(&id).unwrap_or(0) as u32;
        let mut points: Vec<DVec3> = ids.iter().map(|id| position(*id)).collect();
        let (mut indices, mut corners, mut quarters) = (vec![], vec![], vec![]);
        for face in faces {
            let own = face.nodes.map(&position);
            let shares = centre(own);
            let middle = own.iter().zip(shares).map(|(p, share)| *p * share).sum();
            for (k, next) in (0..4).map(|k| (k, (k + 1) % 4)) {
                indices.push([local(face.nodes[k]), local(face.nodes[next]), points.len() as u32]);
                corners.push([own[k], own[next], middle]);
            }
            points.push(middle);
            quarters.push((face.nodes, shares));
        }
        let vertices = points.into_iter().map(|p| to_f32(p - origin)).collect();
        let mesh = TriMesh::with_flags(vertices, indices, TriMeshFlags::ORIENTED).ok()?;
        let cells = faces.iter().flat_map(|q| [q.cell; 4]).collect();
        let walls = faces.iter().flat_map(|q| [q.wall; 4]).collect();
        Some(Self { mesh, ids, triangles: vec![], quarters, cells, walls, corners, origin })
    }

    /// Material point of a triangle with these weights.
    pub fn material_point(&self, triangle: usize, weights: [f64; 3]) -> MaterialPoint {
        match self.quarters.get(triangle / 4) {
            Some((nodes, shares)) => {
                // a quarter of the face: two corners and the centre
                let ([u, v, w], quarter) = (weights, triangle % 4);
                let mut weights = shares.map(|share| share * w);
                weights[quarter] += u;
                weights[(quarter + 1) % 4] += v;
                MaterialPoint::of(*nodes, weights)
            }
            None => MaterialPoint::of(self.triangles[triangle], weights),
        }
    }
}

/// Resistance of tissue to a blade.
#[derive(Clone, Copy, Debug)]
pub struct Resistance {
    /// Force per length of edge at which the tissue is cut, N/m.
    pub edge: f64,
    /// Force per length of a flat, over the root of the flat's distance from the edge, at which the tissue splits ahead of the edge,
    /// N/m^1.5.
    pub splitting: f64,
    /// Cell width along the surface, m: within it of the front a cut's walls do not open as those of a sharp crack.
    pub cell: f64,
}

/// Cosine with the blade's normal above which a wall belongs to the flats, not to the edge.
const SIDEWAYS: f64 = 0.7;

fn edge_contact(
    tool: &Instrument,
    edge: &Edge,
    patch: &Patch,
    point: DVec3,
    length: f64,
    reach: f64,
    search: &Search,
    resistance: &impl Fn(u32) -> Resistance,
    retreat: Option<f64>,
) -> Option<Found> {
    let (triangle, weights, distance, normal) = patch.project(point);
    if distance >= reach {
        return None;
    }
    let bound = resistance(patch.cells[triangle]).edge * length;
    let [forward, along, side] = [edge.forward, edge.along, edge.normal].map(|a| tool.rotation * a);
    let base = Found {
        material_point: patch.material_point(triangle, weights),
        point,
        axes: [-forward, along, side],
        gap: 0.0,
        depth: (-distance).max(0.0),
        law: Law::Cut { radius: bound },
    };
    let in_wound = distance <= 0.0 || patch.walls[triangle];
    match retreat.filter(|_| in_wound) {
        // back in its own cut: free up to the front
        Some(retreat) => return (retreat < reach).then_some(Found { gap: retreat, ..base }),
        // inside: held by the tissue where it is
        None if distance <= 0.0 => return Some(base),
        None => {}
    }
    if normal.dot(side).abs() > SIDEWAYS || normal.dot(forward) > 0.0 {
        return None; // beside or behind the edge
    }
    let law = Law::Coulomb { friction: search.friction, bound };
    Some(Found { axes: frame(normal), gap: distance, law, ..base })
}

/// Growth of a blade's half thickness per length behind its edge: a scalpel's included bevel angle of 28°.
const BEVEL: f64 = 0.25;

/// Contact of a flat with the first wall that faces it.
///
/// The half thickness is what the bevel reaches at the flat's distance behind the edge, less a cell: within a cell of its front a cut opens
/// as the grid lets it, not as a sharp crack. (With the whole bevel, walls of cells of 0.83 mm that had just separated took another 0.11 N
/// of 0.28, those of 0.56 mm 0.07 N, for a step or two each.) Walls are pushed no faster than the bevel opens them as the blade advances: a
/// cut opens by a whole cell at once. Their force is at most what would split the tissue ahead of the edge. A wall that has passed the
/// blade's middle plane is released. (Following it from step to step threw the blade in 5 of 12 random cuts right through: walls of a fresh
/// cut stand anywhere, and one that has passed pulls the two flats against each other.)
fn flat_contact(
    tool: &Instrument,
    edge: &Edge,
    patch: &Patch,
    point: DVec3,
    flat: Flat,
    travel: f64,
    search: &Search,
    resistance: &impl Fn(u32) -> Resistance,
) -> Option<Found> {
    let direction = tool.rotation * edge.normal * flat.side;
    let reach = edge.half_thickness + search.alarm + travel + search.distance;
    let (triangle, weights, distance) = patch.cast(point, direction, reach)?;
    let tissue = resistance(patch.cells[triangle]);
    let half_thickness = edge.half_thickness.min(BEVEL * (flat.behind - tissue.cell).max(0.0));
    let gap = distance - half_thickness - search.distance;
    let bound = tissue.splitting * flat.behind.sqrt() * flat.length;
    Some(Found {
        material_point: patch.material_point(triangle, weights),
        point: point + direction * half_thickness,
        axes: frame(-direction),
        gap: gap.max(-BEVEL * travel),
        depth: 0.0,
        law: Law::Coulomb { friction: search.friction, bound },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn above_a_quad_with_a_reflex_corner_is_outside() {
        let corners = [[0.0, 3.0], [-3.0, -3.0], [0.0, 2.0], [3.0, -3.0]].map(|[x, y]| DVec3::new(x, y, 0.0));
        let face = Face { nodes: [0, 1, 2, 3], cell: 0, wall: false };
        // its mean lies in the notch
        assert_eq!(centre(corners), [0.5, 0.0, 0.5, 0.0]);
        assert_eq!(centre([corners[1], corners[2], corners[3], corners[0]]), [0.0, 0.5, 0.0, 0.5]);
        assert_eq!(centre([DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y]), [0.25; 4], "the counter-test");
        let position = |id: u32| corners[id as usize];
        for patch in [Patch::about_centres(&[face], position), Patch::new(&[face], position)] {
            let patch = patch.expect("it has a face");
            for (at, inside) in [([0.0, 0.0, 0.5], false), ([0.0, 2.5, 0.5], false), ([0.0, 2.5, -0.5], true)] {
                assert_eq!(patch.project(DVec3::from_array(at)).2 < 0.0, inside, "{at:?}");
            }
        }
    }
}
