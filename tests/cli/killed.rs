//! A run that is killed, or that an error ends: what it leaves can be read, and holds what was done.

use super::Outcome;
use super::work::Work;
use crate::ensure;
use cutis::math::random::Random;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Tests of this file.
pub const TESTS: &[super::Test] = &[
    ("a_killed_run_leaves_whole_files", a_killed_run_leaves_whole_files),
    ("an_interrupted_run_leaves_whole_files", an_interrupted_run_leaves_whole_files),
    ("a_cut_off_file_is_noticed", a_cut_off_file_is_noticed),
    ("a_run_that_overflows_ends_with_what_it_has", a_run_that_overflows_ends_with_what_it_has),
];

/// A picture and meshes in every other step, rows in all of them; far longer than it is let run.
const LONG: [(&str, &str); 4] = [
    ("duration_s = 0.025", "duration_s = 60.0"),
    ("frames = 2", "frames = 6000"),
    ("true_residual_every = 2", "true_residual_every = 100000"),
    ("points_mm = [[0.0, 0.0, 0.0]]", "points_mm = [[0.0, 0.0, 0.0]]\ndevice = { kind = \"replay\" }"),
];

/// How many runs are killed, each at another moment within the first second or so of its results.
const KILLED: u64 = 24;

pub fn long() -> String {
    LONG.iter().fold(super::work::PRESS.to_string(), |text, (old, new)| {
        assert!(text.contains(old));
        text.replace(old, new)
    })
}

/// Starts a run, waits until its folder has something and `moment` longer, ends it with a signal.
fn ended_by(work: &Work, signal: &str, moment: Duration) -> Outcome {
    let mut run = Command::new(env!("CARGO_BIN_EXE_cutis"));
    run.args(["run", "scene.toml", "--backend", "cpu", "--record"]).current_dir(work.path("."));
    let mut run = run.stdout(Stdio::null()).stderr(Stdio::null()).spawn().map_err(|e| e.to_string())?;
    let begin = Instant::now();
    while !work.path("out/probes.csv").exists() && begin.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(1));
    }
    std::thread::sleep(moment);
    let kill = Command::new("kill").args([signal, &run.id().to_string()]).status().map_err(|e| e.to_string())?;
    let ended = run.wait().map_err(|e| e.to_string())?;
    ensure!(kill.success() && !ended.success(), "it was to be killed, and ended with {ended}");
    Ok(())
}

/// A table of numbers, and of words in some columns: whole lines with as many values as the header has names.
fn table(text: &str) -> Result<usize, String> {
    let columns: Vec<&str> = text.lines().next().ok_or("no header")?.split(',').collect();
    let is_word = |column: &str| ["first", "second", "kind"].contains(&column);
    ensure_whole(text.ends_with('\n'), "the last line is cut off")?;
    for line in text.lines().skip(1) {
        ensure_whole(line.split(',').count() == columns.len(), line)?;
        let mut cells = line.split(',').zip(&columns);
        ensure_whole(cells.all(|(value, column)| is_word(column) || value.parse::<f64>().is_ok()), line)?;
    }
    Ok(text.lines().count() - 1)
}

fn ensure_whole(holds: bool, what: &str) -> Outcome {
    if holds { Ok(()) } else { Err(format!("not whole: {what}")) }
}

/// A picture that decodes to its last row.
fn picture(path: &Path) -> Outcome {
    let file = std::io::BufReader::new(std::fs::File::open(path).map_err(|e| e.to_string())?);
    let mut reader = png::Decoder::new(file).read_info().map_err(|e| e.to_string())?;
    let mut pixels = vec![0; reader.output_buffer_size().ok_or("too large")?];
    reader.next_frame(&mut pixels).map_err(|e| e.to_string())?;
    reader.finish().map_err(|e| e.to_string())
}

fn mesh(path: &Path) -> Outcome {
    let bytes = std::fs::read(path).map_err(|e| format!("{}: {e}", path.display()))?;
    cutis::formats::read_grid(&bytes, path).map(drop).map_err(|e| e.to_string())
}

/// A `.pvd`: closed, and each mesh that it names is there and whole; how many they are.
fn series(folder: &Path, name: &str) -> Result<usize, String> {
    let text = std::fs::read_to_string(folder.join(name)).map_err(|e| e.to_string())?;
    ensure_whole(text.trim_end().ends_with("</VTKFile>") && text.contains("</Collection>"), name)?;
    let files: Vec<&str> = text.split("file=\"").skip(1).filter_map(|rest| rest.split('"').next()).collect();
    files.iter().try_for_each(|file| mesh(&folder.join(file)))?;
    Ok(files.len())
}

