//! Mesh files: what is written reads back equal, every form of every format is read, and what is wrong is told with its place.

use crate::samples::{FORMS, block};
use cutis::formats::{Cell, Encoding, Format, Group, Mesh, lost, parse, write};
use cutis::math::random::Random;
use std::path::Path;

fn read(bytes: &[u8], name: &str) -> Result<Mesh, String> {
    let path = Path::new(name);
    let format = Format::of(path).map_err(|e| e.to_string())?;
    parse(bytes, format, path, &mut |_| {}).map_err(|e| e.to_string())
}

fn written(mesh: &Mesh, format: Format, encoding: Encoding) -> Vec<u8> {
    write(mesh, format, encoding, Path::new("a")).expect("it is written")
}

const ENCODINGS: [Encoding; 2] = [Encoding::Text, Encoding::Binary];

#[test]
fn msh_and_vtu_read_back_equal_bit_for_bit() {
    let mesh = block(3);
    for encoding in ENCODINGS {
        assert_eq!(read(&written(&mesh, Format::Msh, encoding), "a.msh"), Ok(mesh.clone()), "{encoding:?}");
        let no_names = Mesh { groups: vec![], ..mesh.clone() };
        assert_eq!(read(&written(&mesh, Format::Vtu, encoding), "a.vtu"), Ok(no_names), "{encoding:?}");
    }
    assert_eq!(lost(&mesh, Format::Vtu, Encoding::Text), ["names of physical groups"]);
    // numbers that decimal digits do badly
    let odd = [[0.1, 1.0 / 3.0, -0.0], [f64::MIN_POSITIVE, 5e-324, f64::MAX], [-1e300, 1e-300, 2e-7], [0.2; 3]];
    let mesh =
        Mesh { points: odd.into(), tetrahedra: vec![[0, 1, 2, 3]], tetrahedron_regions: vec![-7], ..Mesh::default() };
    let bits = |mesh: &Mesh| mesh.points.as_flattened().iter().map(|c| c.to_bits()).collect::<Vec<_>>();
    for (format, name) in [(Format::Vtu, "a.vtu"), (Format::Msh, "a.msh")] {
        for encoding in ENCODINGS {
            let back = read(&written(&mesh, format, encoding), name).expect("it reads back");
            assert_eq!(bits(&back), bits(&mesh), "{format:?} {encoding:?}");
        }
    }
}

#[test]
fn formats_of_triangles_read_back_equal() {
    let solid = block(2);
    let surface = Mesh { tetrahedra: vec![], tetrahedron_regions: vec![], groups: vec![], ..solid.clone() };
    // the sides of a block use all its points but the middle one
    let ply = read(&written(&surface, Format::Ply, Encoding::Binary), "a.ply").expect("it reads back");
    assert_eq!(ply.points.len(), surface.points.len() - 1);
    for encoding in ENCODINGS {
        assert_eq!(read(&written(&ply, Format::Ply, encoding), "a.ply"), Ok(ply.clone()), "{encoding:?}");
        let plain = Mesh { triangle_regions: vec![0; ply.triangles.len()], ..ply.clone() };
        assert_eq!(read(&written(&ply, Format::Obj, encoding), "a.obj"), Ok(plain.clone()));
        // STL has no order of points: the positions of the corners are compared
        let stl = read(&written(&ply, Format::Stl, encoding), "a.stl").expect("it reads back");
        let corners = |mesh: &Mesh, to: fn(f64) -> f64| {
            mesh.triangles.iter().map(|ids| ids.map(|id| mesh.points[id as usize].map(to))).collect::<Vec<_>>()
        };
        let narrow: fn(f64) -> f64 = if encoding == Encoding::Text { |c| c } else { |c| f64::from(c as f32) };
        assert_eq!(corners(&stl, |c| c), corners(&ply, narrow), "{encoding:?}");
        assert_eq!(stl.points.len(), ply.points.len(), "corners are welded");
        let again = read(&written(&stl, Format::Stl, encoding), "a.stl");
        assert_eq!(again, Ok(stl), "{encoding:?}");
    }
    // the boundary of a solid is closed and of the same positions as its sides
    let alone = Mesh { triangles: vec![], triangle_regions: vec![], ..solid.clone() };
    let skin = read(&written(&alone, Format::Ply, Encoding::Binary), "a.ply").expect("it reads back");
    assert_eq!(skin.triangles.len(), surface.triangles.len());
    assert!(lost(&solid, Format::Stl, Encoding::Text)[0].starts_with("tetrahedra"));
}

