//! VTK XML unstructured grids: text, base64 within the XML, or data behind it (raw or base64), plain or compressed by zlib.
//!
//! A binary array is its length in bytes (32 or 64 bits, `header_type`) and its bytes; a compressed one has the number of blocks, the size of
//! a block, that of the last one (0 if it is whole), and the compressed size of each. Several pieces are joined.

use super::cursor::{Type, digits};
use super::grid::{Array, Grid};
use super::{At, Encoding, Refused, Result, quoted};
use flate2::read::ZlibDecoder;
use roxmltree::{Document, Node};
use std::borrow::Cow;
use std::fmt::Write as _;
use std::io::Read as _;
use std::path::Path;

/// zlib makes at most so many bytes of one; more are not believed.
const ZLIB_RATIO: u64 = 1032;

/// What the arrays of a file have in common.
struct File<'a> {
    path: &'a Path,
    document: &'a Document<'a>,
    /// The most significant byte of a number comes first.
    big: bool,
    /// Of the lengths before binary data.
    header: Type,
    compressed: bool,
    /// Data behind the XML, and whether it is base64.
    appended: Option<(&'a [u8], bool)>,
}

/// Reads a file with all its arrays.
///
/// # Errors
/// [`Refused`], with the line.
pub fn read(bytes: &[u8], path: &Path) -> Result<Grid> {
    // the XML, and what is appended to it, which may be no text
    let (xml, appended) = match find(bytes, b"<AppendedData") {
        None => (Cow::Borrowed(bytes), None),
        Some(at) => {
            let tag = bytes[at..].iter().position(|byte| *byte == b'>').map_or(bytes.len(), |end| at + end + 1);
            let data = bytes[tag..].iter().position(|byte| *byte == b'_').map_or(bytes.len(), |start| tag + start + 1);
            let closed = [&bytes[..tag], b"</AppendedData></VTKFile>"].concat();
            (Cow::Owned(closed), Some(&bytes[data..]))
        }
    };
    let text = std::str::from_utf8(&xml).map_err(|error| {
        let line = 1 + xml[..error.valid_up_to()].iter().filter(|byte| **byte == b'\n').count();
        let found = format!("the byte 0x{:02x}, which is not UTF-8", xml[error.valid_up_to()]);
        Refused::Unexpected { at: At::line(path, line), found, wanted: "XML in UTF-8" }
    })?;
    let document = Document::parse(text.trim_start_matches('\u{feff}')).map_err(|error| {
        let at = At::line(path, error.pos().row as usize);
        Refused::Unexpected { at, found: error.to_string(), wanted: "XML that is whole" }
    })?;
    let file = File::new(&document, path, appended)?;
    let root = document.root_element();
    let mut grid = Grid::default();
    let grids = children(root, "UnstructuredGrid");
    for piece in grids.flat_map(|grid| children(grid, "Piece")) {
        file.piece(piece, &mut grid)?;
    }
    Ok(grid)
}

fn find(bytes: &[u8], text: &[u8]) -> Option<usize> {
    let first = text[0];
    let mut at = 0;
    loop {
        at += bytes[at..].iter().position(|byte| *byte == first)?;
        if bytes[at..].starts_with(text) {
            return Some(at);
        }
        at += 1;
    }
}

fn children<'a>(node: Node<'a, 'a>, name: &'a str) -> impl Iterator<Item = Node<'a, 'a>> {
    node.children().filter(move |child| child.has_tag_name(name))
}

