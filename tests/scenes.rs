//! Every scene of the repository: it parses, README.md says what it shows, and its `[test]` form runs clean on the CPU path; the hard
//! cases in f32 too.

mod forms;

use cutis::scene::Scene;
use cutis::step::Platform;
use forms::{RESIDUAL, ROUNDED, files, folder, hard, passes, report_of, scene, test_form};

/// Runs a scene in f64 and asks for what every run must be and for the true residual that the scene wants.
fn run(name: &str, scene: &Scene) {
    let report = report_of(name, scene, &Platform::Cpu64).unwrap_or_else(|e| panic!("{e}"));
    passes(name, scene, &report).unwrap_or_else(|e| panic!("{e}"));
    // the tolerance of the recurrence, and what f64 loses to it
    let residual = report.solver.residual_true.expect("the last step is asked for it");
    assert!(residual <= 1.1 * scene.solver.tolerance, "{name}: true residual {residual:e}");
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
