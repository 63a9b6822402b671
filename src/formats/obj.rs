//! Wavefront OBJ files: vertices, and the faces, polylines and points on them.
//!
//! Indices count from 1, or back from the last vertex so far if negative; anything after a slash is ignored. A `#` starts a comment, and a
//! backslash at the end of a line continues it. Lines of other kinds (normals, groups, materials) are skipped.

use super::{At, Cell, Mesh, Refused, Result, quoted};
use std::borrow::Cow;
use std::fmt::Write as _;
use std::path::Path;

/// Content of a file; ids of vertices from 0.
pub struct Obj<'a> {
    /// File name as given by the user.
    pub path: &'a Path,
    /// `[vertex]` in the file's unit.
    pub vertices: Vec<[f64; 3]>,
    /// Line and text of each statement.
    statements: Vec<(usize, Cow<'a, str>)>,
    /// `[vertex]` statement.
    of: Vec<usize>,
}

/// Vertices of a face, a polyline or a list of points, with its line.
pub type List = (Vec<usize>, usize);

/// Words of a statement behind its first, with the line where it starts.
struct Statement<'a> {
    line: usize,
    text: &'a str,
    words: std::str::SplitWhitespace<'a>,
    /// Vertices above it.
    count: usize,
}

impl<'a> Obj<'a> {
    /// Reads the vertices of a text.
    ///
    /// # Errors
    /// For a `v` line without three finite numbers.
    pub fn read(text: &'a str, path: &'a Path) -> Result<Self> {
        let statements = statements(text.trim_start_matches('\u{feff}'));
        let mut obj = Self { path, statements, vertices: vec![], of: vec![] };
        for (k, (line, text)) in obj.statements.iter().enumerate() {
            if let Some(numbers) = text.strip_prefix('v').filter(|rest| rest.starts_with(char::is_whitespace)) {
                let vertex = three(numbers);
                let found = || Refused::ObjNumber { at: At::line(path, *line), found: shorten(text) };
                obj.vertices.push(vertex.ok_or_else(found)?);
                obj.of.push(k);
            }
        }
        Ok(obj)
    }

    /// Line and text of a vertex.
    pub fn line(&self, vertex: usize) -> (usize, &str) {
        let (line, text) = &self.statements[self.of[vertex]];
        (*line, text)
    }

    /// Statements of a kind, in the order of the file.
    fn of_kind(&self, kind: &str) -> impl Iterator<Item = Statement<'_>> {
        self.statements.iter().enumerate().filter_map(move |(k, (line, text))| {
            let mut words = text.split_whitespace();
            (words.next() == Some(kind)).then(|| {
                let count = self.of.partition_point(|other| *other < k);
                Statement { line: *line, text, words, count }
            })
        })
    }

    /// Vertices that a statement names.
    fn ids(&self, statement: &Statement) -> Result<Vec<usize>> {
        let count = statement.count;
        let id = |word: &str| {
            let number = word.split('/').next().and_then(|first| first.parse::<i64>().ok());
            let found = number.and_then(|number| match number {
                1.. => usize::try_from(number - 1).ok(),
                0 => None,
                _ => count.checked_sub(usize::try_from(number.unsigned_abs()).ok()?),
            });
            let at = || At::line(self.path, statement.line);
            let known = found.filter(|id| *id < count);
            known.ok_or_else(|| Refused::ObjIndex { at: at(), found: shorten(word), count })
        };
        statement.words.clone().map(id).collect()
    }

    /// Vertices of each statement of a kind (`f`, `l`, `p`), at least `least`.
    ///
    /// # Errors
    /// For an index without a vertex, or too few of them.
    pub fn lists(&self, kind: &str, least: usize) -> Result<Vec<List>> {
        let list = |statement: Statement| {
            let ids = self.ids(&statement)?;
            let at = At::line(self.path, statement.line);
            let short = || Refused::ObjShort { at, found: shorten(statement.text), wanted: least };
            if ids.len() < least { Err(short()) } else { Ok((ids, statement.line)) }
        };
        self.of_kind(kind).map(list).collect()
    }
}

/// Reads the vertices and faces of a file.
///
/// # Errors
/// [`Refused`], with the line.
pub(super) fn read(bytes: &[u8], path: &Path) -> Result<Mesh> {
    let text = std::str::from_utf8(bytes).map_err(|error| {
        let line = 1 + bytes[..error.valid_up_to()].iter().filter(|byte| **byte == b'\n').count();
        let found = format!("the byte 0x{:02x}, which is not UTF-8", bytes[error.valid_up_to()]);
        Refused::Unexpected { at: At::line(path, line), found, wanted: "text in UTF-8" }
    })?;
    let obj = Obj::read(text, path)?;
    let faces = obj.lists("f", 3)?;
    let mut mesh = Mesh { points: obj.vertices, ..Mesh::default() };
    if mesh.points.len() >= u32::MAX as usize {
        return Err(Refused::TooMany { path: path.to_path_buf(), count: mesh.points.len() as u64 });
    }
    let mut nodes = vec![];
    for (ids, _) in faces {
        nodes.clear();
        nodes.extend(ids.into_iter().map(|id| id as u32));
        let cell = match nodes.len() {
            3 => Cell::Triangle,
            4 => Cell::Quadrilateral,
            _ => Cell::Polygon,
        };
        mesh.add(cell, &nodes, 0);
    }
    Ok(mesh)
}

/// Writes the points and triangles.
pub(super) fn write(mesh: &Mesh) -> Vec<u8> {
    let mut out = String::new();
    for [x, y, z] in &mesh.points {
        writeln!(out, "v {x:?} {y:?} {z:?}").expect("a String takes any text");
    }
    for ids in &mesh.triangles {
        let [a, b, c] = ids.map(|id| id + 1);
        writeln!(out, "f {a} {b} {c}").expect("a String takes any text");
    }
    out.into_bytes()
}

/// Lines without comments and blanks around them, continued ones as one, with the number of the first.
fn statements(text: &str) -> Vec<(usize, Cow<'_, str>)> {
    let mut statements: Vec<(usize, Cow<str>)> = vec![];
    let mut continues = false;
    for (k, line) in text.lines().enumerate() {
        let line = line.split('#').next().unwrap_or_default().trim();
        let (line, goes_on) = line.strip_suffix('\\').map_or((line, false), |line| (line.trim_end(), true));
        match statements.last_mut().filter(|_| continues) {
            Some((_, begun)) => begun.to_mut().extend([" ", line]),
            None => statements.push((k + 1, line.into())),
        }
        continues = goes_on;
    }
    statements.retain(|(_, text)| !text.is_empty());
    statements
}

/// Coordinates; a weight or a colour may follow them.
fn three(numbers: &str) -> Option<[f64; 3]> {
    let mut words = numbers.split_whitespace();
    let mut vertex = [0.0; 3];
    for coordinate in &mut vertex {
        *coordinate = words.next()?.parse().ok().filter(|number: &f64| number.is_finite())?;
    }
    Some(vertex)
}

/// Text for a message that puts it in quotes itself.
fn shorten(text: &str) -> String {
    quoted(text.as_bytes()).trim_matches('`').into()
}
