//! Bad input: exit status and message, which says file, line, what was found, what was wanted.

use crate::work::{ALONE, PRESS, Work};
use crate::{Outcome, Test, ensure};

pub const TESTS: &[Test] = &[
    ("a_wrong_key_names_the_nearest", a_wrong_key_names_the_nearest),
    ("a_wrong_unit_names_the_right_key", a_wrong_unit_names_the_right_key),
    ("poisson_one_half_is_refused", poisson_one_half_is_refused),
    ("a_negative_thickness_is_refused", a_negative_thickness_is_refused),
    ("a_missing_mesh_is_named", a_missing_mesh_is_named),
    ("an_empty_trajectory_is_named", an_empty_trajectory_is_named),
    ("a_pose_that_is_no_number_is_named", a_pose_that_is_no_number_is_named),
    ("a_missing_scene_is_named", a_missing_scene_is_named),
    ("a_grid_beyond_all_indices_is_refused", a_grid_beyond_all_indices_is_refused),
    ("a_check_on_an_unknown_key_is_refused_before_the_run", a_check_on_an_unknown_key_is_refused_before_the_run),
    ("an_unknown_adapter_is_exit_3", an_unknown_adapter_is_exit_3),
    ("wrong_usage_is_exit_2", wrong_usage_is_exit_2),
    ("the_direct_solver_is_the_cpus", the_direct_solver_is_the_cpus),
    ("check_reads_every_scene", check_reads_every_scene),
];

/// The scene with one text replaced ends in exit status 2 and one line with all of `words`.
fn refused(from: &str, to: &str, words: &[&str]) -> Outcome {
    assert_eq!(PRESS.matches(from).count(), 1, "{from} once in the scene");
    let work = Work::with(&PRESS.replace(from, to))?;
    says(&work, &["run", "scene.toml"], 2, words)
}

fn says(work: &Work, arguments: &[&str], code: i32, words: &[&str]) -> Outcome {
    let said = work.cutis(arguments)?;
    ensure!(said.code == code, "{arguments:?}: exit status {}, wanted {code}: {}", said.code, said.err);
    // drivers may write lines of their own
    let message = said.err.lines().find(|line| words.iter().all(|word| line.contains(word)));
    ensure!(message.is_some(), "{arguments:?}: no line with {words:?} in: {}", said.err);
    ensure!(said.out.is_empty(), "{arguments:?}: wrote {}", said.out);
    Ok(())
}

/// Line of a text in the scene, from 1.
fn line(text: &str) -> String {
    let before = PRESS.lines().take_while(|line| !line.contains(text)).count();
    format!("scene.toml:{}:", before + 1)
}

fn a_wrong_key_names_the_nearest() -> Outcome {
    let at = line("young_kpa");
    refused("young_kpa", "yuong_kpa", &[&at, "`yuong_kpa`", "`young_kpa`"])
}

fn a_wrong_unit_names_the_right_key() -> Outcome {
    refused("thickness_mm", "thickness_m", &[&line("thickness_mm"), "`thickness_m`", "`thickness_mm`"])
}

fn poisson_one_half_is_refused() -> Outcome {
    refused("poisson = 0.4", "poisson = 0.5", &[&line("poisson"), "poisson = 0.5", "0 ≤ poisson ≤ 0.4999", "use 0.45"])
}

fn a_negative_thickness_is_refused() -> Outcome {
    refused("thickness_mm = 2.0", "thickness_mm = -2.0", &[&line("thickness_mm"), "-2.0", "wanted"])
}

fn a_missing_mesh_is_named() -> Outcome {
    refused("tip.obj", "top.obj", &[&line("tip.obj"), "top.obj", "cannot be read", "put the file there"])
}

fn an_empty_trajectory_is_named() -> Outcome {
    let work = Work::with(PRESS)?;
    work.write("hand.csv", "")?;
    says(&work, &["run", "scene.toml"], 2, &["hand.csv", "the trajectory is empty", "record the hand again"])
}

fn a_pose_that_is_no_number_is_named() -> Outcome {
    let work = Work::with(PRESS)?;
    work.write("hand.csv", &work.read("hand.csv")?.replace("1.7", "NaN"))?;
    says(&work, &["run", "scene.toml"], 2, &["hand.csv:3:", "z_mm = `NaN`", "wanted a finite number"])
}

