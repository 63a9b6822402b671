//! Results as readable text.

use super::print::shown;
use cutis::gpu::Adapter;
use cutis::report::Report;
use cutis::report::compare::Comparison;
use cutis::report::inspect::{Array, Count, Plan};
use cutis::report::mesh::{Quality, Summary as MeshSummary};
use cutis::report::run::Summary;
use cutis::report::study::Study;
use cutis::report::verify::Page;
use cutis::scene::keys::Key;
use cutis::scene::{Scene, Skin};
use cutis::step;
use std::fmt::Write as _;
use std::path::Path;

/// Summary of a run in five lines, with a sixth on the haptic loop if the wall clock paced it.
pub fn summary(scene: &Scene, summary: &Summary, out: &Path) -> String {
    let r = &summary.report;
    let [size, step, solve, cut] = [body(r), speed(r), accuracy(scene, r), wound(scene, r)];
    let force = match scene.contact {
        Some(_) => format!("peak force {:.3} N at {:.3} s", r.contact_force_n_max, summary.peak_time),
        None => "no tool touches the skin".into(),
    };
    let pictures = match summary.frames {
        0 => "no pictures".to_string(),
        1 => format!("1 picture in {}frames", shown(out)),
        n => format!("{n} pictures in {}frames", shown(out)),
    };
    let ticks = ticks(r);
    format!("{size}\n{step}\n{solve}\n{cut}\n{ticks}{force}; {pictures}, everything else in {}\n", shown(out))
}

/// Table of what the steps cost.
pub fn profile(r: &Report) -> String {
    let c = &r.costs;
    let times = [
        ("search", c.search_ms),
        ("free motion", c.free_ms),
        ("columns", c.columns_ms),
        ("corrections", c.corrections_ms),
        ("contact laws", c.laws_ms),
        ("hand-over", c.hand_over_ms),
        ("cut", c.cut_ms),
        ("other", c.other_ms),
    ];
    let counts = [
        ("columns", c.columns),
        ("passes", c.passes),
        ("iterations", c.iterations),
        ("row updates", c.row_updates),
        ("cut tests", c.cut_tests),
    ];
    let whole: f64 = times.iter().map(|(_, share)| share.mean).sum();
    let mut text = format!("\n{:<14}{:>10}{:>8}{:>12}{:>12}\n", "ms per step", "mean", "", "99 of 100", "most");
    for (name, share) in times {
        let part = 100.0 * share.mean / whole.max(f64::MIN_POSITIVE);
        writeln!(text, "{name:<14}{:>10.2}{part:>7.0}%{:>12.2}{:>12.2}", share.mean, share.p99, share.max).ok();
    }
    writeln!(text, "{:<14}{:>10}{:>8}{:>12}{:>12}", "per step", "mean", "", "99 of 100", "most").ok();
    for (name, share) in counts {
        writeln!(text, "{name:<14}{:>10.1}{:>8}{:>12.0}{:>12.0}", share.mean, "", share.p99, share.max).ok();
    }
    text
}

/// Timing of the haptic loop; empty for a run by the scene's clock.
fn ticks(r: &Report) -> String {
    let h = &r.haptic;
    let Some(missed) = h.missed else { return String::new() };
    let us = |value: Option<f64>| value.map_or("no".into(), |v| format!("{v:.0}"));
    let shortened = match h.shortened_steps.unwrap_or(0) {
        0 => String::new(),
        steps => format!(
            ", {steps} ended when due with contact forces that can be felt to be off (at most {:.1} mN and {:.1} µm left)",
            h.shortened_n_max.unwrap_or(f64::NAN) * 1e3,
            h.shortened_mm_max.unwrap_or(f64::NAN) * 1e3
        ),
    };
    format!(
        "haptic loop at {} Hz: 99 of 100 periods within {} µs and ticks within {} µs, {missed} deadlines missed; {} of {} steps late{shortened}, \
         {:.1} % of the ticks with an old problem; largest force {:.3} N, change in a tick {:.3} N\n",
        h.rate_hz,
        us(h.period_us.p99),
        us(h.tick_us.p99),
        h.late_steps.unwrap_or(0),
        r.steps,
        h.old_share * 100.0,
        h.force_n_max,
        h.force_jump_n_max
    )
}

