//! Mesh files: Gmsh `.msh`, legacy VTK `.vtk`, VTK XML `.vtu`, Wavefront `.obj`, `.stl`, `.ply`.
//!
//! | format | read | written | keeps |
//! | --- | --- | --- | --- |
//! | msh | 2.2 and 4.1, text and binary of either byte order | 2.2, text and binary | everything |
//! | vtu | text, base64, appended raw or base64, zlib | text, base64 | all but names of groups |
//! | vtk | 2.0 to 5.1, text and binary | – | all but names of groups |
//! | ply | text, binary of either byte order | text, binary | triangles and their regions |
//! | stl | text, binary; equal corners are welded | text, binary | positions of triangles, in binary as f32 |
//! | obj | text | text | triangles |
//!
//! Cells are linear. Tetrahedra and triangles are kept; quadrilaterals, polygons, hexahedra, wedges and pyramids are split into them
//! ([`Mesh::add`]); points and lines are counted and left out; cells of higher order are refused. Binary files give the same bits back, and
//! so does text, which has the fewest digits that do.
//!
//! The readers are our own: `mshio`, `stl_io`, `ply-rs` and `vtkio` read some of these formats, but believe the counts of a header and do
//! not say where a file is wrong. No count is believed here beyond what the bytes behind it can hold. The peak of memory is the file and
//! the mesh, and one decoded array of a VTU, or the list of an OBJ's statements.
//!
//! Sources: Gmsh reference manual, section 10 (file formats); VTK file formats (Kitware); Turk 1994 (PLY); 3D Systems 1989 (STL).
//!
//! An error ([`Refused`]) tells file and line or byte, what was found, what was wanted, how to mend it.

mod cursor;
mod grid;
mod msh;
pub mod obj;
mod ply;
mod stl;
mod vtk;
mod vtu;

pub use grid::{Array, Cell, Face, Grid, faces};
#[cfg(feature = "program")]
pub(crate) use vtu::escaped;
pub use vtu::{read as read_grid, write as write_grid};

use cursor::Cursor;
use std::fmt;
use std::path::{Path, PathBuf};

/// Result of the readers and writers.
pub type Result<T> = std::result::Result<T, Refused>;

/// Linear cells on points, as a file has them: nothing is merged, turned or left out but what the formats say.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// `[point]` in the file's unit of length; finite.
    pub points: Vec<[f64; 3]>,
    /// `[tetrahedron]` point ids; positive volume where the fourth point is on the side that the first three turn about counter-clockwise.
    pub tetrahedra: Vec<[u32; 4]>,
    /// `[tetrahedron]` tag of the physical group, 0 for none.
    pub tetrahedron_regions: Vec<i32>,
    /// `[triangle]` point ids.
    pub triangles: Vec<[u32; 3]>,
    /// `[triangle]` tag of the physical group, 0 for none.
    pub triangle_regions: Vec<i32>,
    /// Names of physical groups.
    pub groups: Vec<Group>,
    /// Cells of other shapes that were split or left out, with their number, in ascending order.
    pub others: Vec<(Cell, usize)>,
}

/// Name of a physical group.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Group {
    /// 0 points, 1 lines, 2 triangles, 3 tetrahedra.
    pub dimension: u8,
    /// Number in [`Mesh::tetrahedron_regions`] or [`Mesh::triangle_regions`].
    pub tag: i32,
    /// Name given by the user.
    pub name: String,
}

/// Formats by their endings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Gmsh.
    Msh,
    /// Legacy VTK; read only.
    Vtk,
    /// VTK XML, unstructured grid.
    Vtu,
    /// Wavefront OBJ.
    Obj,
    /// Stereolithography.
    Stl,
    /// Stanford PLY.
    Ply,
}

/// How numbers are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// Decimal digits, the fewest that give the same bits back.
    Text,
    /// As in memory, little-endian; base64 within XML. OBJ has text alone.
    Binary,
}

impl Format {
    /// All of them.
    pub const ALL: [Self; 6] = [Self::Msh, Self::Vtk, Self::Vtu, Self::Obj, Self::Stl, Self::Ply];

