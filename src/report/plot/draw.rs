//! Figures of curves over time, in bounded memory, and how they are drawn: panels below each other, each with its axes and, beside them, its
//! legend.

use plotters::coord::Shift;
use plotters::coord::ranged1d::{KeyPointHint, Ranged, ValueFormatter};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::ops::Range;

/// Width of a figure, of its legend, and of the names of bars; height of its title, of a panel and of a bar.
pub(super) const WIDTH: u32 = 900;
const LEGEND: u32 = 210;
const NAMES: u32 = 110;
const HEAD: u32 = 40;
const PANEL: u32 = 235;
const BAR: u32 = 24;
/// Height of bars without the bars: title and axis.
const AROUND_BARS: u32 = 76;
/// Most curves of a panel; more are told and not drawn.
const MOST_CURVES: usize = 10;
/// Most letters of a name in the legend, and of a title.
const NAME_LETTERS: usize = 27;
const TITLE_LETTERS: usize = 96;
/// Shortest axis; shorter ones are of 1 about 0.
const SMALLEST: f64 = 1e-100;
/// Font sizes.
const LARGE: i32 = 18;
const MIDDLE: i32 = 15;
const SMALL: i32 = 13;
const INK: RGBColor = RGBColor(40, 42, 48);

/// Colours that are told apart with any kind of colour vision (Okabe, Ito 2008), the yellow left out.
const COLORS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
    RGBColor(0, 0, 0),
];

type Area<D> = DrawingArea<D, Shift>;
type Drawn = Result<(), Box<dyn std::error::Error>>;

/// Width and height of a figure, units.
pub(super) fn size(figure: &Figure) -> (u32, u32) {
    let bars = figure.bars.as_ref().map_or(0, |bars| AROUND_BARS + BAR * bars.bars.len() as u32);
    (WIDTH, HEAD + bars + PANEL * figure.panels.len() as u32)
}

/// Draws a figure on an area of its size.
pub(super) fn draw<D: DrawingBackend>(figure: &Figure, area: &Area<D>) -> Drawn
where
    D::ErrorType: 'static,
{
    area.fill(&WHITE)?;
    let (head, mut rest) = area.split_vertically(HEAD);
    head.draw(&Text::new(shortened(&figure.title, TITLE_LETTERS), (16, 14), style(LARGE)))?;
    if let Some(found) = &figure.bars {
        let (own, below) = rest.split_vertically(AROUND_BARS + BAR * found.bars.len() as u32);
        bars(found, &own)?;
        rest = below;
    }
    for panel in &figure.panels {
        let (own, below) = rest.split_vertically(PANEL);
        let (axes, beside) = own.split_horizontally(WIDTH - LEGEND);
        axes.draw(&Text::new(panel.title.clone(), (70, 4), style(MIDDLE)))?;
        curves(panel, &axes.margin(24, 0, 8, 0))?;
        legend(panel, &beside.margin(30, 0, 12, 0))?;
        rest = below;
    }
    area.present()?;
    Ok(())
}

fn style(size: i32) -> TextStyle<'static> {
    ("sans-serif", size).into_font().color(&INK)
}

fn shortened(text: &str, most: usize) -> String {
    let count = text.chars().count();
    match count > most {
        true => text.chars().take(most - 2).chain("..".chars()).collect(),
        false => text.into(),
    }
}

/// Factor and unit in which the largest value has one to three digits before the point.
fn scaled(unit: &str, largest: f64) -> (f64, String) {
    let prefixes = [(1e9, "n"), (1e6, "µ"), (1e3, "m"), (1.0, ""), (1e-3, "k"), (1e-6, "M")];
    if unit.is_empty() || unit.contains(['/', '³']) || unit.starts_with('m') && unit.len() > 1 {
        return (1.0, unit.into());
    }
    let fits = |(factor, _): &&(f64, &str)| (1.0..1000.0).contains(&(largest * factor));
    let (factor, prefix) = prefixes.iter().find(fits).copied().unwrap_or((1.0, ""));
    // kilometres and kiloseconds are nobody's units
    match factor < 1.0 && matches!(unit, "m" | "s") {
        true => (1.0, unit.into()),
        false => (factor, format!("{prefix}{unit}")),
    }
}

