//! Closed surfaces of bodies that are embedded in a grid: triangles in SI units, their checks, and how a scene takes them from a file.
//!
//! Like the tetrahedra of a mesh, a surface stands on the origin of its body's frame: the middle of the bottom of its bounding box is put
//! there. Inside is what triangles wind about, by their own orientation; nested surfaces of opposite orientation leave cavities.

use super::files::Files;
use super::invalid::{Invalid, Location, Result};
use super::raw::At;
use super::region::{Group, Region};
use super::tetrahedral::groups;
use super::text::{SceneText, in_mm};
use super::{Integrator, Law, Mass, Probe, ProbeKind, STEP, Scene, Skin, TrianglePart};
use crate::formats::Mesh;
use glam::DVec3;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;
use std::path::PathBuf;

/// Longest edge of the triangles of an embedded surface, widths of cells: forces act at their corners and the middles of their edges, and
/// larger ones would leave cells between them untouched.
const LONGEST: f64 = 1.5;

/// Triangles that enclose a body: closed, of one orientation, of positive volume. Its points are those of the triangles alone.
#[derive(Clone, Debug, PartialEq)]
pub struct ClosedSurface {
    points: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
    size: [f64; 3],
    volume: f64,
    groups: Vec<Group>,
}

/// A triangle by the middles of its edges, of those that have one.
fn halved(triangle: [u32; 3], middles: &BTreeMap<[u32; 2], u32>) -> Vec<[u32; 3]> {
    let middle = |a: u32, b: u32| middles.get(&[a.min(b), a.max(b)]).copied();
    // turned so that the edges with a middle come first
    let turned = |k: usize| [0, 1, 2].map(|n| triangle[(n + k) % 3]);
    let marked = |[a, b, c]: [u32; 3]| [middle(a, b), middle(b, c), middle(c, a)];
    for [a, b, c] in (0..3).map(turned) {
        match marked([a, b, c]) {
            [None, None, None] => return vec![triangle],
            [Some(m), None, None] => return vec![[a, m, c], [m, b, c]],
            [Some(m), Some(n), None] => return vec![[m, b, n], [a, m, n], [a, n, c]],
            [Some(m), Some(n), Some(o)] => return vec![[a, m, o], [m, b, n], [o, n, c], [m, n, o]],
            _ => {}
        }
    }
    unreachable!("one of the three turns is as wanted")
}

/// What is wrong with a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Leak {
    /// There is no triangle.
    Empty,
    /// A triangle names a point that is not there, or one twice.
    Point(usize),
    /// A coordinate of a point is beyond the range of f32, in m.
    NonFinite(usize),
    /// Edges that triangles do not pass equally often both ways: their number, the points of the first.
    Open(usize, [u32; 2]),
    /// Its volume is not positive.
    Inverted,
}

impl fmt::Display for Leak {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Empty => write!(f, "it has no triangle"),
            Self::Point(first) => write!(f, "triangle {first} (from 0) has a point that is not there, or one twice"),
            Self::NonFinite(first) => write!(f, "point {first} (from 0) is beyond the range of f32, in metres"),
            Self::Open(count, [a, b]) => write!(
                f,
                "it is not closed, or its triangles are not turned alike: {count} of its edges, the first one from point {a} to {b} (from 0), \
                 have no triangle on either side that passes them both ways"
            ),
            Self::Inverted => write!(f, "its triangles are seen clockwise from outside, so its volume is not positive"),
        }
    }
}

impl Leak {
    /// How to mend it in a file.
    fn mend(self) -> &'static str {
        match self {
            Self::Empty | Self::Point(_) | Self::NonFinite(_) => "export the surface of the body as triangles",
            Self::Open(..) => {
                "`cutis mesh FILE --mend --out NEW` joins points at one position and leaves repeated triangles out; close holes and turn triangles \
                 alike in the program that made the mesh"
            }
            Self::Inverted => "flip the normals in the program that made the mesh",
        }
    }
}

impl ClosedSurface {
    /// A surface of points, m, and triangles, counter-clockwise from outside. Points of no triangle are left out. The middle of the bottom
    /// of the bounding box becomes the origin.
    ///
    /// # Errors
    /// The first [`Leak`].
    pub fn new(points: Vec<[f64; 3]>, triangles: Vec<[u32; 3]>) -> std::result::Result<Self, Leak> {
        Self::with_groups(points, triangles, vec![])
    }

