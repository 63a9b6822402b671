//! Runs of small scenes and what they leave.

use crate::work::{ALONE, PRESS, Work};
use crate::{Outcome, Test, ensure};
use serde_json::Value;

pub const TESTS: &[Test] = &[
    ("a_run_leaves_every_file", a_run_leaves_every_file),
    ("the_report_has_every_key", the_report_has_every_key),
    ("meshes_read_back", meshes_read_back),
    ("options_override_the_scene", options_override_the_scene),
    ("both_precisions_agree", both_precisions_agree),
    ("a_failed_check_is_exit_1", a_failed_check_is_exit_1),
    ("a_run_by_the_wall_clock_says_what_the_clock_has_shown", a_run_by_the_wall_clock_says_what_the_clock_has_shown),
    ("a_run_cut_short_skips_checks_and_says_so", a_run_cut_short_skips_checks_and_says_so),
    ("files_of_an_earlier_run_go", files_of_an_earlier_run_go),
    ("an_unwritable_folder_is_exit_1", an_unwritable_folder_is_exit_1),
    ("a_scene_without_contact_has_nothing_of_contact", a_scene_without_contact_has_nothing_of_contact),
    ("the_incision_inside_is_the_one_in_scenes", the_incision_inside_is_the_one_in_scenes),
    ("help_names_the_commands_of_their_page", help_names_the_commands_of_their_page),
    ("a_study_leaves_its_three_files", a_study_leaves_its_three_files),
];

pub const GPU_TESTS: &[Test] = &[
    ("inspect_lists_what_the_gpu_holds", inspect_lists_what_the_gpu_holds),
    ("an_array_beyond_a_binding_is_refused", an_array_beyond_a_binding_is_refused),
    ("both_paths_agree", both_paths_agree),
    ("auto_takes_hardware_or_the_cpu", auto_takes_hardware_or_the_cpu),
];

const RUN: &[&str] = &["run", "scene.toml", "--backend", "cpu", "--json"];

/// Keys that DESIGN.md asks for, and the ones added since.
const KEYS: &str = "scene backend adapter driver nodes hexes tets springs dof step_s steps error wall_s step_ms.median step_ms.p99 \
    step_ms.max costs.columns.mean costs.columns.p99 costs.columns.max costs.passes.mean costs.passes.p99 costs.passes.max costs.iterations.mean \
    costs.iterations.p99 costs.iterations.max costs.row_updates.mean costs.row_updates.p99 costs.row_updates.max costs.cut_tests.mean \
    costs.cut_tests.p99 costs.cut_tests.max costs.search_ms.mean costs.search_ms.p99 costs.search_ms.max costs.free_ms.mean \
    costs.free_ms.p99 costs.free_ms.max costs.columns_ms.mean costs.columns_ms.p99 costs.columns_ms.max costs.corrections_ms.mean \
    costs.corrections_ms.p99 costs.corrections_ms.max costs.laws_ms.mean costs.laws_ms.p99 costs.laws_ms.max costs.hand_over_ms.mean costs.hand_over_ms.p99 costs.hand_over_ms.max costs.cut_ms.mean \
    costs.cut_ms.p99 costs.cut_ms.max costs.other_ms.mean costs.other_ms.p99 costs.other_ms.max \
    solver.kind solver.preconditioner solver.iterations_mean solver.iterations_max solver.newton_iterations_max solver.sums solver.refinements \
    solver.at_floor solver.residual_max solver.residual_true solver.law_residual energy_j.start energy_j.max energy_j.end energy_j.kinetic.start \
    energy_j.kinetic.max energy_j.kinetic.end energy_j.elastic.start energy_j.elastic.max energy_j.elastic.end energy_j.potential.start \
    energy_j.potential.max energy_j.potential.end energy_j.work_in.loads energy_j.work_in.hands energy_j.work_in.overlaps \
    energy_j.dissipated.friction energy_j.dissipated.cutting energy_j.dissipated.impact energy_j.dissipated.damping energy_j.dissipated.numerical \
    inverted_cells_max contacts_max contact_force_n_max contact.passes_mean contact.passes_max \
    contact.residual_n_max contact.residual_m_max contact.candidates_max contact.depth_mm_max haptic.rate_hz \
    haptic.period_us.p50 haptic.period_us.p99 haptic.period_us.p99_9 haptic.period_us.max \
    haptic.tick_us.p50 haptic.tick_us.p99 haptic.tick_us.p99_9 haptic.tick_us.max haptic.coupling_age_ms.p50 haptic.coupling_age_ms.p99 \
    haptic.coupling_age_ms.p99_9 haptic.coupling_age_ms.max haptic.missed haptic.records_lost haptic.device_faults haptic.late_steps haptic.behind_ms haptic.shortened_steps haptic.shortened_n_max \
    haptic.shortened_mm_max haptic.old_share haptic.sweeps_max \
    haptic.out_of_time haptic.unsound haptic.non_finite haptic.late_ticks haptic.stale_ticks haptic.clamped haptic.fades haptic.stops \
    haptic.force_n_max haptic.force_jump_n_max haptic.cut_jump_n haptic.energy_out_j haptic.energy_uncontrolled_j haptic.energy_damped_j \
    cut.hexes_removed cut.removed_mm3 cut.tets_removed cut.springs_removed cut.links_severed cut.links_held cut.node_copies cut.pieces cut.nonmanifold_edges \
    cut.area_mm2 cut.length_mm cut.length_top_mm cut.depth_mm cut.opening_mm_max cut.overlap_mm_max warnings memory_bytes.device memory_bytes.host probes.top probes.bed";

