//! Gmsh `.msh`: 2.2 and 4.1 read, 2.2 written.
//!
//! A cell's region is the first physical group that it is in: in 2.2 its first tag, in 4.1 that of its entity. Numbers of points may have
//! gaps. Sections that are not of the mesh (periodicity, fields) are skipped.

use super::cursor::{Cursor, Numbers, Type, digits};
use super::grid::gmsh_name;
use super::{Cell, Encoding, Group, Mesh, Refused, Result, quoted};
use std::collections::HashMap;
use std::fmt::Write as _;

const INT: Type = Type::Signed(4);
const SIZE: Type = Type::Unsigned(8);
const REAL: Type = Type::Float(8);
/// Sections with what is not read here, and would be missed.
const PARTITIONED: &[u8] = b"$PartitionedEntities";

/// What has been read so far.
#[derive(Default)]
struct Read {
    mesh: Mesh,
    /// Version 4.1; else 2.2.
    is_4: bool,
    /// How the numbers of the data sections stand.
    numbers: Option<Numbers>,
    /// Region of each entity, by dimension and tag.
    regions: HashMap<(i32, i32), i32>,
    ids: Option<Ids>,
}

/// Point ids by the numbers of the file.
enum Ids {
    /// 1, 2, 3 and so on.
    InOrder,
    /// `[number]` id, or the largest there is.
    Table(Vec<u32>),
    /// Number and id, in ascending order.
    Sorted(Vec<(u64, u32)>),
}

impl Ids {
    fn new(numbers: Vec<u64>, cursor: &Cursor) -> Result<Self> {
        if numbers.iter().zip(1..).all(|(number, wanted)| *number == wanted) {
            return Ok(Self::InOrder);
        }
        let twice = |number: u64| cursor.unexpected(format!("two points have the number {number}"), "each number once");
        let largest = numbers.iter().max().map_or(0, |largest| *largest);
        // a table costs four bytes a number; within four times the number of points it is no more than the list
        if largest / 4 <= numbers.len() as u64 {
            let mut table = vec![u32::MAX; largest as usize + 1];
            for (id, number) in numbers.into_iter().enumerate() {
                if std::mem::replace(&mut table[number as usize], id as u32) != u32::MAX {
                    return Err(twice(number));
                }
            }
            return Ok(Self::Table(table));
        }
        let mut sorted: Vec<(u64, u32)> = numbers.into_iter().zip(0..).collect();
        sorted.sort_unstable();
        match sorted.windows(2).find(|pair| pair[0].0 == pair[1].0) {
            Some(pair) => Err(twice(pair[0].0)),
            None => Ok(Self::Sorted(sorted)),
        }
    }

    fn of(&self, number: u64, count: usize) -> Option<u32> {
        match self {
            Self::InOrder => u32::try_from(number.checked_sub(1)?).ok().filter(|id| (*id as usize) < count),
            Self::Table(table) => table.get(usize::try_from(number).ok()?).copied().filter(|id| *id != u32::MAX),
            Self::Sorted(list) => list.binary_search_by_key(&number, |(number, _)| *number).ok().map(|at| list[at].1),
        }
    }
}

