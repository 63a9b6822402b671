//! Vertices, edges and faces of a patch of skin with their normal cones.
//!
//! A pair of features is a local minimum of the distance only if the direction between its points lies in the normal cones of both. Let d
//! be the unit direction from a skin vertex or edge to the tool, n the normalised sum of the unit normals of the triangles around it, and l
//! the unit directions in which what surrounds it ends there (for a vertex along its edges; for an edge across it, in the plane of each of
//! its triangles). The pair is refused when `n·d < −α` or when, for any l, `l·d < −(max(0, ½ n·l) + α)`; a face refuses `n·d < 0`. α widens
//! the cones (sine of an angle). At 0 a tool exactly above a vertex of a surface that is flat up to rounding would have no pair at all,
//! since the vertex is a dimple and no face has the point strictly inside.
//! Source: Johnson, Willemsen 2003 (local minima of distance by normal cones), in the form of SOFA's LocalMinDistance. Differs: they bound
//! cones of whole boxes of triangles to find all minima between two meshes; here the tool is a few lines and each pair is tested itself.

use super::closest::{self, Near};
use crate::collide::Patch;
use glam::DVec3;
use std::collections::BTreeMap;

/// SOFA's `coneFactor`: widening of a convex feature's cone beyond the exact one, so that no pair falls between two features.
const FACTOR: f64 = 0.5;

/// Normal cone of a feature.
#[derive(Clone, Debug, Default)]
pub struct Cone {
    /// Unit mean normal; zero for a tool's point, which has no triangles.
    pub normal: DVec3,
    /// Unit directions in which the surroundings of the feature end at it; none for a face.
    pub outward: Vec<DVec3>,
}

impl Cone {
    /// Whether the unit direction `d`, from the feature to the other body, is in the cone widened by `widen`.
    pub fn admits(&self, d: DVec3, widen: f64) -> bool {
        let (normal, outward) = (self.normal, &self.outward);
        let faces = normal.dot(d) >= if outward.is_empty() { 0.0 } else { -widen };
        faces && outward.iter().all(|l| l.dot(d) >= -((FACTOR * normal.dot(*l)).max(0.0) + widen))
    }
}

/// Vertex, edge or face of the skin.
#[derive(Clone, Debug)]
pub struct Feature {
    /// One to three node ids.
    pub nodes: Vec<u32>,
    /// Their positions, m.
    pub positions: Vec<DVec3>,
    /// Its normal cone.
    pub cone: Cone,
}

impl Feature {
    /// Nearest points of this feature and a tool's point or segment; none for segment and face, which only pierce.
    pub fn near(&self, ends: [DVec3; 2], point: bool) -> Option<Near> {
        match (point, &self.positions[..]) {
            (true, [q]) => Some(closest::point_vertex(ends[0], *q)),
            (true, [a, b]) => Some(closest::point_edge(ends[0], [*a, *b])),
            (true, [a, b, c]) => Some(closest::point_face(ends[0], [*a, *b, *c])),
            (false, [q]) => Some(closest::segment_vertex(ends, *q)),
            (false, [a, b]) => Some(closest::segment_edge(ends, [*a, *b])),
            _ => None,
        }
    }

    /// Point with the given weights.
    pub fn position(&self, weights: [f64; 3]) -> DVec3 {
        self.positions.iter().zip(weights).map(|(position, weight)| *position * weight).sum()
    }

    /// Nodes and weights as for a triangle; absent nodes have no weight.
    pub fn surface_point(&self, weights: [f64; 3]) -> ([u32; 3], [f64; 3]) {
        let last = self.nodes.len() - 1;
        let known = [0, 1, 2].map(|k| if k <= last { weights[k] } else { 0.0 });
        ([0, 1, 2].map(|k: usize| self.nodes[k.min(last)]), known)
    }
}

