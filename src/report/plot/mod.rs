//! Plots of a run from the tables in its folder: force, probes, energy, convergence and computing time over the run's time, each as SVG and
//! as PNG.
//!
//! A figure is drawn where the folder has its table: `force` from probes.csv, contacts.csv and haptic.csv, `probes` from probes.csv, `energy`
//! from energy.csv, `residual` from solver.csv, `timing` from report.json and haptic.csv. Tables are read a row at a time; of a long one a
//! curve keeps the least and the largest value of neighbouring rows.

mod canvas;
mod draw;

use super::Refused;
use super::listing::Listing;
use super::tables::{CONTACTS, ENERGY, PROBES, Rows, SOLVER};
use crate::error::Result;
use crate::output::{Failed, replace};
use crate::scene::FIXED_COLUMNS;
use crate::view;
use canvas::Canvas;
use draw::{Bar, Bars, Curve, Figure, Panel};
use glam::DVec3;
use plotters::prelude::{DrawingArea, IntoDrawingArea, SVGBackend};
use serde_json::Value;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::rc::Rc;

/// Folder of the plots in that of the run.
const FOLDER: &str = "plots";
/// Names of the figures.
const NAMES: [&str; 5] = ["force", "probes", "energy", "residual", "timing"];

/// Whether a file of this name, relative to the folder of a run, is a plot of it.
pub(super) fn is_plot(name: &str) -> bool {
    let file = name.strip_prefix(FOLDER).and_then(|rest| rest.strip_prefix('/'));
    let stem = file.and_then(|file| file.strip_suffix(".svg").or(file.strip_suffix(".png")));
    stem.is_some_and(|stem| NAMES.contains(&stem))
}

/// Draws what a run has left in a folder; returns the files, in `plots` in that folder.
///
/// # Errors
/// [`Refused::NoResults`] for a folder without results, [`Refused::Table`], with the line, for a table or report that is damaged or foreign,
/// [`Refused::Locked`] while a run writes there, [`Refused::Foreign`] where another file has the name of a plot, and if the disk is full.
pub fn plot(folder: &Path) -> Result<Vec<PathBuf>> {
    if !folder.is_dir() {
        return Err(Refused::NoResults { path: folder.to_owned(), wanted: "a folder" }.into());
    }
    let figures = figures(folder)?;
    if figures.is_empty() {
        let wanted = "one of probes.csv, solver.csv, energy.csv, haptic.csv, report.json";
        return Err(Refused::NoResults { path: folder.to_owned(), wanted }.into());
    }
    let mut listing = Listing::open(folder, &[FOLDER], is_plot)?;
    let mut files = vec![];
    listing.remove(is_plot)?;
    for figure in &figures {
        let failed =
            |error: Box<dyn std::error::Error>| Refused::Plot { file: figure.name, message: error.to_string() };
        let size = draw::size(figure);
        let mut text = String::new();
        draw::draw(figure, &SVGBackend::with_string(&mut text, size).into_drawing_area()).map_err(failed)?;
        let canvas = Rc::new(RefCell::new(Canvas::new(size.0, size.1)));
        draw::draw(figure, &DrawingArea::from(&canvas)).map_err(failed)?;
        let svg = listing.add(&format!("{FOLDER}/{}.svg", figure.name))?;
        replace(&svg, text.as_bytes())?;
        let png = listing.add(&format!("{FOLDER}/{}.png", figure.name))?;
        let bytes =
            view::png(&canvas.borrow().image()).map_err(|source| Failed::Write { path: png.clone(), source })?;
        replace(&png, &bytes)?;
        files.extend([svg, png]);
    }
    Ok(files)
}

/// Units at the end of a probe's column, the quantity that each is of; plain numbers have none.
const UNITS: [(&str, &str, &str); 8] = [
    ("_m3", "m³", "volume"),
    ("_rad_s", "rad/s", "angular velocity"),
    ("_m_s", "m/s", "velocity"),
    ("_pa", "Pa", "stress, pressure"),
    ("_ratio", "", "strain, ratio"),
    ("_m", "m", "displacement, position"),
    ("_n", "N", "force"),
    ("", "", "value"),
];

