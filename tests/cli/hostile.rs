//! What goes wrong outside the program: pipes that close, disks that are full, signals, a folder that belongs to somebody else.

use super::killed::{long, read_back};
use super::work::{ALONE, PRESS, Said, Work};
use super::{Outcome, Test};
use crate::ensure;
use cutis::haptic::haply::mock::{Faults, Mock, Options};
use cutis::scene::Pose;
use serde_json::Value;
use std::fs::File;
use std::io::Read;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Tests of this file; what they set up is Unix's.
pub const TESTS: &[Test] = &[
    ("a_closed_pipe_ends_quietly", a_closed_pipe_ends_quietly),
    ("a_full_output_is_exit_1_with_words", a_full_output_is_exit_1_with_words),
    ("a_run_goes_on_where_nobody_reads_its_messages", a_run_goes_on_where_nobody_reads_its_messages),
    ("a_signal_releases_the_devices_and_leaves_a_report", a_signal_releases_the_devices_and_leaves_a_report),
    ("a_device_that_is_lost_is_a_warning_and_fails_a_check", a_device_that_is_lost_is_a_warning_and_fails_a_check),
    ("a_signal_ends_a_step_without_an_end", a_signal_ends_a_step_without_an_end),
    ("a_second_signal_ends_a_run_at_once", a_second_signal_ends_a_run_at_once),
    ("a_signal_that_is_ignored_stays_ignored", a_signal_that_is_ignored_stays_ignored),
    ("a_file_size_limit_leaves_whole_rows_and_is_reported", a_file_size_limit_leaves_whole_rows_and_is_reported),
    ("a_picture_beyond_the_limit_keeps_what_the_run_has", a_picture_beyond_the_limit_keeps_what_the_run_has),
    ("the_folder_is_tried_before_anything_is_computed", the_folder_is_tried_before_anything_is_computed),
    ("two_runs_do_not_share_a_folder", two_runs_do_not_share_a_folder),
    ("files_of_earlier_runs_go_and_no_others", files_of_earlier_runs_go_and_no_others),
    ("a_refused_run_leaves_no_folder", a_refused_run_leaves_no_folder),
];

/// A command of the program in a folder.
fn cutis(work: &Work, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_cutis"));
    command
        .args(arguments)
        .current_dir(work.path("."))
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    command
}

fn words<E: std::fmt::Display>(error: E) -> String {
    error.to_string()
}

/// Waits for the end; what it has said on standard error if that is a pipe, and its exit status.
fn end(mut process: Child) -> Result<(Option<i32>, String), String> {
    let mut said = String::new();
    if let Some(mut pipe) = process.stderr.take() {
        pipe.read_to_string(&mut said).map_err(words)?;
    }
    Ok((process.wait().map_err(words)?.code(), said))
}

fn report(work: &Work) -> Result<Value, String> {
    serde_json::from_str(&work.read("out/report.json")?).map_err(words)
}

fn kill(process: &Child, signal: &str) -> Outcome {
    let sent = Command::new("kill").args([signal, &process.id().to_string()]).status().map_err(words)?;
    ensure!(sent.success(), "{signal} could not be sent");
    Ok(())
}

/// Waits until it holds.
fn until(what: &str, mut holds: impl FnMut() -> bool) -> Outcome {
    let begin = Instant::now();
    while !holds() {
        ensure!(begin.elapsed() < Duration::from_secs(60), "{what}: not within a minute");
        std::thread::sleep(Duration::from_millis(2));
    }
    Ok(())
}

/// Commands that print, each with more than one write.
const PRINTING: [&[&str]; 8] = [
    &["inspect", "scene.toml"],
    &["inspect", "scene.toml", "--json"],
    &["check", "scene.toml", "scene.toml"],
    &["keys"],
    &["keys", "--json"],
    &["adapters"],
    &["--help"],
    &["run", "scene.toml", "--backend", "cpu", "--frames", "0", "--json"],
];

fn a_closed_pipe_ends_quietly() -> Outcome {
    let work = Work::with(PRESS)?;
    for arguments in PRINTING {
        let mut command = cutis(&work, arguments);
        let mut process = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().map_err(words)?;
        drop(process.stdout.take());
        let (code, said) = end(process)?;
        ensure!(code == Some(0) && !said.contains("panicked"), "{arguments:?}: {code:?}: {said}");
    }
    Ok(())
}

