//! Bounds on the result of a run: the scene's `[check]` table applied to the report's keys.

use super::haptics::LOST;
use super::{Refused, Report};
use crate::error::Result;
use crate::scene::{Scene, check_of};
use serde_json::Value;

/// Check that failed.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Failure {
    /// Key of the report, dotted.
    pub key: String,
    /// Value of the run; none if it was not measured.
    pub found: Option<f64>,
    /// Inclusive lower bound, if any.
    pub min: Option<f64>,
    /// Inclusive upper bound, if any.
    pub max: Option<f64>,
}

impl std::fmt::Display for Failure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.found {
            Some(found) => write!(f, "{} = {}", self.key, digits(found))?,
            None => write!(f, "{} was not measured", self.key)?,
        }
        match (self.min, self.max) {
            (Some(min), Some(max)) => write!(f, ", wanted {min} to {max}"),
            (Some(min), None) => write!(f, ", wanted at least {min}"),
            (None, Some(max)) => write!(f, ", wanted at most {max}"),
            (None, None) => Ok(()),
        }
    }
}

/// Integers in full, other numbers with four significant digits.
fn digits(value: f64) -> String {
    let size = value.abs();
    if value == value.trunc() && size < 1e6 {
        return format!("{value}");
    }
    if (1e-3..1e6).contains(&size) {
        let places = (3 - size.log10().floor() as i32).clamp(0, 6) as usize;
        format!("{value:.places$}")
    } else {
        format!("{value:.3e}")
    }
}

/// Checks of the scene that a report fails; a lost device, whose hand nobody led, fails them too.
pub fn failures(scene: &Scene, report: &Report) -> Vec<Failure> {
    let tree = serde_json::to_value(report).unwrap_or(Value::Null);
    let bound = |b: f64| b.is_finite().then_some(b);
    let found = report.warnings.get(LOST).filter(|_| !scene.checks.is_empty()).map(|count| *count as f64);
    let lost = found.map(|_| Failure { key: format!("warnings.{LOST}"), found, min: None, max: Some(0.0) });
    scene
        .checks
        .iter()
        .filter_map(|check| {
            let found = value(&tree, &check.key);
            let [min, max] = check.bounds(&scene.skins);
            let holds = found.is_some_and(|v| min <= v && v <= max);
            (!holds).then(|| Failure { key: check.key.clone(), found, min: bound(min), max: bound(max) })
        })
        .chain(lost)
        .collect()
}

/// Number of the report with a given key; a warning that did not occur is 0.
fn value(tree: &Value, key: &str) -> Option<f64> {
    let (table, name) = key.split_once('.').unwrap_or(("", key));
    if table == "warnings" || table == "probes" {
        let found = tree.get(table)?.get(name);
        return match found {
            None if table == "warnings" => Some(0.0),
            found => found?.as_f64(),
        };
    }
    key.split('.').try_fold(tree, |at, part| at.get(part))?.as_f64()
}

/// Refuses checks on keys that no report has; called before the run.
///
/// # Errors
/// [`Refused::UnknownCheck`], which lists the known keys.
pub fn known(scene: &Scene) -> Result<()> {
    let tree = serde_json::to_value(Report::default()).unwrap_or(Value::Null);
    let mut keys = vec![];
    list("", &tree, &mut keys);
    for check in &scene.checks {
        let named = check.key.starts_with("warnings.") || check.key.starts_with("probes.");
        if !named && !keys.contains(&check.key) {
            let (at, key) = (scene.at(&check_of(&check.key)), check.key.clone());
            return Err(Refused::UnknownCheck { at, key, known: keys.join(", ") }.into());
        }
    }
    Ok(())
}

fn list(prefix: &str, tree: &Value, keys: &mut Vec<String>) {
    let Value::Object(map) = tree else {
        return;
    };
    for (name, value) in map {
        match value {
            Value::Object(_) => list(&format!("{prefix}{name}."), value, keys),
            Value::String(_) => {}
            _ => keys.push(format!("{prefix}{name}")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dotted_keys_reach_every_number() {
        let mut report = Report::default();
        report.cut.length_mm = 10.5;
        report.warnings.insert("columns_not_converged".into(), 3);
        report.probes.insert("a.b".into(), -2.0);
        let tree = serde_json::to_value(&report).unwrap();
        assert_eq!(value(&tree, "cut.length_mm"), Some(10.5));
        assert_eq!(value(&tree, "warnings.columns_not_converged"), Some(3.0));
        assert_eq!(value(&tree, "warnings.none_of_these"), Some(0.0));
        assert_eq!(value(&tree, "probes.a.b"), Some(-2.0));
        assert_eq!(value(&tree, "step_ms.median"), None);
        assert_eq!(value(&tree, "cut.lenght_mm"), None);
    }

    #[test]
    fn a_failure_says_value_and_bounds() {
        let failure = |found, min, max| {
            let key = "cut.length_mm".into();
            Failure { key, found, min, max }.to_string()
        };
        assert_eq!(failure(Some(12.3456), Some(9.0), Some(11.0)), "cut.length_mm = 12.35, wanted 9 to 11");
        assert_eq!(failure(Some(1.25e-7), None, Some(1e-9)), "cut.length_mm = 1.250e-7, wanted at most 0.000000001");
        assert_eq!(failure(None, Some(1.0), None), "cut.length_mm was not measured, wanted at least 1");
    }
}
