//! Wavefront OBJ files: vertices, and the faces, polylines and points on them.
//!
//! Indices count from 1, or back from the last vertex so far if negative; anything after a slash is ignored. A `#` starts a comment, and a
//! backslash at the end of a line continues it. Lines of other kinds (normals, groups, materials) are skipped.

use super::ToolMesh;
use super::diagnose::shorten;
use super::invalid::{Invalid, Location, Result};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::Path;

/// Content of a file; ids of vertices from 0.
pub(super) struct Obj<'a> {
    path: &'a Path,
    /// Line and words of each statement.
    statements: Vec<(usize, Cow<'a, str>)>,
    vertices: Vec<[f64; 3]>,
    /// `[vertex]` statement.
    of: Vec<usize>,
}

/// Words of a statement behind its first, with the line where it starts.
struct Statement<'a> {
    at: Location,
    text: &'a str,
    words: Vec<&'a str>,
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
                let found = || Invalid::ObjNumber { at: Location::new(path, *line), found: shorten(text) };
                obj.vertices.push(vertex.ok_or_else(found)?);
                obj.of.push(k);
            }
        }
        Ok(obj)
    }

    /// Statements of a kind, in the order of the file.
    fn of_kind(&self, kind: &str) -> impl Iterator<Item = Statement<'_>> {
        self.statements.iter().enumerate().filter_map(move |(k, (line, text))| {
            let mut words = text.split_whitespace();
            (words.next() == Some(kind)).then(|| Statement {
                at: Location::new(self.path, *line),
                text,
                words: words.collect(),
                count: self.of.partition_point(|other| *other < k),
            })
        })
    }

    /// Vertices that a statement names.
    fn ids(&self, statement: &Statement) -> Result<Vec<usize>> {
        let count = statement.count;
        let id = |word: &&str| {
            let number = word.split('/').next().and_then(|first| first.parse::<i64>().ok());
            let found = number.and_then(|number| match number {
                1.. => usize::try_from(number - 1).ok(),
                0 => None,
                _ => count.checked_sub(usize::try_from(number.unsigned_abs()).ok()?),
            });
            let known = found.filter(|id| *id < count);
            known.ok_or_else(|| Invalid::ObjIndex { at: statement.at.clone(), found: shorten(word), count })
        };
        statement.words.iter().map(id).collect()
    }

    /// Vertices of each statement of a kind, at least `least`, with its line.
    fn lists(&self, kind: &str, least: usize) -> Result<Vec<(Vec<usize>, Location)>> {
        let list = |statement: Statement| {
            let ids = self.ids(&statement)?;
            let short = |at| Invalid::ObjShort { at, found: shorten(statement.text), wanted: least };
            if ids.len() < least { Err(short(statement.at)) } else { Ok((ids, statement.at)) }
        };
        self.of_kind(kind).map(list).collect()
    }

    /// Segments of the polylines.
    pub fn segments(&self) -> Result<Vec<[usize; 2]>> {
        let mut segments = vec![];
        for (ids, at) in self.lists("l", 2)? {
            for pair in ids.windows(2) {
                if self.vertices[pair[0]] == self.vertices[pair[1]] {
                    return Err(Invalid::LinesShort { at, a: pair[0] + 1, b: pair[1] + 1 });
                }
                segments.push([pair[0], pair[1]]);
            }
        }
        Ok(segments)
    }

    /// Points.
    pub fn points(&self) -> Result<Vec<usize>> {
        Ok(self.lists("p", 1)?.into_iter().flat_map(|(ids, _)| ids).collect())
    }

    /// Position of a vertex, m; `unit` is one unit of the file in m.
    pub fn position(&self, id: usize, unit: f64) -> Result<[f64; 3]> {
        let position = self.vertices[id].map(|coordinate| coordinate * unit);
        if position.iter().all(|coordinate| (*coordinate as f32).is_finite()) {
            return Ok(position);
        }
        let (line, text) = &self.statements[self.of[id]];
        Err(Invalid::ObjFar { at: Location::new(self.path, *line), found: shorten(text) })
    }

    /// The faces as triangle fans, on the vertices that they use.
    pub fn triangles(&self, unit: f64) -> Result<ToolMesh> {
        let mut used = BTreeMap::new(); // number of each vertex in use, in the order of use
        let mut mesh = ToolMesh { positions: vec![], triangles: vec![] };
        for (ids, _) in self.lists("f", 3)? {
            let mut corners = vec![];
            for id in ids {
                if let std::collections::btree_map::Entry::Vacant(new) = used.entry(id) {
                    new.insert(mesh.positions.len() as u32);
                    mesh.positions.push(self.position(id, unit)?);
                }
                corners.push(used[&id]);
            }
            mesh.triangles.extend(corners[1..].windows(2).map(|pair| [corners[0], pair[0], pair[1]]));
        }
        match mesh.triangles.is_empty() {
            true => Err(Invalid::MeshEmpty { path: self.path.to_path_buf() }),
            false => Ok(mesh),
        }
    }
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
    let parsed = numbers.split_whitespace().take(3).map(|word| word.parse::<f64>().ok().filter(|n| n.is_finite()));
    <[f64; 3]>::try_from(parsed.collect::<Option<Vec<f64>>>()?).ok()
}
