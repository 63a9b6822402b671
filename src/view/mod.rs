//! Pictures without a graphics adapter: a small software rasteriser.
//!
//! Triangles are clipped at the near plane, drawn into a depth buffer with 4 × 4 samples per pixel, and shaded once per pixel and triangle.
//! A picture is drawn in bands of rows, so that the samples take little memory: first the nearest surface of each pixel, for the ambient
//! occlusion, then its colour.
//! Wounds are shallow compared with the patch, so two cheap depth cues are added: ambient occlusion from the depth buffer, and shadows of
//! the first light. Triangles are drawn in a fixed order and rows are shaded independently, so the same input gives the same bytes for any
//! number of threads.
//!
//! View space: x right, y up, z away from the eye, in metres. Lights are fixed to the camera.

mod overlay;
mod picture;
mod pipelines;
mod raster;
mod shade;

pub use overlay::{ColorBar, VIRIDIS, caption, color_bar, color_of, strokes};
pub use picture::{Clip, Drawn, Effort, Renderer};
pub use raster::NoMemory;

use crate::error::Result;
use glam::{DVec3, Vec3};
use raster::{Line, NO_TRIANGLE, SAMPLES, Samples, room};
use rayon::prelude::*;

/// Cosine of 40°: smooth shading preserves edges sharper than this. A larger angle rounds the bevel of a blade, a smaller one shows the
/// facets of a coarse handle.
const CREASE_COSINE: f32 = 0.766;

/// Distance of the near plane as a fraction of the distance from eye to target.
const NEAR: f64 = 0.01;

/// Colour of what is beyond the end of `Surface::colors`, sRGB.
const NO_COLOR: [u8; 3] = [128; 3];

/// Minimum number of rows per thread: ten thousand pixels or so; fewer are not worth distributing.
const ROWS: usize = 16;

/// Triangle mesh with its material. Both sides of a triangle are drawn.
#[derive(Clone, Copy, Debug)]
pub struct Surface<'a> {
    /// `[vertex]` m.
    pub positions: &'a [[f64; 3]],
    /// `[triangle]` vertex ids; either winding.
    pub triangles: &'a [[u32; 3]],
    /// Colours.
    pub colors: Paint<'a>,
    /// Smooth shading with normals averaged over the faces around a vertex, except across creases; otherwise flat.
    pub smooth: bool,
    /// Lines on the surface, later ones over earlier ones.
    pub outlines: &'a [Outline<'a>],
    /// Exponent of the highlight: about 10 for skin, 100 for polished metal; above 50 the surface also mirrors its surroundings.
    pub shininess: f64,
}

/// Colours of a surface, sRGB; missing ones are grey.
#[derive(Clone, Copy, Debug)]
pub enum Paint<'a> {
    /// `[triangle]`
    Triangles(&'a [[u8; 3]]),
    /// `[vertex]`, with even transitions between them.
    Vertices(&'a [[u8; 3]]),
}

impl Paint<'_> {
    /// Linear colours of the corners of a triangle, from 0 to 1.
    fn corners(self, triangle: usize, ids: [u32; 3]) -> [Vec3; 3] {
        let linear = |srgb: Option<&[u8; 3]>| {
            let color = Vec3::from(srgb.unwrap_or(&NO_COLOR).map(|channel| f32::from(channel) / 255.0));
            color * color
        };
        match self {
            Self::Triangles(colors) => [linear(colors.get(triangle)); 3],
            Self::Vertices(colors) => ids.map(|id| linear(colors.get(id as usize))),
        }
    }
}

/// Lines of one style, drawn where they are visible.
#[derive(Clone, Copy, Debug)]
pub struct Outline<'a> {
    /// `[line]` vertex ids.
    pub lines: &'a [[u32; 2]],
    /// Width, pixels.
    pub width: f32,
    /// Fraction of the surface's linear colour that remains under the line, 0 to 1.
    pub ink: [f32; 3],
}