/// Figures of what is in a folder.
fn figures(folder: &Path) -> Result<Vec<Figure>> {
    let report = report(folder)?;
    let scene = report.as_ref().and_then(|report| report["scene"].as_str()).unwrap_or("a run");
    let probes = Rows::open(&folder.join(PROBES))?.map(Probes::read).transpose()?;
    let by_pair = by_pair(folder)?;
    let haptic = Rows::open(&folder.join("haptic.csv"))?.map(Haptic::read).transpose()?;
    let (mut of_forces, mut others) = (vec![], vec![]);
    if let Some(probes) = probes {
        of_forces.push(Panel::new("largest contact force on a rigid body", "force", "N", vec![probes.contact]));
        for (k, (_, unit, quantity)) in UNITS.iter().enumerate() {
            let panel = Panel::new(&format!("probes: {quantity}"), quantity, unit, probes.by_unit[k].clone());
            if *unit == "N" { of_forces.push(panel) } else { others.push(panel) }
        }
    }
    of_forces.push(Panel::new("contact force between two bodies (magnitude of the sum)", "force", "N", by_pair));
    let (mut on_hand, mut age) = (vec![], vec![]);
    if let Some(haptic) = haptic {
        (on_hand, age) = (haptic.force, haptic.age);
    }
    of_forces.push(Panel::new("force on the hand, at the haptic rate", "force", "N", on_hand));
    let age = Panel::new("age of the contact problem that the haptic loop solves", "age", "s", age);
    let bars = report.as_ref().map(|report| bars(folder, report)).transpose()?;
    let all = [
        Figure::of("force", format!("{scene}: forces"), None, of_forces),
        Figure::of("probes", format!("{scene}: probes"), None, others),
        Figure::of("energy", format!("{scene}: energy"), None, energy(folder)?),
        Figure::of("residual", format!("{scene}: convergence"), None, solver(folder)?),
        Figure::of("timing", format!("{scene}: computing time"), bars, vec![age]),
    ];
    Ok(all.into_iter().flatten().collect())
}

/// Curves of `probes.csv`.
struct Probes {
    contact: Curve,
    /// `[unit]` of [`UNITS`].
    by_unit: Vec<Vec<Curve>>,
}

impl Probes {
    fn read(mut rows: Rows) -> Result<Self> {
        let [_, fixed @ ..] = FIXED_COLUMNS;
        let mut out = Self { contact: Curve::new("largest"), by_unit: vec![vec![]; UNITS.len()] };
        let unit = |name: &str| UNITS.iter().position(|(end, ..)| name.ends_with(end)).unwrap_or(UNITS.len() - 1);
        // column, unit, number among the curves of that unit
        let mut places = vec![];
        for (column, name) in rows.columns.iter().enumerate().skip(1) {
            if !fixed.contains(&name.as_str()) {
                let curves = &mut out.by_unit[unit(name)];
                places.push((column, unit(name), curves.len()));
                curves.push(Curve::new(name.strip_suffix(UNITS[unit(name)].0).unwrap_or(name)));
            }
        }
        let contact = rows.columns.iter().position(|name| name == "contact_force_n");
        while rows.next()? {
            let time = rows.number(0)?;
            for (column, unit, curve) in &places {
                out.by_unit[*unit][*curve].add(time, rows.number(*column)?);
            }
            if let Some(column) = contact {
                out.contact.add(time, rows.number(column)?);
            }
        }
        Ok(out)
    }
}

/// Force on the hand and age of its contact problem, by tool.
struct Haptic {
    force: Vec<Curve>,
    age: Vec<Curve>,
}

impl Haptic {
    fn read(mut rows: Rows) -> Result<Self> {
        let tool = rows.column("tool")?;
        let force = [rows.column("force_x_n")?, rows.column("force_y_n")?, rows.column("force_z_n")?];
        let age = rows.column("coupling_age_ms")?;
        let mut tools: BTreeMap<String, [Curve; 2]> = BTreeMap::new();
        while rows.next()? {
            let number = rows.word(tool).to_string();
            let new = || [0; 2].map(|_| Curve::new(format!("tool {number}")));
            let (time, curves) = (rows.number(0)?, tools.entry(number.clone()).or_insert_with(new));
            let mut along = [0.0; 3];
            for (value, column) in along.iter_mut().zip(force) {
                *value = rows.number(column)?;
            }
            curves[0].add(time, DVec3::from(along).length());
            curves[1].add(time, rows.number(age)? * 1e-3);
        }
        let (force, age) = tools.into_values().map(|[force, age]| (force, age)).unzip();
        Ok(Self { force, age })
    }
}

/// Magnitude of the contact force between each two bodies, at the times of `probes.csv`.
fn by_pair(folder: &Path) -> Result<Vec<Curve>> {
    let (Some(mut steps), Some(mut rows)) = (Rows::open(&folder.join(PROBES))?, Rows::open(&folder.join(CONTACTS))?)
    else {
        return Ok(vec![]);
    };
    let bodies = [rows.column("first")?, rows.column("second")?];
    let force = [rows.column("force_x_n")?, rows.column("force_y_n")?, rows.column("force_z_n")?];
    let mut pairs: BTreeMap<[String; 2], (DVec3, Curve)> = BTreeMap::new();
    let (mut more, mut before) = (rows.next()?, None);
    while steps.next()? {
        let time = steps.number(0)?;
        while more && rows.number(0)? <= time {
            let names = bodies.map(|column| rows.word(column).to_string());
            let pair = pairs.entry(names).or_insert_with_key(|[first, second]| {
                let mut curve = Curve::new(format!("{second} on {first}"));
                before.iter().for_each(|time| curve.add(*time, 0.0));
                (DVec3::ZERO, curve)
            });
            let mut along = [0.0; 3];
            for (value, column) in along.iter_mut().zip(force) {
                *value = rows.number(column)?;
            }
            pair.0 += DVec3::from(along);
            more = rows.next()?;
        }
        for (sum, curve) in pairs.values_mut() {
            curve.add(time, std::mem::take(sum).length());
        }
        before = Some(time);
    }
    Ok(pairs.into_values().map(|(_, curve)| curve).collect())
}

