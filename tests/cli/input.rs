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
    ("numbers_out_of_range_say_what_was_wanted", numbers_out_of_range_say_what_was_wanted),
    ("a_mistyped_command_names_the_nearest", a_mistyped_command_names_the_nearest),
    ("errors_are_json_where_that_is_asked_for", errors_are_json_where_that_is_asked_for),
    ("too_many_threads_are_refused", too_many_threads_are_refused),
    ("steps_too_long_for_the_wall_clock_are_refused", steps_too_long_for_the_wall_clock_are_refused),
    ("errors_after_reading_name_their_line", errors_after_reading_name_their_line),
    ("positions_that_no_hand_reaches_are_refused", positions_that_no_hand_reaches_are_refused),
    ("a_file_that_is_not_utf8_names_its_first_bad_byte", a_file_that_is_not_utf8_names_its_first_bad_byte),
    ("pipes_and_devices_are_no_input", pipes_and_devices_are_no_input),
    ("control_characters_do_not_reach_the_terminal", control_characters_do_not_reach_the_terminal),
    ("a_hundred_thousand_probes_are_read_in_linear_time", a_hundred_thousand_probes_are_read_in_linear_time),
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

fn numbers_out_of_range_say_what_was_wanted() -> Outcome {
    let work = Work::with(PRESS)?;
    let cases: [(&[&str], &str); 10] = [
        (&["run", "--steps", "-5"], "-5 is not in 1.."),
        (&["run", "--frames", "-1"], "-1 is not in 0.."),
        (&["run", "--seconds", "-0.1"], "wanted seconds above 0"),
        (&["run", "--seconds", "soon"], "wanted seconds above 0"),
        (&["run", "--tolerance", "-1e-3"], "wanted a number between 0 and 1"),
        (&["study", "--limit", "-1"], "wanted seconds above 0"),
        (&["haply-mock", "--port", "-1"], "-1 is not in 0..=65535"),
        (&["haply-mock", "--device", ""], "wanted a name"),
        (&["haply-mock", "--grip", " "], "wanted a name"),
        (&["run", "scene.toml", "--seconds", "1e300"], "at most 4294967295 are counted"),
    ];
    cases.iter().try_for_each(|(arguments, word)| says(&work, arguments, 2, &[word]))
}

fn a_mistyped_command_names_the_nearest() -> Outcome {
    let work = Work::with(PRESS)?;
    says(&work, &["rnu", "scene.toml"], 2, &["no command and no scene file `rnu`; did you mean `cutis run`?"])?;
    says(&work, &["inspct"], 2, &["did you mean `cutis inspect`?"])?;
    says(&work, &["--backend", "cpu", "run", "scene.toml"], 2, &["before the command `run`", "cutis run"])?;
    // a scene may be called like that
    std::fs::rename(work.path("scene.toml"), work.path("rnu")).map_err(|e| e.to_string())?;
    let said = work.cutis(&["rnu", "--backend", "cpu", "--frames", "0", "--steps", "1"])?;
    ensure!(said.code == 0, "{}: {}", said.code, said.err);
    Ok(())
}

fn errors_are_json_where_that_is_asked_for() -> Outcome {
    let work = Work::with(&PRESS.replace("step_ms", "step_s"))?;
    for (arguments, code, word) in [
        (&["run", "scene.toml", "--json"][..], 2, "scene.toml:4: unknown key `step_s`"),
        (&["inspect", "scene.toml", "--json"], 2, "unknown key"),
        (&["run", "--steps", "0", "--json"], 2, "0 is not in 1.."),
        (&["--json", "run", "scene.toml"], 2, "before the command `run`"),
        (&["keys", "elephants", "--json"], 2, "no key of a scene has to do with"),
    ] {
        let object = work.json(arguments, code)?;
        let error = object["error"].as_str().unwrap_or_default();
        ensure!(error.contains(word) && !error.starts_with("error"), "{arguments:?}: {object}");
    }
    Ok(())
}