fn a_full_output_is_exit_1_with_words() -> Outcome {
    let work = Work::with(PRESS)?;
    for arguments in PRINTING {
        let full = File::options().write(true).open("/dev/full").map_err(words)?;
        let mut command = cutis(&work, arguments);
        let (code, said) = end(command.stdout(full).stderr(Stdio::piped()).spawn().map_err(words)?)?;
        let told = said.contains("error: standard output cannot be written") && said.contains("make space");
        ensure!(code == Some(1) && told, "{arguments:?}: {code:?}: {said}");
    }
    Ok(())
}

fn a_run_goes_on_where_nobody_reads_its_messages() -> Outcome {
    let work = Work::with(PRESS)?;
    for full in [false, true] {
        std::fs::remove_dir_all(work.path("out")).ok();
        let mut command = cutis(&work, &["run", "scene.toml", "--backend", "cpu", "--frames", "0"]);
        match full {
            true => command.stderr(File::options().write(true).open("/dev/full").map_err(words)?),
            false => command.stderr(Stdio::piped()),
        };
        let mut process = command.spawn().map_err(words)?;
        drop(process.stderr.take());
        let (code, _) = end(process)?;
        ensure!(code == Some(0), "full: {full}: {code:?}");
        ensure!(report(&work)?["steps"] == 5, "{}", report(&work)?);
    }
    // an error has its exit status, said or not
    let mut process = cutis(&work, &["run", "missing.toml"]).stderr(Stdio::piped()).spawn().map_err(words)?;
    drop(process.stderr.take());
    ensure!(end(process)?.0 == Some(2), "an error without words has its status");
    Ok(())
}

/// A stand-in whose hand presses the block, and the scene that it holds the tip of.
fn pressing(options: Options) -> Result<(Mock, Work), String> {
    let pose = |time, z| Pose { time, position: [0.3e-3, 0.2e-3, z], rotation: [0.0, 0.0, 0.0, 1.0] };
    // it goes on: after a gap the tool continues from where it was held
    let path = vec![pose(0.0, 2.2e-3), pose(0.1, 1.9e-3), pose(10.0, 0.5e-3)];
    let mock = Mock::start(Options { port: 0, path, ..options }).map_err(words)?;
    let device = format!("device = {{ kind = \"haply\", url = \"{}\" }}", mock.url());
    let points = "points_mm = [[0.0, 0.0, 0.0]]";
    let scene = PRESS.replace(points, &format!("{points}\n{device}")).replace("= 0.025", "= 60.0");
    Ok((mock, Work::with(&scene)?))
}

/// Bit mask of the signals that this process, and what it starts, ignores, where the system tells.
fn ignored() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0)
}

fn a_signal_releases_the_devices_and_leaves_a_report() -> Outcome {
    // those that this test's own parent ignores stay ignored: in the background of a shell SIGINT, under `nohup` SIGHUP
    let ignored = ignored();
    let heard = |(_, code): &(&str, i32)| ignored >> (code - 129) & 1 == 0;
    for (signal, wanted) in [("-INT", 130), ("-TERM", 143), ("-HUP", 129)].into_iter().filter(heard) {
        let (mock, work) = pressing(Options::default())?;
        let arguments = ["run", "scene.toml", "--backend", "cpu", "--realtime", "--frames", "0", "--record"];
        let process = cutis(&work, &arguments).stderr(Stdio::piped()).spawn().map_err(words)?;
        until("a force", || mock.record().forces.iter().any(|force| force.length() > 0.05))?;
        kill(&process, signal)?;
        let sent = Instant::now();
        let (code, said) = end(process)?;
        ensure!(sent.elapsed() < Duration::from_secs(5), "it took {:?}", sent.elapsed());
        ensure!(code == Some(wanted) && said.contains("error: interrupted"), "{signal}: {code:?}: {said}");
        until("the end of the connection", || mock.record().ended == 1)?;
        let last = mock.record().last_forces;
        ensure!(last.concat().iter().all(|force| force.length() == 0.0), "{signal}: it was left with {last:?}");
        let report = report(&work)?;
        ensure!(report["error"] == "interrupted" && report["haptic"]["force_n_max"].as_f64() > Some(0.05), "{report}");
        let [steps, _] = read_back(&work.path("out"))?;
        ensure!(steps > 0 && report["steps"].as_u64() == Some(steps as u64), "{steps} steps, {report}");
        ensure!(work.read("out/hand_tip.csv")?.lines().count() > steps, "the recording is short");
    }
    Ok(())
}

