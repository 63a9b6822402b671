//! How far the lips of wounds pass through each other: three crossing cuts with a flap that folds (`scenes/incision_shapes.toml`), on grids and with
//! moduli that differ a little, since such runs are chaotic. In every fifth step the depth of each node of the wound in foreign cells is measured in the
//! cells themselves. Prints Markdown: a row for each grid, over its moduli.
//!
//! `cargo bench --bench lips -- 12 14 16 18` takes these grids, `-- 14 without` no contact between lips.

#[path = "../tests/shared/inside.rs"]
mod inside;

use cutis::scene::{Scene, read};
use cutis::step::{Platform, Simulation};
use std::path::Path;

/// Relative changes of the moduli.
const CHANGES: [f64; 4] = [0.0, 1e-4, 2e-4, 3e-4];
/// A depth beyond which a node is counted, m.
const DEEP: f64 = 3e-5;

/// Runs a scene: the depths, m, and how many warnings.
fn run(scene: &Scene) -> Result<(Vec<f64>, u32), String> {
    let mut simulation = Simulation::new(scene, &Platform::Cpu64).map_err(|e| e.to_string())?;
    let (mut depths, mut warnings) = (vec![], 0);
    for step in 1..=scene.time.steps() {
        let report = simulation.step(false).map_err(|e| format!("step {step}: {e}"))?;
        warnings += report.warnings.values().sum::<u32>();
        if step % 5 == 0 {
            depths.extend(inside::inside(&mut simulation));
        }
    }
    Ok((depths, warnings))
}

/// Runs of a grid in one row.
fn row(mut scene: Scene, cells: u32, lips: bool) -> Result<(), String> {
    scene.skins[0].cells = [cells; 2];
    scene.contact.as_mut().ok_or("the scene has a blade")?.lips = lips;
    let (mut all, mut deepest, mut warned) = (vec![], vec![], vec![]);
    for change in CHANGES {
        let mut scene = scene.clone();
        scene.skins[0].layers.iter_mut().for_each(|layer| layer.young *= 1.0 + change);
        let (depths, warnings) = run(&scene)?;
        deepest.push(format!("{:.3}", 1e3 * depths.iter().fold(0.0f64, |a, b| a.max(*b))));
        warned.push(warnings.to_string());
        all.extend(depths);
    }
    let mean = 1e6 * all.iter().sum::<f64>() / all.len().max(1) as f64;
    let deep = all.iter().filter(|depth| **depth > DEEP).count();
    println!(
        "| {cells} × {cells} | {} | {mean:.2} | {deep} | {} | {} |",
        all.len(),
        deepest.join(", "),
        warned.join(", ")
    );
    Ok(())
}

fn main() -> Result<(), String> {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let lips = !arguments.iter().any(|a| a == "without");
    let number = |a: &String| a.parse().map_err(|e| format!("{a}: {e}; give numbers of cells, or `without`"));
    let given: Vec<u32> = arguments.iter().filter(|a| *a != "without").map(number).collect::<Result<_, _>>()?;
    let scene = read(Path::new("scenes/incision_shapes.toml")).map_err(|e| e.to_string())?;
    println!(
        "| cells | nodes inside | mean, µm | deeper than {:.2} mm | deepest of each run, mm | warnings |",
        1e3 * DEEP
    );
    println!("| --- | --- | --- | --- | --- | --- |");
    let grids = if given.is_empty() { vec![12, 14, 16, 18] } else { given };
    grids.into_iter().try_for_each(|cells| row(scene.clone(), cells, lips))
}
