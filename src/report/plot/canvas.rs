//! Pixels for plots: lines, polygons and text on a fine grid, averaged to a picture.

use crate::view::{Image, strokes};
use plotters_backend::text_anchor::{HPos, VPos};
use plotters_backend::{
    BackendColor, BackendCoord, BackendStyle, BackendTextStyle, DrawingBackend, DrawingErrorKind, FontTransform,
};
use std::convert::Infallible;

/// Pixels of the picture along each side of a unit of the plot, and grid points along each side of a pixel.
const PIXELS: usize = 2;
const FINE: usize = 3;
const GRID: usize = PIXELS * FINE;
/// Font size, units, at which a dot of the font is one unit wide: a capital is then as high as that of a browser.
const DOT_SIZE: f64 = 12.0;
/// Columns between two letters, and the height of a capital, dots.
const ADVANCE: f64 = 6.0;
const CAPITAL: f64 = 7.0;
/// Width of the strokes of letters, dots.
const STROKE: f64 = 0.95;

type Drawn = Result<(), DrawingErrorKind<Infallible>>;
type Point = [f64; 2];

/// A white picture that plotters draws on; sizes and positions are in units of the plot, two pixels wide.
pub(super) struct Canvas {
    size: [usize; 2],
    /// `[row][column]` of the fine grid, sRGB.
    fine: Vec<[u8; 3]>,
}

impl Canvas {
    pub fn new(width: u32, height: u32) -> Self {
        let size = [width as usize, height as usize];
        Self { size, fine: vec![[255; 3]; size[0] * size[1] * GRID * GRID] }
    }

    /// The picture, twice as many pixels along each side as the plot has units.
    pub fn image(&self) -> Image {
        let [width, height] = self.size.map(|n| n * PIXELS);
        let mut rgb = Vec::with_capacity(3 * width * height);
        for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
            let rows = (0..FINE).map(|k| ((y * FINE + k) * width + x) * FINE);
            let mut sum = [0u32; 3];
            for point in rows.flat_map(|start| &self.fine[start..start + FINE]) {
                (0..3).for_each(|k| sum[k] += u32::from(point[k]));
            }
            rgb.extend(sum.map(|sum| ((sum + (FINE * FINE) as u32 / 2) / (FINE * FINE) as u32) as u8));
        }
        Image { width: width as u32, height: height as u32, rgb, skipped: 0 }
    }

    /// Paints grid points of a row from `low` to `high`, both in units.
    fn span(&mut self, row: usize, low: f64, high: f64, color: BackendColor) {
        let width = self.size[0] * GRID;
        let point = |unit: f64| (unit * GRID as f64 - 0.5).clamp(-1.0, width as f64);
        let (start, end) = (point(low).ceil().max(0.0) as usize, point(high).floor());
        let paint =
            |from: u8, to: u8| (f64::from(from) + color.alpha * (f64::from(to) - f64::from(from))).round() as u8;
        let (r, g, b) = color.rgb;
        for column in start..((end + 1.0).max(0.0) as usize).min(width) {
            let point = &mut self.fine[row * width + column];
            *point = [paint(point[0], r), paint(point[1], g), paint(point[2], b)];
        }
    }

    /// Rows of the grid between two heights.
    fn rows(&self, low: f64, high: f64) -> std::ops::Range<usize> {
        let most = (self.size[1] * GRID) as f64;
        let row = |unit: f64| (unit * GRID as f64 - 0.5).ceil().clamp(0.0, most) as usize;
        row(low)..row(high)
    }

    /// Fills a polygon by the even-odd rule.
    fn polygon(&mut self, corners: &[Point], color: BackendColor) {
        let heights = corners.iter().map(|p| p[1]);
        let (low, high) = heights.fold((f64::MAX, f64::MIN), |(low, high), y| (low.min(y), high.max(y)));
        for row in self.rows(low, high) {
            let y = (row as f64 + 0.5) / GRID as f64;
            let mut crossings: Vec<f64> = vec![];
            for (k, a) in corners.iter().enumerate() {
                let b = corners[(k + 1) % corners.len()];
                if (a[1] <= y) != (b[1] <= y) {
                    crossings.push(a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]));
                }
            }
            crossings.sort_by(f64::total_cmp);
            crossings.chunks_exact(2).for_each(|pair| self.span(row, pair[0], pair[1], color));
        }
    }

    /// Draws a line with round ends.
    fn line(&mut self, a: Point, b: Point, width: f64, color: BackendColor) {
        let r = 0.5 * width;
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let length = dx.hypot(dy).max(f64::MIN_POSITIVE);
        let across = [-dy / length * r, dx / length * r];
        let corner = |p: Point, sign: f64| [p[0] + sign * across[0], p[1] + sign * across[1]];
        let sides = [corner(a, 1.0), corner(b, 1.0), corner(b, -1.0), corner(a, -1.0)];
        for row in self.rows(a[1].min(b[1]) - r, a[1].max(b[1]) + r) {
            let y = (row as f64 + 0.5) / GRID as f64;
            // the line with its ends is convex: one span a row
            let (mut low, mut high) = (f64::MAX, f64::MIN);
            let mut meet = |x: f64| (low, high) = (low.min(x), high.max(x));
            for end in [a, b] {
                let half = (r * r - (y - end[1]) * (y - end[1])).max(-1.0);
                if half >= 0.0 {
                    meet(end[0] - half.sqrt());
                    meet(end[0] + half.sqrt());
                }
            }
            for (k, p) in sides.iter().enumerate() {
                let q = sides[(k + 1) % 4];
                if (p[1] <= y) != (q[1] <= y) {
                    meet(p[0] + (y - p[1]) / (q[1] - p[1]) * (q[0] - p[0]));
                }
            }
            if low <= high {
                self.span(row, low, high, color);
            }
        }
    }
}