    /// The same with named points.
    fn with_groups(
        points: Vec<[f64; 3]>,
        mut triangles: Vec<[u32; 3]>,
        groups: Vec<Group>,
    ) -> std::result::Result<Self, Leak> {
        if triangles.is_empty() {
            return Err(Leak::Empty);
        }
        let odd = |[a, b, c]: &[u32; 3]| {
            [a, b, c].iter().any(|id| **id as usize >= points.len()) || a == b || b == c || c == a
        };
        if let Some(first) = triangles.iter().position(odd) {
            return Err(Leak::Point(first));
        }
        if let Some(first) = points.iter().position(|x| x.iter().any(|c| !(*c as f32).is_finite())) {
            return Err(Leak::NonFinite(first));
        }
        open(&triangles)?;
        // the points in use, in their order
        let mut new = vec![None; points.len()];
        triangles.as_flattened().iter().for_each(|id| new[*id as usize] = Some(0));
        let mut kept = vec![];
        for (new, point) in new.iter_mut().zip(&points).filter(|(new, _)| new.is_some()) {
            *new = Some(kept.len() as u32);
            kept.push(*point);
        }
        triangles.as_flattened_mut().iter_mut().for_each(|id| *id = new[*id as usize].unwrap_or_default());
        let of_group = |group: &Group| {
            let own: Vec<u32> = group.nodes().iter().filter_map(|id| new[*id as usize]).collect();
            (!own.is_empty()).then(|| Group::new(group.name().to_string(), own))
        };
        let groups = groups.iter().filter_map(of_group).collect();
        // to the origin
        let bound = |axis: usize, by: fn(f64, f64) -> f64| kept.iter().map(|x| x[axis]).reduce(by).unwrap_or_default();
        let (low, high) = ([0, 1, 2].map(|n| bound(n, f64::min)), [0, 1, 2].map(|n| bound(n, f64::max)));
        let origin = [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), low[2]];
        kept.iter_mut().for_each(|x| (0..3).for_each(|n| x[n] -= origin[n]));
        let at = |id: u32| DVec3::from_array(kept[id as usize]);
        let volume = triangles.iter().map(|[a, b, c]| at(*a).dot(at(*b).cross(at(*c))) / 6.0).sum();
        let size = [0, 1, 2].map(|n| high[n] - low[n]);
        let sound = volume > 0.0 && size.iter().all(|edge| *edge > 0.0);
        if sound { Ok(Self { points: kept, triangles, size, volume, groups }) } else { Err(Leak::Inverted) }
    }

    /// The surface with no edge longer than `longest`, m: longer ones are halved, in both of their triangles, until there is none. A middle is of
    /// the groups that both ends are of.
    pub fn refined(&self, longest: f64) -> Cow<'_, Self> {
        let mut out = Cow::Borrowed(self);
        loop {
            let mut middles: BTreeMap<[u32; 2], u32> = BTreeMap::new();
            let at = |id: u32| DVec3::from_array(out.points[id as usize]);
            let mut points = vec![];
            for [a, b] in out.triangles.iter().flat_map(|[a, b, c]| [[a, b], [b, c], [c, a]]) {
                let edge = [*a.min(b), *a.max(b)];
                if at(*a).distance(at(*b)) > longest && !middles.contains_key(&edge) {
                    middles.insert(edge, (out.points.len() + points.len()) as u32);
                    points.push((0.5 * (at(edge[0]) + at(edge[1]))).to_array());
                }
            }
            if middles.is_empty() {
                return out;
            }
            let out = out.to_mut();
            out.points.extend(points);
            out.triangles = out.triangles.iter().flat_map(|triangle| halved(*triangle, &middles)).collect();
            for group in &mut out.groups {
                let own = |id: &u32| group.holds(*id as usize);
                let between = middles.iter().filter(|([a, b], _)| own(a) && own(b)).map(|(_, middle)| *middle);
                *group = Group::new(group.name().to_string(), group.nodes().iter().copied().chain(between).collect());
            }
        }
    }

    /// The surface as it is embedded in a grid of this extent, m, and so many cells along x and y.
    pub fn in_cells(&self, size: [f64; 2], cells: [u32; 2]) -> Cow<'_, Self> {
        self.refined(LONGEST * [0, 1].map(|n| size[n] / f64::from(cells[n])).into_iter().fold(0.0, f64::max))
    }

    /// `[point]` rest position in the body's frame, m.
    pub fn points(&self) -> &[[f64; 3]] {
        &self.points
    }

    /// `[triangle]` points, counter-clockwise from outside.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Edges of the bounding box, m.
    pub fn size(&self) -> [f64; 3] {
        self.size
    }

    /// Enclosed volume, m³.
    pub fn volume(&self) -> f64 {
        self.volume
    }

    /// Named points: of the file's groups of triangles, then of its groups of tetrahedra, as far as they lie on the surface.
    pub fn groups(&self) -> &[Group] {
        &self.groups
    }

    /// True if a point belongs to a region; its `top` and `sides` are where those of the bounding box are.
    pub fn point_is_in(&self, point: usize, region: &Region) -> bool {
        let [x, y, thickness] = self.size;
        match region {
            // by its name, since halved edges have added points
            Region::Group(group) => self.groups.iter().any(|own| own.name() == group.name() && own.holds(point)),
            _ => region.holds(self.points[point], [x, y], thickness),
        }
    }

    /// Parts of a triangle of its points that belong to a region.
    pub fn parts_in(&self, region: &Region, triangle: [u32; 3]) -> Vec<TrianglePart> {
        let [x, y, thickness] = self.size;
        let inside = triangle.map(|id| self.point_is_in(id as usize, region));
        region.parts_of_triangle(triangle.map(|id| self.points[id as usize]), inside, [x, y], thickness)
    }

    /// True if a region holds the corners of a triangle, as halved in a grid of this extent, m, and so many cells along x and y.
    pub(super) fn has_triangle_in(&self, region: &Region, size: [f64; 2], cells: [u32; 2]) -> bool {
        let holds = |of: &Self| {
            of.triangles.iter().any(|corners| corners.iter().all(|id| of.point_is_in(*id as usize, region)))
        };
        // whole ones first, which is soon done on any grid
        holds(self) || holds(&self.in_cells(size, cells))
    }

    /// First part of a body that does not fit its surface: the part, what was found, what has to be.
    pub(super) fn misfit(&self, skin: &Skin) -> Option<(String, String, &'static str)> {
        let covers = beyond(self, skin.size, skin.thickness()).is_none();
        let large = matches!(skin.law, Law::Hyperelastic(_));
        let parts = [
            (
                covers,
                "size, layers.thickness",
                format!("{:?}, {}", skin.size, skin.thickness()),
                "a box around `embedded`",
            ),
            (large, "law", "of small strains or springs".into(), "a hyperelastic one with `embedded`"),
            (skin.mass == Mass::Lumped, "mass", format!("{:?}", skin.mass), "lumped with `embedded`"),
            (skin.cut == super::Cut::Remove, "cut", "split".into(), "`Cut::Remove` with `embedded`, which is not cut"),
            (skin.mesh.is_none(), "mesh", "given too".into(), "none with `embedded`"),
        ];
        let odd = parts.into_iter().find(|(fits, ..)| !fits);
        odd.map(|(_, part, found, wanted)| (part.to_string(), found, wanted))
    }
}

