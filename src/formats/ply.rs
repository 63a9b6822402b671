//! PLY 1.0: vertices and faces; other elements and properties are passed over. A property `region` of faces is kept.

use super::cursor::{Cursor, Numbers, Type};
use super::{Cell, Encoding, Mesh, Refused, Result, quoted};
use std::fmt::Write as _;

/// Property of an element.
struct Property {
    name: Vec<u8>,
    /// Type of the number before a list; none for a single number.
    list: Option<Type>,
    kind: Type,
}

/// Kind of thing that a file has some of.
struct Element {
    name: Vec<u8>,
    count: u64,
    properties: Vec<Property>,
}

impl Element {
    /// Fewest bytes of one.
    fn least(&self, numbers: Numbers) -> usize {
        let of = |p: &Property| if numbers == Numbers::Text { 2 } else { p.list.unwrap_or(p.kind).bytes() };
        self.properties.iter().map(of).sum()
    }

    fn find(&self, names: &[&[u8]]) -> Option<usize> {
        self.properties.iter().position(|p| names.contains(&&p.name[..]))
    }
}

fn kind(word: &[u8]) -> Option<Type> {
    Some(match word {
        b"char" | b"int8" => Type::Signed(1),
        b"uchar" | b"uint8" => Type::Unsigned(1),
        b"short" | b"int16" => Type::Signed(2),
        b"ushort" | b"uint16" => Type::Unsigned(2),
        b"int" | b"int32" => Type::Signed(4),
        b"uint" | b"uint32" => Type::Unsigned(4),
        b"int64" => Type::Signed(8),
        b"uint64" => Type::Unsigned(8),
        b"float" | b"float32" => Type::Float(4),
        b"double" | b"float64" => Type::Float(8),
        _ => return None,
    })
}

/// Reads a file.
///
/// # Errors
/// [`Refused`], with the location.
pub(super) fn read(cursor: &mut Cursor) -> Result<Mesh> {
    let (numbers, elements) = header(cursor)?;
    cursor.numbers = numbers;
    let mut mesh = Mesh::default();
    let mut faces = vec![];
    for element in &elements {
        let least = element.least(numbers);
        if least == 0 {
            continue;
        }
        let count = cursor.holds(element.count, least, "elements")?;
        match &element.name[..] {
            b"vertex" => vertices(cursor, element, count, &mut mesh)?,
            b"face" => self::faces(cursor, element, count, &mut faces)?,
            _ => {
                for _ in 0..count {
                    skip(cursor, &element.properties)?;
                }
            }
        }
    }
    // faces may stand above vertices, so that ids are known at the end only
    let mut start = 0;
    while let Some([count, region, ..]) = faces.get(start..).filter(|rest| rest.len() > 1) {
        let nodes = &faces[start + 2..start + 2 + *count as usize];
        if let Some(id) = nodes.iter().find(|id| **id as usize >= mesh.points.len()) {
            return Err(Refused::Point { at: cursor.location(), found: id.to_string(), count: mesh.points.len() });
        }
        let cell = match nodes.len() {
            3 => Cell::Triangle,
            4 => Cell::Quadrilateral,
            _ => Cell::Polygon,
        };
        mesh.add(cell, nodes, *region as i32);
        start += 2 + nodes.len();
    }
    Ok(mesh)
}

fn header(cursor: &mut Cursor) -> Result<(Numbers, Vec<Element>)> {
    if cursor.line() != Some(b"ply") {
        cursor.go_to(0);
        let found = quoted(&cursor.left()[..cursor.left().len().min(40)]);
        return Err(cursor.unexpected(found, "`ply` on the first line"));
    }
    // a statement per line, up to `end_header`
    let mut numbers = None;
    let mut elements: Vec<Element> = vec![];
    loop {
        let at = cursor.location();
        let Some(line) = cursor.line() else {
            return Err(Refused::End { at, wanted: "`end_header`" });
        };
        // the line by words, and a property from them
        let words: Vec<&[u8]> = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty()).collect();
        let unexpected = |wanted| Refused::Unexpected { at, found: quoted(line), wanted };
        let property = |name: &[u8], list: Option<&[u8]>, of: &[u8]| {
            let list = match list {
                Some(word) => Some(kind(word).filter(|kind| !matches!(kind, Type::Float(_)))?),
                None => None,
            };
            Some(Property { name: name.to_vec(), list, kind: kind(of)? })
        };
        match &words[..] {
            [b"end_header"] => break,
            [] | [b"comment" | b"obj_info", ..] => {}
            [b"format", format, b"1.0"] => {
                numbers = Some(match *format {
                    b"ascii" => Numbers::Text,
                    b"binary_little_endian" => Numbers::Little,
                    b"binary_big_endian" => Numbers::Big,
                    _ => return Err(unexpected("ascii, binary_little_endian or binary_big_endian")),
                });
            }
            [b"format", ..] => return Err(unexpected("`format`, the way that numbers stand, and the version 1.0")),
            [b"element", name, count] => {
                let count =
                    super::cursor::digits(count).ok_or_else(|| unexpected("`element`, its name and their number"))?;
                elements.push(Element { name: name.to_vec(), count, properties: vec![] });
            }
            [b"property", rest @ ..] => {
                // of the element before
                let found = match rest {
                    [b"list", list, of, name] => property(name, Some(list), of),
                    [of, name] => property(name, None, of),
                    _ => None,
                };
                match (found, elements.last_mut()) {
                    (Some(property), Some(element)) => element.properties.push(property),
                    _ => {
                        return Err(unexpected(
                            "a property of an element above: `property TYPE NAME` or `property list TYPE TYPE NAME`",
                        ));
                    }
                }
            }
            _ => return Err(unexpected("a line of the header: format, comment, element, property or end_header")),
        }
    }
    match numbers {
        Some(numbers) => Ok((numbers, elements)),
        None => Err(cursor.unexpected("a header without a format", "`format ascii 1.0` or another one")),
    }
}

