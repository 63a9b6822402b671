//! Connectivity of a mesh of tetrahedra under cuts: severed links over shared faces, and the connected components of tetrahedra around each
//! node.
//!
//! A link joins the two tetrahedra on a face. Where links no longer join the tetrahedra around a node, each component gets a node of its
//! own: the larger one keeps the node (at a tie the one with the lowest tetrahedron), the other gets a duplicate from a reserve, so no volume
//! is lost. The faces of a severed link are both on the surface, with the nodes of their own sides. Tetrahedra that are removed take their
//! links with them.
//!
//! Crossed links store the position of the crossing. A corner of the wound lies at the mean of the crossings around it ([`super::Corner`]),
//! by at most half of the shortest edge there, which gives a smooth wound in a mesh that the blade does not follow. On the outside of the body
//! it stays there. It moves with the tetrahedron of its own component that it is inside, or nearest to.
//!
//! A link whose cut would set free a piece of fewer than [`FRAGMENT`] tetrahedra holds, as between hexahedra ([`super::Parts`]). One that
//! would need more duplicates, or more edges of the smoothed element ([`EDGES`]), than there is room for is refused.
//!
//! After removals no two tetrahedra meet in a node or an edge alone: of the components around each, by faces that hold it, only the largest
//! stays. What is on the outside is found anew for the whole mesh after a cut, and around what was removed after a removal.
//! Source: Molino, Bao, Fedkiw 2004 (virtual nodes); Sase et al. 2015 (removal that keeps the surface a manifold); differs from both: what
//! hangs by a node or an edge is removed, not joined or split.

use super::parts::FRAGMENT;
use super::unstructured::{EMPTY, Extent, extend};
use super::{Corner, Face, Outside, PAIRS, Unstructured};
use crate::formats;
use crate::math::{V3, V4};
use glam::DVec3;
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Room for edges that a duplicate divides, in one material each. In a triangulated wall three edges are there for each node, and those at the
/// borders of layers count once for each.
pub const EDGES: usize = 8;

/// Sine of the angle between normals of the outside from which on an edge is between them: 20°.
const EDGE: f64 = 0.34;

/// Changes by a cut.
#[derive(Clone, Debug, Default)]
pub struct Severed {
    /// Severed links.
    pub links: Vec<u32>,
    /// Number of links that stay intact because the reserve is used up.
    pub refused: u32,
    /// Number of links that stay intact because they alone hold a piece too small to be free.
    pub holding: u32,
    /// New duplicates, each with the node whose state it copies, as of before the cut.
    pub copies: Vec<[u32; 2]>,
    /// Tetrahedra with other corners than before, sorted.
    pub tetrahedra: Vec<u32>,
}

/// Tetrahedra of a mesh as they are cut: see the module.
#[derive(Clone, Debug)]
pub struct TetrahedralParts {
    of: Arc<Unstructured>,
    reserve: usize,
    /// `[tetrahedron]` nodes; empty while they are those of the mesh.
    corners: Vec<[u32; 4]>,
    present: Vec<bool>,              // [tetrahedron]
    severed: Vec<bool>,              // [link]
    crossings: BTreeMap<u32, f64>,   // position of the crossing along each severed link, 0 to 1
    wounded: BTreeSet<u32>,          // nodes of the mesh at severed links
    held: BTreeMap<u32, Vec<DVec3>>, // directions that corners of the outside keep to
    originals: Vec<u32>,             // [duplicate] node of the mesh
    edges: usize,                    // divided so far
    around: [Vec<u32>; 2],           // CSR of the tetrahedra around each node of the mesh; empty before the first cut
    outside: Option<Outside>,
}

impl TetrahedralParts {
    /// An uncut mesh with room for `reserve` duplicates.
    pub fn new(of: Arc<Unstructured>, reserve: usize) -> Self {
        let (count, links) = (of.mesh.tetrahedra().len(), of.links.sides.len());
        Self {
            of,
            reserve,
            corners: vec![],
            present: vec![true; count],
            severed: vec![false; links],
            crossings: BTreeMap::new(),
            wounded: BTreeSet::new(),
            held: BTreeMap::new(),
            originals: vec![],
            edges: 0,
            around: Default::default(),
            outside: None,
        }
    }

