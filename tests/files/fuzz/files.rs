//! Files that a scene names, changed: trajectories, recorded hands, meshes; and folders of results with anything in them.

use super::bounds::{Folder, TO_READ, TO_RUN, bounded, count, mends, tried};
use super::change::{Change, change, changed};
use cutis::report::run;
use cutis::scene;
use cutis::step::{Platform, Simulation};
use proptest::collection::vec;
use proptest::prelude::*;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::sync::LazyLock;

/// A block of two cells with a tool of each kind that reads a file.
const SCENE: &str = r#"title = "Tools with files"
time = { step_ms = 5.0, duration_s = 0.01 }
skin = { size_mm = [4.0, 4.0], cells = [2, 2], layer = [
    { name = "dermis", thickness_mm = 2.0, cells = 1, young_kpa = 100.0, poisson = 0.4, density_kg_m3 = 1100.0 },
] }
boundary = [{ region = "bottom" }]

[[tool]]
name = "tip"
mesh = "tip.obj"
trajectory = "hand.csv"
mass_g = 10.0
inertia_g_mm2 = [100.0, 100.0, 100.0]
points_mm = [[0.0, 0.0, 0.0]]

[[tool]]
name = "wire"
mesh = "tip.obj"
trajectory = "recorded.csv"
mass_g = 10.0
inertia_g_mm2 = [100.0, 100.0, 100.0]
lines = { mesh = "wire.obj", radius_mm = 0.2 }
"#;

const HAND: &str =
    "time_s,x_mm,y_mm,z_mm,qx,qy,qz,qw\n0,0.3,0.2,2.05,0,0,0,1\n0.005,0.3,0.2,1.9,0,0,0,1\n0.02,0.3,0.2,1.7,0,0,0,1\n";
const RECORDED: &str = "time_s,x_mm,y_mm,z_mm,qx,qy,qz,qw,force_x_n,force_y_n,force_z_n,torque_x_n_mm,torque_y_n_mm,torque_z_n_mm\n\
                        0.001,0,0,2.2,0,0,0,1,0,0,0,0,0,0\n0.002,0,0,2.1,0,0.6,0,0.8,0,0,0.1,0,0,0\n";
const TIP: &str = "o tip\nv 0 0 0\nv 1 0 2\nv -1 1 2\nv -1 -1 2\nvt 0 0\nvn 0 0 1\ns off\nusemtl steel\nf 1 2 3\nf 1/1/1 3/1/1 4/1/1\nf 1//1 4//1 2//1\nf -3 -1 -2\n";
const WIRE: &str = "v 0 0 0\nv 0 0 3\nv 1 0 3\nv 0.5 0.5 3 1.0\nl 1 2 3\nl -4 -1\np 4\np 1 2\n# end\n";

static LINES: LazyLock<Vec<String>> = LazyLock::new(|| {
    let own = [
        "v 1e38 0 0",
        "v nan 0 0",
        "v",
        "v 1 2",
        "f",
        "f 1",
        "f 1 2",
        "f 0 1 2",
        "f 9 9 9",
        "f -9 1 2",
        "f 1 1 1",
        "f 1 2 3 4 1",
    ];
    let more = [
        "f 4294967295 1 2",
        "f 9223372036854775808 1 2",
        "l 1",
        "l 1 1",
        "l 0 1",
        "p -5",
        "p 99",
        "l 1 2 1 2 1",
        "mtllib x.mtl",
        "",
        "\u{feff}",
    ];
    own.iter().chain(&more).map(|line| (*line).to_string()).collect()
});

/// A folder with the scene and its files.
fn folder() -> Folder {
    let folder = Folder::new();
    for (name, text) in
        [("scene.toml", SCENE), ("hand.csv", HAND), ("recorded.csv", RECORDED), ("tip.obj", TIP), ("wire.obj", WIRE)]
    {
        fs::write(folder.0.join(name), text).expect("the folder takes files");
    }
    folder
}

/// Puts a file where another one was. A new one: what overwrites an old one waits for the disk.
fn put(path: &Path, bytes: &[u8]) -> Result<(), String> {
    fs::remove_file(path).ok();
    fs::write(path, bytes).map_err(|e| e.to_string())
}

/// Reads the scene with one of its files changed; steps it twice for one of a hundred.
fn holds(folder: &Path, name: &str, text: &[u8], luck: u32) -> Result<(), String> {
    put(&folder.join(name), text)?;
    match bounded(TO_READ, || scene::read(&folder.join("scene.toml")))? {
        Ok(scene) if luck == 0 => bounded(TO_RUN, || {
            let mut simulation = Simulation::new(&scene, &Platform::Cpu64)?;
            simulation.step(false)?;
            simulation.step(true).map(drop)
        })?
        .map_err(|error| format!("running: {error}")),
        Ok(_) => Ok(()),
        Err(error) => mends(&error.to_string(), name),
    }
}

