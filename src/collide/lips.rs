//! Contacts between the lips of wounds.
//!
//! A severed link leaves two faces, one on each lip. Each of their nodes may rest on the nearest face of another lip that it faces: one
//! whose outward normal opposes the node's own. The normal of the contact is the mean of the two, interpolated over the face; where two
//! nodes meet, which both find, one contact is kept. Lips that have slid along each other, and flaps that have folded over, are found as
//! well as those that face each other as they did when cut. Lips are wet: there is no friction between them.
//!
//! Three crossing cuts with a flap on 14 × 14 cells: 0.07 mm of the deepest node inside of a foreign cell, 0.23 mm without contact. Where
//! its flap curled up, by a path that is no longer its own: 24 × 24 cells 0.25 mm at the tip of the flap, elsewhere 0.1.
//!
//! Behind every face there is tissue, and the far side of a thin flap faces it from there. Such a node was behind the face at rest, and
//! does not touch it.

use super::features::closest::on_triangle;
use super::{Contact, area_normal, frame};
use crate::constraints::Law;
use crate::kernels::corner;
use crate::mesh::{MaterialPoint, Parts, TetrahedralParts};
use crate::scene::BodyId;
use glam::DVec3;
use std::collections::{BTreeMap, BTreeSet};

/// Share of a face's shorter diagonal by which a node may lie beside the face, across the normal, and still face it; beyond the rim of a
/// wound there is nothing to rest on.
const BESIDE: f64 = 0.25;
/// Share of the areas around a node that its normal must have: at the front of a cut the faces of both lips meet, and there is no normal.
const LEAST_NORMAL: f64 = 0.3;
/// Weight of a face's node from which a contact is one of two nodes.
const AT_NODE: f64 = 1.0 - 1e-9;

/// Faces left by severed links: their nodes counterclockwise seen from outside of the tissue; a triangle has its third one twice.
pub type Faces = Vec<[u32; 4]>;

/// Faces of all severed links, those of a link one after the other: of the cell before it, and of the one beyond.
pub fn faces(parts: &Parts) -> Faces {
    let mut out = vec![];
    for (cell, axis, _) in parts.cuts() {
        let Some(beyond) = parts.beyond(cell as usize, axis) else { continue };
        let [before, mut beyond] = [(parts.corners(cell as usize), 1), (parts.corners(beyond), 0)]
            .map(|(corners, side)| around(axis, side).map(|a| corners[a] as u32));
        beyond.reverse();
        out.extend([before, beyond]);
    }
    out
}

/// The same of a mesh; a triangle has its third node twice.
pub fn triangles(parts: &TetrahedralParts) -> Faces {
    let sides = |[[a, b, c], [d, e, f]]: [[u32; 3]; 2]| [[a, b, c, c], [f, e, d, d]];
    parts.cuts().flat_map(|link| sides(parts.faces(link))).collect()
}

/// Corner numbers around a cell's face across an axis, counterclockwise seen against the axis.
fn around(axis: usize, side: usize) -> [usize; 4] {
    [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[u, v]| {
        let mut wanted = [side; 3];
        (wanted[(axis + 1) % 3], wanted[(axis + 2) % 3]) = (u, v);
        (0..8).find(|a| corner(*a) == wanted).unwrap_or(0)
    })
}

/// A face at its present and at its rest position, m.
struct Placed {
    nodes: [u32; 4],
    now: [DVec3; 4],
    rest: [DVec3; 4],
    low: DVec3,
    high: DVec3,
    /// Shorter diagonal.
    diagonal: f64,
}

impl Placed {
    /// Weights of the nodes at the point nearest to `p`, on four triangles about the face's centre.
    fn nearest(&self, p: DVec3) -> [f64; 4] {
        let centre = self.now.iter().sum::<DVec3>() * 0.25;
        let on_quarter = |k: usize| {
            let next = (k + 1) % 4;
            let [a, b, c] = on_triangle(p, [self.now[k], self.now[next], centre]);
            let mut weights = [0.25 * c; 4];
            weights[k] += a;
            weights[next] += b;
            (weights, p.distance_squared(mix(&self.now, weights)))
        };
        let nearest = (0..4).map(on_quarter).min_by(|a, b| a.1.total_cmp(&b.1));
        nearest.map_or([0.25; 4], |(weights, _)| weights)
    }

    /// The point with these weights.
    fn material_point(&self, [a, b, c, d]: [f64; 4]) -> MaterialPoint {
        let triangle = self.nodes[2] == self.nodes[3];
        MaterialPoint::of(self.nodes, if triangle { [a, b, c + d, 0.0] } else { [a, b, c, d] })
    }