fn too_many_threads_are_refused() -> Outcome {
    let work = Work::with(PRESS)?;
    for command in ["run", "check", "compare", "inspect", "study", "mesh", "verify", "keys", "adapters"] {
        let mut cutis = std::process::Command::new(env!("CARGO_BIN_EXE_cutis"));
        cutis.arg(command).args(["scene.toml"].iter().filter(|_| !["verify", "keys", "adapters"].contains(&command)));
        let ran = cutis.current_dir(work.path(".")).env("RAYON_NUM_THREADS", "100000").output();
        let ran = ran.map_err(|e| e.to_string())?;
        let said = String::from_utf8_lossy(&ran.stderr).into_owned();
        ensure!(ran.status.code() == Some(2), "{command}: {}: {said}", ran.status);
        ensure!(said.contains("RAYON_NUM_THREADS=100000 asks for more threads than 4096"), "{command}: {said}");
    }
    Ok(())
}

fn steps_too_long_for_the_wall_clock_are_refused() -> Outcome {
    for (step_ms, duration_s) in [("1e22", "1e19"), ("1e23", "1e20"), ("61000.0", "61.0")] {
        let long = ALONE.replace("step_ms = 5.0", &format!("step_ms = {step_ms}"));
        let long = long.replace("= 0.025", &format!("= {duration_s}"));
        let work = Work::with(&long)?;
        let words = ["scene.toml:4: ", "with --realtime; at most 60 s", "leave out --realtime"];
        says(&work, &["run", "scene.toml", "--realtime", "--steps", "1", "--backend", "cpu"], 2, &words)?;
    }
    // a hand has no more ticks in a step than can be written
    let work = Work::with(&PRESS.replace("step_ms = 5.0", "step_ms = 1e7").replace("= 0.025", "= 1e5"))?;
    says(&work, &["check", "scene.toml"], 2, &["scene.toml:4: ", "has 1.000e7 ticks of 1000 Hz", "[haptic] rate_hz"])
}

/// Layer of the scene, as it stands there.
fn one_layer() -> &'static str {
    let [layer, boundary] = ["[[skin.layer]]", "[[boundary]]"].map(|table| ALONE.find(table).unwrap_or_default());
    &ALONE[layer..boundary]
}

fn positions_that_no_hand_reaches_are_refused() -> Outcome {
    let work = Work::with(PRESS)?;
    for (position, column, found) in
        [("1e308,0,0", "x_mm", "1e308"), ("0,-1e7,0", "y_mm", "-10000000.0"), ("0,0,1000001", "z_mm", "1000001.0")]
    {
        let hand = format!("time_s,x_mm,y_mm,z_mm,qx,qy,qz,qw\n0,0,0,2,0,0,0,1\n0.02,{position},0,0,0,1\n");
        work.write("hand.csv", &hand)?;
        for command in [&["run", "scene.toml"][..], &["check", "scene.toml"]] {
            says(
                &work,
                command,
                2,
                &["hand.csv:3: ", &format!("{column} = {found}; wanted "), "mend the value or remove the row"],
            )?;
        }
    }
    // as far as a path may go
    work.write("hand.csv", "time_s,x_mm,y_mm,z_mm,qx,qy,qz,qw\n0,0,0,2,0,0,0,1\n0.02,-1e6,1e6,1e6,0,0,0,1\n")?;
    let said = work.cutis(&["check", "scene.toml"])?;
    ensure!(said.code == 0, "{}", said.err);
    Ok(())
}

