//! Links of a mesh of tetrahedra: the faces that two of them share.

use crate::formats::faces;
use crate::scene::TetrahedralMesh;

/// No link: the face is of one tetrahedron alone.
const NONE: u32 = u32::MAX;

/// Faces that two tetrahedra share.
#[derive(Clone, Debug, Default)]
pub struct Links {
    /// `[link]` its tetrahedra, each as 4 × tetrahedron + opposite corner, the lower one first.
    pub sides: Vec<[u32; 2]>,
    /// `[tetrahedron][opposite corner]` link, or `u32::MAX`.
    of_face: Vec<[u32; 4]>,
}

impl Links {
    /// Of a mesh.
    pub fn new(mesh: &TetrahedralMesh) -> Self {
        let mut all = faces(mesh.tetrahedra());
        all.sort_unstable();
        let pairs = all.chunk_by(|a, b| a.0 == b.0).filter(|same| same.len() == 2);
        let mut sides: Vec<[u32; 2]> = pairs.map(|same| [0, 1].map(|k| same[k].1 as u32)).collect();
        sides.sort_unstable();
        let mut of_face = vec![[NONE; 4]; mesh.tetrahedra().len()];
        for (link, side) in (0..).zip(&sides) {
            side.iter().for_each(|side| of_face[*side as usize / 4][*side as usize % 4] = link);
        }
        Self { sides, of_face }
    }

    /// Link over a face of a tetrahedron.
    pub fn over(&self, e: usize, opposite: usize) -> Option<usize> {
        Some(self.of_face[e][opposite] as usize).filter(|link| *link != NONE as usize)
    }

    /// The two tetrahedra of a link.
    pub fn ends(&self, link: usize) -> [usize; 2] {
        self.sides[link].map(|side| side as usize / 4)
    }

    /// Tetrahedron on the other side of a face.
    pub fn beyond(&self, e: usize, opposite: usize) -> Option<usize> {
        let [a, b] = self.ends(self.over(e, opposite)?);
        Some(if a == e { b } else { a })
    }

    /// Size of the arrays, bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.sides[..]) + size_of_val(&self.of_face[..])
    }
}
