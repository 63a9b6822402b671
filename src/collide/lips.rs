//! Contacts between the lips of wounds.
//!
//! A severed link leaves two faces, one on each lip. Each of their nodes may rest on the nearest face of another lip that it faces: one
//! whose outward normal opposes the node's own. The normal of the contact is the mean of the two, interpolated over the face; where two
//! nodes meet, which both find, one contact is kept. Lips that have slid along each other, and flaps that have folded over, are found as
//! well as those that face each other as they did when cut. Lips are wet: there is no friction between them.
//!
//! A corner of a flap that slides into a wall beside its bed does not face it. So a node within the walls of the cell behind a face has a contact
//! with that face, along the face's normal, whatever its own is: the nearest such, unless it is about the one before. At the front of a cut,
//! where the faces of both lips meet, a node lies between both and is held by the tissue before it; it has no normal and no contact.
//!
//! How far they pass through each other: `benches/results/two_cores/lips.md` (`cargo bench --bench lips`).
//! Source: own; node-to-surface contact with averaged nodal normals (as in mortar methods: Puso, Laursen 2004).
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
/// Share of a face's shorter diagonal by which a node within the walls of its cell is behind each of them; those of one's own cell are not.
const WITHIN: f64 = 1e-3;
/// Cosine (of 26°) above which the normals of two contacts of a node make them one.
const ALIKE: f64 = 0.9;
/// Set in the feature number of a node's contact by a cell, beside that with the face that it faces.
const BY_CELL: usize = (1_u64 << 40) as usize;

/// Face left by a severed link.
#[derive(Clone, Debug)]
pub struct LipFace {
    /// Its nodes, counterclockwise seen from outside of the tissue; a triangle has its third one twice.
    pub nodes: [u32; 4],
    /// All faces of the cell that it bounds, likewise.
    pub cell: Vec<[u32; 4]>,
}

/// Faces left by severed links.
pub type Faces = Vec<LipFace>;

/// Faces of all severed links at cells that are left, those of a link one after the other: of the cell before it, and of the one beyond.
pub fn faces(parts: &Parts, alive: &[bool]) -> Faces {
    let mut out = vec![];
    for (cell, axis, _) in parts.cuts() {
        let Some(beyond) = parts.beyond(cell as usize, axis) else { continue };
        for (cell, side) in [(cell as usize, 1), (beyond, 0)].into_iter().filter(|(cell, _)| alive[*cell]) {
            let corners = parts.corners(cell);
            let face = |axis: usize, side: usize| {
                let mut nodes = around(axis, side).map(|a| corners[a] as u32);
                if side == 0 {
                    nodes.reverse();
                }
                nodes
            };
            let all = (0..6).map(|k| face(k / 2, k % 2)).collect();
            out.push(LipFace { nodes: face(axis, side), cell: all });
        }
    }
    out
}