/// Camera of a picture.
#[derive(Clone, Copy, Debug)]
pub struct Camera {
    /// m.
    pub eye: [f64; 3],
    /// Point at the centre of the picture, m.
    pub target: [f64; 3],
    /// Up direction in the picture, of any length.
    pub up: [f64; 3],
    /// Angle between the top and the bottom of the picture, degrees.
    pub field_of_view_deg: f64,
}

/// Picture with 8 bits per channel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// `[height][width][3]` sRGB, from the top left.
    pub rgb: Vec<u8>,
    /// Number of triangles skipped because a corner is non-finite or not in `positions`.
    pub skipped: usize,
}

/// A triangle in view space, ready to be drawn.
struct Triangle {
    corners: [Vec3; 3],
    normals: [Vec3; 3],
    /// Of the corners, linear, 0 to 1.
    colors: [Vec3; 3],
    shininess: f32,
}

/// Axes of the camera, and its scale in samples.
struct View {
    eye: DVec3,
    axes: [DVec3; 3],
    /// Distance from eye to target, m.
    distance: f64,
    /// Samples per unit of x/z.
    focal: f64,
    /// Centre of the picture, samples.
    center: [f64; 2],
    /// Tangent of half the field of view.
    half_tangent: f64,
}

impl View {
    /// `None` if the camera has no direction or a non-finite value.
    fn new(camera: &Camera, width: usize, height: usize) -> Option<Self> {
        let (eye, target) = (DVec3::from(camera.eye), DVec3::from(camera.target));
        let forward = (target - eye).try_normalize()?;
        let right = forward.cross(DVec3::from(camera.up).normalize_or_zero());
        let right = match right.length() > 1e-6 {
            true => right.normalize(),
            false => forward.any_orthonormal_vector(),
        };
        let half_tangent = (0.5 * camera.field_of_view_deg.clamp(1.0, 170.0)).to_radians().tan();
        let center = [0.5 * (width * SAMPLES) as f64, 0.5 * (height * SAMPLES) as f64];
        let view = Self {
            eye,
            axes: [right, right.cross(forward), forward],
            distance: eye.distance(target),
            focal: center[1] / half_tangent,
            center,
            half_tangent,
        };
        (view.distance.is_finite() && half_tangent.is_finite()).then_some(view)
    }

    /// World to view space, m; `None` if non-finite.
    fn to_view(&self, position: &[f64; 3]) -> Option<Vec3> {
        let p = DVec3::from(*position) - self.eye;
        let p = DVec3::from(self.axes.map(|axis| axis.dot(p))).as_vec3();
        p.is_finite().then_some(p)
    }
}

/// Draws `surfaces` in perspective on a light background, with `caption` at the top left.
///
/// Nothing of the input is kept. Without surfaces, or with a camera without a direction, the result is the background; a width or height of
/// 0 gives an image without pixels.
///
/// # Errors
/// [`NoMemory`] if there is not enough memory for the picture.
pub fn render(surfaces: &[Surface], camera: &Camera, width: u32, height: u32, caption: &[&str]) -> Result<Image> {
    let (columns, rows) = (width as usize, height as usize);
    let mut image = Image { width, height, rgb: room(3 * columns * rows, 0)?, skipped: 0 };
    let mut drawing = None;
    if let Some(view) = View::new(camera, columns, rows) {
        let mut made = Drawing::new(view);
        image.skipped = surfaces.iter().map(|surface| made.add(surface)).sum();
        surfaces.iter().for_each(|surface| made.add_lines(surface));
        drawing = Some(made).filter(|made| !made.triangles.is_empty());
    }
    shade::shade(drawing.as_ref(), &mut image)?;
    overlay::caption(&mut image, caption);
    Ok(image)
}

/// What is drawn, in view space.
struct Drawing {
    view: View,
    /// Distance of the near plane, m.
    near: f32,
    triangles: Vec<Triangle>,
    lines: Vec<Line>,
    /// `[pen]` fraction of the linear colour that remains under a line; the first is that of no line.
    inks: Vec<Vec3>,
    /// `[triangle]` and `[line]` rows of samples that each reaches.
    triangle_rows: Vec<[f64; 2]>,
    line_rows: Vec<[f64; 2]>,
}

