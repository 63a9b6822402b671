//! A run that was killed and goes on from its checkpoint ends as one that was not; what is no checkpoint of the run is refused.

use super::Outcome;
use super::work::{PRESS, Work};
use crate::ensure;
use cutis::math::random::Random;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// Tests of this file.
pub const TESTS: &[super::Test] = &[
    ("a_killed_run_goes_on_to_the_same_end", a_killed_run_goes_on_to_the_same_end),
    ("a_run_killed_after_its_last_step_gets_its_report", a_run_killed_after_its_last_step_gets_its_report),
    ("a_checkpoint_that_does_not_fit_is_refused", a_checkpoint_that_does_not_fit_is_refused),
    ("a_damaged_checkpoint_is_refused", a_damaged_checkpoint_is_refused),
];

/// Kills of each scene.
const KILLS: u32 = 10;
/// A run is killed within this time of its start, ms.
const MOMENT: u64 = 400;

/// A simulated hand that the tip pushes back, and pictures.
fn pressed() -> String {
    let changes = [
        ("duration_s = 0.025", "duration_s = 0.2"),
        ("frames = 2", "frames = 5"),
        ("points_mm = [[0.0, 0.0, 0.0]]", "points_mm = [[0.0, 0.0, 0.0]]\ndevice = { kind = \"hand\" }"),
    ];
    changes.iter().fold(PRESS.to_string(), |text, (old, new)| {
        assert!(text.contains(old));
        text.replace(old, new)
    })
}

/// The shipped incision on few cells, past its first cuts.
pub fn cut() -> String {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let text = std::fs::read_to_string(scenes.join("incision.toml")).expect("it is shipped");
    let whole = |key: &str| (format!("{key} = \""), format!("{key} = \"{}/", scenes.display()));
    let ((mesh, whole_mesh), (hand, whole_hand)) = (whole("mesh"), whole("trajectory"));
    let mut lines: Vec<String> = vec![];
    for line in text.lines() {
        lines.push(match line.split(" = ").next().unwrap_or_default() {
            "cells" if line.contains('[') => "cells = [24, 5]".into(),
            "duration_s" => "duration_s = 0.3".into(),
            "frames" => "frames = 3".into(),
            _ => line.replace(&mesh, &whole_mesh).replace(&hand, &whole_hand),
        });
    }
    let text = lines.join("\n");
    text.split("[check]").next().unwrap_or_default().split("[study]").next().unwrap_or_default().to_string()
}

fn start(work: &Work, out: &str) -> Result<Child, String> {
    let mut run = Command::new(env!("CARGO_BIN_EXE_cutis"));
    run.args(["run", "scene.toml", "--backend", "cpu", "--checkpoint", "1", "--out", out]).current_dir(work.path("."));
    let kept = format!("{out}/checkpoint.bin");
    if work.path(&kept).exists() {
        run.args(["--resume", &kept]);
    }
    run.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().map_err(|e| e.to_string())
}

/// What a run has left, but for what the clock says: names and bytes.
fn left(folder: &Path) -> Result<Vec<(String, Vec<u8>)>, String> {
    let list = |path: &Path| {
        std::fs::read_dir(path).into_iter().flatten().flatten().map(|e| e.path()).collect::<Vec<PathBuf>>()
    };
    let mut files = [list(folder), list(&folder.join("frames")), list(&folder.join("vtu"))].concat();
    files.retain(|path| path.is_file() && !path.ends_with("checkpoint.bin"));
    files.sort();
    let mut out = vec![];
    for path in files {
        let mut bytes = std::fs::read(&path).map_err(|e| e.to_string())?;
        if path.ends_with("report.json") {
            let mut report: serde_json::Value = serde_json::from_slice(&bytes).map_err(|e| e.to_string())?;
            let keys = report.as_object_mut().ok_or("a report is a table")?;
            ["wall_s", "step_ms", "costs"].iter().for_each(|key| drop(keys.remove(*key)));
            bytes = report.to_string().into_bytes();
        }
        if path.ends_with("cutis-files.txt") {
            let text = String::from_utf8(bytes).map_err(|e| e.to_string())?;
            let mut names: Vec<&str> = text.lines().collect();
            names.sort_unstable();
            bytes = names.join("\n").into_bytes();
        }
        out.push((path.strip_prefix(folder).map_err(|e| e.to_string())?.display().to_string(), bytes));
    }
    Ok(out)
}

/// Runs to the end, or is killed after some time; whether it has ended.
fn ended(work: &Work, out: &str, after: Option<Duration>) -> Result<bool, String> {
    let mut run = start(work, out)?;
    if let Some(after) = after {
        std::thread::sleep(after);
        run.kill().map_err(|e| e.to_string())?;
    }
    let done = run.wait_with_output().map_err(|e| e.to_string())?;
    let killed = done.status.code().is_none();
    ensure!(killed || done.status.success(), "{}: {}", done.status, String::from_utf8_lossy(&done.stderr));
    Ok(!killed)
}

