//! Contacts of tools made of points and straight segments with the skin's vertices, edges and triangles.
//!
//! A pair is the nearest points P on a feature of the tool and Q on one of the skin: point–vertex, point–edge, point–triangle,
//! segment–vertex, segment–edge. It is kept when both lie strictly inside their features and |PQ| is below the alarm distance (plus the
//! tool's radius), and, with `filter = "cones"`, when the direction is in the normal cones of both features ([`cones`]): local minima of
//! the distance. With `filter = "points"` every pair within reach is kept whose skin feature faces the tool.
//! Source: Johnson, Willemsen 2003, and SOFA's LocalMinDistance, whose pairs and cones these are. Three things differ:
//!
//! - Signed. LocalMinDistance has no inside: a tool behind the surface loses its contacts. Here a point inside is pushed out along the
//!   normal of the nearest surface (inside by [`super::sides`]). A segment below an edge or vertex is the mirrored problem: the same
//!   pair with reversed normal, if the tool's point is inside and the pair about as near as the surface. A stretch of a segment between two
//!   triangles that it pierces has one contact, at its middle, if no pair holds it.
//! - Touching. Below a hundredth of the alarm distance PQ has no direction: a point takes the mean normal of the vertex, edge or triangle
//!   that it rests on, a segment the normal across both lines (`e × s`). A tool at rest thus keeps its contacts whatever the rounding.
//! - Continuous. All ends move by their unconstrained motion of the step. A pair is evaluated where it first touches or comes nearest,
//!   found by conservative advancement (Mirtich 1996); its gap is that of the plane there at the start of the step. A point on a face that
//!   may slide along it into a rising face is held by the planes of both, although the second is no local minimum yet.
//!
//! Triangles near a tool feature come from parry3d's bounding-box tree; all else is in f64. Units: m.

pub mod closest;
pub mod cones;

use super::sides::{Last, OfSamples, Projection, Side};
use super::{Contact, Patch, Search, frame};
use crate::bodies::rigid::{Instrument, UnconstrainedMotion};
use crate::constraints::Law;
use crate::mesh::MaterialPoint;
use crate::scene::{Filter, Lines};
use closest::Near;
use cones::{Cone, Feature, Features};
use glam::DVec3;

/// Share of the alarm distance below which a pair touches: 2 µm in most scenes, above the gap that a step leaves at rest (0.1 µm). If
/// larger, contacts at rest take a mean normal where a face has its own. If smaller, a point at rest on a dimpled vertex has a contact with
/// each face around it at one point, more than determine friction there (sweeps of the contact law then do not converge).
const TOUCH: f64 = 1e-2;
/// Most advancement steps; a near miss that takes more keeps the nearest approach found so far.
const MOST_STEPS: u32 = 64;
/// Largest distance of a pair inside the skin, as a multiple of the depth: its normal leans from the surface's by at most 48°. With more, a
/// tool just below the top would be pushed through the bottom.
const DEEPER: f64 = 1.5;
/// Cosine (of 2.6°) above which the normals of pairs at one point make them one contact.
const ALIKE: f64 = 0.999;

/// Point (both ends alike) or segment of the tool at the start of the step, with the motion of its ends.
struct Piece {
    ends: [DVec3; 2],
    motion: [DVec3; 2],
    point: bool,
    /// Number of the tool's point at its first end.
    first: usize,
    cone: Cone,
}

impl Piece {
    fn at(&self, t: f64) -> [DVec3; 2] {
        [0, 1].map(|k| self.ends[k] + self.motion[k] * t)
    }
    fn travel(&self) -> f64 {
        self.motion[0].length().max(self.motion[1].length())
    }
    fn point_at(&self, u: f64) -> DVec3 {
        self.ends[0].lerp(self.ends[1], u)
    }
}

/// Contact pair.
struct Pair {
    /// Nodes and weights of the point on the skin.
    surface_point: ([u32; 3], [f64; 3]),
    /// Parameter of the point on the tool's segment.
    u: f64,
    on_tool: DVec3,
    on_skin: DVec3,
    normal: DVec3,
    gap: f64,
    /// Has friction.
    frictional: bool,
}

/// Low bits of a contact's feature number, which name the point or segment of the tool; the high bits count its contacts.
const PIECE_BITS: u32 = 32;
const PIECE: usize = (1 << PIECE_BITS) - 1;

/// Search of one tool and one patch.
struct PairSearch<'a> {
    patch: &'a Patch,
    features: Features,
    search: &'a Search,
    radius: f64,
    touch: f64,
    /// `[point of the tool]` its projection, by the side that it was on.
    points: Vec<Projection>,
}

