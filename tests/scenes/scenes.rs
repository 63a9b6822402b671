//! Every scene of the repository: it parses, README.md says what it shows, and its `[test]` form runs clean on the CPU path; the hard
//! cases in f32 too.

use crate::forms::{RESIDUAL, ROUNDED, files, folder, hard, passes, report_of, scene, test_form};
use cutis::scene::{Law, Material, Scene};
use cutis::step::Platform;

/// Runs a scene in f64 and asks for what every run must be and for the true residual that the scene wants.
fn run(name: &str, scene: &Scene) {
    let report = report_of(name, scene, &Platform::Cpu64).unwrap_or_else(|e| panic!("{e}"));
    passes(name, scene, &report).unwrap_or_else(|e| panic!("{e}"));
    // the tolerance of the recurrence, of unconstrained motion and correction by contact each, and what f64 loses to it
    let residual = report.solver.residual_true.expect("the last step is asked for it");
    let solves = if scene.contact.is_some() { std::f64::consts::SQRT_2 } else { 1.0 };
    assert!(residual <= 1.1 * solves * scene.solver.tolerance, "{name}: true residual {residual:e}");
}

#[test]
fn every_scene_parses() {
    let found = files();
    assert!(found.len() >= 7, "scenes went missing: {found:?}");
    for (name, path) in found {
        assert!(!scene(&path).title.is_empty(), "{name}: no title");
    }
}

#[test]
fn every_test_form_runs_without_a_warning_and_passes_its_checks() {
    let mut ran = 0;
    for (name, path) in files() {
        if let Some(scene) = test_form(&path) {
            let start = std::time::Instant::now();
            run(&name, &scene);
            println!("{name}: {} steps in {:.1} s", scene.time.steps(), start.elapsed().as_secs_f64());
            ran += 1;
        }
    }
    assert!(ran >= 6, "only {ran} scenes have a [test] table");
}

#[test]
fn every_hard_case_passes_its_checks_in_f32() {
    let mut failed = vec![];
    for (name, scene) in hard() {
        let report = report_of(&name, &scene, &Platform::Cpu32);
        failed.extend(
            report
                .and_then(|report| {
                    passes(&name, &scene, &report)?;
                    let residual = report.solver.residual_true.unwrap_or(f64::NAN);
                    println!("{name}: true residual {residual:.1e} for {:e}", scene.solver.tolerance);
                    let warned = report.warnings.contains_key(RESIDUAL);
                    let known = warned || !ROUNDED.contains(&name.as_str());
                    if known {
                        Ok(())
                    } else {
                        Err(format!("{name} is listed as one that f32 leaves a residual of, and it does not"))
                    }
                })
                .err(),
        );
    }
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}

#[test]
fn a_failing_check_is_noticed() {
    let file = folder().join("verify/confined_column_045.toml");
    let mut scene = test_form(&file).expect("it has a [test] table");
    scene.skins[0].layers[0].poisson = 0.451;
    let outcome = std::panic::catch_unwind(|| run("a wrong column", &scene));
    let message = outcome.expect_err("0.001 of ν fails the check");
    assert!(message.downcast_ref::<String>().is_some_and(|m| m.contains("probes.top_reaction")));
}

#[test]
fn readme_has_one_entry_per_scene() {
    let text = std::fs::read_to_string(folder().join("README.md")).expect("scenes/README.md is there");
    let entries: Vec<&str> = text.lines().filter_map(|l| l.strip_prefix("- `")?.split('`').next()).collect();
    let names: Vec<String> = files().into_iter().map(|f| f.0).collect();
    for name in &names {
        let count = entries.iter().filter(|e| *e == name).count();
        assert_eq!(count, 1, "scenes/README.md: entries that start with - `{name}`");
    }
    for entry in entries {
        assert!(names.iter().any(|n| n == entry), "scenes/README.md: `{entry}` is no scene");
    }
}

/// A block above the origin, with these lines on its scene.
fn noted(gravity: &str, more: &str) -> Vec<String> {
    let text = format!(
        "title = \"a\"\n[time]\nstep_ms = 5\nduration_s = 0.1\ngravity_m_s2 = {gravity}\n{more}[skin]\nsize_mm = [10, 10]\ncells = [2, 2]\n\
         [[skin.layer]]\nname = \"a\"\nthickness_mm = 2\ncells = 1\nyoung_kpa = 50\npoisson = 0.4\ndensity_kg_m3 = 1000\n"
    );
    let made = cutis::scene::parse(&text, "noted.toml".as_ref(), &cutis::scene::Files::Embedded(&[]));
    made.unwrap_or_else(|e| panic!("{e}")).notes()
}

