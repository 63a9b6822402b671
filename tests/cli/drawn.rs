//! Contact points as data, saved fields and surfaces, `cutis plot` and `cutis render`; and the same files by readers of others.

use crate::mesh::python;
use crate::resumed::cut;
use crate::work::{ALONE, PRESS, Work};
use crate::{Outcome, Test, ensure};
use cutis::formats::{self, Grid, read_grid};
use glam::DVec3;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Command;

pub const TESTS: &[Test] = &[
    ("contact_points_add_up_to_the_force_of_the_probes", contact_points_add_up_to_the_force_of_the_probes),
    ("saved_stress_is_that_of_the_probes", saved_stress_is_that_of_the_probes),
    ("alive_shares_follow_the_cut", alive_shares_follow_the_cut),
    ("saved_stiffness_is_that_of_the_inclusion", saved_stiffness_is_that_of_the_inclusion),
    ("surfaces_in_every_format_are_one_surface", surfaces_in_every_format_are_one_surface),
    ("plots_show_what_the_tables_have", plots_show_what_the_tables_have),
    ("what_cannot_be_plotted_is_told_with_its_place", what_cannot_be_plotted_is_told_with_its_place),
    ("pictures_and_a_film_are_rendered", pictures_and_a_film_are_rendered),
    ("what_cannot_be_rendered_is_told_with_its_place", what_cannot_be_rendered_is_told_with_its_place),
];

/// Needs python3 with meshio, trimesh and pygltflib.
pub const READER_TESTS: &[Test] = &[("other_readers_agree", other_readers_agree)];

/// Whether this machine's python3 has them.
pub fn has_readers() -> bool {
    let wanted = "import meshio, numpy, pygltflib, trimesh";
    Command::new(python()).args(["-c", wanted]).output().is_ok_and(|ran| ran.status.success())
}

const FIELDS: &str =
    "\n[output]\nfields = [\"stress\", \"strain\", \"alive\"]\nsurface = [\"glb\", \"obj\", \"stl\"]\n";

/// The press with more in its scene, run.
fn pressed(more: &str) -> Result<Work, String> {
    let work = Work::with(&format!("{PRESS}{more}"))?;
    let said = work.cutis(&["run", "scene.toml", "--backend", "cpu"])?;
    ensure_run(said.code == 0, &said.err)?;
    Ok(work)
}

fn ensure_run(holds: bool, words: &str) -> Outcome {
    ensure!(holds, "{words}");
    Ok(())
}

/// Rows of a table by column name.
fn rows(work: &Work, name: &str) -> Result<Vec<BTreeMap<String, String>>, String> {
    let text = work.read(name)?;
    let columns: Vec<&str> = text.lines().next().unwrap_or_default().split(',').collect();
    let row = |line: &str| columns.iter().map(|c| c.to_string()).zip(line.split(',').map(String::from)).collect();
    Ok(text.lines().skip(1).map(row).collect())
}

fn number(row: &BTreeMap<String, String>, column: &str) -> f64 {
    row.get(column).and_then(|cell| cell.parse().ok()).unwrap_or(f64::NAN)
}

fn vector(row: &BTreeMap<String, String>, [x, y, z]: [&str; 3]) -> DVec3 {
    DVec3::new(number(row, x), number(row, y), number(row, z))
}

const FORCE: [&str; 3] = ["force_x_n", "force_y_n", "force_z_n"];

/// Largest difference, relative to the largest force, between the sums of contact points and the probes of the force on the tip.
fn apart(probes: &[BTreeMap<String, String>], contacts: &[BTreeMap<String, String>]) -> f64 {
    let (mut most, mut scale) = (0.0f64, 0.0f64);
    for step in probes {
        let here = contacts.iter().filter(|row| row["time_s"] == step["time_s"]);
        let sum: DVec3 = here.map(|row| vector(row, FORCE)).sum();
        let probed = vector(step, ["fx_n", "fy_n", "fz_n"]);
        most = most.max((sum - probed).length());
        scale = scale.max(probed.length());
    }
    most / scale
}