impl Drawing {
    fn new(view: View) -> Self {
        let near = (NEAR * view.distance) as f32;
        let (triangles, lines, inks) = (vec![], vec![], vec![Vec3::ONE]);
        Self { view, near, triangles, lines, inks, triangle_rows: vec![], line_rows: vec![] }
    }

    /// Adds the triangles of a surface; returns the number of skipped ones.
    fn add(&mut self, surface: &Surface) -> usize {
        let in_view: Vec<_> = surface.positions.iter().map(|p| self.view.to_view(p)).collect();
        let first = self.triangles.len();
        let skipped = prepare(surface, &in_view, &mut self.triangles);
        let reach = |triangle: &Triangle| raster::rows(&self.view, self.near, &triangle.corners, 0.0);
        self.triangle_rows.extend(self.triangles[first..].iter().map(reach));
        skipped
    }

    /// Adds the lines of a surface; those with a missing or non-finite end are skipped.
    fn add_lines(&mut self, surface: &Surface) {
        for outline in surface.outlines {
            let pen = self.pen(outline.ink);
            let width = f64::from(outline.width) * SAMPLES as f64;
            for ids in outline.lines {
                let ends = ids.map(|id| surface.positions.get(id as usize).and_then(|p| self.view.to_view(p)));
                if let [Some(a), Some(b)] = ends {
                    self.line_rows.push(raster::rows(&self.view, self.near, &[a, b], 0.5 * width));
                    self.lines.push(Line { ends: [a, b], pen, width });
                }
            }
        }
    }

    /// Pen of a colour; colours beyond the 255th share its pen.
    fn pen(&mut self, ink: [f32; 3]) -> u8 {
        let ink = Vec3::from(ink);
        let known = self.inks.iter().position(|other| *other == ink);
        let pen = known.unwrap_or_else(|| {
            self.inks.push(ink);
            self.inks.len() - 1
        });
        pen.min(255) as u8
    }

    /// Samples of the `rows` rows of pixels from `top` on, in a picture of `columns` columns; without lines where only depths are wanted.
    fn samples(&self, columns: usize, rows: usize, top: usize, with_lines: bool) -> Result<Samples> {
        let mut samples = Samples::new(columns, rows, top)?;
        let (first, last) = (samples.top as f64, (samples.top + samples.height) as f64);
        let inside = |[low, high]: &[f64; 2]| *low < last && *high > first;
        for (id, triangle) in self.triangles.iter().enumerate().filter(|(id, _)| inside(&self.triangle_rows[*id])) {
            samples.draw_triangle(&self.view, self.near, &triangle.corners, id as u32);
        }
        if with_lines {
            for (_, line) in self.lines.iter().enumerate().filter(|(k, _)| inside(&self.line_rows[*k])) {
                samples.draw_line(&self.view, self.near, line);
            }
        }
        Ok(samples)
    }
}

/// Adds the surface's triangles in view space; returns the number of skipped ones.
fn prepare(surface: &Surface, in_view: &[Option<Vec3>], triangles: &mut Vec<Triangle>) -> usize {
    let first = triangles.len();
    let corner = |id: u32| in_view.get(id as usize).copied().flatten();
    let mut kept_ids = Vec::with_capacity(surface.triangles.len());
    for (index, ids) in surface.triangles.iter().enumerate() {
        let [Some(a), Some(b), Some(c)] = ids.map(corner) else {
            continue;
        };
        triangles.push(Triangle {
            corners: [a, b, c],
            normals: [(b - a).cross(c - a).normalize_or_zero(); 3],
            colors: surface.colors.corners(index, *ids),
            shininess: (surface.shininess as f32).clamp(1.0, 1e4),
        });
        kept_ids.push(*ids);
    }
    if surface.smooth {
        smooth_normals(in_view.len(), &kept_ids, &mut triangles[first..]);
    }
    surface.triangles.len() - kept_ids.len()
}

