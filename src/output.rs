//! Result files: meshes for ParaView (`.vtu`), their times (`.pvd`) and tables (`.csv`).
//!
//! Meshes are VTK XML unstructured grids with inline base64 binary arrays in little-endian order. Coordinates are metres. A killed run leaves readable files: meshes and series are written to temporary files and
//! then renamed; tables are flushed in complete lines.

use crate::error::{Error, Result};
use crate::formats::{Array, Encoding, Grid, escaped, write_grid};
use serde::{Deserialize, Serialize};
use std::borrow::{Borrow, Cow};
use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, BufRead as _, BufReader, Write as _};
use std::path::{Path, PathBuf};
/// Result file that cannot be written or continued.
#[derive(Debug, thiserror::Error)]
pub enum Failed {
    /// The system refuses to write.
    #[error("{path}: cannot be written ({source}); choose a folder that exists, is writable and has space")]
    Write {
        /// The file.
        path: PathBuf,
        /// Reason given by the system.
        source: io::Error,
    },

    /// Table that ends before its run.
    #[error(
        "{}: stopped after {bytes} bytes, at the end of a row ({source}); make space on the disk, raise the limit of file sizes (ulimit -f), \
         or choose another folder",
        path.display()
    )]
    Stopped {
        /// The table.
        path: PathBuf,
        /// Its length.
        bytes: u64,
        /// Reason given by the system.
        source: io::Error,
    },

    /// Invalid mesh.
    #[error("{path}: cannot be written as VTK ({message}); choose a folder that exists, is writable and has space")]
    Vtk {
        /// The file.
        path: PathBuf,
        /// Message of the writer.
        message: String,
    },

    /// Table that a resumed run cannot continue.
    #[error("{}: the table {what}; resume in the folder of the run that wrote the checkpoint", path.display())]
    TableUnfit {
        /// The table.
        path: PathBuf,
        /// What is wrong with it.
        what: &'static str,
    },
}

/// Rows between two flushes of a [`Table`]. At 1 kHz a killed run loses at most 64 ms; a flush
/// for each row would cost a system call per step.
const ROWS_PER_FLUSH: usize = 64;

/// VTK's numbers of the shapes that are written.
const VERTEX: u8 = 1;
const TRIANGLE: u8 = 5;
const TETRAHEDRON: u8 = 10;
const HEXAHEDRON: u8 = 12;