fn body(r: &Report) -> String {
    let elements = match (r.spring_count, r.tets) {
        (0, 0) => format!("{} cells", r.hexes),
        (0, n) => format!("{n} tetrahedra"),
        (n, _) => format!("{n} springs"),
    };
    let steps = if r.steps == 1 { "step" } else { "steps" };
    format!("{elements}, {} nodes, {} {steps} of {} ms", r.nodes, r.steps, milli(r.step_s))
}

/// Rounded to thousandths.
fn milli(value: f64) -> f64 {
    (value * 1e9).round() / 1e6
}

fn speed(r: &Report) -> String {
    let [median, p99] = [r.step_ms.median, r.step_ms.p99].map(|t| t.unwrap_or(f64::NAN));
    let driver = if r.driver.is_empty() { String::new() } else { format!(", {}", r.driver) };
    format!(
        "{median:.1} ms per step (99 of 100 within {p99:.1} ms), {:.1} s in all, on the {}: {}{driver}",
        r.wall_s,
        r.backend.to_uppercase(),
        r.adapter
    )
}

fn accuracy(scene: &Scene, r: &Report) -> String {
    let found = r.solver.residual_true.map_or("not checked".into(), |v| format!("{v:.1e}"));
    format!(
        "{:.1} iterations per solve (at most {}), true residual {found} for a tolerance of {:e}",
        r.solver.iterations_mean, r.solver.iterations_max, scene.solver.tolerance
    )
}

fn wound(scene: &Scene, r: &Report) -> String {
    let c = &r.cut;
    let carves = scene.tools.iter().any(|tool| tool.carve.is_some());
    let breaks = scene.skins.iter().any(Skin::breaks);
    if !carves && !breaks && !scene.tools.iter().any(|tool| tool.blade.is_some()) {
        return "no blade in this scene".into();
    }
    if carves && c.springs_removed + c.links_severed == 0 {
        return format!("carved {:.2} mm³, {:.1} mm long, {:.2} mm deep", c.removed_mm3, c.length_mm, c.depth_mm);
    }
    let gone = match (c.springs_removed, c.hexes_removed) {
        (0, 0) => format!("{} links severed", c.links_severed),
        (0, cells) => format!("{cells} cells removed"),
        (springs, _) => format!("{springs} springs removed"),
    };
    format!("cut {:.1} mm long, {:.2} mm deep, {:.1} mm² ({gone})", c.length_mm, c.depth_mm, c.area_mm2)
}

/// Result of a study and its folder.
pub fn study(s: &Study, out: &Path) -> String {
    let mut text =
        format!("{} settings; errors are of {}, relative to {}\n", s.rows.len(), s.signals.join(", "), s.reference);
    writeln!(text, "against large strain: {}", s.law).ok();
    if s.left_out > 0 {
        writeln!(text, "left out for want of time: {}", s.left_out).ok();
    }
    for line in s.advice() {
        writeln!(text, "{line}").ok();
    }
    writeln!(text, "{}: study.csv, study.md, study.svg", shown(out)).ok();
    text
}

/// Table of known answers, columns aligned, and its sum.
pub fn verification(page: &Page, out: Option<&Path>) -> String {
    let head = ["case", "measured", "reference", "source", "ours", "error %", "bound %", "grid", "law", "steps", "s"];
    let rows: Vec<[String; 11]> =
        std::iter::once(head.map(String::from)).chain(page.rows.iter().map(|row| row.words())).collect();
    let width = |k: usize| rows.iter().map(|row| row[k].chars().count()).max().unwrap_or(0);
    let widths: [usize; 11] = std::array::from_fn(width);
    let mut text = format!("on: {}\n\n", page.device);
    for row in &rows {
        let cells: Vec<String> = row.iter().zip(widths).map(|(cell, width)| format!("{cell:<width$}")).collect();
        writeln!(text, "{}", cells.join("  ").trim_end()).ok();
    }
    let bounded = page.rows.iter().filter(|row| row.bound.is_finite()).count();
    writeln!(text, "\n{} of {bounded} bounds are met", bounded - page.missed().len()).ok();
    if let Some(out) = out {
        writeln!(text, "{}: verification.md, verification.csv, verification.json", shown(out)).ok();
    }
    text
}