    /// Ending of its files, without the dot.
    pub fn ending(self) -> &'static str {
        match self {
            Self::Msh => "msh",
            Self::Vtk => "vtk",
            Self::Vtu => "vtu",
            Self::Obj => "obj",
            Self::Stl => "stl",
            Self::Ply => "ply",
        }
    }

    /// Format of a file by its ending, in capitals or not.
    ///
    /// # Errors
    /// [`Refused::Ending`].
    pub fn of(path: &Path) -> Result<Self> {
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase()).unwrap_or_default();
        let known = Self::ALL.into_iter().find(|format| format.ending() == ending);
        known.ok_or_else(|| Refused::Ending { path: path.to_path_buf() })
    }

    /// Format of bytes that begin as one does; OBJ and binary STL begin with anything.
    fn begun(bytes: &[u8]) -> Option<Self> {
        let bytes = bytes.trim_ascii_start();
        let begins = |word: &[u8]| bytes.starts_with(word);
        let xml = (begins(b"<?xml") || begins(b"<VTKFile"))
            && bytes[..bytes.len().min(512)].windows(8).any(|text| text == b"<VTKFile");
        let found = [
            (begins(b"$MeshFormat") || begins(b"$Comments") || begins(b"$PhysicalNames"), Self::Msh),
            (begins(b"# vtk DataFile"), Self::Vtk),
            (xml, Self::Vtu),
            (begins(b"ply\n") || begins(b"ply\r"), Self::Ply),
            (begins(b"solid ") && bytes[..bytes.len().min(512)].windows(5).any(|text| text == b"facet"), Self::Stl),
        ];
        found.into_iter().find_map(|(holds, format)| holds.then_some(format))
    }
}

/// Reads a mesh file by its ending. `progress` is told the share of the file that is read, 0 to 1, every megabyte or so.
///
/// # Errors
/// [`Refused`], with the location in the file.
pub fn read(path: &Path, progress: &mut dyn FnMut(f64)) -> Result<Mesh> {
    let format = Format::of(path)?;
    let no_file = |reason: String| Refused::File { path: path.to_path_buf(), reason };
    let found = std::fs::metadata(path).map_err(|error| no_file(error.to_string()))?;
    if !found.is_file() {
        // a pipe may have no end
        return Err(no_file("it is a folder, a pipe or a device".into()));
    }
    let bytes = std::fs::read(path).map_err(|error| no_file(error.to_string()))?;
    parse(&bytes, format, path, progress)
}

/// Reads the bytes of a mesh file; `path` is for messages.
///
/// # Errors
/// [`Refused`], with the location in the file.
pub fn parse(bytes: &[u8], format: Format, path: &Path, progress: &mut dyn FnMut(f64)) -> Result<Mesh> {
    if bytes.trim_ascii().is_empty() {
        return Err(Refused::Empty { path: path.to_path_buf() });
    }
    if let Some(found) = Format::begun(bytes).filter(|found| *found != format) {
        return Err(Refused::Type { path: path.to_path_buf(), named: format.ending(), found: found.ending() });
    }
    let mut cursor = Cursor::new(bytes, path, progress);
    let mut mesh = match format {
        Format::Msh => msh::read(&mut cursor)?,
        Format::Vtk => vtk::read(&mut cursor)?,
        Format::Vtu => vtu::read(bytes, path)?.into_mesh(path)?,
        Format::Obj => obj::read(bytes, path)?,
        Format::Stl => stl::read(&mut cursor)?,
        Format::Ply => ply::read(&mut cursor)?,
    };
    if mesh.tetrahedra.is_empty() && mesh.triangles.is_empty() {
        return Err(Refused::NoCells { path: path.to_path_buf() });
    }
    mesh.shrink();
    Ok(mesh)
}

