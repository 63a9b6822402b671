//! `cutis mesh`: what it says of a mesh, its defects, conversion, picture; and the same files by meshio.

use crate::work::{ALONE, Work};
use crate::{Outcome, Test, ensure};
use serde_json::Value;
use std::process::Command;

pub const TESTS: &[Test] = &[
    ("a_tetrahedron_has_its_volume_and_angles", a_tetrahedron_has_its_volume_and_angles),
    ("every_defect_is_told_and_mended", every_defect_is_told_and_mended),
    ("meshes_convert_by_ending", meshes_convert_by_ending),
    ("a_mesh_is_drawn", a_mesh_is_drawn),
    ("meshes_of_results_are_examined", meshes_of_results_are_examined),
    ("bad_meshes_are_exit_2_with_their_place", bad_meshes_are_exit_2_with_their_place),
];

/// Needs python3 with meshio.
pub const MESHIO_TESTS: &[Test] = &[("meshio_agrees", meshio_agrees)];

/// Whether this machine's python3 has meshio; `CUTIS_PYTHON` names another one.
pub fn has_meshio() -> bool {
    Command::new(python()).args(["-c", "import meshio, numpy"]).output().is_ok_and(|ran| ran.status.success())
}

pub fn python() -> String {
    std::env::var("CUTIS_PYTHON").unwrap_or_else(|_| "python3".into())
}

/// A regular tetrahedron of edge √2·2 within a cube.
const REGULAR: &str = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n1 1 1 1\n2 -1 1 -1\n3 1 -1 -1\n4 -1 -1 1\n$EndNodes\n\
    $Elements\n1\n1 4 2 7 1 1 2 3 4\n$EndElements\n";

fn number(report: &Value, key: &str) -> f64 {
    report.pointer(key).and_then(Value::as_f64).unwrap_or(f64::NAN)
}

fn a_tetrahedron_has_its_volume_and_angles() -> Outcome {
    let work = Work::with(ALONE)?;
    work.write("one.msh", REGULAR)?;
    let found = work.json(&["mesh", "one.msh", "--json"], 0)?;
    let edge = 8f64.sqrt();
    let volume = edge.powi(3) / (6.0 * 2f64.sqrt());
    let area = 3f64.sqrt() * edge * edge;
    let angle = (1f64 / 3.0).acos().to_degrees();
    for (key, wanted) in [
        ("/volume", volume),
        ("/area", area),
        ("/quality/aspect_max", 1.0),
        ("/quality/angle_min", angle),
        ("/quality/angle_max", angle),
        ("/quality/angles/7", 6.0),
        ("/boundary/edges", 6.0),
        ("/regions/0/tag", 7.0),
        ("/low/2", -1.0),
    ] {
        ensure!((number(&found, key) - wanted).abs() < 1e-12 * wanted.abs(), "{key} is not {wanted}: {found}");
    }
    ensure!(found["boundary"]["closed"] == true && found["defects"] == Value::Array(vec![]), "{found}");
    let said = work.cutis(&["mesh", "one.msh"])?;
    for words in ["4 points, 1 tetrahedra", "region 7: 1 tetrahedra", "closed", "no defects", "70° to  80°"] {
        ensure!(said.out.contains(words), "no `{words}` in {}", said.out);
    }
    Ok(())
}

/// Cells of format 2.2 on points.
fn msh(points: &[[f64; 3]], cells: &[&str]) -> String {
    let mut text = format!("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{}\n", points.len());
    points.iter().enumerate().for_each(|(k, [x, y, z])| text += &format!("{} {x} {y} {z}\n", k + 1));
    text += &format!("$EndNodes\n$Elements\n{}\n", cells.len());
    cells.iter().enumerate().for_each(|(k, cell)| text += &format!("{} {cell}\n", k + 1));
    text + "$EndElements\n"
}

