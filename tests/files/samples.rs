//! Meshes for tests, and one small mesh in every form of every format.

use cutis::formats::{Cell, Group, Mesh};
use std::sync::LazyLock;

/// A block of n × n × n unit cubes of six tetrahedra each, its sides as triangles, in regions by height.
pub fn block(n: u32) -> Mesh {
    let mut mesh = Mesh::default();
    let id = |x: u32, y: u32, z: u32| (z * (n + 1) + y) * (n + 1) + x;
    for z in 0..=n {
        for y in 0..=n {
            for x in 0..=n {
                mesh.points.push([f64::from(x) * 0.1, f64::from(y) * 0.1, f64::from(z) / 3.0]);
            }
        }
    }
    let mut solid = mesh.clone();
    for z in 0..n {
        for y in 0..n {
            for x in 0..n {
                let corner = |k: [u32; 3]| id(x + k[0], y + k[1], z + k[2]);
                let nodes = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]];
                solid.add(Cell::Hexahedron, &nodes.map(corner), 1 + z as i32);
            }
        }
    }
    mesh.tetrahedra = solid.tetrahedra;
    mesh.tetrahedron_regions = solid.tetrahedron_regions;
    (mesh.triangles, mesh.triangle_regions) = mesh.boundary().into_iter().unzip();
    mesh.groups = vec![
        Group { dimension: 2, tag: 1, name: "side of the \"bottom\"".into() },
        Group { dimension: 3, tag: 1, name: "Dermis, ä".into() },
    ];
    mesh
}

/// Two tetrahedra on either side of a triangle, of 1/6 in volume each.
const POINTS: [[f64; 3]; 5] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]];
const TETS: [[u32; 4]; 2] = [[0, 1, 2, 3], [0, 2, 1, 4]];
/// Their outside.
const FACES: [[u32; 3]; 6] = [[0, 1, 3], [1, 2, 3], [2, 0, 3], [0, 4, 1], [1, 4, 2], [2, 4, 0]];

/// Numbers in binary, of either order.
struct Bytes {
    big: bool,
    out: Vec<u8>,
}

impl Bytes {
    fn text(&mut self, text: &str) -> &mut Self {
        self.out.extend(text.bytes());
        self
    }

    fn number<const N: usize>(&mut self, bytes: [u8; N]) {
        if self.big {
            self.out.extend(bytes.iter().rev());
        } else {
            self.out.extend(bytes);
        }
    }

    fn ints(&mut self, list: &[i32]) -> &mut Self {
        list.iter().for_each(|n| self.number(n.to_le_bytes()));
        self
    }

    fn sizes(&mut self, list: &[u64]) -> &mut Self {
        list.iter().for_each(|n| self.number(n.to_le_bytes()));
        self
    }

    fn reals(&mut self, list: &[f64]) -> &mut Self {
        list.iter().for_each(|n| self.number(n.to_le_bytes()));
        self
    }
}

fn msh2(big: bool) -> Vec<u8> {
    let mut b = Bytes { big, out: vec![] };
    b.text("$MeshFormat\n2.2 1 8\n").ints(&[1]).text("\n$EndMeshFormat\n$Nodes\n5\n");
    for (k, point) in POINTS.iter().enumerate() {
        // numbers with gaps
        b.ints(&[10 * k as i32 + 3]).reals(point);
    }
    b.text("\n$EndNodes\n$Elements\n3\n").ints(&[15, 1, 2, 1, 0, 1, 3]).ints(&[4, 2, 2]);
    for (k, nodes) in TETS.iter().enumerate() {
        b.ints(&[k as i32 + 2, 7, 1]).ints(&nodes.map(|id| 10 * id as i32 + 3));
    }
    b.text("\n$EndElements\n");
    b.out
}

