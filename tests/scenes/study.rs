//! `cutis study`: each error is of the one thing that it names, and the files say what was run.

use cutis::error::{Error, Result};
use cutis::report::Refused;
use cutis::report::study::{Options, Row, Setting, Stop, Study, Trace, study};
use cutis::scene::{Element, Files, Integrator, Law, Material, Preconditioner, Scene, parse};
use cutis::step::Platform;
use std::path::{Path, PathBuf};

/// A block pressed on a quarter of its top.
const BLOCK: &str = r#"title = "A pressed block"

[time]
step_ms = 4.0
duration_s = 0.016
gravity_m_s2 = [0.0, 0.0, 0.0]

[solver]
preconditioner = "multigrid"
tolerance = 1e-2

[skin]
size_mm = [8.0, 8.0]
cells = [8, 8]
law = "corotational"

[[skin.layer]]
name = "dermis"
thickness_mm = 2.0
cells = 2
young_kpa = 100.0
poisson = 0.49
density_kg_m3 = 1100.0

[[boundary]]
region = "bottom"

[[load]]
pressure_kpa = 5.0
rectangle_mm = [[-2.0, -2.0], [2.0, 2.0]]

[[probe]]
name = "top"
kind = "displacement"
point_mm = [0.0, 0.0, 2.0]

[[probe]]
name = "off"
kind = "displacement"
point_mm = [0.3, 0.0, 2.0]
"#;

const AXES: &str = r#"
[study]
probes = ["top"]
laws = ["bbar", "plain"]
preconditioners = ["jacobi", "direct"]
tolerances = [1e-1, 1e-4]
iterations = [3]
grids = [0.5, 1]
steps_ms = [4.0, 2.0]
quick_grid = 1
reference_grid = 2
reference_step_ms = 1.0
"#;

fn parsed(text: &str) -> Result<Scene> {
    parse(text, Path::new("scenes/block.toml"), &Files::Folder(PathBuf::new()))
}

fn with(axes: &str) -> Scene {
    parsed(&format!("{BLOCK}{axes}")).unwrap_or_else(|e| panic!("{e}"))
}

fn refusal(axes: &str) -> String {
    parsed(&format!("{BLOCK}{axes}")).expect_err("the table does not fit").to_string()
}

fn folder(name: &str) -> PathBuf {
    std::env::temp_dir().join(format!("cutis-study-{}-{name}", std::process::id()))
}

fn options(name: &str, quick: bool) -> Options {
    Options { gpu: None, quick, limit_s: 60.0, repeats: 1, out: folder(name) }
}

/// Runs a study, hands its files to `look`, and removes them.
fn studied(name: &str, scene: &Scene, quick: bool, look: impl Fn(&Study, &dyn Fn(&str) -> String)) {
    let options = options(name, quick);
    let mut last = 0.0;
    let result = study(scene, &options, &mut |p| {
        assert!(p.share >= last && p.share < 1.0 + 1e-9 && p.run < p.runs, "{p:?} after {last}");
        last = p.share;
    });
    let result = result.unwrap_or_else(|e| panic!("{e}"));
    // what fails has no last step
    assert!((last - 1.0).abs() < 1e-9 || !result.failed.is_empty(), "the work ends at its end: {last}");
    look(&result, &|file| std::fs::read_to_string(options.out.join(file)).expect("the study wrote it"));
    std::fs::remove_dir_all(&options.out).expect("it was made");
}

fn find(study: &Study, fits: impl Fn(&Setting) -> bool) -> &Row {
    study.rows.iter().find(|r| fits(&r.setting)).expect("it was run")
}

fn fem(element: Element) -> Law {
    Law::Fem { element, corotational: true }
}

/// Direct, hexahedra, grid × 1, the long step: nothing but grid and step is wrong of it.
fn exact(s: &Setting, element: Element, step: f64) -> bool {
    s.preconditioner == Preconditioner::Direct && s.law == fem(element) && s.refinement == 1.0 && s.step == step
}

