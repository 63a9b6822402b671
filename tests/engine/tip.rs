//! A point with a radius presses as a ball does, whatever the cells and wherever it stands on them.

use cutis::scene::{Files, Scene, parse};
use cutis::step::{Platform, Simulation};
use std::path::Path;

const YOUNG: f64 = 20e3;
const POISSON: f64 = 0.3;
/// How far the tip is pressed into the block, m.
const PRESS: f64 = 0.05e-3;
/// m
const RADIUS: f64 = 1e-3;

/// A block of 16 × 16 × 8 mm, `cells` across, that a tip presses in the middle, moved by shares of a cell.
fn block(cells: u32, radius: f64, [x, y]: [f64; 2]) -> Scene {
    let side = 16.0 / f64::from(cells);
    let (x, y, half) = (x * side, y * side, cells / 2);
    let text = format!(
        r#"title = "A tip on a block"
[time]
step_ms = 20.0
duration_s = 0.5
gravity_m_s2 = [0.0, 0.0, 0.0]
[solver]
preconditioner = "multigrid"
tolerance = 1e-4
[skin]
size_mm = [16.0, 16.0]
cells = [{cells}, {cells}]
rayleigh_mass_per_s = 0.1
rayleigh_stiffness_s = 0.01
[[skin.layer]]
name = "gel"
thickness_mm = 8.0
cells = {half}
young_kpa = 20.0
poisson = 0.3
density_kg_m3 = 1000.0
[[boundary]]
region = "bottom"
[[tool]]
name = "tip"
mesh = "meshes/needle.obj"
points_mm = [[0.0, 0.0, 0.0]]
tip_radius_mm = {}
path_mm = [[0.0, {x}, {y}, 8.01], [0.2, {x}, {y}, 7.95]]
mass_g = 1.0
inertia_g_mm2 = [6000.0, 6000.0, 800.0]
[tool.coupling]
stiffness_n_m = 100000.0
damping_n_s_m = 100.0
[contact]
friction = 0.0
alarm_mm = 0.2
max_contacts = 8
"#,
        radius * 1e3
    );
    let files = Files::Folder(Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes"));
    parse(&text, Path::new("scenes/tip.toml"), &files).unwrap_or_else(|e| panic!("{e}"))
}

/// Force on the tip at rest, N.
fn force(scene: &Scene) -> f64 {
    let mut simulation = Simulation::new(scene, &Platform::Cpu64).expect("the scene fits");
    let mut last = 0.0;
    for _ in 0..scene.time.steps() {
        let report = simulation.step(false).expect("the CPU path has no device to fail");
        assert!(report.warnings.is_empty(), "at {} s: {:?}", report.time, report.warnings);
        last = report.contact.on_tool[0][2];
    }
    last
}

/// A node, the middle of an edge, the middle of a face.
const PLACES: [[f64; 2]; 3] = [[0.0, 0.0], [0.5, 0.0], [0.5, 0.5]];

fn spread(forces: [f64; 3]) -> f64 {
    let most = forces.iter().copied().fold(0.0, f64::max);
    1.0 - forces.iter().copied().fold(most, f64::min) / most
}

/// In the mean over Hertz's pressure a half space sinks by `3 F (1 − ν²) / (5 a E)`; this block's bottom, held eight radii down, makes it a few
/// percent stiffer.
#[test]
fn a_tip_with_a_radius_is_a_hertzian_disc_on_any_grid() {
    let hertz = 5.0 / 3.0 * RADIUS * YOUNG / (1.0 - POISSON * POISSON) * PRESS;
    let forces = [24, 32].map(|cells| PLACES.map(|at| force(&block(cells, RADIUS, at))));
    println!("{forces:?} N, Hertz {hertz} N");
    for of_grid in forces {
        assert!(spread(of_grid) < 0.02, "differs by where it stands: {of_grid:?} N");
        for force in of_grid {
            assert!((0.98..1.15).contains(&(force / hertz)), "{force} N, Hertz {hertz} N");
        }
    }
    let [coarse, fine] = forces.map(|of_grid| of_grid.iter().sum::<f64>());
    assert!((coarse / fine - 1.0).abs() < 0.02, "differs by the grid: {forces:?} N");
}

/// The counter-test: a point without extent feels the cells, not the block.
#[test]
fn a_point_without_a_radius_feels_the_cells() {
    let forces = [16, 24].map(|cells| PLACES.map(|at| force(&block(cells, 0.0, at))));
    println!("{forces:?} N");
    assert!(forces.iter().all(|of_grid| spread(*of_grid) > 0.4), "{forces:?} N");
    let [coarse, fine] = forces.map(|of_grid| of_grid.iter().sum::<f64>());
    assert!(coarse / fine > 1.3, "{forces:?} N");
}

/// Of a steady press: with the forces of the last step in place of predicted ones, each of its steps took two passes.
#[test]
fn forces_of_a_steady_press_are_predicted_within_a_pass() {
    let mut scene = block(16, RADIUS, [0.0, 0.0]);
    (scene.time.step, scene.time.duration) = (5e-3, 0.1);
    let end = &mut scene.tools[0].trajectory[1];
    (end.time, end.position[2]) = (0.1, 7.84e-3);
    let mut simulation = Simulation::new(&scene, &Platform::Cpu64).expect("the scene fits");
    let contact = |_| simulation.step(false).expect("the CPU path has no device to fail").contact;
    let steps: Vec<_> = (0..20).map(contact).skip(2).collect();
    assert!(steps.iter().all(|contact| contact.on_tool[0][2] > 1e-3), "the tip presses in each of them");
    let passes: Vec<u32> = steps.iter().map(|contact| contact.passes).collect();
    assert!(passes.iter().all(|passes| *passes <= 1), "{passes:?}");
}

#[test]
fn a_radius_of_no_point_is_refused() {
    let text = "[skin]\nsize_mm = [8.0, 8.0]\ncells = [4, 4]\n[[skin.layer]]\nname = \"gel\"\nthickness_mm = 2.0\ncells = 1\n\
        young_kpa = 20.0\npoisson = 0.3\ndensity_kg_m3 = 1000.0\n[[tool]]\nname = \"ball\"\ntip_radius_mm = 1.0\nmass_g = 1.0\n\
        inertia_g_mm2 = [1.0, 1.0, 1.0]\npath_mm = [[0.0, 0.0, 0.0, 9.0]]\n[tool.round]\nradius_mm = 1.0\npoints_mm = [[0.0, 0.0, 0.0]]\n";
    let text = format!("title = \"t\"\n[time]\nstep_ms = 5.0\nduration_s = 0.1\n{text}");
    let files = Files::Folder(Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes"));
    let error = parse(&text, Path::new("t.toml"), &files).err().map(|e| e.to_string()).unwrap_or_default();
    assert!(error.contains("tip_radius_mm"), "{error}");
}
