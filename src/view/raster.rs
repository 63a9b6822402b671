//! Scan conversion: the nearest triangle at each sample.
//!
//! Corners are snapped to 1/256 of a sample, so that edge functions are exact and triangles with a common edge leave no gap.

use super::View;
use crate::error::Result;
use glam::{Vec2, Vec3};

/// Samples along each side of a pixel.
pub(super) const SAMPLES: usize = 2;

/// Id where no triangle was drawn.
pub(super) const NO_TRIANGLE: u32 = u32::MAX;

/// Snapping steps per sample.
const SNAP: f64 = 256.0;

/// A line is drawn if it is at most this fraction of its depth behind the surface. Lines lie in the surface: less breaks them up on slanted
/// faces, more lets them show through thin layers.
const LINE_DEPTH_SHARE: f64 = 2e-3;

/// Nearest triangle and line at each sample.
pub(super) struct Samples {
    pub(super) width: usize,
    pub(super) height: usize,
    /// `[height][width]` 1/m, 1/z in view space; 0 where there is nothing.
    pub(super) inverse_depth: Vec<f32>,
    /// `[height][width]` triangle ids.
    pub(super) triangle: Vec<u32>,
    /// `[height][width]` pen of the line; 0 for none.
    pub(super) line: Vec<u8>,
    /// `[pen]` fraction of the linear colour that remains under a line.
    pub(super) inks: Vec<Vec3>,
}

/// Not enough memory for a picture.
#[derive(Clone, Copy, Debug, thiserror::Error)]
#[error(
    "no memory is left for a picture: {bytes} bytes were refused; set a smaller view.size_px, or frames = 0 for none, or close what takes \
     memory"
)]
pub struct NoMemory {
    /// Size of the failed allocation, bytes.
    pub bytes: u64,
}

/// Allocates an array over a picture, or returns an error: pictures are most of what a running scene allocates.
pub(super) fn room<T: Clone>(count: usize, value: T) -> Result<Vec<T>> {
    let mut values = vec![];
    let bytes = (count * size_of::<T>()) as u64;
    values.try_reserve_exact(count).map_err(|_| NoMemory { bytes })?;
    values.resize(count, value);
    Ok(values)
}

impl Samples {
    /// Empty samples for a picture of `columns` × `rows` pixels.
    pub(super) fn new(columns: usize, rows: usize) -> Result<Self> {
        let (width, height) = (columns * SAMPLES, rows * SAMPLES);
        Ok(Self {
            width,
            height,
            inverse_depth: room(width * height, 0.0)?,
            triangle: room(width * height, NO_TRIANGLE)?,
            line: room(width * height, 0)?,
            inks: vec![Vec3::ONE],
        })
    }

    /// Draws a triangle in view space where it is beyond the near plane and nearest.
    pub(super) fn draw_triangle(&mut self, view: &View, near: f32, corners: &[Vec3; 3], id: u32) {
        let (polygon, count) = clip(corners, near);
        let project = |p: Vec3| project(view, p);
        for k in 2..count {
            let corners = [project(polygon[0]), project(polygon[k - 1]), project(polygon[k])];
            fill(self.width, self.height, corners, |sample, inverse_depth| {
                if inverse_depth > self.inverse_depth[sample] {
                    self.inverse_depth[sample] = inverse_depth;
                    self.triangle[sample] = id;
                }
            });
        }
    }

    /// Pen of a colour; colours beyond the 255th share its pen.
    pub(super) fn pen(&mut self, ink: [f32; 3]) -> u8 {
        let ink = Vec3::from(ink);
        let known = self.inks.iter().position(|other| *other == ink);
        known
            .unwrap_or_else(|| {
                self.inks.push(ink);
                self.inks.len() - 1
            })
            .min(255) as u8
    }