fn errors_after_reading_name_their_line() -> Outcome {
    let checks = "\n[check]\n\"cut.depth_mm\" = { min = 0 }\n\"steps_taken\" = { min = 1 }\n";
    let work = Work::with(&format!("{ALONE}{checks}"))?;
    let line = work.read("scene.toml")?.lines().count();
    says(&work, &["check", "scene.toml"], 2, &[&format!("scene.toml:{line}: [check] names `steps_taken`")])?;
    // a device that goes by the wall clock
    let points = "points_mm = [[0.0, 0.0, 0.0]]";
    let held = PRESS.replace(points, &format!("{points}\n\n[tool.device]\nkind = \"haply\""));
    let work = Work::with(&held)?;
    let at = held.lines().take_while(|line| *line != "[tool.device]").count() + 1;
    let run = ["run", "scene.toml", "--backend", "cpu"];
    says(&work, &run, 2, &[&format!("scene.toml:{at}: the tool \"tip\" is held by a haply device")])?;
    // a cell that is inverted from the start
    let inverted = "cells = [4, 4]\nlaw = \"neo_hookean\"\nstart = \"inside_out\"";
    let inverted = ALONE.replace("cells = [4, 4]", inverted).replace("[time]", "[time]\nintegrator = \"static\"");
    let work = Work::with(&inverted)?;
    says(
        &work,
        &run,
        2,
        &["scene.toml:5: cell [2, 1, 0]", "is inverted at the start of a step", "or take law = \"corotational\""],
    )?;
    // which is a law
    let law = ALONE.replace("cells = [4, 4]", "cells = [4, 4]\nlaw = \"corotational\"");
    let read = Work::with(&law)?.cutis(&["check", "scene.toml"])?;
    ensure!(read.code == 0, "{}", read.err);
    // an explicit step beyond the stability limit
    let unstable = ALONE.replace("[time]", "[time]\nintegrator = \"symplectic_euler\"");
    let work = Work::with(&unstable)?;
    says(
        &work,
        &run,
        2,
        &["scene.toml:5: skin is stable under integrator", "and its step (step_ms over substeps) is 5"],
    )?;
    // a block that nothing holds under the tip that presses it
    let loose = PRESS.replace("[time]", "[time]\nintegrator = \"static\"");
    let work = Work::with(&loose.replace("[[boundary]]\nregion = \"bottom\"\n", ""))?;
    says(&work, &run, 1, &["scene.toml:5: the static step to 0.005 s is not in balance", "hold what slides"])?;
    // bodies that are to be tied, apart from each other
    let block = "\n[[block]]\nname = \"other\"\nposition_mm = [0.0, 0.0, 40.0]\nsize_mm = [2.0, 2.0]\ncells = [1, 1]\n";
    let tie = "\n[[attach]]\nbody = \"other\"\nto = \"skin\"\nregion = \"bottom\"\n";
    let apart = format!("{ALONE}{block}{}{tie}", one_layer().replace("[[skin.layer]]", "[[block.layer]]"));
    let at = apart.lines().take_while(|line| *line != "[[attach]]").count() + 1;
    let work = Work::with(&apart)?;
    says(
        &work,
        &run,
        2,
        &[&format!("scene.toml:{at}: the node at"), "mm is to be tied to a body that is 38.000 mm away"],
    )?;
    // more layers than a body can have
    let one = one_layer();
    let many: String = (0..22).map(|k| one.replace("dermis", &format!("layer {k}"))).collect();
    let work = Work::with(&ALONE.replace(one, &many))?;
    says(&work, &run, 2, &["scene.toml: 22 layers; at most 21 fit"])?;
    // two recordings of one name
    let row = "mesh = \"tip.obj\"\ntrajectory = \"hand.csv\"\nmass_g = 10.0\ninertia_g_mm2 = [1.0, 1.0, 1.0]\n";
    let tools = ["a b", "a_b"].map(|name| format!("[[tool]]\nname = \"{name}\"\n{row}")).concat();
    let work = Work::with(&format!("{PRESS}\n{tools}"))?;
    says(&work, &[&run[..], &["--record"]].concat(), 2, &["two tools are recorded as hand_a_b.csv", "rename one"])
}