impl<'a> File<'a> {
    fn new(document: &'a Document<'a>, path: &'a Path, data: Option<&'a [u8]>) -> Result<Self> {
        let root = document.root_element();
        let line = |node: Node| At::line(path, document.text_pos_at(node.range().start).row as usize);
        let unsupported = |node, found: String, mend| Err(Refused::Unsupported { at: line(node), found, mend });
        if !root.has_tag_name("VTKFile") {
            let found = format!("an element `{}`", root.tag_name().name());
            return Err(Refused::Unexpected { at: line(root), found, wanted: "`VTKFile`" });
        }
        // the kind of file, and how its arrays are written
        let of_type = root.attribute("type").unwrap_or_default();
        if of_type != "UnstructuredGrid" {
            let found = format!("a file of type {}; UnstructuredGrid is read", quoted(of_type.as_bytes()));
            return unsupported(root, found, "export the mesh as an unstructured grid (ParaView: Append Datasets)");
        }
        let compressed = match root.attribute("compressor") {
            None | Some("") => false,
            Some("vtkZLibDataCompressor") => true,
            Some(other) => {
                let found = format!("data compressed by {}; zlib is read", quoted(other.as_bytes()));
                return unsupported(root, found, "export the mesh with zlib, or without compression");
            }
        };
        let header = match root.attribute("header_type") {
            None | Some("UInt32") => Type::Unsigned(4),
            Some("UInt64") => Type::Unsigned(8),
            Some(other) => {
                let found = format!("lengths of type {}; UInt32 and UInt64 are read", quoted(other.as_bytes()));
                return unsupported(root, found, "export the mesh with one of them");
            }
        };
        let big = match root.attribute("byte_order") {
            None | Some("LittleEndian") => false,
            Some("BigEndian") => true,
            Some(other) => {
                let found = format!("byte order {}", quoted(other.as_bytes()));
                return Err(Refused::Unexpected { at: line(root), found, wanted: "LittleEndian or BigEndian" });
            }
        };
        // arrays behind the elements
        let encoding = children(root, "AppendedData").next().map(|node| (node, node.attribute("encoding")));
        let appended = match (data, encoding) {
            (Some(data), Some((_, Some("raw")))) => Some((data, false)),
            (Some(data), Some((_, Some("base64") | None))) => Some((data, true)),
            (_, Some((node, Some(other)))) => {
                let found = format!("appended data of encoding {}; raw and base64 are read", quoted(other.as_bytes()));
                return unsupported(node, found, "export the mesh with one of them");
            }
            _ => None,
        };
        Ok(Self { path, document, big, header, compressed, appended })
    }

    fn at(&self, node: Node) -> At {
        At::line(self.path, self.document.text_pos_at(node.range().start).row as usize)
    }

    fn unexpected(&self, node: Node, found: impl Into<String>, wanted: &'static str) -> Refused {
        Refused::Unexpected { at: self.at(node), found: found.into(), wanted }
    }

    /// Adds a piece to the grid.
    fn piece(&self, piece: Node<'a, 'a>, grid: &mut Grid) -> Result<()> {
        let count = |name: &str| {
            let found = piece.attribute(name).and_then(|value| digits(value.trim().as_bytes()));
            found.ok_or_else(|| self.unexpected(piece, format!("a piece without a number `{name}`"), "that number"))
        };
        let (points, cells) = (count("NumberOfPoints")?, count("NumberOfCells")?);
        let first = grid.points.len() as u64;
        let had = grid.connectivity.len() as u64;
        // points
        let of_points = children(piece, "Points").flat_map(|node| children(node, "DataArray")).next();
        let values = match of_points {
            Some(node) => self.reals(node, points.saturating_mul(3), "coordinates")?,
            None if points == 0 => vec![],
            None => return Err(self.unexpected(piece, "a piece without `Points`", "them")),
        };
        if let Some(at) = values.iter().position(|value| !value.is_finite()) {
            let found = format!("point {} at {:?}", at / 3, &values[at / 3 * 3..][..3]);
            return Err(self.unexpected(of_points.unwrap_or(piece), found, "three finite numbers"));
        }
        grid.points.extend_from_slice(values.as_chunks::<3>().0);
        if grid.points.len() >= u32::MAX as usize {
            return Err(Refused::TooMany { path: self.path.to_path_buf(), count: grid.points.len() as u64 });
        }
        // cells
        let list = |name: &str, count: Option<u64>, take: &mut dyn FnMut(u64)| {
            let named = |node: &Node| node.attribute("Name") == Some(name);
            let mut arrays = children(piece, "Cells").flat_map(|node| children(node, "DataArray"));
            match arrays.find(named) {
                Some(node) => self.wholes(node, count, take).map(|()| Some(node)),
                None if cells == 0 => Ok(None),
                None => Err(self.unexpected(piece, format!("cells without an array `{name}`"), "it")),
            }
        };
        let mut last = 0;
        let at = list("offsets", Some(cells), &mut |end| {
            last = end;
            grid.offsets.push(had.saturating_add(end));
        })?;
        grid.at = grid.at.take().or(at.map(|node| self.at(node)));
        list("connectivity", Some(last), &mut |id| {
            // what is no id of this piece is made none of any
            let known = (id < points).then(|| u32::try_from(first + id).ok()).flatten();
            grid.connectivity.push(known.unwrap_or(u32::MAX));
        })?;
        list("types", Some(cells), &mut |number| grid.types.push(u8::try_from(number).unwrap_or(u8::MAX)))?;
        // arrays
        let (total_points, total_cells) = (grid.points.len() as u64, grid.types.len() as u64);
        self.arrays(piece, "PointData", points, total_points, &mut grid.point_data)?;
        self.arrays(piece, "CellData", cells, total_cells, &mut grid.cell_data)
    }

