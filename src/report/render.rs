//! Pictures and a film of a run from its saved surfaces: coloured by layer, or by a field with a labelled bar.

use super::Refused;
use super::film::Film;
use super::frames::{CELL_INK, CELL_LINE, RIM_INK, RIM_LINE, SKIN_SHININESS, STEEL, STEEL_SHININESS, WALL_LINE};
use super::listing::Listing;
use crate::error::Result;
use crate::formats::{Array, Grid, read_grid};
use crate::output::{Failed, replace};
use crate::view::{self, Camera, ColorBar, Image, Outline, Paint, Surface, color_bar, color_of};
use glam::DVec3;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Folder of the pictures in that of the run, and the film in it.
const FOLDER: &str = "render";
const FILM: &str = "render/film.png";
/// Direction from the surface to the camera (front right, 30 degrees above), room around the surface, and the angle of view, degrees.
const DIRECTION: DVec3 = DVec3::new(0.5, -0.7, 0.51);
const MARGIN: f64 = 1.12;
const FIELD_OF_VIEW: f64 = 30.0;
/// Share of the faces, by number, whose stress may be beyond the bar: next to a point of contact or the end of a cut it grows with the
/// fineness of the grid, and would leave one colour to the rest.
const BEYOND: f64 = 0.005;

/// What the colours are of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Color {
    /// Layers, as in the pictures of the run.
    Layer,
    /// Length of the displacement.
    Displacement,
    /// Length of the velocity.
    Velocity,
    /// Von Mises stress, of runs whose scene asks for stress in `[output]`.
    VonMises,
}

/// A quantity with its name, array and unit.
struct Quantity {
    name: &'static str,
    array: &'static str,
    /// Units and their factors, from small to large.
    units: &'static [(&'static str, f64)],
}

impl Color {
    fn quantity(self) -> Option<Quantity> {
        let lengths = &[("µm", 1e6), ("mm", 1e3)];
        match self {
            Self::Layer => None,
            Self::Displacement => Some(Quantity { name: "displacement", array: "displacement_m", units: lengths }),
            Self::Velocity => {
                Some(Quantity { name: "velocity", array: "velocity_m_s", units: &[("mm/s", 1e3), ("m/s", 1.0)] })
            }
            Self::VonMises => {
                let units = &[("Pa", 1.0), ("kPa", 1e-3), ("MPa", 1e-6)];
                Some(Quantity { name: "von Mises stress", array: "von_mises_pa", units })
            }
        }
    }
}

/// Options of the pictures.
#[derive(Clone, Debug)]
pub struct Options {
    /// Folder of the run.
    pub folder: PathBuf,
    /// Colours.
    pub color: Color,
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// Pictures of the film per second.
    pub rate: u16,
    /// Position of the camera, m; all in view from the front right when none is given.
    pub eye: Option<[f64; 3]>,
    /// Point that it looks at, m; the middle when none is given.
    pub target: Option<[f64; 3]>,
}

/// Whether a file of this name, relative to the folder of a run, was made here.
pub(super) fn is_rendered(name: &str) -> bool {
    let digits = name.strip_prefix("render/frame_").and_then(|rest| rest.strip_suffix(".png"));
    name == FILM || digits.is_some_and(|d| d.len() >= 4 && d.bytes().all(|b| b.is_ascii_digit()))
}

/// A saved surface.
struct Saved {
    mesh: Grid,
    triangles: Vec<[u32; 3]>,
    path: PathBuf,
}

impl Saved {
    fn read(path: PathBuf) -> Result<Self> {
        let bytes = std::fs::read(&path).map_err(|error| unread(&path, &error.to_string()))?;
        let mesh = read_grid(&bytes, &path)?;
        // VTK's number of a triangle
        if mesh.types.iter().any(|kind| *kind != 5) || mesh.connectivity.len() != 3 * mesh.types.len() {
            return Err(unread(&path, "it has other cells than triangles"));
        }
        let triangles = mesh.connectivity.chunks_exact(3).map(|ids| [ids[0], ids[1], ids[2]]).collect();
        Ok(Self { mesh, triangles, path })
    }