/// After its first frame the service sends nothing of use.
fn a_device_that_is_lost_is_a_warning_and_fails_a_check() -> Outcome {
    for (faults, check, wanted) in [
        (Faults { malformed_every: 1, ..Faults::default() }, true, 1),
        (Faults { empty_every: 1, ..Faults::default() }, true, 1),
        (Faults { malformed_every: 1, ..Faults::default() }, false, 0),
        // the counter-tests: a whole one, and one with a gap
        (Faults::default(), true, 0),
        (Faults { malformed_every: 40, ..Faults::default() }, true, 0),
    ] {
        let (_mock, work) = pressing(Options { faults, ..Options::default() })?;
        let scene = work.read("scene.toml")?.replace("duration_s = 60.0", "duration_s = 0.5");
        let checks = if check { "\n[check]\n\"steps\" = { min = 100 }\n" } else { "" };
        work.write("scene.toml", &(scene + checks))?;
        let said = work.cutis(&["run", "scene.toml", "--backend", "cpu", "--realtime", "--frames", "0"])?;
        ensure!(said.code == wanted, "{faults:?}: {}: {}", said.code, said.err);
        let lost = faults.malformed_every == 1 || faults.empty_every == 1;
        let ticks = report(&work)?["warnings"]["device_lost"].as_u64();
        ensure!(ticks.is_some_and(|ticks| ticks > 50) == lost, "{faults:?}: {ticks:?} of 500 ticks");
        ensure!(said.err.contains("warning: device_lost") == lost, "{faults:?}: {}", said.err);
        let failed = said.err.contains("check failed: warnings.device_lost = ");
        ensure!(failed == (lost && check), "{faults:?}: {}", said.err);
    }
    Ok(())
}

fn a_second_signal_ends_a_run_at_once() -> Outcome {
    // the set-up alone takes longer than this test
    let work = Work::with(&ALONE.replace("cells = [4, 4]", "cells = [600, 600]").replace("cells = 2", "cells = 8"))?;
    let process = cutis(&work, &["run", "scene.toml", "--backend", "cpu"]).spawn().map_err(words)?;
    until("the folder", || work.path("out/cutis-files.txt").exists())?;
    kill(&process, "-TERM")?;
    std::thread::sleep(Duration::from_millis(100));
    kill(&process, "-TERM")?;
    let sent = Instant::now();
    let (code, _) = end(process)?;
    ensure!(code == Some(143) && sent.elapsed() < Duration::from_secs(2), "{code:?} after {:?}", sent.elapsed());
    ensure!(!work.path("out/report.json").exists(), "it has ended as after the first");
    Ok(())
}

/// A static step whose tolerance is below rounding, so that it takes all its solves.
fn a_signal_ends_a_step_without_an_end() -> Outcome {
    let scene =
        ALONE.replace("[skin]", "[solver]\ntolerance = 1e-30\nmax_iterations = 1000000\nfloor_n = 0.0\n\n[skin]");
    let scene = scene.replace("[time]", "[time]\nintegrator = \"static\"");
    let work = Work::with(&scene.replace("cells = [4, 4]", "cells = [100, 100]").replace("cells = 2", "cells = 8"))?;
    let run = ["run", "scene.toml", "--backend", "cpu", "--frames", "0"];
    let process = cutis(&work, &run).stderr(Stdio::piped()).spawn().map_err(words)?;
    until("a table", || work.path("out/energy.csv").exists() || work.path("out/probes.csv").exists())?;
    std::thread::sleep(Duration::from_secs(3));
    kill(&process, "-TERM")?;
    let (code, said) = end(process)?;
    ensure!(code == Some(143) && said.contains("error: interrupted"), "{code:?}: {said}");
    let report = report(&work)?;
    ensure!(report["error"] == "interrupted" && report["steps"] == 0, "{report}");
    Ok(())
}