/// Bytes of a mesh file. Formats of triangles take the mesh's triangles, or, where it has none, the boundary of its tetrahedra.
///
/// # Errors
/// [`Refused::ReadOnly`] for legacy VTK.
///
/// # Panics
/// If a cell names a point that is not there, or regions are not as many as cells.
pub fn write(mesh: &Mesh, format: Format, encoding: Encoding, path: &Path) -> Result<Vec<u8>> {
    let ids = mesh.tetrahedra.as_flattened().iter().chain(mesh.triangles.as_flattened());
    assert!(ids.max().is_none_or(|id| (*id as usize) < mesh.points.len()), "cells are on points");
    assert_eq!(mesh.tetrahedra.len(), mesh.tetrahedron_regions.len());
    assert_eq!(mesh.triangles.len(), mesh.triangle_regions.len());
    Ok(match format {
        Format::Msh => msh::write(mesh, encoding),
        Format::Vtk => return Err(Refused::ReadOnly { path: path.to_path_buf() }),
        Format::Vtu => vtu::write(&Grid::of(mesh), encoding),
        Format::Obj => obj::write(&mesh.surface()),
        Format::Stl => stl::write(&mesh.surface(), encoding),
        Format::Ply => ply::write(&mesh.surface(), encoding),
    })
}

/// What of a mesh a format does not keep, in words.
pub fn lost(mesh: &Mesh, format: Format, encoding: Encoding) -> Vec<&'static str> {
    let of_triangles = matches!(format, Format::Obj | Format::Stl | Format::Ply);
    let has = |regions: &[i32]| regions.iter().any(|region| *region != 0);
    let narrow = |p: &[f64; 3]| p.iter().any(|c| f64::from(*c as f32) != *c);
    let losses = [
        (
            of_triangles && !mesh.tetrahedra.is_empty(),
            "tetrahedra (their boundary is written if there are no triangles)",
        ),
        (format != Format::Msh && !mesh.groups.is_empty(), "names of physical groups"),
        (matches!(format, Format::Obj | Format::Stl) && has(&mesh.triangle_regions), "regions"),
        (of_triangles && unused(mesh), "points that no triangle uses"),
        (format == Format::Stl && encoding == Encoding::Binary && mesh.points.iter().any(narrow), "digits beyond f32"),
    ];
    losses.into_iter().filter_map(|(holds, words)| holds.then_some(words)).collect()
}

fn unused(mesh: &Mesh) -> bool {
    let mut used = vec![false; mesh.points.len()];
    mesh.triangles.as_flattened().iter().for_each(|id| used[*id as usize] = true);
    !mesh.triangles.is_empty() && used.contains(&false)
}

impl Mesh {
    /// Adds a cell; others than tetrahedra and triangles are split, points and lines counted.
    ///
    /// A quadrilateral is split along the diagonal of its smallest point id, a solid into tetrahedra from its smallest point id to the
    /// faces that do not have it, each split the same way: neighbours agree on a face, whatever they are. Source: Dompierre et al. 1999,
    /// section 2. The sign of the volume stays, but for wedges, of which VTK and Gmsh have opposite ones: they become positive.
    ///
    /// # Panics
    /// If `nodes` are not as many as the cell has, or not points of the mesh.
    pub fn add(&mut self, cell: Cell, nodes: &[u32], region: i32) {
        match (cell, nodes) {
            (Cell::Tetrahedron, &[a, b, c, d]) => self.add_tetrahedron([a, b, c, d], region),
            (Cell::Triangle, &[a, b, c]) => self.add_triangle([a, b, c], region),
            _ => self.split(cell, nodes, region),
        }
    }

    fn add_tetrahedron(&mut self, nodes: [u32; 4], region: i32) {
        self.tetrahedra.push(nodes);
        self.tetrahedron_regions.push(region);
    }

    fn add_triangle(&mut self, nodes: [u32; 3], region: i32) {
        self.triangles.push(nodes);
        self.triangle_regions.push(region);
    }

