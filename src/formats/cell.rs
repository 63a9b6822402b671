//! Shapes of cells by the numbers of the formats, and how those that are not kept are split.

/// Shape of a linear cell, with VTK's order of nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Cell {
    /// One node.
    Point,
    /// Two nodes, or a polyline.
    Line,
    /// Three nodes.
    Triangle,
    /// Four nodes around.
    Quadrilateral,
    /// Any number of nodes around.
    Polygon,
    /// Four nodes.
    Tetrahedron,
    /// Four nodes around and the apex.
    Pyramid,
    /// A triangle and the one above it.
    Wedge,
    /// Four nodes around and the four above them.
    Hexahedron,
}

impl Cell {
    /// Word for one.
    pub fn name(self) -> &'static str {
        match self {
            Self::Point => "point",
            Self::Line => "line",
            Self::Triangle => "triangle",
            Self::Quadrilateral => "quadrilateral",
            Self::Polygon => "polygon",
            Self::Tetrahedron => "tetrahedron",
            Self::Pyramid => "pyramid",
            Self::Wedge => "wedge",
            Self::Hexahedron => "hexahedron",
        }
    }

    /// Number of nodes; none where it is any.
    pub fn nodes(self) -> Option<usize> {
        match self {
            Self::Point => Some(1),
            Self::Triangle => Some(3),
            Self::Quadrilateral | Self::Tetrahedron => Some(4),
            Self::Pyramid => Some(5),
            Self::Wedge => Some(6),
            Self::Hexahedron => Some(8),
            Self::Line | Self::Polygon => None,
        }
    }

    /// 0 points, 1 lines, 2 faces, 3 solids.
    pub fn dimension(self) -> u8 {
        match self {
            Self::Point => 0,
            Self::Line => 1,
            Self::Triangle | Self::Quadrilateral | Self::Polygon => 2,
            Self::Tetrahedron | Self::Pyramid | Self::Wedge | Self::Hexahedron => 3,
        }
    }

    /// Cell by Gmsh's number, with its number of nodes.
    pub(super) fn of_gmsh(number: u64) -> Option<(Self, usize)> {
        Some(match number {
            1 => (Self::Line, 2),
            2 => (Self::Triangle, 3),
            3 => (Self::Quadrilateral, 4),
            4 => (Self::Tetrahedron, 4),
            5 => (Self::Hexahedron, 8),
            6 => (Self::Wedge, 6),
            7 => (Self::Pyramid, 5),
            15 => (Self::Point, 1),
            _ => return None,
        })
    }

    /// Faces, seen counter-clockwise from outside.
    fn faces(self) -> &'static [&'static [usize]] {
        match self {
            Self::Tetrahedron => &[&[1, 2, 3], &[0, 3, 2], &[0, 1, 3], &[0, 2, 1]],
            Self::Pyramid => &[&[0, 3, 2, 1], &[0, 1, 4], &[1, 2, 4], &[2, 3, 4], &[3, 0, 4]],
            Self::Wedge => &[&[0, 2, 1], &[3, 4, 5], &[0, 1, 4, 3], &[1, 2, 5, 4], &[2, 0, 3, 5]],
            Self::Hexahedron => {
                &[&[0, 4, 7, 3], &[1, 2, 6, 5], &[0, 1, 5, 4], &[2, 3, 7, 6], &[0, 3, 2, 1], &[4, 5, 6, 7]]
            }
            _ => &[],
        }
    }
}

/// Word for Gmsh's cells of higher order.
pub(super) fn gmsh_name(number: u64) -> &'static str {
    match number {
        8 => "a 3-node line",
        9 => "a 6-node triangle",
        10 | 16 => "a quadrilateral of second order",
        11 => "a 10-node tetrahedron",
        12 | 17 => "a hexahedron of second order",
        13 | 18 => "a wedge of second order",
        14 | 19 => "a pyramid of second order",
        20..=31 | 92 | 93 => "of third or higher order",
        _ => "not a shape that is known here",
    }
}

/// A polygon as a fan about its smallest point id; triangles that name a point twice are left out.
pub(super) fn triangles(nodes: &[u32]) -> Vec<[u32; 3]> {
    let count = nodes.len();
    let start = (0..count).min_by_key(|k| nodes[*k]).unwrap_or(0);
    let at = |k: usize| nodes[(start + k) % count];
    let fan = (2..count).map(|k| [at(0), at(k - 1), at(k)]);
    fan.filter(|[a, b, c]| a != b && b != c && c != a).collect()
}

/// A solid as tetrahedra from its smallest point id; those that name a point twice are left out.
pub(super) fn tetrahedra(cell: Cell, nodes: &[u32]) -> Vec<[u32; 4]> {
    let apex = nodes.iter().copied().min().unwrap_or(0);
    let mut out = vec![];
    for face in cell.faces() {
        let corners: Vec<u32> = face.iter().map(|k| nodes[*k]).collect();
        let opposite = triangles(&corners).into_iter().filter(|_| !corners.contains(&apex));
        out.extend(opposite.map(|[a, b, c]| [apex, a, b, c]));
    }
    out
}

/// Face of a tetrahedron: its point ids in ascending order, and 4 × tetrahedron + opposite corner.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Face(pub [u32; 3], pub u64);

impl Face {
    /// Point ids counter-clockwise from outside, where the tetrahedron is positive.
    pub fn outward(&self, tetrahedra: &[[u32; 4]]) -> [u32; 3] {
        let nodes = tetrahedra[(self.1 / 4) as usize];
        let corners = Cell::Tetrahedron.faces()[(self.1 % 4) as usize];
        [nodes[corners[0]], nodes[corners[1]], nodes[corners[2]]]
    }
}

/// The four faces of each tetrahedron.
pub fn faces(tetrahedra: &[[u32; 4]]) -> Vec<Face> {
    let mut out = Vec::with_capacity(4 * tetrahedra.len());
    for (number, nodes) in tetrahedra.iter().enumerate() {
        for (opposite, corners) in Cell::Tetrahedron.faces().iter().enumerate() {
            let mut ids = [nodes[corners[0]], nodes[corners[1]], nodes[corners[2]]];
            ids.sort_unstable();
            out.push(Face(ids, (4 * number + opposite) as u64));
        }
    }
    out
}