fn contact_points_add_up_to_the_force_of_the_probes() -> Outcome {
    let probe =
        |axis| format!("\n[[probe]]\nname = \"f{axis}\"\nkind = \"force\"\nbody = \"tip\"\naxis = \"{axis}\"\n");
    let work = pressed(&["x", "y", "z"].map(probe).concat())?;
    let (probes, mut contacts) = (rows(&work, "out/probes.csv")?, rows(&work, "out/contacts.csv")?);
    ensure!(contacts.len() >= 3, "{} rows", contacts.len());
    let found = apart(&probes, &contacts);
    ensure!(found < 1e-12, "sums differ by {found}");
    for row in &contacts {
        ensure!(row["first"] == "tip" && row["second"] == "skin" && row["kind"] == "contact", "{row:?}");
        let (normal, gap) = (vector(row, ["normal_x", "normal_y", "normal_z"]), number(row, "gap_mm"));
        ensure!((normal.length() - 1.0).abs() < 1e-12 && normal.z > 0.9, "{row:?}");
        ensure!(gap.abs() < 1e-3 && number(row, "slip_x_mm").abs() < 0.1, "{row:?}");
        ensure!(vector(row, FORCE).dot(normal) > 0.0, "a contact pulls: {row:?}");
    }
    // the points of a picture are the rows of its time, with those that bear no force
    let at =
        |time: &str| contacts.iter().filter(|row| row["time_s"] == time).map(|row| vector(row, FORCE)).sum::<DVec3>();
    let (points, series) = (saved(&work, "out/vtu/contacts_0002.vtu")?, work.read("out/contacts.pvd")?);
    let time = series.lines().find(|line| line.contains("contacts_0002")).and_then(|line| line.split('"').nth(1));
    let forces = array(&points, "force_n")?.chunks_exact(3).map(DVec3::from_slice);
    let (sum, wanted) = (forces.sum::<DVec3>(), at(time.ok_or("no time")?));
    ensure!(wanted.length() > 1e-3 && (sum - wanted).length() < 1e-9 * wanted.length(), "{sum} N, {wanted} N");
    ensure!(points.points.iter().all(|p| (p[2] - 2e-3).abs() < 2e-3), "{:?}", points.points);
    // the counter-test
    let changed = number(&contacts[1], "force_z_n") * (1.0 + 1e-9);
    contacts[1].insert("force_z_n".into(), format!("{changed}"));
    let found = apart(&probes, &contacts);
    ensure!(found > 1e-11, "a changed row is not noticed: {found}");
    // it is on the list, and goes with the next run
    ensure!(work.read("out/cutis-files.txt")?.lines().any(|line| line == "contacts.csv"), "not on the list");
    work.write("scene.toml", ALONE)?;
    let said = work.cutis(&["run", "scene.toml", "--backend", "cpu"])?;
    ensure!(said.code == 0 && !work.path("out/contacts.csv").exists(), "it is still there: {}", said.err);
    Ok(())
}

fn saved(work: &Work, name: &str) -> Result<Grid, String> {
    let path = work.path(name);
    let bytes = std::fs::read(&path).map_err(|e| e.to_string())?;
    read_grid(&bytes, &path).map_err(|e| e.to_string())
}

fn array<'a>(grid: &'a Grid, name: &str) -> Result<&'a [f64], String> {
    let all = grid.point_data.iter().chain(&grid.cell_data);
    all.into_iter().find(|a| a.name == name).map(|a| &a.values[..]).ok_or(format!("no array {name}"))
}

/// Rest positions of the middles of cells, m.
fn middles(grid: &Grid) -> Result<Vec<DVec3>, String> {
    let u = array(grid, "displacement_m")?;
    let rest = |id: &u32| DVec3::from(grid.points[*id as usize]) - DVec3::from_slice(&u[3 * *id as usize..][..3]);
    Ok(grid.connectivity.chunks_exact(8).map(|ids| ids.iter().map(rest).sum::<DVec3>() / 8.0).collect())
}

