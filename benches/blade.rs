//! Random paths of a blade through small skins, judged by force, jumps, depth, links and warnings (`tests/engine/blade/paths.rs`).
//!
//! `cargo bench --bench blade -- straight 100 0` runs 100 straight cuts from number 0 on; `through` are cuts right across and through,
//! `any` are paths of any kind. Prints a line for each path with a fault, and the worst of all; ends with 1 when there was a fault.

#[path = "../tests/engine/blade/paths.rs"]
mod blade;

use blade::{Case, Kind};
use cutis::step::Platform;

fn main() {
    let mut arguments = std::env::args().skip(1).filter(|a| a != "--bench");
    let kind = match arguments.next().as_deref() {
        Some("through") => Kind::Through,
        Some("any") => Kind::Any,
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
                case.faults(&report)
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
