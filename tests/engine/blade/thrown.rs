//! Two paths that once went wrong: a straight cut in which the blade was thrown aside with 53 N, and a wild path after which the tool was NaN.
//!
//! `cargo bench --bench blade -- thrown 26` runs the first with 25 placements near it, `non_finite 16` the second with 15.

use super::paths::{Case, Kind};
use cutis::report::Report;
use cutis::report::run::{Options, run};
use cutis::step::Platform;

/// Largest change of a force from one step or haptic tick to the next, N.
const JUMP: f64 = 0.5;

/// Runs the path of a kind; its case, the report and the forces on the tool at the ends of the steps, N.
fn recorded(kind: Kind) -> (Case, Report, Vec<f64>) {
    let case = Case::new(kind, 0);
    let out = std::env::temp_dir().join(format!("cutis_blade_{kind:?}_{}", std::process::id()));
    let mut forces = vec![];
    let ended = run(&case.scene, &Options::new(Platform::Cpu64, &out), &mut |step| forces.push(step.force));
    let report = ended.unwrap_or_else(|e| panic!("{}: {e}", case.name)).report;
    drop(std::fs::remove_dir_all(&out));
    (case, report, forces)
}

/// What holds of both: no fault or warning, no jump, and as many links severed as the path crosses, so that the blade has cut.
fn is_sound((case, report, forces): &(Case, Report, Vec<f64>)) {
    assert!(
        case.faults(report).is_empty() && report.warnings.is_empty(),
        "{:?} {:?}",
        case.faults(report),
        report.warnings
    );
    assert_eq!(forces.len(), report.steps as usize, "steps");
    assert!(forces.iter().all(|force| force.is_finite()), "{forces:?}");
    let jump = forces.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max);
    assert!(jump < JUMP && report.haptic.force_jump_n_max < JUMP, "{jump} N, {} N", report.haptic.force_jump_n_max);
    let ([least, most], severed) = (case.links_expected(0.1), report.cut.links_severed as f64);
    assert!((least..=most).contains(&severed), "{severed} links severed, {least} to {most} expected");
}

#[test]
fn a_straight_cut_that_once_threw_the_blade_stays_below_half_a_newton() {
    let run = recorded(Kind::Thrown);
    is_sound(&run);
    let (_, report, _) = run;
    // 0.25 N is what this cut takes
    assert!(report.contact_force_n_max < 0.5, "{} N on the tool", report.contact_force_n_max);
    assert!(report.haptic.force_n_max < 0.5, "{} N on the hand", report.haptic.force_n_max);
    assert!(report.contact.depth_mm_max < 0.2, "{} mm", report.contact.depth_mm_max);
}

#[test]
fn a_path_after_which_the_tool_was_nan_ends_finite() {
    is_sound(&recorded(Kind::NonFinite));
}
