//! Scene files: the shipped scenes and a few more, changed. What is accepted goes on, in a small grid: the model, what `inspect` says, two
//! steps, a run.

use super::bounds::{Folder, TO_READ, TO_RUN, bounded, count, mends, tried};
use super::change::{change, changed};
use cutis::bodies::Model;
use cutis::error::Result;
use cutis::report::{inspect, run};
use cutis::scene::{self, Cut, Files, INTEGRATORS, MATERIALS, Scene};
use cutis::step::{Platform, Simulation};
use proptest::collection::vec;
use proptest::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

/// Scenes of two cells a side with what no shipped scene has; in no folder.
const OWN: [&str; 5] = [MOONEY_RIVLIN, FIBRES, BALANCE, EXPLICIT, PROBED];

const MOONEY_RIVLIN: &str = r#"title = "Mooney–Rivlin under a pressure, by the midpoint rule"
[time]
step_ms = 1.0
duration_s = 0.01
integrator = "midpoint"
[skin]
size_mm = [4.0, 4.0]
cells = [2, 2]
law = "mooney_rivlin"
[[skin.layer]]
name = "dermis"
thickness_mm = 2.0
cells = 2
c10_kpa = 10.0
c01_kpa = 4.0
bulk_kpa = 300.0
density_kg_m3 = 1100.0
[[boundary]]
region = "bottom"
[[load]]
pressure_kpa = 2.0
follower = false
start_s = 0.001
end_s = 0.006
[[load]]
traction_kpa = [0.5, 0.0, -1.0]
region = "side_x_max"
"#;

const FIBRES: &str = r#"title = "Fibres under a force at a point, in Newton's steps"
[time]
step_ms = 5.0
duration_s = 0.05
integrator = "implicit_euler"
[solver]
newton = true
[skin]
size_mm = [4.0, 4.0]
cells = [2, 2]
law = "holzapfel"
[[skin.layer]]
name = "dermis"
thickness_mm = 2.0
cells = 2
young_kpa = 100.0
poisson = 0.45
density_kg_m3 = 1100.0
fibre_kpa = 150.0
fibre_growth = 1.2
fibre_dispersion = 0.1
fibre_angle_deg = 35.0
langer_deg = 20.0
pre_strain = [0.1, 0.05]
[[boundary]]
region = "bottom"
[[boundary]]
region = "sides"
[[load]]
force_n = [0.0, 0.0, -0.01]
at_mm = [0.0, 0.0, 2.0]
"#;

const BALANCE: &str = r#"title = "Two blocks in static balance, of both laws, one on a path"
[time]
step_ms = 100.0
duration_s = 0.3
integrator = "static"
[skin]
size_mm = [4.0, 4.0]
cells = [2, 2]
law = "mooney_rivlin"
[[skin.layer]]
name = "dermis"
thickness_mm = 2.0
cells = 2
c10_kpa = 10.0
c01_kpa = 4.0
bulk_kpa = 300.0
density_kg_m3 = 1100.0
[[block]]
name = "strip"
position_mm = [0.0, 10.0, 0.0]
size_mm = [4.0, 4.0]
cells = [2, 2]
law = "holzapfel"
[[block.layer]]
name = "dermis"
thickness_mm = 2.0
cells = 2
young_kpa = 100.0
poisson = 0.45
density_kg_m3 = 1100.0
fibre_kpa = 150.0
langer_deg = 90.0
[[boundary]]
body = "skin"
region = "bottom"
[[boundary]]
body = "strip"
region = "side_x_min"
[[boundary]]
body = "strip"
region = "side_x_max"
axes = "x"
path_mm = [[0.0, 0.0, 0.0, 0.0], [0.3, 0.5, 0.0, 0.0]]
[[load]]
body = "skin"
pressure_kpa = 2.0
follower = true
rectangle_mm = [[-1.0, -1.0], [1.0, 1.0]]
[[load]]
body = "skin"
force_n = [0.001, 0.0, -0.01]
at_mm = [1.0, 0.5, 2.0]
"#;

const EXPLICIT: &str = r##"title = "Explicit steps"
[time]
step_ms = 1.0
duration_s = 0.01
substeps = 25
integrator = "symplectic_euler"
[skin]
size_mm = [4.0, 4.0]
cells = [2, 2]
mass = "uniform"
rayleigh_stiffness_s = 0.0
[[skin.layer]]
name = "dermis"
thickness_mm = 2.0
cells = 2
young_kpa = 100.0
poisson = 0.45
density_kg_m3 = 1100.0
color = "#c08060"
[[boundary]]
region = "bottom_rim"
margin_mm = 0.5
[[load]]
force_n = [0.0, 0.0, -0.01]
region = "sphere"
centre_mm = [0.0, 0.0, 2.0]
radius_mm = 1.5
"##;