/// Passes over numbers of an element.
fn skip(cursor: &mut Cursor, properties: &[Property]) -> Result<()> {
    cursor.row("an element of the file")?;
    for property in properties {
        skip_one(cursor, property)?;
    }
    Ok(())
}

fn skip_one(cursor: &mut Cursor, property: &Property) -> Result<()> {
    let count = match property.list {
        Some(list) => cursor.count(list, [2, property.kind.bytes()], "numbers of a list")?,
        None => 1,
    };
    for _ in 0..count {
        cursor.real(property.kind, "a property of an element")?;
    }
    Ok(())
}

fn vertices(cursor: &mut Cursor, element: &Element, count: usize, mesh: &mut Mesh) -> Result<()> {
    let axes = [b"x", b"y", b"z"].map(|axis| element.find(&[axis]));
    let [Some(x), Some(y), Some(z)] = axes else {
        return Err(cursor.unexpected("vertices without x, y and z", "a property of each of these names"));
    };
    mesh.points.reserve(count);
    for _ in 0..count {
        cursor.row("a vertex")?;
        let at = cursor.location_of_next();
        let mut point = [f64::NAN; 3];
        for (k, property) in element.properties.iter().enumerate() {
            match [x, y, z].iter().position(|axis| *axis == k) {
                Some(axis) if property.list.is_none() => {
                    point[axis] = cursor.real(property.kind, "a coordinate of a vertex")?;
                }
                _ => skip_one(cursor, property)?,
            }
        }
        if !point.iter().all(|coordinate| coordinate.is_finite()) {
            let found = format!("a vertex at {point:?}");
            return Err(Refused::Unexpected { at: cursor.at(at), found, wanted: "three finite numbers" });
        }
        mesh.points.push(point);
    }
    Ok(())
}

/// Adds for each face its number of points, its region and the points.
fn faces(cursor: &mut Cursor, element: &Element, count: usize, out: &mut Vec<u32>) -> Result<()> {
    let list = element.find(&[b"vertex_indices", b"vertex_index"]).filter(|k| element.properties[*k].list.is_some());
    let region_of = element.find(&[b"region"]).filter(|k| element.properties[*k].list.is_none());
    let Some(list) = list else {
        return Err(cursor.unexpected("faces without a list of vertices", "`property list uchar int vertex_indices`"));
    };
    for _ in 0..count {
        cursor.row("a face")?;
        let start = out.len();
        out.extend([0, 0]);
        for (k, property) in element.properties.iter().enumerate() {
            if Some(k) == region_of {
                let region = cursor.real(property.kind, "the region of a face")?;
                out[start + 1] = region as i32 as u32;
            } else if let Some(kind) = property.list.filter(|_| k == list) {
                let at = cursor.location_of_next();
                let nodes = cursor.count(kind, [2, property.kind.bytes()], "vertices of a face")?;
                if nodes < 3 {
                    let found = format!("a face of {nodes} vertices");
                    return Err(Refused::Unexpected { at: cursor.at(at), found, wanted: "three or more" });
                }
                out[start] = nodes as u32;
                for _ in 0..nodes {
                    let id = cursor.whole(property.kind, "the number of a vertex, from 0")?;
                    out.push(u32::try_from(id).unwrap_or(u32::MAX));
                }
            } else {
                skip_one(cursor, property)?;
            }
        }
    }
    Ok(())
}

/// Writes the points and triangles; regions where there are any.
pub(super) fn write(mesh: &Mesh, encoding: Encoding) -> Vec<u8> {
    let binary = encoding == Encoding::Binary;
    let format = if binary { "binary_little_endian" } else { "ascii" };
    let has_regions = mesh.triangle_regions.iter().any(|region| *region != 0);
    let property = if has_regions { "property int region\n" } else { "" };
    let mut text = format!(
        "ply\nformat {format} 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\n\
         element face {}\nproperty list uchar int vertex_indices\n{property}end_header\n",
        mesh.points.len(),
        mesh.triangles.len()
    );
    let of_triangles = mesh.triangles.iter().zip(&mesh.triangle_regions);
    if binary {
        let mut out = text.into_bytes();
        out.extend(mesh.points.iter().flatten().flat_map(|coordinate| coordinate.to_le_bytes()));
        for (ids, region) in of_triangles {
            out.push(3);
            out.extend(ids.iter().flat_map(|id| id.to_le_bytes()));
            if has_regions {
                out.extend(region.to_le_bytes());
            }
        }
        return out;
    }
    for [x, y, z] in &mesh.points {
        writeln!(text, "{x:?} {y:?} {z:?}").expect("a String takes any text");
    }
    for ([a, b, c], region) in of_triangles {
        let region = if has_regions { format!(" {region}") } else { String::new() };
        writeln!(text, "3 {a} {b} {c}{region}").expect("a String takes any text");
    }
    text.into_bytes()
}