/// The same of a mesh.
pub fn triangles(parts: &TetrahedralParts) -> Faces {
    let outward = |e: usize, k: usize| {
        let [a, b, c] = parts.outward(e, k);
        [a, b, c, c]
    };
    let sides = |link: usize| {
        parts.sides(link).map(|(e, k)| LipFace { nodes: outward(e, k), cell: (0..4).map(|k| outward(e, k)).collect() })
    };
    parts.cuts().flat_map(sides).collect()
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
    /// Unit mean normal, outward.
    normal: DVec3,
    /// Planes of the other faces of the cell behind it: outward normal, place along it.
    walls: Vec<(DVec3, f64)>,
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

    /// Whether a point at this gap is within the walls of the cell behind the face, in front of the face or nearer to it than to what is opposite.
    fn has_within_walls(&self, p: DVec3, gap: f64) -> bool {
        let distance = |(normal, at): &(DVec3, f64)| normal.dot(p) - at;
        let along = |wall: &(DVec3, f64)| wall.0.dot(self.normal);
        let opposite = self.walls.iter().min_by(|a, b| along(a).total_cmp(&along(b)));
        self.walls.iter().all(|wall| distance(wall) < -WITHIN * self.diagonal)
            && opposite.is_none_or(|wall| gap > distance(wall))
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
    is_free: impl Fn(u32) -> bool,
    alarm: f64,
) -> Vec<Contact> {
    // faces with their positions and extents
    let mut placed: Vec<Placed> = faces
        .iter()
        .map(|LipFace { nodes, cell }| {
            let at = nodes.map(&position);
            let (now, rest) = (at.map(|[now, _]| now), at.map(|[_, rest]| rest));
            let (low, high) = now.iter().fold((now[0], now[0]), |(low, high), p| (low.min(*p), high.max(*p)));
            let diagonal = now[0].distance(now[2]).min(now[1].distance(now[3]));
            let unit_normal = |corners: [DVec3; 4]| area_normal(corners).normalize_or_zero();
            let plane = |nodes: &[u32; 4]| {
                let corners = nodes.map(|node| position(node)[0]);
                let normal = unit_normal(corners);
                (normal, normal.dot(corners.iter().sum::<DVec3>() * 0.25))
            };
            let walls = cell.iter().filter(|other| *other != nodes).map(plane).collect();
            Placed { nodes: *nodes, now, rest, low, high, diagonal, normal: unit_normal(now), walls }
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
    // nearest faces that each node is opposite to, and within whose cell it is
    let mut out = vec![];
    let mut met = BTreeSet::new();
    for (node, own) in normals.iter().filter(|(node, own)| is_free(**node) && **own != DVec3::ZERO) {
        let ([at, rest], own) = (position(*node), *own);
        let first = placed.partition_point(|face| face.low.x < at.x - reach - widest);
        let mut faced: Option<(f64, Contact)> = None;
        let mut by_cell: Option<Contact> = None;
        for face in placed[first..].iter().take_while(|face| face.low.x < at.x + reach) {
            let near = alarm.max(face.diagonal);
            let clear = (face.low - at).max(at - face.high).max_element() > near;
            if clear || face.nodes.contains(node) || face.was_behind(rest) {
                continue;
            }
            let weights = face.nearest(at);
            let outward: DVec3 = face.nodes.iter().zip(weights).map(|(node, w)| normals[node] * w).sum();
            let away = at - mix(&face.now, weights);
            let contact = |normal: DVec3, gap: f64, feature: usize| Contact {
                on: [BodyId::Deformable(body); 2],
                points: [MaterialPoint::node(*node), face.material_point(weights)],
                feature,
                point: at - away * 0.5,
                axes: frame(normal),
                gap: [gap, 0.0, 0.0],
                depth: 0.0,
                law: Law::contact(0.0),
            };
            // within the walls of the cell behind the face
            let gap = face.normal.dot(away);
            let nearer = by_cell.as_ref().is_none_or(|other| gap.abs() < other.gap[0].abs());
            if gap < alarm && nearer && face.has_within_walls(at, gap) {
                by_cell = Some(contact(face.normal, gap, *node as usize | BY_CELL));
            }
            // opposite to the node; the gap is along the mean of both normals
            let distance = away.length();
            let Some(normal) = (outward - own).try_normalize() else { continue };
            let gap = normal.dot(away);
            let faces_it = outward.dot(own) < 0.0 && (away - normal * gap).length() < BESIDE * face.diagonal;
            let within = gap < alarm && gap > -face.diagonal;
            let nearer = faced.as_ref().is_none_or(|(least, _)| distance < *least);
            if faces_it && within && nearer {
                faced = Some((distance, contact(normal, gap, *node as usize)));
            }
        }
        let faced = faced.map(|(_, contact)| contact);
        let alike = |a: &Contact, b: &Contact| a.axes[0].dot(b.axes[0]) > ALIKE;
        out.extend(match (&faced, by_cell) {
            (Some(faced), Some(by_cell)) => Some(by_cell).filter(|by_cell| !alike(faced, by_cell)),
            (None, Some(by_cell)) => Some(Contact { feature: *node as usize, ..by_cell }),
            (_, None) => None,
        });
        // two nodes that meet find each other
        let mut twice = |found: &Contact| match found.points[1].0[..] {
            [(other, weight)] if weight >= AT_NODE => !met.insert([other.min(*node), other.max(*node)]),
            _ => false,
        };
        out.extend(faced.filter(|found| !twice(found)));
    }
    out.sort_by(|a, b| a.gap[0].total_cmp(&b.gap[0]).then(a.feature.cmp(&b.feature)));
    out
}