/// Edges that are not passed equally often both ways.
fn open(triangles: &[[u32; 3]]) -> std::result::Result<(), Leak> {
    let sides = triangles.iter().flat_map(|[a, b, c]| [[*a, *b], [*b, *c], [*c, *a]]);
    let mut sides: Vec<([u32; 2], bool)> = sides.map(|[a, b]| ([a.min(b), a.max(b)], a < b)).collect();
    sides.sort_unstable();
    let uneven = |side: &&[([u32; 2], bool)]| 2 * side.iter().filter(|(_, forward)| *forward).count() != side.len();
    let mut found = sides.chunk_by(|a, b| a.0 == b.0).filter(uneven);
    match found.next() {
        None => Ok(()),
        Some(first) => Err(Leak::Open(1 + found.count(), first[0].0)),
    }
}

/// Rounding between a size in mm and a mesh in m, relative.
const ROUNDED: f64 = 1e-9;

/// First axis along which a grid ends within a surface: its letter, extents of the surface and of the grid, m.
pub(super) fn beyond(surface: &ClosedSurface, [x, y]: [f64; 2], thickness: f64) -> Option<(char, f64, f64)> {
    let ends = [('x', x), ('y', y), ('z', thickness)];
    let all = ends.into_iter().zip(surface.size()).map(|((axis, grid), own)| (axis, own, grid));
    all.into_iter().find(|(_, own, grid)| *own > grid * (1.0 + ROUNDED))
}