fn keys(prefix: &str, tree: &Value, found: &mut Vec<String>) {
    match tree.as_object() {
        Some(map) if !map.is_empty() => {
            for (name, value) in map {
                keys(&format!("{prefix}.{name}"), value, found);
            }
        }
        _ => found.push(prefix.trim_start_matches('.').to_string()),
    }
}

fn names(list: &Value) -> Vec<String> {
    let name = |v: &Value| v.as_str().or(v["name"].as_str()).unwrap_or_default().to_string();
    list.as_array().map(|list| list.iter().map(name).collect()).unwrap_or_default()
}

fn a_run_leaves_every_file() -> Outcome {
    let work = Work::with(PRESS)?;
    let said = work.cutis(&["scene.toml", "--backend", "cpu"])?;
    ensure!(said.code == 0, "exit status {}: {}", said.code, said.err);
    ensure!(said.out.lines().count() == 5, "not five lines: {}", said.out);
    for word in
        ["32 cells, 75 nodes, 5 steps of 5 ms", "ms per step", "true residual", "peak force", "2 pictures in out"]
    {
        ensure!(said.out.contains(word), "no `{word}` in {}", said.out);
    }
    let probes = work.read("out/probes.csv")?;
    ensure!(probes.starts_with("time_s,top_m,bed_n,contacts,contact_force_n,links_cut\n"), "{probes}");
    ensure!(probes.lines().count() == 6, "{probes}");
    let ticks = work.read("out/haptic.csv")?;
    ensure!(ticks.lines().count() == 26, "{} ticks", ticks.lines().count() - 1);
    let force = |row: &str| row.split(',').nth(10).and_then(|c| c.parse::<f64>().ok()).unwrap_or(f64::NAN);
    let largest = ticks.lines().skip(1).map(force).fold(0.0, f64::max);
    ensure!(largest > 0.01, "no force on the hand: {largest} N");
    for number in ["0001", "0002"] {
        let file = work.path(&format!("out/frames/frame_{number}.png"));
        let decoder = png::Decoder::new(std::io::BufReader::new(std::fs::File::open(file).map_err(|e| e.to_string())?));
        let info = decoder.read_info().map_err(|e| e.to_string())?;
        ensure!(info.info().size() == (96, 64), "{:?}", info.info().size());
    }
    for name in ["volume", "surface"] {
        let series = work.read(&format!("out/{name}.pvd"))?;
        ensure!(series.contains("timestep=\"0.015\"") && series.contains("timestep=\"0.025\""), "{series}");
        ensure!(series.contains(&format!("vtu/{name}_0002.vtu")), "{series}");
    }
    Ok(())
}

