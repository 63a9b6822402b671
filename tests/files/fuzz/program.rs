//! The built program on command lines at random, and on outputs that take nothing. It ends with an exit status that `cutis --help` lists
//! and, unless that is 0, with words; it leaves the files of others as they are, and its own ones whole.

use super::bounds::{Folder, count, tried};
use proptest::collection::vec;
use proptest::prelude::*;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs::{self, File};
use std::os::unix::ffi::OsStringExt;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::sync::LazyLock;

/// A block of four cells for 20 steps.
const SCENE: &str = r#"title = "A block settles"
time = { step_ms = 5.0, duration_s = 0.1 }
skin = { size_mm = [4.0, 4.0], cells = [2, 2], layer = [
    { name = "dermis", thickness_mm = 2.0, cells = 1, young_kpa = 100.0, poisson = 0.4, density_kg_m3 = 1100.0 },
] }
boundary = [{ region = "bottom" }]
probe = [{ name = "top", kind = "displacement", point_mm = [0.0, 0.0, 2.0] }]
view = { frames = 1, size_px = [48, 32] }
"#;

/// Checks of it that fail.
const CHECKS: &str = "check = { steps = { min = 1000 } }\n";

/// Folder with the scenes of the command lines; `out`, where results go unless `--out` says otherwise, is a file there.
fn folder() -> Folder {
    let folder = Folder::new();
    for (name, text) in [
        ("scene.toml", SCENE),
        ("checked.toml", &format!("{SCENE}{CHECKS}")),
        ("broken.toml", &SCENE.replace("poisson = 0.4", "poisson = 0.5")),
        ("out", "in the way\n"),
    ] {
        fs::write(folder.0.join(name), text).expect("the folder takes files");
    }
    folder
}

fn cutis(folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_cutis"));
    command.current_dir(folder).stdin(Stdio::null()).env_remove("RAYON_NUM_THREADS");
    // without it some drivers write lines that begin as ours do
    command.env("XDG_RUNTIME_DIR", folder);
    command
}

/// An option as the help has it, and the name of its value.
type Flag = (String, Option<String>);

/// Commands with their options, read from the program's own help; the first one is that of no command.
static COMMANDS: LazyLock<Vec<(String, Vec<Flag>)>> = LazyLock::new(|| {
    let help = |command: &str| {
        let words = command.split_whitespace().chain(["--help"]);
        let said = cutis(Path::new(".")).args(words).output().expect("the program starts");
        assert!(said.status.success(), "{said:?}");
        String::from_utf8(said.stdout).expect("it is text")
    };
    let top = help("");
    let listed = top.lines().skip_while(|line| *line != "Commands:").skip(1).take_while(|line| !line.is_empty());
    let names = listed.filter_map(|line| line.strip_prefix("  ")?.split(' ').next()).filter(|name| !name.is_empty());
    let mut commands = vec![(String::new(), flags(&top))];
    commands.extend(names.filter(|name| *name != "help").map(|name| (name.into(), flags(&help(name)))));
    commands.push(("help".into(), vec![]));
    commands
});

/// Options in a help text.
fn flags(help: &str) -> Vec<Flag> {
    let of_line = |line: &str| {
        let at = line.find("--").filter(|at| *at <= 6 && line.starts_with("  "))?;
        let mut words = line[at..].split(' ');
        let value = |word: &str| Some(word.strip_prefix('<')?.trim_end_matches('>').to_string());
        Some((words.next()?.to_string(), words.next().and_then(value)))
    };
    help.lines().filter_map(of_line).collect()
}

/// Values of an option, good and broken ones. A step count has to be small, since a run takes as many steps as are asked for.
fn values(name: &str) -> &'static [&'static str] {
    match name {
        "N" => &["1", "3", "20", "0", "-1", "1.5", "4294967296", "x", ""],
        "T" => &["0.005", "0.02", "0", "-1", "nan", "inf", "1e300", "soon", ""],
        "R" => &["1e-3", "0.5", "0", "1", "2", "-1e-3", "nan", ""],
        "TEXT" => &["no such thing", "", "\u{1b}[2J"],
        "DIR" => &["made", "made/deep", "out", "scene.toml", ".", "", "/dev/full", "/dev/null/made"],
        "FILE" => &["made/checkpoint.bin", "scene.toml", "missing", ".", "/dev/zero", ""],
        "ID" => &["A", "é", " ", "", "\u{1b}[2J"],
        "NAME" => &["tip", "", "-"],
        "ADDRESS" => &["127.0.0.1:0", "127.0.0.1", "8.8.8.8:1", "[::1]:x", ""],
        "SCENE" => &SCENES,
        "BACKEND" => &["cpu", "auto", "cuda", "CPU", ""],
        "PRECISION" => &["f32", "f64", "f16", ""],
        "COLOR" => &["displacement", "von-mises", "layer", "red", ""],
        "W" => &["32", "0", "9000", "x", ""],
        "X" => &["1", "-1", "nan", "x", ""],
        "PRECONDITIONER" => &["none", "jacobi", "block", "column", "multigrid", "direct", "best", ""],
        _ => panic!("no values of <{name}> are tried; add some"),
    }
}