#[test]
fn every_form_of_a_file_gives_the_same_mesh() {
    for (name, bytes) in FORMS.iter() {
        let mesh = read(bytes, name).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(mesh.points.len(), 5, "{name}");
        let volume: f64 = mesh.tetrahedra.iter().map(|nodes| mesh.volume(nodes)).sum();
        let solid = [".msh", ".vtk", ".vtu"].iter().any(|ending| name.ends_with(ending)) && !name.contains("poly");
        assert_eq!(mesh.tetrahedra.len(), if solid { 2 } else { 0 }, "{name}");
        assert!(!solid || (volume - 1.0 / 3.0).abs() < 1e-12, "{name}: {volume}");
        assert!(solid || mesh.triangles.len() == 6, "{name}: {} triangles", mesh.triangles.len());
        if name.contains("region") {
            assert_eq!(mesh.tetrahedron_regions, [7, 7], "{name}");
        }
        if name.contains("named") {
            assert_eq!(mesh.groups, [Group { dimension: 3, tag: 7, name: "der mis".into() }], "{name}");
        }
    }
}

#[test]
fn solids_and_quadrilaterals_are_split_without_gaps() {
    // a box of 2 × 1 × 1: a hexahedron, and two wedges beside it that share its face
    let mut points = vec![];
    for z in 0..2 {
        for y in 0..2 {
            for x in 0..3 {
                points.push([f64::from(x), f64::from(y), f64::from(z)]);
            }
        }
    }
    // every numbering of the points: diagonals follow the numbers
    let mut random = Random::new(1);
    for _ in 0..200 {
        let mut order: Vec<u32> = (0..12).collect();
        for k in (1..12).rev() {
            order.swap(k, random.below(k as u64 + 1) as usize);
        }
        let mut mesh = Mesh { points: vec![[0.0; 3]; 12], ..Mesh::default() };
        (0..12).for_each(|k| mesh.points[order[k] as usize] = points[k]);
        let add = |mesh: &mut Mesh, cell, nodes: &[usize]| {
            mesh.add(cell, &nodes.iter().map(|k| order[*k]).collect::<Vec<_>>(), 3);
        };
        add(&mut mesh, Cell::Hexahedron, &[0, 1, 4, 3, 6, 7, 10, 9]);
        add(&mut mesh, Cell::Wedge, &[1, 2, 5, 7, 8, 11]);
        // VTK's order of a wedge, which is the mirror image of Gmsh's
        add(&mut mesh, Cell::Wedge, &[1, 4, 5, 7, 10, 11]);
        assert!(mesh.tetrahedra.iter().all(|nodes| mesh.volume(nodes) > 0.1), "all are positive");
        let volume: f64 = mesh.tetrahedra.iter().map(|nodes| mesh.volume(nodes)).sum();
        assert!((volume - 2.0).abs() < 1e-12, "{volume}");
        // two triangles for each square of the outside, so that no inner face is open
        assert_eq!(mesh.boundary().len(), 20);
        assert_eq!(mesh.others, [(Cell::Wedge, 2), (Cell::Hexahedron, 1)]);
    }
    // the counter-test: a tetrahedron that is missing leaves an inner face open
    let mut mesh = Mesh { points, ..Mesh::default() };
    mesh.add(Cell::Pyramid, &[0, 1, 4, 3, 6], 0);
    assert_eq!((mesh.boundary().len(), mesh.volume(&mesh.tetrahedra[0]) > 0.0), (6, true));
    mesh.tetrahedra.pop();
    assert_eq!(mesh.boundary().len(), 4);
}

