//! Contacts of spheres and capsules with the skin's surface points.
//!
//! Surface points: the corners of each face, the middles of its edges and its centre (on the diagonal of its triangles), so half a cell
//! apart, each once. For a point `p` and the tool's axis `a`, radius R: `n = (a − p)/|a − p|`, gap `n·(a − p) − R`, negative when the
//! point is inside the tool. Between the points the skin is held by one more contact per axis sample, at the nearest place of the faces.
//!
//! Continuous: along the tool's motion s of the step, `a(t) = a + t s`, the first t with `|a(t) − p| = R` is looked for by conservative
//! advancement (Mirtich 1996: no step is longer than the clearance). Normal and place on the axis are taken there, the gap of that plane
//! at the step's start. Inside and outside are told at the step's start, never from where the motion would end: a tool that would be
//! through the skin by then is stopped on the side that it came from. A tool whose axis starts inside the skin is pushed out along
//! the normal of the nearest surface.
//! Units: m.

use super::{Contact, Patch, Search, frame};
use crate::constraints::Law;
use crate::instrument::{Free, Instrument, Role};
use crate::mesh::Quad;
use crate::scene::{Filter, Round};
use glam::DVec3;
use std::collections::BTreeMap;

/// Shortest step of the advancement, radii: how deep the first touch may be found. Shorter ones take more steps past near misses.
const SHORTEST: f64 = 0.01;
/// Steps of the advancement at most; a near miss that takes more is treated as it was found until then.
const MOST_STEPS: u32 = 128;
/// Points whose surface is turned from the tool (cosine) are not touched: the far side of the skin, or of a wound.
const FACING: f64 = 0.1;
/// Nearest places closer than this to a surface point, radii, add nothing to it.
const SAME: f64 = 1e-3;

/// The tool's axis at the step's start and its motion.
struct Sweep {
    ends: [DVec3; 2],
    shift: DVec3,
    radius: f64,
}

/// A touch: unit normal from skin to tool, place of the axis at the step's start, gap there.
struct Touch {
    normal: DVec3,
    axis: DVec3,
    gap: f64,
}

/// A place of the skin as nodes and weights.
type Spot = ([u32; 3], [f64; 3]);

/// Where an axis sample first touches: number of the sample, spot, touch, place.
type Nearest = (usize, Spot, Touch, DVec3);

impl Sweep {
    fn new(tool: &Instrument, round: &Round, free: &Free) -> Self {
        let ends = round.ends.map(|end| tool.at(DVec3::from_array(end)));
        let middle = (ends[0] + ends[1]) * 0.5;
        let shift = free.shift + free.turn.cross(middle - tool.position);
        Self { ends, shift, radius: round.radius }
    }

    /// Nearest place of the axis, before the motion.
    fn nearest(&self, p: DVec3) -> DVec3 {
        let [a, b] = self.ends;
        let line = b - a;
        let squared = line.length_squared();
        let s = if squared > 0.0 { ((p - a).dot(line) / squared).clamp(0.0, 1.0) } else { 0.0 };
        a + line * s
    }

    /// The smallest clearance until the first touch, with what `at` (share of the motion → clearance and more) gave there.
    fn advance<T>(&self, at: impl Fn(f64) -> (f64, T)) -> (f64, T) {
        let length = self.shift.length();
        let mut best = at(0.0);
        let (mut clear, mut t) = (best.0, 0.0);
        for _ in 0..MOST_STEPS {
            t += clear.max(SHORTEST * self.radius) / length;
            if clear <= 0.0 || t > 1.0 || length == 0.0 {
                break;
            }
            let next = at(t);
            clear = next.0;
            if clear < best.0 {
                best = next;
            }
        }
        best
    }

    /// How the tool meets a surface point, when it comes within `reach`.
    fn meets(&self, p: DVec3, reach: f64) -> Option<Touch> {
        let (clear, (axis, away)) = self.advance(|t| {
            let axis = self.nearest(p - self.shift * t);
            let away = axis + self.shift * t - p;
            (away.length() - self.radius, (axis, away))
        });
        let normal = away.try_normalize().filter(|_| clear < reach)?;
        let outside = self.nearest(p).distance(p) >= self.radius;
        let gap = normal.dot(axis - p) - self.radius;
        // past the nearest approach the plane may lie behind the start by a step of the advancement
        Some(Touch { normal, axis, gap: if outside { gap.max(0.0) } else { gap } })
    }

