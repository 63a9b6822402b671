//! Raw tables of what is measured, shown and tested.

use super::{At, Counts, Numbers, Points};
use std::collections::BTreeMap;

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::scene) struct Probe {
    pub name: At<String>,
    pub kind: At<String>,
    pub body: Option<At<String>>,
    pub from: Option<At<String>>,
    pub point_mm: Option<Numbers>,
    pub axis: Option<At<String>>,
    pub region: Option<At<String>>,
    pub box_mm: Option<Points>,
    pub centre_mm: Option<Numbers>,
    pub radius_mm: Option<At<f64>>,
    pub through_mm: Option<Numbers>,
    pub normal: Option<Numbers>,
    pub within_mm: Option<At<f64>>,
    pub margin_mm: Option<At<f64>>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::scene) struct Check {
    pub min: Option<At<f64>>,
    pub max: Option<At<f64>>,
    pub cells: Option<At<f64>>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::scene) struct Test {
    pub cells: Option<Counts>,
    pub steps: Option<At<u32>>,
}

#[derive(Default, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::scene) struct Study {
    pub probes: Option<Vec<At<String>>>,
    pub known: Option<BTreeMap<At<String>, At<f64>>>,
    pub duration_s: Option<At<f64>>,
    pub elements: Option<At<Vec<At<String>>>>,
    pub preconditioners: Option<At<Vec<At<String>>>>,
    pub tolerances: Option<At<Vec<At<f64>>>>,
    pub iterations: Option<At<Vec<At<u32>>>>,
    pub grids: Option<Numbers>,
    pub steps_ms: Option<Numbers>,
    pub integrators: Option<At<Vec<At<String>>>>,
    pub corrections: Option<At<Vec<At<String>>>>,
    pub quick_grid: Option<At<f64>>,
    pub reference_grid: Option<At<f64>>,
    pub reference_step_ms: Option<At<f64>>,
}

#[derive(Default, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::scene) struct View {
    pub frames: Option<At<u32>>,
    pub size_px: Option<Counts>,
    pub eye_mm: Option<Numbers>,
    pub target_mm: Option<Numbers>,
    pub field_of_view_deg: Option<At<f64>>,
}