    /// An array on points, or else on triangles, and whether it is on points.
    fn array(&self, name: &str, components: usize) -> Result<(&Array, bool)> {
        let fits = |array: &&Array, count: usize| {
            array.name == name && array.components == components && array.values.len() == components * count
        };
        let on_points = self.mesh.point_data.iter().find(|array| fits(array, self.mesh.points.len()));
        let on_cells = self.mesh.cell_data.iter().find(|array| fits(array, self.triangles.len()));
        let missing = || Refused::NoField { path: self.path.clone(), name: name.into() };
        Ok(on_points.map(|array| (array, true)).or(on_cells.map(|array| (array, false))).ok_or_else(missing)?)
    }

    /// An array on triangles.
    fn on_triangles(&self, name: &str, components: usize) -> Result<&[f64]> {
        match self.array(name, components)? {
            (array, false) => Ok(&array.values),
            _ => Err(Refused::NoField { path: self.path.clone(), name: name.into() }.into()),
        }
    }

    /// Size of a field at the points or triangles that it is on, and whether it is on points.
    fn sizes(&self, name: &str) -> Result<(Vec<f64>, bool)> {
        match self.array(name, 3) {
            Ok((vectors, on_points)) => {
                Ok((vectors.values.chunks_exact(3).map(|v| DVec3::from_slice(v).length()).collect(), on_points))
            }
            Err(_) => self.array(name, 1).map(|(array, on_points)| (array.values.clone(), on_points)),
        }
    }

    /// Triangles of the skin, or of the walls of wounds: numbers and ids.
    fn faces(&self, wall: bool) -> Result<(Vec<usize>, Vec<[u32; 3]>)> {
        let of_wall = self.on_triangles("wall", 1)?;
        let picked = (0..self.triangles.len()).filter(|t| (of_wall[*t] != 0.0) == wall);
        Ok(picked.map(|t| (t, self.triangles[t])).unzip())
    }
}

fn unread(path: &Path, reason: &str) -> crate::error::Error {
    Refused::Table {
        at: path.display().to_string(),
        found: format!("a file that cannot be drawn ({reason})"),
        wanted: "a surface that `cutis run` has saved",
    }
    .into()
}

/// Sides of the cells behind triangles, each once: two triangles in turn are a cell's face.
fn sides(triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let mut out: Vec<[u32; 2]> = vec![];
    for pair in triangles.chunks(2) {
        match pair {
            [[a, b, c], [d, e, f]] if a == d && c == e => out.extend([[*a, *b], [*b, *c], [*c, *f], [*f, *a]]),
            _ => out.extend(pair.iter().flat_map(|[a, b, c]| [[*a, *b], [*b, *c], [*c, *a]])),
        }
    }
    out.iter_mut().for_each(|side| side.sort_unstable());
    out.sort_unstable();
    out.dedup();
    out
}

/// A file of a series and its time, s.
type Entry = (f64, PathBuf);

/// Entries of a `.pvd` file; none where there is no such file.
fn series(folder: &Path, name: &str) -> Result<Vec<Entry>> {
    let path = folder.join(name);
    let text = match std::fs::read_to_string(&path) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(vec![]),
        text => text.map_err(|error| unread(&path, &error.to_string()))?,
    };
    let document = roxmltree::Document::parse(&text).map_err(|error| {
        let (at, found) = (format!("{}:{}", path.display(), error.pos().row), error.to_string());
        Refused::Table { at, found, wanted: "a series that `cutis run` has written" }
    })?;
    let entry = |node: roxmltree::Node| {
        let row = document.text_pos_at(node.range().start).row;
        let refused = || Refused::Table {
            at: format!("{}:{row}", path.display()),
            found: "a DataSet without a timestep and a file".into(),
            wanted: "a series that `cutis run` has written",
        };
        let time = node.attribute("timestep").and_then(|time| time.parse().ok());
        Ok((time.ok_or_else(refused)?, folder.join(node.attribute("file").ok_or_else(refused)?)))
    };
    document.descendants().filter(|node| node.has_tag_name("DataSet")).map(entry).collect()
}

/// Largest value of the bar over all pictures, and the box around all points.
struct Extent {
    high: f64,
    low_corner: DVec3,
    high_corner: DVec3,
}