fn saved_stress_is_that_of_the_probes() -> Outcome {
    let probe = |kind: &str, component: &str| {
        format!(
            "\n[[probe]]\nname = \"{kind}_{component}\"\nkind = \"{kind}\"\ncomponent = \"{component}\"\npoint_mm = [1.0, 1.0, 1.5]\n"
        )
    };
    let probes = [probe("stress", "von_mises"), probe("stress", "zz"), probe("stress", "yz"), probe("strain", "zx")];
    let work = pressed(&format!("{}{FIELDS}", probes.concat()))?;
    let last = rows(&work, "out/probes.csv")?.pop().ok_or("no step")?;
    let grid = saved(&work, "out/vtu/volume_0002.vtu")?;
    let near = |p: &DVec3| (*p - DVec3::new(1e-3, 1e-3, 1.5e-3)).length() < 1e-9;
    let cell = middles(&grid)?.iter().position(near).ok_or("no cell there")?;
    let (stress, strain) = (array(&grid, "stress_pa")?, array(&grid, "strain")?);
    for (found, column) in [
        (array(&grid, "von_mises_pa")?[cell], "stress_von_mises_pa"),
        (stress[6 * cell + 2], "stress_zz_pa"),
        (stress[6 * cell + 4], "stress_yz_pa"),
        (strain[6 * cell + 5], "strain_zx_ratio"),
    ] {
        let wanted = number(&last, column);
        ensure!(wanted != 0.0 && (found - wanted).abs() <= 1e-12 * wanted.abs(), "{column}: {found}, probed {wanted}");
    }
    // von Mises of the components, by its other formula
    for (s, found) in stress.chunks_exact(6).zip(array(&grid, "von_mises_pa")?) {
        let [xx, yy, zz, xy, yz, zx] = [s[0], s[1], s[2], s[3], s[4], s[5]];
        let normal = (xx - yy).powi(2) + (yy - zz).powi(2) + (zz - xx).powi(2);
        let wanted = (0.5 * normal + 3.0 * (xy * xy + yz * yz + zx * zx)).sqrt();
        ensure!((found - wanted).abs() < 1e-9 * wanted.max(1.0), "{found} and {wanted}");
    }
    // faces have the field of the cell behind them
    let surface = saved(&work, "out/vtu/surface_0002.vtu")?;
    let known: BTreeSet<u64> = array(&grid, "von_mises_pa")?.iter().map(|v| v.to_bits()).collect();
    ensure!(
        array(&surface, "von_mises_pa")?.iter().all(|v| known.contains(&v.to_bits())),
        "other values on the surface"
    );
    // what is not asked for is not there
    let work = pressed("")?;
    ensure!(array(&saved(&work, "out/vtu/volume_0002.vtu")?, "stress_pa").is_err(), "stress without asking");
    ensure!(!work.path("out/surface").exists(), "surfaces without asking");
    Ok(())
}

fn alive_shares_follow_the_cut() -> Outcome {
    let work = Work::with(&format!("{}\n[output]\nfields = [\"alive\"]\n", cut()))?;
    let said = work.cutis(&["run", "scene.toml", "--backend", "cpu", "--json"])?;
    ensure!(said.code == 0, "{}", said.err);
    let report: serde_json::Value = serde_json::from_str(&said.out).map_err(|e| e.to_string())?;
    let severed = report["cut"]["links_severed"].as_f64().unwrap_or(f64::NAN);
    let size = [24.0, 5.0];
    // the last of the default number of pictures
    let grid = saved(&work, "out/vtu/volume_0008.vtu")?;
    let middles = middles(&grid)?;
    let high = middles.iter().fold(DVec3::MIN, |high, p| high.max(*p));
    let low = middles.iter().fold(DVec3::MAX, |low, p| low.min(*p));
    // each severed link is missing at both of its cells, which have a neighbour per side that is not at the grid's border
    let step = [(high.x - low.x) / (size[0] - 1.0), (high.y - low.y) / (size[1] - 1.0)];
    let beside = |value: f64, low: f64, high: f64, step: f64| {
        f64::from(u8::from(value > low + 0.5 * step)) + f64::from(u8::from(value < high - 0.5 * step))
    };
    let thinnest = 1e-6;
    let mut missing = 0.0;
    for (p, share) in middles.iter().zip(array(&grid, "alive_share")?) {
        let sides = beside(p.x, low.x, high.x, step[0])
            + beside(p.y, low.y, high.y, step[1])
            + beside(p.z, low.z, high.z, thinnest);
        missing += sides * (1.0 - share);
    }
    ensure!(
        severed > 0.0 && (missing - 2.0 * severed).abs() < 1e-6,
        "{missing} sides missing, {severed} links severed"
    );
    Ok(())
}