/// Centre of a unit square.
fn centre((x, y): BackendCoord) -> Point {
    [f64::from(x) + 0.5, f64::from(y) + 0.5]
}

/// Width and height of a text, units.
fn extent(text: &str, size: f64) -> [f64; 2] {
    let dot = size / DOT_SIZE;
    [(text.chars().count() as f64 * ADVANCE - 1.0).max(0.0) * dot, CAPITAL * dot]
}

impl DrawingBackend for Canvas {
    type ErrorType = Infallible;

    fn get_size(&self) -> (u32, u32) {
        (self.size[0] as u32, self.size[1] as u32)
    }

    fn ensure_prepared(&mut self) -> Drawn {
        Ok(())
    }

    fn present(&mut self) -> Drawn {
        Ok(())
    }

    fn draw_pixel(&mut self, (x, y): BackendCoord, color: BackendColor) -> Drawn {
        let [x, y] = [f64::from(x), f64::from(y)];
        self.polygon(&[[x, y], [x + 1.0, y], [x + 1.0, y + 1.0], [x, y + 1.0]], color);
        Ok(())
    }

    fn draw_line<S: BackendStyle>(&mut self, from: BackendCoord, to: BackendCoord, style: &S) -> Drawn {
        self.line(centre(from), centre(to), f64::from(style.stroke_width()), style.color());
        Ok(())
    }

    fn draw_path<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(&mut self, path: I, style: &S) -> Drawn {
        let points: Vec<Point> = path.into_iter().map(centre).collect();
        for pair in points.windows(2) {
            self.line(pair[0], pair[1], f64::from(style.stroke_width()), style.color());
        }
        Ok(())
    }

    fn draw_rect<S: BackendStyle>(&mut self, low: BackendCoord, high: BackendCoord, style: &S, fill: bool) -> Drawn {
        let ([x, y], [u, v]) = (centre(low), centre(high));
        let corners = [[x, y], [u, y], [u, v], [x, v]];
        if fill {
            self.polygon(&corners, style.color());
        } else {
            let width = f64::from(style.stroke_width());
            (0..4).for_each(|k| self.line(corners[k], corners[(k + 1) % 4], width, style.color()));
        }
        Ok(())
    }

    fn draw_circle<S: BackendStyle>(&mut self, at: BackendCoord, radius: u32, style: &S, fill: bool) -> Drawn {
        let at = centre(at);
        let point = |k: u32| {
            let (sin, cos) = (f64::from(k) / 32.0 * std::f64::consts::TAU).sin_cos();
            [at[0] + f64::from(radius) * cos, at[1] + f64::from(radius) * sin]
        };
        if fill {
            self.polygon(&(0..32).map(point).collect::<Vec<_>>(), style.color());
        } else {
            (0..32).for_each(|k| self.line(point(k), point(k + 1), f64::from(style.stroke_width()), style.color()));
        }
        Ok(())
    }

    fn fill_polygon<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(&mut self, corners: I, style: &S) -> Drawn {
        self.polygon(&corners.into_iter().map(centre).collect::<Vec<_>>(), style.color());
        Ok(())
    }

    fn draw_text<T: BackendTextStyle>(&mut self, text: &str, style: &T, at: BackendCoord) -> Drawn {
        let (dot, [width, height]) = (style.size() / DOT_SIZE, extent(text, style.size()));
        let left = match style.anchor().h_pos {
            HPos::Left => 0.0,
            HPos::Center => -0.5 * width,
            HPos::Right => -width,
        };
        // distances of SVG: 0.76 and half of an em above and below
        let top = match style.anchor().v_pos {
            VPos::Top => 0.1 * height,
            VPos::Center => -0.5 * height,
            VPos::Bottom => -1.3 * height,
        };
        let at = [f64::from(at.0), f64::from(at.1)];
        let turned = |[x, y]: Point| match style.transform() {
            FontTransform::None => [at[0] + x, at[1] + y],
            FontTransform::Rotate90 => [at[0] - y, at[1] + x],
            FontTransform::Rotate180 => [at[0] - x, at[1] - y],
            FontTransform::Rotate270 => [at[0] + y, at[1] - x],
        };
        for (number, character) in text.chars().enumerate() {
            let first = left + number as f64 * ADVANCE * dot;
            for ends in strokes(character) {
                let [a, b] = ends.map(|[x, y]| turned([first + (x + 0.5) * dot, top + (y + 0.5) * dot]));
                self.line(a, b, STROKE * dot, style.color());
            }
        }
        Ok(())
    }

    fn estimate_text_size<T: BackendTextStyle>(
        &self,
        text: &str,
        style: &T,
    ) -> Result<(u32, u32), DrawingErrorKind<Infallible>> {
        Ok(extent(text, style.size()).map(|length| length.ceil() as u32).into())
    }
}