    /// `[tetrahedron]` nodes as it is cut now, of removed ones as before.
    pub fn corners(&self) -> &[[u32; 4]] {
        if self.corners.is_empty() { self.of.mesh.tetrahedra() } else { &self.corners }
    }

    /// `[tetrahedron]` false if removed.
    pub fn present(&self) -> &[bool] {
        &self.present
    }

    /// The outside of what is left.
    pub fn outside(&self) -> &Outside {
        self.outside.as_ref().unwrap_or(&self.of.outside)
    }

    /// Original of a duplicate; the node itself if it is none.
    pub fn original(&self, node: usize) -> usize {
        node.checked_sub(self.of.mesh.nodes().len()).map_or(node, |copy| self.originals[copy] as usize)
    }

    /// Duplicates of a node of the mesh.
    pub fn copies(&self, node: usize) -> Vec<u32> {
        let first = self.of.mesh.nodes().len() as u32;
        (first..)
            .zip(&self.originals)
            .filter(|(_, original)| **original as usize == node)
            .map(|(copy, _)| copy)
            .collect()
    }

    /// True for a node of the mesh and for a duplicate that has been taken.
    pub fn in_use(&self, node: usize) -> bool {
        node < self.of.mesh.nodes().len() + self.originals.len()
    }

    /// Severed links with both of their tetrahedra left.
    pub fn cuts(&self) -> impl Iterator<Item = usize> {
        let left = |link: &usize| self.severed[*link] && self.of.links.ends(*link).iter().all(|e| self.present[*e]);
        (0..self.severed.len()).filter(left)
    }

    /// Nodes of both faces of a link, in the same order, counter-clockwise seen against the way from the first tetrahedron to the second.
    pub fn faces(&self, link: usize) -> [[u32; 3]; 2] {
        let [near, far] = self.of.links.sides[link];
        let face = self.outward(near as usize / 4, near as usize % 4);
        // the other tetrahedron has the same originals
        let other = self.corners()[far as usize / 4];
        let twin =
            |node: u32| other.into_iter().find(|own| self.original(*own as usize) == self.original(node as usize));
        [face, face.map(|node| twin(node).unwrap_or_else(|| unreachable!("the two share the face")))]
    }

    /// Both sides of a link: a tetrahedron, and its corner opposite to the face.
    pub fn sides(&self, link: usize) -> [(usize, usize); 2] {
        self.of.links.sides[link].map(|side| (side as usize / 4, side as usize % 4))
    }

    /// Node triple of a face of a tetrahedron, outward.
    pub fn outward(&self, e: usize, opposite: usize) -> [u32; 3] {
        formats::Face([0; 3], (4 * e + opposite) as u64).outward(self.corners())
    }

    /// The mesh with what is derived from it.
    pub fn mesh(&self) -> &Unstructured {
        &self.of
    }

    /// Tetrahedron beyond a face that an intact link joins.
    pub fn beyond(&self, e: usize, opposite: usize) -> Option<usize> {
        self.of.links.over(e, opposite).filter(|link| !self.severed[*link])?;
        self.of.links.beyond(e, opposite).filter(|other| self.present[*other])
    }

    /// Tetrahedra that intact links join to one over faces that hold all of some of its nodes, up to a number of them; sorted.
    fn component(&self, first: usize, holding: &[u32], most: usize) -> Vec<usize> {
        let mut found = vec![first];
        let mut seen = 0;
        while seen < found.len() && found.len() < most {
            let e = found[seen];
            for opposite in (0..4).filter(|k| !holding.contains(&self.corners()[e][*k])) {
                if let Some(other) = self.beyond(e, opposite).filter(|other| !found.contains(other)) {
                    found.push(other);
                }
            }
            seen += 1;
        }
        found.sort_unstable();
        found
    }

    /// Whether a tetrahedron is of a piece of fewer than [`FRAGMENT`].
    fn is_fragment(&self, e: usize) -> bool {
        self.component(e, &[], FRAGMENT).len() < FRAGMENT
    }