fn saved_stiffness_is_that_of_the_inclusion() -> Outcome {
    // the half with x < 0
    let inclusion = "[[inclusion]]\nregion = \"box\"\nbox_mm = [[-99, -99, -1], [0, 99, 99]]\nyoung_kpa = 68\n";
    let work = Work::with(&format!("{}\n{inclusion}[output]\nfields = [\"stiffness\"]\n", cut()))?;
    let said = work.cutis(&["run", "scene.toml", "--backend", "cpu", "--steps", "8"])?;
    ensure!(said.code == 0, "{}", said.err);
    let grid = saved(&work, "out/vtu/volume_0001.vtu")?;
    let mut counts = [0; 4];
    for (p, factor) in middles(&grid)?.iter().zip(array(&grid, "stiffness_factor")?) {
        let (kind, wanted) = match p.z {
            _ if p.x > 0.0 => (3, 1.0),
            z if z < 1.2e-3 => (0, 68.0 / 34.0),
            z if z < 2.2e-3 => (1, 68.0 / 200.0),
            _ => (2, 68.0 / 1000.0),
        };
        counts[kind] += 1;
        ensure!((factor / wanted - 1.0).abs() < 1e-6, "{factor} at {p}, wanted {wanted}");
    }
    ensure!(counts.iter().all(|count| *count > 0) && counts[3] == counts[..3].iter().sum::<i32>(), "{counts:?}");
    Ok(())
}

/// Triangles of a `.glb` file: the first mesh, corners in z up.
fn glb(bytes: &[u8]) -> Result<Vec<[DVec3; 3]>, String> {
    let word = |at: usize| bytes.get(at..at + 4).map_or(0, |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize);
    ensure_run(bytes.starts_with(b"glTF") && word(4) == 2 && word(8) == bytes.len(), "no head of a glb file")?;
    let length = word(12);
    ensure_run(&bytes[16..20] == b"JSON" && &bytes[24 + length..28 + length] == b"BIN\0", "wrong chunks")?;
    let json: serde_json::Value = serde_json::from_slice(&bytes[20..20 + length]).map_err(|e| e.to_string())?;
    let binary = &bytes[28 + length..];
    let primitive = &json["meshes"][0]["primitives"][0];
    let view = |accessor: &serde_json::Value| -> Result<&[u8], String> {
        let accessor = &json["accessors"][accessor.as_u64().ok_or("no accessor")? as usize];
        let view = &json["bufferViews"][accessor["bufferView"].as_u64().ok_or("no view")? as usize];
        let [start, length] = ["byteOffset", "byteLength"].map(|key| view[key].as_u64().unwrap_or(u64::MAX) as usize);
        binary.get(start..start + length).ok_or("a view beyond the buffer".into())
    };
    let quad = |b: &[u8]| [b[0], b[1], b[2], b[3]];
    let floats =
        |bytes: &[u8]| bytes.chunks_exact(4).map(|b| f64::from(f32::from_le_bytes(quad(b)))).collect::<Vec<_>>();
    let points = floats(view(&primitive["attributes"]["POSITION"])?);
    let colors = floats(view(&primitive["attributes"]["COLOR_0"])?);
    ensure_run(colors.len() == points.len() && colors.iter().all(|c| (0.0..=1.0).contains(c)), "colours")?;
    let ids = view(&primitive["indices"])?.chunks_exact(4).map(|b| u32::from_le_bytes(quad(b)) as usize);
    let corners: Vec<DVec3> = ids.map(|id| DVec3::from_slice(&points[3 * id..][..3])).collect();
    Ok(corners.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect())
}