/// Table of differences.
pub fn comparison(c: &Comparison) -> String {
    let mut text = format!(
        "GPU: {}, {}\nCPU: {}, {}\n\n{:<84} {:>11} {:>11} {:>11} {:>9}\n",
        c.gpu.adapter, c.gpu.driver, c.cpu.adapter, c.cpu.precision, "", "CPU", "GPU", "difference", "bound"
    );
    for r in &c.rows {
        let verdict = if r.holds() { "" } else { "  FAILED" };
        let line = format!(
            "{:<84} {:>11} {:>11} {:>11.2e} {:>9.0e}{verdict}",
            r.name,
            short(r.cpu),
            short(r.gpu),
            r.difference,
            r.bound
        );
        writeln!(text, "{line}").ok();
    }
    text
}

fn short(value: f64) -> String {
    if value == value.trunc() && value.abs() < 1e9 { format!("{value}") } else { format!("{value:.6}") }
}

/// Arrays by purpose (equal ones once, with their number), kernels, launches, read-backs.
pub fn plan(p: &Plan) -> String {
    let mut text = format!(
        "{}: {} nodes, {} cells, {} springs, {} degrees of freedom, {} steps, up to {} right-hand sides\n",
        p.scene, p.nodes, p.cells, p.spring_count, p.dof, p.steps, p.right_hand_sides
    );
    let mut purposes: Vec<&str> = p.arrays.iter().map(|a| a.purpose).collect();
    purposes.dedup();
    for purpose in purposes {
        let each = p.shares.iter().find(|s| s.purpose == purpose).map_or(0.0, |s| s.bytes_per_cell);
        writeln!(text, "\n{purpose:<24} {:>12} {each:>14.1} bytes per cell", "elements").ok();
        let mut equal: Vec<(&Array, usize)> = vec![];
        for array in p.arrays.iter().filter(|a| a.purpose == purpose) {
            match equal.iter_mut().find(|(a, _)| (a.name, a.elements) == (array.name, array.elements)) {
                Some((_, count)) => *count += 1,
                None => equal.push((array, 1)),
            }
        }
        for (array, count) in equal {
            let times = if count > 1 { format!("{} × {count}", array.name) } else { array.name.to_string() };
            let bytes = array.bytes * count as u64;
            writeln!(text, "  {times:<22} {:>12} {bytes:>14} bytes", array.elements).ok();
        }
    }
    writeln!(text, "\non the GPU {} bytes, constant arrays on the host {}", p.device_bytes, p.host_bytes).ok();
    if p.blade_bytes > 0 {
        let each = p.blade_bytes as f64 / p.cells.max(1) as f64;
        writeln!(
            text,
            "of these for cutting {} bytes, {each:.1} per cell; without a blade they are not there",
            p.blade_bytes
        )
        .ok();
    }
    writeln!(text, "kernels: {}", p.kernels.join(", ")).ok();
    writeln!(text, "launches: {}", counts(&p.dispatches)).ok();
    writeln!(text, "read-backs: {}", counts(&p.read_backs)).ok();
    text
}

fn counts(list: &[Count]) -> String {
    let one = |c: &Count| format!("{} {} per {}", c.name, c.count, c.per);
    list.iter().map(one).collect::<Vec<_>>().join("; ")
}

/// Table of adapters, with the choice of `auto`.
pub fn adapters(all: &[Adapter]) -> String {
    let mut text = String::new();
    if !all.is_empty() {
        let name_width = all.iter().map(|a| a.name.chars().count()).max().unwrap_or(0).max(4);
        let driver_width = all.iter().map(|a| a.driver.chars().count()).max().unwrap_or(0).max(6);
        let head = ["name", "API", "driver", "kind", "MiB/binding"];
        let row = |c: [&str; 5]| {
            format!("{:<name_width$}  {:<7}  {:<driver_width$}  {:<8}  {:>11}\n", c[0], c[1], c[2], c[3], c[4])
        };
        text += &row(head);
        for a in all {
            let kind = if a.software { "software" } else { "hardware" };
            text += &row([&a.name, &a.backend, &a.driver, kind, &(a.max_binding >> 20).to_string()]);
        }
    }
    let choice = match (all.first(), all.is_empty()) {
        (Some(first), _) if !first.software => format!("`--backend auto` takes `{}`.", first.name),
        (_, true) => "No adapter here; `--backend auto` takes the CPU path.".into(),
        _ => "No hardware here; `--backend auto` takes the CPU path. Ask for a software adapter with `--backend gpu`."
            .into(),
    };
    text + &choice + "\n"
}

