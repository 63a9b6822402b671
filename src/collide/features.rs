//! Contacts of tools made of points and straight segments with the skin's vertices, edges and triangles.
//!
//! A pair is the nearest places P on a feature of the tool and Q on one of the skin: point–vertex, point–edge, point–triangle,
//! segment–vertex, segment–edge. It is kept when both lie strictly inside their features and |PQ| is below the alarm distance (and the
//! tool's radius), and, with `filter = "cones"`, when the direction is in the normal cones of both features ([`cones`]): local minima of
//! the distance. With `filter = "points"` every pair within reach is kept whose skin feature is turned to the tool.
//! Source: Johnson, Willemsen 2003, and SOFA's LocalMinDistance, whose pairs and cones these are. Three things differ:
//!
//! - Signed. LocalMinDistance has no inside: a tool behind the surface has no contact any more. Here a point inside is pushed out along
//!   the normal of the nearest surface ([`Patch::project`] has the sign). A segment under an edge or vertex is the mirrored problem: the
//!   same pair with the normal turned round, when the tool's place is inside and the pair is about as near as the surface. A stretch of a
//!   segment between two triangles that it pierces has one contact, at its middle, when no pair holds it.
//! - Touching. Below a hundredth of the alarm distance PQ has no direction: the normal is the mean one of the vertex, edge or
//!   triangle that a point rests on, and across both lines (`e × s`) for a segment. So a tool at rest keeps its contacts whatever
//!   rounding does.
//! - Continuous. All ends move along their free motion of the step; a pair is taken where it first touches, or comes nearest, found by
//!   conservative advancement (Mirtich 1996), and its gap is that of the plane there at the step's start. A point on a face that may
//!   slide along it into a face that rises there is held by the planes of both: the other one is no local minimum yet.
//!
//! Triangles near a tool feature come from parry3d's tree of boxes; all else is in f64. Units: m.

pub mod closest;
pub mod cones;

use super::{Contact, Patch, Search, frame};
use crate::bodies::rigid::{Instrument, UnconstrainedMotion};
use crate::constraints::Law;
use crate::mesh::MaterialPoint;
use crate::scene::{Filter, Lines};
use closest::Near;
use cones::{Cone, Feature, Features};
use glam::DVec3;

/// Distance below which a pair touches, alarm distances: 2 µm as most scenes have it, above what a step leaves of a gap at rest (0.1 µm).
/// Larger, and contacts at rest take a mean normal where a face has its own; smaller, and a point at rest on a dimpled vertex has each of
/// the faces round it as a contact at one place, more than friction there is determined by (sweeps of the contact law then do not end).
const TOUCH: f64 = 1e-2;
/// Steps of the advancement at most; a near miss that takes more is treated as it was found until then.
const MOST_STEPS: u32 = 64;
/// A pair inside the skin may be this many times further from its place than the nearest surface is: its normal leans from
/// theirs by at most 48°. More, and a tool just under the top would be pushed through the bottom.
const DEEPER: f64 = 1.5;
/// Pairs at one place whose normals have at least this cosine (2.6°) are one contact.
const ALIKE: f64 = 0.999;

/// A point (both ends alike) or segment of the tool at the step's start, with the motion of its ends.
struct Piece {
    ends: [DVec3; 2],
    shift: [DVec3; 2],
    point: bool,
    cone: Cone,
}

impl Piece {
    fn at(&self, t: f64) -> [DVec3; 2] {
        [0, 1].map(|k| self.ends[k] + self.shift[k] * t)
    }
    fn travel(&self) -> f64 {
        self.shift[0].length().max(self.shift[1].length())
    }
    fn place(&self, u: f64) -> DVec3 {
        self.ends[0].lerp(self.ends[1], u)
    }
}

/// A pair that is kept.
struct Pair {
    /// Nodes and weights of the place on the skin.
    spot: ([u32; 3], [f64; 3]),
    /// Place on the tool's segment.
    u: f64,
    on_tool: DVec3,
    on_skin: DVec3,
    normal: DVec3,
    gap: f64,
    /// With friction.
    rubs: bool,
}

/// Bits of a contact's number that say which point or segment of the tool has it; the rest counts its contacts.
const PIECE_BITS: u32 = 32;
const PIECE: usize = (1 << PIECE_BITS) - 1;

/// One tool and one patch.
struct Hunt<'a> {
    patch: &'a Patch,
    features: Features,
    search: &'a Search,
    radius: f64,
    touch: f64,
}

/// Contacts of one tool with a patch.
pub fn contacts(
    tool: (usize, &Instrument),
    lines: &Lines,
    skin: (usize, &Patch),
    search: &Search,
    free: &UnconstrainedMotion,
) -> Vec<Contact> {
    contacts_among(tool, lines, skin, search, free, &|low, high| skin.1.near(low, high))
}

