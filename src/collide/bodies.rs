//! Contacts of rigid bodies with walls and with each other, and of deformable bodies with walls and with each other.
//!
//! Wall: corners, points and sphere centres of a rigid body, nodes of a deformable one, gap `n·(p − q)`. Rigid bodies: their convex parts
//! ([`super::convex`]). Deformable bodies: nodes of one against faces of the other, both ways; where two nodes meet, once. Edges that cross:
//! [`super::edges`].
//! Units: m.

use super::convex::{self, Cuboid, Point};
use super::edges::BESIDE;
use super::{Contact, Patch, Search, area_normal};
use crate::bodies::rigid::{Instrument, Role};
use crate::mesh::Face;
use crate::mesh::MaterialPoint;
use crate::scene::{BodyId, Plane};
use glam::DVec3;
use std::collections::BTreeMap;

/// Cosine below which faces do not face each other: the sides of two blocks stacked on each other do not touch.
const FACING: f64 = 0.1;

/// Contacts of a rigid body with a wall; `travel` bounds a sample's motion in the step, m.
pub fn with_plane(
    (number, tool): (usize, &Instrument),
    (wall, plane): (usize, &Plane),
    search: &Search,
    travel: f64,
) -> Vec<Contact> {
    let (through, normal) = (DVec3::from_array(plane.through), DVec3::from_array(plane.normal));
    let on = [BodyId::Rigid(number), BodyId::Plane(wall)];
    let sample = |(index, sample): (usize, &crate::bodies::rigid::Sample)| {
        let radius = match sample.role {
            Role::Axis => tool.round.map_or(0.0, |round| round.radius),
            Role::Point => tool.lines.as_ref().map_or(0.0, |lines| lines.radius),
            Role::Corner | Role::Edge { .. } => 0.0,
            Role::Flat(_) => return None,
        };
        let point = tool.at(sample.position) - normal * radius;
        let gap = normal.dot(point - through);
        (gap < search.alarm + search.distance + travel).then(|| Contact::between(on, index, point, normal, gap, search))
    };
    tool.samples.iter().enumerate().filter_map(sample).collect()
}

/// Contacts of two rigid bodies by their parts: spheres, capsules, boxes, segments and points of lines, points of a tool and of an edge.
/// Parts of one body never touch each other.
pub fn between_rigid(
    (first, a): (usize, &Instrument),
    (second, b): (usize, &Instrument),
    search: &Search,
    travel: f64,
) -> Vec<Contact> {
    let on = [BodyId::Rigid(first), BodyId::Rigid(second)];
    let reach = search.alarm + search.distance + travel;
    if a.position.distance(b.position) > a.span() + b.span() + reach {
        return vec![];
    }
    let (mut out, mut feature) = (vec![], 0);
    let others = parts(b);
    for part in parts(a) {
        for other in &others {
            feature += MAX_POINTS;
            for (k, (point, normal, gap)) in meet(&part, other, reach).into_iter().enumerate() {
                if gap < reach {
                    out.push(Contact::between(on, feature + k, point, normal, gap, search));
                }
            }
        }
    }
    out
}

/// Feature numbers per pair of parts, one for each contact point, of which two faces have eight at most.
const MAX_POINTS: usize = 64;

/// Convex part of a rigid body, in the world.
enum Part {
    Box(Cuboid),
    /// Ends of the axis and radius, m; a point has both ends alike.
    Round([DVec3; 2], f64),
}

fn parts(body: &Instrument) -> Vec<Part> {
    let round = |ends: [DVec3; 2], radius: f64| Part::Round(ends.map(|end| body.at(end)), radius);
    if let Some(cuboid) = Cuboid::of(body) {
        return vec![Part::Box(cuboid)];
    }
    if let Some(of) = &body.round {
        return vec![round(of.ends.map(DVec3::from_array), of.radius)];
    }
    let Some(lines) = &body.lines else {
        let points = body.samples.iter().filter(|s| matches!(s.role, Role::Point | Role::Edge { .. }));
        return points.map(|s| round([s.position; 2], 0.0)).collect();
    };
    let at = |vertex: u32| DVec3::from_array(lines.positions[vertex as usize]);
    let alone = |vertex: &u32| lines.segments.iter().all(|ends| !ends.contains(vertex));
    let points = (0..lines.positions.len() as u32).filter(alone).map(|v| round([at(v); 2], lines.radius));
    lines.segments.iter().map(|ends| round(ends.map(at), lines.radius)).chain(points).collect()
}