const SCENES: [&str; 9] =
    ["scene.toml", "checked.toml", "scene.toml", "broken.toml", "missing.toml", ".", "/dev/zero", "", "steps"];

/// Values of RAYON_NUM_THREADS.
const THREADS: [Option<&str>; 8] = [None, None, None, Some("1"), Some("0"), Some("-1"), Some("100000"), Some("x")];

/// A change of the words; positions count around.
#[derive(Clone, Debug)]
enum Change {
    Drop(usize),
    Swap(usize, usize),
    Copy(usize, usize),
    /// A word ends after so many bytes, which may split a letter.
    End(usize, usize),
    Insert(usize, Vec<u8>),
}

fn lines() -> impl Strategy<Value = (Vec<OsString>, Option<&'static str>)> {
    let of_command = |(command, flags): (String, Vec<Flag>)| {
        let option = (0..flags.len().max(1), any::<usize>(), any::<bool>()).prop_map(move |(k, n, joined)| {
            let Some((flag, value)) = flags.get(k) else { return vec![] };
            let value = value.as_ref().map(|name| values(name)[n % values(name).len()]);
            match (value, joined) {
                (Some(value), true) => vec![format!("{flag}={value}")],
                (Some(value), false) => vec![flag.clone(), value.to_string()],
                (None, _) => vec![flag.clone()],
            }
        });
        let scene = prop::sample::select(&SCENES[..]).prop_map(|scene| vec![scene.to_string()]);
        let parts = prop_oneof![1 => scene.clone(), 2 => option];
        (Just(command), vec(scene, 0..2), vec(parts, 0..4))
    };
    // nothing here is a number or a path that leads out of the folder
    let text = "[^0-9/.\\x00]{0,5}".prop_map(String::into_bytes);
    let word = prop_oneof![text, vec(0x80u8..=0xff, 1..4), Just(b"--".to_vec()), Just(b"--json".to_vec())];
    let place = || 0..64usize;
    let change = prop_oneof![
        place().prop_map(Change::Drop),
        (place(), place()).prop_map(|(a, b)| Change::Swap(a, b)),
        (place(), place()).prop_map(|(from, to)| Change::Copy(from, to)),
        (place(), place()).prop_map(|(at, bytes)| Change::End(at, bytes)),
        (place(), word).prop_map(|(at, word)| Change::Insert(at, word)),
    ];
    let changes = prop_oneof![Just(vec![]), vec(change, 1..4)];
    let line = (0..COMMANDS.len()).prop_flat_map(move |k| of_command(COMMANDS[k].clone()));
    (line, changes, prop::sample::select(&THREADS[..])).prop_map(|((command, scenes, parts), changes, threads)| {
        let words = [command].into_iter().filter(|word| !word.is_empty()).chain(scenes.concat()).chain(parts.concat());
        let mut words: Vec<Vec<u8>> = words.map(String::into_bytes).collect();
        changes.into_iter().for_each(|change| apply(change, &mut words));
        if takes_long(&words) {
            words.push(b"--no-such-option".to_vec());
        }
        (words.into_iter().map(OsString::from_vec).collect(), threads)
    })
}

fn apply(change: Change, words: &mut Vec<Vec<u8>>) {
    let count = words.len();
    match change {
        Change::Insert(at, word) => words.insert(at % (count + 1), word),
        _ if count == 0 => {}
        Change::Drop(at) => drop(words.remove(at % count)),
        Change::Swap(a, b) => words.swap(a % count, b % count),
        Change::Copy(from, to) => {
            let word = words[from % count].clone();
            words.insert(to % count, word);
        }
        Change::End(at, bytes) => {
            let word = &mut words[at % count];
            word.truncate(bytes % (word.len() + 1));
        }
    }
}