/// Label of an axis.
fn label(quantity: &str, unit: &str) -> String {
    if unit.is_empty() { quantity.into() } else { format!("{quantity}, {unit}") }
}

/// Range of values from 0, or of both signs, with some room.
fn range(values: impl Iterator<Item = f64>) -> Range<f64> {
    let (low, high) = values.fold((0.0f64, 0.0f64), |(low, high), y| (low.min(y), high.max(y)));
    match high - low > SMALLEST {
        true => low - 0.06 * (high - low) * f64::from(u8::from(low < 0.0))..high + 0.06 * (high - low),
        false => 0.0..1.0,
    }
}

/// Whole decades around positive values.
fn decades(values: impl Iterator<Item = f64>) -> Range<f64> {
    let (low, high) = values.fold((f64::INFINITY, 0.0f64), |(low, high), y| (low.min(y), high.max(y)));
    if low > high {
        return 0.1..1.0;
    }
    let (low, high) = (low.log10().floor(), (high * 1.0001).log10().ceil());
    10f64.powf(low)..10f64.powf(high.max(low + 1.0))
}

fn shown(panel: &Panel) -> &[Curve] {
    &panel.curves[..panel.curves.len().min(MOST_CURVES)]
}

/// Whether a curve is left to the legend: one that is always 0 would lie on others, or on the axis.
fn hidden(panel: &Panel, curve: &Curve) -> bool {
    let zero = |curve: &Curve| curve.points().all(|(_, y)| y == 0.0);
    zero(curve) && (panel.logarithmic || shown(panel).iter().any(|other| !zero(other)))
}

fn curves<D: DrawingBackend>(panel: &Panel, area: &Area<D>) -> Drawn
where
    D::ErrorType: 'static,
{
    let all = || shown(panel).iter().flat_map(Curve::points);
    let (first, last) = all().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), (t, _)| (a.min(t), b.max(t)));
    let times = if last > first { first.min(0.0)..last } else { first - 0.5..first + 0.5 };
    let mut chart = ChartBuilder::on(area);
    chart.x_label_area_size(36).y_label_area_size(62);
    if panel.logarithmic {
        let values = decades(all().map(|p| p.1).filter(|y| *y > SMALLEST));
        let name = label(&panel.quantity, &panel.unit);
        lines(panel, chart.build_cartesian_2d(times, Decades(values))?, 1.0, &name, &decade)
    } else {
        let largest = all().map(|p| p.1.abs()).fold(0.0, f64::max);
        let (factor, unit) = scaled(&panel.unit, largest);
        let values = range(all().map(|p| p.1 * factor));
        let name = label(&panel.quantity, &unit);
        let digits = digits(values.end - values.start);
        lines(panel, chart.build_cartesian_2d(times, values)?, factor, &name, &|y: &f64| {
            format!("{:.digits$}", y + 0.0)
        })
    }
}

/// Text of a power of ten.
fn decade(value: &f64) -> String {
    format!("1e{}", value.log10().round())
}

/// Digits after the point of some labels over an extent.
fn digits(extent: f64) -> usize {
    (1.0 - (extent / 2.0).log10().floor()).clamp(0.0, 9.0) as usize
}

/// Logarithmic axis that labels decades alone.
struct Decades(Range<f64>);

impl Ranged for Decades {
    type FormatOption = plotters::coord::ranged1d::NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        let share = (value / self.0.start).log10() / (self.0.end / self.0.start).log10();
        limit.0 + (share * f64::from(limit.1 - limit.0)).round() as i32
    }

    fn key_points<H: KeyPointHint>(&self, hint: H) -> Vec<f64> {
        let count = (self.0.end / self.0.start).log10().round().max(1.0) as i32;
        let each = (count as usize).div_ceil(hint.max_num_points().clamp(1, 7)).max(1);
        (0..=count).step_by(each).map(|k| self.0.start * 10f64.powi(k)).collect()
    }

    fn range(&self) -> Range<f64> {
        self.0.clone()
    }
}

