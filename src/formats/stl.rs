//! STL: triangles without connectivity. Corners at equal positions become one point; normals are not read, and written from the corners.
//!
//! A file is binary if its length is what the count of a binary file says, or if it does not begin with `solid`. Several solids of a text
//! are regions from 1 on.

use super::cursor::{Cursor, Numbers, Type};
use super::{Encoding, Group, Mesh, Refused, Result, quoted};
use std::collections::HashMap;
use std::fmt::Write as _;

/// Bytes before the first triangle of a binary file, and of each triangle.
const HEADER: usize = 84;
const TRIANGLE: usize = 50;
const FLOAT: Type = Type::Float(4);

/// Points by their positions.
#[derive(Default)]
struct Welded {
    mesh: Mesh,
    ids: HashMap<[u64; 3], u32>,
}

impl Welded {
    fn corner(&mut self, position: [f64; 3]) -> u32 {
        // + 0.0: −0 and 0 are one position
        let position = position.map(|coordinate| coordinate + 0.0);
        let new = self.mesh.points.len() as u32;
        let id = *self.ids.entry(position.map(f64::to_bits)).or_insert(new);
        if id == new {
            self.mesh.points.push(position);
        }
        id
    }

    fn add(&mut self, corners: [[f64; 3]; 3], region: i32) {
        let ids = corners.map(|corner| self.corner(corner));
        self.mesh.triangles.push(ids);
        self.mesh.triangle_regions.push(region);
    }
}

/// Reads a file.
///
/// # Errors
/// [`Refused`], with the location.
pub(super) fn read(cursor: &mut Cursor) -> Result<Mesh> {
    let bytes = cursor.left();
    let count = bytes.get(80..HEADER).map(|count| Type::Unsigned(4).whole(count, false).unwrap_or(0));
    let is_whole = count.is_some_and(|count| bytes.len() as u64 == HEADER as u64 + TRIANGLE as u64 * count);
    match bytes.starts_with(b"solid") && !is_whole {
        true => text(cursor),
        false => binary(cursor, count),
    }
}

fn binary(cursor: &mut Cursor, count: Option<u64>) -> Result<Mesh> {
    let Some(count) = count else {
        return Err(
            cursor.unexpected(quoted(cursor.left()), "`solid`, or the 84 bytes before the triangles of a binary file")
        );
    };
    cursor.numbers = Numbers::Little;
    cursor.go_to(HEADER);
    let count = cursor.holds(count, TRIANGLE, "triangles")?;
    let mut welded = Welded::default();
    for _ in 0..count {
        cursor.tell();
        cursor.take(12, "the normal of a triangle")?;
        let mut corners = [[0.0; 3]; 3];
        for corner in &mut corners {
            *corner = cursor.point(FLOAT)?;
        }
        cursor.take(2, "the attribute of a triangle")?;
        welded.add(corners, 0);
    }
    if !cursor.left().is_empty() {
        let found = format!("{} bytes behind the {count} triangles that are announced", cursor.left().len());
        return Err(cursor.unexpected(found, "the end of the file"));
    }
    Ok(welded.mesh)
}

fn text(cursor: &mut Cursor) -> Result<Mesh> {
    cursor.free = true;
    let mut welded = Welded::default();
    let mut names: Vec<String> = vec![];
    loop {
        match cursor.word() {
            b"" => break,
            b"solid" => names.push(String::from_utf8_lossy(cursor.line().unwrap_or_default()).into_owned()),
            other => return Err(cursor.unexpected(quoted(other), "`solid` and its name")),
        }
        loop {
            cursor.tell();
            match cursor.word() {
                b"facet" => {}
                b"endsolid" => {
                    cursor.line();
                    break;
                }
                b"" => return Err(Refused::End { at: cursor.location(), wanted: "`facet` or `endsolid`" }),
                other => return Err(cursor.unexpected(quoted(other), "`facet` or `endsolid`")),
            }
            // the normal, which may be nan
            cursor.line();
            keywords(cursor, &[b"outer", b"loop"])?;
            let mut corners = [[0.0; 3]; 3];
            for corner in &mut corners {
                keywords(cursor, &[b"vertex"])?;
                *corner = cursor.point(FLOAT)?;
            }
            keywords(cursor, &[b"endloop", b"endfacet"])?;
            welded.add(corners, names.len() as i32);
        }
    }
    let mut mesh = welded.mesh;
    match names.len() {
        0 | 1 => mesh.triangle_regions.fill(0),
        _ => mesh.groups = names.into_iter().zip(1..).map(|(name, tag)| Group { dimension: 2, tag, name }).collect(),
    }
    Ok(mesh)
}

fn keywords(cursor: &mut Cursor, words: &[&'static [u8]]) -> Result<()> {
    for wanted in words {
        let found = cursor.word();
        if found != *wanted {
            let words = "`outer loop`, three lines of `vertex` and three numbers, `endloop` and `endfacet`";
            return Err(match found {
                b"" => Refused::End { at: cursor.location(), wanted: words },
                _ => cursor.unexpected(quoted(found), words),
            });
        }
    }
    Ok(())
}

/// Writes the triangles.
pub(super) fn write(mesh: &Mesh, encoding: Encoding) -> Vec<u8> {
    let normal = |corners: &[[f64; 3]; 3]| {
        let [a, b, c] = corners.map(glam::DVec3::from);
        (b - a).cross(c - a).normalize_or_zero().to_array()
    };
    let triangles = mesh.triangles.iter().map(|ids| ids.map(|id| mesh.points[id as usize]));
    if encoding == Encoding::Binary {
        let mut out = vec![0; 80];
        // not `solid`, with which texts begin
        out[..5].copy_from_slice(b"cutis");
        out.extend((mesh.triangles.len() as u32).to_le_bytes());
        for corners in triangles {
            let numbers = normal(&corners).into_iter().chain(corners.into_iter().flatten());
            out.extend(numbers.flat_map(|number| (number as f32).to_le_bytes()));
            out.extend([0; 2]);
        }
        return out;
    }
    let mut out = String::from("solid cutis\n");
    for corners in triangles {
        let [x, y, z] = normal(&corners);
        write!(out, "facet normal {x:?} {y:?} {z:?}\nouter loop\n").expect("a String takes any text");
        for [x, y, z] in corners {
            writeln!(out, "vertex {x:?} {y:?} {z:?}").expect("a String takes any text");
        }
        out.push_str("endloop\nendfacet\n");
    }
    out.push_str("endsolid cutis\n");
    out.into_bytes()
}