#[test]
fn what_is_wrong_is_told_with_its_place() {
    let text = |form: &str| {
        let (_, bytes) = FORMS.iter().find(|(name, _)| *name == form).unwrap_or_else(|| panic!("no {form}"));
        String::from_utf8(bytes.clone()).expect("a text")
    };
    let msh2 = text("region named 2.2.msh");
    let msh4 = text("region named 4.1.msh");
    let vtk = text("region 4.2.vtk");
    let vtu = text("region text.vtu");
    let ply = text("text.ply");
    let stl = text("text.stl");
    let cases = [
        ("a.msh", String::new(), &["a.msh: the file is empty", "export"][..]),
        ("a.msh", stl.clone(), &["is named .msh, but begins like a .stl; rename it"]),
        ("a.mesh", msh2.clone(), &["a.mesh: no mesh format"]),
        ("a.msh", msh2.replace("2.2 0 8", "3.0 0 8"), &["a.msh:2: Gmsh's format `3.0`", "; export"]),
        ("a.msh", msh2.replace("2.2 0 8", "2.2 0 4"), &["a.msh:", "data size 4"]),
        (
            "a.msh",
            msh2.replace("2 1 0 0\n", "2 1 nan 0\n"),
            &["a.msh:11: a point at [1.0, NaN, 0.0]; wanted three finite"],
        ),
        ("a.msh", msh2.replace("2 1 0 0\n", "2 1 0\n"), &["a.msh:11: the line ends; wanted three coordinates"]),
        ("a.msh", msh2.replace("2 1 0 0\n", "2 1 0 0 9\n"), &["a.msh:11: `9`; wanted the end of the line"]),
        ("a.msh", msh2.replace("$Nodes\n5", "$Nodes\n1000000000000"), &["a.msh:9: 1000000000000 points are announced"]),
        ("a.msh", msh2.replace("$Elements\n3", "$Elements\n4"), &["a.msh:21: `$EndElements`; wanted"]),
        (
            "a.msh",
            msh2.replace(" 1 2 3 4\n", " 1 2 3 99\n"),
            &["a.msh:19: a cell names point 99, which is not among the 5"],
        ),
        (
            "a.msh",
            msh2.replace("2 4 2 7 1 1", "2 11 2 7 1 1"),
            &["a.msh:19: a cell of type 11, a 10-node tetrahedron", "; export"],
        ),
        ("a.msh", msh2[..msh2.len() - 20].to_string(), &["a.msh:20: the file ends where"]),
        ("a.msh", msh2.replace("\n5 0 0 -1", "\n4 0 0 -1"), &["two points have the number 4"]),
        ("a.msh", msh4.replace("1 5 1 5", "1 6 1 5"), &["6 points are announced, and the blocks have 5"]),
        ("a.vtk", vtk.replace("Version 4.2", "Version 6.0"), &["a.vtk:", "version `6.0` of the format", "; export"]),
        (
            "a.vtk",
            vtk.replace("UNSTRUCTURED_GRID", "STRUCTURED_POINTS"),
            &["a data set `STRUCTURED_POINTS`", "; export"],
        ),
        ("a.vtk", vtk.replace("POINTS 5", "POINTS 5000000000"), &["a.vtk:5: 5000000000 points are announced"]),
        ("a.vtk", vtk.replace("4 0 1 2 3", "4 0 1 2 5"), &["a.vtk:", "a cell names point 5"]),
        ("a.vtk", vtk.replace("\n10\n10", "\n24\n10"), &["cell 0 has type 24, of second order", "; export"]),
        ("a.vtu", vtu.replace("</Points>", ""), &["a.vtu:", "; wanted XML that is whole"]),
        (
            "a.vtu",
            vtu.replace("UnstructuredGrid\" ver", "PolyData\" ver"),
            &["a.vtu:2: a file of type `PolyData`", "; export"],
        ),
        ("a.vtu", vtu.replace("Points=\"5\"", "Points=\"6\""), &["an array of 15 coordinates, where 18 are announced"]),
        ("a.vtu", vtu.replace("0 0 -1", "0 0 inf"), &["a.vtu:7: point 4 at [0.0, 0.0, inf]"]),
        ("a.vtu", vtu.replace("0 1 2 3", "0 1 2 -3"), &["`-3`; wanted a whole number"]),
        ("a.ply", ply.replace("ascii 1.0", "ascii 2.0"), &["a.ply:2: `format ascii 2.0`; wanted"]),
        ("a.ply", ply.replace("vertex 5", "vertex 123456789"), &["123456789 elements are announced"]),
        ("a.ply", ply.replace("3 0 1 3", "3 0 1 5"), &["a cell names point 5"]),
        ("a.ply", ply.replace("double x", "double w"), &["vertices without x, y and z"]),
        ("a.stl", stl.replace("outer loop", "outer lop"), &["a.stl:3: `lop`; wanted `outer loop`"]),
        ("a.stl", stl[..stl.len() / 2].to_string(), &["a.stl:", "export the mesh again"]),
        ("a.obj", text("faces.obj").replace("v 0 0 1", "v 0 x 1"), &["a.obj:4: `v 0 x 1`; wanted `v` and three"]),
        ("a.obj", text("faces.obj").replace("f 1 2 4", "f 1 2 9"), &["`9` is no vertex; 5 `v` lines stand above"]),
        ("a.obj", "v 0 0 0\n".into(), &["a.obj: there is no tetrahedron and no face"]),
    ];
    for (name, text, words) in &cases {
        let error = read(text.as_bytes(), name).expect_err(name);
        assert!(words.iter().all(|word| error.contains(word)), "{name}: {error}\nwanted {words:?}");
    }
}

#[test]
fn binary_files_tell_the_byte() {
    let form = |form: &str| FORMS.iter().find(|(name, _)| *name == form).expect("it is there").1.clone();
    let stl = form("binary.stl");
    let error = read(&stl[..stl.len() - 1], "a.stl").unwrap_err();
    assert!(error.contains("a.stl, byte 84: 6 triangles are announced, but only 299 bytes follow"), "{error}");
    let mut huge = stl.clone();
    huge[80..84].fill(0xff);
    assert!(read(&huge, "a.stl").unwrap_err().contains("4294967295 triangles are announced"));
    let mut nan = stl.clone();
    nan[84 + 12..84 + 16].copy_from_slice(&f32::NAN.to_le_bytes());
    assert!(read(&nan, "a.stl").unwrap_err().contains("a.stl, byte 96: a point at [NaN"));
    for name in ["binary little 4.1.msh", "region binary big 2.2.msh", "binary 5.1.vtk", "big.ply"] {
        let bytes = form(name);
        for end in 1..bytes.len() {
            let error = match read(&bytes[..end], name) {
                // a file that lacks its last arrays, or blanks at its end, may be whole
                Ok(_) => continue,
                Err(error) => error,
            };
            assert!(error.contains("; ") && error.contains(name), "{error}");
        }
        assert!(read(&bytes[..bytes.len() / 2], name).is_err(), "{name}");
    }
}