fn the_report_has_every_key() -> Outcome {
    let work = Work::with(PRESS)?;
    let printed = work.json(RUN, 0)?;
    let written: Value = serde_json::from_str(&work.read("out/report.json")?).map_err(|e| e.to_string())?;
    ensure!(printed == written, "printed and written reports differ");
    let (mut found, mut wanted) = (vec![], KEYS.split_whitespace().map(String::from).collect::<Vec<_>>());
    keys("", &written, &mut found);
    found.sort();
    wanted.sort();
    ensure!(found == wanted, "found {found:?}");
    for (key, value) in [
        ("/nodes", 75.0),
        ("/hexes", 32.0),
        ("/dof", 150.0),
        ("/steps", 5.0),
        ("/cut/pieces", 1.0),
        ("/cut/nonmanifold_edges", 0.0),
        ("/haptic/rate_hz", 1000.0),
    ] {
        ensure!(written.pointer(key).and_then(Value::as_f64) == Some(value), "{key}: {written}");
    }
    let number = |key: &str| written.pointer(key).and_then(Value::as_f64).unwrap_or(f64::NAN);
    let (candidates, depth) = (number("/contact/candidates_max"), number("/contact/depth_mm_max"));
    ensure!((2.0..=80.0).contains(&candidates) && (0.0..1.0).contains(&depth), "{candidates} faces, {depth} mm");
    ensure!(number("/contact_force_n_max") > 0.01 && number("/contacts_max") == 1.0, "{written}");
    ensure!(number("/solver/residual_true") < 2e-3, "{written}");
    ensure!(number("/probes/top") < -1e-5, "{written}");
    Ok(())
}

fn meshes_read_back() -> Outcome {
    let work = Work::with(PRESS)?;
    work.json(RUN, 0)?;
    for (name, cells, corners, points) in [("volume", 32, 8, 75), ("surface", 128, 3, 66)] {
        let path = work.path(&format!("out/vtu/{name}_0002.vtu"));
        let bytes = std::fs::read(&path).map_err(|e| e.to_string())?;
        let grid = cutis::formats::read_grid(&bytes, &path).map_err(|e| e.to_string())?;
        ensure!(grid.points.len() == points, "{name}: {} points", grid.points.len());
        let found = (grid.types.len(), grid.connectivity.len());
        ensure!(found == (cells, cells * corners), "{name}: {found:?} cells and ids");
        let fields = (grid.point_data.len(), grid.cell_data.len());
        let of_cells = if name == "surface" { 4 } else { 2 };
        ensure!(fields == (2, of_cells), "{name}: {fields:?} fields");
    }
    Ok(())
}

fn options_override_the_scene() -> Outcome {
    let work = Work::with(PRESS)?;
    let more =
        ["--seconds", "0.015", "--frames", "0", "--out", "there", "--preconditioner", "jacobi", "--tolerance", "1e-5"];
    let report = work.json(&[RUN, &more].concat(), 0)?;
    ensure!(report["steps"] == 3 && report["solver"]["preconditioner"] == "jacobi", "{report}");
    ensure!(report["solver"]["residual_true"].as_f64().is_some_and(|r| r < 2e-5), "{report}");
    ensure!(!work.path("there/frames").exists() && work.path("there/report.json").exists(), "wrong files");
    let report = work.json(&[RUN, &["--iterations", "1"]].concat(), 0)?;
    ensure!(report["warnings"]["solver_not_converged"].as_u64() > Some(0), "{report}");
    Ok(())
}

fn both_precisions_agree() -> Outcome {
    let work = Work::with(PRESS)?;
    let force = |precision: &str| -> Result<f64, String> {
        let report = work.json(&[RUN, &["--precision", precision]].concat(), 0)?;
        let told = report["adapter"].as_str().is_some_and(|a| a.ends_with(precision));
        ensure_told(told, &report)?;
        report["contact_force_n_max"].as_f64().ok_or("no force".into())
    };
    let (double, single) = (force("f64")?, force("f32")?);
    // both solves stop at 1e-3
    ensure!((double - single).abs() < 5e-3 * double, "{double} N and {single} N");
    Ok(())
}