/// Reads a file.
///
/// # Errors
/// [`Refused`], with the location.
pub(super) fn read(cursor: &mut Cursor) -> Result<Mesh> {
    let mut read = Read::default();
    while let Some(name) = section(cursor)? {
        // what it holds; other sections are passed over
        match name {
            b"$MeshFormat" => format(cursor, &mut read)?,
            b"$PhysicalNames" => groups(cursor, &mut read.mesh)?,
            b"$Entities" if read.is_4 => in_data(cursor, &mut read, entities)?,
            b"$Nodes" if read.is_4 => in_data(cursor, &mut read, points_4)?,
            b"$Nodes" => in_data(cursor, &mut read, points_2)?,
            b"$Elements" if read.is_4 => in_data(cursor, &mut read, cells_4)?,
            b"$Elements" => in_data(cursor, &mut read, cells_2)?,
            PARTITIONED => {
                let found = "the mesh is partitioned; whole meshes are read".into();
                let mend = "export it with `Mesh.PartitionSplitMeshFiles = 0` before it is partitioned";
                return Err(Refused::Unsupported { at: cursor.location(), found, mend });
            }
            _ => {
                let end = [b"$End", &name[1..]].concat();
                let left = cursor.left();
                let found = left.windows(end.len()).position(|text| text == end);
                let Some(found) = found else {
                    cursor.go_to(usize::MAX);
                    return Err(Refused::End { at: cursor.location(), wanted: "the end of a section (`$End…`)" });
                };
                cursor.go_to(cursor.position() + found);
            }
        }
        // its end
        cursor.numbers = Numbers::Text;
        let end = cursor.text();
        if end.is_none_or(|end| end.strip_prefix(b"$End") != Some(&name[1..])) {
            return match end {
                Some(end) => {
                    Err(cursor.unexpected(quoted(end), "the end of the section (`$End…`), after what it announced"))
                }
                None => Err(Refused::End { at: cursor.location(), wanted: "the end of the section (`$End…`)" }),
            };
        }
    }
    if read.ids.is_none() {
        return Err(Refused::End { at: cursor.location(), wanted: "a section `$Nodes`" });
    }
    Ok(read.mesh)
}

/// Name of the next section.
fn section<'a>(cursor: &mut Cursor<'a>) -> Result<Option<&'a [u8]>> {
    match cursor.text() {
        Some(line) if line.starts_with(b"$") && line.len() > 1 => Ok(Some(line)),
        Some(line) => Err(cursor.unexpected(quoted(line), "the name of a section, `$Nodes` for instance")),
        None => Ok(None),
    }
}

fn format(cursor: &mut Cursor, read: &mut Read) -> Result<()> {
    cursor.row("the version of the format")?;
    let at = cursor.location();
    let version = cursor.word();
    read.is_4 = match version {
        b"2.2" | b"2.1" | b"2" | b"2.0" => false,
        b"4.1" => true,
        _ => {
            let found = format!("Gmsh's format {}; 2.2 and 4.1 are read", quoted(version));
            return Err(Refused::Unsupported { at, found, mend: "export the mesh with `gmsh -format msh41`" });
        }
    };
    let binary = cursor.whole(INT, "0 for text or 1 for binary")?;
    let size = cursor.whole(INT, "8, the bytes of a number")?;
    if size != 8 || binary > 1 {
        return Err(cursor.unexpected(format!("file type {binary}, data size {size}"), "type 0 or 1, size 8"));
    }
    cursor.line();
    read.numbers = Some(Numbers::Text);
    if binary == 1 {
        let one = cursor.take(4, "the number 1, which tells the order of bytes")?;
        read.numbers = match one {
            [1, 0, 0, 0] => Some(Numbers::Little),
            [0, 0, 0, 1] => Some(Numbers::Big),
            _ => {
                return Err(cursor.unexpected(format!("bytes {one:?}"), "the number 1, which tells the order of bytes"));
            }
        };
    }
    Ok(())
}

fn in_data(cursor: &mut Cursor, read: &mut Read, section: fn(&mut Cursor, &mut Read) -> Result<()>) -> Result<()> {
    let Some(numbers) = read.numbers else {
        return Err(cursor.unexpected("no `$MeshFormat` stands above", "`$MeshFormat` at the beginning of the file"));
    };
    cursor.numbers = numbers;
    section(cursor, read)?;
    if numbers == Numbers::Text {
        // what stands behind the last record is not of this section
        let rest = cursor.line().unwrap_or_default();
        if !rest.is_empty() {
            return Err(cursor.unexpected(quoted(rest), "the end of the line"));
        }
    }
    Ok(())
}

/// `$PhysicalNames`, which are text in binary files too.
fn groups(cursor: &mut Cursor, mesh: &mut Mesh) -> Result<()> {
    cursor.row("the number of groups")?;
    let count = cursor.count(INT, [6, 6], "names of physical groups")?;
    for _ in 0..count {
        cursor.row("a physical group")?;
        let dimension = cursor.whole(INT, "the dimension of a group, 0 to 3")?;
        let tag = cursor.int("the number of a group")?;
        let text = cursor.line().unwrap_or_default();
        let name = text.strip_prefix(b"\"").and_then(|text| text.strip_suffix(b"\""));
        let (Some(name), 0..=3) = (name, dimension) else {
            return Err(cursor.unexpected(quoted(text), "dimension, number and name in quotes of a group"));
        };
        let name = String::from_utf8_lossy(name).into_owned();
        mesh.groups.push(Group { dimension: dimension as u8, tag, name });
    }
    Ok(())
}

