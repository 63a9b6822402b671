//! What a step that cuts costs against one that does not (`scenes/incision_fine.toml` on coarser grids and as it is). Prints Markdown.
//!
//! Steps of a whole run by kind: free (nothing touches), touching (contacts, nothing severed), cutting. Times are medians, as ratios to the
//! free step of the same run; beside them what the run is worth: the length and the depth of the cut against the path of the tip, and the
//! work that the blade put in against toughness × severed area. A cut changes little of a body, so the ratio should not grow with it.
//!
//! `cargo bench --bench wound -- 22 66` takes grids of 22 × 22 and 66 × 66 columns of 23 cells (about 10⁴ and 10⁵); 200 is the scene as it
//! is, for a GPU: `-- 200 gpu`.

use cutis::scene::{Scene, read};
use cutis::step::{Platform, Simulation, StepReport};
use glam::DVec3;
use std::path::Path;
use std::time::Instant;

/// Length of the path in the skin, mm (`scenes/make_assets.py`).
const PATH_MM: f64 = 10.0;

/// What steps of one kind took, ms.
#[derive(Default)]
struct Times([Vec<f64>; 3]);

impl Times {
    fn add(&mut self, step: &StepReport, ms: f64) {
        let kind = match (step.contact.count(), step.severed) {
            (0, 0) => 0,
            (_, 0) => 1,
            _ => 2,
        };
        self.0[kind].push(ms);
    }

    /// Median of a kind; NaN where there was none.
    fn median(&self, kind: usize) -> f64 {
        let mut sorted = self.0[kind].clone();
        sorted.sort_by(f64::total_cmp);
        sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
    }
}

/// Runs the scene on a grid and prints its row.
fn row(mut scene: Scene, columns: u32, platform: &Platform) {
    scene.skins[0].cells = [columns; 2];
    let name = match platform {
        Platform::Cpu64 => "CPU f64",
        Platform::Cpu32 => "CPU f32",
        Platform::Gpu(_) => "GPU f32",
    };
    let mut simulation = match Simulation::new(&scene, platform) {
        Ok(simulation) => simulation,
        Err(e) => {
            println!("{name} on {columns} columns is left out: {e}");
            return;
        }
    };
    let mut times = Times::default();
    let (mut work, mut columns_solved, mut trouble) = (0.0, 0, 0);
    for _ in 0..scene.time.steps() {
        let before = simulation.tools[0].position;
        let begin = Instant::now();
        let report = simulation.step(false).expect("the device works");
        times.add(&report, begin.elapsed().as_secs_f64() * 1e3);
        let force = report.contact.on_tool.first().map_or(DVec3::ZERO, |f| DVec3::from_array(*f));
        work -= force.dot(simulation.tools[0].position - before);
        columns_solved += report.contact.columns;
        trouble += report.warnings.values().sum::<u32>();
    }
    let totals = simulation.totals();
    let cells = simulation.bodies[0].model.grid.cell_count();
    let free = times.median(0);
    println!(
        "| {cells} | {name} | {} / {} / {} | {:.1} | {:.2} | {:.2} | {columns_solved} | {:.2} | {:.2} | {:.2} | {} | {trouble} |",
        times.0[0].len(),
        times.0[1].len(),
        times.0[2].len(),
        free,
        times.median(1) / free,
        times.median(2) / free,
        totals.length * 1e3 / PATH_MM,
        totals.depth * 1e3,
        work / (scene.skins[0].layers[1].toughness * totals.area),
        totals.copies,
    );
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    let mut grids: Vec<u32> = words.iter().filter_map(|word| word.parse().ok()).collect();
    if grids.is_empty() {
        grids = vec![22, 66];
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let scene = read(&root.join("scenes/incision_fine.toml")).expect("the shipped scene is valid");
    let platforms = match words.iter().any(|word| word == "gpu") {
        true => vec![Platform::Gpu(None)],
        false => vec![Platform::Cpu64, Platform::Cpu32],
    };
    println!(
        "| cells | path | steps free / touching / cutting | free step, ms | touching / free | cutting / free | columns solved | cut length / path | depth, mm | work / (toughness × area) | copies | warnings |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    for columns in grids {
        platforms.iter().for_each(|platform| row(scene.clone(), columns, platform));
    }
}