#[test]
fn what_floats_away_is_noted_and_what_floats_on_purpose_is_not() {
    let (down, none) = ("[0, 0, -9.81]", "[0, 0, 0]");
    let held = |axes: &str| format!("[[boundary]]\nregion = \"side_x_min\"\naxes = \"{axes}\"\n");
    let wall = |z: f64| format!("[[plane]]\nname = \"w\"\nthrough_mm = [0, 0, 0]\nnormal = [0, 0, {z}]\n");
    let under = "[[block]]\nname = \"b\"\nposition_mm = [0, 0, -5]\nsize_mm = [10, 10]\ncells = [2, 2]\n[[block.layer]]\nname = \"a\"\n\
                 thickness_mm = 2\ncells = 1\nyoung_kpa = 50\npoisson = 0.4\ndensity_kg_m3 = 1000\n";
    let fixed = format!("{under}[[boundary]]\nbody = \"b\"\nregion = \"bottom\"\n");
    let quiet = [
        (down, held("z")),
        (down, wall(1.0)),
        (down, fixed),
        (down, "[[rest_spring]]\nregion = \"top\"\nstiffness_n_m = 1\n".into()),
        (down, "[[attach]]\nregion = \"top\"\n".into()),
        (none, String::new()),
        (none, "[[load]]\npressure_kpa = 1\nregion = \"all\"\n".into()),
    ];
    for (gravity, more) in quiet {
        assert_eq!(noted(gravity, &more), [""; 0], "{more}");
    }
    let said = [
        (down, String::new(), 1, "gravity pulls"),
        (down, held("xy"), 1, "gravity pulls"),
        (down, wall(-1.0), 1, "put a [[plane]] under it"),
        (down, under.to_string(), 2, "nothing holds `b`"),
        (none, "[[load]]\npressure_kpa = 1\n".into(), 1, "its load pushes"),
    ];
    for (gravity, more, count, wanted) in said {
        let notes = noted(gravity, &more);
        assert!(notes.len() == count && notes.concat().contains(wanted), "{more}: {notes:?}");
    }
}

#[test]
fn a_duration_that_is_no_multiple_of_the_step_is_noted() {
    let still = |step: f64, duration: f64| {
        let time = cutis::scene::Time { step, duration, ..cutis::scene::Time::default() };
        Scene { time, ..Scene::default() }.notes()
    };
    let notes = still(3e-3, 0.1);
    assert!(notes.len() == 1 && notes[0].contains("33 steps and ends at 0.099 s"), "{notes:?}");
    // the counter-test: decimals that are none in binary
    for (step, duration) in [(5e-3, 0.1), (0.1e-3, 0.3), (7e-3, 0.7), (1e-3, 1e3)] {
        assert_eq!(still(step, duration), [""; 0], "{duration} / {step}");
    }
}

#[test]
fn a_load_that_is_in_no_step_is_noted() {
    let of = |start: f64, end: f64, integrator: &str| {
        let load = format!("[[load]]\npressure_kpa = 1\nregion = \"all\"\nstart_s = {start}\nend_s = {end}\n");
        noted("[0, 0, 0]", &format!("integrator = \"{integrator}\"\n{load}"))
    };
    for (start, end) in [(0.021, 0.024), (0.0201, 0.02499), (0.097, 1.0)] {
        let notes = of(start, end, "implicit_euler");
        assert!(notes.len() == 1 && notes[0].contains("in no step of 5 ms"), "{notes:?}");
    }
    assert_eq!(of(0.0, 0.004, "static").len(), 1, "no static step ends before 5 ms");
    assert_eq!(of(0.097, 1.0, "static"), [""; 0], "the last one ends at 0.1 s");
    // the counter-test: loads at the start of a step
    for (start, end) in [(0.0, 0.004), (0.02, 0.021), (0.021, 0.0251), (0.095, 1.0)] {
        assert_eq!(of(start, end, "implicit_euler"), [""; 0], "{start} to {end}");
    }
}

#[test]
fn nearly_incompressible_tetrahedra_are_noted() {
    let mut skin = scene(&folder().join("skin_tetra.toml"));
    let mut of = |poisson: f64, law: Option<Law>| {
        skin.skins[0].layers[0].poisson = poisson;
        skin.skins[0].law = law.unwrap_or(skin.skins[0].law);
        skin.notes()
    };
    assert!(of(0.49, None).is_empty());
    let notes = of(0.495, None);
    assert!(notes.len() == 1 && notes[0].contains("0.495") && notes[0].contains("hexahedra"), "{notes:?}");
    // hexahedra are for it
    assert!(of(0.495, Some(Law::Hyperelastic(Material::NeoHookean))).is_empty());
}

#[test]
fn a_blade_that_is_led_backward_is_noted() {
    let mut skin = scene(&folder().join("incision.toml"));
    assert_eq!(skin.notes(), [""; 0]);
    let blade = skin.tools[0].blade.as_mut().expect("a scalpel has one");
    blade.normal = blade.normal.map(|c| -c);
    let notes = skin.notes();
    assert!(notes.len() == 1 && notes[0].contains("`scalpel` is led backward"), "{notes:?}");
}

#[test]
fn scenes_of_the_repository_have_no_notes() {
    for (name, path) in files() {
        let notes = scene(&path).notes();
        assert!(notes.is_empty() || name.starts_with("hard/"), "{name}: {notes:?}");
        notes.iter().for_each(|note| println!("{name}: {note}"));
    }
}