const PROBED: &str = r#"title = "A sphere on skin, with probes of both"
[time]
step_ms = 5.0
duration_s = 0.05
[skin]
size_mm = [4.0, 4.0]
cells = [2, 2]
[[skin.layer]]
name = "dermis"
thickness_mm = 2.0
cells = 2
young_kpa = 100.0
poisson = 0.45
density_kg_m3 = 1100.0
[[boundary]]
region = "bottom_core"
margin_mm = 0.5
[[boundary]]
region = "side_y_max"
[[tool]]
name = "finger"
mass_g = 20.0
inertia_g_mm2 = [80.0, 80.0, 80.0]
path_mm = [[0.0, 0.0, 0.0, 3.01], [0.05, 0.1, 0.0, 2.9]]
[tool.round]
radius_mm = 1.0
points_mm = [[0.0, 0.0, 0.0]]
[tool.coupling]
stiffness_n_m = 2000.0
damping_n_s_m = 5.0
angular_stiffness_n_m_rad = 3.0
angular_damping_n_m_s_rad = 0.01
[contact]
friction = 0.3
[[probe]]
name = "pressure"
kind = "pressure"
region = "top"
[[probe]]
name = "spin"
kind = "spin"
body = "finger"
axis = "x"
"#;

/// The scenes that are changed: folder and text of the shipped ones, then [`OWN`].
static SCENES: LazyLock<Vec<(PathBuf, String)>> = LazyLock::new(|| {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let mut all = vec![];
    for folder in [root.clone(), root.join("hard"), root.join("verify")] {
        let entries = std::fs::read_dir(&folder).expect("the scenes are there").flatten().map(|entry| entry.path());
        let scenes = entries.filter(|path| path.extension().is_some_and(|end| end == "toml"));
        all.extend(scenes.map(|path| (folder.clone(), std::fs::read_to_string(path).expect("it is text"))));
    }
    all.sort();
    assert!(all.len() > 20);
    all.extend(OWN.map(|text| (root.clone(), text.into())));
    all
});

static LINES: LazyLock<Vec<String>> = LazyLock::new(|| {
    SCENES.iter().flat_map(|(_, text)| text.lines()).filter(|l| !l.is_empty()).map(String::from).collect()
});

/// A changed scene.
#[derive(Clone)]
struct Input {
    number: usize,
    text: String,
    /// How far it goes when it is accepted.
    luck: u32,
}

impl std::fmt::Debug for Input {
    /// The lines that the scene does not have.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (_, scene) = &SCENES[self.number];
        let title = scene.lines().next().unwrap_or_default();
        write!(f, "luck {}, {title}, {} bytes of {}:", self.luck, self.text.len(), scene.len())?;
        self.text.lines().filter(|line| !scene.contains(line)).try_for_each(|line| write!(f, "\n    {line}"))
    }
}

fn inputs() -> impl Strategy<Value = Input> {
    let changes = (0..SCENES.len(), vec(change(&LINES), 0..6), 0u32..1024);
    changes.prop_map(|(number, changes, luck)| Input { number, text: changed(&SCENES[number].1, &changes), luck })
}

/// The scene on a few cells, with few iterations: what may take long because it was asked for is none of this.
fn small(mut scene: Scene) -> Scene {
    for skin in &mut scene.skins {
        skin.cells = skin.cells.map(|n| n.min(3));
        skin.layers.iter_mut().for_each(|layer| layer.cells = layer.cells.min(2));
        if let Cut::Split { reserve_columns } = &mut skin.cut {
            *reserve_columns = (*reserve_columns).min(40);
        }
    }
    scene.solver.max_iterations = scene.solver.max_iterations.min(60);
    scene.solver.refinements = scene.solver.refinements.min(2);
    if let Some(contact) = &mut scene.contact {
        // an ill-posed problem of 64 contacts takes all its sweeps and Newton steps, minutes of them
        contact.max_contacts = contact.max_contacts.min(12);
        contact.max_passes = contact.max_passes.min(4);
    }
    scene.time.substeps = scene.time.substeps.min(3);
    scene.view.frames = 0;
    scene
}

fn two_steps(scene: &Scene, platform: Platform) -> Result<()> {
    let mut simulation = Simulation::new(scene, &platform)?;
    simulation.step(false)?;
    simulation.step(true)?;
    Ok(())
}

fn two_steps_written(scene: &Scene) -> Result<()> {
    let folder = Folder::new();
    let out = folder.0.join("out");
    let options = run::Options { steps: Some(2), record: true, ..run::Options::new(Platform::Cpu64, out) };
    run::run(scene, &options, &mut |_| {}).map(drop)
}