/// The same with another way to find the triangles that meet a box.
pub fn contacts_among(
    (number, tool): (usize, &Instrument),
    lines: &Lines,
    (body, patch): (usize, &Patch),
    search: &Search,
    free: &UnconstrainedMotion,
    near: &dyn Fn(DVec3, DVec3) -> Vec<u32>,
) -> Vec<Contact> {
    let touch = TOUCH * search.alarm;
    let hunt = Hunt { patch, features: Features::new(patch), search, radius: lines.radius, touch };
    let mut kept: Vec<(usize, Pair)> = vec![];
    for (index, piece) in pieces(tool, lines, free).iter().enumerate() {
        let margin = DVec3::splat(search.alarm + search.distance + lines.radius + 2.0 * touch);
        let corners = [piece.at(0.0), piece.at(1.0)].concat();
        let low = corners.iter().fold(DVec3::INFINITY, |low, p| low.min(*p)) - margin;
        let high = corners.iter().fold(DVec3::NEG_INFINITY, |high, p| high.max(*p)) + margin;
        let triangles = near(low, high);
        let found = if piece.point { hunt.point(piece, &triangles) } else { hunt.segment(piece, &triangles) };
        kept.extend(found.into_iter().map(|pair| (index, pair)));
    }
    kept.sort_by_key(|(_, pair)| !pair.rubs); // of two at one place the one with friction stays
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
        let spot = MaterialPoint::of(pair.spot.0, pair.spot.1);
        let earlier = out.iter().filter(|(c, _)| c.feature & PIECE == index).count();
        let contact = Contact {
            axes: frame(pair.normal),
            gap: [pair.gap - search.distance, 0.0, 0.0],
            depth: (-pair.gap).max(0.0),
            law: Law::contact(if pair.rubs { search.friction } else { 0.0 }),
            ..Contact::on_skin(number, index | earlier << PIECE_BITS, body, spot, point)
        };
        out.push((contact, pair.on_skin));
    }
    out.into_iter().map(|(contact, _)| contact).collect()
}

/// Points, then segments, each with its motion.
fn pieces(tool: &Instrument, lines: &Lines, free: &UnconstrainedMotion) -> Vec<Piece> {
    let places: Vec<DVec3> = lines.positions.iter().map(|p| tool.at(DVec3::from_array(*p))).collect();
    let shift = |p: DVec3| free.shift + free.turn.cross(p - tool.position);
    let piece = |ends: [DVec3; 2], point: bool, cone: Cone| Piece { ends, shift: ends.map(shift), point, cone };
    let mut cones = vec![Cone::default(); places.len()];
    for [a, b] in lines.segments.iter().map(|ends| ends.map(|id| id as usize)) {
        let along = (places[b] - places[a]).normalize_or_zero();
        cones[a].outward.push(-along);
        cones[b].outward.push(along);
    }
    let points = places.iter().zip(cones).map(|(place, cone)| piece([*place; 2], true, cone));
    let segments = lines.segments.iter().map(|s| piece(s.map(|id| places[id as usize]), false, Cone::default()));
    points.chain(segments).collect()
}