    fn split(&mut self, cell: Cell, nodes: &[u32], region: i32) {
        assert!(cell.nodes().is_none_or(|count| count == nodes.len()), "{cell:?} of {} nodes", nodes.len());
        match self.others.binary_search_by_key(&cell, |(cell, _)| *cell) {
            Ok(at) => self.others[at].1 += 1,
            Err(at) => self.others.insert(at, (cell, 1)),
        }
        match cell.dimension() {
            3 => {
                let mut pieces = grid::tetrahedra(cell, nodes);
                let volume = pieces.iter().map(|piece| self.volume(piece)).sum::<f64>();
                if cell == Cell::Wedge && volume < 0.0 {
                    pieces.iter_mut().for_each(|piece| piece.swap(2, 3));
                }
                pieces.into_iter().for_each(|piece| self.add_tetrahedron(piece, region));
            }
            2 => grid::triangles(nodes).into_iter().for_each(|piece| self.add_triangle(piece, region)),
            _ => {}
        }
    }

    /// Signed volume of a tetrahedron, in the cube of the file's unit.
    pub fn volume(&self, nodes: &[u32; 4]) -> f64 {
        let [a, b, c, d] = nodes.map(|id| glam::DVec3::from(self.points[id as usize]));
        (b - a).dot((c - a).cross(d - a)) / 6.0
    }

    /// Faces of tetrahedra that no other one has, turned outward where the tetrahedron is positive, with its region; in ascending order of
    /// sorted ids.
    pub fn boundary(&self) -> Vec<([u32; 3], i32)> {
        let mut faces = grid::faces(&self.tetrahedra);
        faces.sort_unstable();
        let alone = faces.chunk_by(|a, b| a.0 == b.0).filter(|same| same.len() == 1);
        alone
            .map(|same| (same[0].outward(&self.tetrahedra), self.tetrahedron_regions[same[0].1 as usize / 4]))
            .collect()
    }

    /// Triangles with the points that they use: those of the mesh, or of the boundary of the tetrahedra if it has none.
    fn surface(&self) -> Self {
        let mut out = match self.triangles.is_empty() {
            true => {
                let (triangles, triangle_regions) = self.boundary().into_iter().unzip();
                Self { triangles, triangle_regions, ..Self::default() }
            }
            false => Self {
                triangles: self.triangles.clone(),
                triangle_regions: self.triangle_regions.clone(),
                ..Self::default()
            },
        };
        let mut new = vec![u32::MAX; self.points.len()];
        out.triangles.as_flattened().iter().for_each(|id| new[*id as usize] = 0);
        for (new, point) in new.iter_mut().zip(&self.points).filter(|(new, _)| **new == 0) {
            *new = out.points.len() as u32;
            out.points.push(*point);
        }
        out.triangles.as_flattened_mut().iter_mut().for_each(|id| *id = new[*id as usize]);
        out
    }

    fn shrink(&mut self) {
        self.points.shrink_to_fit();
        self.tetrahedra.shrink_to_fit();
        self.tetrahedron_regions.shrink_to_fit();
        self.triangles.shrink_to_fit();
        self.triangle_regions.shrink_to_fit();
    }
}

/// Position in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct At {
    /// File name as given by the user.
    pub file: PathBuf,
    /// Where in it.
    pub position: Position,
}

/// Position within a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Position {
    /// Line of a text, from 1.
    Line(usize),
    /// Byte of binary data, from 0.
    Byte(usize),
}

impl At {
    /// A line of a file.
    pub fn line(file: &Path, line: usize) -> Self {
        Self { file: file.to_path_buf(), position: Position::Line(line) }
    }
}

impl fmt::Display for At {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.position {
            Position::Line(line) => write!(f, "{}:{line}", self.file.display()),
            Position::Byte(byte) => write!(f, "{}, byte {byte}", self.file.display()),
        }
    }
}