#[test]
fn each_error_is_of_what_it_names() {
    studied("errors", &with(AXES), false, |study, _| {
        let of = |element, step| find(study, |s| exact(s, element, step));
        let (long, short) = (of(Element::Bbar, 4e-3), of(Element::Bbar, 2e-3));
        // solver and rounding: none of a factor in f64
        assert_eq!((long.error_solver, long.error_rounding), (Some(0.0), Some(0.0)));
        // implicit Euler is of first order; against the step of 1 ms the errors are as 3 to 1
        let ratio = long.error_step.unwrap() / short.error_step.unwrap();
        assert!((2.0..4.0).contains(&ratio), "steps of 4 and 2 ms: {ratio}");
        // plain hexahedra lock at ν 0.49 where B-bar does not; a coarser grid is worse
        let plain = of(Element::Plain, 4e-3).error_discretisation.unwrap();
        let bbar = long.error_discretisation.unwrap();
        assert!(plain > 3.0 * bbar && bbar > 0.0, "plain {plain}, B-bar {bbar}");
        let coarse = find(study, |s| {
            s.law == fem(Element::Bbar) && s.refinement == 0.5 && s.preconditioner == Preconditioner::Direct
        });
        assert!(coarse.error_discretisation.unwrap() > bbar);
        // a looser solve is a larger error of the solver, and three iterations are none at all
        let jacobi = |stop| {
            let fits = |s: &Setting| {
                s.preconditioner == Preconditioner::Jacobi
                    && s.stop == stop
                    && s.platform == Platform::Cpu64
                    && s.law == fem(Element::Bbar)
                    && s.refinement == 1.0
                    && s.step == 4e-3
            };
            find(study, fits)
        };
        let [loose, tight, three] = [Stop::Tolerance(1e-1), Stop::Tolerance(1e-4), Stop::Iterations(3)]
            .map(|s| jacobi(s).error_solver.unwrap());
        assert!(three > loose && loose > 10.0 * tight && tight > 0.0, "{three} {loose} {tight}");
        assert!(jacobi(Stop::Iterations(3)).trace.iterations <= 3.0);
        // f32 is wrong by rounding, and by nothing else more than its twin
        let single = find(study, |s| {
            s.platform == Platform::Cpu32 && s.stop == Stop::Tolerance(1e-4) && s.law == fem(Element::Bbar)
        });
        let rounding = single.error_rounding.unwrap();
        assert!(rounding > 0.0 && rounding < 1e-3, "{rounding}");
        // errors add up to no more than their sum
        for row in &study.rows {
            let parts = [row.error_discretisation, row.error_step, row.error_solver, row.error_rounding];
            let sum: f64 = parts.iter().map(|e| e.unwrap()).sum();
            assert!(row.error_total.unwrap() <= sum * (1.0 + 1e-9), "{row:?}");
        }
    });
}

#[test]
fn the_files_have_every_setting_once() {
    studied("files", &with(AXES), false, |study, read| {
        // elements × grids × steps × ((jacobi × 3 stops) × (f64, f32) + direct), and the scene's own
        assert_eq!(study.rows.len(), 2 * 2 * 2 * (3 * 2 + 1) + 1);
        let csv = read("study.csv");
        let lines: Vec<&str> = csv.lines().collect();
        assert_eq!(lines.len(), study.rows.len() + 1);
        let columns = "scene,element,preconditioner,tolerance,iteration_limit,iterations,grid,poisson,step_ms,integrator,correction,backend,\
                       precision,adapter,error_discretisation,error_solver,error_rounding,error_step,error_total,error_law,\
                       error_displacement,error_lateral,error_velocity,error_stress,error_force,ms_per_step,";
        assert!(lines[0].starts_with(columns), "{}", lines[0]);
        assert!(lines[0].ends_with(",pareto"), "{}", lines[0]);
        let mut settings: Vec<String> = study.rows.iter().map(|r| format!("{:?}", r.setting)).collect();
        settings.sort();
        settings.dedup();
        assert_eq!(settings.len(), study.rows.len(), "a setting was run twice");
        let json = study.to_json();
        assert_eq!(json[0]["preconditioner"], "multigrid", "the scene's own setting comes first");
        assert_eq!(json[0]["time_ratio"], 1.0);
        assert!(json.as_array().unwrap().iter().any(|row| row["pareto"] == 1.0));
        let page = read("study.md");
        assert!(page.contains("## The fastest setting within an error") && page.contains("study.svg"), "{page}");
        assert!(page.lines().filter(|l| l.contains("grid × ")).count() >= study.rows.len());
        let picture = read("study.svg");
        assert!(picture.starts_with("<svg") && picture.trim_end().ends_with("</svg>"));
        for label in ["bbar jacobi", "plain direct", "CPU f64", "CPU f32", "error, %"] {
            assert!(picture.contains(label), "{label}");
        }
    });
}

