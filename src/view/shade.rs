//! Light and colour: three lights, a plain surrounding, ambient occlusion, resolve to pixels.
//!
//! Colours are linear here; sRGB is approximated by gamma 2, which needs no power function. The mirror and the highlight (Schlick 1994)
//! distinguish metal from skin; neither is based on measurements.
//!
//! Ambient occlusion is the fraction of the surroundings visible from each pixel, from the depth buffer only:
//! `1 − s Σ max(0, n·v/|v| − b) max(0, 1 − |v|²/R²) / K` at position p with normal n, where `v` points from p to the surface at K sample
//! positions around the pixel.
//! Source: McGuire et al. 2011 (Alchemy). Differs: the cosine and a smooth range R instead of `1/|v|`, so that no constant depends on the
//! scene's size.

use super::raster::{ShadowMap, room};
use super::{Drawing, Image, NO_TRIANGLE, SAMPLES, Samples, Triangle, View, for_rows};
use crate::error::{Error, Result};
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// Lights: direction in view space, of any length, and brightness. The first one comes from the left and casts shadows, so that a wound
/// across the picture has a dark and a light wall; the others light the sides of the patch.
pub(super) const KEY: ([f32; 3], f32) = ([-0.55, 0.50, -0.66], 0.66);
pub(super) const FILL: ([f32; 3], f32) = ([0.75, -0.05, -0.75], 0.30);
pub(super) const RIM: ([f32; 3], f32) = ([0.15, 0.60, 0.75], 0.25);

/// Ambient light from above and from below.
pub(super) const AMBIENT: [f32; 2] = [0.37, 0.36];

/// Background at the top and the bottom, linear grey.
pub(super) const BACKGROUND: [f32; 2] = [0.86, 0.62];

/// Rows of pixels that are drawn at once.
const BAND: usize = 16;

/// Shading of samples.
struct Shader<'a> {
    drawing: &'a Drawing,
    shadow: ShadowMap,
    lights: [(Vec3, f32); 3],
}

/// Computes the pixels of `image`.
pub(super) fn shade(drawing: Option<&Drawing>, image: &mut Image) -> Result<()> {
    let (width, height) = (image.width as usize, image.height as usize);
    let Some(drawing) = drawing else {
        for_rows(&mut image.rgb, 3 * width, |y, row| {
            row.chunks_exact_mut(3).enumerate().for_each(|(x, rgb)| put(background(x, y, width, height), rgb));
        });
        return Ok(());
    };
    if image.rgb.is_empty() {
        return Ok(());
    }
    let shader = Shader::new(drawing)?;
    let rows = |band: usize| BAND.min(height - band * BAND);
    // nearest surfaces, the light that their surroundings leave, colours
    let mut seen = room(width * height, NOTHING)?;
    seen.par_chunks_mut(BAND * width).enumerate().try_for_each(|(band, pixels)| {
        let samples = drawing.samples(width, rows(band), band * BAND, false)?;
        pixels.iter_mut().enumerate().for_each(|(k, pixel)| *pixel = shader.seen(&samples, k % width, k / width));
        Ok::<(), Error>(())
    })?;
    let open = Pixels { width, height, seen }.openness(&drawing.view)?;
    image.rgb.par_chunks_mut(BAND * 3 * width).enumerate().try_for_each(|(band, bytes)| {
        let samples = drawing.samples(width, rows(band), band * BAND, true)?;
        for (k, rgb) in bytes.chunks_exact_mut(3).enumerate() {
            let (x, y) = (k % width, band * BAND + k / width);
            let behind = background(x, y, width, height);
            put(shader.pixel(&samples, x, k / width, open[y * width + x], behind), rgb);
        }
        Ok(())
    })
}

/// sRGB bytes of a linear colour.
fn put(color: Vec3, rgb: &mut [u8]) {
    let srgb = color.clamp(Vec3::ZERO, Vec3::ONE).map(f32::sqrt) * 255.0 + 0.5;
    rgb.copy_from_slice(&srgb.to_array().map(|channel| channel as u8));
}