    /// Adds arrays on points or cells; those that a piece before does not have are left out.
    fn arrays(&self, piece: Node<'a, 'a>, name: &'a str, count: u64, total: u64, out: &mut Vec<Array>) -> Result<()> {
        for node in children(piece, name).flat_map(|node| children(node, "DataArray")) {
            let components = match node.attribute("NumberOfComponents").map(|text| digits(text.trim().as_bytes())) {
                None => 1,
                Some(Some(count @ 1..)) => count,
                _ => return Err(self.unexpected(node, "an array of no number of components", "1 or more")),
            };
            let name = node.attribute("Name").unwrap_or_default();
            if node.attribute("type") == Some("String") {
                continue;
            }
            let values = self.reals(node, count.saturating_mul(components), "values of an array")?;
            let components = usize::try_from(components).unwrap_or(usize::MAX);
            match out.iter_mut().find(|array| array.name == name && array.components == components) {
                Some(array) => array.values.extend(values),
                None => out.push(Array { name: name.into(), components, values }),
            }
        }
        let wanted = |array: &Array| (array.components as u64).saturating_mul(total);
        out.retain(|array| array.values.len() as u64 == wanted(array));
        Ok(())
    }

    /// Floats of an array of `count`.
    fn reals(&self, node: Node<'a, 'a>, count: u64, what: &'static str) -> Result<Vec<f64>> {
        let kind = self.kind(node)?;
        if node.attribute("format") == Some("ascii") {
            let mut out = vec![];
            for word in self.text(node).split_ascii_whitespace() {
                let value = word.parse().map_err(|_| self.unexpected(node, quoted(word.as_bytes()), "a number"))?;
                out.push(value);
            }
            self.counted(node, out.len() as u64, count, what)?;
            return Ok(out);
        }
        let bytes = self.bytes(node, kind, count, what)?;
        Ok(bytes.chunks_exact(kind.bytes()).map(|bytes| kind.real(bytes, self.big)).collect())
    }

    /// Whole numbers of an array, one by one.
    fn wholes(&self, node: Node<'a, 'a>, count: Option<u64>, take: &mut dyn FnMut(u64)) -> Result<()> {
        let kind = self.kind(node)?;
        let count = count.unwrap_or(0);
        if node.attribute("format") == Some("ascii") {
            let mut found = 0;
            for word in self.text(node).split_ascii_whitespace() {
                let value = digits(word.as_bytes());
                take(
                    value.ok_or_else(|| {
                        self.unexpected(node, quoted(word.as_bytes()), "a whole number, not negative")
                    })?,
                );
                found += 1;
            }
            return self.counted(node, found, count, "numbers of cells");
        }
        let bytes = self.bytes(node, kind, count, "numbers of cells")?;
        for bytes in bytes.chunks_exact(kind.bytes()) {
            let value = kind.whole(bytes, self.big);
            take(
                value
                    .ok_or_else(|| self.unexpected(node, "a number that is negative or not whole", "ids of points"))?,
            );
        }
        Ok(())
    }