    /// How far a surface point is inside a tool that is itself inside the skin, along the way out.
    fn buries(&self, p: DVec3, out: DVec3) -> Option<Touch> {
        let axis = self.nearest(p);
        let away = axis - p;
        let height = away.dot(out);
        let squared = self.radius * self.radius - (away - out * height).length_squared();
        (squared > 0.0).then(|| Touch { normal: out, axis, gap: height - squared.sqrt() })
    }
}

/// Surface points of faces: their two nodes (the same twice for a corner) and outward direction, not of unit length.
fn surface_points(faces: &[Quad], position: &impl Fn(u32) -> DVec3) -> BTreeMap<(u32, u32), DVec3> {
    let mut points: BTreeMap<(u32, u32), DVec3> = BTreeMap::new();
    for face in faces {
        let [a, b, c, d] = face.nodes;
        let outward = (position(c) - position(a)).cross(position(d) - position(b));
        for (i, j) in [(a, a), (b, b), (c, c), (d, d), (a, b), (b, c), (c, d), (d, a), (a, c)] {
            *points.entry((i.min(j), i.max(j))).or_default() += outward;
        }
    }
    points
}

/// Number of a surface point among a tool's contacts, after those of its own samples.
fn point_id(tool: &Instrument, i: u32, j: u32) -> usize {
    tool.samples.len() + ((i as usize) << 32 | j as usize)
}

/// Contacts of one round tool with the faces near it, of which `patch` is made; `position` says where a node is now.
pub fn contacts(
    (number, tool): (usize, &Instrument),
    round: &Round,
    (body, patch): (usize, &Patch),
    faces: &[Quad],
    position: &impl Fn(u32) -> DVec3,
    search: &Search,
    free: &Free,
) -> Vec<Contact> {
    let sweep = Sweep::new(tool, round, free);
    let reach = search.alarm + search.distance;
    let (nearest, out) = nearest_places(tool, patch, &sweep, reach);
    let made = |index: usize, (nodes, weights): Spot, touch: &Touch| {
        let point = touch.axis - touch.normal * sweep.radius;
        let contact = Contact::on_skin(number, index, body, super::Spot { nodes, weights }, point);
        let law = Law::Coulomb { friction: search.friction, bound: f64::INFINITY };
        Contact { axes: frame(touch.normal), gap: [touch.gap - search.distance, 0.0, 0.0], law, ..contact }
    };
    if search.filter == Filter::One {
        let deepest = nearest.iter().min_by(|a, b| a.2.gap.total_cmp(&b.2.gap));
        return deepest.map(|(index, spot, touch, _)| made(*index, *spot, touch)).into_iter().collect();
    }
    let mut found = vec![];
    let mut places = vec![];
    for ((i, j), outward) in surface_points(faces, position) {
        let p = (position(i) + position(j)) * 0.5;
        let touch = match out {
            Some(out) => sweep.buries(p, out),
            None => sweep.meets(p, reach),
        };
        if let Some(touch) = touch.filter(|t| t.normal.dot(outward) > FACING * outward.length()) {
            found.push(made(point_id(tool, i, j), ([i, j, j], [0.5, 0.5, 0.0]), &touch));
            places.push(p);
        }
    }
    for (index, spot, touch, place) in &nearest {
        if places.iter().all(|p| p.distance(*place) > SAME * sweep.radius) {
            found.push(made(*index, *spot, touch));
            places.push(*place);
        }
    }
    found
}

/// For each axis sample the place of the skin that it first touches, or comes nearest to. And the way out when a sample starts
/// inside the skin: the normal at the place nearest to the deepest one.
fn nearest_places(tool: &Instrument, patch: &Patch, sweep: &Sweep, reach: f64) -> (Vec<Nearest>, Option<DVec3>) {
    let mut found = vec![];
    let mut deepest: Option<(f64, DVec3)> = None;
    for (index, sample) in tool.samples.iter().enumerate().filter(|(_, s)| s.role == Role::Axis) {
        let axis = tool.at(sample.position);
        let (clear, (triangle, weights, normal)) = sweep.advance(|t| {
            let (triangle, weights, distance, normal) = patch.project(axis + sweep.shift * t);
            (distance - sweep.radius, (triangle, weights, normal))
        });
        if clear >= reach {
            continue;
        }
        let outside = patch.project(axis).2;
        if outside < 0.0 && deepest.is_none_or(|(depth, _)| outside < depth) {
            deepest = Some((outside, normal));
        }
        let place = patch.place(triangle, weights);
        let gap = normal.dot(axis - place) - sweep.radius;
        let gap = if outside >= sweep.radius { gap.max(0.0) } else { gap };
        found.push((index, (patch.triangles[triangle], weights), Touch { normal, axis, gap }, place));
    }
    (found, deepest.map(|d| d.1))
}