impl Hunt<'_> {
    /// Pairs of a tool's point: what it rests on and other local minima; the way out when it is inside.
    fn point(&self, piece: &Piece, triangles: &[u32]) -> Vec<Pair> {
        let p = piece.ends[0];
        let features = || self.features.of(triangles).into_iter().map(|id| &self.features.all[id]);
        let rests = features().find_map(|feature| self.rests(piece, feature));
        let mut found: Vec<Pair> = match rests.is_none() && self.patch.project(p).2 < 0.0 {
            true => self.way_out(p, 0.0).into_iter().collect(),
            false => rests.into_iter().chain(features().filter_map(|feature| self.meets(piece, feature))).collect(),
        };
        let walls: Vec<Pair> = found.iter().flat_map(|pair| self.walls(pair, piece.shift[0])).collect();
        found.extend(walls);
        found
    }

    /// The faces that rise round the place of a pair with a face, without friction: a point that slides along its own face, by as much
    /// as its motion of the step has along it, would go through them. On an edge or vertex the mean normal stands for them: it depends on theirs, and forces would be
    /// undetermined.
    fn walls(&self, pair: &Pair, shift: DVec3) -> Vec<Pair> {
        let reach = shift.reject_from(pair.normal).length().min(self.search.alarm) + self.touch;
        let used: Vec<u32> = (0..3).filter(|k| pair.spot.1[*k] > closest::MARGIN).map(|k| pair.spot.0[k]).collect();
        let mut walls = vec![];
        if used.len() < 3 {
            return walls;
        }
        for face in self.features.faces_at(&used) {
            let normal = face.cone.normal;
            let high = normal.dot(pair.on_skin - face.places[0]);
            let rises = face.places.iter().all(|c| pair.normal.dot(*c - pair.on_skin) > -self.touch);
            let steep = normal != DVec3::ZERO && normal.dot(pair.normal) < ALIKE;
            if rises && steep && high > -self.touch && high < reach {
                let near = closest::point_face(pair.on_skin, [face.places[0], face.places[1], face.places[2]]);
                let on_skin = face.place(near.weights);
                let gap = normal.dot(pair.on_tool - on_skin) - self.radius;
                let spot = face.spot(near.weights);
                walls.push(Pair { spot, u: pair.u, on_tool: pair.on_tool, on_skin, normal, gap, rubs: false });
            }
        }
        walls
    }

    /// The pair of a point with a feature that it touches, vertices before edges before faces: one of them is enough, since what is
    /// round it moves with it.
    fn rests(&self, piece: &Piece, feature: &Feature) -> Option<Pair> {
        let near = feature.near(piece.ends, piece.point)?;
        let normal = feature.cone.normal;
        let rests = near.away.length() <= self.touch && normal != DVec3::ZERO;
        rests.then(|| self.pair(piece, feature, &near, normal))
    }

    /// Pairs of a tool's segment, and one for each stretch inside the skin that has none.
    fn segment(&self, piece: &Piece, triangles: &[u32]) -> Vec<Pair> {
        let features = self.features.of(triangles).into_iter().map(|id| &self.features.all[id]);
        let mut found: Vec<Pair> = features.filter_map(|feature| self.meets(piece, feature)).collect();
        let corners = triangles.iter().map(|t| self.patch.corners[*t as usize]);
        let mut hits: Vec<(f64, bool)> = corners.filter_map(|c| closest::pierces(piece.ends, c)).collect();
        hits.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut entered = None;
        for (u, inward) in hits {
            if inward {
                entered = entered.or(Some(u));
            } else if let Some(start) = entered.take() {
                // stretches that reach an end of the segment are held at that end, which is a point
                let middle = 0.5 * (start + u);
                if !found.iter().any(|pair| (start..=u).contains(&pair.u)) {
                    let inside = self.patch.project(piece.place(middle)).2 < 0.0;
                    found.extend(self.way_out(piece.place(middle), middle).filter(|_| inside));
                }
            }
        }
        found
    }

    /// The nearest place of the skin to a place of the tool that is inside or touches; the normal leads out.
    fn way_out(&self, p: DVec3, u: f64) -> Option<Pair> {
        let (triangle, _, distance, _) = self.patch.project(p);
        let weights = closest::on_triangle(p, self.patch.corners[triangle]);
        let on_skin = self.patch.place(triangle, weights);
        let away = (p - on_skin) * distance.signum();
        let normal = match away.length() > self.touch {
            true => away.normalize(),
            false => self.features.holding(triangle, weights).cone.normal,
        };
        let spot = (self.patch.triangles[triangle], weights);
        let gap = normal.dot(p - on_skin) - self.radius;
        (normal != DVec3::ZERO).then_some(Pair { spot, u, on_tool: p, on_skin, normal, gap, rubs: true })
    }

    /// The pair of a tool's feature and one of the skin, where they first touch or come nearest, if it is kept.
    fn meets(&self, piece: &Piece, feature: &Feature) -> Option<Pair> {
        let first = feature.near(piece.ends, piece.point)?;
        let reach = self.search.alarm + self.search.distance + self.radius;
        if first.away.length() >= reach + piece.travel() {
            return None;
        }
        let behind = feature.cone.normal.dot(first.away) < 0.0 && first.away.length() > self.touch;
        if behind && !piece.point {
            return self.mirrored(piece, feature, &first);
        }
        let (t, near) = self.advance(piece, feature, first);
        if near.away.length() >= reach || !near.strict {
            return None;
        }
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

    /// The pair of a segment with an edge or vertex that is above it, when its place is inside the skin.
    fn mirrored(&self, piece: &Piece, feature: &Feature, near: &Near) -> Option<Pair> {
        let depth = -self.patch.project(piece.place(near.u)).2;
        let normal = -near.away.normalize();
        let reach = self.search.alarm + self.search.distance + self.radius;
        let nearest = near.strict && depth > 0.0 && near.away.length() <= reach.min(DEEPER * depth);
        let admitted = self.search.filter == Filter::Points || feature.cone.admits(normal, self.search.angle_cone);
        (nearest && admitted).then(|| self.pair(piece, feature, near, normal))
    }

    fn pair(&self, piece: &Piece, feature: &Feature, near: &Near, normal: DVec3) -> Pair {
        let (on_tool, on_skin) = (piece.place(near.u), feature.place(near.weights));
        let gap = normal.dot(on_tool - on_skin) - self.radius;
        Pair { spot: feature.spot(near.weights), u: near.u, on_tool, on_skin, normal, gap, rubs: true }
    }

    /// The share of the motion at which the two touch or are nearest, with their nearest places there: never closer than the distance
    /// that counts as touching, unless they begin so.
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

/// Normal of a segment's pair that touches: across both lines; across the segment, as near to the vertex's as that allows. A point
/// that touches rests already.
fn touching(piece: &Piece, feature: &Feature) -> Option<DVec3> {
    let outward = feature.cone.normal;
    let line = (piece.ends[1] - piece.ends[0]).normalize_or_zero();
    match (piece.point, &feature.places[..]) {
        (false, [_]) => outward.reject_from(line).try_normalize(),
        (false, [a, b]) => {
            let across = (*b - *a).cross(line).try_normalize()?;
            Some(if across.dot(outward) < 0.0 { -across } else { across })
        }
        _ => None,
    }
}