/// Columns of a table as curves.
fn curves(rows: &mut Rows, names: &[(&str, &str)]) -> Result<Vec<Curve>> {
    let columns = names.iter().map(|(column, _)| rows.column(column)).collect::<Result<Vec<_>>>()?;
    let mut curves: Vec<Curve> = names.iter().map(|(_, name)| Curve::new(*name)).collect();
    while rows.next()? {
        let time = rows.number(0)?;
        for (curve, column) in curves.iter_mut().zip(&columns) {
            curve.add(time, rows.number(*column)?);
        }
    }
    Ok(curves)
}

fn energy(folder: &Path) -> Result<Vec<Panel>> {
    const NAMES: [(&str, &str); 9] = [
        ("kinetic_j", "kinetic"),
        ("elastic_j", "elastic"),
        ("potential_j", "potential"),
        ("work_loads_j", "work of loads"),
        ("work_hands_j", "work of hands"),
        ("work_overlaps_j", "work of overlaps"),
        ("friction_j", "friction"),
        ("cutting_j", "cutting"),
        ("impact_j", "impact"),
    ];
    let Some(mut rows) = Rows::open(&folder.join(ENERGY))? else { return Ok(vec![]) };
    let mut stored = curves(&mut rows, &NAMES)?;
    let mut spent = stored.split_off(3);
    let dissipated = spent.split_off(3);
    Ok(vec![
        Panel::new("energy of the bodies", "energy", "J", stored),
        Panel::new("work done on them so far", "work", "J", spent),
        Panel::new("dissipated so far", "energy", "J", dissipated),
    ])
}

fn solver(folder: &Path) -> Result<Vec<Panel>> {
    const NAMES: [(&str, &str); 6] = [
        ("residual", "unconstrained motion"),
        ("iterations", "iterations"),
        ("newton_iterations", "Newton iterations"),
        ("contact_passes", "contact passes"),
        ("contact_residual_n", "force"),
        ("contact_residual_mm", "distance"),
    ];
    let Some(mut rows) = Rows::open(&folder.join(SOLVER))? else { return Ok(vec![]) };
    let mut residual = curves(&mut rows, &NAMES)?;
    let mut counts = residual.split_off(1);
    let mut force = counts.split_off(3);
    let distance = force.split_off(1);
    let panel =
        |title, quantity, unit, curves| Panel { logarithmic: true, ..Panel::new(title, quantity, unit, curves) };
    Ok(vec![
        panel("residual relative to the step's load", "residual", "", residual),
        Panel::new("iterations and passes per step", "count", "", counts),
        panel("contact: force change by one more pass", "residual", "N", force),
        panel("contact: penetration, slip where it sticks", "residual", "mm", distance),
    ])
}

/// The report of a folder, if there is one.
fn report(folder: &Path) -> Result<Option<Value>> {
    let path = folder.join("report.json");
    let text = match std::fs::read_to_string(&path) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        text => text,
    };
    let refused = |line: usize, found: String| Refused::Table {
        at: if line > 0 { format!("{}:{line}", path.display()) } else { path.display().to_string() },
        found,
        wanted: "the report that `cutis run` has written",
    };
    let text = text.map_err(|error| refused(0, format!("a file that cannot be read ({error})")))?;
    let parsed: std::result::Result<Value, _> = serde_json::from_str(&text);
    Ok(Some(parsed.map_err(|error| refused(error.line(), error.to_string()))?))
}

/// Times of a step and of its parts.
fn bars(folder: &Path, report: &Value) -> Result<Bars> {
    const PARTS: [(&str, &str); 9] = [
        ("/step_ms", "whole step"),
        ("/costs/search_ms", "search"),
        ("/costs/free_ms", "free motion"),
        ("/costs/columns_ms", "columns"),
        ("/costs/corrections_ms", "corrections"),
        ("/costs/laws_ms", "laws"),
        ("/costs/hand_over_ms", "hand-over"),
        ("/costs/cut_ms", "cut"),
        ("/costs/other_ms", "other"),
    ];
    let number = |key: String| match report.pointer(&key) {
        Some(Value::Null) => Ok(0.0), // of no step
        found => found.and_then(Value::as_f64).ok_or_else(|| Refused::Table {
            at: folder.join("report.json").display().to_string(),
            found: format!("no number `{}`", key.trim_start_matches('/').replace('/', ".")),
            wanted: "the report that `cutis run` has written",
        }),
    };
    let mut bars = vec![];
    for (key, name) in PARTS {
        let middle = if key == "/step_ms" { "median" } else { "mean" };
        let [middle, p99, max] = [middle, "p99", "max"].map(|value| number(format!("{key}/{value}")));
        bars.push(Bar { name, middle: middle?, p99: p99?, max: max? });
    }
    Ok(Bars {
        title: "a step (median) and its parts (mean); line: 99 of 100, tick: maximum".into(),
        bars,
        budget: number("/step_s".into())? * 1e3,
    })
}