    /// Number of connected pieces.
    pub fn pieces(&self) -> usize {
        let mut seen: Vec<bool> = self.present.iter().map(|present| !present).collect();
        let (mut count, mut open) = (0, vec![]);
        for first in 0..seen.len() {
            if std::mem::replace(&mut seen[first], true) {
                continue;
            }
            count += 1;
            open.push(first);
            while let Some(e) = open.pop() {
                for next in (0..4).filter_map(|k| self.beyond(e, k)) {
                    if !std::mem::replace(&mut seen[next], true) {
                        open.push(next);
                    }
                }
            }
        }
        count
    }

    /// Share of a tetrahedron's neighbours in the mesh that it is still linked to, 0 to 1; 1 without neighbours.
    pub fn linked_share(&self, e: usize) -> f64 {
        let all = (0..4).filter(|k| self.of.links.over(e, *k).is_some()).count();
        let linked = (0..4).filter(|k| self.beyond(e, *k).is_some()).count();
        if all > 0 { linked as f64 / all as f64 } else { 1.0 }
    }

    /// `[node]` quarter of the volumes of the present tetrahedra around it, m³.
    pub fn volumes(&self) -> Cow<'_, [f64]> {
        if self.outside.is_none() {
            return Cow::Borrowed(&self.of.around);
        }
        let mut out = vec![0.0; self.of.mesh.nodes().len() + self.reserve];
        for e in (0..self.present.len()).filter(|e| self.present[*e]) {
            let quarter = 0.25 * self.of.mesh.volume(e);
            self.corners()[e].iter().for_each(|node| out[*node as usize] += quarter);
        }
        Cow::Owned(out)
    }

    /// Makes the lists of the first cut, once.
    pub(super) fn prepare(&mut self) {
        if self.around[0].is_empty() {
            let tetrahedra = self.of.mesh.tetrahedra();
            let mut first = vec![0; self.of.mesh.nodes().len() + 1];
            tetrahedra.as_flattened().iter().for_each(|node| first[*node as usize + 1] += 1);
            (1..first.len()).for_each(|n| first[n] += first[n - 1]);
            let (mut next, mut entries) = (first.clone(), vec![0; 4 * tetrahedra.len()]);
            for (entry, node) in tetrahedra.as_flattened().iter().enumerate() {
                entries[next[*node as usize] as usize] = (entry / 4) as u32;
                next[*node as usize] += 1;
            }
            self.around = [first, entries];
            for face in &self.of.outside.faces {
                let [a, b, c] = [0, 1, 2].map(|k| self.rest(face.nodes[k]));
                let normal = (b - a).cross(c - a).normalize_or_zero();
                for node in face.corners() {
                    let own = self.held.entry(*node).or_default();
                    let rest = own.iter().fold(normal, |rest, held| rest - *held * held.dot(rest));
                    // a smooth surface has one direction, an edge two, a tip three
                    if rest.length() > EDGE {
                        own.push(rest.normalize());
                    }
                }
            }
        }
    }

    fn rest(&self, node: u32) -> DVec3 {
        DVec3::from_array(self.of.mesh.nodes()[self.original(node as usize)])
    }

    /// Tetrahedra around a node of the mesh; none before the first cut.
    fn all_around(&self, original: usize) -> impl Iterator<Item = usize> {
        let [first, entries] = &self.around;
        let own = first.get(original..original + 2).map_or(0..0, |own| own[0] as usize..own[1] as usize);
        entries[own].iter().map(|e| *e as usize)
    }

    /// Present tetrahedra around a node as it is now; none before the first cut.
    pub fn around(&self, node: u32) -> Vec<usize> {
        let is_here = |e: &usize| self.present[*e] && self.corners()[*e].contains(&node);
        self.all_around(self.original(node as usize)).filter(is_here).collect()
    }

    /// Whether a node of a present tetrahedron is on the outside; not known before the first cut.
    pub(super) fn is_outside(&self, node: u32) -> bool {
        let open = |e: &usize| (0..4).any(|k| self.corners()[*e][k] != node && self.beyond(*e, k).is_none());
        self.around(node).iter().any(open)
    }

    /// Unit normals of the outside of the whole mesh at a node, perpendicular to each other; none before the first cut.
    pub(super) fn held(&self, node: u32) -> &[DVec3] {
        self.held.get(&(self.original(node as usize) as u32)).map_or(&[], |held| held)
    }

    /// Offset of the surface corner from the rest position of a node, m; zero where no link is cut.
    pub(super) fn offset(&self, node: u32) -> DVec3 {
        let (original, at, mesh) = (self.original(node as usize) as u32, self.rest(node), &self.of.mesh);
        if !self.wounded.contains(&original) {
            return DVec3::ZERO;
        }
        let (mut sum, mut count, mut shortest) = (DVec3::ZERO, 0.0, f64::INFINITY);
        for e in self.all_around(original as usize) {
            let corners = mesh.tetrahedra()[e];
            let beside = corners.iter().filter(|other| **other != original);
            shortest = beside.map(|other| self.rest(*other).distance(at)).fold(shortest, f64::min);
            // faces that hold the node, from their lower tetrahedron
            for link in (0..4).filter(|k| corners[*k] != original).filter_map(|k| self.of.links.over(e, k)) {
                let ends = self.of.links.ends(link);
                if let Some(share) = self.crossings.get(&(link as u32)).filter(|_| ends[0] == e) {
                    let [near, far] = ends.map(|e| mesh.corners(e).map(DVec3::from_array).iter().sum::<DVec3>() * 0.25);
                    sum += near.lerp(far, *share) - at;
                    count += 1.0;
                }
            }
        }
        self.held(node)
            .iter()
            .fold(sum / count, |rest, held| rest - *held * held.dot(rest))
            .clamp_length_max(0.5 * shortest)
    }

    /// Surface corner at a node; a node without a cut link or without tetrahedra is its own corner.
    pub fn corner(&self, node: usize) -> Corner {
        let id = node as u32;
        let offset = self.offset(id);
        let mut own =
            Corner { offset: offset.to_array(), nodes: [id; 8], weights: [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0] };
        if offset == DVec3::ZERO {
            return own;
        }
        let at = (self.rest(id) + offset).to_array();
        let mut most = f64::NEG_INFINITY;
        for e in self.around(id) {
            let weights = self.of.mesh.weights(e, at);
            let least = weights.into_iter().fold(f64::INFINITY, f64::min);
            if least > most {
                most = least;
                own.nodes[..4].copy_from_slice(&self.corners()[e]);
                own.weights[..4].copy_from_slice(&weights);
            }
        }
        own
    }

    /// Severs links, each at a position along it, in the given order; those that are already cut, or gone with a tetrahedron, keep their state.
    pub fn cut(&mut self, hits: impl Iterator<Item = (u32, f64)>) -> Severed {
        self.prepare();
        let mut out = Severed::default();
        let mut changed = BTreeSet::new();
        for (link, at) in hits {
            let ends = self.of.links.ends(link as usize);
            if self.severed[link as usize] || ends.iter().any(|e| !self.present[*e]) {
                continue;
            }
            let face = self.faces(link as usize)[0];
            self.severed[link as usize] = true;
            if ends.iter().any(|e| self.is_fragment(*e)) {
                self.severed[link as usize] = false;
                out.holding += 1;
                continue;
            }
            // nodes that the link alone kept whole, with the tetrahedra that leave them
            let leaving: Vec<(u32, Vec<usize>)> =
                face.into_iter().filter_map(|node| Some((node, self.leaving(node, ends)?))).collect();
            let edges: usize = leaving.iter().map(|(node, own)| self.divided_edges(*node, own, &face)).sum();
            if self.originals.len() + leaving.len() > self.reserve || self.edges + edges > EDGES * self.reserve {
                self.severed[link as usize] = false;
                out.refused += 1;
                continue;
            }
            self.edges += edges;
            self.crossings.insert(link, at);
            self.wounded.extend(face.map(|node| self.original(node as usize) as u32));
            for (node, own) in leaving {
                out.copies.push([self.take_copy(node, &own), node]);
                changed.extend(own.into_iter().map(|e| e as u32));
            }
            out.links.push(link);
        }
        // the source of a new duplicate may be new itself
        let sources: BTreeMap<u32, u32> = out.copies.iter().map(|[copy, source]| (*copy, *source)).collect();
        for [_, source] in &mut out.copies {
            while let Some(older) = sources.get(source) {
                *source = *older;
            }
        }
        out.tetrahedra = changed.into_iter().collect();
        if !out.links.is_empty() {
            self.outside = Some(self.find_outside());
        }
        out
    }

    /// Tetrahedra that get a duplicate of a node, if the two tetrahedra of a severed link are no longer joined around it.
    fn leaving(&self, node: u32, [near, far]: [usize; 2]) -> Option<Vec<usize>> {
        // where a side has another node already, they have parted before
        if [near, far].iter().any(|e| !self.corners()[*e].contains(&node)) {
            return None;
        }
        let first = self.component(near, &[node], usize::MAX);
        if first.contains(&far) {
            return None;
        }
        let second = self.component(far, &[node], usize::MAX);
        let keeps = |one: &[usize], other: &[usize]| (one.len(), other[0]) > (other.len(), one[0]);
        Some(if keeps(&first, &second) { second } else { first })
    }

    /// Number of edges at a node, of one layer each, that a component that leaves it shares with what stays; those of the severed face,
    /// whose other ends may be divided too, count twice.
    fn divided_edges(&self, node: u32, own: &[usize], face: &[u32]) -> usize {
        let mesh = &self.of.mesh;
        let stay: Vec<usize> = self.around(node).into_iter().filter(|e| own.binary_search(e).is_err()).collect();
        let edges = |list: &[usize]| -> BTreeSet<(u32, u32)> {
            let of = |e: &usize| self.corners()[*e].map(|other| (other, mesh.layers()[*e]));
            list.iter().flat_map(of).filter(|(other, _)| *other != node).collect()
        };
        edges(own).intersection(&edges(&stay)).map(|(other, _)| 1 + usize::from(face.contains(other))).sum()
    }

    /// Gives tetrahedra a duplicate in place of a node.
    fn take_copy(&mut self, node: u32, own: &[usize]) -> u32 {
        let copy = (self.of.mesh.nodes().len() + self.originals.len()) as u32;
        self.originals.push(self.original(node as usize) as u32);
        if self.corners.is_empty() {
            self.corners = self.of.mesh.tetrahedra().to_vec();
        }
        for e in own {
            self.corners[*e].iter_mut().filter(|corner| **corner == node).for_each(|corner| *corner = copy);
        }
        copy
    }

    /// The outside after a cut: a triangle that another one had on its other side is a wall. Takes time in proportion to the mesh.
    fn find_outside(&self) -> Outside {
        let Unstructured { mesh, links, .. } = self.mesh();
        let mut out = Outside::found(
            mesh,
            |e| self.present[e],
            |e, opposite| self.beyond(e, opposite),
            |e, opposite| (self.outward(e, opposite), links.over(e, opposite).is_some()),
        );
        out.faces.iter().zip(&mut out.behind).for_each(|(face, behind)| self.add_corners(face, behind));
        out
    }

    /// Extends a box to the corners of a triangle: those of the wound lie beside their nodes.
    fn add_corners(&self, face: &Face, behind: &mut Extent) {
        face.corners().iter().for_each(|node| extend(behind, (self.rest(*node) + self.offset(*node)).to_array()));
    }

    /// Volume at rest of the tetrahedra that are there, by the `share` of each, with the nodes that they have now, and its change at displacements
    /// `u`, `[node]` m, m³.
    pub fn volume(&self, share: impl Fn(usize) -> f64, u: &[V4<f64>]) -> [f64; 2] {
        let mut sum = [0.0; 2];
        for (e, ids) in self.corners().iter().enumerate().filter(|(e, _)| self.present()[*e]) {
            let x = self.of.mesh.corners(e).map(V3::of);
            let u = ids.map(|id| V3::from4(u[id as usize]));
            // 6 V = a·(b × c) of the edges; its change without the difference of two volumes
            let ([a, b, c], [p, q, r]) = ([1, 2, 3].map(|k| x[k] - x[0]), [1, 2, 3].map(|k| u[k] - u[0]));
            let linear = p.dot(b.cross(c)) + a.dot(q.cross(c)) + a.dot(b.cross(r));
            let rest = a.dot(q.cross(r)) + p.dot(b.cross(r)) + p.dot(q.cross(c)) + p.dot(q.cross(r));
            let sixth = share(e) / 6.0;
            sum = [sum[0] + a.dot(b.cross(c)) * sixth, sum[1] + (linear + rest) * sixth];
        }
        sum
    }

    /// Removes tetrahedra.
    pub fn remove(&mut self, gone: &[u32]) {
        self.prepare();
        let mut new = gone.to_vec();
        new.retain(|e| std::mem::replace(&mut self.present[*e as usize], false));
        self.uncover(&new);
    }

    /// Removes tetrahedra, then what they leave that hangs by an edge or a node, and pieces of fewer than [`FRAGMENT`]; returns all that
    /// went, in order.
    pub fn carve(&mut self, chosen: &[u32]) -> Vec<u32> {
        self.prepare();
        let mut out = vec![];
        let mut next: Vec<u32> = chosen.to_vec();
        while !next.is_empty() {
            next.sort_unstable();
            next.dedup();
            next.retain(|e| self.present[*e as usize]);
            next.iter().for_each(|e| self.present[*e as usize] = false);
            out.extend(&next);
            next = self.hanging(&next);
        }
        self.uncover(&out);
        out
    }

    /// Has the outside follow the removal of tetrahedra, in time in proportion to them, but for the first removal after the start or a cut.
    fn uncover(&mut self, gone: &[u32]) {
        if gone.is_empty() {
            return;
        }
        let mut outside = self.outside.take().unwrap_or_else(|| self.of.outside.clone());
        outside.number(self.corners());
        gone.iter().flat_map(|e| 4 * e..4 * e + 4).for_each(|side| outside.remove(side));
        let links = &self.of.links;
        for (e, k) in gone.iter().flat_map(|e| (0..4).map(move |k| (*e, k))) {
            let Some(link) = links.over(e as usize, k).filter(|link| !self.severed[*link]) else { continue };
            let [a, b] = links.sides[link];
            let side = if a == 4 * e + k as u32 { b } else { a };
            let [other, opposite] = [side / 4, side % 4].map(|n| n as usize);
            if self.present[other] {
                let face = Face { wall: true, ..Face::triangle(self.outward(other, opposite), other as u32) };
                let mut own = EMPTY;
                self.of.mesh.corners(other).into_iter().for_each(|x| extend(&mut own, x));
                self.add_corners(&face, &mut own);
                outside.uncover(e, side, face, own);
            }
        }
        self.outside = Some(outside);
    }

    /// Tetrahedra that hang by a node or an edge, or in a piece too small, after the removal of others.
    fn hanging(&self, removed: &[u32]) -> Vec<u32> {
        // nodes and edges of what went
        let mut held: BTreeSet<Vec<u32>> = BTreeSet::new();
        for corners in removed.iter().map(|e| self.corners()[*e as usize]) {
            held.extend(corners.map(|node| vec![node]));
            held.extend(PAIRS.map(|[a, b]| vec![corners[a], corners[b]]).map(|mut edge| {
                edge.sort_unstable();
                edge
            }));
        }
        let mut out = vec![];
        for holding in held {
            let mut around = self.around(holding[0]);
            around.retain(|e| holding.iter().all(|node| self.corners()[*e].contains(node)));
            let mut best: Vec<usize> = vec![];
            while let Some(first) = around.first().copied() {
                let found = self.component(first, &holding, usize::MAX);
                around.retain(|e| found.binary_search(e).is_err());
                let less = if found.len() > best.len() { std::mem::replace(&mut best, found) } else { found };
                out.extend(less.iter().map(|e| *e as u32));
            }
        }
        let neighbours = removed.iter().flat_map(|e| (0..4).map(move |k| (*e as usize, k)));
        let neighbours: Vec<usize> = neighbours.filter_map(|(e, k)| self.beyond(e, k)).collect();
        for e in neighbours {
            let found = self.component(e, &[], FRAGMENT);
            if found.len() < FRAGMENT {
                out.extend(found.iter().map(|e| *e as u32));
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;
    use crate::mesh::Grid;
    use crate::scene::{Layer, Skin, TetrahedralMesh};

    fn block(cells: [u32; 2], levels: u32) -> TetrahedralParts {
        let layer = Layer { thickness: 1e-3 * f64::from(levels), cells: levels, ..Layer::default() };
        let raster = Skin { size: cells.map(|n| 1e-3 * f64::from(n)), cells, layers: vec![layer], ..Skin::default() };
        let grid = Grid::new(&raster);
        let nodes = (0..grid.node_count()).map(|node| grid.rest(node)).collect();
        let tetrahedra: Vec<[u32; 4]> = grid.tetrahedra().into_iter().map(|(corners, _)| corners).collect();
        let layers = vec![0; tetrahedra.len()];
        let mesh = TetrahedralMesh::new(nodes, tetrahedra, layers).unwrap_or_else(|defect| panic!("{defect}"));
        TetrahedralParts::new(Arc::new(Unstructured::new(&Arc::new(mesh))), 400)
    }

    /// Triangles in order, and whether every tetrahedron that is there is in the box of one of them.
    fn triangles(parts: &TetrahedralParts, outside: &Outside) -> (Vec<[u32; 5]>, bool) {
        let mut faces: Vec<[u32; 5]> = (outside.faces.iter())
            .map(|face| {
                let [a, b, c, _] = face.nodes;
                [face.cell, a, b, c, u32::from(face.wall)]
            })
            .collect();
        faces.sort_unstable();
        assert_eq!(outside.faces.len(), outside.behind.len());
        let within = |x: [f64; 3], [low, high]: &Extent| (0..3).all(|n| low[n] <= x[n] && x[n] <= high[n]);
        let covered = |e: usize| {
            let corners = parts.of.mesh.corners(e);
            outside.behind.iter().any(|behind| corners.iter().all(|x| within(*x, behind)))
        };
        let all = (0..parts.present.len()).filter(|e| parts.present[*e]).all(covered);
        let own = outside
            .faces
            .iter()
            .zip(&outside.behind)
            .all(|(face, behind)| parts.of.mesh.corners(face.cell as usize).iter().all(|x| within(*x, behind)));
        (faces, all && own)
    }

    #[test]
    fn the_outside_follows_removals_as_it_is_found_anew() {
        for seed in 1..5 {
            let (mut parts, mut random) = (block([5, 4], 4), Random::new(seed));
            let count = parts.present.len();
            let mut gone = 0;
            while 10 * gone < 9 * count {
                if random.below(8) == 0 {
                    let links: Vec<(u32, f64)> =
                        (0..6).map(|_| (random.below(parts.severed.len() as u64) as u32, 0.5)).collect();
                    parts.cut(links.into_iter());
                }
                let chosen: Vec<u32> = (0..=random.below(4)).map(|_| random.below(count as u64) as u32).collect();
                let before = parts.outside().faces.len();
                let removed = parts.carve(&chosen).len();
                gone += removed;
                let fresh = parts.find_outside();
                assert_eq!(
                    triangles(&parts, parts.outside()),
                    (triangles(&parts, &fresh).0, true),
                    "seed {seed}, {gone}"
                );
                assert!(removed == 0 || before > 0);
            }
        }
        // the counter-test: triangles with boxes of their own tetrahedra alone leave some uncovered
        let mut parts = block([5, 4], 4);
        parts.carve(&[0]);
        let mut outside = parts.outside().clone();
        for (face, behind) in outside.faces.iter().zip(&mut outside.behind) {
            *behind = EMPTY;
            parts.of.mesh.corners(face.cell as usize).into_iter().for_each(|x| extend(behind, x));
        }
        assert!(!triangles(&parts, &outside).1);
    }
}