/// As under `nohup`.
fn a_signal_that_is_ignored_stays_ignored() -> Outcome {
    if !cfg!(target_os = "linux") {
        return Ok(());
    }
    let work = Work::with(PRESS)?;
    let mut command = Command::new("sh");
    command.args(["-c", "trap '' HUP; exec \"$@\"", "sh", env!("CARGO_BIN_EXE_cutis"), "run", "scene.toml"]);
    command.args(["--backend", "cpu", "--realtime", "--seconds", "2"]).current_dir(work.path("."));
    work.write("scene.toml", &PRESS.replace("duration_s = 0.025", "duration_s = 60.0"))?;
    let process = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().map_err(words)?;
    until("a table", || work.path("out/probes.csv").exists())?;
    kill(&process, "-HUP")?;
    let (code, said) = end(process)?;
    ensure!(code == Some(0) && report(&work)?["steps"] == 400, "{code:?}: {said}");
    Ok(())
}

/// Runs the scene under a limit of the size of files, in units of 512 bytes.
fn limited(work: &Work, blocks: u32, arguments: &[&str]) -> Result<(Option<i32>, String), String> {
    let mut command = Command::new("sh");
    let limit = blocks.to_string();
    // shells differ in their unit: that of `sh` is measured on a file
    let script = "ulimit -f \"$1\" && shift && exec \"$@\"";
    command.args(["-c", script, "sh", &limit, env!("CARGO_BIN_EXE_cutis")]).args(arguments);
    command.current_dir(work.path(".")).stdout(Stdio::null()).stderr(Stdio::piped());
    end(command.spawn().map_err(words)?)
}

fn a_file_size_limit_leaves_whole_rows_and_is_reported() -> Outcome {
    let work = Work::with(&long())?;
    let (code, said) = limited(&work, 64, &["run", "scene.toml", "--backend", "cpu", "--frames", "0", "--record"])?;
    let error = said.lines().find_map(|line| line.strip_prefix("error: ")).unwrap_or_default();
    ensure!(code == Some(1) && error.contains("haptic.csv: stopped after"), "{code:?}: {said}");
    let length = work.read("out/haptic.csv")?.len();
    ensure!(error.contains(&format!("after {length} bytes, at the end of a row")), "{length} bytes: {error}");
    ensure!((16_000..=64 * 1024).contains(&length), "{length} bytes");
    let [steps, _] = read_back(&work.path("out"))?;
    ensure!(report(&work)?["error"] == error && report(&work)?["steps"].as_u64() == Some(steps as u64), "{error}");
    ensure!(!work.path("out/reserve.bin").exists(), "the reserve is still there");
    Ok(())
}

fn a_picture_beyond_the_limit_keeps_what_the_run_has() -> Outcome {
    let work = Work::with(&PRESS.replace("size_px = [96, 64]", "size_px = [2400, 1600]"))?;
    let (code, said) = limited(&work, 64, &["run", "scene.toml", "--backend", "cpu", "--record"])?;
    ensure!(code == Some(1) && said.contains("frame_0001.png.tmp: cannot be written"), "{code:?}: {said}");
    let report = report(&work)?;
    ensure!(report["steps"] == 3 && report["error"].as_str().is_some_and(|e| said.contains(e)), "{report}");
    ensure!(read_back(&work.path("out"))? == [3, 0], "{:?}", read_back(&work.path("out"))?);
    Ok(())
}

fn the_folder_is_tried_before_anything_is_computed() -> Outcome {
    let work = Work::with(PRESS)?;
    let blocked =
        ["run/frames/frame_0002.png", "run/report.json.tmp", "run/hand_tip.csv", "run/vtu", "study/study.svg"];
    let commands = [
        (&["run", "scene.toml", "--backend", "cpu", "--record", "--out", "run"][..], &blocked[..3]),
        (&["study", "scene.toml", "--out", "study"], &blocked[4..]),
        (&["verify", "--quick", "--out", "page"], &["page/verification.md"]),
    ];
    for (arguments, names) in commands {
        for name in names {
            std::fs::create_dir_all(work.path(name)).map_err(words)?;
            let said = work.cutis(arguments)?;
            let told = said.err.contains(&format!("{name}: stands where a result goes")) && said.err.contains("--out");
            ensure!(said.code == 1 && told, "{name}: {}: {}", said.code, said.err);
            computed_nothing(&said)?;
            std::fs::remove_dir_all(work.path(name)).map_err(words)?;
        }
    }
    // a file where a folder goes
    std::fs::remove_dir_all(work.path("run")).map_err(words)?;
    std::fs::create_dir_all(work.path("run")).map_err(words)?;
    work.write(blocked[3], "mine")?;
    let said = work.cutis(commands[0].0)?;
    ensure!(said.code == 1 && said.err.contains("vtu: cannot be written"), "{}: {}", said.code, said.err);
    computed_nothing(&said)?;
    Ok(())
}