fn ensure_told(told: bool, report: &Value) -> Outcome {
    ensure!(told, "the adapter does not name the precision: {report}");
    Ok(())
}

fn a_run_by_the_wall_clock_says_what_the_clock_has_shown() -> Outcome {
    let work = Work::with(PRESS)?;
    let report = work.json(&[RUN, &["--realtime", "--frames", "0"]].concat(), 0)?;
    let haptic = &report["haptic"];
    for key in [
        "/period_us/p50",
        "/tick_us/max",
        "/coupling_age_ms/p99",
        "/missed",
        "/records_lost",
        "/device_faults",
        "/late_steps",
        "/behind_ms",
        "/shortened_steps",
        "/shortened_n_max",
        "/shortened_mm_max",
    ] {
        ensure!(haptic.pointer(key).is_some_and(Value::is_number), "{key}: {haptic}");
    }
    let cores = std::thread::available_parallelism().map_err(|e| e.to_string())?.get();
    let said = work.cutis(&["scene.toml", "--backend", "cpu", "--realtime", "--frames", "0"])?.out;
    ensure!(said.lines().count() == 6 && said.contains("haptic loop at 1000 Hz: 99 of 100 periods within"), "{said}");
    let told = format!("{} threads", cores.saturating_sub(1).max(1));
    ensure!(report["adapter"].as_str().is_some_and(|a| a.starts_with(&told)), "{}", report["adapter"]);
    Ok(())
}

fn a_failed_check_is_exit_1() -> Outcome {
    let checks = "\n[check]\nsteps = { min = 5.0, max = 5.0 }\n\"probes.top\" = { min = 0.001 }\n\"haptic.missed\" = { max = 0 }\n";
    let work = Work::with(&format!("{PRESS}{checks}"))?;
    let said = work.cutis(&["scene.toml", "--backend", "cpu"])?;
    ensure!(said.code == 1, "exit status {}", said.code);
    let failed: Vec<&str> = said.err.lines().filter(|line| line.starts_with("check failed: ")).collect();
    ensure!(failed.len() == 2, "{failed:?}");
    let top = failed.iter().any(|line| line.contains("probes.top = -") && line.ends_with("wanted at least 0.001"));
    ensure!(top, "{failed:?}");
    ensure!(failed.iter().any(|line| line.contains("haptic.missed was not measured")), "{failed:?}");
    Ok(())
}

fn a_run_cut_short_skips_checks_and_says_so() -> Outcome {
    let work = Work::with(&format!("{ALONE}\n[check]\nsteps = {{ min = 5.0 }}\n"))?;
    let said = work.cutis(&["scene.toml", "--backend", "cpu", "--steps", "2"])?;
    ensure!(said.code == 0 && said.err.contains("were not evaluated"), "{}: {}", said.code, said.err);
    Ok(())
}

fn files_of_an_earlier_run_go() -> Outcome {
    let work = Work::with(PRESS)?;
    work.json(RUN, 0)?;
    work.write("out/frames/mine.png", "kept")?;
    work.write("scene.toml", ALONE)?;
    work.json(RUN, 0)?;
    for name in ["frames/frame_0002.png", "vtu/volume_0002.vtu", "haptic.csv"] {
        ensure!(!work.path("out").join(name).exists(), "{name} is still there");
    }
    ensure!(work.path("out/frames/mine.png").exists(), "a file of the user's is gone");
    Ok(())
}

fn an_unwritable_folder_is_exit_1() -> Outcome {
    let work = Work::with(ALONE)?;
    let said = work.cutis(&["scene.toml", "--backend", "cpu", "--out", "scene.toml"])?;
    ensure!(said.code == 1 && said.err.contains("scene.toml: cannot be written"), "{}: {}", said.code, said.err);
    Ok(())
}

