//! Legacy VTK files, 1.0 to 5.1, text and binary (which has the most significant byte first): unstructured grids and polygonal data.
//!
//! Arrays on points are passed over, those on cells are kept; fields and metadata are skipped.

use super::cursor::{Cursor, Numbers, Type};
use super::grid::{Array, Grid};
use super::{Mesh, Refused, Result, quoted};

/// VTK's number of each list of polygonal data.
const LISTS: [(&[u8], u8); 4] = [(b"VERTICES", 2), (b"LINES", 4), (b"POLYGONS", 7), (b"TRIANGLE_STRIPS", 6)];

/// Reads a file.
///
/// # Errors
/// [`Refused`], with the location.
pub(super) fn read(cursor: &mut Cursor) -> Result<Mesh> {
    let numbers = header(cursor)?;
    let mut grid = Grid::default();
    let mut types = None;
    cursor.free = true;
    let mut on_cells = false;
    let mut count = 0; // points or cells that the arrays below are on
    loop {
        cursor.numbers = Numbers::Text;
        let word = cursor.word().to_ascii_uppercase();
        match &word[..] {
            b"" => break,
            b"POINTS" => grid.points = points(cursor, numbers)?,
            b"CELLS" => cells(cursor, numbers, &mut grid, None)?,
            b"CELL_TYPES" => types = Some(cell_types(cursor, numbers)?),
            b"POINT_DATA" => (on_cells, count) = (false, data_count(cursor, grid.points.len())?),
            b"CELL_DATA" => (on_cells, count) = (true, data_count(cursor, grid.offsets.len())?),
            b"METADATA" => metadata(cursor),
            word => match LISTS.iter().find(|(name, _)| *name == word) {
                Some((_, number)) => cells(cursor, numbers, &mut grid, Some(*number))?,
                None => array(cursor, numbers, word, count, on_cells.then_some(&mut grid.cell_data))?,
            },
        }
    }
    if let Some(types) = types {
        grid.types = types;
    }
    if grid.types.len() != grid.offsets.len() {
        let found = format!("{} types for {} cells", grid.types.len(), grid.offsets.len());
        return Err(cursor.unexpected(found, "one type for each cell (`CELL_TYPES`)"));
    }
    grid.into_mesh(cursor.path())
}

/// The first four lines; how numbers stand.
fn header(cursor: &mut Cursor) -> Result<Numbers> {
    let first = cursor.line().unwrap_or_default();
    let version = first.strip_prefix(b"# vtk DataFile Version").map(<[u8]>::trim_ascii);
    let Some(version) = version else {
        return Err(cursor.unexpected(quoted(first), "`# vtk DataFile Version`, with which legacy VTK begins"));
    };
    if !version.first().is_some_and(|digit| (b'1'..=b'5').contains(digit)) {
        let found = format!("version {} of the format; 1.0 to 5.1 are read", quoted(version));
        return Err(Refused::Unsupported { at: cursor.location(), found, mend: "export the mesh as .vtu" });
    }
    cursor.line();
    let numbers = match cursor.line().unwrap_or_default() {
        b"ASCII" => Numbers::Text,
        b"BINARY" => Numbers::Big,
        other => return Err(cursor.unexpected(quoted(other), "`ASCII` or `BINARY`")),
    };
    let line = cursor.text().unwrap_or_default();
    match line.strip_prefix(b"DATASET").map(<[u8]>::trim_ascii) {
        Some(b"UNSTRUCTURED_GRID" | b"POLYDATA") => Ok(numbers),
        Some(other) => {
            let found = format!("a data set {}; UNSTRUCTURED_GRID and POLYDATA are read", quoted(other));
            let mend = "export the mesh as an unstructured grid (ParaView: Append Datasets)";
            Err(Refused::Unsupported { at: cursor.location(), found, mend })
        }
        None => Err(cursor.unexpected(quoted(line), "`DATASET UNSTRUCTURED_GRID`")),
    }
}

/// A count in text.
fn count(cursor: &mut Cursor, what: &'static str) -> Result<u64> {
    cursor.whole(Type::Unsigned(8), what)
}

/// The name of a type; goes to the data behind it.
fn data_type(cursor: &mut Cursor, numbers: Numbers) -> Result<Type> {
    let at = cursor.location();
    let word = cursor.word();
    let found = match &word.to_ascii_lowercase()[..] {
        b"float" => Type::Float(4),
        b"double" => Type::Float(8),
        b"char" | b"signed_char" => Type::Signed(1),
        b"unsigned_char" => Type::Unsigned(1),
        b"short" => Type::Signed(2),
        b"unsigned_short" => Type::Unsigned(2),
        b"int" => Type::Signed(4),
        b"unsigned_int" => Type::Unsigned(4),
        b"long" | b"vtkidtype" | b"vtktypeint64" => Type::Signed(8),
        b"unsigned_long" | b"vtktypeuint64" => Type::Unsigned(8),
        _ => {
            let found = format!(
                "numbers of type {}; float, double, char, short, int, long and vtktypeint64 are read",
                quoted(word)
            );
            return Err(Refused::Unsupported { at, found, mend: "export the mesh with one of these" });
        }
    };
    data(cursor, numbers);
    Ok(found)
}