/// Draws every saved surface of a run, with the tools; returns the files: pictures and a film (an animated PNG) in `render` in that folder.
/// `progress` is called with the number of completed pictures and of all.
///
/// The series is read twice, for the extent of all pictures and for each of them; one picture at a time is in memory.
///
/// # Errors
/// [`Refused::NoResults`] for a folder without surfaces, [`Refused::NoField`] for a field that was not saved, [`Refused::Table`] or an error
/// of the mesh, with its place, for files that are damaged or foreign, [`Refused::Locked`] while a run writes there, and if memory or disk do not suffice.
pub fn render(options: &Options, progress: &mut dyn FnMut(usize, usize)) -> Result<Vec<PathBuf>> {
    let folder = &options.folder;
    let surfaces = series(folder, "surface.pvd")?;
    if surfaces.is_empty() {
        let wanted = "surface.pvd with the surfaces of pictures (--frames)";
        return Err(Refused::NoResults { path: folder.clone(), wanted }.into());
    }
    let tools = series(folder, "tools.pvd")?;
    let extent = extent(options, &surfaces)?;
    let camera = camera(options, &extent);
    let mut listing = Listing::open(folder, &[FOLDER], is_rendered)?;
    listing.remove(is_rendered)?;
    let film = listing.add(FILM)?;
    let mut frames = Film::new(&film, options.size)?;
    let mut files = vec![film];
    for (number, (time, path)) in surfaces.iter().enumerate() {
        let saved = Saved::read(path.clone())?;
        let tool = tools.iter().find(|(at, _)| at == time).map(|(_, path)| Saved::read(path.clone())).transpose()?;
        let image = picture(options, &saved, tool.as_ref(), &camera, &extent, *time)?;
        let path = listing.add(&format!("{FOLDER}/frame_{:04}.png", number + 1))?;
        let bytes = view::png(&image).map_err(|source| Failed::Write { path: path.clone(), source })?;
        replace(&path, &bytes)?;
        frames.add(&image, [1, options.rate])?;
        files.push(path);
        progress(number + 1, surfaces.len());
    }
    frames.finish()?;
    Ok(files)
}

fn extent(options: &Options, surfaces: &[Entry]) -> Result<Extent> {
    let mut extent = Extent { high: 0.0, low_corner: DVec3::MAX, high_corner: DVec3::MIN };
    for (_, path) in surfaces {
        let saved = Saved::read(path.clone())?;
        for p in saved.mesh.points.iter().map(|p| DVec3::from_array(*p)).filter(|p| p.is_finite()) {
            (extent.low_corner, extent.high_corner) = (extent.low_corner.min(p), extent.high_corner.max(p));
        }
        if let Some(Quantity { array, .. }) = options.color.quantity() {
            let (mut sizes, on_points) = saved.sizes(array)?;
            sizes.retain(|size| size.is_finite());
            sizes.sort_by(f64::total_cmp);
            let share = if on_points { 1.0 } else { 1.0 - BEYOND };
            let rank = (share * sizes.len() as f64).ceil() as usize;
            extent.high = sizes.get(rank.max(1) - 1).map_or(extent.high, |high| extent.high.max(*high));
        }
    }
    if extent.low_corner.x > extent.high_corner.x {
        (extent.low_corner, extent.high_corner) = (DVec3::ZERO, DVec3::ZERO);
    }
    Ok(extent)
}

fn camera(options: &Options, extent: &Extent) -> Camera {
    let middle = extent.low_corner.midpoint(extent.high_corner);
    let target = options.target.map_or(middle, DVec3::from_array);
    // the nearest eye from which every corner of the box is within the picture
    let to_eye = DIRECTION.normalize();
    let right = DVec3::Z.cross(to_eye).normalize();
    let up = to_eye.cross(right);
    let tangent = (0.5 * FIELD_OF_VIEW).to_radians().tan() / MARGIN;
    let wide = f64::from(options.size[0]) / f64::from(options.size[1].max(1));
    let corner = |k: usize| {
        let pick = |bit: usize, low: f64, high: f64| if k >> bit & 1 == 0 { low } else { high };
        let (low, high) = (extent.low_corner, extent.high_corner);
        DVec3::new(pick(0, low.x, high.x), pick(1, low.y, high.y), pick(2, low.z, high.z)) - target
    };
    let away = |p: DVec3| p.dot(to_eye) + (p.dot(up).abs().max(p.dot(right).abs() / wide)) / tangent;
    let distance = (0..8).map(|k| away(corner(k))).fold(1e-6, f64::max);
    let eye = target + to_eye * distance;
    let (eye, target) = (options.eye.unwrap_or(eye.to_array()), target.to_array());
    Camera { eye, target, up: [0.0, 0.0, 1.0], field_of_view_deg: FIELD_OF_VIEW }
}

