//! Inputs that once were taken wrongly, each by its name.

use super::bounds::{TO_READ, bounded};
use super::scenes::holds;
use cutis::scene;
use cutis::step::{Platform, Simulation};
use std::path::Path;

/// A shipped scene with a line changed, and its folder.
fn shipped(name: &str, old: &str, new: &str) -> (std::path::PathBuf, String) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
    let text = std::fs::read_to_string(&path).expect("the scene is there");
    assert!(text.contains(old), "{name} has no `{old}`");
    (path.parent().expect("it is in a folder").to_path_buf(), text.replace(old, new))
}

/// What the program says of it.
fn refused(name: &str, old: &str, new: &str) -> String {
    let (folder, text) = shipped(name, old, new);
    let files = scene::Files::Folder(folder);
    let read = bounded(TO_READ, || scene::parse(&text, Path::new("scene.toml"), &files)).expect("within its bounds");
    read.err().map(|error| error.to_string()).unwrap_or_else(|| panic!("{new} is taken"))
}

#[test]
fn a_blade_of_any_number_of_samples_is_refused_before_they_are_made() {
    let found = refused("incision.toml", "flat_spacing_mm = 1.0", "flat_spacing_mm = 1e-12");
    assert!(found.contains("contact samples"), "{found}");
}

#[test]
fn a_mass_that_vanishes_in_f32_is_refused() {
    let found = refused("verify/incline_slide.toml", "mass_g = 100.0", "mass_g = 1e-308");
    assert!(found.contains("mass_g = 1e-308; wanted a finite number above 0"), "{found}");
}

#[test]
fn a_region_of_a_long_grid_is_looked_for_without_a_list_of_its_nodes() {
    let (folder, text) = shipped(
        "verify/sphere_press.toml",
        "region = \"bottom\"",
        "region = \"plane\"\nthrough_mm = [0, 0, 0]\nnormal = [0, 1, 0]\nwithin_mm = 1",
    );
    let cells = text.lines().find(|line| line.starts_with("cells = [")).expect("it has cells").to_string();
    let layer_cells =
        text.lines().filter(|line| line.starts_with("cells = ") && !line.contains('[')).collect::<Vec<_>>();
    let long = layer_cells
        .iter()
        .fold(text.replacen(&cells, "cells = [1, 6000000]", 1), |text, line| text.replace(line, "cells = 1"));
    // of cells that are not too slender
    let size = long.lines().find(|line| line.starts_with("size_mm = ")).expect("it has a size").to_string();
    let long = long.replacen(&size, "size_mm = [20, 60000]", 1);
    let test = long.find("\n[test]").map_or(long.clone(), |at| long[..at].to_string());
    let files = scene::Files::Folder(folder);
    bounded(TO_READ, || scene::parse(&test, Path::new("scene.toml"), &files))
        .expect("within 32 MB")
        .expect("it is a scene");
}

#[test]
fn a_tool_that_touches_with_nothing_is_carried_along() {
    let points = ["points_mm = []", ""].map(|points| {
        let (folder, text) = shipped("two_hands.toml", "points_mm = ", "# ");
        (folder, text.replacen("[[tool]]", &format!("[[tool]]\n{points}"), 1))
    });
    for (folder, text) in points {
        holds(&folder, &text, 0).unwrap_or_else(|found| panic!("{found}"));
    }
}

#[test]
fn a_tool_that_is_nowhere_ends_the_run() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/verify/incline_slide.toml");
    let scene = scene::read(&path).unwrap_or_else(|e| panic!("{e}"));
    let mut simulation = Simulation::new(&scene, &Platform::Cpu64).expect("the scene fits");
    simulation.tools[0].position.x = f64::NAN;
    let error = simulation.step(false).expect_err("it is nowhere");
    assert!(error.to_string().contains("the tool \"box\" is non-finite at"), "{error}");
    assert_eq!(error.exit_code(), 1);
    let mut simulation = Simulation::new(&scene, &Platform::Cpu64).expect("the scene fits");
    assert!(simulation.step(false).is_ok(), "the counter-test: where the scene puts it");
}

#[test]
fn a_load_beside_the_surface_is_told_where_to_go() {
    let found = refused(
        "skin_block.toml",
        "rectangle_mm = [[-2.0, -2.0], [2.0, 2.0]]",
        "region = \"sphere\"\ncentre_mm = [0, 0, 1.2]\nradius_mm = 0.1",
    );
    assert!(found.contains("; move the region onto the surface"), "{found}");
}
