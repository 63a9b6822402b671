//! The page of known answers as verification.md, verification.csv and verification.json.

use super::{Page, Row, SINGLE_BOUND, SINGLE_TOLERANCE};
use crate::error::Result;
use crate::output::replace;
use crate::report::Listing;
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::Path;

/// Columns of verification.csv and keys of verification.json; numbers in SI.
const COLUMNS: [&str; 15] = [
    "case",
    "quantity",
    "unit",
    "reference",
    "source",
    "found",
    "error",
    "bound",
    "holds",
    "grid",
    "law",
    "step_s",
    "steps",
    "seconds",
    "note",
];

/// Names of the files.
const FILES: [&str; 3] = ["verification.md", "verification.csv", "verification.json"];

/// Opens the folder for the three files, before anything is computed.
///
/// # Errors
/// If the folder cannot be written, another command writes there, or a file of somebody else has one of the names.
pub fn open(folder: &Path) -> Result<Listing> {
    Listing::open(folder, &[], |name| FILES.contains(&name))
}

/// Writes the three files.
///
/// # Errors
/// If the folder cannot be written.
pub fn write(page: &Page, folder: &mut Listing) -> Result<()> {
    let json = serde_json::to_string_pretty(&page.to_json()).unwrap_or_default(); // numbers and strings always serialise
    let texts = [page.markdown(), page.csv(), json];
    FILES.iter().zip(texts).try_for_each(|(name, text)| replace(&folder.add(name)?, text.as_bytes()))
}

impl Page {
    /// The page as JSON.
    pub fn to_json(&self) -> Value {
        let row = |row: &Row| -> Value {
            COLUMNS.into_iter().map(String::from).zip(values(row)).collect::<serde_json::Map<_, _>>().into()
        };
        json!({
            "version": self.version,
            "device": self.device,
            "quick": self.quick,
            "missed": self.missed().len(),
            "rows": self.rows.iter().map(row).collect::<Vec<_>>(),
        })
    }

    fn csv(&self) -> String {
        let cell = |value: Value| match value {
            Value::Null => String::new(),
            Value::String(text) if text.contains([',', '"', '\n']) => format!("\"{}\"", text.replace('"', "\"\"")),
            Value::String(text) => text,
            other => other.to_string(),
        };
        let line = |row: &Row| values(row).map(cell).join(",") + "\n";
        COLUMNS.join(",") + "\n" + &self.rows.iter().map(line).collect::<String>()
    }

    /// The page as Markdown.
    pub fn markdown(&self) -> String {
        let mut out = String::from("# Known answers\n\n");
        let command = if self.quick { "cutis verify --quick" } else { "cutis verify" };
        let _ = writeln!(out, "`{command}`, version {}, on: {}.\n", self.version, self.device);
        out += "An error is `ours / reference − 1`, of the one quantity named, on the grid named; a bound is what is asked of it, and **missed** says \
                where that is not met. \"static\" steps end in balance. Scenes: `scenes/verify`; cases: `src/report/verify/cases.rs`.\n\n";
        if self.device.contains("f32") {
            let _ = writeln!(
                out,
                "In f32: solves to {SINGLE_TOLERANCE:e} or looser, bounds {} % wider.\n",
                SINGLE_BOUND * 100.0
            );
        }
        let missed = self.missed().len();
        let bounded = self.rows.iter().filter(|row| row.bound.is_finite()).count();
        let _ = writeln!(out, "{} of {bounded} bounds are met.\n", bounded - missed);
        out += "| case | measured | reference | source | ours | error % | bound % | grid | law | steps | s |\n";
        out += "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n";
        for row in &self.rows {
            let [case, what, reference, source, found, error, bound, grid, law, steps, seconds] = row.words();
            let _ = writeln!(
                out,
                "| {case} | {what} | {reference} | {source} | {found} | {error} | {bound} | {grid} | {law} | {steps} | {seconds} |"
            );
        }
        let warned: Vec<&Row> = self.rows.iter().filter(|row| !row.warnings.is_empty()).collect();
        if !warned.is_empty() {
            out += "\nWarnings of these runs:\n\n";
            for row in warned {
                let _ = writeln!(out, "- {}, {}, {}: {}", row.case.name, row.cells, row.law, note(row));
            }
        }
        out
    }
}