/// Unit of a bar that ends at a value.
fn unit(quantity: &Quantity, high: f64) -> (&'static str, f64) {
    let fits = |(_, factor): &&(&str, f64)| high * factor < 1000.0;
    let last = quantity.units[quantity.units.len() - 1];
    quantity.units.iter().find(fits).copied().unwrap_or(last)
}

fn picture(
    options: &Options,
    saved: &Saved,
    tools: Option<&Saved>,
    camera: &Camera,
    extent: &Extent,
    time: f64,
) -> Result<Image> {
    let quantity = options.color.quantity();
    let ((skin_numbers, skin), (wall_numbers, walls)) = (saved.faces(false)?, saved.faces(true)?);
    let (skin_sides, wall_sides) = (sides(&skin), sides(&walls));
    let rims: Vec<[u32; 2]> =
        wall_sides.iter().filter(|side| skin_sides.binary_search(side).is_ok()).copied().collect();
    // colours of vertices or triangles
    let high = if extent.high > 0.0 { extent.high } else { 1.0 };
    let (colors, of_points): (Vec<[u8; 3]>, bool) = match &quantity {
        Some(Quantity { array, .. }) => {
            let (sizes, on_points) = saved.sizes(array)?;
            (sizes.iter().map(|size| color_of(size / high)).collect(), on_points)
        }
        None => {
            let rgb = |c: &[f64]| [c[0], c[1], c[2]].map(|c| (255.0 * c.clamp(0.0, 1.0)).round() as u8);
            (saved.on_triangles("color", 3)?.chunks_exact(3).map(rgb).collect(), false)
        }
    };
    let picked = |numbers: &[usize]| numbers.iter().map(|t| colors[*t]).collect::<Vec<_>>();
    let (of_skin, of_walls) = if of_points { (vec![], vec![]) } else { (picked(&skin_numbers), picked(&wall_numbers)) };
    let paint = |own| if of_points { Paint::Vertices(&colors) } else { Paint::Triangles(own) };
    let skin_lines = [
        Outline { lines: &skin_sides, width: CELL_LINE, ink: CELL_INK },
        Outline { lines: &rims, width: RIM_LINE, ink: RIM_INK },
    ];
    let wall_lines = [Outline { lines: &wall_sides, width: WALL_LINE, ink: CELL_INK }];
    let surface = |triangles, colors, outlines| {
        let shininess = SKIN_SHININESS;
        Surface { positions: &saved.mesh.points, triangles, colors, smooth: true, outlines, shininess }
    };
    let mut surfaces =
        vec![surface(&walls, paint(&of_walls), &wall_lines), surface(&skin, paint(&of_skin), &skin_lines)];
    let steel = vec![STEEL; tools.map_or(0, |tools| tools.triangles.len())];
    surfaces.extend(tools.map(|tools| Surface {
        positions: &tools.mesh.points,
        triangles: &tools.triangles,
        colors: Paint::Triangles(&steel),
        smooth: true,
        outlines: &[],
        shininess: STEEL_SHININESS,
    }));
    let caption = format!("time {time:.3} s");
    let mut image = view::render(&surfaces, camera, options.size[0], options.size[1], &[&caption])?;
    if let Some(quantity) = &quantity {
        let (unit, factor) = unit(quantity, high);
        color_bar(&mut image, &ColorBar { title: format!("{}, {unit}", quantity.name), high: high * factor });
    }
    Ok(image)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faces_of_cells_have_four_sides() {
        let quads = [[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]];
        assert_eq!(sides(&quads), [[0, 1], [0, 3], [1, 2], [1, 4], [2, 3], [2, 5], [4, 5]]);
        assert_eq!(sides(&[[0, 1, 2], [3, 4, 5]]).len(), 6, "triangles that are no pair have three each");
    }
}