    fn counted(&self, node: Node, found: u64, wanted: u64, what: &'static str) -> Result<()> {
        match found == wanted {
            true => Ok(()),
            false => {
                let found = format!("an array of {found} {what}, where {wanted} are announced");
                Err(self.unexpected(node, found, "as many as announced"))
            }
        }
    }

    fn kind(&self, node: Node) -> Result<Type> {
        let name = node.attribute("type").unwrap_or_default();
        Ok(match name {
            "Int8" => Type::Signed(1),
            "UInt8" => Type::Unsigned(1),
            "Int16" => Type::Signed(2),
            "UInt16" => Type::Unsigned(2),
            "Int32" => Type::Signed(4),
            "UInt32" => Type::Unsigned(4),
            "Int64" => Type::Signed(8),
            "UInt64" => Type::Unsigned(8),
            "Float32" => Type::Float(4),
            "Float64" => Type::Float(8),
            _ => {
                let found = format!("an array of type {}", quoted(name.as_bytes()));
                return Err(self.unexpected(node, found, "Int8 to UInt64, Float32 or Float64"));
            }
        })
    }

    fn text(&self, node: Node<'a, 'a>) -> &'a str {
        node.text().unwrap_or_default()
    }

    /// Bytes of a binary array of `count` numbers.
    fn bytes(&self, node: Node<'a, 'a>, kind: Type, count: u64, what: &'static str) -> Result<Cow<'a, [u8]>> {
        let short = |found: String| self.unexpected(node, found, "as many bytes as announced");
        let coded = match node.attribute("format") {
            Some("binary") => Some(self.text(node).as_bytes()),
            Some("appended") => {
                let offset = node.attribute("offset").and_then(|text| digits(text.trim().as_bytes()));
                let offset = offset.and_then(|offset| usize::try_from(offset).ok());
                let Some((data, is_base64)) = self.appended else {
                    return Err(self.unexpected(node, "appended data, of which there is none", "`AppendedData`"));
                };
                let Some(data) = offset.and_then(|offset| data.get(offset..)) else {
                    return Err(short(format!("an offset beyond the {} bytes that are appended", data.len())));
                };
                if !is_base64 {
                    return self.unpacked(node, Cow::Borrowed(data), kind, count, what);
                }
                Some(data)
            }
            _ => None,
        };
        let Some(coded) = coded else {
            let found =
                format!("an array of format {}", quoted(node.attribute("format").unwrap_or_default().as_bytes()));
            return Err(self.unexpected(node, found, "ascii, binary or appended"));
        };
        // of appended data, which goes on with other arrays, no more than one such array can take
        let needed = count.saturating_mul(kind.bytes() as u64).saturating_add(1 << 16);
        let most = usize::try_from(needed.saturating_mul(2)).unwrap_or(usize::MAX);
        let decoded =
            base64(coded, most).map_err(|byte| short(format!("the byte 0x{byte:02x}, which is no digit of base64")))?;
        self.unpacked(node, Cow::Owned(decoded), kind, count, what)
    }

    /// Data behind its header, decompressed.
    fn unpacked(
        &self,
        node: Node,
        data: Cow<'a, [u8]>,
        kind: Type,
        count: u64,
        what: &'static str,
    ) -> Result<Cow<'a, [u8]>> {
        let size = self.header.bytes();
        let number = |k: usize| data.get(k * size..(k + 1) * size).and_then(|bytes| self.header.whole(bytes, self.big));
        let cut = || self.unexpected(node, format!("an array of {} bytes, cut off", data.len()), "its whole length");
        let wanted = count.saturating_mul(kind.bytes() as u64);
        let first = number(0);
        if !self.compressed {
            // VTK writes nothing at all for an array of nothing
            let length = if data.is_empty() && wanted == 0 { 0 } else { first.ok_or_else(cut)? };
            self.counted(node, length / kind.bytes() as u64, count, what)?;
            let end = usize::try_from(length).ok().and_then(|length| size.checked_add(length));
            if wanted == 0 {
                return Ok(Cow::Borrowed(&[]));
            }
            let range = size..end.filter(|end| *end <= data.len()).ok_or_else(cut)?;
            return Ok(match data {
                Cow::Borrowed(bytes) => Cow::Borrowed(&bytes[range]),
                Cow::Owned(mut bytes) => {
                    bytes.truncate(range.end);
                    bytes.drain(..size);
                    Cow::Owned(bytes)
                }
            });
        }
        let blocks = if data.is_empty() && wanted == 0 { 0 } else { first.ok_or_else(cut)? };
        if blocks == 0 {
            return self.counted(node, 0, count, what).map(|()| Cow::Borrowed(&[][..]));
        }
        let (block, last) = (number(1).ok_or_else(cut)?, number(2).ok_or_else(cut)?);
        let last = if last == 0 { block } else { last };
        let total = (blocks - 1).checked_mul(block).and_then(|sum| sum.checked_add(last)).ok_or_else(cut)?;
        self.counted(node, total / kind.bytes() as u64, count, what)?;
        if blocks > data.len() as u64 / size as u64 || total / ZLIB_RATIO > data.len() as u64 {
            return Err(cut());
        }
        let mut at = (3 + blocks as usize) * size;
        let mut out = vec![];
        for k in 0..blocks as usize {
            let length = number(3 + k).and_then(|length| usize::try_from(length).ok()).ok_or_else(cut)?;
            let packed = at.checked_add(length).and_then(|end| data.get(at..end)).ok_or_else(cut)?;
            at += length;
            let wanted = if k + 1 == blocks as usize { last } else { block };
            let before = out.len() as u64;
            let read = ZlibDecoder::new(packed).take(wanted + 1).read_to_end(&mut out);
            if read.is_err() || out.len() as u64 - before != wanted {
                let found = format!("block {k} of {blocks}, which zlib does not take for {wanted} bytes");
                return Err(self.unexpected(node, found, "data as compressed"));
            }
        }
        Ok(Cow::Owned(out))
    }
}