fn a_scene_without_contact_has_nothing_of_contact() -> Outcome {
    let work = Work::with(ALONE)?;
    let plan = work.json(&["inspect", "scene.toml", "--json"], 0)?;
    let arrays = names(&plan["arrays"]);
    let contact = ["values", "tile_bounds"];
    let cut = ["ends", "rest", "quads", "hits", "hit_count", "point_u", "point_before"];
    let springs = ["law", "first", "half", "tangent"];
    let wrong: Vec<&&str> =
        contact.iter().chain(&cut).chain(&springs).filter(|n| arrays.iter().any(|a| a == *n)).collect();
    ensure!(wrong.is_empty(), "arrays {wrong:?}");
    let kernels = names(&plan["kernels"]);
    let needless = ["bounds", "scatter", "cut", "centres", "springs", "springs_product", "springs_blocks"];
    ensure!(!needless.iter().any(|n| kernels.iter().any(|k| k == n)), "kernels {kernels:?}");
    ensure!(names(&plan["read_backs"]) == ["solver"], "{}", plan["read_backs"]);
    ensure!(names(&plan["dispatches"]) == ["free motion", "solver"], "{}", plan["dispatches"]);
    let sizes = ["nodes", "cells", "springs", "dof", "right_hand_sides"].map(|k| plan[k].as_u64().unwrap_or(99));
    ensure!(sizes == [75, 32, 0, 150, 1], "{sizes:?}");
    // the counter-test: with a tool and a blade all of them are there
    let plan = work.json(&["inspect", "--json"], 0)?;
    let arrays = names(&plan["arrays"]);
    ensure!(contact.iter().chain(&cut).all(|n| arrays.iter().any(|a| a == n)), "{arrays:?}");
    for name in ["cut", "state"] {
        ensure!(names(&plan["read_backs"]).contains(&name.to_string()), "{}", plan["read_backs"]);
    }
    let kernels = names(&plan["kernels"]);
    ensure!(kernels.iter().any(|k| k == "bounds"), "kernels {kernels:?}");
    Ok(())
}

fn the_incision_inside_is_the_one_in_scenes() -> Outcome {
    let work = Work::with(ALONE)?;
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/incision.toml");
    let (mut inside, mut outside) =
        (work.json(&["inspect", "--json"], 0)?, work.json(&["inspect", "--json", file], 0)?);
    for plan in [&mut inside, &mut outside] {
        plan["scene"] = Value::Null;
    }
    ensure!(inside == outside, "{inside} {outside}");
    Ok(())
}