/// The surface of a mesh file: its triangles, or, where it has tetrahedra, their boundary; `unit` is one unit of the file in m.
pub(super) fn read(scene: &SceneText, files: &Files, name: &At<String>, unit: f64) -> Result<ClosedSurface> {
    let (path, mesh) = files.mesh(scene, name)?;
    let Mesh { points, triangles, tetrahedra, .. } = &mesh;
    let triangles = match tetrahedra.is_empty() {
        true => triangles.clone(),
        false => mesh.boundary().into_iter().map(|(triangle, _)| triangle).collect(),
    };
    let points = points.iter().map(|x| x.map(|c| c * unit)).collect();
    ClosedSurface::with_groups(points, triangles, groups(&mesh)).map_err(|leak| unfit(scene, name, path, leak))
}

fn unfit(scene: &SceneText, name: &At<String>, path: PathBuf, leak: Leak) -> Invalid {
    Invalid::BodyMesh { at: scene.location(name.span()), path, found: leak.to_string(), mend: leak.mend().into() }
}

/// The error of a grid that ends within its surface.
pub(super) fn too_small(at: Location, (axis, own, grid): (char, f64, f64)) -> Invalid {
    Invalid::EmbeddedSize { at, axis, own: in_mm(own), grid: in_mm(grid) }
}

/// Refuses what a scene asks of embedded bodies that they do not have.
pub(super) fn fits(scene: &Scene) -> Result<()> {
    if scene.skins.iter().all(|skin| skin.embedded.is_none()) {
        return Ok(());
    }
    let refuse = |at: String, what: String, fix| Err(Invalid::Embedded { at, what, fix });
    let file = scene.file.display().to_string();
    if let Some(tool) = scene.tools.iter().find(|tool| tool.blade.is_some()) {
        let fix = "it is not cut: leave the blade or `embed` out; a tool without a blade presses it";
        return refuse(file, format!("the blade of {}", tool.name), fix);
    }
    if scene.time.integrator == Integrator::SymplecticEuler {
        let fix = "cells of small shares would make the step short; take \"implicit_euler\"";
        return refuse(scene.at(STEP), "integrator = \"symplectic_euler\"".into(), fix);
    }
    let embedded = |body: usize| scene.skins[body].embedded.is_some();
    let of_faces = |probe: &&Probe| matches!(probe.kind, ProbeKind::Pressure { body, .. } if embedded(body));
    if let Some(probe) = scene.probes.iter().find(of_faces) {
        let fix = "take kind = \"force\" of the tool that presses";
        return refuse(file, format!("the probe {} of pressure", probe.name), fix);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halved_triangles_are_of_the_regions_and_groups_that_the_whole_ones_are_of() {
        // a plate of 8 × 6 × 1 mm of twelve triangles, its upper corners a group
        let corner = |k: u32| [8e-3 * f64::from(k & 1), 6e-3 * f64::from(k >> 1 & 1), 1e-3 * f64::from(k >> 2)];
        let points = (0..8).map(corner).collect();
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
        let top = Group::new("top".into(), vec![4, 5, 6, 7]);
        let plate = ClosedSurface::with_groups(points, triangles, vec![top.clone()]).unwrap_or_else(|e| panic!("{e}"));
        let fine = plate.in_cells([8e-3, 6e-3], [8, 6]);
        let area = |surface: &ClosedSurface, region: &Region| {
            let at = |id: u32| DVec3::from_array(surface.points[id as usize]);
            let inside = |corners: &&[u32; 3]| corners.iter().all(|id| surface.point_is_in(*id as usize, region));
            let own = |[a, b, c]: &[u32; 3]| 0.5 * (at(*b) - at(*a)).cross(at(*c) - at(*a)).length();
            surface.triangles.iter().filter(inside).map(own).sum::<f64>()
        };
        let group = Region::Group(top);
        for surface in [&plate, &*fine] {
            assert!((area(surface, &group) / 48e-6 - 1.0).abs() < 1e-12, "{} triangles", surface.triangles.len());
        }
        assert!(fine.triangles.len() > 100);
        // a part that has no whole triangle of the file
        let middle = Region::Sphere { centre: [0.0, 0.0, 1e-3], radius: 2.5e-3 };
        assert!(area(&plate, &middle) == 0.0 && area(&fine, &middle) > 4e-6, "{:e}", area(&fine, &middle));
        assert!(plate.has_triangle_in(&middle, [8e-3, 6e-3], [8, 6]));
        assert!(!plate.has_triangle_in(&middle, [8e-3, 6e-3], [1, 1]));
    }
}