fn a_missing_scene_is_named() -> Outcome {
    let work = Work::with(PRESS)?;
    says(&work, &["run", "nowhere.toml"], 2, &["nowhere.toml", "cannot be read", "give the path"])
}

fn a_grid_beyond_all_indices_is_refused() -> Outcome {
    let words = [&*line("cells = [4, 4]"), "nodes", "make cells fewer"];
    refused("cells = [4, 4]", "cells = [70000, 70000]", &words)?;
    refused("cells = [4, 4]", "cells = [8000, 8000]", &[&*line("cells = [4, 4]"), "192048003", "make cells fewer"])
}

fn a_check_on_an_unknown_key_is_refused_before_the_run() -> Outcome {
    let work = Work::with(&format!("{ALONE}\n[check]\n\"cut.lenght_mm\" = {{ min = 1.0 }}\n"))?;
    says(&work, &["scene.toml"], 2, &["scene.toml", "`cut.lenght_mm`", "cut.length_mm"])?;
    ensure!(!work.path("out").exists(), "the run began");
    Ok(())
}

fn an_unknown_adapter_is_exit_3() -> Outcome {
    let work = Work::with(PRESS)?;
    let words = ["no usable GPU adapter", "named like `no such thing`", "apt-get install", "--backend cpu"];
    for command in [&["run", "scene.toml", "--backend", "gpu"][..], &["compare", "scene.toml"], &["scene.toml"]] {
        let arguments = [command, &["--adapter", "no such thing"]].concat();
        says(&work, &arguments, 3, &words)?;
    }
    Ok(())
}

fn wrong_usage_is_exit_2() -> Outcome {
    let work = Work::with(PRESS)?;
    let cases: [(&[&str], &str); 8] = [
        (&["run", "--backend", "cuda"], "cuda"),
        (&["run", "--steps", "0"], "0"),
        (&["run", "--seconds", "0"], "--seconds"),
        (&["run", "--steps", "1", "--seconds", "1"], "cannot be used with"),
        (&["run", "--tolerance", "2"], "between 0 and 1"),
        (&["run", "scene.toml", "--backend", "gpu", "--precision", "f64"], "computes in f32"),
        (&["verify", "--adapter", "llvmpipe", "--precision", "f32"], "--adapter names a GPU"),
        (&["run", "scene.toml", "--backend", "cpu", "--adapter", "x"], "leave out --adapter"),
    ];
    for (arguments, word) in cases {
        says(&work, arguments, 2, &[word])?;
    }
    Ok(())
}

fn the_direct_solver_is_the_cpus() -> Outcome {
    let work = Work::with(&ALONE.replace("[skin]\n", "[solver]\npreconditioner = \"direct\"\n\n[skin]\n"))?;
    let words = ["direct solver runs on the CPU path", "--backend cpu", "multigrid"];
    says(&work, &["run", "scene.toml", "--backend", "gpu"], 2, &words)?;
    says(&work, &["run", "scene.toml", "--adapter", "any"], 2, &words)?;
    says(&work, &["inspect", "scene.toml"], 2, &words)?;
    let report = work.json(&["run", "scene.toml", "--frames", "0", "--json"], 0)?;
    ensure!(report["backend"] == "cpu" && report["solver"]["preconditioner"] == "direct", "{report}");
    ensure!(report["solver"]["iterations_max"] == 1, "{report}");
    Ok(())
}

fn check_reads_every_scene() -> Outcome {
    let work = Work::with(PRESS)?;
    work.write("bad.toml", &ALONE.replace("step_ms", "step_s"))?;
    let said = work.cutis(&["check", "bad.toml", "scene.toml"])?;
    ensure!(said.code == 2, "exit status {}", said.code);
    ensure!(said.err.contains("bad.toml:4: unknown key `step_s`"), "{}", said.err);
    ensure!(said.out == "scene.toml: valid: A blunt tip presses a block\n", "{}", said.out);
    let list = work.json(&["check", "--json", "scene.toml"], 0)?;
    ensure!(list[0]["valid"] == true, "{list}");
    Ok(())
}
