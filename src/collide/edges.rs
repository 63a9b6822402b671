//! Contacts of edges that cross: of a box's with those of a deformable body's surface, and of two such surfaces' with each other.
//!
//! Corners on faces alone let a bar between two rows of nodes fall through, and crossed bars through each other. Two edges touch where
//! the line across both lies in both's normal cones ([`Cone`]) and meets both between their ends, and if the surface is as near as that;
//! the gap is along it. A surface's edges are its cells', without diagonals. An edge at a face whose nodes all touch is held by these;
//! so only bodies narrower than two cells, and rims, have such contacts. Edges that are parallel to 1 % are left to their nodes,
//! which count as over a face that they miss by about as little ([`BESIDE`]).
//! Units: m.

use super::convex::Cuboid;
use super::features::cones::Cone;
use super::{Contact, Patch, Search, area_normal};
use crate::bodies::rigid::Instrument;
use crate::mesh::{Face, MaterialPoint};
use crate::scene::BodyId;
use glam::DVec3;
use std::collections::{BTreeMap, BTreeSet};

/// Sine of the angle below which edges count as parallel.
const PARALLEL: f64 = 0.01;
/// Share of an edge's length by which its node may lie beside a face and still touch it.
pub const BESIDE: f64 = PARALLEL;
/// Share of an edge within which a contact at its end stands for one on the edge.
const AT_END: f64 = 0.25;
/// Largest depth of a pair as a multiple of the depth below the nearest surface; what is deeper belongs to another side of the body.
const DEEPER: f64 = 1.5;
/// Set in the feature numbers of pairs of edges; those of nodes and samples are below.
const PAIR: u64 = 1 << 62;

/// Edge of a surface or of a box.
struct Edge {
    ends: [DVec3; 2],
    /// Of a surface's; of a box's its number.
    nodes: [u32; 2],
    /// Whether a contact is at the end already.
    held: [bool; 2],
    cone: Cone,
}

impl Edge {
    fn at(&self, share: f64) -> DVec3 {
        self.ends[0].lerp(self.ends[1], share)
    }

    /// Whether a contact at an end stands for one at this share of the edge.
    fn has_near(&self, share: f64) -> bool {
        self.held[0] && share < AT_END || self.held[1] && share > 1.0 - AT_END
    }

    fn material_point(&self, share: f64) -> MaterialPoint {
        MaterialPoint::of(self.nodes, [1.0 - share, share])
    }
}

/// Edges of faces, without those at a face whose nodes are all `held`.
fn edges_of(faces: &[Face], position: &impl Fn(u32) -> DVec3, held: &BTreeSet<u32>) -> Vec<Edge> {
    let touching = faces.iter().filter(|face| face.corners().iter().all(|node| held.contains(node)));
    let settled: BTreeSet<u32> = touching.flat_map(|face| face.corners().iter().copied()).collect();
    let mut found: BTreeMap<[u32; 2], Edge> = BTreeMap::new();
    for face in faces {
        let open: Vec<[u32; 2]> =
            face.edges().filter(|nodes| !nodes.iter().any(|node| settled.contains(node))).collect();
        if open.is_empty() {
            continue;
        }
        let normal = area_normal(face.nodes.map(position)).normalize_or_zero();
        for [from, to] in open {
            let nodes = [from.min(to), from.max(to)];
            let edge = found.entry(nodes).or_insert_with(|| Edge {
                ends: nodes.map(position),
                nodes,
                held: nodes.map(|node| held.contains(&node)),
                cone: Cone::default(),
            });
            edge.cone.normal += normal;
            edge.cone.outward.push((position(to) - position(from)).cross(normal).normalize_or_zero());
        }
    }
    let mut edges: Vec<Edge> = found.into_values().collect();
    edges.iter_mut().for_each(|edge| edge.cone.normal = edge.cone.normal.normalize_or_zero());
    edges
}

/// The twelve edges of a box.
fn edges_of_box(of: &Cuboid) -> Vec<Edge> {
    // across each face's edge, out of it, is the other's normal
    let edge = |(n, (ends, normals)): (u32, ([DVec3; 2], [DVec3; 2]))| {
        let cone = Cone { normal: (normals[0] + normals[1]).normalize(), outward: normals.to_vec() };
        Edge { ends, nodes: [n, 0], held: [false; 2], cone }
    };
    (0..).zip(of.edges()).map(edge).collect()
}

/// Two edges that touch: shares along both, unit normal from the second to the first, gap.
type Crossing = (f64, f64, DVec3, f64);

/// Where two edges touch, within `reach`; `depth` tells how deep a point of the first is in the second's body.
fn cross(first: &Edge, second: &Edge, reach: f64, widen: f64, depth: &impl Fn(DVec3) -> f64) -> Option<Crossing> {
    let (d, e) = (first.ends[1] - first.ends[0], second.ends[1] - second.ends[0]);
    let across = d.cross(e);
    if across.length() < PARALLEL * d.length() * e.length() {
        return None;
    }
    // shares at which the line across both meets them
    let (apart, area) = (second.ends[0] - first.ends[0], across.length_squared());
    let (u, t) = (apart.cross(e).dot(across) / area, apart.cross(d).dot(across) / area);
    let within = |of: &Edge, share: f64| (0.0..=1.0).contains(&share) && !of.has_near(share);
    if !within(first, u) || !within(second, t) {
        return None;
    }
    let normal = across.normalize();
    let normal = if normal.dot(second.cone.normal - first.cone.normal) < 0.0 { -normal } else { normal };
    let gap = normal.dot(first.at(u) - second.at(t));
    let admitted = gap < reach && second.cone.admits(normal, widen) && first.cone.admits(-normal, widen);
    // the surface is about as near
    let near = admitted && (gap >= 0.0 || -gap <= DEEPER * depth(first.at(u)).max(PARALLEL * reach));
    near.then_some((u, t, normal, gap))
}