#[test]
fn a_quick_study_varies_one_thing_at_a_time() {
    studied("quick", &with(AXES), true, |study, _| {
        let own = &study.rows[0].setting;
        for row in &study.rows {
            let s = &row.setting;
            let differs = [
                s.law != own.law,
                s.preconditioner != own.preconditioner,
                s.stop != own.stop && s.stop != Stop::Exact,
                s.refinement != own.refinement,
                s.step != own.step,
                s.platform != own.platform,
            ];
            assert!(differs.iter().filter(|d| **d).count() <= 1 && s.refinement <= 1.0, "{s:?}");
        }
        assert_eq!(
            (study.rows.len(), study.left_out),
            (10, 0),
            "own, 1 element, 2 preconditioners, 3 stops, grid, step, f32"
        );
    });
}

#[test]
fn known_values_take_the_place_of_a_reference() {
    let scene = with("[study]\npreconditioners = [\"direct\"]\nsteps_ms = [4.0]\nknown = { top = -1e-4 }\n");
    studied("known", &scene, false, |study, _| {
        assert!(study.reference.contains("top = -0.0001"), "{}", study.reference);
        let row = find(study, |s| s.preconditioner == Preconditioner::Direct);
        let [found] = row.trace.samples[0][..] else { panic!("one value at the end: {:?}", row.trace.samples) };
        assert!((row.error_total.unwrap() - (found / -1e-4 - 1.0).abs()).abs() < 1e-12);
    });
}

#[test]
fn tables_that_do_not_fit_are_refused_with_their_line() {
    let cases = [
        ("[study]\nprobes = [\"tip\"]", "probes = \"tip\" is not known; did you mean \"top\"?"),
        ("[study]\nlaws = [\"bar\"]", "did you mean \"bbar\"?"),
        ("[study]\ntolerances = [1.5]", "wanted a number between 0 and 1"),
        ("[study]\ntolerances = []", "values of tolerances = 0"),
        ("[study]\niterations = [0]", "iterations = 0"),
        ("[study]\ngrids = [-1]", "wanted a finite number above 0"),
        ("[study]\nsteps_ms = [4, 3]", "a step of 3 ms is no whole part of the longest, 4 ms"),
        ("[study]\nreference_step_ms = 3", "a step of 3 ms is no whole part"),
        ("[study]\ntolerance = [1e-3]", "unknown key `tolerance`"),
        ("[study]\nknown = { tip = 1.0 }", "did you mean \"top\"?"),
        ("[study]\ncorrections = [\"exakt\"]", "did you mean \"exact\"?"),
        ("[study]\nintegrators = [\"newmrk\"]", "did you mean \"newmark\"?"),
        ("[study]\nknown = { top = 0.0 }", "errors are relative to it"),
        ("[study]\nreference_step_ms = 8", "8.0 must be at most the upper bound 4.0"),
        ("[study]\ngrids = [4]\nreference_grid = 2", "4.0 must be at most the upper bound 2.0"),
        ("[study]\nduration_s = 0", "wanted a finite number above 0"),
    ];
    let line = BLOCK.lines().count() + 1;
    for (axes, wanted) in cases {
        let message = refusal(axes);
        assert!(message.contains(wanted), "{axes}: {message}");
        let location = [line, line + 1, line + 2].map(|line| format!("scenes/block.toml:{line}: "));
        assert!(location.iter().any(|at| message.starts_with(at.as_str())), "{axes}: {message}");
    }
}

#[test]
fn grids_that_do_not_fit_are_refused_before_the_first_run() {
    let refused = |axes: &str| {
        let result = study(&with(axes), &options("refused", false), &mut |_| panic!("nothing is run"));
        let error = result.expect_err("it does not fit");
        assert!(matches!(error, Error::Report(Refused::Study { .. })) && error.exit_code() == 2, "{error}");
        error.to_string()
    };
    assert!(refused("[study]\nprobes = [\"top\"]\ngrids = [0.3]").contains("8 cells times it are 2.4"));
    // a probe's region that one grid has no node in; a point needs none
    let sphere = "\n[[probe]]\nname = \"spot\"\nkind = \"mean_displacement\"\nregion = \"sphere\"\ncentre_mm = [1, 0, 2]\nradius_mm = 0.1\n\n";
    assert!(refused(&format!("{sphere}[study]\ngrids = [0.5, 1]")).contains("grid 0.5: a region holds no node"));
    let mut large = with("");
    large.probes.truncate(1);
    large.skins[0].cells = [400, 400];
    let error = study(&large, &options("large", true), &mut |_| panic!("nothing is run")).expect_err("it is too large");
    assert!(error.to_string().contains("quick_grid"), "{error}");
    let mut bare = with("");
    bare.probes.clear();
    let error = study(&bare, &options("bare", false), &mut |_| {}).expect_err("there is nothing to compare");
    assert!(error.to_string().contains("nothing to study"), "{error}");
}

