//! The outside of a mesh of tetrahedra, and what else is derived from it.
//!
//! The outside are the triangles of one tetrahedron alone. Each has the tetrahedra behind it: those that are reached from it first, from
//! tetrahedron to tetrahedron over their faces, if all triangles set out at once; the first of them counts at a tie, and a triangle's own
//! tetrahedron is always its own too. They divide the body as the columns of cells below their faces divide a grid, so a point that has sunk
//! into the body is behind a triangle.
//!
//! Where tetrahedra are removed, the triangles that come to light are added in time in proportion to the removed ones, once all are numbered. Each gets the box of the
//! triangle that the removed tetrahedron was behind, as of when all were found: what was behind that one, along tetrahedra that were
//! too, is still in the box of a triangle, that of the last removed tetrahedron on its way.

use super::{Face, Links};
use crate::formats;
use crate::math::{M3, V3, V4};
use crate::scene::TetrahedralMesh;
use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

/// Nobody's.
const NONE: u32 = u32::MAX;

/// Lowest and highest corner of a box, m.
pub type Extent = [[f64; 3]; 2];
/// Contains nothing.
pub(super) const EMPTY: Extent = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];

/// A mesh with what is derived from it.
#[derive(Clone, Debug)]
pub struct Unstructured {
    /// The mesh.
    pub mesh: Arc<TetrahedralMesh>,
    /// Its outside.
    pub outside: Outside,
    /// Faces that its tetrahedra share.
    pub links: Links,
    /// `[node]` quarter of the volumes around it, m³.
    pub around: Vec<f64>,
}

/// The outside of the tetrahedra of a mesh that are there.
#[derive(Clone, Debug, Default)]
pub struct Outside {
    /// Triangles; their cells are tetrahedra.
    pub faces: Vec<Face>,
    /// `[triangle]` lowest and highest corner of the box around the tetrahedra behind it, m.
    pub behind: Vec<Extent>,
    /// `[tetrahedron]` number, in `boxes`, of the triangle that it was behind when all were found; and the boxes of then.
    owner: Vec<u32>,
    boxes: Vec<Extent>,
    /// `[triangle]` its side, 4 × tetrahedron + opposite corner, and the number of the triangle of a side; empty until tetrahedra are removed.
    sides: Vec<u32>,
    numbers: BTreeMap<u32, u32>,
}

/// Extends a box to a point.
pub(super) fn extend([low, high]: &mut Extent, x: [f64; 3]) {
    (0..3).for_each(|n| (low[n], high[n]) = (low[n].min(x[n]), high[n].max(x[n])));
}

impl Outside {
    /// By whether a tetrahedron is there, what is beyond a face of it, and the outward nodes of a face with whether it is a wall.
    pub(super) fn found(
        mesh: &TetrahedralMesh,
        is_there: impl Fn(usize) -> bool,
        beyond: impl Fn(usize, usize) -> Option<usize>,
        face: impl Fn(usize, usize) -> ([u32; 3], bool),
    ) -> Self {
        let count = mesh.tetrahedra().len();
        let sides = (0..count).filter(|e| is_there(*e)).flat_map(|e| (0..4).map(move |opposite| (e, opposite)));
        let outside = sides.filter(|(e, opposite)| beyond(*e, *opposite).is_none());
        let mut outside: Vec<([u32; 3], Face)> = outside
            .map(|(e, opposite)| {
                let (nodes, wall) = face(e, opposite);
                let mut ids = nodes;
                ids.sort_unstable();
                (ids, Face { wall, ..Face::triangle(nodes, e as u32) })
            })
            .collect();
        outside.sort_by_key(|(ids, face)| (*ids, face.cell));
        let faces: Vec<Face> = outside.into_iter().map(|(_, face)| face).collect();
        let (owner, behind) = behind(mesh, &faces, beyond);
        Self { faces, boxes: behind.clone(), behind, owner, sides: vec![], numbers: BTreeMap::new() }
    }

    /// Numbers the triangles by their sides, once; `corners` of the tetrahedra.
    pub(super) fn number(&mut self, corners: &[[u32; 4]]) {
        if self.sides.is_empty() {
            let side = |face: &Face| {
                let opposite = corners[face.cell as usize].iter().position(|node| !face.nodes.contains(node));
                4 * face.cell + opposite.unwrap_or_else(|| unreachable!("a triangle leaves one corner out")) as u32
            };
            self.sides = self.faces.iter().map(side).collect();
            self.numbers = self.sides.iter().copied().zip(0..).collect();
        }
    }

