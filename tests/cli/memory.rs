//! A run whose memory is used up: under each limit it ends with an error that says so, or is aborted with words, and its files are whole.

use super::Outcome;
use super::killed::read_back;
use super::work::Work;
use crate::ensure;
use std::io::Read;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Tests of this file.
pub const TESTS: &[super::Test] = &[
    ("a_run_out_of_memory_says_so_and_leaves_whole_files", a_run_out_of_memory_says_so_and_leaves_whole_files),
    ("a_scene_beyond_memory_is_refused_before_it_takes_any", a_scene_beyond_memory_is_refused_before_it_takes_any),
    (
        "a_verification_beyond_memory_is_refused_before_its_first_case",
        a_verification_beyond_memory_is_refused_before_its_first_case,
    ),
    ("texts_beyond_memory_are_refused_unread", texts_beyond_memory_are_refused_unread),
    ("inspect_takes_no_memory_of_the_size_of_the_grid", inspect_takes_no_memory_of_the_size_of_the_grid),
    ("an_end_without_words_is_noticed", an_end_without_words_is_noticed),
];

/// Limits between what a start takes and what a whole run takes.
const LIMITS: u64 = 16;
/// A run takes a second or two; one that has not ended by then hangs.
const HANGS: Duration = Duration::from_secs(60);

/// The third and the last step have pictures, which are most of the memory of so small a body.
fn scene() -> String {
    super::work::PRESS.replace("size_px = [96, 64]", "size_px = [800, 600]")
}

/// How a run ended.
#[derive(Debug)]
struct End {
    /// Exit status; none of one that a signal ended.
    code: Option<i32>,
    /// What it said.
    said: String,
    /// Most of its address space, KiB, as far as it was seen.
    peak: u64,
    /// Most of its resident memory, KiB, as far as it was seen.
    resident: u64,
}

/// Runs the program with so much address space, KiB, or as much as it likes.
fn under(work: &Work, limit: Option<u64>, arguments: &[&str]) -> Result<End, String> {
    let limit = limit.map_or("unlimited".into(), |kib| kib.to_string());
    let mut run = Command::new("sh");
    run.args(["-c", "ulimit -v \"$1\" && shift && exec \"$@\"", "sh", &limit, env!("CARGO_BIN_EXE_cutis")]);
    run.args(arguments).current_dir(work.path(".")).env("RUST_BACKTRACE", "0");
    // on a machine of many cores the stacks of its threads would take the address space
    run.env("RAYON_NUM_THREADS", "2");
    let mut run = run.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().map_err(|e| e.to_string())?;
    let (begin, mut peak, mut resident) = (Instant::now(), 0, 0);
    let status = loop {
        if let Some(status) = run.try_wait().map_err(|e| e.to_string())? {
            break status;
        }
        if begin.elapsed() > HANGS {
            run.kill().map_err(|e| e.to_string())?;
            return Err(format!("it hangs with {limit} KiB"));
        }
        let status = std::fs::read_to_string(format!("/proc/{}/status", run.id())).unwrap_or_default();
        for (name, most) in [("VmPeak:", &mut peak), ("VmHWM:", &mut resident)] {
            let line = status.lines().find_map(|line| line.strip_prefix(name)).unwrap_or_default();
            *most = line.trim().trim_end_matches("kB").trim().parse().unwrap_or(*most).max(*most);
        }
        std::thread::sleep(Duration::from_millis(2));
    };
    let mut said = String::new();
    run.stderr.take().ok_or("no words")?.read_to_string(&mut said).map_err(|e| e.to_string())?;
    Ok(End { code: status.code(), said, peak, resident })
}

const RUN: [&str; 5] = ["run", "scene.toml", "--backend", "cpu", "--record"];

/// Little more than the least address space with which the program starts and reads a scene, KiB: at the very edge it is the system's own
/// libraries that end it, before it has a word to say.
fn least(work: &Work, most: u64) -> Result<u64, String> {
    let (mut fails, mut starts) = (0, most);
    while starts - fails > most / 1024 {
        let middle = (fails + starts) / 2;
        let begun = under(work, Some(middle), &["check", "scene.toml"])?.code == Some(0);
        *(if begun { &mut starts } else { &mut fails }) = middle;
    }
    Ok(starts + most / 512)
}

/// What a run may end with: done, an error about memory that is in its report too, or an abort that names memory.
fn fits(end: &End, report: Option<&serde_json::Value>, steps: usize) -> Outcome {
    let error = end.said.lines().find_map(|line| line.split_once("error: ")).map(|(_, words)| words);
    match (end.code, error) {
        (Some(0), _) => {
            ensure!(steps == 5, "done after {steps} steps");
        }
        (Some(1), Some(words)) => {
            ensure!(words.contains("memory") && words.contains(';'), "{words}");
            let kept = report.is_none_or(|r| r["error"] == words && r["steps"].as_u64() == Some(steps as u64));
            ensure!(kept && (steps == 0 || report.is_some()), "{steps} steps, {report:?}");
        }
        (None, None) => {
            ensure!(end.said.contains("memory allocation of"), "{end:?}");
        }
        _ => return Err(format!("{end:?}")),
    }
    Ok(())
}