#[test]
fn steps_of_second_order_have_the_smaller_error_and_are_of_the_laws_that_they_fit() {
    let axes = "[study]\nprobes = [\"top\"]\npreconditioners = [\"direct\"]\nintegrators = [\"implicit_euler\", \"midpoint\"]\n\
                laws = [\"bbar\", \"neo_hookean\"]\n\
                steps_ms = [4.0, 2.0]\nreference_step_ms = 0.25\nreference_grid = 1\n";
    studied("integrators", &with(axes), false, |study, read| {
        let error = |integrator, step| {
            let fits = |s: &Setting| {
                s.integrator == integrator
                    && s.step == step
                    && s.preconditioner == Preconditioner::Direct
                    && matches!(s.law, Law::Hyperelastic(_))
            };
            find(study, fits).error_step.unwrap()
        };
        let first = [4e-3, 2e-3].map(|step| error(Integrator::ImplicitEuler, step));
        let second = [4e-3, 2e-3].map(|step| error(Integrator::Midpoint, step));
        assert!((1.6..2.6).contains(&(first[0] / first[1])), "first order: {first:?}");
        assert!(second[0] < 0.5 * first[0] && second[0] / second[1] > 2.8, "second order: {second:?}");
        assert!(read("study.csv").contains(",midpoint,"));
        let fits = |row: &Row| row.setting.integrator.fits(row.setting.law);
        assert!(study.failed.is_empty() && study.rows.iter().all(fits), "{:?}", study.failed);
    });
}

#[test]
fn repeated_runs_keep_the_faster_time() {
    let scene = with("[study]\nprobes = [\"top\"]\nreference_grid = 1\n");
    let options = Options { repeats: 3, ..options("repeats", false) };
    let (mut runs, mut most) = (0, 0);
    let result = study(&scene, &options, &mut |p| (runs, most) = (runs.max(p.run + 1), p.runs));
    std::fs::remove_dir_all(&options.out).expect("it was made");
    // own and f32, their exact twins at two steps, the reference by large strain, and two times more each of the first two
    let rows = result.unwrap_or_else(|e| panic!("{e}")).rows;
    assert_eq!((rows.len(), runs, most), (2, 9, 9));
    let trace = |ms| Trace { ms_per_step: ms, device_ms_per_step: Some(ms / 2.0), ..Trace::default() };
    let mut kept = trace(2.0);
    kept.keep_faster(&trace(3.0));
    assert_eq!(kept.ms_per_step, 2.0);
    kept.keep_faster(&trace(1.0));
    assert_eq!((kept.ms_per_step, kept.device_ms_per_step), (1.0, Some(0.5)));
}

#[test]
fn a_step_that_is_not_listed_is_compared_at_the_same_times() {
    let axes = "[study]\nprobes = [\"top\"]\npreconditioners = [\"direct\"]\nsteps_ms = [2.0, 1.0]\nreference_step_ms = 0.5\nreference_grid = 1\n";
    studied("unlisted", &with(axes), false, |study, _| {
        assert!(study.rows.iter().all(|row| row.trace.samples.len() == 4), "every 4 ms of 16");
        let of = |step| {
            let fits = |s: &Setting| s.step == step && s.preconditioner == Preconditioner::Direct;
            study.rows.iter().find(|r| fits(&r.setting)).and_then(|r| r.error_step)
        };
        let own = study.rows[0].error_step.unwrap();
        assert_eq!(study.rows[0].setting.step, 4e-3);
        assert!(own > of(2e-3).unwrap() && of(2e-3) > of(1e-3), "{own} {:?} {:?}", of(2e-3), of(1e-3));
    });
}

#[test]
fn what_cannot_run_is_told_and_the_rest_is_kept() {
    let axes =
        "[study]\nprobes = [\"top\"]\nintegrators = [\"implicit_euler\", \"symplectic_euler\"]\nreference_grid = 1\n";
    studied("failed", &with(axes), false, |study, read| {
        assert!(!study.rows.is_empty() && !study.failed.is_empty());
        assert!(study.failed.iter().all(|(s, _)| s.integrator == Integrator::SymplecticEuler));
        let told = study.failures().join("\n");
        assert!(told.contains("symplectic_euler") && told.contains("stable"), "{told}");
        assert!(read("study.md").contains("Not run: "));
    });
}