    /// Whether a node at this rest position was behind the face at rest, with the tissue of the face between them.
    fn was_behind(&self, at: DVec3) -> bool {
        let Some(normal) = area_normal(self.rest).try_normalize() else { return false };
        let away = at - self.rest.iter().sum::<DVec3>() * 0.25;
        let depth = -normal.dot(away);
        let diagonal = self.rest[0].distance(self.rest[2]);
        depth > 1e-3 * diagonal && (away + normal * depth).length() < depth + diagonal
    }
}

fn mix(of: &[DVec3; 4], weights: [f64; 4]) -> DVec3 {
    of.iter().zip(weights).map(|(p, w)| *p * w).sum()
}

/// Contacts of lips closer than `alarm`, m, the deepest first; none at constrained nodes. `position` gives a node's present and rest
/// position, m.
pub fn contacts(
    body: usize,
    faces: &Faces,
    position: impl Fn(u32) -> [DVec3; 2],
    free: impl Fn(u32) -> bool,
    alarm: f64,
) -> Vec<Contact> {
    // faces with their positions and extents
    let mut placed: Vec<Placed> = faces
        .iter()
        .map(|nodes| {
            let at = nodes.map(&position);
            let (now, rest) = (at.map(|[now, _]| now), at.map(|[_, rest]| rest));
            let (low, high) = now.iter().fold((now[0], now[0]), |(low, high), p| (low.min(*p), high.max(*p)));
            let diagonal = now[0].distance(now[2]).min(now[1].distance(now[3]));
            Placed { nodes: *nodes, now, rest, low, high, diagonal }
        })
        .collect();
    // normals of the nodes, by area
    let mut normals: BTreeMap<u32, (DVec3, f64)> = BTreeMap::new();
    for face in &placed {
        let normal = area_normal(face.now);
        for node in face.nodes {
            let (sum, size) = normals.entry(node).or_default();
            *sum += normal;
            *size += normal.length();
        }
    }
    let unit = |(node, (sum, size)): (u32, (DVec3, f64))| {
        (node, if sum.length() > LEAST_NORMAL * size { sum.normalize_or_zero() } else { DVec3::ZERO })
    };
    let normals: BTreeMap<u32, DVec3> = normals.into_iter().map(unit).collect();
    // faces in ascending order of x, so that those near a node follow each other
    placed.sort_by(|a, b| a.low.x.total_cmp(&b.low.x).then(a.nodes.cmp(&b.nodes)));
    let widest = placed.iter().map(|face| face.high.x - face.low.x).fold(0.0, f64::max);
    let reach = placed.iter().map(|face| face.diagonal).fold(alarm, f64::max);
    // nearest face that each node is opposite to
    let mut out = vec![];
    let mut met = BTreeSet::new();
    for (node, own) in normals.iter().filter(|(node, own)| free(**node) && **own != DVec3::ZERO) {
        let ([at, rest], own) = (position(*node), *own);
        let first = placed.partition_point(|face| face.low.x < at.x - reach - widest);
        let mut best: Option<(f64, Contact)> = None;
        for face in placed[first..].iter().take_while(|face| face.low.x < at.x + reach) {
            let near = alarm.max(face.diagonal);
            let clear = (face.low - at).max(at - face.high).max_element() > near;
            if clear || face.nodes.contains(node) {
                continue;
            }
            // gap along the mean of both normals
            let weights = face.nearest(at);
            let outward: DVec3 = face.nodes.iter().zip(weights).map(|(node, w)| normals[node] * w).sum();
            let away = at - mix(&face.now, weights);
            let distance = away.length();
            let Some(normal) = (outward - own).try_normalize() else { continue };
            let gap = normal.dot(away);
            // opposite to each other now, and not one behind the other at rest
            let faces_it = outward.dot(own) < 0.0 && (away - normal * gap).length() < BESIDE * face.diagonal;
            let within = gap < alarm && gap > -face.diagonal;
            let nearer = best.as_ref().is_none_or(|(least, _)| distance < *least);
            if faces_it && within && nearer && !face.was_behind(rest) {
                let found = Contact {
                    on: [BodyId::Deformable(body); 2],
                    points: [MaterialPoint::node(*node), face.material_point(weights)],
                    feature: *node as usize,
                    point: at - away * 0.5,
                    axes: frame(normal),
                    gap: [gap, 0.0, 0.0],
                    depth: 0.0,
                    law: Law::contact(0.0),
                };
                best = Some((distance, found));
            }
        }
        let Some((_, found)) = best else { continue };
        // two nodes that meet find each other
        let twice = match found.points[1].0[..] {
            [(other, weight)] if weight >= AT_NODE => !met.insert([other.min(*node), other.max(*node)]),
            _ => false,
        };
        if !twice {
            out.push(found);
        }
    }
    out.sort_by(|a, b| a.gap[0].total_cmp(&b.gap[0]).then(a.feature.cmp(&b.feature)));
    out
}
