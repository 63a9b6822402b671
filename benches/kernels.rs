//! Where a step's time goes on a GPU: parts of the step by the wall clock, and every kernel by the device's timestamps
//! (`scenes/incision_fine.toml` on coarser grids and as it is). Prints Markdown, per step of each kind: free, touching, cutting.
//!
//! Even steps are timed as users run them. In odd ones each launch is a pass of its own with two timestamps; these give the kernels'
//! times and nothing else, since the passes make a step slower.
//!
//! `cargo bench --bench kernels -- 22 66 steps=140` takes grids of 22 × 22 and 66 × 66 columns of 23 cells (about 10⁴ and 10⁵); 200 is the
//! scene as it is.

use cutis::scene::{Scene, read};
use cutis::step::{Part, Platform, Simulation, StepReport};
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

const KINDS: [&str; 3] = ["free", "touching", "cutting"];
const PARTS: [(&str, Part); 7] = [
    ("search", Part::Search),
    ("free motion", Part::Free),
    ("columns", Part::Columns),
    ("corrections", Part::Corrections),
    ("contact laws", Part::Laws),
    ("cut", Part::Cut),
    ("other", Part::Other),
];

/// What steps of one kind took.
#[derive(Default)]
struct Steps {
    /// Steps as users run them.
    plain: usize,
    /// Their times, ms.
    wall: Vec<f64>,
    /// `[part]` ms, sums.
    parts: [f64; PARTS.len()],
    /// Sums of launches, read-backs, iterations, passes, columns.
    counts: [f64; 5],
    /// Steps timed by launches.
    timed: usize,
    /// By kernel: launches and ms, sums.
    kernels: BTreeMap<&'static str, (usize, f64)>,
}

fn kind(step: &StepReport) -> usize {
    match (step.contact.count(), step.severed) {
        (0, 0) => 0,
        (_, 0) => 1,
        _ => 2,
    }
}

fn run(mut scene: Scene, columns: u32, steps: u32) {
    scene.skins[0].cells = [columns; 2];
    let mut simulation = match Simulation::new(&scene, &Platform::Gpu(None)) {
        Ok(simulation) => simulation,
        Err(e) => return println!("{columns} columns are left out: {e}"),
    };
    let mut kinds = [(); 3].map(|()| Steps::default());
    for step in 0..steps.min(scene.time.steps()) {
        let by_launch = step % 2 == 1;
        let gpu = simulation.gpu().expect("the platform is a GPU");
        gpu.time_launches(by_launch);
        let before = gpu.work();
        let begin = Instant::now();
        let report = simulation.step(false).expect("the device works");
        let ms = begin.elapsed().as_secs_f64() * 1e3;
        let gpu = simulation.gpu().expect("the platform is a GPU");
        let after = gpu.work();
        let of_kind = &mut kinds[kind(&report)];
        if by_launch {
            if let Some(times) = gpu.launch_times(gpu.batch()).expect("the device works") {
                of_kind.timed += 1;
                for (name, seconds) in times {
                    let (launches, sum) = of_kind.kernels.entry(name).or_default();
                    (*launches, *sum) = (*launches + 1, *sum + seconds * 1e3);
                }
            }
            continue;
        }
        of_kind.plain += 1;
        of_kind.wall.push(ms);
        for (sum, (_, part)) in of_kind.parts.iter_mut().zip(PARTS) {
            *sum += report.costs.of(part) * 1e3;
        }
        let counts = [
            (after.dispatches - before.dispatches) as f64,
            (after.read_backs - before.read_backs) as f64,
            f64::from(report.costs.iterations),
            f64::from(report.contact.passes),
            f64::from(report.contact.columns),
        ];
        of_kind.counts.iter_mut().zip(counts).for_each(|(sum, count)| *sum += count);
    }
    let cells = simulation.bodies[0].model.grid.cell_count();
    println!("\n## {cells} cells, {}\n", simulation.device().adapter);
    let title: String = PARTS.iter().map(|(name, _)| format!(" {name} |")).collect();
    println!("| steps | | median, ms | mean, ms |{title} launches | read-backs | iterations | passes | columns |");
    println!("|{}", " --- |".repeat(4 + PARTS.len() + 5));
    for (name, steps) in KINDS.iter().zip(&mut kinds).filter(|(_, steps)| steps.plain > 0) {
        let each = |sum: f64| sum / steps.plain as f64;
        steps.wall.sort_by(f64::total_cmp);
        let mean = each(steps.wall.iter().sum());
        let parts: String = steps.parts.iter().map(|sum| format!(" {:.2} |", each(*sum))).collect();
        let counts: String = steps.counts.iter().map(|sum| format!(" {:.1} |", each(*sum))).collect();
        println!("| {name} | {} | {:.2} | {mean:.2} |{parts}{counts}", steps.plain, steps.wall[steps.plain / 2]);
    }
    for (name, steps) in KINDS.iter().zip(&kinds).filter(|(_, steps)| steps.timed > 0) {
        let busy: f64 = steps.kernels.values().map(|(_, ms)| ms).sum::<f64>() / steps.timed as f64;
        println!("\n{name}: the kernels take {busy:.2} ms per step\n");
        println!(
            "| kernel | launches per step | µs per launch | ms per step | share |\n| --- | --- | --- | --- | --- |"
        );
        let mut kernels: Vec<_> = steps.kernels.iter().collect();
        kernels.sort_by(|a, b| b.1.1.total_cmp(&a.1.1));
        for (kernel, (launches, ms)) in kernels {
            let (count, ms_each) = (*launches as f64 / steps.timed as f64, ms / steps.timed as f64);
            let each = 1e3 * ms / *launches as f64;
            println!("| {kernel} | {count:.1} | {each:.1} | {ms_each:.3} | {:.0} % |", 100.0 * ms_each / busy);
        }
    }
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    let value = |key: &str| words.iter().find_map(|word| word.strip_prefix(key));
    let mut grids: Vec<u32> = words.iter().filter_map(|word| word.parse().ok()).collect();
    if grids.is_empty() {
        grids = vec![22];
    }
    let steps = value("steps=").map_or(u32::MAX, |n| n.parse().expect("steps=N"));
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let scene = read(&root.join("scenes/incision_fine.toml")).expect("the shipped scene is valid");
    grids.into_iter().for_each(|columns| run(scene.clone(), columns, steps));
}
