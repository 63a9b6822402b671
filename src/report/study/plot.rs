//! Plot study.svg: error over time per step, both logarithmic; a panel per path, a curve per method, the front marked.

use super::super::Refused;
use super::settings::element_word;
use super::{Row, Setting, Stop, Study};
use crate::error::Result;
use crate::scene::{Element, Law, PRECONDITIONERS, Preconditioner, word};
use plotters::coord::Shift;
use plotters::coord::combinators::LogCoord;
use plotters::prelude::*;
use std::ops::Range;

/// Size of a panel, px.
const PANEL: (u32, u32) = (430, 470);
/// Height of the title and width of the legend, px.
const TITLE: u32 = 56;
const LEGEND: u32 = 190;
/// Smaller errors are drawn here.
const LEAST: f64 = 1e-5;
/// Larger errors are not drawn.
const MOST: f64 = 10.0;

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<LogCoord<f64>, LogCoord<f64>>>;
type Drawn = std::result::Result<(), Box<dyn std::error::Error>>;

/// Computing time per step of the study, ms, and total error, %. A longer step is scaled by the scene time that it covers.
fn point(study: &Study, row: &Row) -> Option<(f64, f64)> {
    let error = row.error_total.filter(|e| *e <= MOST)?;
    Some((row.real_time() * study.step * 1e3, error.max(LEAST) * 100.0))
}

/// The plot as SVG text.
pub(super) fn picture(study: &Study) -> Result<String> {
    let mut text = String::new();
    let mut paths: Vec<[&str; 2]> = vec![];
    for row in &study.rows {
        let path = row.setting.platform.backend_and_precision();
        if !paths.contains(&path) {
            paths.push(path);
        }
    }
    {
        let size = (PANEL.0 * paths.len().max(1) as u32 + LEGEND, PANEL.1 + TITLE);
        let area = SVGBackend::with_string(&mut text, size).into_drawing_area();
        draw(study, &paths, &area).map_err(|e| Refused::Plot { file: "study.svg", message: e.to_string() })?;
    }
    Ok(text)
}

fn draw(study: &Study, paths: &[[&str; 2]], area: &Area) -> Drawn {
    area.fill(&WHITE)?;
    let (head, body) = area.split_vertically(TITLE);
    let font = ("sans-serif", 15).into_font();
    head.draw(&Text::new(format!("{}: total error against time per step", study.scene), (14, 10), font.clone()))?;
    let adapter = study.adapter.as_ref().map_or(String::new(), |a| format!("; GPU: {a}"));
    let small = ("sans-serif", 12).into_font();
    head.draw(&Text::new(format!("{}{adapter}", study.machine), (14, 32), small))?;
    let points: Vec<(f64, f64)> = study.rows.iter().filter_map(|r| point(study, r)).collect();
    let (times, errors) = (decades(points.iter().map(|p| p.0)), decades(points.iter().map(|p| p.1)));
    let (panels, beside) = body.split_horizontally(PANEL.0 * paths.len().max(1) as u32);
    for (panel, path) in panels.split_evenly((1, paths.len().max(1))).iter().zip(paths) {
        let name = format!("{} {}", path[0].to_uppercase(), path[1]);
        let mut chart = ChartBuilder::on(panel)
            .caption(name, font.clone())
            .margin(10)
            .x_label_area_size(38)
            .y_label_area_size(58)
            .build_cartesian_2d(times.clone().log_scale(), errors.clone().log_scale())?;
        let mut mesh = chart.configure_mesh();
        mesh.light_line_style(BLACK.mix(0.06))
            .x_desc(format!("time per step of {} ms, ms", (study.step * 1e9).round() / 1e6))
            .y_desc("error, %")
            .draw()?;
        front(&mut chart, study, path)?;
        let own: Vec<&Row> =
            study.rows.iter().filter(|r| r.setting.platform.backend_and_precision() == *path).collect();
        for method in methods(&own) {
            curve(&mut chart, study, &own, method)?;
        }
    }
    legend(&beside, &study.rows.iter().collect::<Vec<_>>())?;
    area.present()?;
    Ok(())
}

/// Range of whole decades around values, at least one decade.
fn decades(values: impl Iterator<Item = f64>) -> Range<f64> {
    let (low, high) = values.fold((f64::INFINITY, 0.0f64), |(l, h), v| (l.min(v), h.max(v)));
    if low > high {
        return 0.1..10.0;
    }
    let (low, high) = (low.log10().floor(), (high * 1.0001).log10().ceil());
    10f64.powf(low)..10f64.powf(high.max(low + 1.0))
}

/// Method of a curve.
type Method = (Law, Preconditioner);

fn method(s: &Setting) -> Method {
    (s.law, s.preconditioner)
}