/// `$Entities` of 4.1: the physical groups of points, curves, surfaces and volumes.
fn entities(cursor: &mut Cursor, read: &mut Read) -> Result<()> {
    cursor.row("four numbers of entities")?;
    let mut counts = [0; 4];
    for count in &mut counts {
        *count = cursor.whole(SIZE, "the number of entities")?;
    }
    for (dimension, count) in counts.into_iter().enumerate() {
        let box_size = if dimension == 0 { 3 } else { 6 };
        let count = cursor.holds(count, if cursor.numbers == Numbers::Text { 9 } else { 36 }, "entities")?;
        for _ in 0..count {
            cursor.row("an entity")?;
            let tag = cursor.int("the number of an entity")?;
            for _ in 0..box_size {
                cursor.real(REAL, "the bounds of an entity")?;
            }
            let groups = cursor.count(SIZE, [2, 4], "physical groups of an entity")?;
            for k in 0..groups {
                // negative where the group has the entity the other way round
                let group = cursor.int("the number of a physical group")?;
                if k == 0 {
                    read.regions.insert((dimension as i32, tag), group.saturating_abs());
                }
            }
            if dimension > 0 {
                let bounds = cursor.count(SIZE, [2, 4], "bounds of an entity")?;
                for _ in 0..bounds {
                    cursor.int("the number of a bounding entity")?;
                }
            }
        }
    }
    Ok(())
}

fn no_second(cursor: &Cursor, read: &Read) -> Result<()> {
    match read.ids {
        Some(_) => Err(cursor.unexpected("a second section `$Nodes`", "one of them")),
        None => Ok(()),
    }
}

fn points_2(cursor: &mut Cursor, read: &mut Read) -> Result<()> {
    no_second(cursor, read)?;
    let count = announced(cursor, [8, 28], "points")?;
    let mut numbers = Vec::with_capacity(count);
    read.mesh.points.reserve(count);
    for _ in 0..count {
        cursor.row("a point")?;
        numbers.push(cursor.whole(INT, "the number of a point")?);
        read.mesh.points.push(cursor.point(REAL)?);
    }
    read.ids = Some(Ids::new(numbers, cursor)?);
    Ok(())
}

/// The count at the beginning of a section of 2.2, which is text in binary files too.
fn announced(cursor: &mut Cursor, bytes: [usize; 2], what: &'static str) -> Result<usize> {
    let numbers = std::mem::replace(&mut cursor.numbers, Numbers::Text);
    cursor.row(what)?;
    let at = cursor.location();
    let word = cursor.word();
    let found = digits(word).ok_or_else(|| cursor.unexpected(quoted(word), "the number of points or cells"))?;
    if numbers != Numbers::Text {
        cursor.line();
    }
    cursor.numbers = numbers;
    cursor.holds(found, bytes[usize::from(numbers != Numbers::Text)], what).map_err(|error| match error {
        Refused::Count { what, found, left, .. } => Refused::Count { at, what, found, left },
        error => error,
    })
}