/// Area-weighted average of the normals of the faces around a vertex that are within the crease angle of the corner's own face.
fn smooth_normals(vertex_count: usize, ids: &[[u32; 3]], triangles: &mut [Triangle]) {
    // faces around each vertex
    let mut first = vec![0_usize; vertex_count + 1];
    for &id in ids.as_flattened() {
        first[id as usize + 1] += 1;
    }
    for vertex in 0..vertex_count {
        first[vertex + 1] += first[vertex];
    }
    let mut next = first.clone();
    let mut around = vec![0_usize; ids.len() * 3];
    for (face, corners) in ids.iter().enumerate() {
        for &id in corners {
            around[next[id as usize]] = face;
            next[id as usize] += 1;
        }
    }
    // averages
    let faces: Vec<(Vec3, Vec3)> = triangles
        .iter()
        .map(|Triangle { corners: [a, b, c], normals, .. }| (normals[0], (b - a).cross(c - a)))
        .collect();
    for (face, corners) in ids.iter().enumerate() {
        for (corner, &id) in corners.iter().enumerate() {
            let sum: Vec3 = around[first[id as usize]..first[id as usize + 1]]
                .iter()
                .filter(|&&other| faces[other].0.dot(faces[face].0) > CREASE_COSINE)
                .map(|&other| faces[other].1)
                .sum();
            triangles[face].normals[corner] = sum.try_normalize().unwrap_or(faces[face].0);
        }
    }
}

/// Calls `fill(y, row)` for each row of a picture, on all cores. Rows are independent, so the number of threads does not affect the result.
fn for_rows<T: Send>(data: &mut [T], row_size: usize, fill: impl Fn(usize, &mut [T]) + Sync) {
    // uses the existing threads: starting new ones would fail where memory is short
    data.par_chunks_mut(row_size.max(1)).enumerate().with_min_len(ROWS).for_each(|(y, row)| fill(y, row));
}

