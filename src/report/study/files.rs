//! Tables study.csv and study.md, and the names of settings in them.

use super::settings::element_word;
use super::{KINDS, Row, Setting, Stop, Study, plot};
use crate::error::Result;
use crate::output::replace;
use crate::report::Listing;
use crate::scene::{CORRECTIONS, Correction, INTEGRATORS, Integrator, PRECONDITIONERS, word};
use std::fmt::Write;
use std::path::Path;

/// Error bounds for which study.md names the cheapest setting.
const NEEDS: [f64; 5] = [0.2, 0.1, 0.05, 0.02, 0.01];

/// Columns of study.csv.
const COLUMNS: [&str; 33] = [
    "scene",
    "element",
    "preconditioner",
    "tolerance",
    "iteration_limit",
    "iterations",
    "grid",
    "poisson",
    "step_ms",
    "integrator",
    "correction",
    "backend",
    "precision",
    "adapter",
    "error_discretisation",
    "error_solver",
    "error_rounding",
    "error_step",
    "error_total",
    "error_law",
    "error_displacement",
    "error_lateral",
    "error_velocity",
    "error_stress",
    "error_force",
    "ms_per_step",
    "time_ratio",
    "times_real_time",
    "device_ms_per_step",
    "steps",
    "steps_wanted",
    "warnings",
    "pareto",
];

/// Names of the files.
const FILES: [&str; 3] = ["study.csv", "study.md", "study.svg"];

/// Opens the folder for the three files, before anything is computed.
pub(super) fn open(folder: &Path) -> Result<Listing> {
    Listing::open(folder, &[], |name| FILES.contains(&name))
}

/// Writes the three files.
pub(super) fn write(study: &Study, folder: &mut Listing) -> Result<()> {
    let texts = [table(study), page(study), plot::picture(study)?];
    FILES.iter().zip(texts).try_for_each(|(name, text)| replace(&folder.add(name)?, text.as_bytes()))
}

fn correction_name(correction: Option<Correction>) -> &'static str {
    correction.map_or("", |correction| word(&CORRECTIONS, correction))
}

fn table(study: &Study) -> String {
    let lines = study.rows.iter().map(|row| cells(study, row).map(|cell| quoted(&cell)).join(",") + "\n");
    COLUMNS.join(",") + "\n" + &lines.collect::<String>()
}

/// Rows as JSON with the columns of study.csv; empty cells are null.
pub(super) fn json(study: &Study) -> serde_json::Value {
    let value = |text: String| match text.parse::<f64>() {
        Ok(number) => serde_json::json!(number),
        Err(_) if text.is_empty() => serde_json::Value::Null,
        Err(_) => text.into(),
    };
    let row = |row: &Row| {
        let named = COLUMNS.iter().zip(cells(study, row)).map(|(name, cell)| (name.to_string(), value(cell)));
        serde_json::Value::Object(named.collect())
    };
    study.rows.iter().map(row).collect()
}

/// Cells of a row, in the order of the columns.
fn cells(study: &Study, row: &Row) -> [String; COLUMNS.len()] {
    let s = &row.setting;
    let [backend, precision] = s.platform.backend_and_precision();
    let cell = |value: Option<f64>| value.map_or(String::new(), |v| format!("{v:.4e}"));
    let (tolerance, limit) = match s.stop {
        Stop::Tolerance(t) => (format!("{t:e}"), String::new()),
        Stop::Iterations(n) => (String::new(), n.to_string()),
        Stop::Exact => (String::new(), String::new()),
    };
    // where it ran, and of what
    let adapter = if backend == "gpu" { study.adapter.clone().unwrap_or_default() } else { study.machine.clone() };
    let poisson: Vec<String> = study.poisson.iter().map(f64::to_string).collect();
    [
        study.scene.clone(),
        element_word(s.law).into(),
        word(&PRECONDITIONERS, s.preconditioner).into(),
        tolerance,
        limit,
        format!("{:.2}", row.trace.iterations),
        s.refinement.to_string(),
        poisson.join(" "),
        format!("{}", (s.step * 1e9).round() / 1e6),
        word(&INTEGRATORS, s.integrator).into(),
        correction_name(s.correction).into(),
        backend.into(),
        precision.into(),
        adapter,
        cell(row.error_discretisation),
        cell(row.error_solver),
        cell(row.error_rounding),
        cell(row.error_step),
        cell(row.error_total),
        cell(row.error_law),
        cell(row.by_kind[0]),
        cell(row.by_kind[1]),
        cell(row.by_kind[2]),
        cell(row.by_kind[3]),
        cell(row.by_kind[4]),
        format!("{:.4}", row.trace.ms_per_step),
        cell(study.own_ms.map(|own| row.trace.ms_per_step / own)),
        cell(Some(row.real_time())),
        cell(row.trace.device_ms_per_step),
        row.trace.steps.to_string(),
        row.trace.wanted.to_string(),
        row.trace.warnings.to_string(),
        u8::from(row.pareto).to_string(),
    ]
}

fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.into() }
}

/// Per cent with two digits.
fn percent(value: Option<f64>) -> String {
    match value {
        None => "–".into(),
        Some(v) if !v.is_finite() => "∞".into(),
        Some(0.0) => "0".into(),
        Some(v) if v < 1e-6 => format!("{:.0e}", v * 100.0),
        Some(v) => {
            let size = v * 100.0;
            let places = (1 - size.log10().floor() as i32).clamp(0, 5) as usize;
            format!("{size:.places$}")
        }
    }
}

/// A setting in one line.
fn words(s: &Setting) -> String {
    let stop = match s.stop {
        Stop::Tolerance(t) => format!(" to {t:e}"),
        Stop::Iterations(n) => format!(", {n} iterations"),
        Stop::Exact => String::new(),
    };
    let [backend, precision] = s.platform.backend_and_precision();
    let correction = match s.correction {
        None | Some(Correction::Exact) => String::new(),
        other => format!(", {}", correction_name(other)),
    };
    let integrator = match s.integrator {
        Integrator::ImplicitEuler => String::new(),
        other => format!(", {}", word(&INTEGRATORS, other)),
    };
    format!(
        "{} {}{stop}, grid × {}, {} ms{integrator}{correction}, {backend} {precision}",
        element_word(s.law),
        word(&PRECONDITIONERS, s.preconditioner),
        s.refinement,
        (s.step * 1e9).round() / 1e6,
    )
}

/// Fastest setting within each error bound, if any.
fn advice(study: &Study) -> [(f64, Option<&Row>); NEEDS.len()] {
    NEEDS.map(|need| {
        let within = study.rows.iter().filter(|r| r.error_total.is_some_and(|e| e <= need));
        (need, within.min_by(|a, b| a.real_time().total_cmp(&b.real_time())))
    })
}

/// Settings that could not be run with the reason, one line each.
pub(super) fn failed_lines(study: &Study) -> Vec<String> {
    study.failed.iter().map(|(setting, error)| format!("{}: {error}", words(setting))).collect()
}

/// [`advice`] in lines of text; where nothing is within the largest error, the setting with the smallest one instead.
pub(super) fn advice_lines(study: &Study) -> Vec<String> {
    let line = |row: &Row| {
        let ms = row.trace.ms_per_step;
        format!("{}: {ms:.2} ms per step, {} %{}", words(&row.setting), percent(row.error_total), of_law(row))
    };
    let found = advice(study);
    let within = |(need, row): &(f64, Option<&Row>)| {
        row.map_or_else(
            || format!("within {} %: none of these", need * 100.0),
            |row| format!("within {} %: {}", need * 100.0, line(row)),
        )
    };
    match (found[0].1, nearest(study)) {
        (None, Some(row)) => {
            vec![format!("none is within {} %; the nearest is {}; {}", found[0].0 * 100.0, line(row), parts(row))]
        }
        _ => found.iter().map(within).collect(),
    }
}

/// The error against the most complete law, where it is another one.
fn of_law(row: &Row) -> String {
    match row.error_law {
        Some(error) if Some(error) != row.error_total => format!(" ({} % against large strain)", percent(Some(error))),
        _ => String::new(),
    }
}

/// Setting with the smallest total error.
fn nearest(study: &Study) -> Option<&Row> {
    let error = |row: &Row| row.error_total.filter(|e| e.is_finite()).unwrap_or(f64::INFINITY);
    let found = study.rows.iter().min_by(|a, b| error(a).total_cmp(&error(b)));
    found.filter(|row| error(row).is_finite())
}

/// What the error of a row is made of, and of which quantities.
fn parts(row: &Row) -> String {
    let of = [
        ("the grid", row.error_discretisation),
        ("the time step", row.error_step),
        ("the solver", row.error_solver),
        ("rounding", row.error_rounding),
    ];
    let parts = of.into_iter().filter(|(_, e)| e.is_some()).map(|(name, e)| format!("{name} {} %", percent(e)));
    let kinds = KINDS.into_iter().zip(row.by_kind).filter(|(_, e)| e.is_some());
    let kinds = kinds.map(|(name, e)| format!("{name} {} %", percent(e)));
    format!("by cause: {}; by quantity: {}", parts.collect::<Vec<_>>().join(", "), kinds.collect::<Vec<_>>().join(", "))
}

