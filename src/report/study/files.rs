//! Tables study.csv and study.md, and the names of settings in them.

use super::settings::element_word;
use super::{Row, Setting, Stop, Study, plot};
use crate::error::Result;
use crate::output::{Failed, replace};
use crate::scene::{CORRECTIONS, Correction, INTEGRATORS, Integrator, PRECONDITIONERS, word};
use std::fmt::Write;
use std::path::Path;

/// Error bounds for which study.md names the cheapest setting.
const NEEDS: [f64; 5] = [0.2, 0.1, 0.05, 0.02, 0.01];

/// Columns of study.csv.
const COLUMNS: [&str; 30] = [
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
    "error_displacement",
    "error_velocity",
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

/// Writes the three files.
pub(super) fn write(study: &Study, folder: &Path) -> Result<()> {
    std::fs::create_dir_all(folder).map_err(|source| Failed::Write { path: folder.to_owned(), source })?;
    replace(&folder.join("study.csv"), table(study).as_bytes())?;
    replace(&folder.join("study.md"), page(study).as_bytes())?;
    replace(&folder.join("study.svg"), plot::picture(study)?.as_bytes())
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
        cell(row.by_unit[0]),
        cell(row.by_unit[1]),
        cell(row.by_unit[2]),
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

/// [`advice`] in lines of text.
pub(super) fn advice_lines(study: &Study) -> Vec<String> {
    let one = |(need, row): (f64, Option<&Row>)| match row {
        Some(row) => {
            let [ms, error] = [row.trace.ms_per_step, row.error_total.unwrap_or(f64::NAN) * 100.0];
            format!("within {} %: {}: {ms:.2} ms per step, {error:.2} %", need * 100.0, words(&row.setting))
        }
        None => format!("within {} %: none of these", need * 100.0),
    };
    advice(study).map(one).to_vec()
}

const HEAD: &str = "| setting | total % | discretisation % | time step % | solver % | rounding % | iterations | ms per step | × own | × real time | device ms |
| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |
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
        "| {}{cut} | {} | {} | {} | {} | {} | {:.1} | {ms:.2} | {times} | {:.2} | {device} |\n",
        words(&row.setting),
        percent(row.error_total),
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
    let _ = writeln!(out, "Errors are of {}, relative to {}.", study.signals.join(", "), study.reference);
    if let Some(own) = study.own_ms {
        let _ = writeln!(out, "Times are medians; × own is the ratio to the first of all settings, {own:.2} ms.");
    }
    if study.left_out > 0 {
        let _ = writeln!(out, "Left out for want of time: {} settings.", study.left_out);
    }
    for line in failed_lines(study) {
        let _ = writeln!(out, "Not run: {line}");
    }
    out += "\n![study.svg](study.svg)\n\n## The fastest setting within an error\n\n";
    out += &HEAD.replace("| setting |", "| total error within | setting |").replacen("| --- |", "| --- | --- |", 1);
    for (need, row) in advice(study) {
        match row {
            Some(row) => out += &format!("| {} % {}", need * 100.0, line(study, row)),
            None => out += &format!("| {} % | none of these {}|\n", need * 100.0, "| – ".repeat(10)),
        }
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
