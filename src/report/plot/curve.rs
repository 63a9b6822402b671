//! Curves over time in bounded memory, and the panels and figures that they make.

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