fn surfaces_in_every_format_are_one_surface() -> Outcome {
    let work = pressed(FIELDS)?;
    let grid = saved(&work, "out/vtu/surface_0002.vtu")?;
    let point = |id: &u32| DVec3::from(grid.points[*id as usize]);
    let wanted: Vec<[DVec3; 3]> =
        grid.connectivity.chunks_exact(3).map(|ids| [point(&ids[0]), point(&ids[1]), point(&ids[2])]).collect();
    ensure!(wanted.len() == 128, "{} triangles", wanted.len());
    let path = |ending: &str| work.path(&format!("out/surface/surface_0002.{ending}"));
    let read = |path: &Path| formats::read(path, &mut |_| {}).map_err(|e| e.to_string());
    let mut all = vec![("glb", glb(&std::fs::read(path("glb")).map_err(|e| e.to_string())?)?)];
    for ending in ["obj", "stl"] {
        let mesh = read(&path(ending))?;
        let corner = |id: u32| DVec3::from(mesh.points[id as usize]);
        all.push((ending, mesh.triangles.iter().map(|ids| ids.map(corner)).collect()));
    }
    for (ending, found) in &all {
        ensure!(found.len() == wanted.len(), "{ending}: {} triangles", found.len());
        // f32, but for obj
        let far =
            found.iter().flatten().zip(wanted.iter().flatten()).map(|(a, b)| (*a - *b).length()).fold(0.0, f64::max);
        ensure!(far <= if *ending == "obj" { 0.0 } else { 1e-9 }, "{ending}: corners {far} m apart");
    }
    Ok(())
}

/// Number of pixels that are not white, and the size.
fn drawn(path: &Path) -> Result<(usize, [u32; 2]), String> {
    let decoder = png::Decoder::new(std::io::BufReader::new(std::fs::File::open(path).map_err(|e| e.to_string())?));
    let mut reader = decoder.read_info().map_err(|e| e.to_string())?;
    let mut rgb = vec![0; reader.output_buffer_size().ok_or("too large")?];
    let info = reader.next_frame(&mut rgb).map_err(|e| e.to_string())?;
    Ok((rgb.chunks_exact(3).filter(|p| **p != [255; 3]).count(), [info.width, info.height]))
}

fn plots_show_what_the_tables_have() -> Outcome {
    let work = pressed("")?;
    let files = work.json(&["plot", "out", "--json"], 0)?;
    let names = ["force", "probes", "energy", "residual", "timing"];
    ensure!(files.as_array().map(Vec::len) == Some(10), "{files}");
    for name in names {
        let svg = work.read(&format!("out/plots/{name}.svg"))?;
        let document = roxmltree::Document::parse(&svg).map_err(|e| e.to_string())?;
        let texts: Vec<&str> = document.descendants().filter_map(|n| n.text()).map(str::trim).collect();
        let axis = if name == "probes" { "displacement, position, µm" } else { "time, s" };
        ensure!(texts.contains(&axis) && texts.contains(&"time, s"), "{name}: {texts:?}");
        let (marked, [width, height]) = drawn(&work.path(&format!("out/plots/{name}.png")))?;
        let size = document.root_element().attribute("height").and_then(|h| h.parse::<u32>().ok());
        ensure!(width == 1800 && Some(height) == size.map(|h| 2 * h), "{name}: {width} × {height}, {size:?}");
        ensure!(marked > 10_000, "{name}: {marked} pixels");
    }
    let svg = work.read("out/plots/force.svg")?;
    ensure!(svg.contains("force, mN") && svg.contains("skin on tip") && svg.contains("tool 0"), "no force in {svg}");
    // a curve goes through the values of its table: the deepest point of the probe is the lowest of its curve
    let svg = work.read("out/plots/probes.svg")?;
    let document = roxmltree::Document::parse(&svg).map_err(|e| e.to_string())?;
    let curve = document.descendants().filter(|n| n.attribute("stroke") == Some("#0072B2"));
    let points = curve.filter_map(|n| n.attribute("points")).map(|p| p.split_whitespace().collect::<Vec<_>>());
    let curve = points.max_by_key(Vec::len).ok_or("no curve")?;
    let heights: Vec<f64> = curve.iter().filter_map(|p| p.split(',').nth(1)?.parse().ok()).collect();
    let values: Vec<f64> = rows(&work, "out/probes.csv")?.iter().map(|row| number(row, "top_m")).collect();
    ensure!(heights.len() == values.len(), "{heights:?} {values:?}");
    let [low, high] = [f64::min, f64::max].map(|pick| values.iter().copied().reduce(pick).unwrap_or(0.0));
    let [top, bottom] = [f64::min, f64::max].map(|pick| heights.iter().copied().reduce(pick).unwrap_or(0.0));
    for (height, value) in heights.iter().zip(&values) {
        let wanted = top + (high - value) / (high - low) * (bottom - top);
        ensure!((height - wanted).abs() <= 1.5, "{height} and {wanted} for {value}");
    }
    // the next run takes them away
    let said = work.cutis(&["run", "scene.toml", "--backend", "cpu", "--frames", "0"])?;
    ensure!(said.code == 0 && !work.path("out/plots/force.svg").exists(), "plots of an earlier run: {}", said.err);
    Ok(())
}

