//! The CPU path gives the same bits on every machine: what seven scenes write has the hashes stored in `tests/machines/hashes.txt`, with all
//! registers that this machine has (and simulated ones as wide as AVX-512's) and any number of threads.
//!
//! `CUTIS_BLESS=1 cargo test --test machines` stores the hashes anew, when results were meant to change.

use cutis::math::Real;
use cutis::math::wide::{Lanes, Registers, Task, Wide, force};
use cutis::report::run::{self, Options};
use cutis::scene::{Scene, read};
use cutis::step::Platform;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

/// Scenes in their test forms, and steps: past contact, and past the first cut where there is a blade; grids past the first node that is split.
const SCENES: &[(&str, u32)] = &[
    ("incision", 90),
    ("dental_probe", 26),
    ("needle_press", 40),
    ("skin_springs", 38),
    ("incision_shapes", 88),
    ("verify/stack_five_soft", 6),
    ("hard/press_50kpa", 4),
];

const PLATFORMS: [Platform; 2] = [Platform::Cpu64, Platform::Cpu32];

const THREADS: [usize; 3] = [1, 2, 5];

/// The registers are the whole process's, so tests that run scenes take turns.
static TURN: Mutex<()> = Mutex::new(());

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// A scene in its test form, without pictures.
fn scene(name: &str) -> Scene {
    let file = root().join("scenes").join(format!("{name}.toml"));
    let mut scene = read(&file).unwrap_or_else(|e| panic!("{e}")).in_test_form();
    scene.view.frames = 0;
    scene
}

/// FNV-1a, 64 bits.
fn hash(text: &[u8]) -> u64 {
    text.iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3))
}

/// Runs a scene; returns the hashes of its tables, one line each.
fn hashes(name: &str, scene: &Scene, steps: u32, platform: &Platform, threads: usize) -> String {
    let folder = format!("cutis-machines-{}-{}-{platform:?}", std::process::id(), name.replace('/', "-"));
    let out = std::env::temp_dir().join(folder);
    let options = Options { steps: Some(steps), ..Options::new(platform.clone(), &out) };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a few threads can be had");
    let summary = pool.install(|| run::run(scene, &options, &mut |_| {})).unwrap_or_else(|e| panic!("{name}: {e}"));
    assert!(summary.report.cut.node_copies > 0 || !name.starts_with("incision"), "{name}: {steps} steps split no node");
    let mut lines = String::new();
    for table in ["probes.csv", "haptic.csv"] {
        // a scene without tools has no haptic.csv
        if let Ok(text) = std::fs::read_to_string(out.join(table)) {
            let rows = text.lines().skip(1);
            assert!(rows.clone().count() >= steps as usize, "{name}: {table} is short");
            let blade = table == "probes.csv" && scene.tools.iter().any(|tool| tool.blade.is_some());
            // the last column is `links_cut`
            assert!(
                !blade || rows.clone().any(|row| !row.ends_with(",0")),
                "{name}: {steps} steps do not reach the cut"
            );
            writeln!(lines, "{name} {platform:?} {table} {:016x}", hash(text.as_bytes()))
                .expect("a String takes any text");
        }
    }
    std::fs::remove_dir_all(&out).unwrap_or_else(|e| panic!("{}: {e}", out.display()));
    lines
}

/// The lines of all scenes in both precisions.
fn all(threads: usize) -> String {
    let one = |(name, steps): &(&str, u32)| {
        let scene = scene(name);
        PLATFORMS.map(|platform| hashes(name, &scene, *steps, &platform, threads)).concat()
    };
    std::thread::scope(|scope| {
        let running: Vec<_> = SCENES.iter().map(|case| scope.spawn(move || one(case))).collect();
        running.into_iter().map(|run| run.join().expect("a scene runs")).collect()
    })
}

/// Numbers in a register.
struct Count;

impl<R: Real> Task<R> for Count {
    type Output = usize;
    fn run<L: Lanes<R>>(self, _: L) -> usize {
        L::COUNT
    }
}

#[test]
fn registers_and_threads_do_not_change_a_bit() {
    let _turn = TURN.lock().unwrap_or_else(|e| e.into_inner());
    let file = root().join("tests/machines/hashes.txt");
    let bless = std::env::var("CUTIS_BLESS").is_ok_and(|v| v == "1");
    let mut stored = if bless { String::new() } else { text(&file) };
    for registers in Registers::of_this_machine() {
        force(registers);
        println!("{registers:?}: {} numbers of f32, {} of f64", f32::widest(Count), f64::widest(Count));
        for threads in THREADS {
            let start = std::time::Instant::now();
            let found = all(threads);
            println!("  {threads} threads: {:.1} s", start.elapsed().as_secs_f64());
            if bless && stored.is_empty() {
                stored.clone_from(&found);
            }
            let differ: Vec<&str> = found.lines().filter(|line| !stored.lines().any(|own| own == *line)).collect();
            assert!(
                differ.is_empty() && found.lines().count() == stored.lines().count(),
                "with {registers:?} registers and {threads} threads other bits than in {}; if results were meant to change, store them \
                 anew by `CUTIS_BLESS=1 cargo test --test machines`:\n{}",
                file.display(),
                differ.join("\n")
            );
        }
    }
    force(Registers::Widest);
    if bless {
        std::fs::write(&file, &stored).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    }
}

#[test]
fn one_unit_in_the_last_place_is_noticed() {
    let _turn = TURN.lock().unwrap_or_else(|e| e.into_inner());
    let name = "needle_press";
    let mut scene = scene(name);
    let run = |scene: &Scene| hashes(name, scene, 40, &Platform::Cpu64, 1);
    let before = run(&scene);
    assert!(!before.is_empty() && before == run(&scene));
    let young = &mut scene.skins[0].layers[0].young;
    *young = young.next_up();
    let after = run(&scene);
    let same: Vec<_> = before.lines().filter(|line| after.lines().any(|other| other == *line)).collect();
    assert!(same.is_empty(), "a Young's modulus off by its last bit: {same:?}");
}

fn text(file: &Path) -> String {
    std::fs::read_to_string(file).unwrap_or_else(|e| panic!("{}: {e}", file.display()))
}