/// Whether it would compute for minutes or wait for clients, were it not refused: verification, comparison and study, the built-in scene
/// into a folder that takes it, the stand-in for devices, the server of pages, and the window.
fn takes_long(words: &[Vec<u8>]) -> bool {
    let has = |word: &str| words.iter().any(|found| found == word.as_bytes());
    let holds = |part: &str| words.iter().any(|found| String::from_utf8_lossy(found).contains(part));
    let made = holds("--out") || holds("made") || has(".");
    let waits = (has("haply-mock") && !has("--until-stdin-ends")) || has("serve") || has("view");
    // without an adapter these two end at once
    let adapter = [&b"--adapter"[..], b"no such thing"];
    let nobody = words.windows(2).any(|pair| pair == adapter) || has("--adapter=no such thing");
    let computes = has("study") || ((has("verify") || has("compare")) && !nobody);
    waits || computes || (made && !has("scene.toml") && !has("checked.toml"))
}

/// What every end has: a status of the documented ones, words if it is not 0, and as JSON where that was asked for.
fn ended(said: &Output, as_json: bool) -> Result<(), String> {
    let error = String::from_utf8_lossy(&said.stderr);
    let words = |wanted: &str| error.lines().any(|line| line.starts_with(wanted));
    let holds = match said.status.code() {
        Some(0) => true,
        Some(1) => words("error: ") || words("check failed: "),
        Some(2 | 3) => words("error: "),
        _ => false,
    };
    let is_json = || serde_json::from_slice::<serde_json::Value>(&said.stdout).is_ok_and(|v| !v.is_null());
    let as_asked = said.status.success() || !as_json || is_json();
    match holds && as_asked && !error.contains("panicked") {
        true => Ok(()),
        false => Err(format!("{}: {error}{}", said.status, String::from_utf8_lossy(&said.stdout))),
    }
}

#[test]
fn command_lines_end_with_a_documented_status_and_words() {
    // a process each, so fewer
    let cases = count(40);
    let statuses = RefCell::new(BTreeMap::new());
    tried(cases, lines(), |(words, threads)| {
        let folder = folder();
        let mut command = cutis(&folder.0);
        let said = command
            .args(words)
            .envs(threads.map(|count| ("RAYON_NUM_THREADS", count)))
            .output()
            .map_err(|e| e.to_string())?;
        let as_json = words.iter().any(|word| word == "--json") && !words.iter().any(|word| word == "--");
        ended(&said, as_json)?;
        *statuses.borrow_mut().entry(said.status.code()).or_insert(0) += 1;
        match fs::read_to_string(folder.0.join("out")) {
            Ok(text) if text == "in the way\n" => Ok(()),
            other => Err(format!("a file of the user is now {other:?}")),
        }
    });
    println!("exit status and number of command lines: {:?}", statuses.borrow());
    assert!(cases < 200 || (0..3).all(|code| statuses.borrow().contains_key(&Some(code))), "{:?}", statuses.borrow());
}

#[test]
fn every_command_and_option_of_the_help_is_tried() {
    let names: Vec<&str> = COMMANDS.iter().map(|(name, _)| &**name).collect();
    for name in [
        "",
        "run",
        "compare",
        "study",
        "verify",
        "inspect",
        "check",
        "keys",
        "serve",
        "view",
        "adapters",
        "haply-mock",
        "help",
    ] {
        assert!(names.contains(&name), "{name:?} of {names:?}");
    }
    let run = &COMMANDS[1].1;
    for flag in [("--steps", Some("N")), ("--json", None), ("--out", Some("DIR")), ("--help", None)] {
        assert!(run.contains(&(flag.0.into(), flag.1.map(String::from))), "{flag:?} of {run:?}");
    }
    let named = COMMANDS.iter().flat_map(|(_, flags)| flags).filter_map(|(_, value)| value.as_ref());
    assert!(named.map(|name| values(name).len()).min() > Some(2));
}

/// Where an output goes.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Sink {
    Pipe,
    /// A pipe whose reader has ended.
    Broken,
    /// No descriptor at all.
    Closed,
    Full,
}