/// Light grey, darker towards the bottom and a little towards the corners; linear.
fn background(x: usize, y: usize, width: usize, height: usize) -> Vec3 {
    let (u, v) = ((x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32);
    let grey = BACKGROUND[0] + (BACKGROUND[1] - BACKGROUND[0]) * v * v;
    let corner = (u - 0.5) * (u - 0.5) + (v - 0.5) * (v - 0.5);
    Vec3::new(0.985, 0.995, 1.01) * (grey - 0.12 * corner)
}

impl<'a> Shader<'a> {
    fn new(drawing: &'a Drawing) -> Result<Self> {
        let lights = [KEY, FILL, RIM].map(|(to, bright)| (Vec3::from(to).normalize(), bright));
        let shadow = ShadowMap::new(lights[0].0, drawing.triangles.iter().map(|t| &t.corners))?;
        Ok(Self { drawing, shadow, lights })
    }

    /// Direction with z = 1 through a point given in samples.
    fn ray(&self, x: f32, y: f32) -> Vec3 {
        let focal = self.drawing.view.focal as f32;
        let center = self.drawing.view.center;
        Vec3::new((x - center[0] as f32) / focal, (center[1] as f32 - y) / focal, 1.0)
    }

    /// The nearest sample of a pixel, with its face's normal; `y` counts from the top of the band.
    fn seen(&self, samples: &Samples, x: usize, y: usize) -> Seen {
        let inverse_depth = &samples.inverse_depth;
        let front = pixel_samples(x, y, samples.width)
            .into_iter()
            .max_by(|&i, &j| inverse_depth[i].total_cmp(&inverse_depth[j]))
            .expect("a pixel has samples");
        let id = samples.triangle[front];
        if id == NO_TRIANGLE {
            return NOTHING;
        }
        let middle = |pixel: usize| (pixel * SAMPLES) as f32 + 0.5 * SAMPLES as f32;
        let ray = self.ray(middle(x), middle(y) + samples.top as f32);
        let normal = facing(face_normal(&self.drawing.triangles[id as usize]), ray);
        Seen { depth: 1.0 / inverse_depth[front], normal }
    }

    /// Linear colour of a pixel; each triangle in it is shaded once. `y` counts from the top of the band.
    fn pixel(&self, samples: &Samples, x: usize, y: usize, open: f32, behind: Vec3) -> Vec3 {
        let ids = pixel_samples(x, y, samples.width).map(|s| samples.triangle[s]);
        if ids == [NO_TRIANGLE; SAMPLES * SAMPLES] {
            return behind;
        }
        let whole = ids.iter().all(|&id| id == ids[0]);
        let mut color = [behind; SAMPLES * SAMPLES];
        for k in 0..ids.len() {
            if ids[k] == NO_TRIANGLE {
                continue;
            }
            let (dx, dy) = ((k % SAMPLES) as f32 + 0.5, (k / SAMPLES) as f32 + 0.5);
            let middle = 0.5 * SAMPLES as f32;
            let (dx, dy) = if whole { (middle, middle) } else { (dx, dy) };
            color[k] = match ids[..k].iter().position(|&id| id == ids[k]) {
                Some(same) => color[same],
                None => {
                    let at_top = (y * SAMPLES + samples.top) as f32;
                    let ray = self.ray((x * SAMPLES) as f32 + dx, at_top + dy);
                    self.light(&self.drawing.triangles[ids[k] as usize], ray, open)
                }
            };
        }
        let mut sum = Vec3::ZERO;
        for (sample, color) in pixel_samples(x, y, samples.width).into_iter().zip(color) {
            sum += color * self.drawing.inks[usize::from(samples.line[sample])];
        }
        sum / (SAMPLES * SAMPLES) as f32
    }

    /// Linear colour of the triangle where the ray meets it; `open` is the fraction of ambient light left by occlusion, 0 to 1.
    fn light(&self, triangle: &Triangle, ray: Vec3, open: f32) -> Vec3 {
        let (position, normal, color) = meet(triangle, ray);
        let face = facing(face_normal(triangle), ray);
        let normal = if normal.dot(face) < 0.0 { -normal } else { normal };
        let to_eye = -ray.normalize();
        let shininess = triangle.shininess;
        let mirror = shininess * shininess / (shininess * shininess + 2500.0);
        let shadow = if face.dot(self.lights[0].0) > 0.0 { self.shadow.lit(position, face) } else { 0.0 };
        let mut diffuse = AMBIENT[1] + (AMBIENT[0] - AMBIENT[1]) * (0.5 + 0.5 * normal.y);
        let mut highlight = 0.0;
        for (index, &(to_light, bright)) in self.lights.iter().enumerate() {
            let bright = if index == 0 { bright * shadow } else { bright };
            let cosine = normal.dot(to_light).max(0.0);
            diffuse += bright * cosine;
            let half = (to_light + to_eye).normalize_or_zero();
            let s = normal.dot(half).max(0.0);
            // Schlick 1994 in place of sⁿ
            highlight += bright * cosine.min(0.25) * 4.0 * s / (shininess * (1.0 - s) + s);
        }
        let seen = surroundings(ray.normalize().reflect(normal), self.lights[0].0);
        let matt = color * diffuse * (1.0 - 0.75 * mirror);
        let glossy = color * (mirror * seen) + highlight * (0.07 + 0.5 * mirror);
        matt * open + glossy * (0.4 + 0.6 * open)
    }
}

/// Brightness of the surroundings in a mirror: a light ceiling, a darker floor, a soft lamp.
fn surroundings(direction: Vec3, lamp: Vec3) -> f32 {
    let ceiling = smooth_step(-0.5, 0.5, direction.y);
    0.22 + 0.72 * ceiling + 0.9 * smooth_step(0.55, 0.95, direction.dot(lamp))
}

fn smooth_step(low: f32, high: f32, value: f32) -> f32 {
    let t = ((value - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Indices of a pixel's samples, row by row.
fn pixel_samples(x: usize, y: usize, width: usize) -> [usize; SAMPLES * SAMPLES] {
    std::array::from_fn(|k| (y * SAMPLES + k / SAMPLES) * width + x * SAMPLES + k % SAMPLES)
}

fn face_normal(triangle: &Triangle) -> Vec3 {
    let [a, b, c] = triangle.corners;
    (b - a).cross(c - a).normalize_or_zero()
}

/// Normal on the side of the eye.
fn facing(normal: Vec3, ray: Vec3) -> Vec3 {
    if normal.dot(ray) > 0.0 { -normal } else { normal }
}

/// Intersection of a ray from the eye with the triangle's plane, clamped to the triangle, and the normal and colour there. Source: Möller and Trumbore
/// 1997.
fn meet(triangle: &Triangle, ray: Vec3) -> (Vec3, Vec3, Vec3) {
    let [a, b, c] = triangle.corners;
    let (ab, ac) = (b - a, c - a);
    let p = ray.cross(ac);
    let volume = ab.dot(p);
    let (v, w) = (-a.dot(p) / volume, ray.dot(ab.cross(a)) / volume);
    if !(v.is_finite() && w.is_finite()) {
        return (a, triangle.normals[0], triangle.colors[0]); // seen exactly edge on
    }
    let v = v.clamp(0.0, 1.0);
    let w = w.clamp(0.0, 1.0 - v);
    let [na, nb, nc] = triangle.normals;
    let normal = na * (1.0 - v - w) + nb * v + nc * w;
    let [ca, cb, cc] = triangle.colors;
    let color = ca + (cb - ca) * v + (cc - ca) * w;
    (a + ab * v + ac * w, normal.try_normalize().unwrap_or(na), color)
}

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
struct Pixels {
    width: usize,
    height: usize,
    /// `[height][width]`.
    seen: Vec<Seen>,
}

/// Depth, m (infinite where there is no surface), and the unit normal towards the eye.
#[derive(Clone, Copy)]
struct Seen {
    depth: f32,
    normal: Vec3,
}

const NOTHING: Seen = Seen { depth: f32::INFINITY, normal: Vec3::ZERO };

impl Pixels {
    /// `[height][width]` open fraction of the surroundings, 0 to 1.
    fn openness(&self, view: &View) -> Result<Vec<f32>> {
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