/// Values on the points or cells of a mesh; the field's name contains the unit.
#[derive(Clone, Copy, Debug)]
pub enum Field<'a> {
    /// One number each: `[point]` or `[cell]`.
    Scalars(&'a [f64]),
    /// Three numbers each: `[point]` or `[cell]`.
    Vectors(&'a [[f64; 3]]),
    /// Symmetric tensors, `xx yy zz xy yz zx` as in VTK: `[point]` or `[cell]`.
    Tensors(&'a [[f64; 6]]),
}

impl Field<'_> {
    fn len(&self) -> usize {
        match self {
            Field::Scalars(values) => values.len(),
            Field::Vectors(values) => values.len(),
            Field::Tensors(values) => values.len(),
        }
    }
}

/// Writes hexahedra, then tetrahedra to a `.vtu` file; an existing file is replaced atomically.
///
/// `points`: `[node]` m. `hexahedra`, `tetrahedra`: `[cell]` node ids in VTK's order. Fields must have
/// one value per point or cell, and ids must be in range, else [`Failed::Vtk`]. Without cells or
/// points the file is valid and empty.
pub fn write_solids(
    path: &Path,
    points: &[[f64; 3]],
    hexahedra: &[[u32; 8]],
    tetrahedra: &[[u32; 4]],
    point_data: &[(&str, Field)],
    cell_data: &[(&str, Field)],
) -> Result<()> {
    let cells = [(HEXAHEDRON, 8, hexahedra.as_flattened()), (TETRAHEDRON, 4, tetrahedra.as_flattened())];
    write_cells(path, points, &cells, point_data, cell_data)
}

/// Writes triangles to a `.vtu` file; otherwise as [`write_solids`].
pub fn write_triangles(
    path: &Path,
    points: &[[f64; 3]],
    cells: &[[u32; 3]],
    point_data: &[(&str, Field)],
    cell_data: &[(&str, Field)],
) -> Result<()> {
    write_cells(path, points, &[(TRIANGLE, 3, cells.as_flattened())], point_data, cell_data)
}

/// Writes points, each a cell of its own, to a `.vtu` file; otherwise as [`write_solids`].
pub fn write_points(path: &Path, points: &[[f64; 3]], point_data: &[(&str, Field)]) -> Result<()> {
    let ids: Vec<u32> = (0..points.len() as u32).collect();
    write_cells(path, points, &[(VERTEX, 1, &ids)], point_data, &[])
}

/// Cells by VTK's number of their shape, their number of nodes and the nodes of all.
fn write_cells(
    path: &Path,
    points: &[[f64; 3]],
    cells: &[(u8, usize, &[u32])],
    point_data: &[(&str, Field)],
    cell_data: &[(&str, Field)],
) -> Result<()> {
    let vtk_error = |message| Failed::Vtk { path: path.to_owned(), message };
    let connectivity: Vec<u32> = cells.iter().flat_map(|(_, _, ids)| ids.iter().copied()).collect();
    let each = || cells.iter().flat_map(|(shape, nodes, ids)| std::iter::repeat_n((*shape, *nodes), ids.len() / nodes));
    let bad_id = connectivity.iter().find(|&&id| id as usize >= points.len());
    if let Some(id) = bad_id {
        let count = points.len();
        return Err(vtk_error(format!("a cell names point {id}, but there are {count} points")).into());
    }
    let grid = Grid {
        points: points.to_vec(),
        types: each().map(|(shape, _)| shape).collect(),
        offsets: each()
            .scan(0, |end, (_, nodes)| {
                *end += nodes as u64;
                Some(*end)
            })
            .collect(),
        connectivity,
        point_data: arrays(point_data, points.len(), "points").map_err(vtk_error)?,
        cell_data: arrays(cell_data, each().count(), "cells").map_err(vtk_error)?,
        ..Grid::default()
    };
    replace(path, &write_grid(&grid, Encoding::Binary))
}

/// Fields as arrays, or the reason why they are invalid.
fn arrays(fields: &[(&str, Field)], count: usize, of: &str) -> std::result::Result<Vec<Array>, String> {
    let mut arrays = Vec::with_capacity(fields.len());
    for (name, field) in fields {
        if field.len() != count {
            let found = field.len();
            return Err(format!("field `{name}` has {found} values for {count} {of}; give one each"));
        }
        let (components, values) = match field {
            Field::Scalars(values) => (1, values.to_vec()),
            Field::Vectors(values) => (3, values.as_flattened().to_vec()),
            Field::Tensors(values) => (6, values.as_flattened().to_vec()),
        };
        arrays.push(Array { name: (*name).into(), components, values });
    }
    Ok(arrays)
}

/// Writes `bytes` to `path` atomically: a reader, or a killed run, sees the old file or the new one.
pub(crate) fn replace(path: &Path, bytes: &[u8]) -> Result<()> {
    let mut name = path.as_os_str().to_owned();
    name.push(".tmp");
    let temporary = PathBuf::from(name);
    std::fs::write(&temporary, bytes).map_err(|source| {
        std::fs::remove_file(&temporary).ok(); // a part of it would take the last of a full disk
        Failed::Write { path: temporary.clone(), source }
    })?;
    Ok(std::fs::rename(&temporary, path).map_err(|source| Failed::Write { path: path.to_owned(), source })?)
}

/// A `.pvd` file: mesh files with their times.
#[derive(Clone, Debug)]
pub struct Series {
    path: PathBuf,
    entries: String,
}

impl Series {
    /// Empty series. No file is written before the first [`Series::add`].
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Self { path: path.into(), entries: String::new() }
    }

    /// Adds `file_name`, relative to the `.pvd` file, at `time_s` seconds, and rewrites the file.
    pub fn add(&mut self, time_s: f64, file_name: &str) -> Result<()> {
        let file = escaped(file_name);
        let time = shortest(time_s);
        let line = format!("    <DataSet timestep=\"{time}\" part=\"0\" file=\"{file}\"/>\n");
        self.entries.push_str(&line);
        self.write()
    }

    /// Entries so far.
    pub fn entries(&self) -> &str {
        &self.entries
    }

    /// Continues with these entries; replaces a file with others.
    pub fn resume(&mut self, entries: String) -> Result<()> {
        self.entries = entries;
        match self.entries.is_empty() {
            true => {
                std::fs::remove_file(&self.path).ok();
                Ok(())
            }
            false => self.write(),
        }
    }

    fn write(&self) -> Result<()> {
        let text = format!(
            "<?xml version=\"1.0\"?>\n\
             <VTKFile type=\"Collection\" version=\"0.1\" byte_order=\"LittleEndian\">\n  \
             <Collection>\n{}  </Collection>\n</VTKFile>\n",
            self.entries
        );
        replace(&self.path, text.as_bytes())
    }
}

