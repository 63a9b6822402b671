//! Scan conversion: the nearest triangle and line at each sample of a band of rows.
//!
//! Corners are snapped to 1/256 of a sample, so that edge functions (Pineda 1988) are exact and triangles with a common edge leave no gap.

use super::View;
use crate::error::Result;
use glam::{Vec2, Vec3};

/// Samples along each side of a pixel: 16 shades from none to all of an edge.
pub(super) const SAMPLES: usize = 4;

/// Id where no triangle was drawn.
pub(super) const NO_TRIANGLE: u32 = u32::MAX;

/// Snapping steps per sample.
const SNAP: f64 = 256.0;

/// A line is drawn if it is at most this fraction of its depth behind the surface. Lines lie in the surface: less breaks them up on slanted
/// faces, more lets them show through thin layers.
pub(super) const LINE_DEPTH_SHARE: f64 = 2e-3;

/// Nearest triangle and line at each sample of a band.
pub(super) struct Samples {
    pub(super) width: usize,
    pub(super) height: usize,
    /// Row of the picture's samples where the band begins.
    pub(super) top: usize,
    /// `[height][width]` 1/m, 1/z in view space; 0 where there is nothing.
    pub(super) inverse_depth: Vec<f32>,
    /// `[height][width]` triangle ids.
    pub(super) triangle: Vec<u32>,
    /// `[height][width]` pen of the line; 0 for none.
    pub(super) line: Vec<u8>,
}

/// A line in view space.
pub(super) struct Line {
    pub(super) ends: [Vec3; 2],
    /// Number of its colour.
    pub(super) pen: u8,
    /// Samples.
    pub(super) width: f64,
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
    /// Empty samples for `rows` rows of a picture of `columns` pixels, from row `top` on.
    pub(super) fn new(columns: usize, rows: usize, top: usize) -> Result<Self> {
        let (width, height) = (columns * SAMPLES, rows * SAMPLES);
        Ok(Self {
            width,
            height,
            top: top * SAMPLES,
            inverse_depth: room(width * height, 0.0)?,
            triangle: room(width * height, NO_TRIANGLE)?,
            line: room(width * height, 0)?,
        })
    }

    /// x and y in samples of the band, and 1/z in 1/m.
    fn project(&self, view: &View, p: Vec3) -> [f64; 3] {
        let [x, y, inverse] = project(view, p);
        [x, y - self.top as f64, inverse]
    }

    /// Draws a triangle in view space where it is beyond the near plane and nearest.
    pub(super) fn draw_triangle(&mut self, view: &View, near: f32, corners: &[Vec3; 3], id: u32) {
        let (polygon, count) = clip(corners, near);
        for k in 2..count {
            let corners = [polygon[0], polygon[k - 1], polygon[k]].map(|p| self.project(view, p));
            fill(self.width, self.height, corners, |sample, inverse_depth| {
                if inverse_depth > self.inverse_depth[sample] {
                    self.inverse_depth[sample] = inverse_depth;
                    self.triangle[sample] = id;
                }
            });
        }
    }

    /// Marks the samples of a line that are not behind a surface.
    pub(super) fn draw_line(&mut self, view: &View, near: f32, line: &Line) {
        let [a, b] = line.ends;
        let (a, b) = if a.z < b.z { (a, b) } else { (b, a) };
        if b.z <= near {
            return;
        }
        let a = if a.z < near { a.lerp(b, (near - a.z) / (b.z - a.z)) } else { a };
        let (a, b) = (self.project(view, a), self.project(view, b));
        let [dx, dy] = [b[0] - a[0], b[1] - a[1]];
        let squared = dx * dx + dy * dy;
        if !(squared > 0.0 && squared.is_finite()) {
            return;
        }
        let half = 0.5 * line.width;
        let index = |value: f64, size: usize| value.clamp(0.0, size as f64) as usize;
        // centres of samples nearer than half the width
        let rows = (a[1].min(b[1]) - half - 0.5).ceil()..(a[1].max(b[1]) + half - 0.5).floor() + 1.0;
        for row in index(rows.start, self.height)..index(rows.end, self.height) {
            let y = row as f64 + 0.5;
            let Some([low, high]) = across([a[0], a[1]], [b[0], b[1]], half, y) else { continue };
            let columns = index((low - 0.5).ceil(), self.width)..index((high - 0.5).floor() + 1.0, self.width);
            for column in columns {
                let x = column as f64 + 0.5;
                let t = (((x - a[0]) * dx + (y - a[1]) * dy) / squared).clamp(0.0, 1.0);
                let front = (a[2] + t * (b[2] - a[2])) * (1.0 + LINE_DEPTH_SHARE);
                let sample = row * self.width + column;
                if front >= f64::from(self.inverse_depth[sample]) {
                    self.line[sample] = line.pen;
                }
            }
        }
    }
}

/// Part of a row at height `y` that is at most `half` from the line between two points: the line with its round ends is convex.
fn across(a: [f64; 2], b: [f64; 2], half: f64, y: f64) -> Option<[f64; 2]> {
    let [dx, dy] = [b[0] - a[0], b[1] - a[1]];
    let scale = half / dx.hypot(dy);
    let [nx, ny] = [-dy * scale, dx * scale];
    let sides = [[a[0] + nx, a[1] + ny], [b[0] + nx, b[1] + ny], [b[0] - nx, b[1] - ny], [a[0] - nx, a[1] - ny]];
    let mut found = [f64::INFINITY, f64::NEG_INFINITY];
    let mut meet = |x: f64| found = [found[0].min(x), found[1].max(x)];
    for end in [a, b] {
        let squared = half * half - (y - end[1]) * (y - end[1]);
        if squared >= 0.0 {
            meet(end[0] - squared.sqrt());
            meet(end[0] + squared.sqrt());
        }
    }
    for (k, p) in sides.iter().enumerate() {
        let q = sides[(k + 1) % 4];
        if (p[1] <= y) != (q[1] <= y) {
            meet(p[0] + (y - p[1]) / (q[1] - p[1]) * (q[0] - p[0]));
        }
    }
    (found[0] <= found[1]).then_some(found)
}

/// Rows of samples that points in view space reach, with one to spare; all where one is before the near plane.
pub(super) fn rows(view: &View, near: f32, points: &[Vec3], half_width: f64) -> [f64; 2] {
    if points.iter().any(|p| p.z <= near) {
        return [f64::NEG_INFINITY, f64::INFINITY];
    }
    let heights = points.iter().map(|p| project(view, *p)[1]);
    let [low, high] = heights.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], y| [low.min(y), high.max(y)]);
    [low - half_width - 1.0, high + half_width + 1.0]
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
    pub(super) const CELLS: usize = 1280;

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
