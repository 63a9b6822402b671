//! VTK's unstructured grid, as both of its file formats hold it: points, cells of any shape, arrays on both.

use super::refused::{At, Refused};
use super::{Cell, Mesh, Result};
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