#[test]
fn a_run_beyond_the_limit_has_no_error_of_its_own() {
    let scene = with("[study]\nprobes = [\"top\"]\nreference_grid = 1\n");
    for (limit_s, steps) in [(1e-9, 1), (1e300, 4)] {
        let options = Options { limit_s, ..options("limit", false) };
        let result = study(&scene, &options, &mut |_| {});
        let page = std::fs::read_to_string(options.out.join("study.md")).expect("the study wrote it");
        std::fs::remove_dir_all(&options.out).expect("it was made");
        let rows = result.unwrap_or_else(|e| panic!("{e}")).rows;
        let whole = steps == 4;
        assert!(rows.iter().all(|r| r.trace.steps == steps && r.error_total.is_some() == whole), "{rows:?}");
        assert_eq!(page.contains("stopped at the time limit, step 1 of 4"), !whole, "{page}");
    }
}

#[test]
fn bodies_keep_their_own_hexahedra_in_the_scenes_own_setting() {
    let block = BLOCK
        .replace("[[skin.layer]]", "[[block.layer]]")
        .replace("[skin]", "[[block]]\nname = \"one\"\nposition_mm = [0, 0, 0]\nelement = \"bbar\"");
    let body = &block[block.find("[[block]]").unwrap()..block.find("[[boundary]]").unwrap()];
    let second = body.replace("\"one\"", "\"two\"").replace("[0, 0, 0]", "[50, 0, 0]").replace("bbar", "plain");
    let tables = &block[block.find("[[boundary]]").unwrap()..];
    let named = |table: &str, name: &str| {
        ["[[boundary]]", "[[load]]", "[[probe]]"]
            .iter()
            .fold(table.to_string(), |t, head| t.replace(head, &format!("{head}\nbody = \"{name}\"")))
    };
    let probes = named(tables, "two").replace("\"top\"", "\"top two\"").replace("\"off\"", "\"off two\"");
    let text = block.replace(tables, "") + &second + &named(tables, "one") + &probes;
    let study_of = |axes: &str| {
        let scene = parsed(&format!("{text}\n[study]\nprobes = [\"top\", \"top two\"]\nreference_grid = 1\n{axes}"));
        let scene = scene.unwrap_or_else(|e| panic!("{e}"));
        let options = options("bodies", false);
        let result = study(&scene, &options, &mut |_| {}).unwrap_or_else(|e| panic!("{e}"));
        std::fs::remove_dir_all(&options.out).expect("it was made");
        result
    };
    let last = |row: &Row| row.trace.samples.last().unwrap().clone();
    let own = last(&study_of("").rows[0]);
    assert!((own[1] / own[0]).abs() < 0.9, "the plain one locks: {own:?}");
    let both = study_of("laws = [\"plain\"]\n");
    let plain = both.rows.iter().find(|r| r.setting.law == fem(Element::Plain)).map(last).expect("it was run");
    assert!((plain[1] / plain[0] - 1.0).abs() < 0.05, "both lock: {plain:?}");
}