/// A warning of a run, with its meaning and remedy.
pub fn warning(name: &str, count: u64) -> String {
    let said = step::warning(name).map_or(String::new(), |w| format!(": {}; {}", w.meaning, w.remedy).replace('`', ""));
    format!("warning: {name} × {count}{said}")
}

/// Keys of scenes, by table.
pub fn keys(keys: &[Key]) -> String {
    let mut text = String::new();
    let plain = |words: &str| words.replace('`', "");
    for of_table in keys.chunk_by(|a, b| a.table == b.table) {
        writeln!(text, "{}", plain(of_table[0].table)).ok();
        for key in of_table {
            let default = match key.default {
                "" => String::new(),
                words if words.starts_with('(') => format!("; without it {}", plain(words.trim_matches(['(', ')']))),
                value => format!("; default {}", plain(value)),
            };
            writeln!(text, "  {} ({}{default})\n      {}", key.name, plain(key.range), plain(key.meaning)).ok();
        }
    }
    text
}

/// What a mesh file holds.
pub fn mesh(path: &Path, s: &MeshSummary) -> String {
    let mut text =
        format!("{}: {} points, {} tetrahedra, {} triangles\n", path.display(), s.points, s.tetrahedra, s.triangles);
    for (name, count) in &s.others {
        let fate = if matches!(*name, "point" | "line") { "left out" } else { "split" };
        writeln!(text, "cells of the shape {name}: {count}, {fate}").ok();
    }
    for r in &s.regions {
        let cells = if r.dimension == 3 { "tetrahedra" } else { "triangles" };
        let name = if r.name.is_empty() { String::new() } else { format!(" \"{}\"", r.name) };
        writeln!(text, "region {}{name}: {} {cells}", r.tag, r.cells).ok();
    }
    let [low, high] = [s.low, s.high].map(|p| format!("({:.6e}, {:.6e}, {:.6e})", p[0], p[1], p[2]));
    writeln!(text, "from {low} to {high}, in the file's unit").ok();
    writeln!(text, "volume {:.6e}, surface {:.6e}, components {}", s.volume, s.area, s.components).ok();
    let closed = if s.boundary.closed { "closed" } else { "open" };
    writeln!(text, "boundary: {} triangles, {} edges, {closed}", s.boundary.triangles, s.boundary.edges).ok();
    if let Some(quality) = &s.quality {
        text += &mesh_quality(quality);
    }
    if s.defects.is_empty() {
        text += "no defects\n";
    }
    for d in &s.defects {
        writeln!(text, "{}: {}, the first {}: {}", d.name, d.count, d.first, d.effect).ok();
    }
    text
}

fn mesh_quality(q: &Quality) -> String {
    let ends = ["< 1.5", "< 2", "< 3", "< 5", "< 10", "≥ 10"];
    let aspects: Vec<String> = ends.iter().zip(q.aspect).map(|(end, count)| format!("{end}: {count}")).collect();
    let mut text = format!("aspect ratio up to {:.4}; {}\n", q.aspect_max, aspects.join(", "));
    writeln!(text, "dihedral angles {:.2}° to {:.2}°", q.angle_min, q.angle_max).ok();
    let most = q.angles.iter().max().map_or(1, |most| (*most).max(1));
    for (k, count) in q.angles.iter().enumerate().filter(|(_, count)| **count > 0) {
        let bar = "#".repeat((40 * count).div_ceil(most));
        writeln!(text, "{:>4}° to {:>3}° {count:>9} {bar}", 10 * k, 10 * (k + 1)).ok();
    }
    text
}