fn methods(rows: &[&Row]) -> Vec<Method> {
    let mut found = vec![];
    for row in rows {
        if !found.contains(&method(&row.setting)) {
            found.push(method(&row.setting));
        }
    }
    found
}

fn color(preconditioner: Preconditioner) -> RGBColor {
    match preconditioner {
        Preconditioner::None => RGBColor(120, 120, 120),
        Preconditioner::Jacobi => RGBColor(210, 150, 30),
        Preconditioner::Block => RGBColor(150, 90, 160),
        Preconditioner::Column => RGBColor(40, 120, 190),
        Preconditioner::Multigrid => RGBColor(205, 50, 40),
        Preconditioner::Direct => RGBColor(50, 150, 80),
    }
}

/// Dash and gap of a curve, px; none for a solid line.
fn dash(law: Law) -> Option<[u32; 2]> {
    match law {
        Law::Fem { element: Element::Plain, .. } => Some([2, 4]),
        Law::Fem { element: Element::Enhanced, .. } => Some([8, 4]),
        _ => None,
    }
}

/// Points of a method, with its own front as a curve. A ring marks runs that stop after a fixed number of iterations.
fn curve(chart: &mut Chart, study: &Study, rows: &[&Row], (law, preconditioner): Method) -> Drawn {
    let own = rows.iter().filter(|r| method(&r.setting) == (law, preconditioner));
    let color = color(preconditioner);
    let all: Vec<(f64, f64, bool)> = own
        .filter_map(|r| point(study, r).map(|(x, y)| (x, y, matches!(r.setting.stop, Stop::Iterations(_)))))
        .collect();
    chart.draw_series(all.iter().map(|(x, y, limited)| {
        let style = if *limited { color.stroke_width(1) } else { color.mix(0.6).filled() };
        Circle::new((*x, *y), 3, style)
    }))?;
    let line = lower_left(all.iter().map(|(x, y, _)| (*x, *y)).collect());
    let style = color.stroke_width(2);
    match dash(law) {
        None => chart.draw_series(LineSeries::new(line, style))?,
        Some([on, off]) => chart.draw_series(DashedLineSeries::new(line, on, off, style))?,
    };
    Ok(())
}

/// The study's front as a broad line in every panel; its points in this panel ringed.
fn front(chart: &mut Chart, study: &Study, path: &[&str; 2]) -> Drawn {
    let marked = || study.rows.iter().filter(|r| r.pareto);
    let all = lower_left(marked().filter_map(|r| point(study, r)).collect());
    chart.draw_series(LineSeries::new(all, FRONT.mix(0.3).stroke_width(7)))?;
    let here = marked().filter(|r| r.setting.platform.backend_and_precision() == *path).filter_map(|r| point(study, r));
    chart.draw_series(here.map(|p| Circle::new(p, 7, BLACK.stroke_width(1))))?;
    Ok(())
}

const FRONT: RGBColor = RGBColor(120, 120, 120);

/// Points that no other beats, sorted by time.
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

fn legend(area: &Area, rows: &[&Row]) -> Drawn {
    let mut y = 40;
    let mut write = |text: String, draw: &dyn Fn(i32) -> Drawn| -> Drawn {
        draw(y)?;
        area.draw(&Text::new(text, (36, y - 6), ("sans-serif", 12).into_font()))?;
        y += 19;
        Ok(())
    };
    for (law, preconditioner) in methods(rows) {
        let style = color(preconditioner).stroke_width(2);
        let line = |y: i32| -> Drawn {
            let [on, off] = dash(law).unwrap_or([26, 0]).map(|n| n as i32);
            let mut x = 4;
            while x < 30 {
                area.draw(&PathElement::new(vec![(x, y), ((x + on).min(30), y)], style))?;
                x += on + off;
            }
            Ok(())
        };
        write(format!("{} {}", element_word(law), word(&PRECONDITIONERS, preconditioner)), &line)?;
    }
    let broad = |y: i32| -> Drawn {
        area.draw(&PathElement::new(vec![(4, y), (30, y)], FRONT.mix(0.3).stroke_width(7)))?;
        Ok(())
    };
    write("front of all panels".into(), &broad)?;
    let ring = |radius: i32, style: ShapeStyle| {
        move |y: i32| -> Drawn {
            area.draw(&Circle::new((17, y), radius, style))?;
            Ok(())
        }
    };
    write("on that front".into(), &ring(7, BLACK.stroke_width(1)))?;
    write("to a tolerance".into(), &ring(3, FRONT.filled()))?;
    write("a number of iterations".into(), &ring(3, FRONT.stroke_width(1)))
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
        assert_eq!(decades(std::iter::empty()), 0.1..10.0);
        assert_eq!(decades([2.0, 4.0].into_iter()), 1.0..10.0);
        assert_eq!(decades([0.5, 100.0].into_iter()), 0.1..1000.0);
    }
}
