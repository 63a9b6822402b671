//! Contacts between the two lips of a wound.
//!
//! A severed link leaves two faces with the same rest nodes, one on each lip. Each pair of separated nodes is one contact: its normal is
//! the mean of the present faces around it, its gap the nodes' separation along it. Lips that have slid along each other by less than a
//! cell are thus told apart; beyond that the nodes no longer face each other. Lips are wet: there is no friction between them.

use super::{Contact, frame};
use crate::constraints::Law;
use crate::kernels::corner;
use crate::mesh::{MaterialPoint, Parts, TetrahedralParts};
use crate::scene::BodyId;
use glam::DVec3;
use std::collections::BTreeMap;

/// Two faces left by a severed link: their nodes around the face, seen along the link, on its lower and its upper side; a triangle has its
/// third one twice.
pub type Lips = [[u32; 4]; 2];

/// Faces of all severed links.
pub fn faces(parts: &Parts) -> Vec<Lips> {
    let mut out = vec![];
    for (cell, axis, _) in parts.cuts() {
        let Some(beyond) = parts.beyond(cell as usize, axis) else { continue };
        let sides = [(parts.corners(cell as usize), 1), (parts.corners(beyond), 0)];
        out.push(sides.map(|(corners, side)| around(axis, side).map(|a| corners[a] as u32)));
    }
    out
}

/// The same of a mesh.
pub fn triangles(parts: &TetrahedralParts) -> Vec<Lips> {
    parts.cuts().map(|link| parts.faces(link).map(|[a, b, c]| [a, b, c, c])).collect()
}

/// Corner numbers around a cell's face across an axis, counterclockwise seen against the axis.
fn around(axis: usize, side: usize) -> [usize; 4] {
    [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[u, v]| {
        let mut wanted = [side; 3];
        (wanted[(axis + 1) % 3], wanted[(axis + 2) % 3]) = (u, v);
        (0..8).find(|a| corner(*a) == wanted).unwrap_or(0)
    })
}

/// Contacts of lips closer than `alarm`, m, the deepest first; none at constrained nodes.
pub fn contacts(
    body: usize,
    lips: &[Lips],
    position: impl Fn(u32) -> DVec3,
    free: impl Fn(u32) -> bool,
    alarm: f64,
) -> Vec<Contact> {
    // per node pair: area-weighted normal from the first to the second, and the shortest diagonal
    let mut pairs: BTreeMap<(u32, u32), (DVec3, f64)> = BTreeMap::new();
    for [before, beyond] in lips {
        let [(p, q), (r, s)] = [before, beyond].map(|face| {
            let [a, b, c, d] = face.map(&position);
            (c - a, d - b)
        });
        let normal = p.cross(q) + r.cross(s);
        let diagonal = [p, q, r, s].into_iter().map(DVec3::length).fold(f64::INFINITY, f64::min);
        for (near, far) in before.iter().zip(beyond).filter(|(near, far)| near != far && free(**near) && free(**far)) {
            let sign = if near < far { 1.0 } else { -1.0 };
            let pair = pairs.entry((*near.min(far), *near.max(far))).or_insert((DVec3::ZERO, f64::INFINITY));
            *pair = (pair.0 + normal * sign, pair.1.min(diagonal));
        }
    }
    // a contact for each pair that still faces each other
    let mut out = vec![];
    for ((first, second), (normal, diagonal)) in pairs {
        let Some(normal) = normal.try_normalize() else { continue };
        let [near, far] = [first, second].map(&position);
        let gap = normal.dot(far - near);
        let faces = (far - near - normal * gap).length() < diagonal;
        if gap < alarm && faces {
            out.push(Contact {
                on: [BodyId::Deformable(body); 2],
                points: [MaterialPoint::node(second), MaterialPoint::node(first)],
                feature: (first as usize) << 32 | second as usize,
                point: (near + far) * 0.5,
                axes: frame(normal),
                gap: [gap, 0.0, 0.0],
                depth: 0.0,
                law: Law::contact(0.0),
            });
        }
    }
    out.sort_by(|a, b| a.gap[0].total_cmp(&b.gap[0]).then(a.feature.cmp(&b.feature)));
    out
}
