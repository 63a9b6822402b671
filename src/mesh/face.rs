//! A face of the surface: of a hexahedron, or of a tetrahedron.

/// A boundary face, of four corners or of three: corner nodes counter-clockwise seen from outside.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Face {
    /// Node ids; a triangle has its third one twice.
    pub nodes: [u32; 4],
    /// Cell behind the face; of a mesh its tetrahedron.
    pub cell: u32,
    /// True for a wall of the wound, made by a cut.
    pub wall: bool,
}

impl Face {
    /// A triangle of a tetrahedron.
    pub fn triangle([a, b, c]: [u32; 3], cell: u32) -> Self {
        Self { nodes: [a, b, c, c], cell, wall: false }
    }

    /// True if it has three corners.
    pub fn is_triangle(&self) -> bool {
        self.nodes[2] == self.nodes[3]
    }

    /// Its corners, each once.
    pub fn corners(&self) -> &[u32] {
        if self.is_triangle() { &self.nodes[..3] } else { &self.nodes }
    }

    /// Its edges, in the order of its corners.
    pub fn edges(&self) -> impl Iterator<Item = [u32; 2]> {
        let corners = self.corners();
        (0..corners.len()).map(|k| [corners[k], corners[(k + 1) % corners.len()]])
    }

    /// The face as two triangles of node ids, or as the one that it is.
    pub fn triangles(&self) -> impl Iterator<Item = [u32; 3]> + use<> {
        let [a, b, c, d] = self.nodes;
        [[a, b, c], [a, c, d]].into_iter().take(self.corners().len() - 2)
    }
}