/// A command fails with exit status and words, and leaves no `.tmp`.
fn refused(work: &Work, arguments: &[&str], code: i32, words: &str) -> Outcome {
    let said = work.cutis(arguments)?;
    ensure!(said.code == code && said.err.contains(words), "{arguments:?}: {} {}; wanted {words}", said.code, said.err);
    Ok(())
}

fn what_cannot_be_plotted_is_told_with_its_place() -> Outcome {
    let work = pressed("")?;
    refused(&work, &["plot", "nowhere"], 2, "nowhere: no results of a run in it: a folder is looked for")?;
    std::fs::create_dir(work.path("empty")).map_err(|e| e.to_string())?;
    refused(&work, &["plot", "empty"], 2, "empty: no results of a run in it: one of probes.csv")?;
    let left = std::fs::read_dir(work.path("empty")).map_err(|e| e.to_string())?.count();
    ensure!(left == 0, "{left} files in a folder that is not a run's");
    let whole = work.read("out/probes.csv")?;
    let third = whole.lines().nth(2).ok_or("no third line")?;
    for (name, text, words) in [
        ("probes.csv", whole.replace(third, "0.01,1"), "probes.csv:3: 2 values in a row of 6 columns"),
        ("probes.csv", whole.replace(third, "0.01,x,0,0,0,0"), "probes.csv:3: `x` in the column top_m where a number"),
        ("probes.csv", whole.trim_end().into(), "probes.csv:6: a line that is cut off"),
        ("probes.csv", "a,b\n1,2\n".into(), "probes.csv:1: no table of a run"),
        ("solver.csv", "time_s,residual\n".into(), "solver.csv:1: no column iterations"),
        ("report.json", "{\n\"step_s\": 1".into(), "report.json:2: "),
        ("report.json", "{}".into(), "report.json: no number `step_ms.median`"),
    ] {
        let path = format!("out/{name}");
        let before = work.read(&path)?;
        work.write(&path, &text)?;
        refused(&work, &["plot"], 2, words)?;
        work.write(&path, &before)?;
    }
    std::fs::create_dir(work.path("out/plots")).map_err(|e| e.to_string())?;
    work.write("out/plots/force.svg", "mine")?;
    refused(&work, &["plot"], 1, "force.svg: stands where a result goes")?;
    ensure!(work.read("out/plots/force.svg")? == "mine", "a file of the user's is changed");
    Ok(())
}