/// Contacts of one tool with a patch, and the sides that its points are on.
pub fn contacts(
    tool: (usize, &Instrument),
    lines: &Lines,
    skin: (usize, &Patch),
    search: &Search,
    free: &UnconstrainedMotion,
    last: &Last,
) -> (Vec<Contact>, OfSamples) {
    contacts_among(tool, lines, skin, search, free, last, &|low, high| skin.1.near(low, high))
}

/// The same with another search for the triangles that meet a box.
pub fn contacts_among(
    (number, tool): (usize, &Instrument),
    lines: &Lines,
    (body, patch): (usize, &Patch),
    search: &Search,
    free: &UnconstrainedMotion,
    last: &Last,
    near: &dyn Fn(DVec3, DVec3) -> Vec<u32>,
) -> (Vec<Contact>, OfSamples) {
    let touch = TOUCH * search.alarm;
    let pieces = pieces(tool, lines, free);
    // sides of the points
    let of_points = pieces.iter().filter(|piece| piece.point).enumerate();
    let points: Vec<Projection> =
        of_points.clone().map(|(index, piece)| last.project(patch, index, piece.ends[0])).collect();
    let margin = search.alarm + search.distance + lines.radius + 2.0 * touch;
    let side = |(index, piece): (usize, &Piece)| {
        let near = points[index].2 < margin + piece.travel();
        (index, near.then(|| Side::of(patch, piece.ends[0], points[index])))
    };
    let sides = of_points.map(side).collect();
    let pairs = PairSearch { patch, features: Features::new(patch), search, radius: lines.radius, touch, points };
    let mut kept: Vec<(usize, Pair)> = vec![];
    // pairs of every point and segment, from the triangles around its motion
    for (index, piece) in pieces.iter().enumerate() {
        let corners = [piece.at(0.0), piece.at(1.0)].concat();
        let low = corners.iter().fold(DVec3::INFINITY, |low, p| low.min(*p)) - DVec3::splat(margin);
        let high = corners.iter().fold(DVec3::NEG_INFINITY, |high, p| high.max(*p)) + DVec3::splat(margin);
        let triangles = near(low, high);
        let found = if piece.point { pairs.point(piece, &triangles) } else { pairs.segment(piece, &triangles) };
        kept.extend(found.into_iter().map(|pair| (index, pair)));
    }
    kept.sort_by_key(|(_, pair)| !pair.frictional); // of two pairs at one point the one with friction is kept
    // contacts, one per point and normal
    let mut out: Vec<(Contact, DVec3)> = vec![];
    for (index, pair) in kept {
        let point = pair.on_tool - pair.normal * lines.radius;
        let same = |(other, on_skin): &(Contact, DVec3)| {
            other.point.distance(point) <= touch
                && on_skin.distance(pair.on_skin) <= touch
                && other.axes[0].dot(pair.normal) > ALIKE
        };
        if out.iter().any(same) {
            continue;
        }
        let material_point = MaterialPoint::of(pair.surface_point.0, pair.surface_point.1);
        let earlier = out.iter().filter(|(c, _)| c.feature & PIECE == index).count();
        let contact = Contact {
            axes: frame(pair.normal),
            gap: [pair.gap - search.distance, 0.0, 0.0],
            depth: (-pair.gap).max(0.0),
            law: Law::contact(if pair.frictional { search.friction } else { 0.0 }),
            ..Contact::on_skin(number, index | earlier << PIECE_BITS, body, material_point, point)
        };
        out.push((contact, pair.on_skin));
    }
    (out.into_iter().map(|(contact, _)| contact).collect(), sides)
}

/// Points, then segments, with their motion.
fn pieces(tool: &Instrument, lines: &Lines, free: &UnconstrainedMotion) -> Vec<Piece> {
    let positions: Vec<DVec3> = lines.positions.iter().map(|p| tool.at(DVec3::from_array(*p))).collect();
    let motion = |p: DVec3| free.translation + free.rotation.cross(p - tool.position);
    let piece = |ends: [DVec3; 2], point: bool, first: usize, cone: Cone| Piece {
        ends,
        motion: ends.map(motion),
        point,
        first,
        cone,
    };
    let mut cones = vec![Cone::default(); positions.len()];
    for [a, b] in lines.segments.iter().map(|ends| ends.map(|id| id as usize)) {
        let along = (positions[b] - positions[a]).normalize_or_zero();
        cones[a].outward.push(-along);
        cones[b].outward.push(along);
    }
    let points =
        positions.iter().zip(cones).enumerate().map(|(k, (position, cone))| piece([*position; 2], true, k, cone));
    let segment = |s: &[u32; 2]| piece(s.map(|id| positions[id as usize]), false, s[0] as usize, Cone::default());
    let segments = lines.segments.iter().map(segment);
    points.chain(segments).collect()
}