/// What is in the way of the results.
#[derive(Clone, Debug, PartialEq)]
enum Way {
    Free,
    /// A file of somebody else with the name of a result.
    Foreign(&'static str),
    /// A folder where a file goes.
    Folder(&'static str),
    /// A file where the folder goes.
    File,
    /// No folder can be made there.
    Nowhere,
    /// Files end after so many units of `ulimit -f`.
    Limit(u32),
}

#[derive(Clone, Debug)]
struct Faults {
    command: &'static [&'static str],
    out: Sink,
    err: Sink,
    way: Way,
}

/// Commands that print on standard output; the first two write files too.
const PRINTING: [&[&str]; 7] = [
    &["run", "scene.toml", "--backend", "cpu", "--out", "results"],
    &["run", "scene.toml", "--backend", "cpu", "--out", "results", "--json", "--checkpoint", "3"],
    &["inspect", "scene.toml", "--json"],
    &["check", "scene.toml", "scene.toml"],
    &["keys"],
    &["adapters", "--json"],
    &["--help"],
];

const RESULTS: [&str; 6] =
    ["report.json", "probes.csv", "energy.csv", "volume.pvd", "frames/frame_0001.png", "vtu/volume_0001.vtu"];

fn faults() -> impl Strategy<Value = Faults> {
    let sink = || prop::sample::select(&[Sink::Pipe, Sink::Broken, Sink::Closed, Sink::Full][..]);
    let result = || prop::sample::select(&RESULTS[..]);
    let way = prop_oneof![
        2 => Just(Way::Free),
        2 => result().prop_map(Way::Foreign),
        2 => result().prop_map(Way::Folder),
        1 => Just(Way::File),
        1 => Just(Way::Nowhere),
        4 => (0u32..64).prop_map(Way::Limit),
    ];
    let command = prop_oneof![3 => 0..2usize, 1 => 2..PRINTING.len()].prop_map(|k| PRINTING[k]);
    (command, sink(), sink(), way).prop_map(|(command, out, err, way)| Faults { command, out, err, way })
}

/// Runs the program with the faults: exit status, and standard error where it can be read.
fn run(folder: &Path, faults: &Faults) -> Result<(Option<i32>, Option<String>), String> {
    let limit = match faults.way {
        Way::Limit(blocks) => blocks.to_string(),
        _ => "unlimited".into(),
    };
    let closing =
        |sink, descriptor: &str| if sink == Sink::Closed { format!(" {descriptor}>&-") } else { String::new() };
    let script =
        format!("ulimit -f \"$1\" && shift && exec \"$@\"{}{}", closing(faults.out, "1"), closing(faults.err, "2"));
    let nowhere = |word: &&'static str| {
        if faults.way == Way::Nowhere && *word == "results" { "/dev/null/results" } else { *word }
    };
    let full = || File::options().write(true).open("/dev/full").map(Stdio::from);
    let sink = |sink| if sink == Sink::Full { full() } else { Ok(Stdio::piped()) };
    let mut command = Command::new("sh");
    command.args(["-c", &script, "sh", &limit, env!("CARGO_BIN_EXE_cutis")]).env("XDG_RUNTIME_DIR", folder);
    command.args(faults.command.iter().map(nowhere)).current_dir(folder).stdin(Stdio::null());
    let failed = |error: std::io::Error| error.to_string();
    command.stdout(sink(faults.out).map_err(failed)?).stderr(sink(faults.err).map_err(failed)?);
    let mut process = command.spawn().map_err(failed)?;
    if faults.out == Sink::Broken {
        drop(process.stdout.take());
    }
    if faults.err == Sink::Broken {
        drop(process.stderr.take());
    }
    let readable = faults.err == Sink::Pipe;
    let said = process.wait_with_output().map_err(failed)?;
    Ok((said.status.code(), readable.then(|| String::from_utf8_lossy(&said.stderr).into_owned())))
}

/// Exit statuses that the faults may end in.
fn wanted(faults: &Faults) -> &'static [i32] {
    let writes = faults.command.contains(&"results");
    match faults.way {
        Way::Foreign(_) | Way::Folder(_) | Way::File | Way::Nowhere if writes => &[1],
        _ if faults.out == Sink::Full => &[1],
        Way::Limit(_) if writes => &[0, 1],
        _ => &[0],
    }
}

