//! The outside of a mesh of tetrahedra, and what else is derived from it.
//!
//! The outside are the triangles of one tetrahedron alone. Each has the tetrahedra behind it: those that are reached from it first, from
//! tetrahedron to tetrahedron over their faces, if all triangles set out at once; the first of them counts at a tie, and a triangle's own
//! tetrahedron is always its own too. They divide the body as the columns of cells below their faces divide a grid, so a point that has sunk
//! into the body is behind a triangle.

use super::Face;
use crate::formats::faces;
use crate::math::{M3, V3, V4};
use crate::scene::TetrahedralMesh;
use std::collections::VecDeque;
use std::sync::Arc;

/// Nobody's.
const NONE: u32 = u32::MAX;

/// A mesh with what is derived from it.
#[derive(Clone, Debug)]
pub struct Unstructured {
    /// The mesh.
    pub mesh: Arc<TetrahedralMesh>,
    /// Its outside.
    pub outside: Outside,
    /// `[node]` quarter of the volumes around it, m³.
    pub around: Vec<f64>,
}

/// The outside of the tetrahedra of a mesh that are there.
#[derive(Clone, Debug, Default)]
pub struct Outside {
    /// Triangles; their cells are tetrahedra.
    pub faces: Vec<Face>,
    /// `[triangle]` lowest and highest corner of the box around the tetrahedra behind it, m.
    pub behind: Vec<[[f64; 3]; 2]>,
}

impl Outside {
    /// The outside of some tetrahedra: a triangle that another one had on its other side is a wall. Takes time in proportion to the mesh.
    pub fn new(mesh: &TetrahedralMesh, is_there: impl Fn(usize) -> bool) -> Self {
        let tetrahedra = mesh.tetrahedra();
        let mut all = faces(tetrahedra);
        all.sort_unstable();
        let mut outside = vec![];
        let mut beyond = vec![[NONE; 4]; tetrahedra.len()]; // [tetrahedron][face] neighbour
        for same in all.chunk_by(|a, b| a.0 == b.0) {
            let there: Vec<_> = same.iter().filter(|side| is_there(side.1 as usize / 4)).collect();
            match there[..] {
                [one] => {
                    let face = Face::triangle(one.outward(tetrahedra), (one.1 / 4) as u32);
                    outside.push(Face { wall: same.len() > 1, ..face });
                }
                [one, other, ..] => {
                    let [a, b] = [one, other].map(|side| [side.1 as usize / 4, side.1 as usize % 4]);
                    beyond[a[0]][a[1]] = b[0] as u32;
                    beyond[b[0]][b[1]] = a[0] as u32;
                }
                [] => {}
            }
        }
        let behind = behind(mesh, &outside, &beyond);
        Self { faces: outside, behind }
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
        Self { mesh: mesh.clone(), outside: Outside::new(mesh, |_| true), around }
    }

    /// Size of the arrays, bytes.
    pub fn bytes(&self) -> usize {
        let mesh = &self.mesh;
        size_of_val(mesh.nodes())
            + size_of_val(mesh.tetrahedra())
            + size_of_val(mesh.layers())
            + size_of_val(&self.outside.faces[..])
            + size_of_val(&self.outside.behind[..])
            + size_of_val(&self.around[..])
    }

    /// Displacement gradient of a tetrahedron at displacements `u`, `[node]` m.
    pub fn displacement_gradient(&self, e: usize, u: &[V4<f64>]) -> M3<f64> {
        let [x, a, b, c] = self.mesh.corners(e).map(V3::of);
        let [a, b, c] = [a - x, b - x, c - x];
        let [o, p, q, r] = self.mesh.tetrahedra()[e].map(|id| V3::from4(u[id as usize]));
        // gradients of the shape functions
        let six = a.dot(b.cross(c));
        let [ga, gb, gc] = [b.cross(c), c.cross(a), a.cross(b)].map(|normal| normal * (1.0 / six));
        (p - o).outer(ga) + (q - o).outer(gb) + (r - o).outer(gc)
    }

    /// Volume at rest, and its change at displacements `u`, `[node]` m, m³.
    pub fn volume(&self, u: &[V4<f64>]) -> [f64; 2] {
        let mut sum = [0.0; 2];
        for (e, ids) in self.mesh.tetrahedra().iter().enumerate() {
            let x = self.mesh.corners(e).map(V3::of);
            let u = ids.map(|id| V3::from4(u[id as usize]));
            // 6 V = a·(b × c) of the edges; its change without the difference of two volumes
            let ([a, b, c], [p, q, r]) = ([1, 2, 3].map(|k| x[k] - x[0]), [1, 2, 3].map(|k| u[k] - u[0]));
            let linear = p.dot(b.cross(c)) + a.dot(q.cross(c)) + a.dot(b.cross(r));
            let rest = a.dot(q.cross(r)) + p.dot(b.cross(r)) + p.dot(q.cross(c)) + p.dot(q.cross(r));
            sum = [sum[0] + a.dot(b.cross(c)) / 6.0, sum[1] + (linear + rest) / 6.0];
        }
        sum
    }
}

/// Boxes around the tetrahedra behind the triangles: see the module.
fn behind(mesh: &TetrahedralMesh, outside: &[Face], beyond: &[[u32; 4]]) -> Vec<[[f64; 3]; 2]> {
    let mut owner = vec![NONE; beyond.len()];
    let mut queue = VecDeque::new();
    for (number, face) in outside.iter().enumerate() {
        if owner[face.cell as usize] == NONE {
            owner[face.cell as usize] = number as u32;
            queue.push_back(face.cell as usize);
        }
    }
    while let Some(e) = queue.pop_front() {
        for next in beyond[e].iter().filter(|next| **next != NONE) {
            if owner[*next as usize] == NONE {
                owner[*next as usize] = owner[e];
                queue.push_back(*next as usize);
            }
        }
    }
    let mut boxes = vec![[[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]]; outside.len()];
    let mut add = |number: usize, e: usize| {
        let [low, high] = &mut boxes[number];
        for x in mesh.corners(e) {
            (0..3).for_each(|n| (low[n], high[n]) = (low[n].min(x[n]), high[n].max(x[n])));
        }
    };
    let owned = owner.iter().enumerate().filter(|(_, number)| **number != NONE);
    owned.for_each(|(e, number)| add(*number as usize, e));
    outside.iter().enumerate().for_each(|(number, face)| add(number, face.cell as usize));
    boxes
}