impl ValueFormatter<f64> for Decades {}

fn lines<D: DrawingBackend, Y: Ranged<ValueType = f64> + ValueFormatter<f64>>(
    panel: &Panel,
    mut chart: ChartContext<D, Cartesian2d<plotters::coord::types::RangedCoordf64, Y>>,
    factor: f64,
    name: &str,
    format: &dyn Fn(&f64) -> String,
) -> Drawn
where
    D::ErrorType: 'static,
{
    chart
        .configure_mesh()
        .light_line_style(WHITE)
        .bold_line_style(INK.mix(0.13))
        .axis_style(INK.mix(0.6))
        .x_labels(8)
        .y_labels(6)
        .label_style(style(SMALL))
        .axis_desc_style(style(SMALL))
        .x_desc("time, s")
        .y_desc(name)
        .y_label_formatter(&|y| format(y))
        .draw()?;
    for (k, curve) in shown(panel).iter().enumerate().filter(|(_, curve)| !hidden(panel, curve)) {
        let points = curve.points().filter(|(_, y)| !panel.logarithmic || *y > SMALLEST).map(|(t, y)| (t, y * factor));
        chart.draw_series(LineSeries::new(points, line_style(k)))?;
    }
    Ok(())
}

fn line_style(number: usize) -> ShapeStyle {
    COLORS[number % COLORS.len()].stroke_width(if number < COLORS.len() { 2 } else { 1 })
}

fn legend<D: DrawingBackend>(panel: &Panel, area: &Area<D>) -> Drawn
where
    D::ErrorType: 'static,
{
    let left = style(SMALL).pos(Pos::new(HPos::Left, VPos::Center));
    for (k, curve) in shown(panel).iter().enumerate() {
        let y = 8 + 18 * k as i32;
        let name = shortened(&curve.name, NAME_LETTERS);
        if hidden(panel, curve) {
            area.draw(&Text::new(format!("{name}: 0"), (34, y), left.clone()))?;
            continue;
        }
        area.draw(&PathElement::new(vec![(6, y), (26, y)], line_style(k)))?;
        area.draw(&Text::new(name, (34, y), left.clone()))?;
    }
    let more = panel.curves.len() - shown(panel).len();
    if more > 0 {
        let y = 8 + 18 * MOST_CURVES as i32;
        area.draw(&Text::new(format!("and {more} more"), (34, y), left))?;
    }
    Ok(())
}

fn bars<D: DrawingBackend>(found: &Bars, area: &Area<D>) -> Drawn
where
    D::ErrorType: 'static,
{
    area.draw(&Text::new(found.title.clone(), (70, 4), style(MIDDLE)))?;
    let count = found.bars.len() as i32;
    let largest = found.bars.iter().flat_map(|bar| [bar.middle, bar.p99, bar.max]).fold(0.0, f64::max);
    let within = found.budget <= 1.3 * largest;
    let times = range([largest, if within { found.budget } else { 0.0 }].into_iter());
    let (names, axes) = area.margin(26, 0, 0, 16).split_horizontally(NAMES);
    let digits = digits(times.end - times.start);
    let mut chart = ChartBuilder::on(&axes).x_label_area_size(40).build_cartesian_2d(times, 0..count)?;
    chart
        .configure_mesh()
        .disable_y_mesh()
        .disable_y_axis()
        .light_line_style(WHITE)
        .bold_line_style(INK.mix(0.13))
        .axis_style(INK.mix(0.6))
        .label_style(style(SMALL))
        .axis_desc_style(style(SMALL))
        .x_labels(8)
        .x_label_formatter(&|x| format!("{:.digits$}", x + 0.0))
        .x_desc(match within {
            true => format!("time, ms; orange: real time, {} ms a step", round(found.budget)),
            false => format!("time, ms; real time: {} ms a step", round(found.budget)),
        })
        .draw()?;
    let right = style(SMALL).pos(Pos::new(HPos::Right, VPos::Center));
    for (k, bar) in found.bars.iter().enumerate() {
        let middle = (BAR as f64 * (k as f64 + 0.5)) as i32;
        names.draw(&Text::new(bar.name, (NAMES as i32 - 8, middle), right.clone()))?;
        let color = COLORS[if k == 0 { 0 } else { 4 }];
        let pixel = |x: f64| chart.backend_coord(&(x, count)).0;
        let (_, top) = chart.backend_coord(&(0.0, count));
        let (y, half) = (top + middle, BAR as i32 / 2 - 4);
        // in the area's own coordinates
        let (left, upper) = axes.get_base_pixel();
        let at = |x: f64, y: i32| (pixel(x) - left, y - upper);
        axes.draw(&Rectangle::new([at(0.0, y - half), at(bar.middle, y + half)], color.filled()))?;
        axes.draw(&PathElement::new(vec![at(bar.middle, y), at(bar.p99.max(bar.middle), y)], INK.stroke_width(2)))?;
        axes.draw(&PathElement::new(vec![at(bar.max, y - half), at(bar.max, y + half)], INK.stroke_width(1)))?;
    }
    if within {
        let line = vec![(found.budget, 0), (found.budget, count)];
        chart.draw_series(LineSeries::new(line, COLORS[1].stroke_width(2)))?;
    }
    Ok(())
}

