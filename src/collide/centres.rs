//! Patches whose faces are four triangles about their centre, the mean of their corners: for tools of points.
//!
//! Faces cut in two by one diagonal differ at mirror images of a point: a point of `scenes/hard/tools_many_points.toml` alone felt 28.9 and
//! 40.0 mN at (±0.3, ±0.2) mm on cells of 1.4 mm. About the centre no diagonal is preferred. The centre is no node; a force on it acts on
//! the four corners alike. Blades, round tools and tools of lines use faces in two: their pieces meet several triangles at once.

use super::{Patch, to_f32};
use crate::mesh::{Face, MaterialPoint};
use glam::DVec3;
use parry3d::shape::{TriMesh, TriMeshFlags};

impl Patch {
    /// Patch of faces at the present positions of their nodes, as [`Patch::new`]; `None` without faces. Triangles have no diagonal and stay
    /// whole.
    pub fn about_centres(faces: &[Face], position: impl Fn(u32) -> DVec3) -> Option<Self> {
        if faces.iter().any(Face::is_triangle) {
            return Self::new(faces, position);
        }
        let mut ids: Vec<u32> = faces.iter().flat_map(|q| q.nodes).collect();
        ids.sort_unstable();
        ids.dedup();
        let origin = position(*ids.first()?);
        let local = |id: u32| ids.binary_search(&id).unwrap_or(0) as u32;
        let centre = |q: &Face| q.nodes.iter().map(|id| position(*id)).sum::<DVec3>() * 0.25;
        let points = ids.iter().map(|id| position(*id)).chain(faces.iter().map(centre));
        let vertices = points.map(|p| to_f32(p - origin)).collect();
        let (mut indices, mut corners) = (vec![], vec![]);
        for (number, face) in faces.iter().enumerate() {
            for (a, b) in (0..4).map(|k| (face.nodes[k], face.nodes[(k + 1) % 4])) {
                indices.push([local(a), local(b), (ids.len() + number) as u32]);
                corners.push([position(a), position(b), centre(face)]);
            }
        }
        let mesh = TriMesh::with_flags(vertices, indices, TriMeshFlags::ORIENTED).ok()?;
        let cells = faces.iter().flat_map(|q| [q.cell; 4]).collect();
        let walls = faces.iter().flat_map(|q| [q.wall; 4]).collect();
        let quarters = faces.iter().map(|q| q.nodes).collect();
        Some(Self { mesh, triangles: vec![], quarters, cells, walls, corners, origin })
    }

    /// Material point of a triangle with these weights.
    pub fn material_point(&self, triangle: usize, weights: [f64; 3]) -> MaterialPoint {
        match self.quarters.get(triangle / 4) {
            Some(nodes) => {
                // a quarter of the face: two corners, and the centre, the mean of all four
                let ([u, v, w], quarter) = (weights, triangle % 4);
                let mut weights = [0.25 * w; 4];
                weights[quarter] += u;
                weights[(quarter + 1) % 4] += v;
                MaterialPoint::of(*nodes, weights)
            }
            None => MaterialPoint::of(self.triangles[triangle], weights),
        }
    }
}