/// All features of a patch.
pub struct Features {
    /// Vertices, then edges, then the patch's triangles in their order.
    pub all: Vec<Feature>,
    /// `[triangle]` three corners, the edge after each of them, the face.
    of: Vec<[usize; 7]>,
    /// Triangles around each node.
    around: BTreeMap<u32, Vec<usize>>,
}

impl Features {
    /// Features of a patch at its present position.
    // vertices, edges, faces; each once, by its sorted nodes
    pub fn new(patch: &Patch) -> Self {
        let mut number: BTreeMap<Vec<u32>, usize> = BTreeMap::new();
        let mut all: Vec<Feature> = vec![];
        let mut of = vec![];
        for count in [1, 2, 3] {
            for (t, (nodes, positions)) in patch.triangles.iter().zip(&patch.corners).enumerate() {
                if count == 1 {
                    of.push([0; 7]);
                }
                for k in 0..if count == 3 { 1 } else { 3 } {
                    let picked: Vec<usize> = (0..count).map(|n| (k + n) % 3).collect();
                    let mut key: Vec<u32> = picked.iter().map(|i| nodes[*i]).collect();
                    key.sort_unstable();
                    let feature = || Feature {
                        nodes: picked.iter().map(|i| nodes[*i]).collect(),
                        positions: picked.iter().map(|i| positions[*i]).collect(),
                        cone: Cone::default(),
                    };
                    let id = *number.entry(key).or_insert_with(|| {
                        all.push(feature());
                        all.len() - 1
                    });
                    of[t][3 * (count - 1) + k] = id;
                }
            }
        }
        // triangles around each node, then the cones
        let mut around: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for (t, node) in patch.triangles.iter().enumerate().flat_map(|(t, nodes)| nodes.map(|node| (t, node))) {
            around.entry(node).or_default().push(t);
        }
        let mut features = Self { all, of, around };
        features.look(patch);
        features
    }

    /// Computes the cones.
    fn look(&mut self, patch: &Patch) {
        for (t, corners) in patch.corners.iter().enumerate() {
            let normal = patch.face_normal(t);
            for id in self.of[t] {
                self.all[id].cone.normal += normal;
            }
            for k in 0..3 {
                let [a, b, c] = [k, (k + 1) % 3, (k + 2) % 3].map(|n| corners[n]);
                let edge = (b - a).normalize_or_zero();
                // across the edge from a to b, out of the triangle
                self.all[self.of[t][3 + k]].cone.outward.push(edge.cross(normal));
                // along both edges that end at a; an edge of two triangles counts twice, which changes nothing
                let along = [(a - b).normalize_or_zero(), (a - c).normalize_or_zero()];
                self.all[self.of[t][k]].cone.outward.extend(along);
            }
        }
        for feature in &mut self.all {
            feature.cone.normal = feature.cone.normal.normalize_or_zero();
        }
    }

    /// Features of triangles, each once, in order.
    pub fn of(&self, triangles: &[u32]) -> Vec<usize> {
        let mut ids: Vec<usize> = triangles.iter().flat_map(|t| self.of[*t as usize]).collect();
        ids.sort_unstable();
        ids.dedup();
        ids
    }

    /// Faces at any of these nodes, each once, in order.
    pub fn faces_at(&self, nodes: &[u32]) -> Vec<&Feature> {
        let mut found: Vec<usize> = nodes.iter().filter_map(|node| self.around.get(node)).flatten().copied().collect();
        found.sort_unstable();
        found.dedup();
        found.into_iter().map(|t| &self.all[self.of[t][6]]).collect()
    }

    /// Vertex, edge or face of a triangle that contains the point of these weights strictly.
    pub fn holding(&self, triangle: usize, weights: [f64; 3]) -> &Feature {
        let of = &self.of[triangle];
        let used: Vec<usize> = (0..3).filter(|k| weights[*k] > closest::MARGIN).collect();
        &self.all[match used[..] {
            [k] => of[k],
            [0, 1] => of[3],
            [1, 2] => of[4],
            [0, 2] => of[5],
            _ => of[6],
        }]
    }
}