/// A number of ms without the noise of its last digits.
fn round(value: f64) -> f64 {
    (value * 1e6).round() / 1e6
}

/// Most buckets of a curve; a picture is some hundred pixels wide.
const BUCKETS: usize = 4096;

/// Larger values are not drawn: sums and products of an axis would not be finite.
const LARGEST: f64 = 1e100;

/// Value over time. Of more rows than buckets, neighbouring rows share a bucket, which keeps their least and largest value.
#[derive(Clone, Debug)]
pub(super) struct Curve {
    pub name: String,
    /// Rows per bucket, and rows in the last one.
    each: usize,
    inside: usize,
    /// Time of the first row, least and largest value.
    buckets: Vec<[f64; 3]>,
}

impl Curve {
    pub fn new(name: impl Into<String>) -> Self {
        Self { name: name.into(), each: 1, inside: 1, buckets: vec![] }
    }

    /// Adds a row; values that are not finite, or beyond what axes are made for, are gaps and left out.
    pub fn add(&mut self, time: f64, value: f64) {
        if !(time.abs() < LARGEST && value.abs() < LARGEST) {
            return;
        }
        if let Some(last) = self.buckets.last_mut().filter(|_| self.inside < self.each) {
            *last = [last[0], last[1].min(value), last[2].max(value)];
            self.inside += 1;
            return;
        }
        if self.buckets.len() == BUCKETS {
            let pair = |p: &[[f64; 3]]| [p[0][0], p[0][1].min(p[1][1]), p[0][2].max(p[1][2])];
            self.buckets = self.buckets.chunks_exact(2).map(pair).collect();
            self.each *= 2;
        }
        self.inside = 1;
        self.buckets.push([time, value, value]);
    }

    /// Points to join, the two of a bucket one above the other.
    pub fn points(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        self.buckets.iter().flat_map(|[time, low, high]| {
            let more = (high > low).then_some((*time, *high));
            [(*time, *low)].into_iter().chain(more)
        })
    }

    pub fn is_empty(&self) -> bool {
        self.buckets.is_empty()
    }
}

/// Axes with curves over time.
#[derive(Clone, Debug)]
pub(super) struct Panel {
    pub title: String,
    /// Quantity of the values, and their unit in the table; empty for plain numbers.
    pub quantity: String,
    pub unit: String,
    /// Logarithmic values; those of 0 are left out.
    pub logarithmic: bool,
    pub curves: Vec<Curve>,
}

impl Panel {
    pub fn new(title: &str, quantity: &str, unit: &str, curves: Vec<Curve>) -> Self {
        let (title, quantity, unit) = (title.into(), quantity.into(), unit.into());
        Self { title, quantity, unit, logarithmic: false, curves }
    }
}