#[test]
fn the_error_of_the_law_is_against_large_strain_on_the_finest_grid() {
    // two fifths of the stiffness: small strain is far from it
    let axes = "[study]\nprobes = [\"top\"]\nlaws = [\"bbar\", \"neo_hookean\"]\npreconditioners = [\"multigrid\"]\ntolerances = [1e-6]\n\
                grids = [1, 2]\nsteps_ms = [4.0, 1.0]\nreference_grid = 2\nreference_step_ms = 1.0\n";
    let scene =
        parsed(&format!("{}{axes}", BLOCK.replace("pressure_kpa = 5.0", "pressure_kpa = 40.0"))).expect("it fits");
    studied("law", &scene, false, |study, read| {
        assert!(study.law.starts_with("neo_hookean on 2 times") && study.law.contains("16 × 16 × 4"), "{}", study.law);
        let of = |law| {
            find(study, |s| s.law == law && s.refinement == 2.0 && s.step == 1e-3 && s.platform == Platform::Cpu64)
        };
        let [small, large] = [fem(Element::Bbar), Law::Hyperelastic(Material::NeoHookean)].map(of);
        let error = |row: &Row| row.error_law.expect("the run by large strain ended");
        // on the reference's own grid and step nothing but the law is left of small strain, and of large strain nothing but its linear solves
        assert!(small.error_total.unwrap() < 1e-3 && error(small) > 0.05, "{small:?}");
        assert!(error(large) < 0.3 * error(small), "{large:?}");
        assert!(read("study.csv").lines().next().is_some_and(|head| head.contains(",error_law,")));
        assert!(read("study.md").contains("Errors against large strain"));
    });
    // of a scene of large strain it is the total error
    let large = BLOCK.replace("law = \"corotational\"", "law = \"neo_hookean\"");
    let scene = parsed(&format!("{large}[study]\nprobes = [\"top\"]\nreference_grid = 1\n")).expect("it fits");
    studied("large", &scene, false, |study, _| {
        assert!(study.rows.iter().all(|row| row.error_law.is_some() && row.error_law == row.error_total));
    });
    // springs have no law of large strain
    let springs = BLOCK
        .replace("law = \"corotational\"", "law = \"springs\"\nspring_stiffness_n_m = 100\nspring_damping_n_s_m = 0.1")
        .replace("young_kpa = 100.0\npoisson = 0.49\n", "")
        .replace("\"multigrid\"", "\"column\"");
    let scene = parsed(&format!("{springs}[study]\nprobes = [\"top\"]\nreference_grid = 1\n")).expect("it fits");
    studied("springs", &scene, false, |study, _| {
        assert!(study.law.starts_with("none") && study.rows.iter().all(|row| row.error_law.is_none()), "{}", study.law);
    });
}

#[test]
fn lateral_displacement_and_stress_are_measured_beside_the_total() {
    let beside = "[[probe]]\nname = \"aside\"\nkind = \"displacement\"\npoint_mm = [2, 0, 2]\naxis = \"x\"\n\
                  [[probe]]\nname = \"pressed\"\nkind = \"stress\"\npoint_mm = [0.5, 0.5, 1.5]\ncomponent = \"zz\"\n";
    let study_of = |name: &str, probes: &str, look: &dyn Fn(&Study)| {
        let scene = with(&format!("{beside}[study]\nprobes = {probes}\ngrids = [0.5, 1]\nreference_grid = 2\n"));
        studied(name, &scene, false, |study, read| {
            look(study);
            assert!(read("study.csv").contains("error_lateral") && read("study.md").contains("beside the total"));
        });
    };
    study_of("beside", "[\"top\"]", &|study| {
        assert_eq!((&study.signals[..], study.beside.len()), (&["top".to_string()][..], 3));
        for row in study.rows.iter().filter(|r| r.setting.refinement == 0.5) {
            let [displacement, lateral, velocity, stress, force] = row.by_kind;
            let [lateral, stress] = [lateral, stress].map(|e| e.expect("it is measured"));
            assert!(velocity.is_none() && force.is_none() && displacement.is_some(), "{row:?}");
            assert!(lateral > 0.02 && stress > 0.02, "a coarse grid shows it: {row:?}");
        }
    });
    // where the study names it, it counts
    let (mut alone, mut counted) = (0.0, 0.0);
    let total = |study: &Study| find(study, |s| s.refinement == 0.5).error_total.unwrap();
    for (name, probes, found) in [("alone", "[\"top\"]", &mut alone), ("both", "[\"top\", \"aside\"]", &mut counted)] {
        let cell = std::cell::Cell::new(0.0);
        study_of(name, probes, &|study| cell.set(total(study)));
        *found = cell.get();
    }
    assert!(counted > 1.1 * alone, "{counted} with it, {alone} without");
}

#[test]
fn where_nothing_is_near_the_nearest_is_named_with_what_its_error_is_made_of() {
    let axes = "[study]\nprobes = [\"top\"]\npreconditioners = [\"none\"]\niterations = [1]\nreference_grid = 1\n";
    let mut scene = with(axes);
    // one iteration of plain conjugate gradients, in the scene's own setting too
    (scene.solver.preconditioner, scene.solver.max_iterations) = (Preconditioner::None, 1);
    studied("nearest", &scene, false, |study, read| {
        let said = study.advice();
        assert_eq!(said.len(), 1, "{said:?}");
        for part in ["none is within 20 %; the nearest is", "the solver ", "by quantity: displacement "] {
            assert!(said[0].contains(part), "{said:?}");
        }
        assert!(read("study.md").contains("The nearest is "));
    });
    studied("near", &with("[study]\nprobes = [\"top\"]\nreference_grid = 1\n"), false, |study, _| {
        assert_eq!(study.advice().len(), 5);
    });
}
