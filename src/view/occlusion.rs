//! Ambient occlusion: the fraction of the surroundings visible from each pixel, from the depth buffer only.
//!
//! `1 − s Σ max(0, n·v/|v| − b) max(0, 1 − |v|²/R²) / K` at position p with normal n, where `v` points from p to the surface at K sample
//! positions around the pixel.
//! Source: McGuire et al. 2011 (Alchemy). Differs: the cosine and a smooth range R instead of `1/|v|`, so that no constant depends on the
//! scene's size.

use super::raster::room;
use super::{SAMPLES, View, for_rows};
use crate::error::Result;
use glam::{Vec2, Vec3};

/// Sample positions around a pixel; fewer leave blotches, more cost time.
const OFFSETS: usize = 10;

/// The sample pattern is rotated differently in each pixel of a block of 4 × 4, and the blur over 4 × 4 pixels averages all rotations.
const TURNS: usize = 4;

/// Range of the ambient occlusion as a fraction of half the picture's height at the target. In a picture 20 mm high this is 1.5 mm, a
/// little more than the depth of the wounds shown.
const REACH: f32 = 0.15;

/// Cosine below which surroundings are ignored; hides the facets of coarse meshes.
const OCCLUSION_BIAS: f32 = 0.12;

/// Strength of the ambient occlusion.
const OCCLUSION_STRENGTH: f32 = 2.6;

/// Minimum fraction of the light left by ambient occlusion; less makes wounds black.
const LEAST_OPEN: f32 = 0.12;

/// Nearest surface at each pixel.
pub(super) struct Pixels {
    pub(super) width: usize,
    pub(super) height: usize,
    /// `[height][width]`.
    pub(super) seen: Vec<Seen>,
}

/// Depth, m (infinite where there is no surface), and the unit normal towards the eye.
#[derive(Clone, Copy)]
pub(super) struct Seen {
    pub(super) depth: f32,
    pub(super) normal: Vec3,
}

pub(super) const NOTHING: Seen = Seen { depth: f32::INFINITY, normal: Vec3::ZERO };

impl Pixels {
    /// `[height][width]` open fraction of the surroundings, 0 to 1.
    pub(super) fn openness(&self, view: &View) -> Result<Vec<f32>> {
        blur(self, &occlude(self, view)?)
    }
}

/// Open fraction of the surroundings at each pixel, 0 to 1; noisy over 4 × 4 pixels.
fn occlude(pixels: &Pixels, view: &View) -> Result<Vec<f32>> {
    let reach = REACH * (view.distance * view.half_tangent) as f32;
    let focal = view.focal as f32 / SAMPLES as f32;
    let (width, height) = (pixels.width, pixels.height);
    let middle = Vec2::new(0.5 * width as f32, 0.5 * height as f32);
    let ray = |x: usize, y: usize| {
        let at = (Vec2::new(x as f32 + 0.5, y as f32 + 0.5) - middle) / focal;
        Vec3::new(at.x, -at.y, 1.0)
    };
    let pattern = pattern();
    // occlusion by the surface at one sample position
    let hidden = |x: usize, y: usize, offset: Vec2, here: Seen| {
        let column = x as i32 + offset.x as i32;
        let row = y as i32 + offset.y as i32;
        if column < 0 || row < 0 || column >= width as i32 || row >= height as i32 {
            return 0.0;
        }
        let (column, row) = (column as usize, row as usize);
        let depth = pixels.seen[row * width + column].depth;
        if (depth - here.depth).abs() >= reach {
            return 0.0;
        }
        let v = ray(column, row) * depth - ray(x, y) * here.depth;
        let squared = v.length_squared().max(f32::MIN_POSITIVE);
        let cosine = v.dot(here.normal) / squared.sqrt() - OCCLUSION_BIAS;
        cosine.max(0.0) * (1.0 - squared / (reach * reach)).max(0.0)
    };
    let mut open = room(width * height, 1.0)?;
    // sum over the positions of the pattern
    for_rows(&mut open, width, |y, row| {
        for (x, open) in row.iter_mut().enumerate() {
            let here = pixels.seen[y * width + x];
            if here.depth.is_finite() {
                let radius = (focal * reach / here.depth).min(0.25 * height as f32);
                let offsets = &pattern[(y % TURNS) * TURNS + x % TURNS];
                let sum: f32 = offsets.iter().map(|&p| hidden(x, y, p * radius, here)).sum();
                *open = (1.0 - OCCLUSION_STRENGTH * sum / OFFSETS as f32).max(LEAST_OPEN);
            }
        }
    });
    Ok(open)
}

/// `[rotation][position]` sample positions in the unit disc: a spiral of golden angles, rotated for each pixel of a 4 × 4 block.
fn pattern() -> [[Vec2; OFFSETS]; TURNS * TURNS] {
    // cosine and sine of the golden angle 137.50776° and of 1/16 of a full turn
    let golden = Vec2::new(-0.737_368_9, 0.675_490_3);
    let sixteenth = Vec2::new(0.923_879_5, 0.382_683_43);
    // rotations of neighbours differ much
    const ORDER: [usize; TURNS * TURNS] = [0, 8, 2, 10, 12, 4, 14, 6, 3, 11, 1, 9, 15, 7, 13, 5];
    let mut pattern = [[Vec2::ZERO; OFFSETS]; TURNS * TURNS];
    for (rotation, offsets) in pattern.iter_mut().enumerate() {
        let mut direction = Vec2::X;
        for _ in 0..ORDER[rotation] {
            direction = direction.rotate(sixteenth);
        }
        for (k, offset) in offsets.iter_mut().enumerate() {
            *offset = direction * ((k as f32 + 0.5) / OFFSETS as f32).sqrt();
            direction = direction.rotate(golden);
        }
    }
    pattern
}

/// Mean over 4 × 4 pixels of the same surface: similar normals and similar depths.
fn blur(pixels: &Pixels, open: &[f32]) -> Result<Vec<f32>> {
    let (width, height) = (pixels.width, pixels.height);
    let around = |at: usize, size: usize| at.saturating_sub(TURNS / 2)..(at + TURNS - TURNS / 2).min(size);
    let mut smooth = room(open.len(), 0.0)?;
    smooth.copy_from_slice(open);
    for_rows(&mut smooth, width, |y, row| {
        for (x, smooth) in row.iter_mut().enumerate() {
            let here = pixels.seen[y * width + x];
            if here.depth.is_infinite() {
                continue;
            }
            let (mut sum, mut count) = (0.0, 0.0);
            for index in around(y, height).flat_map(|row| around(x, width).map(move |c| row * width + c)) {
                let there = pixels.seen[index];
                let near = (there.depth - here.depth).abs() < 0.01 * here.depth;
                if near && there.normal.dot(here.normal) > 0.8 {
                    sum += open[index];
                    count += 1.0;
                }
            }
            if count > 0.0 {
                *smooth = sum / count;
            }
        }
    });
    Ok(smooth)
}