/// Reads everything in a folder of results; how many steps and meshes there are.
pub fn read_back(folder: &Path) -> Result<[usize; 2], String> {
    let (mut steps, mut meshes, mut listed) = (0, 0, vec![]);
    let mut found = vec![];
    let entries =
        |path: &Path| std::fs::read_dir(path).into_iter().flatten().flatten().map(|e| e.path()).collect::<Vec<_>>();
    for path in [entries(folder), entries(&folder.join("frames")), entries(&folder.join("vtu"))].concat() {
        if path.is_dir() {
            continue;
        }
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default().to_string();
        found.push(path.strip_prefix(folder).map_err(|e| e.to_string())?.display().to_string());
        let text = || std::fs::read_to_string(&path).map_err(|e| e.to_string());
        match name.rsplit('.').next().unwrap_or_default() {
            "csv" => {
                let rows = table(&text()?).map_err(|e| format!("{name}: {e}"))?;
                steps = if name == "probes.csv" { rows } else { steps };
            }
            "json" => {
                let report: serde_json::Value = serde_json::from_str(&text()?).map_err(|e| format!("{name}: {e}"))?;
                ensure!(report["steps"].as_u64() > Some(0), "{name}: {report}");
            }
            "png" => picture(&path)?,
            "vtu" => mesh(&path)?,
            "pvd" => meshes += series(folder, &name)?,
            // written beside its place and not yet there, or room kept for the report: it passes for no result
            "tmp" | "bin" => {}
            "txt" => listed = text()?.lines().map(String::from).collect(),
            _ => return Err(format!("{name} is no result")),
        }
    }
    // each file is on the list of those that a next run may remove
    found.retain(|name| name != "cutis-files.txt" && !listed.contains(&name.trim_end_matches(".tmp").to_string()));
    ensure!(found.is_empty(), "{found:?} are not on the list");
    Ok([steps, meshes])
}

fn a_killed_run_leaves_whole_files() -> Outcome {
    let work = Work::with(&long())?;
    let (mut random, mut found) = (Random::new(15), vec![]);
    for _ in 0..KILLED {
        // the folder of the last one stays, as it does for who runs again
        ended_by(&work, "-KILL", Duration::from_micros(random.below(400_000)))?;
        found.push(read_back(&work.path("out"))?);
    }
    println!("steps and meshes of killed runs: {found:?}");
    let most = found.iter().fold([0, 0], |[a, b], [steps, meshes]| [a.max(*steps), b.max(*meshes)]);
    ensure!(most[0] > 10 && most[1] > 4, "they were killed before they had done anything: {found:?}");
    Ok(())
}

fn an_interrupted_run_leaves_whole_files() -> Outcome {
    let work = Work::with(&long())?;
    ended_by(&work, "-TERM", Duration::from_millis(300))?;
    let [steps, _] = read_back(&work.path("out"))?;
    ensure!(steps > 0, "nothing was done");
    let hand = work.read("out/hand_tip.csv")?;
    // 5 ticks a step; 64 of them wait for a flush at most
    ensure!(hand.lines().count() + 64 + 5 >= 5 * steps, "{} ticks of {steps} steps are recorded", hand.lines().count());
    Ok(())
}

/// The counter-test: each kind of file, with its end cut off.
fn a_cut_off_file_is_noticed() -> Outcome {
    let work = Work::with(super::work::PRESS)?;
    work.json(&["run", "scene.toml", "--backend", "cpu", "--json"], 0)?;
    let out = work.path("out");
    ensure!(read_back(&out)? == [5, 8], "{:?}", read_back(&out)?);
    let files = [
        "report.json",
        "probes.csv",
        "energy.csv",
        "haptic.csv",
        "volume.pvd",
        "frames/frame_0001.png",
        "vtu/volume_0002.vtu",
        "vtu/surface_0001.vtu",
    ];
    for name in files {
        let bytes = std::fs::read(out.join(name)).map_err(|e| e.to_string())?;
        std::fs::write(out.join(name), &bytes[..bytes.len() - bytes.len() / 4 - 3]).map_err(|e| e.to_string())?;
        ensure!(read_back(&out).is_err(), "{name} without its end passes");
        std::fs::write(out.join(name), bytes).map_err(|e| e.to_string())?;
    }
    std::fs::remove_file(out.join("vtu/volume_0001.vtu")).map_err(|e| e.to_string())?;
    ensure!(read_back(&out).is_err(), "a series may name what is not there");
    Ok(())
}

/// The hand goes as far as numbers do in the fourth step.
fn a_run_that_overflows_ends_with_what_it_has() -> Outcome {
    // the largest force that single precision holds, in the fourth step
    let load = "[[load]]\nregion = \"top\"\nforce_n = [0.0, 0.0, 3e38]\nstart_s = 0.015\n";
    let work = Work::with(&format!("{}\n{load}", super::work::PRESS))?;
    let said = work.cutis(&["run", "scene.toml", "--backend", "cpu", "--precision", "f32", "--record"])?;
    let told = said.err.contains("scene.toml:4: the body \"skin\" is non-finite at 0.02 s");
    ensure!(said.code == 1 && told, "{}: {}", said.code, said.err);
    let report: serde_json::Value = serde_json::from_str(&work.read("out/report.json")?).map_err(|e| e.to_string())?;
    ensure!(report["steps"] == 3 && report["contact_force_n_max"].as_f64() > Some(0.01), "{report}");
    ensure!(report["error"].as_str().is_some_and(|e| said.err.contains(e)), "{report}");
    ensure!(read_back(&work.path("out"))? == [3, 4], "{:?}", read_back(&work.path("out"))?);
    Ok(())
}