fn msh4(big: bool) -> Vec<u8> {
    let mut b = Bytes { big, out: vec![] };
    b.text("$MeshFormat\n4.1 1 8\n")
        .ints(&[1])
        .text("\n$EndMeshFormat\n$PhysicalNames\n1\n3 7 \"der mis\"\n$EndPhysicalNames\n");
    b.text("$Entities\n").sizes(&[1, 0, 0, 1]).ints(&[5]).reals(&[0.0; 3]).sizes(&[0]);
    b.ints(&[9]).reals(&[0.0; 6]).sizes(&[1]).ints(&[7]).sizes(&[2]).ints(&[1, -2]).text("\n$EndEntities\n");
    b.text("$Nodes\n").sizes(&[2, 5, 1, 5]).ints(&[3, 9, 0]).sizes(&[4, 1, 2, 3, 4]);
    for point in &POINTS[..4] {
        b.reals(point);
    }
    // the last point has parameters on its curve
    b.ints(&[1, 1, 1]).sizes(&[1, 5]).reals(&POINTS[4]).reals(&[0.5]).text("\n$EndNodes\n");
    b.text("$Periodic\n").sizes(&[0]).text("\n$EndPeriodic\n");
    b.text("$Elements\n").sizes(&[1, 2, 1, 2]).ints(&[3, 9, 4]).sizes(&[2]);
    for (k, nodes) in TETS.iter().enumerate() {
        b.sizes(&[k as u64 + 1]).sizes(&nodes.map(|id| u64::from(id) + 1));
    }
    b.text("\n$EndElements\n");
    b.out
}

const MSH2: &str = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n3 7 \"der mis\"\n$EndPhysicalNames\n$Nodes\n5\n1 0 0 0\n2 1 0 0\n\
    3 0 1 0\n4 0 0 1\n5 0 0 -1\n$EndNodes\n$Elements\n3\n1 15 2 0 1 1\n2 4 2 7 1 1 2 3 4\n3 4 2 7 1 1 3 2 5\n$EndElements\n";
const MSH4: &str = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n3 7 \"der mis\"\n$EndPhysicalNames\n$Entities\n1 0 0 1\n\
    1 0 0 0 0 \n9 0 0 -1 1 1 1 1 7 2 1 -2 \n$EndEntities\n$Nodes\n1 5 1 5\n3 9 0 5\n1\n2\n3\n4\n5\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n0 0 -1\n\
    $EndNodes\n$Elements\n1 2 1 2\n3 9 4 2\n1 1 2 3 4 \n2 1 3 2 5 \n$EndElements\n$NodeData\nanything\n$EndNodeData\n";
const VTK4: &str = "# vtk DataFile Version 4.2\ntwo\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 5 double\n0 0 0 1 0 0\n0 1 0 0 0 1 0 0 -1\n\n\
    CELLS 2 10\n4 0 1 2 3\n4 0 2 1 4\n\nCELL_TYPES 2\n10\n10\n\nCELL_DATA 2\nSCALARS region int 1\nLOOKUP_TABLE default\n7 7\n\
    VECTORS v float\n1 2 3 4 5 6\nPOINT_DATA 5\nFIELD FieldData 1\nt 1 5 float\n1 2 3 4 5\n";
fn vtk51() -> Vec<u8> {
    let mut b = Bytes { big: true, out: vec![] };
    b.text("# vtk DataFile Version 5.1\ntwo\nBINARY\nDATASET UNSTRUCTURED_GRID\nPOINTS 5 double\n")
        .reals(POINTS.as_flattened());
    b.text("\nMETADATA\nINFORMATION 0\n\nCELLS 3 8\nOFFSETS vtktypeint64\n").sizes(&[0, 4, 8]);
    b.text("\nCONNECTIVITY vtktypeint64\n");
    b.sizes(&TETS.as_flattened().iter().map(|id| u64::from(*id)).collect::<Vec<_>>());
    b.text("\nCELL_TYPES 2\n")
        .ints(&[10, 10])
        .text("\nCELL_DATA 2\nFIELD FieldData 1\nregion 1 2 int\n")
        .ints(&[7, 7])
        .text("\n");
    b.out
}

fn poly() -> Vec<u8> {
    let mut b = Bytes { big: true, out: vec![] };
    b.text("# vtk DataFile Version 3.0\nfaces\nBINARY\nDATASET POLYDATA\nPOINTS 5 double\n")
        .reals(POINTS.as_flattened());
    b.text("\nLINES 1 3\n").ints(&[2, 0, 1]).text("\nPOLYGONS 6 24\n");
    for ids in &FACES {
        b.ints(&[3]).ints(&ids.map(|id| id as i32));
    }
    b.text("\n");
    b.out
}