fn same(work: &Work, out: &str, wanted: &[(String, Vec<u8>)]) -> Outcome {
    let found = left(&work.path(out))?;
    let names = |list: &[(String, Vec<u8>)]| list.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>();
    ensure!(names(&found) == names(wanted), "{:?} instead of {:?}", names(&found), names(wanted));
    for ((name, found), (_, wanted)) in found.iter().zip(wanted) {
        let at = found.iter().zip(wanted).position(|(a, b)| a != b).unwrap_or(found.len().min(wanted.len()));
        let near = |bytes: &[u8]| {
            String::from_utf8_lossy(&bytes[at.saturating_sub(40)..(at + 40).min(bytes.len())]).into_owned()
        };
        ensure!(found == wanted, "{name} at byte {at}: {} instead of {}", near(found), near(wanted));
    }
    Ok(())
}

/// Copies a folder; an empty one, where a run was killed before it made any.
fn copy(from: &Path, to: &Path) -> Outcome {
    std::fs::create_dir_all(to).map_err(|e| e.to_string())?;
    if !from.exists() {
        return Ok(());
    }
    for entry in std::fs::read_dir(from).map_err(|e| e.to_string())? {
        let path = entry.map_err(|e| e.to_string())?.path();
        let target = to.join(path.file_name().unwrap_or_default());
        match path.is_dir() {
            true => copy(&path, &target)?,
            false => drop(std::fs::copy(&path, &target).map_err(|e| e.to_string())?),
        }
    }
    Ok(())
}

fn a_killed_run_goes_on_to_the_same_end() -> Outcome {
    for (scene, wants_cut) in [(pressed(), false), (cut(), true)] {
        let work = Work::with(&scene)?;
        ensure!(ended(&work, "whole", None)?, "it ends");
        let wanted = left(&work.path("whole"))?;
        let report: serde_json::Value =
            serde_json::from_str(&work.read("whole/report.json")?).map_err(|e| e.to_string())?;
        let severed = report["cut"]["links_severed"].as_u64().unwrap_or_default();
        ensure!(wants_cut == (severed > 0), "{severed} links are severed");
        let (mut random, mut kills, mut resumed, mut whole) = (Random::new(7), 0, 0, 0);
        while kills < KILLS {
            resumed += u32::from(work.path("killed/checkpoint.bin").exists());
            if ended(&work, "killed", Some(Duration::from_millis(random.below(MOMENT))))? {
                same(&work, "killed", &wanted)?;
                std::fs::remove_dir_all(work.path("killed")).map_err(|e| e.to_string())?;
            } else {
                kills += 1;
                // what this kill has left goes on to the end; the run itself goes on to the next kill
                copy(&work.path("killed"), &work.path("resumed"))?;
                whole += u32::from(work.path("resumed/checkpoint.bin").exists());
                ensure!(ended(&work, "resumed", None)?, "it ends");
                same(&work, "resumed", &wanted)?;
                std::fs::remove_dir_all(work.path("resumed")).map_err(|e| e.to_string())?;
            }
        }
        println!("{kills} kills, {resumed} times gone on, {whole} times to the end");
        ensure!(resumed.min(whole) > KILLS / 3, "gone on {resumed} times, {whole} times to the end");
    }
    Ok(())
}

/// A folder with a checkpoint after ten steps of 40.
fn begun() -> Result<Work, String> {
    let work = Work::with(&pressed())?;
    let said = work.cutis(&["run", "scene.toml", "--backend", "cpu", "--checkpoint", "10", "--steps", "10"])?;
    ensure!(said.code == 0, "{}", said.err);
    Ok(work)
}

fn a_run_killed_after_its_last_step_gets_its_report() -> Outcome {
    let work = begun()?;
    let wanted = left(&work.path("out"))?;
    std::fs::rename(work.path("out"), work.path("killed")).map_err(|e| e.to_string())?;
    std::fs::remove_file(work.path("killed/report.json")).map_err(|e| e.to_string())?;
    let resume = ["--resume", "killed/checkpoint.bin", "--out", "killed", "--steps", "10"];
    let said = work.cutis(&[&["run", "scene.toml", "--backend", "cpu"], &resume[..]].concat())?;
    ensure!(said.code == 0, "{}: {}", said.code, said.err);
    same(&work, "killed", &wanted)
}

