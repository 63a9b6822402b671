//! Longest step of a run against its median: a trainer that stands still for a moment is no trainer. All shipped scenes, those of scenes/hard, and
//! three that are hard on contact: punches of 64 and 256 points dragged by 1 mm with friction, and a sphere of 1 m that touches the whole
//! patch. Prints Markdown: a row a scene, with the bar and the work that a step may cost at most.
//!
//! `cargo bench --bench bursts -- incision points` takes those whose name contains a word. Steps beside other programs take longer: nothing else may run.

use cutis::error::Result;
use cutis::scene::{Contact, Pose, Round, Scene, Skin, read};
use cutis::step::{Platform, Simulation};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Longest step over the median step.
const LONGEST: f64 = 5.0;
/// Cells of a body at most; more of them are for a GPU.
const CELLS: u32 = 200_000;
/// Steps of a run at most; those of long scenes are much alike.
const STEPS: u32 = 700;

/// Scene files of a folder, in order.
fn files(folder: &str) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
    let entries = std::fs::read_dir(&folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    let mut found: Vec<PathBuf> =
        entries.filter_map(|e| Some(e.ok()?.path())).filter(|p| p.extension().is_some_and(|e| e == "toml")).collect();
    found.sort();
    found
}

fn punch() -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/hard/tools_many_points.toml");
    let mut scene = read(&path).unwrap_or_else(|e| panic!("{e}"));
    (scene.time.step, scene.time.duration, scene.solver.tolerance) = (0.01, 0.8, 1e-3);
    scene
}

/// Over the middle of the skin at these heights and shifts, m.
fn way(rows: &[(f64, f64, f64)]) -> Vec<Pose> {
    rows.iter().map(|&(time, x, z)| Pose { time, position: [x, 0.0, z], ..Pose::default() }).collect()
}

/// A punch of `count` × `count` points on 2 × 2 mm, pressed by 0.1 mm and dragged by 1 mm.
fn points(count: usize) -> Scene {
    let mut scene = punch();
    let at = |k: usize| 1e-3 * (2.0 * k as f64 / (count - 1) as f64 - 1.0);
    scene.tools[0].points = (0..count * count).map(|k| [at(k % count), at(k / count), 0.0]).collect();
    scene.tools[0].trajectory = way(&[(0.0, 0.0, 2.301e-3), (0.3, 0.0, 2.2e-3), (0.8, 1e-3, 2.2e-3)]);
    let max_contacts = (count * count) as u32;
    scene.contact = Some(Contact { friction: 0.3, max_contacts, ..Contact::default() });
    scene
}

/// A sphere of 1 m that is pressed by 0.1 mm: it touches the whole patch.
fn large_sphere() -> Scene {
    let mut scene = punch();
    let tool = &mut scene.tools[0];
    (tool.points, tool.mesh.positions, tool.mesh.triangles) = (vec![], vec![], vec![]);
    tool.round = Some(Round { radius: 1.0, ends: [[0.0; 3]; 2] });
    tool.trajectory = way(&[(0.0, 0.0, 1.002301), (0.3, 0.0, 1.0022), (0.8, 1e-3, 1.0022)]);
    scene.contact = Some(Contact { friction: 0.3, max_contacts: 2000, ..Contact::default() });
    scene
}

/// Runs a scene on the CPU path in f64 and prints its row.
fn row(name: &str, scene: &Scene) -> Result<()> {
    let mut simulation = Simulation::new(scene, &Platform::Cpu64)?;
    let (mut times, mut contacts, mut columns, mut updates, mut warnings) = (vec![], 0, 0, 0, 0);
    for _ in 0..scene.time.steps().min(STEPS) {
        let start = Instant::now();
        let report = simulation.step(false)?;
        times.push(1e3 * start.elapsed().as_secs_f64());
        contacts = contacts.max(report.contact.count());
        columns = columns.max(report.contact.columns);
        updates = updates.max(report.costs.row_updates);
        warnings += report.warnings.values().sum::<u32>();
    }
    times.sort_by(f64::total_cmp);
    let of = |share: f64| times[((times.len() - 1) as f64 * share).round() as usize];
    let longest = of(1.0) / of(0.5);
    let bar = if longest > LONGEST { "**above**" } else { "holds" };
    println!(
        "| {name} | {} | {contacts} | {:.2} | {:.1} | {longest:.1} | {bar} | {columns} | {updates} | {warnings} |",
        times.len(),
        of(0.5),
        of(0.99) / of(0.5),
    );
    Ok(())
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    println!(
        "| scene | steps | contacts at most | median step, ms | 99 % / median | longest / median | ≤ {LONGEST} | columns in a step | row updates in a step | warnings |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    let mut scenes: Vec<(String, Result<Scene>)> = vec![
        ("64 points, dragged".into(), Ok(points(8))),
        ("256 points, dragged".into(), Ok(points(16))),
        ("sphere of 1 m".into(), Ok(large_sphere())),
    ];
    for file in ["scenes", "scenes/hard"].into_iter().flat_map(files) {
        let name = file.strip_prefix(Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes")).unwrap_or(&file);
        scenes.push((name.with_extension("").display().to_string(), read(&file)));
    }
    for (name, scene) in scenes {
        if !words.is_empty() && !words.iter().any(|word| name.contains(word.as_str())) {
            continue;
        }
        let cells = |skin: &Skin| skin.cells[0] * skin.cells[1] * skin.layers.iter().map(|l| l.cells).sum::<u32>();
        if scene.as_ref().is_ok_and(|scene| scene.skins.iter().any(|skin| cells(skin) > CELLS)) {
            println!("| {name} | has more than {CELLS} cells |");
            continue;
        }
        if let Err(error) = scene.and_then(|scene| row(&name, &scene)) {
            println!("| {name} | {error} |");
        }
    }
}
