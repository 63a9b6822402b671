//! Errors of mesh files: file and line or byte, what was found, what was wanted, how to mend it.

use std::fmt;
use std::path::{Path, PathBuf};

/// Place in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct At {
    /// File name as given by the user.
    pub file: PathBuf,
    /// Where in it.
    pub place: Place,
}

/// Place within a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Line of a text, from 1.
    Line(usize),
    /// Byte of binary data, from 0.
    Byte(usize),
}

impl At {
    /// A line of a file.
    pub fn line(file: &Path, line: usize) -> Self {
        Self { file: file.to_path_buf(), place: Place::Line(line) }
    }
}

impl fmt::Display for At {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.place {
            Place::Line(line) => write!(f, "{}:{line}", self.file.display()),
            Place::Byte(byte) => write!(f, "{}, byte {byte}", self.file.display()),
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
        /// Place in the file.
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
        /// Place of the number.
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
        /// Place of the number.
        at: At,
        /// The number.
        found: String,
        /// Number of points.
        count: usize,
    },

    /// What the format has and is not read here.
    #[error("{at}: {found}; {mend}")]
    Unsupported {
        /// Place in the file.
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
pub(super) fn quoted(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(&bytes[..bytes.len().min(4 * QUOTE_LENGTH)]);
    let mut short: String = text.chars().take(QUOTE_LENGTH).collect();
    if short.len() < bytes.len() {
        short.push('…');
    }
    format!("`{}`", short.replace(char::is_control, " "))
}