/// Goes to the data behind a line.
fn data(cursor: &mut Cursor, numbers: Numbers) {
    cursor.numbers = numbers;
    if numbers != Numbers::Text {
        cursor.line();
    }
}

/// Bytes of a number at least.
fn least(numbers: Numbers, kind: Type) -> usize {
    if numbers == Numbers::Text { 2 } else { kind.bytes() }
}

fn points(cursor: &mut Cursor, numbers: Numbers) -> Result<Vec<[f64; 3]>> {
    let found = count(cursor, "the number of points")?;
    let kind = data_type(cursor, numbers)?;
    let count = cursor.holds(found, 3 * least(numbers, kind), "points")?;
    let mut points = Vec::with_capacity(count);
    for _ in 0..count {
        cursor.tell();
        points.push(cursor.point(kind)?);
    }
    Ok(points)
}

/// Point ids of cells: before version 5, each cell's count and ids; since, offsets and ids apart. `number` is the type of all of them.
fn cells(cursor: &mut Cursor, numbers: Numbers, grid: &mut Grid, number: Option<u8>) -> Result<()> {
    grid.at = Some(cursor.location());
    let (first, second) = (count(cursor, "the number of cells")?, count(cursor, "the number of ids")?);
    let before = cursor.position();
    let apart = cursor.word().eq_ignore_ascii_case(b"OFFSETS");
    let had = grid.connectivity.len() as u64;
    let cells = if apart {
        let kind = data_type(cursor, numbers)?;
        let count = cursor.holds(first, least(numbers, kind), "offsets of cells")?;
        for k in 0..count {
            cursor.tell();
            let offset = cursor.whole(kind, "the offset of a cell")?;
            // the first one is 0
            if k > 0 {
                grid.offsets.push(had.saturating_add(offset));
            }
        }
        cursor.numbers = Numbers::Text;
        let word = cursor.word();
        if !word.eq_ignore_ascii_case(b"CONNECTIVITY") {
            return Err(cursor.unexpected(quoted(word), "`CONNECTIVITY`, behind the offsets"));
        }
        let kind = data_type(cursor, numbers)?;
        let ids = cursor.holds(second, least(numbers, kind), "ids of cells")?;
        grid.connectivity.reserve(ids);
        for _ in 0..ids {
            cursor.tell();
            let id = id(cursor, kind)?;
            grid.connectivity.push(id);
        }
        count.saturating_sub(1)
    } else {
        cursor.go_to(before);
        data(cursor, numbers);
        let kind = Type::Signed(4);
        let size = cursor.holds(second, least(numbers, kind), "ids of cells")?;
        let count = cursor.holds(first, least(numbers, kind), "cells")?;
        grid.offsets.reserve(count);
        grid.connectivity.reserve(size.saturating_sub(count));
        for _ in 0..count {
            cursor.tell();
            let nodes = cursor.count(kind, [2, 4], "points of a cell")?;
            for _ in 0..nodes {
                let id = id(cursor, kind)?;
                grid.connectivity.push(id);
            }
            grid.offsets.push(grid.connectivity.len() as u64);
        }
        count
    };
    grid.types.extend(number.iter().flat_map(|number| std::iter::repeat_n(*number, cells)));
    Ok(())
}

fn id(cursor: &mut Cursor, kind: Type) -> Result<u32> {
    let found = cursor.whole(kind, "the number of a point of a cell")?;
    // one that is too large is none of the points, which are fewer
    Ok(u32::try_from(found).unwrap_or(u32::MAX))
}

fn cell_types(cursor: &mut Cursor, numbers: Numbers) -> Result<Vec<u8>> {
    let found = count(cursor, "the number of types")?;
    data(cursor, numbers);
    let kind = Type::Signed(4);
    let count = cursor.holds(found, least(numbers, kind), "types of cells")?;
    let mut types = Vec::with_capacity(count);
    for _ in 0..count {
        let number = cursor.whole(kind, "the type of a cell")?;
        // no shape has the number 255
        types.push(u8::try_from(number).unwrap_or(u8::MAX));
    }
    Ok(types)
}

fn data_count(cursor: &mut Cursor, wanted: usize) -> Result<usize> {
    let found = count(cursor, "the number of points or cells that arrays are on")?;
    match usize::try_from(found) {
        Ok(count) if count == wanted => Ok(count),
        _ => {
            Err(cursor
                .unexpected(format!("arrays on {found}, where there are {wanted}"), "arrays on all points or cells"))
        }
    }
}