fn inputs() -> impl Strategy<Value = (usize, Vec<Change>, u32)> {
    (0..2usize, vec(change(&LINES), 0..6), 0u32..100)
}

#[test]
fn changed_trajectories_and_recorded_hands_are_refused_with_words_or_followed() {
    let folder = folder();
    tried(count(1), inputs(), |(which, changes, luck)| {
        let (name, text) = [("hand.csv", HAND), ("recorded.csv", RECORDED)][*which];
        let outcome = holds(&folder.0, name, changed(text, changes).as_bytes(), *luck);
        put(&folder.0.join(name), text.as_bytes())?;
        outcome
    });
}

#[test]
fn changed_meshes_are_refused_with_words_or_taken() {
    let folder = folder();
    tried(count(1), inputs(), |(which, changes, luck)| {
        let (name, text) = [("tip.obj", TIP), ("wire.obj", WIRE)][*which];
        let outcome = holds(&folder.0, name, changed(text, changes).as_bytes(), *luck);
        put(&folder.0.join(name), text.as_bytes())?;
        outcome
    });
}

#[test]
fn meshes_and_trajectories_of_any_numbers_are_refused_with_words_or_taken() {
    let folder = folder();
    let lines = vec((0..5usize, vec((-9i64..9, any::<f64>()), 0..5)), 0..30);
    tried(count(1), (0..2usize, lines), |(which, lines)| {
        let mut text = String::from(["", "v 0 0 0\nv 1 0 0\nv 0 1 0\n"][*which]);
        for (kind, numbers) in lines {
            text.push_str(["v", "f", "l", "p", "vn"][*kind]);
            for (whole, real) in numbers {
                match kind {
                    0 | 4 => write!(text, " {real:e}"),
                    _ => write!(text, " {whole}"),
                }
                .expect("a String takes any text");
            }
            text.push('\n');
        }
        let name = ["tip.obj", "wire.obj"][*which];
        holds(&folder.0, name, text.as_bytes(), 1)?;
        put(&folder.0.join(name), [TIP, WIRE][*which].as_bytes())?;
        let rows = lines.iter().map(|(_, row)| row.iter().map(|(_, v)| format!("{v:e}")).collect::<Vec<_>>().join(","));
        let table = format!("time_s,x_mm,y_mm,z_mm,qx,qy,qz,qw\n{}\n", rows.collect::<Vec<_>>().join("\n"));
        holds(&folder.0, "hand.csv", table.as_bytes(), 1)?;
        put(&folder.0.join("hand.csv"), HAND.as_bytes())
    });
}

#[test]
fn a_run_gets_along_with_anything_in_its_folder() {
    const NAMES: [&str; 12] = [
        "out",
        "out/report.json",
        "out/report.json.tmp",
        "out/probes.csv",
        "out/haptic.csv",
        "out/volume.pvd",
        "out/frames",
        "out/vtu",
        "out/frames/frame_0001.png",
        "out/vtu/volume_0001.vtu",
        "out/hand_tip.csv",
        "out/frames/frame_0001.png.tmp",
    ];
    let entry = (0..NAMES.len(), any::<bool>(), vec(any::<u8>(), 0..40));
    let folder = folder();
    let mut scene = scene::read(&folder.0.join("scene.toml")).expect("it is a scene");
    (scene.view.frames, scene.view.size) = (1, [8, 8]);
    // a run writes a dozen files, so fewer
    tried(count(50), vec(entry, 0..6), |entries| {
        let out = folder.0.join("out");
        for (name, is_folder, bytes) in entries {
            let path = folder.0.join(NAMES[*name]);
            // what cannot be there is not there
            match *is_folder {
                true => fs::create_dir_all(path).ok(),
                false => {
                    path.parent().and_then(|p| fs::create_dir_all(p).ok()).and_then(|()| fs::write(path, bytes).ok())
                }
            };
        }
        let options = run::Options { steps: Some(1), record: true, ..run::Options::new(Platform::Cpu64, &out) };
        let result = bounded(TO_RUN, || run::run(&scene, &options, &mut |_| {}))?;
        fs::remove_dir_all(&out).or_else(|_| fs::remove_file(&out)).map_err(|e| e.to_string())?;
        result.map(drop).or_else(|error| mends(&error.to_string(), "out"))
    });
}