fn a_run_out_of_memory_says_so_and_leaves_whole_files() -> Outcome {
    let work = Work::with(&scene())?;
    // the counter-test: with as much as it likes it is done
    let free = under(&work, None, &RUN)?;
    ensure!(free.code == Some(0) && free.peak > 0, "{free:?}");
    ensure!(read_back(&work.path("out"))? == [5, 8], "{:?}", read_back(&work.path("out"))?);
    let least = least(&work, free.peak)?;
    let mut ends = vec![];
    for k in 0..LIMITS {
        std::fs::remove_dir_all(work.path("out")).ok();
        let limit = least + (free.peak - least) * k / (LIMITS - 1);
        let end = under(&work, Some(limit), &RUN)?;
        let text = work.read("out/report.json").ok();
        let report = text.map(|text| serde_json::from_str::<serde_json::Value>(&text).map_err(|e| e.to_string()));
        let [steps, _] = read_back(&work.path("out")).map_err(|e| format!("{limit} KiB: {e}"))?;
        fits(&end, report.transpose()?.as_ref(), steps).map_err(|e| format!("{limit} KiB: {e}"))?;
        ends.push((limit, end.code, steps));
    }
    println!("KiB, exit status and steps: {ends:?}");
    let told = ends.iter().filter(|(_, code, steps)| *code == Some(1) && (1..5).contains(steps)).count();
    ensure!(told > 0, "none ended with an error between its first and last step: {ends:?}");
    ensure!(ends.iter().any(|(.., steps)| *steps == 0), "none ended before its first step: {ends:?}");
    Ok(())
}

fn a_scene_beyond_memory_is_refused_before_it_takes_any() -> Outcome {
    // 5.9 million nodes, and with the reserve of a blade 30 million more
    let large = super::work::ALONE.replace("cells = [4, 4]", "cells = [1400, 1400]");
    let blade = "edge_mm = [[0, 0, 0], [2, 0, 0.5]]\nthickness_mm = 0.4";
    let cut = super::work::PRESS
        .replace("cells = [4, 4]", "cells = [4, 4]\ncut_reserve_columns = 10000000")
        .replace("points_mm = [[0.0, 0.0, 0.0]]", &format!("[tool.blade]\n{blade}"));
    for (scene, key) in [(large, "cells"), (cut, "cut_reserve_columns")] {
        let work = Work::with(&scene)?;
        let at = scene.lines().take_while(|line| !line.starts_with(&format!("{key} = "))).count() + 1;
        for command in [&RUN[..], &["check", "scene.toml"]] {
            let end = under(&work, Some(2_000_000), command)?;
            let told = end.said.lines().any(|line| {
                let parts = [
                    &format!("scene.toml:{at}: the scene needs "),
                    " GB are free; lower ",
                    key,
                    ", or close what takes memory",
                ];
                line.starts_with("error: ") && parts.iter().all(|part| line.contains(*part))
            });
            ensure!(end.code == Some(1) && told, "{key}: {command:?}: {end:?}");
            ensure!(end.peak < 600_000, "{key}: {command:?} took {} KiB", end.peak);
            ensure!(!work.path("out").exists(), "{key}: {command:?} has begun");
        }
    }
    Ok(())
}

fn texts_beyond_memory_are_refused_unread() -> Outcome {
    let work = Work::with(&scene())?;
    let room = least(&work, 4_000_000)? + 100_000;
    let check = |file: &str| under(&work, Some(room), &["check", file]);
    // a list of 4 million numbers takes 470 MB to read
    work.write("list.toml", &format!("title = \"a\"\nlist = [{}]\n", "1,".repeat(4_000_000)))?;
    // and a hand of 1 million rows
    let rows: String = (0..1_000_000).map(|k| format!("{k},0,0,2,0,0,0,1\n")).collect();
    work.write("hand.csv", &format!("time_s,x_mm,y_mm,z_mm,qx,qy,qz,qw\n{rows}"))?;
    for (file, named) in [("list.toml", "list.toml"), ("scene.toml", "hand.csv")] {
        let end = check(file)?;
        let told = [named, " MB may take ", " MB of memory to read, and ", " MB are free; "];
        let line = end.said.lines().find(|line| told.iter().all(|part| line.contains(part)));
        ensure!(end.code == Some(2) && line.is_some(), "{file}: {end:?}");
    }
    // the counter-test: where memory is not short the list is read, and its key is unknown
    let end = under(&work, None, &["check", "list.toml"])?;
    ensure!(end.code == Some(2) && end.said.contains("list.toml:2: unknown key `list`"), "{end:?}");
    // 1 % of it is read under the limit
    work.write("list.toml", &format!("title = \"a\"\nlist = [{}]\n", "1,".repeat(40_000)))?;
    let end = check("list.toml")?;
    ensure!(end.code == Some(2) && end.said.contains("list.toml:2: unknown key `list`"), "{end:?}");
    Ok(())
}