/// A CSV file with a header; each value is written with the fewest digits that read back to the same `f64`. Dropping it flushes;
/// [`Table::finish`] also reports an error of that flush.
#[derive(Debug)]
pub struct Table {
    path: PathBuf,
    file: File,
    column_count: usize,
    /// Whole lines that are not in the file yet, and how many.
    pending: Vec<u8>,
    pending_rows: usize,
    /// The file takes no more; its length has been told.
    stopped: bool,
    line: String,
    kept: TableMark,
}

/// Position in a table: its bytes so far and their checksum.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TableMark {
    bytes: u64,
    sum: u64,
}

impl TableMark {
    const NONE: Self = Self { bytes: 0, sum: checksum(&[]) };

    fn and(self, more: &[u8]) -> Self {
        Self { bytes: self.bytes + more.len() as u64, sum: checksum_on(self.sum, more) }
    }
}

/// Value of a [`Table`].
#[derive(Clone, Copy, Debug)]
pub enum Cell<'a> {
    /// A number.
    Number(f64),
    /// A word; in quotes where it has a comma or a quote (RFC 4180).
    Word(&'a str),
}

fn quoted(word: &str) -> Cow<'_, str> {
    match word.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", word.replace('"', "\"\"")).into(),
        false => word.into(),
    }
}

/// FNV-1a, 64 bits. Source: Fowler, Noll, Vo 1991.
pub(crate) const fn checksum(bytes: &[u8]) -> u64 {
    checksum_on(0xcbf2_9ce4_8422_2325, bytes)
}

const fn checksum_on(mut sum: u64, bytes: &[u8]) -> u64 {
    let mut at = 0;
    while at < bytes.len() {
        sum = (sum ^ bytes[at] as u64).wrapping_mul(0x0100_0000_01b3);
        at += 1;
    }
    sum
}

impl Table {
    /// Creates a file with the column names, which contain units, at `path`: atomically, so that it never lacks its header.
    pub fn create(path: &Path, columns: &[impl Borrow<str>]) -> Result<Self> {
        let header = columns.join(",") + "\n";
        replace(path, header.as_bytes())?;
        let file = File::options().append(true).open(path);
        let file = file.map_err(|source| Failed::Write { path: path.to_owned(), source })?;
        Ok(Self::at(path, file, columns.len(), TableMark::NONE.and(header.as_bytes())))
    }

    fn at(path: &Path, file: File, column_count: usize, kept: TableMark) -> Self {
        let path = path.to_owned();
        Self { path, file, column_count, pending: vec![], pending_rows: 0, stopped: false, line: String::new(), kept }
    }