/// A time of a step's part.
#[derive(Clone, Debug)]
pub(super) struct Bar {
    pub name: &'static str,
    /// Value of the bar, what 99 of 100 are below, and the maximum, ms.
    pub middle: f64,
    pub p99: f64,
    pub max: f64,
}

/// Bars over a common axis, in ms.
#[derive(Clone, Debug)]
pub(super) struct Bars {
    pub title: String,
    pub bars: Vec<Bar>,
    /// Time that a step may take to keep up with the wall clock, ms.
    pub budget: f64,
}

/// A picture: panels below each other.
#[derive(Clone, Debug)]
pub(super) struct Figure {
    /// Name of its files.
    pub name: &'static str,
    pub title: String,
    pub bars: Option<Bars>,
    pub panels: Vec<Panel>,
}

impl Figure {
    /// A figure of the panels that have something to show; none without any.
    pub fn of(name: &'static str, title: String, bars: Option<Bars>, panels: Vec<Panel>) -> Option<Self> {
        let shown = |panel: &Panel| Panel {
            curves: panel.curves.iter().filter(|curve| !curve.is_empty()).cloned().collect(),
            ..panel.clone()
        };
        let panels: Vec<Panel> = panels.iter().map(shown).filter(|panel| !panel.curves.is_empty()).collect();
        (bars.is_some() || !panels.is_empty()).then_some(Self { name, title, bars, panels })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_get_the_prefix_that_fits() {
        assert_eq!(scaled("N", 0.02), (1e3, "mN".into()));
        assert_eq!(scaled("J", 3e-6), (1e6, "µJ".into()));
        assert_eq!(scaled("Pa", 25_000.0), (1e-3, "kPa".into()));
        assert_eq!(scaled("m", 2000.0), (1.0, "m".into()));
        assert_eq!(scaled("m/s", 0.001), (1.0, "m/s".into()));
        assert_eq!(scaled("mm", 0.001), (1.0, "mm".into()));
        assert_eq!(scaled("", 0.001), (1.0, String::new()));
    }

    #[test]
    fn decades_are_labelled_without_rounding() {
        let axis = Decades(1e-6..1e-1);
        assert_eq!(axis.range(), 1e-6..1e-1);
        let texts: Vec<String> = (0..6).map(|k| decade(&(1e-6 * 10f64.powi(k)))).collect();
        assert_eq!(texts, ["1e-6", "1e-5", "1e-4", "1e-3", "1e-2", "1e-1"]);
        assert_eq!((axis.map(&1e-6, (0, 100)), axis.map(&1e-1, (0, 100)), axis.map(&1e-3, (0, 100))), (0, 100, 60));
    }

    #[test]
    fn ranges_of_nothing_can_be_drawn() {
        assert_eq!(range(std::iter::empty()), 0.0..1.0);
        assert_eq!(decades(std::iter::empty()), 0.1..1.0);
        assert_eq!(decades([2e-4, 3e-4].into_iter()), 1e-4..1e-3);
        let both = range([-1.0, 1.0].into_iter());
        assert!(both.start < -1.0 && both.end > 1.0);
    }

    #[test]
    fn a_long_curve_keeps_its_peaks_in_bounded_memory() {
        let mut curve = Curve::new("a");
        let rows = 1_000_000;
        for k in 0..rows {
            let peak = if k == 777_777 { 5.0 } else { 0.0 };
            curve.add(f64::from(k), peak - f64::from(u8::from(k == 123)));
        }
        curve.add(f64::NAN, 9.0);
        curve.add(0.0, f64::INFINITY);
        assert!(curve.buckets.len() <= BUCKETS && curve.buckets.len() > BUCKETS / 4, "{}", curve.buckets.len());
        let (low, high) = curve.points().fold((0.0f64, 0.0f64), |(low, high), (_, y)| (low.min(y), high.max(y)));
        assert_eq!((low, high), (-1.0, 5.0));
        let at = curve.points().find(|p| p.1 == 5.0).expect("kept").0;
        assert!((at - 777_777.0).abs() <= curve.each as f64, "{at}");
        assert!(curve.points().zip(curve.points().skip(1)).all(|(a, b)| a.0 <= b.0));
    }
}
