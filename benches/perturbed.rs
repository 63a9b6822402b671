//! Runs of a scene that differ by rounding up to a percent: whether one succeeds may not depend on the last digits. Prints a line per
//! run with its seed, then warnings by name, checks that failed, the longest step, the spread of the peak force and the cut's length;
//! exits with status 1 where a bar is missed.
//!
//! `cargo bench --bench perturbed -- SCENE=incision RUNS=100 FIRST=1 CELLS=12,16,20,24,32,40,48`; all of them may be left out.
//! `RUNS=1 FIRST=7` repeats run 7 alone. Peak forces are compared among runs of the same cells.

#[path = "../tests/scenes/perturbation.rs"]
mod perturbation;

use perturbation::{Outcome, outcome, shipped, varied};
use std::collections::BTreeMap;
use std::process::ExitCode;

/// Longest step over the run's median step. Steps beside other programs take longer: nothing else may run.
const LONGEST: f64 = 5.0;
/// Largest peak force of a grid over its least, less 1.
const SPREAD: f64 = 0.02;
/// Cut's length less the path's, cells.
const OVERSHOOT: f64 = 1.0;

/// A `NAME=value` of the command line.
fn argument(name: &str, otherwise: &str) -> String {
    let given = std::env::args().find_map(|a| a.strip_prefix(name)?.strip_prefix('=').map(String::from));
    given.unwrap_or_else(|| otherwise.into())
}

fn number(name: &str, otherwise: &str) -> u64 {
    let text = argument(name, otherwise);
    text.parse().unwrap_or_else(|e| panic!("{name}={text}: {e}"))
}

fn line(o: &Outcome) {
    let v = &o.variation;
    println!(
        "seed {:4}: {:2} cells, {}, ±{:.0e}: peak {:.4} N, passes {:.2} / {}, updates {}, median {:.1} ms, longest {:.1} of it, overshoot {}{}{}",
        v.seed,
        v.cells,
        if v.single { "f32" } else { "f64" },
        v.size,
        o.peak,
        o.passes[0],
        o.passes[1],
        o.updates,
        o.median,
        o.longest,
        o.overshoot.map_or("–".into(), |cells| format!("{cells:.2}")),
        if o.warnings.is_empty() { String::new() } else { format!(", {:?}", o.warnings) },
        if o.failures.is_empty() { String::new() } else { format!(", {:?}", o.failures) },
    );
}

/// What misses a bar, over all runs.
fn missed(outcomes: &[Outcome]) -> Vec<String> {
    let mut out = vec![];
    let mut warnings: BTreeMap<&str, (u64, Vec<u64>)> = BTreeMap::new();
    for o in outcomes {
        for (name, count) in &o.warnings {
            let entry = warnings.entry(name).or_default();
            entry.0 += count;
            entry.1.push(o.variation.seed);
        }
        let seed = o.variation.seed;
        out.extend(o.failures.iter().map(|f| format!("seed {seed}: {f}")));
        if o.longest > LONGEST {
            out.push(format!("seed {seed}: longest step {:.1} times the median", o.longest));
        }
        if let Some(cells) = o.overshoot.filter(|cells| cells.abs() > OVERSHOOT) {
            out.push(format!("seed {seed}: cut {cells:.2} cells longer than the path"));
        }
    }
    out.extend(warnings.iter().map(|(name, (count, seeds))| format!("{name} {count} times, seeds {seeds:?}")));
    let mut grids: BTreeMap<u32, Vec<f64>> = BTreeMap::new();
    outcomes.iter().for_each(|o| grids.entry(o.variation.cells).or_default().push(o.peak));
    for (cells, peaks) in grids {
        let [low, high] = peaks.iter().fold([f64::INFINITY, 0.0], |[a, b], p| [p.min(a), p.max(b)]);
        println!("{cells} cells: {} runs, peak force {low:.4} to {high:.4} N", peaks.len());
        if high > low * (1.0 + SPREAD) {
            out.push(format!("{cells} cells: peak forces differ by {:.1} %", 100.0 * (high / low - 1.0)));
        }
    }
    out
}

fn main() -> ExitCode {
    let name = argument("SCENE", "incision");
    let grids: Vec<u32> = argument("CELLS", "12,16,20,24,32,40,48")
        .split(',')
        .map(|c| c.parse().unwrap_or_else(|e| panic!("CELLS: {c}: {e}")))
        .collect();
    let (first, runs) = (number("FIRST", "1"), number("RUNS", "100"));
    let scene = shipped(&name);
    let mut outcomes = vec![];
    for seed in first..first + runs {
        let (scene, variation) = varied(&scene, &grids, seed);
        outcomes.push(outcome(&scene, variation, None, name == "incision"));
        line(&outcomes[outcomes.len() - 1]);
    }
    let missed = missed(&outcomes);
    println!("{} runs of {name}, {} bars missed", outcomes.len(), missed.len());
    missed.iter().for_each(|m| println!("- {m}"));
    if missed.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