/// A VTU with its arrays as `array` gives them: name, type, components, numbers as bytes, as text.
fn vtu(root: &str, end: &str, mut array: impl FnMut(&str, &str, usize, &[u8], &str) -> String) -> Vec<u8> {
    let reals = |list: &[f64]| list.iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<u8>>();
    let sizes = |list: &[i64]| list.iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<u8>>();
    let ids: Vec<i64> = TETS.as_flattened().iter().map(|id| i64::from(*id)).collect();
    let arrays = [
        array("region", "Int64", 1, &sizes(&[7, 7]), "7 7"),
        array("Points", "Float64", 3, &reals(POINTS.as_flattened()), "0 0 0 1 0 0 0 1 0 0 0 1 0 0 -1"),
        array("connectivity", "Int64", 1, &sizes(&ids), "0 1 2 3 0 2 1 4"),
        array("offsets", "Int64", 1, &sizes(&[4, 8]), "4 8"),
        array("types", "UInt8", 1, &[10, 10], "10 10"),
    ];
    let [region, points, connectivity, offsets, types] = arrays;
    format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" {root}>\n<UnstructuredGrid>\n\
         <Piece NumberOfPoints=\"5\" NumberOfCells=\"2\">\n<CellData>{region}</CellData>\n<Points>\n{points}</Points>\n<Cells>\n{connectivity}\n\
         {offsets}\n{types}\n</Cells>\n</Piece>\n</UnstructuredGrid>\n{end}"
    )
    .into_bytes()
}

fn tag(name: &str, kind: &str, components: usize, format: &str, inside: &str) -> String {
    format!(
        "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\" {format}>{inside}</DataArray>"
    )
}

fn base64(bytes: &[u8]) -> String {
    let digits: Vec<char> = ('A'..='Z').chain('a'..='z').chain('0'..='9').chain(['+', '/']).collect();
    let mut out = String::new();
    for part in bytes.chunks(3) {
        let bits = (0..3).fold(0usize, |bits, k| bits << 8 | part.get(k).map_or(0, |byte| usize::from(*byte)));
        let all = [18, 12, 6, 0].map(|shift| digits[bits >> shift & 63]);
        out.extend(&all[..=part.len()]);
        out.extend(&['=', '=', '='][..3 - part.len()]);
    }
    out
}

/// In blocks of 16 bytes, as VTK has them of 32,768: header and data of 32-bit lengths.
fn zlib(bytes: &[u8]) -> [Vec<u8>; 2] {
    let blocks: Vec<Vec<u8>> = bytes
        .chunks(16)
        .map(|block| {
            let mut out = flate2::write::ZlibEncoder::new(vec![], flate2::Compression::default());
            std::io::Write::write_all(&mut out, block).expect("memory takes it");
            out.finish().expect("memory takes it")
        })
        .collect();
    let lengths = blocks.iter().map(|block| block.len() as u32);
    let header = [blocks.len() as u32, 16, bytes.len() as u32 % 16].into_iter().chain(lengths);
    [header.flat_map(u32::to_le_bytes).collect(), blocks.concat()]
}

fn vtu_forms() -> Vec<(&'static str, Vec<u8>)> {
    let length = |bytes: &[u8]| [&(bytes.len() as u32).to_le_bytes()[..], bytes].concat();
    let text = vtu("", "</VTKFile>\n", |name, kind, n, _, text| tag(name, kind, n, "format=\"ascii\"", text));
    let inline = vtu("", "</VTKFile>\n", |name, kind, n, bytes, _| {
        tag(name, kind, n, "format=\"binary\"", &format!("\n {}\n", base64(&length(bytes))))
    });
    let packed = "header_type=\"UInt32\" compressor=\"vtkZLibDataCompressor\"";
    let compressed = vtu(packed, "</VTKFile>\n", |name, kind, n, bytes, _| {
        tag(name, kind, n, "format=\"binary\"", &zlib(bytes).map(|part| base64(&part)).concat())
    });
    let appended = |root: &str, encoding: &str, code: &dyn Fn(&[u8]) -> Vec<u8>| {
        let mut data = vec![];
        let mut out = vtu(root, "", |name, kind, n, bytes, _| {
            let offset = data.len();
            data.extend(code(bytes));
            tag(name, kind, n, &format!("format=\"appended\" offset=\"{offset}\""), "")
        });
        out.extend(format!("<AppendedData encoding=\"{encoding}\">\n_").bytes());
        out.extend(data);
        out.extend(b"\n</AppendedData>\n</VTKFile>\n");
        out
    };
    vec![
        ("region text.vtu", text),
        ("region base64.vtu", inline),
        ("region zlib.vtu", compressed),
        ("region raw.vtu", appended("", "raw", &length)),
        ("region raw zlib.vtu", appended(packed, "raw", &|bytes| zlib(bytes).concat())),
        ("region appended base64.vtu", appended("", "base64", &|bytes| base64(&length(bytes)).into_bytes())),
    ]
}