fn points_4(cursor: &mut Cursor, read: &mut Read) -> Result<()> {
    no_second(cursor, read)?;
    cursor.row("the numbers of blocks and points")?;
    let blocks = cursor.count(SIZE, [8, 20], "blocks of points")?;
    let count = cursor.count(SIZE, [8, 32], "points")?;
    for _ in 0..2 {
        cursor.whole(SIZE, "the least and the largest number of a point")?;
    }
    let mut numbers = Vec::with_capacity(count);
    read.mesh.points.reserve(count);
    for _ in 0..blocks {
        cursor.row("a block of points")?;
        let dimension = cursor.int("the dimension of an entity")?;
        cursor.int("the number of an entity")?;
        let parametric = cursor.int("0, or 1 for points with parameters")?;
        let here = cursor.count(SIZE, [8, 32], "points of a block")?;
        for _ in 0..here {
            cursor.row("the number of a point")?;
            numbers.push(cursor.whole(SIZE, "the number of a point")?);
        }
        let parameters = if parametric == 0 { 0 } else { dimension.clamp(0, 3) };
        for _ in 0..here {
            cursor.row("a point")?;
            read.mesh.points.push(cursor.point(REAL)?);
            for _ in 0..parameters {
                cursor.real(REAL, "the parameters of a point")?;
            }
        }
    }
    if numbers.len() != count {
        let found = format!("{count} points are announced, and the blocks have {}", numbers.len());
        return Err(cursor.unexpected(found, "as many points as announced"));
    }
    read.ids = Some(Ids::new(numbers, cursor)?);
    Ok(())
}

/// Gmsh's number of a cell; refuses those of higher order.
fn shape(cursor: &mut Cursor) -> Result<(Cell, usize)> {
    let number = cursor.int("the type of a cell")?;
    Cell::of_gmsh(u64::try_from(number).unwrap_or(0)).ok_or_else(|| {
        let name = gmsh_name(u64::try_from(number).unwrap_or(0));
        let found = format!("a cell of type {number}, {name}; linear cells are read");
        Refused::Unsupported { at: cursor.location(), found, mend: "export the mesh with `gmsh -order 1`" }
    })
}

/// Nodes of a cell, into the mesh.
fn cell(cursor: &mut Cursor, read: &mut Read, shape: (Cell, usize), kind: Type, region: i32) -> Result<()> {
    let Some(ids) = &read.ids else {
        return Err(cursor.unexpected("cells stand above the points", "`$Nodes` above `$Elements`"));
    };
    let (count, mut nodes) = (read.mesh.points.len(), [0; 8]);
    for node in &mut nodes[..shape.1] {
        let found = cursor.whole(kind, "the number of a point of a cell")?;
        *node = ids.of(found, count).ok_or_else(|| Refused::Point {
            at: cursor.location(),
            found: found.to_string(),
            count,
        })?;
    }
    read.mesh.add(shape.0, &nodes[..shape.1], region);
    Ok(())
}

fn cells_2(cursor: &mut Cursor, read: &mut Read) -> Result<()> {
    let count = announced(cursor, [8, 8], "cells")?;
    let mut done = 0;
    while done < count {
        // binary cells of one shape and one number of tags stand together
        cursor.row("a cell")?;
        if cursor.numbers == Numbers::Text {
            cursor.whole(INT, "the number of a cell")?;
        }
        let shape = shape(cursor)?;
        let (here, tags) = match cursor.numbers {
            Numbers::Text => (1, cursor.count(INT, [2, 4], "tags of a cell")?),
            _ => {
                let here = cursor.count(INT, [4, 8], "cells of a block")?;
                (here, cursor.count(INT, [2, 4], "tags of a cell")?)
            }
        };
        if here == 0 || here > count - done {
            let found = format!("a block of {here} cells, where {} are left of those announced", count - done);
            return Err(cursor.unexpected(found, "as many cells as announced"));
        }
        for _ in 0..here {
            cursor.tell();
            if cursor.numbers != Numbers::Text {
                cursor.int("the number of a cell")?;
            }
            let mut region = 0;
            for k in 0..tags {
                let tag = cursor.int("a tag of a cell")?;
                region = if k == 0 { tag.saturating_abs() } else { region };
            }
            cell(cursor, read, shape, INT, region)?;
        }
        done += here;
    }
    Ok(())
}