fn every_defect_is_told_and_mended() -> Outcome {
    let work = Work::with(ALONE)?;
    // point 6 is point 1 again but for rounding, 7 and 8 are above it, 9 is unused; around the face 1 2 3 there are three tetrahedra
    let points = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
        [0.0, 0.0, -1.0],
        [0.0, 0.0, -3e-7],
        [0.5, 0.5, 0.0],
        [0.0, 0.0, 2.0],
        [9.0, 9.0, 9.0],
    ];
    let cells = [
        "4 0 1 2 3 4",
        "4 0 1 2 3 5", // inverted
        "4 0 2 3 6 8", // on a point of the same position
        "4 0 4 3 2 1", // the first one again
        "4 0 1 2 3 7", // flat
        "2 0 1 2 3",
        "2 0 3 1 2", // again
        "2 0 1 2 2", // no area
    ];
    work.write("bad.msh", &msh(&points, &cells))?;
    let found = work.json(&["mesh", "bad.msh", "--json"], 0)?;
    let defects = |report: &Value| -> Vec<(String, u64)> {
        let one = |d: &Value| (d["name"].as_str().unwrap_or_default().to_string(), d["count"].as_u64().unwrap_or(0));
        report["defects"].as_array().into_iter().flatten().map(one).collect()
    };
    let list = defects(&found);
    for (name, count) in [
        ("unused points", 1),
        ("points at the position of another", 1),
        ("inverted tetrahedra", 1),
        ("degenerate tetrahedra", 1),
        ("repeated tetrahedra", 1),
        ("repeated triangles", 1),
        ("degenerate triangles", 1),
        ("faces of more than two tetrahedra", 1),
    ] {
        ensure!(list.contains(&(name.into(), count)), "no {count} {name} in {list:?}");
    }
    let said = work.cutis(&["mesh", "bad.msh"])?;
    ensure!(said.out.contains("inverted tetrahedra: 1, the first tetrahedron 1: "), "{}", said.out);
    // mended: what remains overlaps, which is not for a program to mend
    let mended = work.json(&["mesh", "bad.msh", "--mend", "--out", "good.msh", "--json"], 0)?;
    let again = work.json(&["mesh", "good.msh", "--json"], 0)?;
    ensure!(mended == again, "{mended} and {again}");
    ensure!(again["points"] == 6 && again["tetrahedra"] == 3 && again["triangles"] == 1, "{again}");
    let gone = ["unused", "position", "inverted", "degenerate", "repeated"];
    let left = defects(&again);
    ensure!(left.iter().all(|(name, _)| gone.iter().all(|word| !name.contains(word))), "{left:?}");
    // a point farther away is another one
    work.write("apart.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1e-5 0 0\nv 1 1 0\nf 1 2 3\nf 4 2 5\n")?;
    let apart = work.json(&["mesh", "apart.obj", "--json"], 0)?;
    ensure!(defects(&apart).iter().all(|(name, _)| !name.contains("position")), "{apart}");
    // an open surface, and one of two orientations
    work.write("open.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 3 4\n")?;
    let open = work.json(&["mesh", "open.obj", "--json"], 0)?;
    let list = defects(&open);
    for (name, count) in [("open edges of the surface", 4), ("edges between triangles of opposite orientation", 1)] {
        ensure!(list.contains(&(name.into(), count)), "no {count} {name} in {list:?}");
    }
    ensure!(open["boundary"]["closed"] == false, "{open}");
    Ok(())
}

fn meshes_convert_by_ending() -> Outcome {
    let work = Work::with(ALONE)?;
    work.write("one.msh", REGULAR)?;
    let first = work.json(&["mesh", "one.msh", "--json"], 0)?;
    for name in ["a.msh", "a.vtu", "a.ply", "a.stl", "a.obj"] {
        for text in [&[][..], &["--text"]] {
            let said = work.cutis(&[&["mesh", "one.msh", "--out", name], text].concat())?;
            ensure!(said.code == 0, "{name}: {}", said.err);
            let is_solid = matches!(name, "a.msh" | "a.vtu");
            ensure!(said.err.contains("does not keep tetrahedra") != is_solid, "{name}: {}", said.err);
            let back = work.json(&["mesh", name, "--json"], 0)?;
            ensure!((number(&back, "/volume") - number(&first, "/volume")).abs() < 1e-12, "{name}: {back}");
            ensure!(!is_solid || back["tetrahedra"] == 1, "{name}: {back}");
            ensure!(is_solid || back["triangles"] == 4, "{name}: {back}");
        }
    }
    for (name, words) in [("a.vtk", "legacy VTK is read, but not written; name"), ("a.step", "no mesh format")] {
        let said = work.cutis(&["mesh", "one.msh", "--out", name])?;
        ensure!(said.code == 2 && said.err.contains(words), "{}: {}", said.code, said.err);
    }
    Ok(())
}