fn pictures_and_a_film_are_rendered() -> Outcome {
    let work = pressed(FIELDS)?;
    let mut pictures = vec![];
    for color in ["displacement", "velocity", "von-mises", "layer"] {
        let files = work.json(&["render", "--color", color, "--size", "240", "160", "--fps", "4", "--json"], 0)?;
        ensure!(files.as_array().map(Vec::len) == Some(3), "{files}");
        let bytes = std::fs::read(work.path("out/render/frame_0002.png")).map_err(|e| e.to_string())?;
        ensure!(drawn(&work.path("out/render/frame_0002.png"))?.1 == [240, 160], "wrong size");
        pictures.push(bytes);
        let film = std::fs::File::open(work.path("out/render/film.png")).map_err(|e| e.to_string())?;
        let mut reader = png::Decoder::new(std::io::BufReader::new(film)).read_info().map_err(|e| e.to_string())?;
        let count = reader.info().animation_control.map(|a| (a.num_frames, a.num_plays));
        ensure!(count == Some((2, 0)), "{count:?}");
        let mut rgb = vec![0; reader.output_buffer_size().ok_or("too large")?];
        for _ in 0..2 {
            reader.next_frame(&mut rgb).map_err(|e| e.to_string())?;
            let delay = reader.info().frame_control.map(|f| (f.delay_num, f.delay_den));
            ensure!(delay == Some((1, 4)), "{delay:?}");
        }
        // the film's last picture is the last picture
        let last = png::Decoder::new(std::io::Cursor::new(&pictures[pictures.len() - 1]));
        let mut alone = vec![0; rgb.len()];
        last.read_info().and_then(|mut r| r.next_frame(&mut alone)).map_err(|e| e.to_string())?;
        ensure!(alone == rgb, "the film ends with another picture");
    }
    let all: BTreeSet<&Vec<u8>> = pictures.iter().collect();
    ensure!(all.len() == pictures.len(), "colours of different quantities are one picture");
    // another eye, another picture
    work.json(&["render", "--color", "layer", "--size", "240", "160", "--eye-mm", "0", "-1", "40", "--json"], 0)?;
    let other = std::fs::read(work.path("out/render/frame_0002.png")).map_err(|e| e.to_string())?;
    ensure!(other != pictures[3], "the eye does nothing");
    let said = work.cutis(&["run", "scene.toml", "--backend", "cpu", "--frames", "0"])?;
    ensure!(said.code == 0 && !work.path("out/render/film.png").exists(), "a film of an earlier run: {}", said.err);
    Ok(())
}

fn what_cannot_be_rendered_is_told_with_its_place() -> Outcome {
    let work = pressed("")?;
    refused(&work, &["render", "nowhere"], 2, "nowhere: no results of a run in it: surface.pvd")?;
    refused(
        &work,
        &["render", "--color", "von-mises"],
        2,
        "surface_0001.vtu: no field von_mises_pa; run the scene again",
    )?;
    refused(&work, &["render", "--size", "0", "10"], 2, "--size")?;
    let series = work.read("out/surface.pvd")?;
    work.write("out/surface.pvd", &series.replace("timestep=\"0.015\"", ""))?;
    refused(&work, &["render"], 2, "surface.pvd:4: a DataSet without a timestep")?;
    work.write("out/surface.pvd", &series[..series.len() - 20])?;
    refused(&work, &["render"], 2, "surface.pvd:")?;
    work.write("out/surface.pvd", &series)?;
    std::fs::copy(work.path("out/vtu/volume_0002.vtu"), work.path("out/vtu/surface_0002.vtu"))
        .map_err(|e| e.to_string())?;
    refused(
        &work,
        &["render"],
        2,
        "surface_0002.vtu: a file that cannot be drawn (it has other cells than triangles)",
    )?;
    std::fs::remove_file(work.path("out/vtu/surface_0002.vtu")).map_err(|e| e.to_string())?;
    refused(&work, &["render"], 2, "surface_0002.vtu: a file that cannot be drawn")?;
    ensure!(!work.path("out/render").exists(), "something is left of what was refused");
    Ok(())
}

fn other_readers_agree() -> Outcome {
    let work = pressed(FIELDS)?;
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/cli/results_check.py");
    let ran = Command::new(python()).arg(script).arg(work.path("out")).output().map_err(|e| e.to_string())?;
    let (said, failed) = (String::from_utf8_lossy(&ran.stdout), String::from_utf8_lossy(&ran.stderr));
    ensure!(ran.status.success() && said.ends_with("all agree\n"), "{said}{failed}");
    Ok(())
}