/// Bytes of base64, up to what is none, at most about `most`; padding may stand between parts. An error is a byte in its place.
fn base64(text: &[u8], most: usize) -> std::result::Result<Vec<u8>, u8> {
    let mut out = Vec::with_capacity((text.len() / 4 * 3 + 3).min(most));
    let (mut bits, mut count) = (0u32, 0);
    for byte in text {
        let digit = match byte {
            b'A'..=b'Z' => byte - b'A',
            b'a'..=b'z' => byte - b'a' + 26,
            b'0'..=b'9' => byte - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            b'=' => {
                // two or three digits stand for one or two bytes
                if count > 1 {
                    out.extend(&(bits << (6 * (4 - count))).to_be_bytes()[1..count]);
                }
                (bits, count) = (0, 0);
                continue;
            }
            b'<' => break,
            byte if byte.is_ascii_whitespace() => continue,
            byte => return Err(*byte),
        };
        (bits, count) = (bits << 6 | u32::from(digit), count + 1);
        if count == 4 {
            out.extend(&bits.to_be_bytes()[1..]);
            (bits, count) = (0, 0);
            if out.len() >= most {
                break;
            }
        }
    }
    Ok(out)
}

/// Appends bytes as base64.
fn to_base64(bytes: &[u8], out: &mut String) {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    out.reserve(bytes.len().div_ceil(3) * 4);
    for part in bytes.chunks(3) {
        let bits = part.iter().fold(0u32, |bits, byte| bits << 8 | u32::from(*byte)) << (8 * (3 - part.len()));
        for k in 0..4 {
            let digit = DIGITS[(bits >> (18 - 6 * k) & 63) as usize];
            out.push(if k <= part.len() { char::from(digit) } else { '=' });
        }
    }
}