fn help_names_the_commands_of_their_page() -> Outcome {
    let said = Work::with(ALONE)?.cutis(&["--help"])?;
    ensure!(said.code == 0 && said.out.contains("--json") && said.out.contains("Exit status"), "{}", said.out);
    let listed = said.out.split("Commands:").nth(1).and_then(|rest| rest.split("\n\n").next()).unwrap_or_default();
    let mut listed: Vec<&str> = listed.lines().filter_map(|line| line.split_whitespace().next()).collect();
    listed.retain(|name| *name != "help");
    let page = include_str!("../../src/commands.md");
    let command = |line: &'static str| line.strip_prefix("| `cutis ")?.split([' ', '`']).next();
    let mut explained: Vec<&str> = page.lines().filter_map(command).collect();
    listed.sort_unstable();
    explained.sort_unstable();
    ensure!(listed == explained && listed.len() > 10, "{listed:?} {explained:?}");
    // the options of each row, but those of cargo
    let is_option =
        |word: &&str| word.starts_with("--") && word.len() > 3 && !["--release", "--features"].contains(word);
    for line in page.lines() {
        let Some(name) = command(line) else { continue };
        let said = Work::with(ALONE)?.cutis(&[name, "--help"])?;
        let words = line.split(|c: char| !c.is_ascii_lowercase() && c != '-').filter(is_option);
        let missing: Vec<&str> = words.filter(|word| !said.out.contains(word)).collect();
        ensure!(missing.is_empty(), "{missing:?} are no options of `{name}`");
    }
    Ok(())
}

fn a_study_leaves_its_three_files() -> Outcome {
    let work =
        Work::with(&format!("{PRESS}\n[study]\nprobes = [\"top\"]\ncorrections = [\"exact\", \"uncoupled\"]\n"))?;
    let rows = work.json(&["study", "scene.toml", "--quick", "--json", "--out", "s"], 0)?;
    let of = |key: &str| rows.as_array().map(|r| r.iter().map(|row| row[key].clone()).collect::<Vec<_>>());
    ensure!(of("precision") == Some(vec!["f64".into(), "f64".into(), "f32".into()]), "{rows}");
    let solver: Vec<f64> = of("error_solver").unwrap_or_default().iter().filter_map(Value::as_f64).collect();
    ensure!(solver.len() == 3 && solver[1] > 2.0 * solver[0], "uncoupled contact is worse than exact: {solver:?}");
    let table = work.read("s/study.csv")?;
    ensure!(table.lines().count() == 4 && table.contains("uncoupled"), "{table}");
    ensure!(work.read("s/study.md")?.contains("force on the tools"), "errors are of forces too");
    ensure!(work.read("s/study.svg")?.contains("</svg>"), "the picture is whole");
    let said = work.cutis(&["study", "scene.toml", "--quick", "--out", "s"])?;
    ensure!(said.code == 0 && said.out.contains("within 20 %"), "{} {}", said.out, said.err);
    ensure!(said.err.contains("s left"), "progress with the time left: {}", said.err);
    let said = work.cutis(&["study", "scene.toml", "--adapter", "no such adapter"])?;
    ensure!(said.code == 3, "exit status {} without the adapter: {}", said.code, said.err);
    Ok(())
}

fn inspect_lists_what_the_gpu_holds() -> Outcome {
    for scene in [PRESS, ALONE] {
        let work = Work::with(scene)?;
        let plan = work.json(&["inspect", "scene.toml", "--json"], 0)?;
        let report = work.json(&["run", "scene.toml", "--backend", "gpu", "--steps", "1", "--json"], 0)?;
        let (told, held) = (&plan["device_bytes"], &report["memory_bytes"]["device"]);
        ensure!(told == held && told.as_u64() > Some(1000), "{told} told, {held} held");
    }
    Ok(())
}

fn an_array_beyond_a_binding_is_refused() -> Outcome {
    let work = Work::with(PRESS)?;
    // 8 right-hand sides on 4001 × 4001 × 3 nodes: 6 GB in one array, refused before any is made
    work.write("scene.toml", &PRESS.replacen("cells = [4, 4]", "cells = [4000, 4000]", 1))?;
    let said = work.cutis(&["scene.toml", "--backend", "gpu"])?;
    ensure!(said.code == 2, "exit status {}: {}", said.code, said.err);
    for word in ["array `x`", "max_storage_buffer_binding_size", "use fewer cells or contacts"] {
        ensure!(said.err.contains(word), "no `{word}` in {}", said.err);
    }
    Ok(())
}

fn both_paths_agree() -> Outcome {
    let work = Work::with(PRESS)?;
    let result = work.json(&["compare", "scene.toml", "--steps", "5", "--json"], 0)?;
    ensure!(result["holds"] == true && result["rows"].as_array().map(Vec::len) == Some(6), "{result}");
    let said = work.cutis(&["compare", "scene.toml", "--steps", "2"])?;
    ensure!(said.out.contains("difference") && said.out.contains("peak contact force"), "{}", said.out);
    Ok(())
}

fn auto_takes_hardware_or_the_cpu() -> Outcome {
    let work = Work::with(ALONE)?;
    let list = work.json(&["adapters", "--json"], 0)?;
    let chosen: Vec<&Value> = list.as_array().into_iter().flatten().filter(|a| a["auto"] == true).collect();
    let report = work.json(&["scene.toml", "--steps", "1", "--frames", "0", "--json"], 0)?;
    ensure!(report["backend"] == if chosen.is_empty() { "cpu" } else { "gpu" }, "{list} {report}");
    ensure!(chosen.iter().all(|a| a["software"] == false), "{list}");
    Ok(())
}