fn a_file_that_is_not_utf8_names_its_first_bad_byte() -> Outcome {
    let work = Work::with(PRESS)?;
    let bytes = |text: &str| text.bytes().map(|byte| if byte == b'~' { 0xe9 } else { byte }).collect::<Vec<u8>>();
    let scene = PRESS.replace("name = \"dermis\"", "name = \"dünn~\"");
    std::fs::write(work.path("scene.toml"), bytes(&scene)).map_err(|e| e.to_string())?;
    let line = scene.lines().take_while(|line| !line.contains('~')).count() + 1;
    let words = [&*format!("the byte 0xe9 in line {line}, column 13"), "save it as UTF-8", "iconv -f latin1 -t utf-8"];
    says(&work, &["run", "scene.toml"], 2, &words)?;
    work.write("scene.toml", PRESS)?;
    std::fs::write(work.path("tip.obj"), [0xff, 0xfe, b'v', 0]).map_err(|e| e.to_string())?;
    says(&work, &["run", "scene.toml"], 2, &["scene.toml:", "tip.obj", "0xff in line 1, column 1", "iconv -f utf-16"])?;
    // a byte order mark is none of the text
    work.write("tip.obj", "\u{feff}v 0 0 0\nv 1 0 2\nv -1 1 2\nf 1 2 3\n")?;
    work.write("scene.toml", &format!("\u{feff}{PRESS}"))?;
    let said = work.cutis(&["check", "scene.toml"])?;
    ensure!(said.code == 0, "{}: {}", said.code, said.err);
    Ok(())
}

fn pipes_and_devices_are_no_input() -> Outcome {
    if !cfg!(unix) {
        return Ok(());
    }
    let work = Work::with(PRESS)?;
    let made = std::process::Command::new("mkfifo").arg(work.path("pipe")).status().map_err(|e| e.to_string())?;
    ensure!(made.success(), "no pipe could be made");
    let refused = "it is a pipe or a device";
    for name in ["pipe", "/dev/zero"] {
        says(&work, &["run", name], 2, &[name, refused])?;
        work.write("scene.toml", &PRESS.replace("\"tip.obj\"", &format!("\"{name}\"")))?;
        says(&work, &["run", "scene.toml"], 2, &[name, refused])?;
        work.write("scene.toml", PRESS)?;
        says(&work, &["run", "scene.toml", "--backend", "cpu", "--resume", name], 2, &[name, refused])?;
    }
    says(&work, &["run", "."], 2, &["it is a folder"])
}

fn control_characters_do_not_reach_the_terminal() -> Outcome {
    let title = "title = \"A blunt tip presses a block\"";
    let work = Work::with(&PRESS.replace(title, r#"title = "red \u001b[31m\nand \u009b31m more""#))?;
    let said = work.cutis(&["check", "scene.toml"])?;
    let wanted = concat!(r"scene.toml: valid: red \u{1b}[31m\nand \u{9b}31m more", "\n");
    ensure!(said.code == 0 && said.out == wanted, "{:?}", said.out);
    let list = work.cutis(&["check", "--json", "scene.toml"])?;
    ensure!(!list.out.contains(|c: char| c.is_control() && c != '\n'), "{:?}", list.out);
    let read: serde_json::Value = serde_json::from_str(&list.out).map_err(|e| e.to_string())?;
    ensure!(read[0]["title"] == "red \u{1b}[31m\nand \u{9b}31m more", "{read}");
    let region = "region = \"bottom\"\n\n[solver]";
    let work = Work::with(&PRESS.replace(region, "region = \"\\u001b[2Jbottom\"\n\n[solver]"))?;
    let said = work.cutis(&["check", "scene.toml"])?;
    let message = said.err.lines().find(|line| line.starts_with("error: ")).unwrap_or_default();
    ensure!(message.contains(r"\u{1b}[2Jbottom") && !said.err.contains('\u{1b}'), "{:?}", said.err);
    Ok(())
}

/// Quadratic time took 20 s.
fn a_hundred_thousand_probes_are_read_in_linear_time() -> Outcome {
    let probe = |k: u32| format!("[[probe]]\nname = \"p{k}\"\nkind = \"volume\"\n");
    let check = |k: u32| format!("\"probes.p{k}\" = {{ min = 0 }}\n");
    let [probes, checks]: [String; 2] = [(0..100_000).map(probe).collect(), (0..100_000).map(check).collect()];
    let work = Work::with(&format!("{ALONE}\n{probes}\n[check]\n{checks}"))?;
    let begin = std::time::Instant::now();
    let said = work.cutis(&["check", "scene.toml"])?;
    let took = begin.elapsed();
    println!("100,000 probes and checks: {took:?}");
    ensure!(said.code == 0 && took.as_secs() < 10, "{}: {} after {took:?}", said.code, said.err);
    Ok(())
}