impl PairSearch<'_> {
    /// Pairs of a tool's point: what it rests on and other local minima; if inside, the way out.
    fn point(&self, piece: &Piece, triangles: &[u32]) -> Vec<Pair> {
        let (p, projection) = (piece.ends[0], self.points[piece.first]);
        let features = || self.features.of(triangles).into_iter().map(|id| &self.features.all[id]);
        let rests = features().find_map(|feature| self.rests(piece, feature));
        let mut found: Vec<Pair> = match rests.is_none() && projection.2 < 0.0 {
            true => self.push_out(p, 0.0, projection).into_iter().collect(),
            false => rests.into_iter().chain(features().filter_map(|feature| self.meets(piece, feature))).collect(),
        };
        let walls: Vec<Pair> = found.iter().flat_map(|pair| self.walls(pair, piece.motion[0])).collect();
        found.extend(walls);
        found
    }

    /// Frictionless pairs with the faces that rise around a pair on a face, within the step's tangential motion: a point that slides along
    /// its own face would pass through them. On an edge or vertex the mean normal stands for them; it depends on theirs, so forces would be
    /// undetermined.
    fn walls(&self, pair: &Pair, motion: DVec3) -> Vec<Pair> {
        let reach = motion.reject_from(pair.normal).length().min(self.search.alarm) + self.touch;
        let used: Vec<u32> =
            (0..3).filter(|k| pair.surface_point.1[*k] > closest::MARGIN).map(|k| pair.surface_point.0[k]).collect();
        let mut walls = vec![];
        if used.len() < 3 {
            return walls;
        }
        for face in self.features.faces_at(&used) {
            let normal = face.cone.normal;
            let high = normal.dot(pair.on_skin - face.positions[0]);
            let rises = face.positions.iter().all(|c| pair.normal.dot(*c - pair.on_skin) > -self.touch);
            let steep = normal != DVec3::ZERO && normal.dot(pair.normal) < ALIKE;
            if rises && steep && high > -self.touch && high < reach {
                let near = closest::point_face(pair.on_skin, [face.positions[0], face.positions[1], face.positions[2]]);
                let on_skin = face.position(near.weights);
                let gap = normal.dot(pair.on_tool - on_skin) - self.radius;
                let surface_point = face.surface_point(near.weights);
                walls.push(Pair {
                    surface_point,
                    u: pair.u,
                    on_tool: pair.on_tool,
                    on_skin,
                    normal,
                    gap,
                    frictional: false,
                });
            }
        }
        walls
    }

    /// Pair of a point with a feature that it touches, vertices before edges before faces. One is enough, since the surface around it
    /// moves with it.
    fn rests(&self, piece: &Piece, feature: &Feature) -> Option<Pair> {
        let near = feature.near(piece.ends, piece.point)?;
        let normal = feature.cone.normal;
        let rests = near.away.length() <= self.touch && normal != DVec3::ZERO;
        rests.then(|| self.pair(piece, feature, &near, normal))
    }

    /// Pairs of a tool's segment, and one for each stretch inside the skin without any.
    fn segment(&self, piece: &Piece, triangles: &[u32]) -> Vec<Pair> {
        let features = self.features.of(triangles).into_iter().map(|id| &self.features.all[id]);
        let mut found: Vec<Pair> = features.filter_map(|feature| self.meets(piece, feature)).collect();
        // where the segment enters and leaves the skin
        let corners = triangles.iter().map(|t| self.patch.corners[*t as usize]);
        let mut hits: Vec<(f64, bool)> = corners.filter_map(|c| closest::pierces(piece.ends, c)).collect();
        hits.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut entered = None;
        for (u, inward) in hits {
            if inward {
                entered = entered.or(Some(u));
            } else if let Some(start) = entered.take() {
                // a stretch that reaches an end of the segment is held at that end, a point of its own
                let middle = 0.5 * (start + u);
                if !found.iter().any(|pair| (start..=u).contains(&pair.u)) {
                    let inside = self.inside(piece, middle);
                    found.extend(inside.and_then(|at| self.push_out(piece.point_at(middle), middle, at)));
                }
            }
        }
        found
    }

    /// Projection of a point of a segment that is inside: the way there from its first end has entered the skin, and the nearest surface
    /// says so too.
    fn inside(&self, piece: &Piece, u: f64) -> Option<Projection> {
        let at = self.patch.project(piece.point_at(u));
        let before = i32::from(self.points[piece.first].2 < 0.0);
        (at.2 < 0.0 && before + self.patch.entered(piece.ends[0], piece.point_at(u)) > 0).then_some(at)
    }

    /// Pair of a tool point that is inside or touches with the skin's point of its projection; the normal leads out.
    fn push_out(&self, p: DVec3, u: f64, (triangle, _, distance, out): Projection) -> Option<Pair> {
        let weights = closest::on_triangle(p, self.patch.corners[triangle]);
        let on_skin = self.patch.position(triangle, weights);
        let away = (p - on_skin) * distance.signum();
        let normal = match away.length() > self.touch {
            true if away.dot(out) > 0.0 => away.normalize(),
            true => out,
            false => self.features.holding(triangle, weights).cone.normal,
        };
        let surface_point = (self.patch.triangles[triangle], weights);
        let gap = normal.dot(p - on_skin) - self.radius;
        (normal != DVec3::ZERO).then_some(Pair { surface_point, u, on_tool: p, on_skin, normal, gap, frictional: true })
    }

    /// Pair of a tool's feature and a skin's, where they first touch or come nearest, if it is kept.
    fn meets(&self, piece: &Piece, feature: &Feature) -> Option<Pair> {
        // too far, or from behind
        let first = feature.near(piece.ends, piece.point)?;
        let reach = self.search.alarm + self.search.distance + self.radius;
        if first.away.length() >= reach + piece.travel() {
            return None;
        }
        let behind = feature.cone.normal.dot(first.away) < 0.0 && first.away.length() > self.touch;
        if behind && !piece.point {
            return self.mirrored(piece, feature, &first);
        }
        // nearest approach; inside both features
        let (t, near) = self.advance(piece, feature, first);
        if near.away.length() >= reach || !near.strict {
            return None;
        }
        // normal; the filter
        let touches = near.away.length() <= self.touch;
        let normal = if touches { touching(piece, feature)? } else { near.away.normalize() };
        let widen = self.search.angle_cone;
        let kept = match self.search.filter {
            Filter::Points => feature.cone.normal.dot(normal) > 0.0,
            _ => feature.cone.admits(normal, widen) && (touches || piece.cone.admits(-normal, widen)),
        };
        let pair = self.pair(piece, feature, &near, normal);
        kept.then_some(Pair { gap: if t > 0.0 { pair.gap.max(0.0) } else { pair.gap }, ..pair })
    }

    /// Pair of a segment with an edge or vertex above it, if the segment's point is inside the skin.
    fn mirrored(&self, piece: &Piece, feature: &Feature, near: &Near) -> Option<Pair> {
        let normal = -near.away.normalize();
        let reach = self.search.alarm + self.search.distance + self.radius;
        if !near.strict || near.away.length() > reach {
            return None;
        }
        let depth = -self.inside(piece, near.u)?.2;
        let nearest = near.away.length() <= DEEPER * depth;
        let admitted = self.search.filter == Filter::Points || feature.cone.admits(normal, self.search.angle_cone);
        (nearest && admitted).then(|| self.pair(piece, feature, near, normal))
    }

    fn pair(&self, piece: &Piece, feature: &Feature, near: &Near, normal: DVec3) -> Pair {
        let (on_tool, on_skin) = (piece.point_at(near.u), feature.position(near.weights));
        let gap = normal.dot(on_tool - on_skin) - self.radius;
        Pair {
            surface_point: feature.surface_point(near.weights),
            u: near.u,
            on_tool,
            on_skin,
            normal,
            gap,
            frictional: true,
        }
    }

    /// Fraction of the motion at which the two touch or come nearest, with the nearest points there: never closer than the touching
    /// distance, unless they start so.
    fn advance(&self, piece: &Piece, feature: &Feature, first: Near) -> (f64, Near) {
        let clear = |near: &Near| near.away.length() - self.radius;
        let (mut best, mut here, mut t) = ((0.0, first), clear(&first), 0.0);
        let travel = piece.travel();
        for _ in 0..MOST_STEPS {
            if here <= 2.0 * self.touch || travel == 0.0 || t >= 1.0 {
                break;
            }
            t = (t + (here - self.touch) / travel).min(1.0);
            let Some(near) = feature.near(piece.at(t), piece.point) else {
                break;
            };
            here = clear(&near);
            if here < clear(&best.1) {
                best = (t, near);
            }
        }
        best
    }
}

/// Normal of a touching pair of a segment: across both lines, or across the segment as near to the vertex's as possible. A touching point
/// rests already.
fn touching(piece: &Piece, feature: &Feature) -> Option<DVec3> {
    let outward = feature.cone.normal;
    let line = (piece.ends[1] - piece.ends[0]).normalize_or_zero();
    match (piece.point, &feature.positions[..]) {
        (false, [_]) => outward.reject_from(line).try_normalize(),
        (false, [a, b]) => {
            let across = (*b - *a).cross(line).try_normalize()?;
            Some(if across.dot(outward) < 0.0 { -across } else { across })
        }
        _ => None,
    }
}