/// Pairs of edges whose boxes are within reach, in the order of the first.
fn pairs<'a>(first: &'a [Edge], second: &'a [Edge], reach: f64) -> impl Iterator<Item = (usize, usize)> + 'a {
    let extent = move |edge: &Edge, more: f64| {
        let [low, high] = [edge.ends[0].min(edge.ends[1]), edge.ends[0].max(edge.ends[1])];
        (low - DVec3::splat(more), high + DVec3::splat(more))
    };
    let boxes: Vec<(DVec3, DVec3)> = second.iter().map(|edge| extent(edge, 0.0)).collect();
    // by the axis along which the second ones lie farthest apart
    let span = boxes.iter().map(|(low, _)| *low).reduce(DVec3::max).unwrap_or_default()
        - boxes.iter().map(|(low, _)| *low).reduce(DVec3::min).unwrap_or_default();
    let axis = span.max_position();
    let mut order: Vec<usize> = (0..second.len()).collect();
    order.sort_by(|a, b| boxes[*a].0[axis].total_cmp(&boxes[*b].0[axis]));
    let longest = boxes.iter().map(|(low, high)| high[axis] - low[axis]).fold(0.0, f64::max);
    first.iter().enumerate().flat_map(move |(i, edge)| {
        let (low, high) = extent(edge, reach);
        let from = order.partition_point(|j| boxes[*j].0[axis] < low[axis] - longest);
        let along = order[from..].iter().take_while(|j| boxes[**j].0[axis] <= high[axis]);
        let meets = |j: &usize| low.cmple(boxes[*j].1).all() && high.cmpge(boxes[*j].0).all();
        along.copied().filter(meets).map(|j| (i, j)).collect::<Vec<_>>()
    })
}

/// Whether a contact's feature is a pair of edges.
pub fn is_pair(feature: usize) -> bool {
    feature as u64 & PAIR != 0
}

/// Feature number of a pair of edges, apart from those of nodes and samples: mixed from the numbers that name both.
fn numbered(of: [u32; 4]) -> usize {
    const MIX: u64 = 0x9e37_79b9_7f4a_7c15; // odd, 2^64 over the golden ratio
    let mixed = of.iter().fold(0_u64, |mixed, n| (mixed ^ u64::from(*n)).wrapping_mul(MIX).rotate_left(29));
    (mixed | PAIR) as usize
}

/// Contacts of these edges of two bodies, of which `patch` is the second's surface; those of boxes of edges up to `farther` beyond reach apart.
fn between(
    on: [BodyId; 2],
    (first, second): (&[Edge], &[Edge]),
    patch: &Patch,
    (reach, farther): (f64, f64),
    search: &Search,
) -> Vec<Contact> {
    let depth = |at: DVec3| -patch.project(at).2;
    let of_surface = |who: BodyId, edge: &Edge, share: f64| match who {
        BodyId::Deformable(_) => edge.material_point(share),
        _ => MaterialPoint::default(),
    };
    let touch = |(i, j): (usize, usize)| {
        let (one, two) = (&first[i], &second[j]);
        let (u, t, normal, gap) = cross(one, two, reach, search.angle_cone, &depth)?;
        let feature = numbered([one.nodes[0], one.nodes[1], two.nodes[0], two.nodes[1]]);
        let points = [of_surface(on[0], one, u), of_surface(on[1], two, t)];
        Some(Contact { points, ..Contact::between(on, feature, one.at(u), normal, gap, search) })
    };
    pairs(first, second, reach + farther).filter_map(touch).collect()
}

/// Contacts of a box's edges with those of a surface around it, whose `held` nodes touch the box; none if the tool is no box.
pub fn of_box(
    (rigid, tool): (usize, &Instrument),
    (number, patch, faces): (usize, &Patch, &[Face]),
    position: &impl Fn(u32) -> DVec3,
    held: &BTreeSet<u32>,
    search: &Search,
    travel: f64,
) -> Vec<Contact> {
    let Some(cuboid) = Cuboid::of(tool) else { return vec![] };
    let (own, skin) = (edges_of_box(&cuboid), edges_of(faces, position, held));
    let reach = search.alarm + search.distance + travel;
    let on = [BodyId::Rigid(rigid), BodyId::Deformable(number)];
    between(on, (&own, &skin), patch, (reach, patch.deepest(tool)), search)
}

/// Contacts of the edges of two deformable bodies' surfaces, of whose nodes these are `held` by the other; `patch` is the second's.
pub fn of_surfaces<P: Fn(u32) -> DVec3, Q: Fn(u32) -> DVec3>(
    (first, faces, position, held): (usize, &[Face], &P, &BTreeSet<u32>),
    (second, others, at, touched): (usize, &[Face], &Q, &BTreeSet<u32>),
    patch: &Patch,
    search: &Search,
) -> Vec<Contact> {
    let (own, theirs) = (edges_of(faces, position, held), edges_of(others, at, touched));
    let reach = search.alarm + search.distance;
    let on = [BodyId::Deformable(first), BodyId::Deformable(second)];
    // as deep again as they may be in a step
    between(on, (&own, &theirs), patch, (reach, reach), search)
}