/// Encodes the picture as PNG.
///
/// # Errors
/// For an image without pixels.
pub fn png(image: &Image) -> std::io::Result<Vec<u8>> {
    let encode = || -> std::result::Result<Vec<u8>, png::EncodingError> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, image.width, image.height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&image.rgb)?;
        writer.finish()?;
        Ok(bytes)
    };
    encode().map_err(std::io::Error::from)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn render(surfaces: &[Surface], camera: &Camera, width: u32, height: u32, caption: &[&str]) -> Image {
        super::render(surfaces, camera, width, height, caption).expect("small pictures fit")
    }

    const RED: [u8; 3] = [200, 30, 30];
    const BLUE: [u8; 3] = [30, 30, 200];
    /// From above, y up in the picture, about 8 mm of height at z = 0.
    const CAMERA: Camera =
        Camera { eye: [0.0, 0.0, 20e-3], target: [0.0; 3], up: [0.0, 1.0, 0.0], field_of_view_deg: 23.0 };

    fn triangle(half: f64, z: f64) -> [[f64; 3]; 3] {
        [[-half, -half, z], [half, -half, z], [0.0, half, z]]
    }

    fn surface<'a>(positions: &'a [[f64; 3]], colors: &'a [[u8; 3]]) -> Surface<'a> {
        Surface {
            positions,
            triangles: &[[0, 1, 2]],
            colors: Paint::Triangles(colors),
            smooth: false,
            outlines: &[],
            shininess: 10.0,
        }
    }

    fn picture(surfaces: &[Surface]) -> Image {
        render(surfaces, &CAMERA, 64, 48, &[])
    }

    fn middle(image: &Image) -> [u8; 3] {
        let index = 3 * (image.height / 2 * image.width + image.width / 2) as usize;
        [image.rgb[index], image.rgb[index + 1], image.rgb[index + 2]]
    }

    type Sheet = (Vec<[f64; 3]>, Vec<[u32; 3]>, Vec<[u32; 2]>);

    /// A bumpy sheet of `n` × `n` cells, 6 mm wide: positions, triangles, outline.
    fn sheet(n: u32) -> Sheet {
        let along = |i: u32| 6e-3 * (f64::from(i) / f64::from(n) - 0.5);
        let points = (0..=n).flat_map(|j| (0..=n).map(move |i| (i, j)));
        let positions = points.map(|(i, j)| [along(i), along(j), 2e-4 * f64::from((i * 7 + j * 5) % 4)]).collect();
        let cells = (0..n).flat_map(|j| (0..n).map(move |i| j * (n + 1) + i));
        let triangles = cells.clone().flat_map(|a| [[a, a + 1, a + n + 2], [a, a + n + 2, a + n + 1]]).collect();
        (positions, triangles, cells.map(|a| [a, a + 1]).collect())
    }

    #[test]
    fn a_triangle_in_front_hides_one_behind() {
        let (near, far) = (triangle(2e-3, 1e-3), triangle(2e-3, -1e-3));
        let (red, blue) = (surface(&near, &[RED]), surface(&far, &[BLUE]));
        let [r, _, b] = middle(&picture(&[red, blue]));
        assert!(r > 2 * b, "the near triangle is red, seen {r} {b}");
        let (red, blue) = (surface(&near, &[RED]), surface(&far, &[BLUE]));
        assert_eq!(picture(&[red, blue]).rgb.len(), 3 * 64 * 48);
        let (red, blue) = (surface(&far, &[RED]), surface(&near, &[BLUE]));
        let [r, _, b] = middle(&picture(&[red, blue]));
        assert!(b > 2 * r, "the near triangle is blue, seen {r} {b}");
    }

    #[test]
    fn the_picture_is_not_mirrored() {
        let right = [[1e-3, -1e-3, 0.0], [3e-3, -1e-3, 0.0], [2e-3, 1e-3, 0.0]];
        let image = picture(&[surface(&right, &[RED])]);
        let is_red = |x: usize, y: usize| {
            let rgb = &image.rgb[3 * (y * 64 + x)..][..3];
            rgb[0] > rgb[2].saturating_mul(2)
        };
        assert!(is_red(43, 24) && !is_red(20, 24));
        let above = [[-1e-3, 1e-3, 0.0], [1e-3, 1e-3, 0.0], [0.0, 3e-3, 0.0]];
        let image = picture(&[surface(&above, &[RED])]);
        let is_red = |x: usize, y: usize| image.rgb[3 * (y * 64 + x)] > 100 && image.rgb[3 * (y * 64 + x) + 2] < 90;
        assert!(is_red(32, 14) && !is_red(32, 34));
    }

    #[test]
    fn the_same_input_gives_the_same_bytes() {
        let (positions, triangles, outline) = sheet(20);
        let colors = vec![RED; triangles.len()];
        let draw = || {
            let surface = Surface {
                positions: &positions,
                triangles: &triangles,
                colors: Paint::Triangles(&colors),
                smooth: true,
                outlines: &[Outline { lines: &outline, width: 1.0, ink: [0.4; 3] }],
                shininess: 60.0,
            };
            render(&[surface], &CAMERA, 123, 77, &["t = 0.1 s"])
        };
        assert_eq!(draw(), draw());
    }

    #[test]
    fn neighbours_leave_no_gap() {
        let (positions, triangles, _) = sheet(31);
        let colors = vec![RED; triangles.len()];
        let surface = Surface { triangles: &triangles, ..surface(&positions, &colors) };
        let mut drawing = Drawing::new(View::new(&CAMERA, 64, 48).unwrap());
        assert_eq!(drawing.add(&surface), 0);
        let samples = drawing.samples(64, 48, 0, true).unwrap();
        let inside = (20 * SAMPLES..44 * SAMPLES).flat_map(|x| (10 * SAMPLES..38 * SAMPLES).map(move |y| (x, y)));
        for (x, y) in inside {
            let id = samples.triangle[y * samples.width + x];
            assert_ne!(id, NO_TRIANGLE, "gap at sample {x} {y}");
        }
    }

    #[test]
    fn edges_and_lines_have_many_shades() {
        // a slanted edge, and a slanted line on a sheet
        let corners = [[-9e-3, -9e-3, 0.0], [9e-3, -9e-3, 0.0], [9e-3, -3e-3, 0.0]];
        let sheet =
            [[-9e-3, -9e-3, 0.0], [9e-3, -9e-3, 0.0], [0.0, 20e-3, 0.0], [-3e-3, -1e-3, 0.0], [3e-3, 1e-3, 0.0]];
        let lines = [[3, 4]];
        let outlines = [Outline { lines: &lines, width: 1.5, ink: [0.0; 3] }];
        let shades = |image: &Image| {
            let middle: Vec<u8> =
                (0..48).flat_map(|y| (8..56).map(move |x| 3 * (y * 64 + x) + 2)).map(|k| image.rgb[k]).collect();
            let mut found = middle.clone();
            found.sort_unstable();
            found.dedup();
            let (low, high) = (found[0], found[found.len() - 1]);
            found.iter().filter(|shade| **shade > low + 8 && **shade < high - 8).count()
        };
        let edge = shades(&picture(&[surface(&corners, &[RED])]));
        let line = shades(&picture(&[Surface { outlines: &outlines, ..surface(&sheet, &[RED]) }]));
        assert!(edge >= 8, "{edge} shades along an edge");
        assert!(line >= 5, "{line} shades along a line");
    }

    #[test]
    fn what_cannot_be_seen_does_not_panic() {
        let empty = picture(&[]);
        let cases = [
            triangle(1e-3, 50e-3),                                       // behind the eye
            triangle(1e-3, 20e-3),                                       // around the eye
            [[1.0, 0.0, 0.0], [1.1, 0.0, 0.0], [1.0, 0.1, 0.0]],         // beside the picture
            [[0.0; 3]; 3],                                               // a point
            [[-1e-3, 0.0, 0.0], [0.0; 3], [1e-3, 0.0, 0.0]],             // a line
            [[1e300, 0.0, 0.0], [0.0, 1e300, 0.0], [0.0; 3]],            // not finite in f32
            [[1e30, 0.0, -1e30], [0.0, 1e30, -1e30], [0.0, 0.0, -1e30]], // huge and far away
        ];
        for corners in cases {
            let lines = [[0, 1], [1, 2], [0, 7]];
            let hidden = Surface { smooth: true, ..surface(&corners, &[RED]) };
            assert_eq!(picture(&[hidden]).rgb.len(), empty.rgb.len());
            let outlines = [Outline { lines: &lines, width: 1.0, ink: [0.4; 3] }];
            let lined = Surface { outlines: &outlines, ..surface(&corners, &[]) };
            picture(&[lined]);
        }
        let behind = triangle(1e-3, 50e-3);
        assert_eq!(picture(&[surface(&behind, &[RED])]), empty);
    }

    #[test]
    fn a_triangle_through_the_near_plane_is_cut_there() {
        let floor = [[-1.0, -1e-3, 1.0], [1.0, -1e-3, 1.0], [0.0, -1e-3, -5.0]];
        let image = picture(&[surface(&floor, &[RED])]);
        let red = |y: usize| image.rgb[3 * (y * 64 + 32) + 2] < 90;
        assert!(red(47) && red(35) && !red(10));
    }

    #[test]
    fn triangles_that_are_not_finite_are_counted() {
        let mut corners = triangle(1e-3, 0.0).to_vec();
        corners.push([0.0, f64::NAN, 0.0]);
        corners.push([f64::INFINITY, 0.0, 0.0]);
        let ids = [[0, 1, 2], [0, 1, 3], [4, 1, 2], [0, 1, 99]];
        let image = picture(&[Surface { triangles: &ids, ..surface(&corners, &[RED; 4]) }]);
        assert_eq!(image.skipped, 3);
        assert_eq!(picture(&[surface(&corners, &[RED])]).rgb, image.rgb);
    }

    #[test]
    fn a_useless_camera_or_size_gives_a_picture_without_a_scene() {
        let corners = triangle(1e-3, 0.0);
        let surfaces = [surface(&corners, &[RED])];
        let blind = [
            Camera { eye: CAMERA.target, ..CAMERA },
            Camera { eye: [f64::NAN; 3], ..CAMERA },
            Camera { field_of_view_deg: f64::NAN, ..CAMERA },
        ];
        for camera in blind {
            assert_eq!(render(&surfaces, &camera, 64, 48, &[]), picture(&[]));
        }
        let upright = Camera { up: [0.0, 0.0, 1.0], ..CAMERA };
        assert_ne!(render(&surfaces, &upright, 64, 48, &[]), picture(&[]));
        assert!(render(&surfaces, &CAMERA, 0, 48, &["text"]).rgb.is_empty());
        assert_eq!(render(&surfaces, &CAMERA, 1, 1, &["text"]).rgb.len(), 3);
    }

    #[test]
    fn a_shallow_trench_is_darker_than_its_surroundings() {
        // Seen straight from above, the hardest case: 0.5 mm deep, 0.8 mm wide, 20 mm of skin.
        let (top, floor) = (0.0, -5e-4);
        let profile = [(-1e-2, top), (-4e-4, top), (-4e-4, floor), (4e-4, floor), (4e-4, top), (1e-2, top)];
        let sides = |(y, z)| [[-1e-2, y, z], [1e-2, y, z]];
        let positions: Vec<_> = profile.into_iter().flat_map(sides).collect();
        let strip = |k| [[k, k + 1, k + 3], [k, k + 3, k + 2]];
        let triangles: Vec<_> = (0..10).step_by(2).flat_map(strip).collect();
        let colors = [[220, 180, 150]; 10];
        let skin = Surface { triangles: &triangles, ..surface(&positions, &colors) };
        let camera = Camera { eye: [0.0, 0.0, 50e-3], ..CAMERA };
        let image = render(&[skin], &camera, 960, 640, &[]);
        let green = |y: usize| u32::from(image.rgb[3 * (y * 960 + 480) + 1]);
        let (floor, skin) = (green(320), green(480));
        assert!(10 * floor < 9 * skin, "floor {floor}, skin {skin}");
    }

    #[test]
    fn caption_is_drawn_at_the_top_left() {
        let (with, without) = (render(&[], &CAMERA, 96, 48, &["Ab µ", "☃"]), render(&[], &CAMERA, 96, 48, &[]));
        let changed: Vec<usize> =
            (0..96 * 48).filter(|i| with.rgb[3 * i..3 * i + 3] != without.rgb[3 * i..3 * i + 3]).collect();
        assert!(changed.len() > 50);
        assert!(changed.iter().all(|i| i % 96 < 40 && i / 96 < 26));
    }

    #[test]
    fn colours_of_vertices_blend_between_them() {
        let corners = triangle(4e-3, 0.0);
        let painted = |colors| picture(&[Surface { colors, ..surface(&corners, &[]) }]);
        let both = painted(Paint::Vertices(&[RED, BLUE, [0; 3]]));
        let red_at = |x: usize| {
            let rgb = &both.rgb[3 * (40 * 64 + x)..][..3];
            f64::from(rgb[0]) / f64::from(u32::from(rgb[0]) + u32::from(rgb[2]))
        };
        let shares: Vec<f64> = (16..48).map(red_at).collect();
        assert!(shares[0] > 0.65 && shares[31] < 0.35, "{shares:?}");
        assert!(shares.windows(2).all(|pair| pair[1] < pair[0] + 0.01 && pair[0] - pair[1] < 0.05), "{shares:?}");
        // one colour at all vertices is that of the triangle
        assert_eq!(painted(Paint::Vertices(&[RED; 3])), painted(Paint::Triangles(&[RED])));
    }

    #[test]
    fn a_png_reads_back_equal() {
        let corners = triangle(1e-3, 0.0);
        let image = picture(&[surface(&corners, &[RED])]);
        let file = std::io::Cursor::new(png(&image).unwrap());
        let mut reader = png::Decoder::new(file).read_info().unwrap();
        let mut rgb = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut rgb).unwrap();
        assert_eq!((info.width, info.height), (64, 48));
        assert_eq!(rgb, image.rgb);
        assert!(png(&render(&[], &CAMERA, 0, 0, &[])).is_err());
    }
}