fn refused(work: &Work, arguments: &[&str], says: &str) -> Outcome {
    let before = work.read("out/probes.csv")?;
    let said = work
        .cutis(&[&["run", "scene.toml", "--backend", "cpu", "--resume", "out/checkpoint.bin"], arguments].concat())?;
    ensure!(said.code == 2 && said.err.contains(says), "{arguments:?}: {}: {} without \"{says}\"", said.code, said.err);
    ensure!(["checkpoint.bin", "probes.csv", "haptic.csv"].iter().any(|name| said.err.contains(name)), "{}", said.err);
    ensure!(work.read("out/probes.csv")? == before, "what was refused has written");
    Ok(())
}

fn a_checkpoint_that_does_not_fit_is_refused() -> Outcome {
    let work = begun()?;
    refused(&work, &["--steps", "9"], "was written after step 10, and 9 steps are asked for")?;
    refused(&work, &["--precision", "f32"], "is of a run on cpu f64, and this one is on cpu f32")?;
    refused(&work, &["--tolerance", "1e-4"], "is not the one that is to be run")?;
    let scene = work.read("scene.toml")?;
    work.write("scene.toml", &scene.replace("young_kpa = 100.0", "young_kpa = 100.1"))?;
    refused(&work, &[], "which is not the one that is to be run")?;
    work.write("scene.toml", &scene)?;
    let hand = work.read("hand.csv")?;
    work.write("hand.csv", &hand.replace("1.7", "1.71"))?;
    refused(&work, &[], "which is not the one that is to be run")?;
    work.write("hand.csv", &hand)?;
    let said = work.cutis(&["run", "scene.toml", "--resume", "nowhere.bin"])?;
    ensure!(said.code == 2 && said.err.contains("nowhere.bin") && said.err.contains("cannot be read"), "{}", said.err);
    // in another folder, and in one whose table was cut
    let elsewhere = ["run", "scene.toml", "--backend", "cpu", "--resume", "out/checkpoint.bin", "--out", "other"];
    let said = work.cutis(&elsewhere)?;
    ensure!(said.code == 2 && said.err.contains("resume in the folder of the run"), "{}: {}", said.code, said.err);
    // in the folder of another run, whose tables have the same columns
    let scene_there = scene.replace("young_kpa = 100.0", "young_kpa = 50.0");
    work.write("other.toml", &scene_there)?;
    ensure!(work.cutis(&["run", "other.toml", "--backend", "cpu", "--out", "other"])?.code == 0, "it runs");
    let there = left(&work.path("other"))?;
    let said = work.cutis(&elsewhere)?;
    ensure!(
        said.code == 2 && said.err.contains("is of another run than the checkpoint"),
        "{}: {}",
        said.code,
        said.err
    );
    ensure!(left(&work.path("other"))? == there, "another run's results were changed");
    // nothing is touched where one of the tables does not fit
    let ticks = work.read("out/haptic.csv")?;
    work.write("out/haptic.csv", &ticks[..ticks.len() / 2])?;
    refused(&work, &[], "")?;
    work.write("out/haptic.csv", &ticks)?;
    let table = work.read("out/probes.csv")?;
    work.write("out/probes.csv", &table[..table.len() / 2])?;
    refused(&work, &[], "is shorter than when the checkpoint was written")?;
    work.write("out/probes.csv", &table)?;
    // the counter-test
    let said = work.cutis(&["run", "scene.toml", "--backend", "cpu", "--resume", "out/checkpoint.bin"])?;
    ensure!(said.code == 0, "{}", said.err);
    Ok(())
}

fn a_damaged_checkpoint_is_refused() -> Outcome {
    let work = begun()?;
    let path = work.path("out/checkpoint.bin");
    let whole = std::fs::read(&path).map_err(|e| e.to_string())?;
    let with = |bytes: &[u8], says: &str| {
        std::fs::write(&path, bytes).map_err(|e| e.to_string())?;
        refused(&work, &[], says)
    };
    with(b"", "is no checkpoint of cutis")?;
    with(work.read("scene.toml")?.as_bytes(), "is no checkpoint of cutis")?;
    for length in [16, 19, 35, 36, whole.len() / 2, whole.len() - 1] {
        with(&whole[..length], "is cut off")?;
    }
    with(&[&whole[..], b"x"].concat(), "is damaged")?;
    let changed = |at: usize| {
        let mut bytes = whole.clone();
        bytes[at] ^= 0x10;
        bytes
    };
    for at in [28, 36, whole.len() / 3, whole.len() - 1] {
        with(&changed(at), "is damaged")?;
    }
    with(&changed(16), "is of a newer program (format 29; this one reads 13)")?;
    let mut older = whole.clone();
    older[16] = 0;
    with(&older, "is of an older program (format 0; this one reads 13)")?;
    Ok(())
}
