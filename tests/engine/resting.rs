//! Static steps of bodies that contacts or ties to other bodies alone hold: they bear the weight, and what has no balance is refused.

use cutis::error::Result;
use cutis::report::run::{Options, run};
use cutis::scene::{BodyId, Files, Scene, parse};
use cutis::step::{Platform, Simulation, StepReport};
use std::path::Path;

/// A block of 10 mm and 10 kPa in one static step, tied to a base or on a floor.
const BLOCK: &str = r#"title = "A block at rest"
[time]
step_ms = 5.0
duration_s = 0.005
integrator = "static"
[solver]
tolerance = 1e-4
[[block]]
name = "block"
position_mm = [0.0, 0.0, 0.0]
size_mm = [10.0, 10.0]
cells = [3, 3]
law = "corotational"
[[block.layer]]
name = "dermis"
thickness_mm = 10.0
cells = 3
young_kpa = 10.0
poisson = 0.4
density_kg_m3 = 1000.0
"#;

fn scene(more: &str) -> Scene {
    let text = format!("{BLOCK}{more}");
    parse(&text, Path::new("resting.toml"), &Files::Embedded(&[])).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

const WEIGHT: f64 = 1000.0 * 1e-6 * 9.81;
const FLOOR: &str = "[[plane]]\nname = \"floor\"\nthrough_mm = [0.0, 0.0, 0.0]\nnormal = [0.0, 0.0, 1.0]\n";
const FRICTION: &str = "[contact]\nfriction = 0.3\n";

/// Report of the first step, and how far the middle of the top has come down, m.
fn step(scene: &Scene) -> Result<(StepReport, f64)> {
    let mut simulation = Simulation::new(scene, &Platform::Cpu64)?;
    let report = simulation.step(true)?;
    let model = &simulation.bodies[0].model;
    let top = model.grid.nearest([0.0, 0.0, model.grid.thickness()]);
    let down = -simulation.bodies[0].snapshot()?.u[top][2];
    Ok((report, down))
}

#[test]
fn a_block_at_rest_on_a_floor_is_borne_by_it() {
    let (held, wanted) = step(&scene("[[boundary]]\nregion = \"bottom\"\n")).expect("it is held");
    assert!(held.warnings.is_empty() && wanted > 2e-6, "{wanted:e} m");
    let (report, down) = step(&scene(&format!("{FLOOR}{FRICTION}"))).expect("the floor holds it");
    let force = report.contact.force(BodyId::Deformable(0), None);
    println!("force {force} N, weight {WEIGHT} N; top {down:e} m down, {wanted:e} m where its bottom is held");
    assert!(report.warnings.is_empty(), "{:?}", report.warnings);
    assert!((force.z / WEIGHT - 1.0).abs() < 1e-3 && force.truncate().length() < 1e-3 * WEIGHT, "{force} N");
    // it may slide a little in growing wider
    assert!((0.9..1.3).contains(&(down / wanted)), "{down:e} m, {wanted:e} m");
    // one farther down as well, once it is there
    let (report, _) =
        step(&scene(&format!("{}{FRICTION}", FLOOR.replace("0.0, 0.0, 0.0", "0.0, 0.0, -50.0")))).expect("a floor");
    assert!((report.contact.force(BodyId::Deformable(0), None).z / WEIGHT - 1.0).abs() < 1e-3);
    // a finer one, with as many contacts as nodes
    let fine = |most: u32| {
        let mut scene = scene(&format!("{FLOOR}{FRICTION}"));
        scene.skins[0].cells = [6, 6];
        scene.contact.as_mut().expect("it has contact").max_contacts = most;
        step(&scene)
    };
    let (report, _) = fine(100).expect("the floor holds it");
    assert!((report.contact.force(BodyId::Deformable(0), None).z / WEIGHT - 1.0).abs() < 1e-3);
    // it tumbles on too few of them, which is said
    match fine(8) {
        Ok((report, _)) => assert!(report.warnings.contains_key("contacts_dropped"), "{:?}", report.warnings),
        Err(refused) => assert!(refused.to_string().contains("max_contacts"), "{refused}"),
    }
    // the counter-test: beside a wall there is no balance
    let far = FLOOR.replace("0.0, 0.0, 1.0", "1.0, 0.0, 0.0").replace("0.0, 0.0, 0.0", "-50.0, 0.0, 0.0");
    let refused = step(&scene(&format!("{far}{FRICTION}"))).expect_err("it falls").to_string();
    assert!(refused.contains("not in balance"), "{refused}");
}

#[test]
fn a_block_tied_to_another_one_hangs_on_it() {
    let base = r#"[[block]]
name = "base"
size_mm = [10.0, 10.0]
position_mm = [0.0, 0.0, 10.0]
cells = [3, 3]
law = "corotational"
[[block.layer]]
name = "dermis"
thickness_mm = 2.0
cells = 1
young_kpa = 10.0
poisson = 0.4
density_kg_m3 = 1000.0
[[boundary]]
region = "top"
body = "base"
[[attach]]
body = "block"
region = "top"
to = "base"
"#;
    let text = format!("{base}{FRICTION}");
    let (report, down) = step(&scene(&text)).expect("the tie holds it");
    let force = report.contact.force(BodyId::Deformable(0), Some(BodyId::Deformable(1)));
    println!("force {force} N, weight {WEIGHT} N, {down:e} m down");
    assert!(report.warnings.is_empty(), "{:?}", report.warnings);
    assert!((force.z / WEIGHT - 1.0).abs() < 1e-3 && (0.0..1e-4).contains(&down), "{force} N, {down:e} m");
}

/// One linear solve for a load as large as the modulus is no balance, however long the step; static steps and short ones are.
#[test]
fn a_step_far_beyond_its_linearisation_says_so() {
    let pressed = |integrator: &str, step_ms: &str, duration_s: &str| {
        let text = BLOCK.replace("corotational", "neo_hookean").replace("\"static\"", integrator);
        let text = text.replace("step_ms = 5.0", step_ms).replace("duration_s = 0.005", duration_s);
        let text = format!("{text}[[boundary]]\nregion = \"bottom\"\n[[load]]\npressure_kpa = 4.0\nregion = \"top\"\n");
        let scene = parse(&text, Path::new("pressed.toml"), &Files::Embedded(&[])).unwrap_or_else(|e| panic!("{e}"));
        let out = Path::new(env!("CARGO_TARGET_TMPDIR")).join("engine_pressed");
        let report =
            run(&scene, &Options::new(Platform::Cpu64, &out), &mut |_| {}).unwrap_or_else(|e| panic!("{e}")).report;
        println!("{integrator} {step_ms}: {:?} of the law, {:?}", report.solver.law_residual, report.warnings);
        assert!(report.solver.residual_true.is_some_and(|left| left < 1e-3), "the linear solve itself is done");
        report.warnings.get("step_beyond_linearisation").copied()
    };
    assert_eq!(pressed("\"implicit_euler\"", "step_ms = 1000000.0", "duration_s = 1000.0"), Some(1));
    assert_eq!(pressed("\"static\"", "step_ms = 1000000.0", "duration_s = 1000.0"), None);
    assert_eq!(
        pressed("\"implicit_euler\"", "step_ms = 2.0", "duration_s = 0.1"),
        None,
        "whatever its first steps leave"
    );
}

#[test]
fn a_static_tolerance_beyond_f32_is_refused_as_such() {
    let mut scene = scene("[[boundary]]\nregion = \"bottom\"\n");
    scene.solver.tolerance = 1e-10;
    let ends = |platform: &Platform| Simulation::new(&scene, platform).and_then(|mut s| s.step(true)).map(|_| ());
    let said = ends(&Platform::Cpu32).err().map(|e| e.to_string()).unwrap_or_default();
    assert!(said.contains("f32 may round to no less than that"), "{said}");
    assert!(ends(&Platform::Cpu64).is_ok(), "f64 reaches it");
}

#[test]
fn held_nodes_that_overlap_or_are_torn_from_their_ties_are_counted() {
    let moved = |region: &str, by: [f64; 3]| format!("[[boundary]]\nregion = \"{region}\"\ndisplacement_mm = {by:?}\n");
    let warned = |more: &str| step(&scene(&format!("{more}{FRICTION}"))).expect("it is held").0.warnings;
    // into the floor, of which the search reaches 0.5 mm
    let into = |z: f64| warned(&format!("{FLOOR}{}", moved("all", [0.0, 0.0, z])));
    let found = into(-2.0);
    assert!(found.get("held_overlap").is_some_and(|count| *count >= 16), "{found:?}");
    assert!(into(-0.4).is_empty(), "the counter-test: {:?}", into(-0.4));
    // away from where they are tied
    let tied = |x: f64| warned(&format!("{}[[attach]]\nregion = \"bottom\"\n", moved("bottom", [x, 0.0, 0.0])));
    let found = tied(1.0);
    assert!(found.get("held_apart").is_some_and(|count| *count >= 16), "{found:?}");
    assert!(tied(0.0).is_empty(), "the counter-test: {:?}", tied(0.0));
}

/// A sphere of 2 mm, pressed into a held block of cells as large as it and slid.
const PRESSED: &str = r#"title = "A sphere on large cells"
[time]
step_ms = 20.0
duration_s = 0.3
integrator = "static"
[solver]
tolerance = 1e-3
[skin]
size_mm = [12.0, 12.0]
cells = [6, 6]
[[skin.layer]]
name = "dermis"
thickness_mm = 4.0
cells = 3
young_kpa = 50.0
poisson = 0.45
density_kg_m3 = 1000.0
[[boundary]]
region = "bottom"
[[tool]]
name = "sphere"
path_mm = [[0.0, 1.5, 0.4, 6.1], [0.1, 1.5, 0.4, 5.0], [0.3, 3.0, 0.8, 5.0]]
mass_g = 20.0
inertia_g_mm2 = [80.0, 80.0, 80.0]
[tool.round]
radius_mm = 2.0
points_mm = [[0.0, 0.0, 0.0]]
[tool.coupling]
stiffness_n_m = 5000.0
[[probe]]
name = "borne"
kind = "reaction"
axis = "z"
region = "bottom"
"#;

#[test]
fn a_sphere_on_cells_as_large_as_it_finds_its_balance() {
    for (young, cells, law) in [(50, [6, 6], "neo_hookean"), (50, [7, 7], "neo_hookean"), (40, [6, 6], "linear")] {
        let text = PRESSED.replace("[6, 6]", &format!("{cells:?}\nlaw = \"{law}\""));
        let text = format!("{}{FRICTION}max_contacts = 100\n", text.replace("50.0", &format!("{young}.0")));
        let scene = parse(&text, Path::new("pressed.toml"), &Files::Embedded(&[])).expect("the scene is valid");
        let mut simulation = Simulation::new(&scene, &Platform::Cpu64).expect("it fits");
        for number in 1..=scene.time.steps() {
            let report = simulation.step(true).unwrap_or_else(|e| panic!("{young} kPa, {cells:?}, {law}: {e}"));
            assert!(report.warnings.keys().all(|name| *name == "strain_beyond_law"), "{:?}", report.warnings);
            // the hand bears what the block does, and the block's bottom its weight too
            let force = report.contact.on_tool[0];
            let hand = simulation.tools[0].hand(f64::from(number) * scene.time.step).0;
            let held = 5000.0 * (simulation.tools[0].position - hand);
            let weight = 1000.0 * 9.81 * 12e-3 * 12e-3 * 4e-3;
            let size = report.contact.largest_on_tools().max(weight);
            assert!((held.z - force[2]).abs() < 2e-3 * size, "{held} N, {force:?} N");
            assert!((report.probes[0] - force[2] - weight).abs() < 5e-3 * size, "{} N, {force:?} N", report.probes[0]);
        }
        assert!(simulation.tools[0].position.z < 5.2e-3, "{} m", simulation.tools[0].position);
    }
}