/// Bytes of a file with all arrays of a grid, base64 or text; numbers of arrays are Float64, ids Int64.
///
/// # Panics
/// If the sizes of arrays do not fit the numbers of points and cells.
pub fn write(grid: &Grid, encoding: Encoding) -> Vec<u8> {
    let (points, cells) = (grid.points.len(), grid.types.len());
    assert_eq!(grid.offsets.len(), cells, "an offset for each cell");
    let mut out = String::from(
        "<?xml version=\"1.0\"?>\n\
         <VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n  \
         <UnstructuredGrid>\n",
    );
    writeln!(out, "    <Piece NumberOfPoints=\"{points}\" NumberOfCells=\"{cells}\">")
        .expect("a String takes any text");
    for (name, arrays, count) in [("PointData", &grid.point_data, points), ("CellData", &grid.cell_data, cells)] {
        writeln!(out, "      <{name}>").expect("a String takes any text");
        for Array { name, components, values } in arrays {
            assert_eq!(values.len(), count * components, "values of {name}");
            array(&mut out, name, *components, values, encoding);
        }
        writeln!(out, "      </{name}>").expect("a String takes any text");
    }
    out.push_str("      <Points>\n");
    array(&mut out, "Points", 3, grid.points.as_flattened(), encoding);
    out.push_str("      </Points>\n      <Cells>\n");
    let ids: Vec<i64> = grid.connectivity.iter().map(|id| i64::from(*id)).collect();
    array(&mut out, "connectivity", 1, &ids, encoding);
    let ends: Vec<i64> = grid.offsets.iter().map(|end| *end as i64).collect();
    array(&mut out, "offsets", 1, &ends, encoding);
    array(&mut out, "types", 1, &grid.types, encoding);
    out.push_str("      </Cells>\n    </Piece>\n  </UnstructuredGrid>\n</VTKFile>\n");
    out.into_bytes()
}

/// Numbers that arrays are written of.
trait Number: Copy + std::fmt::Debug {
    const NAME: &'static str;
    fn little(self, out: &mut Vec<u8>);
}

impl Number for f64 {
    const NAME: &'static str = "Float64";
    fn little(self, out: &mut Vec<u8>) {
        out.extend(self.to_le_bytes());
    }
}

impl Number for i64 {
    const NAME: &'static str = "Int64";
    fn little(self, out: &mut Vec<u8>) {
        out.extend(self.to_le_bytes());
    }
}

impl Number for u8 {
    const NAME: &'static str = "UInt8";
    fn little(self, out: &mut Vec<u8>) {
        out.push(self);
    }
}

fn array<T: Number>(out: &mut String, name: &str, components: usize, values: &[T], encoding: Encoding) {
    let format = if encoding == Encoding::Binary { "binary" } else { "ascii" };
    let (kind, name) = (T::NAME, escaped(name));
    // left out where it is 1: some readers take it for a dimension of its own
    let components_of = if components == 1 { String::new() } else { format!(" NumberOfComponents=\"{components}\"") };
    write!(out, "        <DataArray type=\"{kind}\" Name=\"{name}\"{components_of} format=\"{format}\">")
        .expect("a String takes any text");
    match encoding {
        Encoding::Binary => {
            let length = std::mem::size_of_val(values);
            let mut bytes = Vec::with_capacity(8 + length);
            bytes.extend((length as u64).to_le_bytes());
            values.iter().for_each(|value| value.little(&mut bytes));
            to_base64(&bytes, out);
        }
        Encoding::Text => {
            for row in values.chunks(components.max(1)) {
                out.push('\n');
                row.iter().for_each(|value| write!(out, " {value:?}").expect("a String takes any text"));
            }
            out.push('\n');
        }
    }
    out.push_str("</DataArray>\n");
}

/// Text for an attribute.
pub(crate) fn escaped(text: &str) -> String {
    let text = text.replace('&', "&amp;").replace('<', "&lt;");
    text.replace('>', "&gt;").replace('"', "&quot;")
}