impl Row {
    /// Cells of the table: case, quantity with its unit, reference, source, result, error and bound in %, grid, law, steps, seconds.
    pub fn words(&self) -> [String; 11] {
        let (unit, per) = self.case.unit;
        let quantity = if unit.is_empty() { self.case.what.into() } else { format!("{}, {unit}", self.case.what) };
        let missed = if self.holds() { "" } else { " **missed**" };
        [
            self.case.name.into(),
            quantity,
            digits(self.case.reference * per, 5),
            self.case.source.into(),
            self.found.as_ref().map_or_else(|error| format!("none: {error}"), |found| digits(found * per, 5)),
            self.error().map_or("–".into(), |error| format!("{}{missed}", percent(error))),
            if self.bound.is_finite() { digits(self.bound * 100.0, 3) } else { "–".into() },
            self.cells.clone(),
            if self.law.is_empty() { "–".into() } else { self.law.clone() },
            match self.steps {
                (0.0, 1) => "static".into(),
                (0.0, n) => format!("{n} static"),
                (step, n) if step < 1.0 => format!("{n} × {} ms", digits(step * 1e3, 3)),
                (step, n) => format!("{n} × {} s", digits(step, 5)),
            },
            format!("{:.1}", self.seconds),
        ]
    }
}

fn values(row: &Row) -> [Value; COLUMNS.len()] {
    let case = &row.case;
    [
        json!(case.name),
        json!(case.what),
        json!(case.unit.0),
        json!(case.reference),
        json!(case.source),
        json!(row.found.as_ref().ok()),
        json!(row.error()),
        json!(row.bound.is_finite().then_some(row.bound)),
        json!(row.holds()),
        json!(row.cells),
        json!(row.law),
        json!(row.steps.0),
        json!(row.steps.1),
        json!((row.seconds * 1e3).round() / 1e3),
        json!(note(row)),
    ]
}

/// Why there is no result, or the warnings of the run.
fn note(row: &Row) -> String {
    let warnings = row.warnings.iter().map(|(name, count)| format!("{name} × {count}"));
    row.found.as_ref().err().cloned().into_iter().chain(warnings).collect::<Vec<_>>().join(", ")
}

/// So many significant digits, without the zeros at the end.
fn digits(value: f64, count: i32) -> String {
    if value == 0.0 || !value.is_finite() {
        return if value == 0.0 { "0".into() } else { "not finite".into() };
    }
    let power = value.abs().log10().floor() as i32;
    if !(-4..7).contains(&power) {
        return format!("{value:.*e}", (count - 1) as usize);
    }
    let text = format!("{value:.*}", (count - 1 - power).max(0) as usize);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
}

/// Per cent with its sign and two digits; below 0.01 % by its power of ten.
fn percent(share: f64) -> String {
    let size = share.abs() * 100.0;
    match size {
        _ if !size.is_finite() => "not finite".into(),
        0.0 => "0".into(),
        _ if size < 0.01 => format!("{:+.0e}", share * 100.0),
        _ if size < 9.95 => format!("{:+.2}", share * 100.0),
        _ => format!("{:+.1}", share * 100.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_their_digits() {
        let five = |v: f64| digits(v, 5);
        assert_eq!(
            [five(-0.18362), five(4.905), five(12345.678), five(0.0), five(1.5e-9)],
            ["-0.18362", "4.905", "12346", "0", "1.5000e-9"]
        );
        assert_eq!([percent(0.0215), percent(-0.301), percent(1e-9), percent(0.0)], ["+2.15", "-30.1", "+1e-7", "0"]);
    }
}