fn a_mesh_is_drawn() -> Outcome {
    let work = Work::with(ALONE)?;
    work.write("one.msh", REGULAR)?;
    let said = work.cutis(&["mesh", "one.msh", "--png", "one.png"])?;
    ensure!(said.code == 0, "{}", said.err);
    let file = std::fs::File::open(work.path("one.png")).map_err(|e| e.to_string())?;
    let mut reader = png::Decoder::new(std::io::BufReader::new(file)).read_info().map_err(|e| e.to_string())?;
    let mut pixels = vec![0; reader.output_buffer_size().ok_or("too large")?];
    reader.next_frame(&mut pixels).map_err(|e| e.to_string())?;
    // the mesh is reddish, the background is not; it takes a good part of the middle, and does not touch the sides
    let (width, height) = (reader.info().width as usize, reader.info().height as usize);
    let red = |x: usize, y: usize| {
        let pixel = &pixels[3 * (y * width + x)..][..3];
        pixel[0] > pixel[2].saturating_add(12)
    };
    let count = (0..width * height).filter(|k| red(k % width, k / width)).count();
    ensure!(count * 20 > width * height, "{count} pixels of the mesh");
    ensure!((0..height).all(|y| !red(0, y) && !red(width - 1, y)), "the mesh touches the sides");
    Ok(())
}

fn meshes_of_results_are_examined() -> Outcome {
    let work = Work::with(ALONE)?;
    let said = work.cutis(&["run", "scene.toml", "--backend", "cpu"])?;
    ensure!(said.code == 0, "{}", said.err);
    let found = work.json(&["mesh", "out/vtu/volume_0001.vtu", "--json"], 0)?;
    // 8 × 8 × 2 mm under gravity
    ensure!((number(&found, "/volume") - 128e-9).abs() < 1e-9, "{found}");
    ensure!(found["tetrahedra"] == 6 * 32 && found["others"][0][0] == "hexahedron", "{found}");
    ensure!(found["defects"] == Value::Array(vec![]) && found["boundary"]["closed"] == true, "{found}");
    Ok(())
}

fn bad_meshes_are_exit_2_with_their_place() -> Outcome {
    let work = Work::with(ALONE)?;
    work.write("nan.msh", &REGULAR.replace("2 -1 1 -1", "2 -1 nan -1"))?;
    work.write("cut.msh", &REGULAR[..REGULAR.len() - 20])?;
    work.write("empty.vtu", "")?;
    std::fs::create_dir(work.path("folder.stl")).map_err(|e| e.to_string())?;
    for (name, words) in [
        ("nan.msh", "nan.msh:7: a point at [-1.0, NaN, -1.0]; wanted three finite numbers; mend it"),
        ("cut.msh", "the file ends where"),
        ("empty.vtu", "empty.vtu: the file is empty; export the mesh again"),
        ("folder.stl", "folder.stl: the mesh cannot be read (it is a folder"),
        ("none.ply", "none.ply: the mesh cannot be read"),
        ("scene.toml", "scene.toml: no mesh format that is known here has this ending; name the file .msh"),
    ] {
        let said = work.cutis(&["mesh", name])?;
        ensure!(
            said.code == 2 && said.err.contains(words) && said.out.is_empty(),
            "{name}: {} {}",
            said.code,
            said.err
        );
    }
    Ok(())
}

fn meshio_agrees() -> Outcome {
    let work = Work::with(ALONE)?;
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/cli/meshio_check.py");
    let ran = Command::new(python()).args([script, env!("CARGO_BIN_EXE_cutis")]).arg(work.path("")).output();
    let ran = ran.map_err(|e| e.to_string())?;
    let said = String::from_utf8_lossy(&ran.stdout);
    let failed = String::from_utf8_lossy(&ran.stderr);
    ensure!(ran.status.success() && said.ends_with("all agree\n"), "{said}{failed}");
    Ok(())
}
