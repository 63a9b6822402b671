//! VTK's unstructured grid, as both of its file formats hold it: points, cells of any shape, arrays on both.
//! Shapes of cells have the numbers of the formats; those that are not kept are split.

use super::{At, Mesh, Refused, Result};
use std::path::Path;

/// Names of cell arrays that other programs keep regions in, the first that is there counts: ours, meshio's, Medit's, Gmsh's.
const REGIONS: [&str; 5] = ["region", "gmsh:physical", "medit:ref", "layer", "CellEntityIds"];

/// Numbers on points or cells.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Array {
    /// Name, with the unit where it has one.
    pub name: String,
    /// Numbers of each point or cell.
    pub components: usize,
    /// `[point or cell][component]`
    pub values: Vec<f64>,
}

/// Points, cells and arrays on them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Grid {
    /// `[point]`
    pub points: Vec<[f64; 3]>,
    /// `[cell]` shape by VTK's number.
    pub types: Vec<u8>,
    /// `[cell]` end of its points in `connectivity`.
    pub offsets: Vec<u64>,
    /// Point ids of the cells, one after the other.
    pub connectivity: Vec<u32>,
    /// Arrays on points.
    pub point_data: Vec<Array>,
    /// Arrays on cells.
    pub cell_data: Vec<Array>,
    /// Where the cells stand in the file that they were read from, for messages.
    pub at: Option<At>,
}

/// What VTK's number of a cell means here.
enum Shape {
    Is(Cell),
    /// A rectangle or a box whose nodes are in the order of the axes.
    Pixel,
    Voxel,
    /// Triangles that each share an edge with the one before.
    Strip,
    Empty,
}

fn shape(number: u8) -> Option<Shape> {
    Some(match number {
        0 => Shape::Empty,
        1 | 2 => Shape::Is(Cell::Point),
        3 | 4 => Shape::Is(Cell::Line),
        5 => Shape::Is(Cell::Triangle),
        6 => Shape::Strip,
        7 => Shape::Is(Cell::Polygon),
        8 => Shape::Pixel,
        9 => Shape::Is(Cell::Quadrilateral),
        10 => Shape::Is(Cell::Tetrahedron),
        11 => Shape::Voxel,
        12 => Shape::Is(Cell::Hexahedron),
        13 => Shape::Is(Cell::Wedge),
        14 => Shape::Is(Cell::Pyramid),
        _ => return None,
    })
}

/// Word for VTK's cells that are not read.
fn vtk_name(number: u8) -> &'static str {
    match number {
        21..=37 => "of second order",
        15 | 16 => "a prism of five or six sides",
        41 | 42 => "a polyhedron",
        60..=81 => "of higher order",
        _ => "not a shape that is known here",
    }
}

impl Grid {
    /// Triangles, then tetrahedra of a mesh, with an array `region`.
    pub(super) fn of(mesh: &Mesh) -> Self {
        let (triangles, tetrahedra) = (mesh.triangles.len(), mesh.tetrahedra.len());
        let regions = mesh.triangle_regions.iter().chain(&mesh.tetrahedron_regions);
        let ends = (1..=triangles).map(|k| 3 * k).chain((1..=tetrahedra).map(|k| 3 * triangles + 4 * k));
        Self {
            points: mesh.points.clone(),
            types: [vec![5; triangles], vec![10; tetrahedra]].concat(),
            offsets: ends.map(|end| end as u64).collect(),
            connectivity: [mesh.triangles.as_flattened(), mesh.tetrahedra.as_flattened()].concat(),
            point_data: vec![],
            cell_data: vec![Array {
                name: REGIONS[0].into(),
                components: 1,
                values: regions.map(|region| f64::from(*region)).collect(),
            }],
            at: None,
        }
    }

    /// The grid as a mesh: cells split, regions from the cell arrays.
    ///
    /// # Errors
    /// For cells that are not linear, name points that are not there, or have another number of them than their shape.
    pub fn into_mesh(self, path: &Path) -> Result<Mesh> {
        let at = || self.at.clone().unwrap_or_else(|| At::line(path, 1));
        let of_cells = |name: &&str| {
            let named = |array: &&Array| array.name == **name && array.components == 1;
            self.cell_data.iter().find(named).map(|array| &array.values)
        };
        let regions = REGIONS.iter().find_map(of_cells);
        let mut mesh = Mesh { points: self.points, ..Mesh::default() };
        let mut start = 0;
        for (k, (number, end)) in self.types.iter().zip(&self.offsets).enumerate() {
            let nodes = usize::try_from(*end).ok().and_then(|end| self.connectivity.get(start..end));
            let Some(nodes) = nodes else {
                let found = format!("cell {k} ends at number {end} of {}", self.connectivity.len());
                return Err(Refused::Unexpected {
                    at: at(),
                    found,
                    wanted: "offsets that ascend to the number of ids",
                });
            };
            start = *end as usize;
            if let Some(id) = nodes.iter().find(|id| **id as usize >= mesh.points.len()) {
                return Err(Refused::Point { at: at(), found: id.to_string(), count: mesh.points.len() });
            }
            let Some(shape) = shape(*number) else {
                let found = format!("cell {k} has type {number}, {}; linear cells are read", vtk_name(*number));
                let mend = "export the mesh with linear cells (ParaView: Tessellate, or Linear Subdivision)";
                return Err(Refused::Unsupported { at: at(), found, mend });
            };
            let region = regions.and_then(|regions| regions.get(k)).map_or(0, |region| *region as i32);
            add(&mut mesh, &shape, nodes, region).ok_or_else(|| Refused::Unexpected {
                at: at(),
                found: format!("cell {k} of type {number} has {} points", nodes.len()),
                wanted: "as many points as the shape has",
            })?;
        }
        Ok(mesh)
    }
}

/// Adds a cell; none if it has another number of points than its shape.
fn add(mesh: &mut Mesh, shape: &Shape, nodes: &[u32], region: i32) -> Option<()> {
    match (shape, nodes) {
        (Shape::Is(cell), _) => match cell.nodes() {
            Some(count) if count == nodes.len() => mesh.add(*cell, nodes, region),
            None if nodes.len() >= if *cell == Cell::Line { 2 } else { 3 } => mesh.add(*cell, nodes, region),
            // a cloud of points is one cell in VTK
            _ if *cell == Cell::Point => nodes.iter().for_each(|id| mesh.add(Cell::Point, &[*id], region)),
            _ => return None,
        },
        (Shape::Pixel, &[a, b, c, d]) => mesh.add(Cell::Quadrilateral, &[a, b, d, c], region),
        (Shape::Voxel, &[a, b, c, d, e, f, g, h]) => mesh.add(Cell::Hexahedron, &[a, b, d, c, e, f, h, g], region),
        (Shape::Strip, [_, _, _, ..]) => {
            for (k, of) in nodes.windows(3).enumerate() {
                let [a, b, c] = [of[0], of[1], of[2]];
                // each second one is the other way round
                mesh.add(Cell::Triangle, &if k % 2 == 0 { [a, b, c] } else { [b, a, c] }, region);
            }
        }
        (Shape::Empty, _) => {}
        _ => return None,
    }
    Some(())
}

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