const HEAD: &str = "| setting | total % | against large strain % | lateral % | stress % | discretisation % | time step % | solver % | rounding % | iterations | ms per step | × own | × real time | device ms |
| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |
";

fn line(study: &Study, row: &Row) -> String {
    let ms = row.trace.ms_per_step;
    let times = study.own_ms.map_or("–".into(), |own| format!("{:.2}", ms / own));
    let device = row.trace.device_ms_per_step.map_or("–".into(), |ms| format!("{ms:.2}"));
    let cut = match row.trace.whole() {
        true => String::new(),
        false => format!(" (stopped at the time limit, step {} of {})", row.trace.steps, row.trace.wanted),
    };
    format!(
        "| {}{cut} | {} | {} | {} | {} | {} | {} | {} | {} | {:.1} | {ms:.2} | {times} | {:.2} | {device} |\n",
        words(&row.setting),
        percent(row.error_total),
        percent(row.error_law),
        percent(row.by_kind[1]),
        percent(row.by_kind[3]),
        percent(row.error_discretisation),
        percent(row.error_step),
        percent(row.error_solver),
        percent(row.error_rounding),
        row.trace.iterations,
        row.real_time(),
    )
}

fn page(study: &Study) -> String {
    let mut out = format!("# Speed against error: {}\n\n", study.scene);
    let adapter = study.adapter.as_ref().map_or(String::new(), |a| format!("; GPU: {a}"));
    let _ = writeln!(out, "Machine: {}{adapter}.", study.machine);
    let _ = writeln!(
        out,
        "Total errors are of {}, relative to {}: root of the sum of squares over the samples of the run, the largest over the kinds of quantity.",
        study.signals.join(", "),
        study.reference
    );
    if !study.beside.is_empty() {
        let _ = writeln!(out, "Lateral displacements and stresses, beside the total: {}.", study.beside.join(", "));
    }
    let _ = writeln!(out, "Errors against large strain are total ones against: {}.", study.law);
    if let Some(own) = study.own_ms {
        let _ = writeln!(out, "Times are medians; × own is the ratio to the first of all settings, {own:.2} ms.");
    }
    if study.left_out > 0 {
        let _ = writeln!(out, "Left out for want of time: {} settings.", study.left_out);
    }
    // what is missing
    for line in failed_lines(study) {
        let _ = writeln!(out, "Not run: {line}");
    }
    // advice, the front, everything
    out += "\n![study.svg](study.svg)\n\n## The fastest setting within an error\n\n";
    out += &HEAD.replace("| setting |", "| total error within | setting |").replacen("| --- |", "| --- | --- |", 1);
    for (need, row) in advice(study) {
        match row {
            Some(row) => out += &format!("| {} % {}", need * 100.0, line(study, row)),
            None => out += &format!("| {} % | none of these {}|\n", need * 100.0, "| – ".repeat(13)),
        }
    }
    if let (None, Some(row)) = (advice(study)[0].1, nearest(study)) {
        let _ =
            writeln!(out, "\nThe nearest is {}: {} %, {}.", words(&row.setting), percent(row.error_total), parts(row));
    }
    out += "\n## Nothing is both faster and nearer\n\n";
    out += HEAD;
    let mut front: Vec<&Row> = study.rows.iter().filter(|r| r.pareto).collect();
    front.sort_by(|a, b| a.real_time().total_cmp(&b.real_time()));
    front.iter().for_each(|row| out += &line(study, row));
    out += "\n## All settings\n\n";
    out += HEAD;
    study.rows.iter().for_each(|row| out += &line(study, row));
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_have_two_digits() {
        let of = |v: f64| percent(Some(v));
        assert_eq!([of(0.1234), of(0.01234), of(1.5), of(0.000123), of(0.0)], ["12", "1.2", "150", "0.012", "0"]);
        assert_eq!([of(3e-9), of(f64::INFINITY), percent(None)], ["3e-7", "∞", "–"]);
    }

    #[test]
    fn cells_with_commas_are_quoted() {
        assert_eq!([quoted("a"), quoted("a, b"), quoted("a\"b")], ["a", "\"a, b\"", "\"a\"\"b\""]);
    }
}