/// Mesh file that cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum Refused {
    /// File that the system does not give.
    #[error("{}: the mesh cannot be read ({reason}); give the path of a mesh file", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },

    /// Ending of no known format.
    #[error(
        "{}: no mesh format that is known here has this ending; name the file .msh (Gmsh), .vtk, .vtu, .obj, .stl or .ply, by what it holds",
        path.display()
    )]
    Ending {
        /// The file.
        path: PathBuf,
    },

    /// Content of another format than the ending says.
    #[error("{}: the file is named .{named}, but begins like a .{found}; rename it to .{found}", path.display())]
    Type {
        /// The file.
        path: PathBuf,
        /// Its ending.
        named: &'static str,
        /// Ending of files that begin like this one.
        found: &'static str,
    },

    /// File without content.
    #[error("{}: the file is empty; export the mesh again", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },

    /// File without cells.
    #[error("{}: there is no tetrahedron and no face in the file; export the mesh with its cells", path.display())]
    NoCells {
        /// The file.
        path: PathBuf,
    },

    /// Format that is not written.
    #[error("{}: legacy VTK is read, but not written; name the file .vtu instead", path.display())]
    ReadOnly {
        /// The file.
        path: PathBuf,
    },

    /// Something else than what the format says.
    #[error("{at}: {found}; wanted {wanted}; mend it, or export the mesh again")]
    Unexpected {
        /// Position in the file.
        at: At,
        /// What stands there.
        found: String,
        /// What should.
        wanted: &'static str,
    },

    /// File that is cut off.
    #[error("{at}: the file ends where {wanted} should stand; export the mesh again, it was cut off")]
    End {
        /// Its end.
        at: At,
        /// What should stand there.
        wanted: &'static str,
    },

    /// A count beyond what the rest of the file can hold.
    #[error(
        "{at}: {found} {what} are announced, but only {left} bytes follow; export the mesh again, it is cut off or the number is wrong"
    )]
    Count {
        /// Position of the number.
        at: At,
        /// What is counted.
        what: &'static str,
        /// The number.
        found: u64,
        /// Bytes behind it.
        left: usize,
    },

    /// Number of a point that is not there.
    #[error(
        "{at}: a cell names point {found}, which is not among the {count} points of the file; mend the cell, or export the mesh again"
    )]
    Point {
        /// Position of the number.
        at: At,
        /// The number.
        found: String,
        /// Number of points.
        count: usize,
    },

    /// What the format has and is not read here.
    #[error("{at}: {found}; {mend}")]
    Unsupported {
        /// Position in the file.
        at: At,
        /// What stands there, and what is read.
        found: String,
        /// What to do.
        mend: &'static str,
    },

    /// More points than ids.
    #[error("{}: {count} points; at most {} are counted here; export a coarser mesh, or parts of it", path.display(), u32::MAX)]
    TooMany {
        /// The file.
        path: PathBuf,
        /// Their number.
        count: u64,
    },

    /// An OBJ vertex without three numbers.
    #[error("{at}: `{found}`; wanted `v` and three finite numbers; mend the line, or export the file again")]
    ObjNumber {
        /// The `v` line.
        at: At,
        /// The line.
        found: String,
    },

    /// An index of an OBJ file without a vertex.
    #[error(
        "{at}: `{found}` is no vertex; {count} `v` lines stand above, so wanted 1 to {count}, or -{count} to -1; mend the index, or move the vertices up"
    )]
    ObjIndex {
        /// The `f`, `l` or `p` line.
        at: At,
        /// The index found.
        found: String,
        /// Number of vertices above.
        count: usize,
    },

    /// A face, a line or a point without enough vertices.
    #[error(
        "{at}: `{found}`; wanted at least {wanted} vertices (`f` for faces, `l` for lines, `p` for points); add some, or remove the line"
    )]
    ObjShort {
        /// The line.
        at: At,
        /// Its text.
        found: String,
        /// Fewest vertices.
        wanted: usize,
    },
}

/// Longest quotation of a file in a message, characters.
const QUOTE_LENGTH: usize = 72;

/// Text of a file for a message, on one line.
fn quoted(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(&bytes[..bytes.len().min(4 * QUOTE_LENGTH)]);
    let mut short: String = text.chars().take(QUOTE_LENGTH).collect();
    if short.len() < bytes.len() {
        short.push('…');
    }
    format!("`{}`", short.replace(char::is_control, " "))
}
