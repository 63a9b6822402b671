//! Every scene of the repository: it parses, README.md says what it shows, and its `[test]` form runs clean on the CPU path.

use cutis::scene::{Scene, read};
use cutis::step::{Place, Simulation, StepReport};
use std::path::{Path, PathBuf};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes")
}

/// Every `*.toml` under scenes/, sorted, with its path from there.
fn files() -> Vec<(String, PathBuf)> {
    let mut open = vec![folder()];
    let mut found = vec![];
    while let Some(folder) = open.pop() {
        for entry in std::fs::read_dir(&folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display())) {
            let path = entry.expect("the folder can be listed").path();
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|e| e == "toml") {
                found.push(path);
            }
        }
    }
    found.sort();
    let name = |p: &Path| p.strip_prefix(self::folder()).expect("it was found there").display().to_string();
    found.into_iter().map(|p| (name(&p).replace('\\', "/"), p)).collect()
}

fn scene(path: &Path) -> Scene {
    read(path).unwrap_or_else(|e| panic!("{e}"))
}

/// The scene with the cells of its `[test]` table, and the steps to run.
fn test_form(mut scene: Scene) -> Option<(Scene, u32)> {
    let form = scene.test?;
    scene.skin.cells = form.cells.unwrap_or(scene.skin.cells);
    let all = (scene.time.duration / scene.time.step).round() as u32;
    Some((scene, form.steps.unwrap_or(all)))
}

/// The scene's `[check]` table after the last step: bounds on probes. Keys of the run's report are evaluated where the report is made.
fn evaluate_checks(name: &str, scene: &Scene, last: &StepReport) {
    for check in &scene.checks {
        let Some(probe) = check.key.strip_prefix("probes.") else {
            continue;
        };
        let index = scene.probes.iter().position(|p| p.name == probe).expect("the reader checked the name");
        let value = last.probes[index];
        let inside = value >= check.min && value <= check.max;
        assert!(inside, "{name}: {} = {value:e}, wanted {:e} to {:e}", check.key, check.min, check.max);
    }
}

fn run(name: &str, scene: &Scene, steps: u32) {
    let mut simulation = Simulation::new(scene, &Place::Cpu64).unwrap_or_else(|e| panic!("{name}: {e}"));
    let mut last = StepReport::default();
    for step in 1..=steps {
        last = simulation.step(step == steps).unwrap_or_else(|e| panic!("{name}, step {step}: {e}"));
        assert!(last.warnings.is_empty(), "{name}, step {step}: {:?}", last.warnings);
    }
    let state = simulation.snapshot().unwrap_or_else(|e| panic!("{name}: {e}"));
    assert!(state.u.iter().chain(&state.v).flatten().all(|c| c.is_finite()), "{name}: not finite");
    // the tolerance of the recurrence, and what f64 loses to it
    let residual = last.true_residual.expect("the last step was asked for it");
    assert!(residual <= 1.1 * scene.solver.tolerance, "{name}: true residual {residual:e}");
    evaluate_checks(name, scene, &last);
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
        if let Some((scene, steps)) = test_form(scene(&path)) {
            let start = std::time::Instant::now();
            run(&name, &scene, steps);
            println!("{name}: {steps} steps in {:.1} s", start.elapsed().as_secs_f64());
            ran += 1;
        }
    }
    assert!(ran >= 6, "only {ran} scenes have a [test] table");
}

#[test]
fn a_failing_check_is_noticed() {
    let (mut scene, steps) =
        test_form(scene(&folder().join("verify/confined_column_045.toml"))).expect("it has a [test] table");
    scene.skin.layers[0].poisson = 0.451;
    let outcome = std::panic::catch_unwind(|| run("a wrong column", &scene, steps));
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
