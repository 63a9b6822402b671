//! Random paths of blades through small skins, judged by force, jumps, depth, links and warnings (`tests/engine/blade/paths.rs`), and by the
//! time of the longest step.
//!
//! `cargo bench --bench blade -- straight 100 0` runs 100 straight cuts from number 0 on; `through` are cuts right across and through,
//! `any` paths of any kind, `crossing` the cuts of two blades that cross, `again` 20 cuts along one line, `piece` cuts all round a piece,
//! which falls; `thrown 26` is a cut that once threw the blade, with 25 placements within 0.3 mm of it, `non_finite 16` the same of a path
//! after which the tool was NaN. Prints a line for each path with a fault, and the worst of all; ends with 1 when there was a fault.

#[path = "../tests/engine/blade/paths.rs"]
mod blade;

use blade::{Case, Kind};
use cutis::step::Platform;

/// Longest time of a step that is no fault, in medians of the run: a longer step stands out as a halt. Judge it on an idle machine.
const LONGEST: f64 = 20.0;

fn main() {
    let mut arguments = std::env::args().skip(1).filter(|a| a != "--bench");
    let kind = match arguments.next().as_deref() {
        Some("through") => Kind::Through,
        Some("any") => Kind::Any,
        Some("crossing") => Kind::Crossing,
        Some("again") => Kind::Again,
        Some("piece") => Kind::Piece,
        Some("thrown") => Kind::Thrown,
        Some("non_finite") => Kind::NonFinite,
        _ => Kind::Straight,
    };
    let mut number = |or: u64| arguments.next().and_then(|n| n.parse().ok()).unwrap_or(or);
    let (count, first) = (number(20), number(0));
    let out = std::env::temp_dir().join(format!("cutis_blade_{}", std::process::id()));
    let (mut faulty, mut force, mut jump, mut depth, mut slow) = (0, 0.0f64, 0.0f64, 0.0f64, 0.0f64);
    for number in first..first + count {
        let case = Case::new(kind, number);
        let faults = match case.run(Platform::Cpu64, &out) {
            Ok(report) => {
                force = force.max(report.contact_force_n_max);
                jump = jump.max(report.haptic.force_jump_n_max);
                depth = depth.max(report.contact.depth_mm_max);
                let [median, longest] = [report.step_ms.median, report.step_ms.max].map(|t| t.unwrap_or(f64::NAN));
                slow = slow.max(longest / median);
                let mut faults = case.faults(&report);
                if longest > LONGEST * median {
                    faults.push(format!("longest step {:.0} medians, at most {LONGEST:.0}", longest / median));
                }
                faults
            }
            Err(e) => vec![e.to_string()],
        };
        faulty += u32::from(!faults.is_empty());
        if !faults.is_empty() {
            println!("{}: {}", case.name, faults.join("; "));
        }
    }
    drop(std::fs::remove_dir_all(&out));
    println!(
        "{faulty} of {count} {kind:?} with faults; at most {force:.2} N, a jump of {jump:.2} N, {depth:.3} mm deep; \
         longest step {slow:.0} medians"
    );
    std::process::exit(i32::from(faulty > 0));
}
