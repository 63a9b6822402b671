//! Whether a run succeeds may not depend on the last digits: a sample of `benches/perturbed.rs` that is short enough for the suite.
//!
//! Forty incisions on 12 cells across, in f64 and f32 by turns of the dice, each to 0.5 s: the blade presses, enters and slices the first
//! 3 mm. Inputs change by up to 1 %; peak forces are compared among those that change by up to 0.1 % (beyond it two of 32 runs to the end
//! were 1 and 8 % off, by what the blade takes as it enters). Not covered here: finer grids, the way back, the scene's checks, the longest
//! step, other scenes; the bench has them.

use crate::perturbation::{Outcome, outcome, shipped, varied};
use std::collections::BTreeMap;

const RUNS: u64 = 40;
const CELLS: [u32; 1] = [12];
const STEPS: u32 = 100;
/// Largest peak force of a grid over its least, less 1.
const SPREAD: f64 = 0.02;
/// Bar of the row updates of the contact laws in a step.
const UPDATES: f64 = 400_000.0;
/// Largest relative change of the inputs for which peak forces are compared.
const COMPARED: f64 = 1e-3;

fn run(seed: u64) -> Outcome {
    let (scene, variation) = varied(&shipped("incision"), &CELLS, seed);
    outcome(&scene, variation, Some(STEPS), false)
}

/// Largest over least, less 1.
fn spread(peaks: &[f64]) -> f64 {
    let [low, high] = peaks.iter().fold([f64::INFINITY, 0.0], |[a, b], p| [p.min(a), p.max(b)]);
    high / low - 1.0
}

#[test]
fn runs_that_differ_by_rounding_or_a_percent_end_alike_and_without_a_warning() {
    let outcomes: Vec<Outcome> = (1..=RUNS).map(run).collect();
    let mut grids: BTreeMap<u32, Vec<f64>> = BTreeMap::new();
    for o in &outcomes {
        assert!(o.warnings.is_empty(), "{:?}: {:?}", o.variation, o.warnings);
        assert!(o.updates <= UPDATES, "{:?}: {} row updates in a step", o.variation, o.updates);
        if o.variation.size <= COMPARED {
            grids.entry(o.variation.cells).or_default().push(o.peak);
        }
    }
    for (cells, peaks) in &grids {
        println!("{cells} cells: {} runs, {:.2} % apart", peaks.len(), 100.0 * spread(peaks));
        assert!(peaks.len() > 5 && spread(peaks) <= SPREAD, "{cells} cells: {peaks:?} N");
    }
    let both = |single| outcomes.iter().filter(|o| o.variation.single == single).count() > 5;
    assert!(both(true) && both(false), "f64 and f32");
    assert!(outcomes.iter().all(|o| o.peak > 0.1), "the blade presses");
}

#[test]
fn a_tougher_skin_and_a_solve_cut_short_are_noticed() {
    let (mut scene, variation) = varied(&shipped("incision"), &CELLS, 1);
    let peak = outcome(&scene, variation, Some(STEPS), false).peak;
    scene.contact.as_mut().expect("it has a tool").max_passes = 1;
    let short = outcome(&scene, variation, Some(STEPS), false);
    assert!(short.warnings.contains_key("contact_passes_exhausted"), "{:?}", short.warnings);
    let (mut scene, variation) = varied(&shipped("incision"), &CELLS, 1);
    scene.skins[0].layers.iter_mut().for_each(|l| l.toughness *= 1.1);
    let tougher = outcome(&scene, variation, Some(STEPS), false).peak;
    assert!(spread(&[peak, tougher]) > SPREAD, "{peak} N and {tougher} N");
}
