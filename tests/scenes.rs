//! Every scene of the repository: it parses, README.md says what it shows, and its `[test]` form runs clean on the CPU path.

use cutis::report::{self, run::Options};
use cutis::scene::{Scene, read};
use cutis::step::Place;
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
    scene.skins[0].cells = form.cells.unwrap_or(scene.skins[0].cells);
    scene.view.frames = 0;
    let all = report::run::whole(&scene);
    Some((scene, form.steps.unwrap_or(all)))
}

/// Runs a scene into a folder of its own and asks for what every run must be: no warning that
/// its `[check]` table does not bound (nodes that are not finite are one), the true
/// residual that the scene wants, and its `[check]` table.
fn run(name: &str, scene: &Scene, steps: u32) {
    let out =
        std::env::temp_dir().join(format!("cutis-scenes-{}-{}", std::process::id(), name.replace(['/', ' '], "-")));
    let options = Options { place: Place::Cpu64, steps: Some(steps), out: out.clone(), realtime: false, record: false };
    let summary = report::run::run(scene, &options, &mut |_| {}).unwrap_or_else(|e| panic!("{name}: {e}"));
    std::fs::remove_dir_all(&out).unwrap_or_else(|e| panic!("{}: {e}", out.display()));
    let report = summary.report;
    let asked = |warning: &str| scene.checks.iter().any(|c| c.key.strip_prefix("warnings.") == Some(warning));
    let unasked: Vec<_> = report.warnings.iter().filter(|(name, _)| !asked(name)).collect();
    assert!(unasked.is_empty(), "{name}: {unasked:?}");
    assert_eq!(report.steps, steps, "{name}");
    // the tolerance of the recurrence, and what f64 loses to it
    let residual = report.solver.residual_true.expect("the last step is asked for it");
    assert!(residual <= 1.1 * scene.solver.tolerance, "{name}: true residual {residual:e}");
    let failures = report::check::failures(scene, &report);
    let text: Vec<String> = failures.iter().map(ToString::to_string).collect();
    assert!(failures.is_empty(), "{name}: {}", text.join("; "));
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
    scene.skins[0].layers[0].poisson = 0.451;
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