    /// Marks the samples of a line in view space that are not behind a surface; `pen` is its colour, `line_width` its width in samples.
    pub(super) fn draw_line(&mut self, view: &View, near: f32, [a, b]: [Vec3; 2], (pen, line_width): (u8, isize)) {
        let (a, b) = if a.z < b.z { (a, b) } else { (b, a) };
        if b.z <= near {
            return;
        }
        let a = if a.z < near { a.lerp(b, (near - a.z) / (b.z - a.z)) } else { a };
        let (a, b) = (project(view, a), project(view, b));
        let steep = usize::from((b[1] - a[1]).abs() > (b[0] - a[0]).abs());
        let (a, b) = if a[steep] < b[steep] { (a, b) } else { (b, a) };
        let length = b[steep] - a[steep];
        if !(length > 0.0 && length.is_finite()) {
            return;
        }
        let size = [self.width as isize, self.height as isize];
        let start = a[steep].floor().max(0.0) as isize;
        let end = b[steep].ceil().min(size[steep] as f64) as isize;
        for major in start..end {
            let t = ((major as f64 + 0.5 - a[steep]) / length).clamp(0.0, 1.0);
            let at = |axis: usize| a[axis] + t * (b[axis] - a[axis]);
            let from = (at(1 - steep) - 0.5 * (line_width - 1) as f64).floor() as isize;
            let front = at(2) * (1.0 + LINE_DEPTH_SHARE);
            for minor in from..from.saturating_add(line_width) {
                let (x, y) = if steep == 1 { (minor, major) } else { (major, minor) };
                if (0..size[0]).contains(&x) && (0..size[1]).contains(&y) {
                    let sample = y as usize * self.width + x as usize;
                    if front >= f64::from(self.inverse_depth[sample]) {
                        self.line[sample] = pen;
                    }
                }
            }
        }
    }
}

/// Part of a triangle beyond the near plane: a polygon of 0, 3 or 4 corners.
fn clip(corners: &[Vec3; 3], near: f32) -> ([Vec3; 4], usize) {
    let mut polygon = [Vec3::ZERO; 4];
    let mut count = 0;
    let mut push = |p| {
        polygon[count] = p;
        count += 1;
    };
    for k in 0..3 {
        let (a, b) = (corners[k], corners[(k + 1) % 3]);
        if a.z > near {
            push(a);
        }
        if (a.z > near) != (b.z > near) {
            // starting at the farther corner, so that both triangles of an edge get the same point
            let (far, close) = if a.z > b.z { (a, b) } else { (b, a) };
            push(far.lerp(close, (far.z - near) / (far.z - close.z)));
        }
    }
    (polygon, count)
}

/// x and y in samples, and 1/z in 1/m.
fn project(view: &View, p: Vec3) -> [f64; 3] {
    let p = p.as_dvec3();
    let scale = view.focal / p.z;
    [view.center[0] + scale * p.x, view.center[1] - scale * p.y, 1.0 / p.z]
}

/// Calls `visit(sample, value)` for each sample in the triangle; corners are x, y in samples and a value that is interpolated linearly.
/// Triangles without area or with huge corners give none.
pub(super) fn fill(width: usize, height: usize, corners: [[f64; 3]; 3], mut visit: impl FnMut(usize, f32)) {
    let snap = |c: [f64; 3]| [(c[0] * SNAP).round() / SNAP, (c[1] * SNAP).round() / SNAP, c[2]];
    let [a, mut b, mut c] = corners.map(snap);
    let mut area = cross(a, b, c[0], c[1]);
    if area < 0.0 {
        std::mem::swap(&mut b, &mut c);
        area = -area;
    }
    if !(area > 0.0 && area.is_finite()) {
        return;
    }
    let range = |axis: usize, size: usize| {
        let low = a[axis].min(b[axis]).min(c[axis]) - 0.5;
        let high = a[axis].max(b[axis]).max(c[axis]) - 0.5;
        let end = (high.floor() + 1.0).clamp(0.0, size as f64) as usize;
        (low.ceil().max(0.0) as usize).min(end)..end
    };
    let columns = range(0, width);
    // one sample to the right changes each edge function by a constant
    let step = [b[1] - c[1], c[1] - a[1], a[1] - b[1]];
    for row in range(1, height) {
        let y = row as f64 + 0.5;
        let x = columns.start as f64 + 0.5;
        let mut w = [cross(b, c, x, y), cross(c, a, x, y), cross(a, b, x, y)];
        let mut inside_before = false;
        for column in columns.clone() {
            let inside = w[0] >= 0.0 && w[1] >= 0.0 && w[2] >= 0.0;
            if inside {
                let value = (w[0] * a[2] + w[1] * b[2] + w[2] * c[2]) / area;
                visit(row * width + column, value as f32);
            } else if inside_before {
                break;
            }
            inside_before = inside;
            w = [w[0] + step[0], w[1] + step[1], w[2] + step[2]];
        }
    }
}