/// Resident memory that inspecting a scene may take, on any grid, KiB: a third of one byte a node beyond that of a few cells.
const TO_INSPECT: u64 = 24_000;

/// As large as arrays may be that one binding holds: with the blocks of columns, with right-hand sides of contact and a reserve, with springs.
fn inspect_takes_no_memory_of_the_size_of_the_grid() -> Outcome {
    let [alone, pressed] = [super::work::ALONE, super::work::PRESS]
        .map(|scene| scene.replace("cells = [4, 4]", "cells = [4, 4]\nlaw = \"corotational\""));
    let multigrid = format!("{alone}\n[solver]\npreconditioner = \"multigrid\"\n");
    let blade = "[tool.blade]\nedge_mm = [[0, 0, 0], [2, 0, 0.5]]\nthickness_mm = 0.4";
    let cut = pressed.replace("points_mm = [[0.0, 0.0, 0.0]]", blade);
    let of_springs = "law = \"springs\"\nspring_stiffness_n_m = 100.0\nspring_damping_n_s_m = 0.1";
    let springs = alone.replace("law = \"corotational\"", of_springs).replace("young_kpa = 100.0\npoisson = 0.4\n", "");
    let scenes =
        [("columns", &alone, 3161), ("multigrid", &multigrid, 3161), ("cut", &cut, 1500), ("springs", &springs, 800)];
    let inspect = |scene: &str| -> Result<(End, Work), String> {
        let work = Work::with(scene)?;
        Ok((under(&work, None, &["inspect", "scene.toml"])?, work))
    };
    for (name, small, cells) in scenes {
        let (few, _) = inspect(small)?;
        let (many, work) = inspect(&small.replace("cells = [4, 4]", &format!("cells = [{cells}, {cells}]")))?;
        ensure!(few.code == Some(0) && many.code == Some(0), "{name}: {few:?}, {many:?}");
        let plan = work.json(&["inspect", "scene.toml", "--json"], 0)?;
        let nodes = (cells + 1) * (cells + 1) * 3;
        ensure!(plan["nodes"] == nodes, "{name}: {}", plan["nodes"]);
        ensure!(plan["device_bytes"].as_i64() > Some(200 * nodes), "{name}: {}", plan["device_bytes"]);
        println!("{name}: {nodes} nodes in {} KiB, a few cells in {} KiB", many.resident, few.resident);
        ensure!((1..TO_INSPECT).contains(&many.resident), "{name}: {} KiB", many.resident);
    }
    // beyond that, 36 million nodes, it names the array
    let (many, _) = inspect(&alone.replace("cells = [4, 4]", "cells = [3463, 3463]"))?;
    ensure!(many.code == Some(2) && many.said.contains("array `block` has 2303"), "{many:?}");
    ensure!((1..TO_INSPECT).contains(&many.resident), "{} KiB", many.resident);
    Ok(())
}

fn a_verification_beyond_memory_is_refused_before_its_first_case() -> Outcome {
    let work = Work::with(&scene())?;
    let least = least(&work, 4_000_000)?;
    // the largest case is 59,536 nodes in contact, 155 MB of the estimate
    let verify = ["verify", "--backend", "cpu", "--out", "page"];
    let end = under(&work, Some(least + 50_000), &verify)?;
    // it has no scene that could be changed
    let told = ["error: the case ", " GB are free; close what takes memory", "--quick"];
    ensure!(told.iter().all(|part| end.said.contains(part)), "{end:?}");
    ensure!(end.code == Some(1) && end.said.lines().count() == 1 && !end.said.contains("cells"), "{end:?}");
    ensure!(!work.path("page").exists(), "the folder is left");
    Ok(())
}

/// The counter-test of what counts as words.
fn an_end_without_words_is_noticed() -> Outcome {
    let end = |code, said: &str| End { code, said: said.into(), peak: 0, resident: 0 };
    let told = "error: no memory is left for a picture: 9 bytes were refused; take fewer";
    let report = serde_json::json!({ "steps": 3, "error": told.trim_start_matches("error: ") });
    fits(&end(Some(1), told), Some(&report), 3)?;
    fits(&end(None, "memory allocation of 9 bytes failed"), None, 3)?;
    let wrong = [
        fits(&end(None, ""), None, 3),
        fits(&end(Some(101), "thread 'main' panicked"), None, 3),
        fits(&end(Some(1), "error: it failed; mend it"), Some(&report), 3),
        fits(&end(Some(1), told), None, 3),
        fits(&end(Some(1), told), Some(&report), 2),
        fits(&end(Some(0), ""), None, 4),
    ];
    ensure!(wrong.iter().all(Result::is_err), "{wrong:?}");
    Ok(())
}