    /// Checks that a file begins with what a table of these columns wrote up to a mark.
    ///
    /// # Errors
    /// [`Failed::TableUnfit`] for one that does not.
    pub fn verify(path: &Path, columns: &[impl Borrow<str>], kept: TableMark) -> Result<()> {
        let unfit = |what| Err(Failed::TableUnfit { path: path.to_owned(), what }.into());
        let Ok(opened) = File::open(path) else { return unfit("cannot be opened") };
        let (mut file, mut found, mut header) = (BufReader::new(opened), TableMark::NONE, String::new());
        let failed = |source| Failed::Write { path: path.to_owned(), source };
        file.read_line(&mut header).map_err(failed)?;
        if header.trim_end() != columns.join(",") {
            return unfit("has other columns than the scene asks for");
        }
        found = found.and(header.as_bytes());
        while found.bytes < kept.bytes {
            let block = file.fill_buf().map_err(failed)?;
            let used = block.len().min((kept.bytes - found.bytes) as usize);
            if used == 0 {
                return unfit("is shorter than when the checkpoint was written");
            }
            found = found.and(&block[..used]);
            file.consume(used);
        }
        if found == kept { Ok(()) } else { unfit("is of another run than the checkpoint") }
    }

    /// Continues a table at a mark checked by [`Table::verify`]; truncates what follows it.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn reopen(path: &Path, columns: &[impl Borrow<str>], kept: TableMark) -> Result<Self> {
        let failed = |source| Failed::Write { path: path.to_owned(), source };
        let opened = File::options().write(true).open(path).map_err(failed)?;
        opened.set_len(kept.bytes).map_err(failed)?;
        let file = File::options().append(true).open(path).map_err(failed)?;
        Ok(Self::at(path, file, columns.len(), kept))
    }

    /// Mark of the current position, with all rows flushed.
    pub fn kept(&mut self) -> Result<TableMark> {
        self.flush()?;
        Ok(self.kept)
    }

    /// Adds a row, one value per column. Lines reach the file complete, also where the disk is full in the middle of one.
    ///
    /// # Panics
    /// If the number of values is not the number of columns.
    pub fn row(&mut self, values: &[f64]) -> Result<()> {
        self.cells(values.iter().map(|value| Cell::Number(*value)))
    }

    /// Adds a row of numbers and words; otherwise as [`Table::row`].
    ///
    /// # Panics
    /// If the number of cells is not the number of columns.
    pub fn cells<'a>(&mut self, cells: impl IntoIterator<Item = Cell<'a>>) -> Result<()> {
        self.line.clear();
        let mut count = 0;
        for cell in cells {
            let comma = if count == 0 { "" } else { "," };
            let text = match cell {
                // + 0.0 avoids −0: which zero a maximum returns depends on the processor
                Cell::Number(value) => shortest(value + 0.0).into(),
                Cell::Word(word) => quoted(word),
            };
            write!(self.line, "{comma}{text}").expect("a String takes any text");
            count += 1;
        }
        assert_eq!(count, self.column_count, "values in a row of {}", self.path.display());
        self.line.push('\n');
        self.kept = self.kept.and(self.line.as_bytes());
        if !self.stopped {
            self.pending.extend_from_slice(self.line.as_bytes());
            self.pending_rows += 1;
        }
        if self.pending_rows < ROWS_PER_FLUSH { Ok(()) } else { self.flush() }
    }

    /// Flushes all rows so far.
    ///
    /// # Errors
    /// [`Failed::Stopped`], once; the file then ends with its last whole line, and stays as it is.
    pub fn flush(&mut self) -> Result<()> {
        if self.stopped {
            return Ok(());
        }
        if let Err(source) = self.file.write_all(&self.pending) {
            return Err(self.cut_back(source));
        }
        self.pending.clear();
        self.pending_rows = 0;
        Ok(())
    }

    /// Cuts a line off that the file took a part of.
    fn cut_back(&mut self, source: io::Error) -> Error {
        let before = self.kept.bytes - self.pending.len() as u64;
        let length = self.file.metadata().map_or(before, |file| file.len());
        let part = &self.pending[..self.pending.len().min(length.saturating_sub(before) as usize)];
        let whole = part.iter().rposition(|byte| *byte == b'\n').map_or(0, |at| at + 1);
        let bytes = before + whole as u64;
        self.pending.clear();
        self.stopped = true;
        // where even this is refused, the message has the length up to which the table is good
        self.file.set_len(bytes).ok();
        Failed::Stopped { path: self.path.clone(), bytes, source }.into()
    }

    /// Flushes and closes the file.
    pub fn finish(mut self) -> Result<()> {
        self.flush()
    }
}