/// The tables end in whole rows, and what is read as a whole is there as a whole.
fn whole(results: &Path, foreign: &str) -> Result<(), String> {
    for table in ["probes.csv", "solver.csv", "energy.csv"] {
        let Ok(text) = fs::read_to_string(results.join(table)) else { continue };
        let columns = text.lines().next().unwrap_or_default().split(',').count();
        let rows = text.lines().all(|line| line.split(',').count() == columns);
        if table != foreign && !(text.ends_with('\n') && columns > 1 && rows) {
            return Err(format!("{table} is not whole: {text}"));
        }
    }
    let report = fs::read(results.join("report.json")).ok().filter(|_| foreign != "report.json");
    if report.is_some_and(|bytes| serde_json::from_slice::<serde_json::Value>(&bytes).is_err()) {
        return Err("report.json is not whole".into());
    }
    match results.join("reserve.bin").exists() {
        true => Err("the reserve is left".into()),
        false => Ok(()),
    }
}

/// Exit status of the program, if it did with the faults as it should.
fn holds(faults: &Faults) -> Result<i32, String> {
    let folder = folder();
    let results = folder.0.join("results");
    let failed = |error: std::io::Error| error.to_string();
    let mut foreign = "";
    match faults.way {
        Way::Foreign(name) | Way::Folder(name) => {
            let path = results.join(name);
            fs::create_dir_all(path.parent().expect("it is in a folder")).map_err(failed)?;
            if let Way::Folder(_) = faults.way {
                fs::create_dir(path).map_err(failed)?;
            } else {
                foreign = name;
                fs::write(path, "mine").map_err(failed)?;
            }
        }
        Way::File => fs::write(&results, "mine").map_err(failed)?,
        Way::Free | Way::Nowhere | Way::Limit(_) => {}
    }
    let (code, said) = run(&folder.0, faults)?;
    let Some(code) = code.filter(|code| wanted(faults).contains(code)) else {
        return Err(format!("{code:?}, wanted one of {:?}: {said:?}", wanted(faults)));
    };
    if said.is_some_and(|said| said.contains("panicked") || code == 1 && !said.contains("error: ")) {
        return Err(format!("{code} without its words"));
    }
    let mine = |path: &Path| fs::read(path).is_ok_and(|bytes| bytes == b"mine");
    if !foreign.is_empty() && !mine(&results.join(foreign)) || faults.way == Way::File && !mine(&results) {
        return Err("a file of somebody else is gone".into());
    }
    if code == 0 && faults.command.contains(&"results") && !results.join("report.json").is_file() {
        return Err("there is no report".into());
    }
    whole(&results, foreign).map(|()| code)
}

#[test]
fn outputs_that_take_nothing_are_told_and_spoil_nothing() {
    let cases = count(80);
    let statuses = RefCell::new(BTreeMap::new());
    tried(cases, faults(), |faults| {
        let code = holds(faults)?;
        *statuses.borrow_mut().entry(code).or_insert(0) += 1;
        Ok(())
    });
    println!("exit status and number of faults: {:?}", statuses.borrow());
    assert!(cases < 100 || statuses.borrow().len() == 2, "{:?}", statuses.borrow());
}

#[test]
fn a_wrong_end_is_noticed() {
    use std::os::unix::process::ExitStatusExt;
    let end = |status: i32, out: &str, error: &str| {
        let status = std::process::ExitStatus::from_raw(status);
        Output { status, stdout: out.into(), stderr: error.into() }
    };
    assert!(ended(&end(0, "", ""), true).is_ok() && ended(&end(2 << 8, "{}", "error: a\n"), true).is_ok());
    for (wrong, as_json) in [
        (end(101 << 8, "", "thread 'main' panicked"), false),
        (end(6, "", "error: aborted"), false),
        (end(2 << 8, "", "no words of ours"), false),
        (end(0, "", "thread 'x' panicked at"), false),
        (end(1 << 8, "text", "error: a"), true),
    ] {
        assert!(ended(&wrong, as_json).is_err(), "{wrong:?}");
    }
    let folder = folder();
    fs::write(folder.0.join("probes.csv"), "a,b\n1,2\n").expect("the folder takes files");
    assert!(whole(&folder.0, "").is_ok());
    for (name, text) in
        [("probes.csv", "a,b\n1,2\n3"), ("probes.csv", "a,b\n1\n"), ("report.json", "{"), ("reserve.bin", "")]
    {
        let other = Folder::new();
        fs::write(other.0.join(name), text).expect("the folder takes files");
        assert!(whole(&other.0, "").is_err(), "{name}: {text}");
        assert!(name == "reserve.bin" || whole(&other.0, name).is_ok(), "{name} of somebody else");
    }
}