/// Lines up to a blank one.
fn metadata(cursor: &mut Cursor) {
    cursor.line();
    while cursor.line().is_some_and(|line| !line.is_empty()) {}
}

/// An array on points or cells, or several; kept if there is a list for it.
fn array(
    cursor: &mut Cursor,
    numbers: Numbers,
    word: &[u8],
    count: usize,
    mut kept: Option<&mut Vec<Array>>,
) -> Result<()> {
    let components = |word: &[u8]| match word {
        b"VECTORS" | b"NORMALS" => Some(3),
        b"TENSORS" => Some(9),
        b"GLOBAL_IDS" | b"PEDIGREE_IDS" => Some(1),
        _ => None,
    };
    match word {
        // name, type, number of components, colour table
        b"SCALARS" => {
            let name = cursor.word();
            let kind = cursor.word();
            // the number of components may be left out
            let rest = cursor.line().unwrap_or_default();
            let components = if rest.is_empty() { Some(1) } else { super::cursor::digits(rest) };
            let Some(components) = components.filter(|count| (1..=9).contains(count)) else {
                return Err(cursor.unexpected(quoted(rest), "1 to 9 components of an array"));
            };
            let kind = data_type(&mut Cursor::new(kind, cursor.path(), &mut |_| {}), numbers)?;
            let before = cursor.position();
            match cursor.word().eq_ignore_ascii_case(b"LOOKUP_TABLE") {
                true => drop(cursor.line()),
                false => cursor.go_to(before),
            }
            cursor.numbers = numbers;
            values(cursor, name, kind, components as usize, count, &mut kept)
        }
        // colours, which nothing keeps
        b"COLOR_SCALARS" | b"LOOKUP_TABLE" => {
            let name = cursor.word();
            let second = self::count(cursor, "the number of colours or components")?;
            let (components, tuples) = match word {
                b"LOOKUP_TABLE" => (4, usize::try_from(second).unwrap_or(usize::MAX)),
                _ => (usize::try_from(second).unwrap_or(usize::MAX), count),
            };
            data(cursor, numbers);
            // bytes in binary files, shares of 1 in text
            values(cursor, name, Type::Unsigned(1), components, tuples, &mut None)
        }
        b"TEXTURE_COORDINATES" => {
            let name = cursor.word();
            let components = self::count(cursor, "the number of components")?;
            let kind = data_type(cursor, numbers)?;
            values(cursor, name, kind, usize::try_from(components).unwrap_or(usize::MAX), count, &mut None)
        }
        // several arrays, each with its size
        b"FIELD" => {
            cursor.word();
            let arrays = self::count(cursor, "the number of arrays of a field")?;
            let arrays = cursor.holds(arrays, 8, "arrays of a field")?;
            for _ in 0..arrays {
                cursor.numbers = Numbers::Text;
                let name = match cursor.word() {
                    word if word.eq_ignore_ascii_case(b"METADATA") => {
                        metadata(cursor);
                        cursor.word()
                    }
                    name => name,
                };
                let components = self::count(cursor, "the number of components of an array")?;
                let tuples = self::count(cursor, "the number of values of an array")?;
                let kind = data_type(cursor, numbers)?;
                let [components, tuples] = [components, tuples].map(|n| usize::try_from(n).unwrap_or(usize::MAX));
                // a field may stand outside of the data of points and cells
                let mut kept = kept.as_deref_mut().filter(|_| tuples == count);
                values(cursor, name, kind, components, tuples, &mut kept)?;
            }
            Ok(())
        }
        word => match components(word) {
            Some(components) => {
                let name = cursor.word();
                let kind = data_type(cursor, numbers)?;
                values(cursor, name, kind, components, count, &mut kept)
            }
            None => Err(cursor.unexpected(quoted(word), "a keyword of legacy VTK, `CELLS` for instance")),
        },
    }
}

/// Numbers of an array.
fn values(
    cursor: &mut Cursor,
    name: &[u8],
    kind: Type,
    components: usize,
    tuples: usize,
    kept: &mut Option<&mut Vec<Array>>,
) -> Result<()> {
    let numbers = cursor.numbers;
    let count = (components as u64).saturating_mul(tuples as u64);
    let count = cursor.holds(count, least(numbers, kind), "values of an array")?;
    if kept.is_none() && numbers != Numbers::Text {
        return cursor.take(count * kind.bytes(), "the values of an array").map(drop);
    }
    let mut values = Vec::with_capacity(if kept.is_some() { count } else { 0 });
    for _ in 0..count {
        cursor.tell();
        let value = cursor.real(kind, "a value of an array")?;
        if kept.is_some() {
            values.push(value);
        }
    }
    if let Some(kept) = kept {
        kept.push(Array { name: String::from_utf8_lossy(name).into_owned(), components, values });
    }
    Ok(())
}