/// What an accepted scene goes on to; one of four is stepped, one of 64 writes a folder, one of 1024 is inspected.
fn goes_on(scene: Scene, luck: u32) -> std::result::Result<(), String> {
    let scene = small(scene);
    // fewer cells may be slender, which no file may ask for
    if scene.check().is_err_and(|error| error.to_string().contains("times as long as wide")) {
        return Ok(());
    }
    let result = bounded(TO_RUN, || {
        for number in 0..scene.skins.len() {
            drop(Model::new(&scene, number)?);
        }
        match luck {
            0..256 => two_steps(&scene, [Platform::Cpu64, Platform::Cpu32][luck as usize % 2].clone()),
            256..272 => two_steps_written(&scene),
            272 => inspect::inspect(&scene).map(drop),
            _ => Ok(()),
        }
    })?;
    result.or_else(|error| mends(&error.to_string(), "").map_err(|e| format!("running: {e}")))
}

pub fn holds(folder: &Path, text: &str, luck: u32) -> std::result::Result<(), String> {
    let files = Files::Folder(folder.to_path_buf());
    match bounded(TO_READ, || scene::parse(text, Path::new("scene.toml"), &files))? {
        Ok(scene) => goes_on(scene, luck),
        Err(error) => {
            let message = error.to_string();
            // of a file that the scene names, the scene's folder is part of the name
            let named = if message.contains("scene.toml") { "scene.toml" } else { folder.to_str().unwrap_or_default() };
            mends(&message, named)
        }
    }
}

#[test]
fn changed_scenes_are_refused_with_words_or_run() {
    tried(count(1), inputs(), |input| holds(&SCENES[input.number].0, &input.text, input.luck));
}

#[test]
fn own_scenes_run_as_they_stand() {
    let run = |text: &str| {
        let scene = scene::parse(text, Path::new("scene.toml"), &Files::Embedded(&[]))?;
        two_steps(&scene, Platform::Cpu64)
    };
    for text in OWN {
        run(text).unwrap_or_else(|error| panic!("{error}"));
    }
    assert!(run(&EXPLICIT.replace("substeps = 25\n", "")).is_err(), "the counter-test: a step beyond the stable one");
}

/// Keys of loads, layers and time steps, and words of laws and integrators, that no line of the scenes has.
fn untried(lines: &[String]) -> Vec<String> {
    let begun = |key: &str| lines.iter().any(|line| line.starts_with(&format!("{key} = ")));
    let named = |word: &str| lines.iter().any(|line| line.contains(&format!(" = \"{word}\"")));
    let tables = ["[time]", "[[skin.layer]] and [[block.layer]]", "[[load]]", "[[probe]]"];
    let all = scene::keys::keys();
    let of = |key: &scene::keys::Key| key.table.replace('`', "");
    let keys: Vec<&str> = all.iter().filter(|key| tables.contains(&of(key).as_str())).map(|key| key.name).collect();
    // kinds of probes and regions
    let choices = [("[[probe]]", "kind"), ("[[boundary]]", "region")];
    let choices = all.iter().filter(|key| choices.contains(&(of(key).as_str(), key.name)));
    let choices = choices.flat_map(|key| key.range.split('"').skip(1).step_by(2).map(|word| (key.name, word)));
    let unchosen = choices.filter(|(key, word)| !lines.contains(&format!("{key} = \"{word}\"")));
    assert!(keys.contains(&"follower") && keys.contains(&"langer_deg") && keys.contains(&"substeps"), "{keys:?}");
    let words = INTEGRATORS.iter().map(|(word, _)| *word).chain(MATERIALS.iter().map(|(word, _)| *word));
    let missing = keys.into_iter().filter(|key| !begun(key)).chain(words.filter(|word| !named(word)));
    missing.chain(unchosen.map(|(_, word)| word)).map(String::from).collect()
}

#[test]
fn every_load_layer_law_integrator_probe_and_region_is_tried() {
    assert_eq!(untried(&LINES), [""; 0], "scenes with these go into OWN");
    let without: Vec<String> = LINES.iter().filter(|line| !line.contains("follower")).cloned().collect();
    assert_eq!(untried(&without), ["follower"], "the counter-test");
    let without: Vec<String> = LINES.iter().filter(|line| !line.contains("\"spin\"")).cloned().collect();
    assert_eq!(untried(&without), ["spin"], "the counter-test");
}

#[test]
fn bytes_that_are_no_scene_are_refused_with_words() {
    let folder = Folder::new();
    let path = folder.0.join("scene.toml");
    let bytes =
        prop_oneof![vec(any::<u8>(), 0..200), "[\\[\\]{}=\"'#.,a-z0-9\n -]{0,200}".prop_map(String::into_bytes)];
    tried(count(1), bytes, |bytes| {
        std::fs::remove_file(&path).ok(); // what overwrites an old file waits for the disk
        std::fs::write(&path, bytes).map_err(|e| e.to_string())?;
        match bounded(TO_READ, || scene::read(&path))? {
            Ok(_) => Err("it is no scene".into()),
            Err(error) => mends(&error.to_string(), "scene.toml"),
        }
    });
}