/// There is no line of progress; a driver may have said something too.
fn computed_nothing(said: &Said) -> Outcome {
    let errors = said.err.lines().all(|line| line.starts_with("error: "));
    ensure!(errors && said.out.is_empty(), "something was computed: {}{}", said.out, said.err);
    Ok(())
}

fn two_runs_do_not_share_a_folder() -> Outcome {
    let work = Work::with(&long())?;
    let mut first = cutis(&work, &["run", "scene.toml", "--backend", "cpu"]).spawn().map_err(words)?;
    until("a table", || work.path("out/probes.csv").exists())?;
    for arguments in [&["run", "scene.toml", "--backend", "cpu"][..], &["study", "scene.toml"]] {
        let said = work.cutis(arguments)?;
        ensure!(said.code == 1 && said.err.contains("out: another run writes there"), "{}: {}", said.code, said.err);
    }
    ensure!(first.try_wait().map_err(words)?.is_none(), "the first one has ended");
    first.kill().map_err(words)?;
    first.wait().map_err(words)?;
    ensure!(read_back(&work.path("out"))?[0] > 0, "the first one was disturbed");
    // the lock ends with its process
    let said = work.cutis(&["run", "scene.toml", "--backend", "cpu", "--steps", "1"])?;
    ensure!(said.code == 0, "{}: {}", said.code, said.err);
    Ok(())
}

fn files_of_earlier_runs_go_and_no_others() -> Outcome {
    let work = Work::with(PRESS)?;
    work.json(&["run", "scene.toml", "--backend", "cpu", "--record", "--json"], 0)?;
    // a killed run has left these two, and the user those
    work.write("out/report.json.tmp", "{")?;
    work.write("out/frames/frame_10000.png", "of a long run")?;
    let list = work.read("out/cutis-files.txt")?;
    work.write("out/cutis-files.txt", &(list + "frames/frame_10000.png\n"))?;
    let mine = ["hand_mine.csv", "notes.tmp", "frames/frame_0009.png", "frames/frame_1.png"];
    mine.iter().try_for_each(|name| work.write(&format!("out/{name}"), "mine"))?;
    work.write("scene.toml", ALONE)?;
    work.json(&["run", "scene.toml", "--backend", "cpu", "--json"], 0)?;
    for name in ["hand_tip.csv", "haptic.csv", "report.json.tmp", "frames/frame_10000.png", "frames/frame_0002.png"] {
        ensure!(!work.path("out").join(name).exists(), "{name} is still there");
    }
    for name in mine {
        ensure!(work.read(&format!("out/{name}"))? == "mine", "{name} is not the user's any more");
    }
    // what the list does not have is not written over
    for name in ["report.json", "probes.csv", "volume.pvd", "frames/frame_0001.png"] {
        let work = Work::with(ALONE)?;
        std::fs::create_dir_all(work.path("frames")).map_err(words)?;
        work.write(name, "mine")?;
        let said = work.cutis(&["run", "scene.toml", "--backend", "cpu", "--out", "."])?;
        ensure!(said.code == 1 && said.err.contains(name), "{name}: {}: {}", said.code, said.err);
        ensure!(work.read(name)? == "mine", "{name} was written over");
    }
    // a study leaves the files of a run, and the other way round
    let said = work.cutis(&["verify", "--quick", "--out", "out/frames/frame_0001.png"])?;
    ensure!(said.code == 1 && said.err.contains("frame_0001.png: cannot be written"), "{}", said.err);
    Ok(())
}

fn a_refused_run_leaves_no_folder() -> Outcome {
    let work = Work::with(PRESS)?;
    let said = work.cutis(&["run", "scene.toml", "--adapter", "no such thing"])?;
    ensure!(said.code == 3 && !work.path("out").exists(), "{}: {}", said.code, said.err);
    Ok(())
}