    /// Takes the triangle of a side away, if there is one; the last triangle gets its number.
    pub(super) fn remove(&mut self, side: u32) {
        if let Some(number) = self.numbers.remove(&side) {
            let at = number as usize;
            self.faces.swap_remove(at);
            self.behind.swap_remove(at);
            self.sides.swap_remove(at);
            if let Some(moved) = self.sides.get(at) {
                self.numbers.insert(*moved, number);
            }
        }
    }

    /// Adds the triangle of a side behind which a removed tetrahedron was; `own` is the box of its own.
    pub(super) fn uncover(&mut self, removed: u32, side: u32, face: Face, mut own: Extent) {
        // whatever was behind the removed one has been behind the same triangle
        self.boxes[self.owner[removed as usize] as usize].iter().for_each(|x| extend(&mut own, *x));
        self.numbers.insert(side, self.faces.len() as u32);
        self.faces.push(face);
        self.behind.push(own);
        self.sides.push(side);
    }

    /// Size of the arrays, bytes.
    fn bytes(&self) -> usize {
        size_of_val(&self.faces[..])
            + size_of_val(&self.behind[..])
            + size_of_val(&self.owner[..])
            + size_of_val(&self.boxes[..])
    }
}

impl Unstructured {
    /// The outside of a mesh.
    pub fn new(mesh: &Arc<TetrahedralMesh>) -> Self {
        let tetrahedra = mesh.tetrahedra();
        let mut around = vec![0.0; mesh.nodes().len()];
        for (e, corners) in tetrahedra.iter().enumerate() {
            corners.iter().for_each(|id| around[*id as usize] += 0.25 * mesh.volume(e));
        }
        let links = Links::new(mesh);
        let beyond = |e: usize, opposite: usize| links.beyond(e, opposite);
        let outward =
            |e: usize, opposite: usize| (formats::Face([0; 3], (4 * e + opposite) as u64).outward(tetrahedra), false);
        let outside = Outside::found(mesh, |_| true, beyond, outward);
        Self { mesh: mesh.clone(), outside, links, around }
    }

    /// Size of the arrays, bytes.
    pub fn bytes(&self) -> usize {
        let mesh = &self.mesh;
        size_of_val(mesh.nodes())
            + size_of_val(mesh.tetrahedra())
            + size_of_val(mesh.layers())
            + self.outside.bytes()
            + size_of_val(&self.around[..])
            + self.links.bytes()
    }

    /// Gradients of the shape functions of corners 1 to 3 of a tetrahedron, 1/m.
    pub fn gradients(&self, e: usize) -> [V3<f64>; 3] {
        let [x, a, b, c] = self.mesh.corners(e).map(V3::of);
        let [a, b, c] = [a - x, b - x, c - x];
        let six = a.dot(b.cross(c));
        [b.cross(c), c.cross(a), a.cross(b)].map(|normal| normal * (1.0 / six))
    }

    /// Displacement gradient of a tetrahedron at displacements `u`, `[node]` m.
    pub fn displacement_gradient(&self, e: usize, u: &[V4<f64>]) -> M3<f64> {
        let [o, p, q, r] = self.mesh.tetrahedra()[e].map(|id| V3::from4(u[id as usize]));
        let [ga, gb, gc] = self.gradients(e);
        (p - o).outer(ga) + (q - o).outer(gb) + (r - o).outer(gc)
    }
}

/// `[tetrahedron]` triangle that it is behind, and boxes around those behind each triangle: see the module.
fn behind(
    mesh: &TetrahedralMesh,
    outside: &[Face],
    beyond: impl Fn(usize, usize) -> Option<usize>,
) -> (Vec<u32>, Vec<Extent>) {
    let mut owner = vec![NONE; mesh.tetrahedra().len()];
    let mut queue = VecDeque::new();
    for (number, face) in outside.iter().enumerate() {
        if owner[face.cell as usize] == NONE {
            owner[face.cell as usize] = number as u32;
            queue.push_back(face.cell as usize);
        }
    }
    while let Some(e) = queue.pop_front() {
        for next in (0..4).filter_map(|opposite| beyond(e, opposite)) {
            if owner[next] == NONE {
                owner[next] = owner[e];
                queue.push_back(next);
            }
        }
    }
    let mut boxes = vec![EMPTY; outside.len()];
    let mut add = |number: usize, e: usize| mesh.corners(e).into_iter().for_each(|x| extend(&mut boxes[number], x));
    let owned = owner.iter().enumerate().filter(|(_, number)| **number != NONE);
    owned.for_each(|(e, number)| add(*number as usize, e));
    outside.iter().enumerate().for_each(|(number, face)| add(number, face.cell as usize));
    (owner, boxes)
}