fn ply(format: &str, numbers: &Bytes) -> Vec<u8> {
    let mut out = format!(
        "ply\nformat {format} 1.0\ncomment two\nelement vertex 5\nproperty double x\nproperty double y\nproperty double z\n\
         property uchar red\nelement face 6\nproperty list uchar int vertex_indices\nend_header\n"
    )
    .into_bytes();
    out.extend(&numbers.out);
    out
}

fn ply_binary(big: bool) -> Bytes {
    let mut b = Bytes { big, out: vec![] };
    POINTS.iter().for_each(|point| b.reals(point).out.push(200));
    for ids in FACES {
        b.out.push(3);
        b.ints(&ids.map(|id| id as i32));
    }
    b
}

fn triangles() -> impl Iterator<Item = [[f64; 3]; 3]> {
    FACES.iter().map(|ids| ids.map(|id| POINTS[id as usize]))
}

/// Forms of files by a name that ends as a file's.
pub static FORMS: LazyLock<Vec<(&'static str, Vec<u8>)>> = LazyLock::new(|| {
    let mut text = Bytes { big: false, out: vec![] };
    for [x, y, z] in &POINTS {
        text.text(&format!("{x} {y} {z} 200\n"));
    }
    for [a, b, c] in &FACES {
        text.text(&format!("3 {a} {b} {c}\n"));
    }
    let mut stl = String::from("solid two\n");
    let mut binary = vec![b' '; 80];
    binary.extend(6u32.to_le_bytes());
    for corners in triangles() {
        stl += "  facet normal 0 0 0\n    outer loop\n";
        binary.extend([0; 12]);
        for [x, y, z] in corners {
            stl += &format!("      vertex {x} {y} {z}\n");
            binary.extend([x, y, z].iter().flat_map(|c| (*c as f32).to_le_bytes()));
        }
        stl += "    endloop\n  endfacet\n";
        binary.extend([0; 2]);
    }
    stl += "endsolid two\n";
    let obj: String = POINTS.iter().map(|[x, y, z]| format!("v {x} {y} {z}\n")).collect::<String>()
        + &FACES.iter().map(|ids| ids.map(|id| id + 1)).map(|[a, b, c]| format!("f {a} {b} {c}\n")).collect::<String>();
    let mut forms = vec![
        ("region named 2.2.msh", MSH2.as_bytes().to_vec()),
        ("region binary little 2.2.msh", msh2(false)),
        ("region binary big 2.2.msh", msh2(true)),
        ("region named 4.1.msh", MSH4.as_bytes().to_vec()),
        ("binary little 4.1.msh", msh4(false)),
        ("region named binary big 4.1.msh", msh4(true)),
        ("region 4.2.vtk", VTK4.as_bytes().to_vec()),
        ("region 5.1.vtk", vtk51()),
        ("binary 5.1.vtk", vtk51()),
        ("poly 3.0.vtk", poly()),
        ("text.ply", ply("ascii", &text)),
        ("little.ply", ply("binary_little_endian", &ply_binary(false))),
        ("big.ply", ply("binary_big_endian", &ply_binary(true))),
        ("text.stl", stl.into_bytes()),
        ("binary.stl", binary),
        ("faces.obj", obj.into_bytes()),
    ];
    forms.extend(vtu_forms());
    forms
});
