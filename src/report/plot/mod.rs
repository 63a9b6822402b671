//! Plots of a run from the tables in its folder: force, probes, energy, convergence and computing time over the run's time, each as SVG and
//! as PNG.
//!
//! A figure is drawn where the folder has its table: `force` from probes.csv, contacts.csv and haptic.csv, `probes` from probes.csv, `energy`
//! from energy.csv, `residual` from solver.csv, `timing` from report.json and haptic.csv. Tables are read a row at a time; of a long one a
//! curve keeps the least and the largest value of neighbouring rows.

mod canvas;
mod draw;
mod read;

use super::Refused;
use super::listing::Listing;
use crate::error::Result;
use crate::output::{Failed, replace};
use crate::view;
use canvas::Canvas;
use plotters::prelude::{DrawingArea, IntoDrawingArea, SVGBackend};
use std::cell::RefCell;
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
    let figures = read::figures(folder)?;
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
