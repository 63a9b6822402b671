//! study.svg: error against time per step, both logarithmic, a panel per path, a curve per method, the front marked.

use super::files::{element_name, path_name};
use super::{Row, Setting, Stop, Study};
use crate::error::{Error, Result};
use crate::report::preconditioner_name;
use crate::scene::{Element, Preconditioner};
use plotters::coord::Shift;
use plotters::prelude::*;
use std::ops::Range;

/// Size of a panel, px.
const PANEL: (u32, u32) = (460, 470);
/// Of the title.
const TITLE: u32 = 56;
/// Errors below this are drawn at it.
const LEAST: f64 = 1e-5;
/// And above this are not drawn.
const MOST: f64 = 10.0;

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Chart<'a, 'b> = ChartContext<
    'a,
    SVGBackend<'b>,
    Cartesian2d<plotters::coord::combinators::LogCoord<f64>, plotters::coord::combinators::LogCoord<f64>>,
>;

/// Time per step, ms, and total error.
fn point(row: &Row) -> Option<(f64, f64)> {
    let error = row.error_total.filter(|e| *e <= MOST)?;
    Some((row.trace.ms_per_step, error.max(LEAST)))
}

/// The picture's text.
pub(super) fn picture(study: &Study) -> Result<String> {
    let failed = |e: &dyn std::fmt::Display| Error::Device { message: format!("the picture cannot be drawn: {e}") };
    let mut text = String::new();
    let mut paths: Vec<[&str; 2]> = vec![];
    for row in &study.rows {
        let path = path_name(&row.setting.place);
        if !paths.contains(&path) {
            paths.push(path);
        }
    }
    {
        let size = (PANEL.0 * paths.len().max(1) as u32, PANEL.1 + TITLE);
        let area = SVGBackend::with_string(&mut text, size).into_drawing_area();
        draw(study, &paths, &area).map_err(|e| failed(&e))?;
    }
    Ok(text)
}

fn draw(study: &Study, paths: &[[&str; 2]], area: &Area) -> std::result::Result<(), Box<dyn std::error::Error>> {
    area.fill(&WHITE)?;
    let (head, body) = area.split_vertically(TITLE);
    let font = ("sans-serif", 15).into_font();
    head.draw(&Text::new(format!("{}: total error against time per step", study.scene), (14, 10), font.clone()))?;
    let adapter = study.adapter.as_ref().map_or(String::new(), |a| format!("; GPU: {a}"));
    let small = ("sans-serif", 12).into_font();
    head.draw(&Text::new(format!("{}{adapter}", study.machine), (14, 32), small))?;
    let points: Vec<(f64, f64)> = study.rows.iter().filter_map(point).collect();
    let (times, errors) = (range(points.iter().map(|p| p.0)), range(points.iter().map(|p| p.1)));
    for (panel, path) in body.split_evenly((1, paths.len().max(1))).iter().zip(paths) {
        let name = format!("{} {}", path[0].to_uppercase(), path[1]);
        let mut chart = ChartBuilder::on(panel)
            .caption(name, font.clone())
            .margin(10)
            .x_label_area_size(38)
            .y_label_area_size(58)
            .build_cartesian_2d(times.clone().log_scale(), errors.clone().log_scale())?;
        chart
            .configure_mesh()
            .light_line_style(BLACK.mix(0.05))
            .x_desc("time per step, ms")
            .y_desc("error, relative")
            .draw()?;
        let own: Vec<&Row> = study.rows.iter().filter(|r| path_name(&r.setting.place) == *path).collect();
        curves(&mut chart, &own)?;
        front(&mut chart, study, path)?;
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::LowerLeft)
            .background_style(WHITE.mix(0.8))
            .border_style(BLACK.mix(0.2))
            .label_font(("sans-serif", 11))
            .draw()?;
    }
    area.present()?;
    Ok(())
}