impl Drop for Table {
    fn drop(&mut self) {
        drop(self.flush());
    }
}

/// Shortest text that reads back to the same value; very small and large ones as `1.5e-7`.
fn shortest(value: f64) -> String {
    let size = value.abs();
    if size == 0.0 || (1e-5..1e16).contains(&size) || !size.is_finite() {
        format!("{value}")
    } else {
        format!("{value:e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::read_grid;

    /// A folder of its own for one test, removed at the end.
    struct Folder(PathBuf);

    impl Folder {
        fn new(name: &str) -> Self {
            let path = std::env::temp_dir().join(format!("cutis-{}-{name}", std::process::id()));
            std::fs::create_dir_all(&path).unwrap();
            Self(path)
        }

        fn file(&self, name: &str) -> PathBuf {
            self.0.join(name)
        }
    }

    impl Drop for Folder {
        fn drop(&mut self) {
            std::fs::remove_dir_all(&self.0).ok();
        }
    }

    fn read(path: &Path) -> Grid {
        read_grid(&std::fs::read(path).unwrap(), path).unwrap()
    }

    fn array(name: &str, components: usize, values: &[f64]) -> Array {
        Array { name: name.into(), components, values: values.to_vec() }
    }

    const CUBE: [[f64; 3]; 8] = [
        [0.0, 0.0, 0.0],
        [1e-3, 0.0, 0.0],
        [1e-3, 0.1, 0.0],
        [0.0, 0.1, 0.0],
        [0.0, 0.0, 0.3],
        [1e-3, 0.0, 0.3],
        [1e-3, 0.1, 0.3],
        [0.0, 0.1, 0.3],
    ];

    #[test]
    fn hexahedra_and_tetrahedra_read_back_equal() {
        let folder = Folder::new("hexes");
        let path = folder.file("cube.vtu");
        let speed = CUBE.map(|p| [p[0] + 0.1, -p[1], 1.0 / 3.0]);
        let temperature: Vec<f64> = (0..8).map(|i| f64::from(i) / 7.0).collect();
        write_solids(
            &path,
            &CUBE,
            &[[0, 1, 2, 3, 4, 5, 6, 7]],
            &[[0, 1, 3, 4]],
            &[("v_m_s", Field::Vectors(&speed)), ("t_K", Field::Scalars(&temperature))],
            &[("layer", Field::Scalars(&[2.0, 1.0]))],
        )
        .unwrap();
        let piece = read(&path);
        assert_eq!((piece.points.as_slice(), piece.types.as_slice()), (&CUBE[..], &[HEXAHEDRON, TETRAHEDRON][..]));
        assert_eq!((piece.offsets, piece.connectivity), (vec![8, 12], (0..8).chain([0, 1, 3, 4]).collect()));
        assert_eq!(piece.point_data, [array("v_m_s", 3, speed.as_flattened()), array("t_K", 1, &temperature)]);
        assert_eq!(piece.cell_data, [array("layer", 1, &[2.0, 1.0])]);
        assert!(!folder.file("cube.vtu.tmp").exists());
    }

    #[test]
    fn triangles_read_back_equal() {
        let folder = Folder::new("triangles");
        let path = folder.file("two.vtu");
        let normals = [[0.0, 0.0, -1.0], [0.5, 0.25, 0.125]];
        let data = [("normal", Field::Vectors(&normals))];
        write_triangles(&path, &CUBE[..4], &[[0, 2, 1], [0, 3, 2]], &[], &data).unwrap();
        let piece = read(&path);
        assert_eq!((piece.points.as_slice(), piece.types.as_slice()), (&CUBE[..4], &[TRIANGLE; 2][..]));
        assert_eq!((piece.offsets, piece.connectivity), (vec![3, 6], vec![0, 2, 1, 0, 3, 2]));
        assert!(piece.point_data.is_empty());
        assert_eq!(piece.cell_data, [array("normal", 3, normals.as_flattened())]);
    }

    #[test]
    fn an_empty_mesh_is_a_valid_file() {
        let folder = Folder::new("empty");
        let path = folder.file("empty.vtu");
        write_solids(&path, &[], &[], &[], &[("v", Field::Vectors(&[]))], &[]).unwrap();
        let piece = read(&path);
        assert_eq!((piece.points.len(), piece.types.len()), (0, 0));
        assert_eq!(piece.point_data, [array("v", 3, &[])]);
        write_triangles(&path, &CUBE, &[], &[], &[]).unwrap();
        assert_eq!(read(&path).points.len(), 8);
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.contains("<Piece NumberOfPoints=\"8\" NumberOfCells=\"0\""));
    }

    #[test]
    fn wrong_sizes_and_folders_are_errors() {
        let folder = Folder::new("errors");
        let path = folder.file("bad.vtu");
        let short = [("t", Field::Scalars(&[1.0]))];
        let error = write_triangles(&path, &CUBE, &[], &short, &[]).unwrap_err();
        assert!(error.to_string().contains("field `t` has 1 values for 8 points"), "{error}");
        let error = write_triangles(&path, &CUBE, &[[0, 1, 8]], &[], &[]).unwrap_err();
        assert!(error.to_string().contains("point 8, but there are 8 points"), "{error}");
        assert!(!path.exists());
        let nowhere = folder.file("missing").join("a.vtu");
        let error = write_triangles(&nowhere, &CUBE, &[], &[], &[]).unwrap_err();
        assert!(matches!(error, Error::Output(Failed::Write { .. })), "{error}");
    }

    #[test]
    fn a_series_is_complete_after_each_add() {
        let folder = Folder::new("series");
        let path = folder.file("run.pvd");
        let mut series = Series::new(&path);
        series.add(0.0, "a.vtu").unwrap();
        let head = "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\" \
                    byte_order=\"LittleEndian\">\n  <Collection>\n    \
                    <DataSet timestep=\"0\" part=\"0\" file=\"a.vtu\"/>\n";
        let tail = "  </Collection>\n</VTKFile>\n";
        assert_eq!(std::fs::read_to_string(&path).unwrap(), format!("{head}{tail}"));
        series.add(0.02, "b&\"c.vtu").unwrap();
        let second = "    <DataSet timestep=\"0.02\" part=\"0\" file=\"b&amp;&quot;c.vtu\"/>\n";
        assert_eq!(std::fs::read_to_string(&path).unwrap(), format!("{head}{second}{tail}"));
        assert!(!folder.file("run.pvd.tmp").exists());
    }

    #[test]
    fn a_table_holds_whole_lines_that_read_back_equal() {
        let folder = Folder::new("table");
        let path = folder.file("force.csv");
        let mut table = Table::create(&path, &["time_s", "force_N"]).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "time_s,force_N\n");
        for i in 0..1000 {
            table.row(&[f64::from(i) * 1e-3, 1.0 / 3.0]).unwrap();
            let text = std::fs::read_to_string(&path).unwrap();
            assert!(text.ends_with('\n') && text.lines().all(|l| l.matches(',').count() == 1));
            assert!(i as usize + 2 - text.lines().count() < ROWS_PER_FLUSH);
        }
        table.row(&[-0.0, 1.5e-7]).unwrap();
        table.row(&[f64::NAN, 2e300]).unwrap();
        table.finish().unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.starts_with("time_s,force_N\n0,0.3333333333333333\n0.001,"), "{text}");
        assert!(text.ends_with("\n0,1.5e-7\nNaN,2e300\n"), "{text}");
        let row: Vec<f64> = text.lines().nth(8).unwrap().split(',').map(|v| v.parse().unwrap()).collect();
        assert_eq!(row, [7.0 * 1e-3, 1.0 / 3.0]);
    }

    #[test]
    fn a_dropped_table_is_flushed() {
        let folder = Folder::new("dropped");
        let path = folder.file("t.csv");
        Table::create(&path, &["a"]).unwrap().row(&[2.0]).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "a\n2\n");
    }
}
