//! Scene files: the shipped scenes, changed. What is accepted goes on, in a small grid: the model, what `inspect` says, two steps, a run.

use crate::bounds::{Folder, TO_READ, TO_RUN, bounded, count, mends, tried};
use crate::change::{change, changed};
use cutis::bodies::Model;
use cutis::error::Result;
use cutis::report::{inspect, run};
use cutis::scene::{self, Cut, Files, Scene};
use cutis::step::{Platform, Simulation};
use proptest::collection::vec;
use proptest::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

/// The shipped scenes: folder and text.
static SHIPPED: LazyLock<Vec<(PathBuf, String)>> = LazyLock::new(|| {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let mut all = vec![];
    for folder in [root.clone(), root.join("hard"), root.join("verify")] {
        let entries = std::fs::read_dir(&folder).expect("the scenes are there").flatten().map(|entry| entry.path());
        let scenes = entries.filter(|path| path.extension().is_some_and(|end| end == "toml"));
        all.extend(scenes.map(|path| (folder.clone(), std::fs::read_to_string(path).expect("it is text"))));
    }
    all.sort();
    assert!(all.len() > 20);
    all
});

static LINES: LazyLock<Vec<String>> = LazyLock::new(|| {
    SHIPPED.iter().flat_map(|(_, text)| text.lines()).filter(|l| !l.is_empty()).map(String::from).collect()
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
    /// The lines that the shipped scene does not have.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (_, shipped) = &SHIPPED[self.number];
        let title = shipped.lines().next().unwrap_or_default();
        write!(f, "luck {}, {title}, {} bytes of {}:", self.luck, self.text.len(), shipped.len())?;
        self.text.lines().filter(|line| !shipped.contains(line)).try_for_each(|line| write!(f, "\n    {line}"))
    }
}

fn inputs() -> impl Strategy<Value = Input> {
    let changes = (0..SHIPPED.len(), vec(change(&LINES), 0..6), 0u32..1024);
    changes.prop_map(|(number, changes, luck)| Input { number, text: changed(&SHIPPED[number].1, &changes), luck })
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
    tried(count(1), inputs(), |input| holds(&SHIPPED[input.number].0, &input.text, input.luck));
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