/// Twice the signed area of `a`, `b` and (x, y).
fn cross(a: [f64; 3], b: [f64; 3], x: f64, y: f64) -> f64 {
    (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])
}

/// Shadow map: the surface nearest to a distant light in each cell of a grid.
pub(super) struct ShadowMap {
    axes: [Vec3; 3],
    low: Vec2,
    cells_per_metre: f32,
    /// `[CELLS][CELLS]` m along the third axis, which points to the light
    nearest: Vec<f32>,
}

impl ShadowMap {
    /// Cells along each side. The whole scene is about 60 mm, so a cell is about 0.05 mm, well below a wound's width.
    const CELLS: usize = 1280;

    /// `to_light` is a unit vector; `triangles` are in view space, m.
    pub(super) fn new<'a>(to_light: Vec3, triangles: impl Iterator<Item = &'a [Vec3; 3]> + Clone) -> Result<Self> {
        let (u, v) = to_light.any_orthonormal_pair();
        let axes = [u, v, to_light];
        let to_map = |p: Vec3| Vec3::from(axes.map(|axis| axis.dot(p)));
        let (mut low, mut high) = (Vec2::MAX, Vec2::MIN);
        for corner in triangles.clone().flatten() {
            let p = to_map(*corner).truncate();
            (low, high) = (low.min(p), high.max(p));
        }
        let side = (high - low).max_element().max(f32::MIN_POSITIVE);
        let cells_per_metre = Self::CELLS as f32 / side;
        let mut nearest = room(Self::CELLS * Self::CELLS, f32::MIN)?;
        for corners in triangles {
            let cells = corners.map(|corner| {
                let p = to_map(corner);
                let cell = (p.truncate() - low) * cells_per_metre;
                [f64::from(cell.x), f64::from(cell.y), f64::from(p.z)]
            });
            fill(Self::CELLS, Self::CELLS, cells, |cell, height| {
                nearest[cell] = nearest[cell].max(height);
            });
        }
        Ok(Self { axes, low, cells_per_metre, nearest })
    }

    /// Fraction of the light that reaches `position`, a point of a surface with `normal`, 0 to 1; a shadow's edge is three cells wide.
    pub(super) fn lit(&self, position: Vec3, normal: Vec3) -> f32 {
        // offset from the surface, which would shade itself: heights are known per cell only
        let position = position + normal * (2.0 / self.cells_per_metre);
        let [u, v, height] = self.axes.map(|axis| axis.dot(position));
        let at = (Vec2::new(u, v) - self.low) * self.cells_per_metre - 0.5;
        let inside = at.min_element() >= 1.0 && at.max_element() < (Self::CELLS - 3) as f32;
        if !inside {
            return 1.0;
        }
        let (column, row) = (at.x as usize, at.y as usize);
        let part = at - Vec2::new(column as f32, row as f32);
        let weights = |t: f32| [1.0 - t, 1.0, 1.0, t];
        let corner = (row - 1) * Self::CELLS + column - 1;
        let mut sum = 0.0;
        for (row, y_weight) in weights(part.y).into_iter().enumerate() {
            let heights = &self.nearest[corner + row * Self::CELLS..][..4];
            for (x_weight, &nearest) in weights(part.x).into_iter().zip(heights) {
                if nearest <= height {
                    sum += x_weight * y_weight;
                }
            }
        }
        sum / 9.0
    }
}