/// Contact points of two parts within reach, each with the normal towards the first and the gap.
fn meet(part: &Part, other: &Part, reach: f64) -> Vec<Point> {
    let (found, radii) = match (part, other) {
        (Part::Box(a), Part::Box(b)) => (convex::boxes(a, b, reach), [0.0; 2]),
        (Part::Round(ends, radius), Part::Box(b)) => (convex::segment_on_box(*ends, b), [*radius, 0.0]),
        (Part::Box(a), Part::Round(ends, radius)) => {
            let found = convex::segment_on_box(*ends, a);
            (found.into_iter().map(|(point, normal, gap)| (point, -normal, gap)).collect(), [0.0, *radius])
        }
        (Part::Round(ends, radius), Part::Round(others, more)) => (convex::segments(*ends, *others), [*radius, *more]),
    };
    // half way between the surfaces
    let grown = |(point, normal, gap): Point| {
        (point + normal * (0.5 * (radii[1] - radii[0])), normal, gap - radii[0] - radii[1])
    };
    found.into_iter().map(grown).collect()
}

/// Nodes of faces with outward directions, not of unit length.
fn nodes(faces: &[Face], position: &impl Fn(u32) -> DVec3) -> BTreeMap<u32, DVec3> {
    let mut out: BTreeMap<u32, DVec3> = BTreeMap::new();
    for face in faces {
        let outward = area_normal(face.nodes.map(position));
        for node in face.corners() {
            *out.entry(*node).or_default() += outward;
        }
    }
    out
}

/// Contacts of a deformable body's faces with a wall.
pub fn skin_on_plane(
    (number, faces): (usize, &[Face]),
    position: &impl Fn(u32) -> DVec3,
    (wall, plane): (usize, &Plane),
    search: &Search,
) -> Vec<Contact> {
    let (through, normal) = (DVec3::from_array(plane.through), DVec3::from_array(plane.normal));
    let on = [BodyId::Deformable(number), BodyId::Plane(wall)];
    let mut out = vec![];
    for (node, _) in nodes(faces, position) {
        let point = position(node);
        let gap = normal.dot(point - through);
        if gap < search.alarm + search.distance {
            let found = Contact::between(on, node as usize, point, normal, gap, search);
            out.push(Contact { points: [MaterialPoint::node(node), MaterialPoint::default()], ..found });
        }
    }
    out
}

/// Contacts of a deformable body's nodes with the faces of a box, for nodes over a face or inside; none if the tool is no box.
pub fn skin_on_box(
    (number, faces): (usize, &[Face]),
    position: &impl Fn(u32) -> DVec3,
    (rigid, tool): (usize, &Instrument),
    search: &Search,
    travel: f64,
) -> Vec<Contact> {
    let Some(half) = tool.cuboid else { return vec![] };
    let on = [BodyId::Rigid(rigid), BodyId::Deformable(number)];
    let mut out = vec![];
    for (node, outward) in nodes(faces, position) {
        let point = position(node);
        let local = tool.rotation.inverse() * (point - tool.position);
        let out_of = local.abs() - half; // distance beyond each pair of faces
        let slack = BESIDE * outward.length().sqrt(); // by about the length of its edges
        // the face that it is farthest out of, of those that it faces
        let mut axes = [0, 1, 2];
        axes.sort_by(|a, b| out_of[*b].total_cmp(&out_of[*a]));
        let normal = |axis: usize| -(tool.rotation * (DVec3::AXES[axis] * local[axis].signum()));
        let over = |axis: &usize| {
            let beside = (0..3).any(|n| n != *axis && out_of[n] > slack);
            !beside && normal(*axis).dot(outward) > FACING * outward.length()
        };
        let Some(axis) = axes.into_iter().find(over) else { continue };
        if out_of[axis] < search.alarm + search.distance + travel {
            // numbered after the box's own corners
            let found =
                Contact::between(on, tool.samples.len() + node as usize, point, normal(axis), out_of[axis], search);
            out.push(Contact { points: [MaterialPoint::default(), MaterialPoint::node(node)], ..found });
        }
    }
    out
}

/// Contacts of the first body's nodes with the second's faces; nodes within `same` of a point of `skip` are omitted.
pub fn skin_on_skin(
    (first, faces, position): (usize, &[Face], &impl Fn(u32) -> DVec3),
    (second, patch): (usize, &Patch),
    search: &Search,
    skip: &[DVec3],
    same: f64,
) -> Vec<Contact> {
    let on = [BodyId::Deformable(first), BodyId::Deformable(second)];
    let mut out = vec![];
    for (node, outward) in nodes(faces, position) {
        let point = position(node);
        let (triangle, weights, distance, _) = patch.project(point);
        // the face's own normal: at a rim the vector from the nearest point to the node may lie along the face
        let normal = patch.face_normal(triangle);
        if distance >= search.alarm + search.distance || normal.dot(outward) > -FACING * outward.length() {
            continue;
        }
        let nearest = patch.position(triangle, weights);
        let beside = (point - nearest) - normal * normal.dot(point - nearest);
        let slack = same.max(BESIDE * outward.length().sqrt()); // by about the length of its edges
        if beside.length() > slack || skip.iter().any(|p| p.distance(point) < same) {
            continue; // over the rim, or a node of the other body is here
        }
        let found = Contact::between(on, node as usize, point, normal, normal.dot(point - nearest), search);
        out.push(Contact { points: [MaterialPoint::node(node), patch.material_point(triangle, weights)], ..found });
    }
    out
}