fn cells_4(cursor: &mut Cursor, read: &mut Read) -> Result<()> {
    cursor.row("the numbers of blocks and cells")?;
    let blocks = cursor.count(SIZE, [8, 20], "blocks of cells")?;
    let count = cursor.count(SIZE, [4, 16], "cells")?;
    for _ in 0..2 {
        cursor.whole(SIZE, "the least and the largest number of a cell")?;
    }
    let mut done = 0;
    for _ in 0..blocks {
        cursor.row("a block of cells")?;
        let dimension = cursor.int("the dimension of an entity")?;
        let entity = cursor.int("the number of an entity")?;
        let shape = shape(cursor)?;
        let here = cursor.count(SIZE, [2 + 2 * shape.1, 8 + 8 * shape.1], "cells of a block")?;
        let region = read.regions.get(&(dimension, entity)).map_or(0, |region| *region);
        if shape.0 == Cell::Tetrahedron {
            read.mesh.tetrahedra.reserve(here);
            read.mesh.tetrahedron_regions.reserve(here);
        }
        for _ in 0..here {
            cursor.row("a cell")?;
            cursor.whole(SIZE, "the number of a cell")?;
            cell(cursor, read, shape, SIZE, region)?;
        }
        done += here;
    }
    if done != count {
        let found = format!("{count} cells are announced, and the blocks have {done}");
        return Err(cursor.unexpected(found, "as many cells as announced"));
    }
    Ok(())
}

/// Writes format 2.2: points from 1 in the mesh's order, then triangles, then tetrahedra.
pub(super) fn write(mesh: &Mesh, encoding: Encoding) -> Vec<u8> {
    let binary = encoding == Encoding::Binary;
    let mut out = format!("$MeshFormat\n2.2 {} 8\n", u8::from(binary)).into_bytes();
    if binary {
        out.extend(1i32.to_le_bytes());
        out.push(b'\n');
    }
    out.extend(b"$EndMeshFormat\n");
    if !mesh.groups.is_empty() {
        out.extend(format!("$PhysicalNames\n{}\n", mesh.groups.len()).into_bytes());
        for Group { dimension, tag, name } in &mesh.groups {
            out.extend(format!("{dimension} {tag} \"{name}\"\n").into_bytes());
        }
        out.extend(b"$EndPhysicalNames\n");
    }
    let mut text = format!("$Nodes\n{}\n", mesh.points.len());
    for (number, [x, y, z]) in mesh.points.iter().enumerate() {
        if binary {
            out.append(&mut std::mem::take(&mut text).into_bytes());
            out.extend((number as i32 + 1).to_le_bytes());
            out.extend([x, y, z].iter().flat_map(|c| c.to_le_bytes()));
        } else {
            writeln!(text, "{} {x:?} {y:?} {z:?}", number + 1).expect("a String takes any text");
        }
    }
    let newline = if binary { "\n" } else { "" };
    let count = mesh.triangles.len() + mesh.tetrahedra.len();
    write!(text, "{newline}$EndNodes\n$Elements\n{count}\n").expect("a String takes any text");
    out.append(&mut text.into_bytes());
    cells(&mut out, 2, &mesh.triangles, &mesh.triangle_regions, 0, binary);
    cells(&mut out, 4, &mesh.tetrahedra, &mesh.tetrahedron_regions, mesh.triangles.len(), binary);
    out.extend(newline.bytes());
    out.extend(b"$EndElements\n");
    out
}

/// Cells of Gmsh's `shape`, numbered behind `first`; tags are the region and, for the geometric entity, the region again, at least 1.
fn cells<const N: usize>(
    out: &mut Vec<u8>,
    shape: i32,
    cells: &[[u32; N]],
    regions: &[i32],
    first: usize,
    binary: bool,
) {
    if binary && !cells.is_empty() {
        out.extend([shape, cells.len() as i32, 2].iter().flat_map(|n| n.to_le_bytes()));
    }
    let mut text = String::new();
    for (k, (nodes, region)) in cells.iter().zip(regions).enumerate() {
        let (number, entity) = (first + k + 1, (*region).max(1));
        if binary {
            out.extend([number as i32, *region, entity].iter().flat_map(|n| n.to_le_bytes()));
            out.extend(nodes.iter().flat_map(|id| (id + 1).to_le_bytes()));
        } else {
            write!(text, "{number} {shape} 2 {region} {entity}").expect("a String takes any text");
            nodes.iter().for_each(|id| write!(text, " {}", id + 1).expect("a String takes any text"));
            text.push('\n');
        }
    }
    out.append(&mut text.into_bytes());
}