/// From a little below the least to a little above the greatest.
fn range(values: impl Iterator<Item = f64>) -> Range<f64> {
    let (low, high) = values.fold((f64::INFINITY, 0.0f64), |(l, h), v| (l.min(v), h.max(v)));
    if low <= high { low / 1.5..high * 1.5 } else { 0.1..10.0 }
}

/// What one curve is of.
fn method(s: &Setting) -> (Option<Element>, Preconditioner) {
    (s.element, s.preconditioner)
}

fn color(preconditioner: Preconditioner) -> RGBColor {
    match preconditioner {
        Preconditioner::None => RGBColor(120, 120, 120),
        Preconditioner::Jacobi => RGBColor(200, 140, 40),
        Preconditioner::Block => RGBColor(150, 90, 160),
        Preconditioner::Column => RGBColor(50, 130, 190),
        Preconditioner::Multigrid => RGBColor(200, 60, 50),
        Preconditioner::Direct => RGBColor(60, 150, 90),
    }
}

/// All points of each method, small, and its own front as a curve.
fn curves(chart: &mut Chart, rows: &[&Row]) -> std::result::Result<(), Box<dyn std::error::Error>> {
    let mut methods = vec![];
    for row in rows {
        if !methods.contains(&method(&row.setting)) {
            methods.push(method(&row.setting));
        }
    }
    for (element, preconditioner) in methods {
        let own = rows.iter().filter(|r| method(&r.setting) == (element, preconditioner));
        let color = color(preconditioner);
        let filled = element != Some(Element::Plain);
        let all: Vec<(f64, f64, bool)> =
            own.filter_map(|r| point(r).map(|(x, y)| (x, y, matches!(r.setting.stop, Stop::Iterations(_))))).collect();
        // what stops after a number of iterations is a hollow ring: its error is what it left unsolved
        chart.draw_series(all.iter().map(|(x, y, limited)| {
            let style = if *limited { color.stroke_width(1) } else { color.mix(0.45).filled() };
            Circle::new((*x, *y), 2, style)
        }))?;
        let width = if filled { 2 } else { 1 };
        let line = lower_left(all.iter().map(|(x, y, _)| (*x, *y)).collect());
        let label = format!("{} {}", element_name(element), preconditioner_name(preconditioner));
        let style = color.stroke_width(width);
        let dashes = if filled { 1000 } else { 5 };
        let drawn = chart.draw_series(DashedLineSeries::new(line, dashes, if filled { 0 } else { 4 }, style))?;
        drawn.label(label).legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 18, y)], style));
    }
    Ok(())
}

/// Points that none of the others beats, by time.
fn lower_left(mut points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    points.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let mut least = f64::INFINITY;
    points.retain(|p| {
        let better = p.1 < least;
        least = least.min(p.1);
        better
    });
    points
}

/// The study's front as a grey line in every panel; its own points of this panel ringed.
fn front(chart: &mut Chart, study: &Study, path: &[&str; 2]) -> std::result::Result<(), Box<dyn std::error::Error>> {
    let of = |here: bool| {
        let marked = study.rows.iter().filter(move |r| r.pareto && (!here || path_name(&r.setting.place) == *path));
        lower_left(marked.filter_map(point).collect())
    };
    let style = BLACK.mix(0.25).stroke_width(4);
    let drawn = chart.draw_series(LineSeries::new(of(false), style))?;
    drawn.label("front of all paths").legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 18, y)], style));
    chart.draw_series(of(true).into_iter().map(|p| Circle::new(p, 6, BLACK.stroke_width(1))))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_goes_down_only() {
        let points = vec![(3.0, 0.2), (1.0, 0.5), (2.0, 0.1), (2.0, 0.4)];
        assert_eq!(lower_left(points), [(1.0, 0.5), (2.0, 0.1)]);
    }

    #[test]
    fn a_range_of_nothing_can_be_drawn() {
        assert_eq!(range(std::iter::empty()), 0.1..10.0);
        assert_eq!(range([2.0, 4.0].into_iter()), 2.0 / 1.5..6.0);
    }
}
