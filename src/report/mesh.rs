//! What a mesh file holds: counts, sizes, quality, components, boundary, defects; and a mesh without its defects.
//!
//! Aspect ratio of a tetrahedron: longest edge over the least height, divided by √1.5, so that a regular one has 1. Dihedral angles are those
//! between its faces, `cos θ = −n_i·n_j` of outward normals. A tetrahedron counts as degenerate below 1e-12 of the volume of a regular one of
//! its longest edge: rounding of its corners to f64 decides its sign there.
//! Source: Shewchuk 2002, What is a good linear element?, section 6.

use crate::error::Result;
use crate::formats::{Encoding, Face, Format, Mesh, faces, write};
use crate::math::elementary::acos;
use crate::output::{Failed, replace};
use crate::view::{self, Camera, Outline, Paint, Surface};
use glam::DVec3;
use serde::Serialize;
use std::collections::{HashMap, HashSet};
use std::path::Path;

/// Least volume, relative to a regular tetrahedron of the same longest edge.
const DEGENERATE: f64 = 1e-12;
/// Bins of the histogram of aspect ratios, by their upper ends; the last one is open.
const ASPECTS: [f64; 6] = [1.5, 2.0, 3.0, 5.0, 10.0, f64::INFINITY];
/// Bins of dihedral angles over 180°.
const ANGLES: usize = 18;

/// Report on a mesh; lengths, areas and volumes are in powers of the file's unit.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// Number of points.
    pub points: usize,
    /// Number of tetrahedra, with the ones that others were split into.
    pub tetrahedra: usize,
    /// The same of triangles.
    pub triangles: usize,
    /// Cells of other shapes: quadrilaterals and solids, which were split; points and lines, which were left out.
    pub others: Vec<(&'static str, usize)>,
    /// Physical groups and tags in use.
    pub regions: Vec<Region>,
    /// Least coordinates of points.
    pub low: [f64; 3],
    /// Largest coordinates of points.
    pub high: [f64; 3],
    /// Sum of the signed volumes of the tetrahedra; that enclosed by the triangles, if there are none.
    pub volume: f64,
    /// Area of the surface: the boundary of the tetrahedra, or the triangles, if there are none.
    pub area: f64,
    /// Parts of cells that share no point.
    pub components: usize,
    /// Surface.
    pub boundary: Boundary,
    /// Quality of the tetrahedra; none without them.
    pub quality: Option<Quality>,
    /// What is wrong.
    pub defects: Vec<Defect>,
}

/// Cells of a region.
#[derive(Clone, Debug, Serialize)]
pub struct Region {
    /// 2 triangles, 3 tetrahedra.
    pub dimension: u8,
    /// Number.
    pub tag: i32,
    /// Name of the physical group; empty without one.
    pub name: String,
    /// Number of cells.
    pub cells: usize,
}

/// Boundary of the tetrahedra, or the triangles.
#[derive(Clone, Debug, Serialize)]
pub struct Boundary {
    /// Number of triangles.
    pub triangles: usize,
    /// Number of edges.
    pub edges: usize,
    /// No edge is open.
    pub closed: bool,
}

/// Shapes of tetrahedra, degenerate ones left out.
#[derive(Clone, Debug, Serialize)]
pub struct Quality {
    /// Largest aspect ratio.
    pub aspect_max: f64,
    /// Number of tetrahedra with an aspect ratio below 1.5, 2, 3, 5, 10, and above.
    pub aspect: [usize; ASPECTS.len()],
    /// Least dihedral angle, degrees.
    pub angle_min: f64,
    /// Largest dihedral angle, degrees.
    pub angle_max: f64,
    /// Number of dihedral angles in each 10°.
    pub angles: [usize; ANGLES],
}

/// Something wrong with a mesh.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Defect {
    /// What.
    pub name: &'static str,
    /// How many.
    pub count: usize,
    /// The first one: points or cells from 0.
    pub first: String,
    /// What comes of it, and what `--mend` does about it.
    pub effect: &'static str,
}

/// Triangles that bound a mesh: of its tetrahedra, or, without them, those of the file.
pub fn surface(mesh: &Mesh) -> (Vec<[u32; 3]>, Vec<i32>) {
    match mesh.tetrahedra.is_empty() {
        true => (mesh.triangles.clone(), mesh.triangle_regions.clone()),
        false => mesh.boundary().into_iter().unzip(),
    }
}

/// Examines a mesh. The peak of memory is some 100 bytes a tetrahedron.
pub fn summary(mesh: &Mesh) -> Summary {
    let (skin, _) = surface(mesh);
    let edges = edges(&skin);
    let bound = |start: f64, by: fn(f64, f64) -> f64| {
        mesh.points.iter().fold([start; 3], |sum, p| [0, 1, 2].map(|k| by(sum[k], p[k])))
    };
    let at = |id: u32| DVec3::from(mesh.points[id as usize]);
    let signed = |[a, b, c]: &[u32; 3]| at(*a).dot(at(*b).cross(at(*c))) / 6.0;
    let open = edges.iter().filter(|edge| edge.forward != edge.backward || edge.count() < 2).count();
    Summary {
        points: mesh.points.len(),
        tetrahedra: mesh.tetrahedra.len(),
        triangles: mesh.triangles.len(),
        others: mesh.others.iter().map(|(cell, count)| (cell.name(), *count)).collect(),
        regions: regions(mesh),
        low: bound(f64::INFINITY, f64::min),
        high: bound(f64::NEG_INFINITY, f64::max),
        volume: match mesh.tetrahedra.is_empty() {
            true => skin.iter().map(signed).sum(),
            false => mesh.tetrahedra.iter().map(|nodes| mesh.volume(nodes)).sum(),
        },
        area: skin.iter().map(|[a, b, c]| 0.5 * (at(*b) - at(*a)).cross(at(*c) - at(*a)).length()).sum(),
        components: components(mesh),
        boundary: Boundary { triangles: skin.len(), edges: edges.len(), closed: open == 0 },
        quality: (!mesh.tetrahedra.is_empty()).then(|| quality(mesh)),
        defects: defects(mesh, &edges),
    }
}

fn regions(mesh: &Mesh) -> Vec<Region> {
    let mut out: Vec<Region> = vec![];
    for (dimension, tags) in [(2, &mesh.triangle_regions), (3, &mesh.tetrahedron_regions)] {
        let mut tags = tags.clone();
        tags.sort_unstable();
        for same in tags.chunk_by(|a, b| a == b).filter(|same| same[0] != 0) {
            let group = mesh.groups.iter().find(|group| (group.dimension, group.tag) == (dimension, same[0]));
            let name = group.map(|group| group.name.clone()).unwrap_or_default();
            out.push(Region { dimension, tag: same[0], name, cells: same.len() });
        }
    }
    out
}

/// Parts of cells that share no point, by union of point ids.
fn components(mesh: &Mesh) -> usize {
    let mut parent: Vec<u32> = (0..mesh.points.len() as u32).collect();
    fn root(parent: &mut [u32], mut id: u32) -> u32 {
        while parent[id as usize] != id {
            // halves the way for the next one
            parent[id as usize] = parent[parent[id as usize] as usize];
            id = parent[id as usize];
        }
        id
    }
    let mut used = vec![false; mesh.points.len()];
    let cells = mesh.tetrahedra.iter().map(|nodes| &nodes[..]).chain(mesh.triangles.iter().map(|nodes| &nodes[..]));
    for nodes in cells {
        let first = root(&mut parent, nodes[0]);
        for id in nodes {
            used[*id as usize] = true;
            let other = root(&mut parent, *id);
            parent[other as usize] = first;
        }
    }
    (0..parent.len()).filter(|id| used[*id] && parent[*id] as usize == *id).count()
}

/// Edge of the surface, with the triangles that pass it towards the larger and the smaller id.
struct Edge {
    ids: [u32; 2],
    forward: usize,
    backward: usize,
}

impl Edge {
    fn count(&self) -> usize {
        self.forward + self.backward
    }
}

fn edges(triangles: &[[u32; 3]]) -> Vec<Edge> {
    let sides = triangles.iter().flat_map(|[a, b, c]| [[a, b], [b, c], [c, a]]);
    let mut sides: Vec<([u32; 2], bool)> = sides.map(|[a, b]| ([*a.min(b), *a.max(b)], a < b)).collect();
    sides.sort_unstable();
    let of_edge = sides.chunk_by(|a, b| a.0 == b.0);
    let edge = |same: &[([u32; 2], bool)]| {
        let forward = same.iter().filter(|(_, forward)| *forward).count();
        Edge { ids: same[0].0, forward, backward: same.len() - forward }
    };
    of_edge.map(edge).collect()
}

/// Longest edge, outward normals times twice the areas, and signed volume of a tetrahedron.
fn shape(mesh: &Mesh, nodes: &[u32; 4]) -> (f64, [DVec3; 4], f64) {
    let [a, b, c, d] = nodes.map(|id| DVec3::from(mesh.points[id as usize]));
    let longest = [a - b, a - c, a - d, b - c, b - d, c - d].into_iter().map(DVec3::length).fold(0.0, f64::max);
    let normals = [(c - b).cross(d - b), (d - a).cross(c - a), (b - a).cross(d - a), (c - a).cross(b - a)];
    (longest, normals, mesh.volume(nodes))
}

/// Whether a tetrahedron is not degenerate; false for lengths beyond f64.
fn has_volume(mesh: &Mesh, nodes: &[u32; 4]) -> bool {
    let (longest, _, volume) = shape(mesh, nodes);
    // a regular one has a volume of edge³ / 6√2
    let regular = longest.powi(3) / (6.0 * std::f64::consts::SQRT_2);
    volume.abs() > DEGENERATE * regular
}

/// The same of a triangle and its area.
fn has_area(mesh: &Mesh, nodes: &[u32; 3]) -> bool {
    let [a, b, c] = nodes.map(|id| DVec3::from(mesh.points[id as usize]));
    let longest = (b - a).length().max((c - a).length()).max((c - b).length());
    (b - a).cross(c - a).length() > DEGENERATE * longest * longest
}

fn quality(mesh: &Mesh) -> Quality {
    let mut q =
        Quality { aspect_max: 0.0, aspect: [0; ASPECTS.len()], angle_min: 180.0, angle_max: 0.0, angles: [0; ANGLES] };
    for nodes in mesh.tetrahedra.iter().filter(|nodes| has_volume(mesh, nodes)) {
        let (longest, normals, volume) = shape(mesh, nodes);
        let largest = normals.iter().map(|n| n.length()).fold(0.0, f64::max);
        // least height = 6 |V| / (2 × largest face)
        let aspect = longest * largest / (6.0 * volume.abs()) / 1.5f64.sqrt();
        q.aspect_max = q.aspect_max.max(aspect);
        q.aspect[ASPECTS.iter().position(|end| aspect < *end).unwrap_or(ASPECTS.len() - 1)] += 1;
        for (i, j) in [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)] {
            let cosine = -normals[i].normalize_or_zero().dot(normals[j].normalize_or_zero());
            let angle = acos(cosine.clamp(-1.0, 1.0)).to_degrees();
            (q.angle_min, q.angle_max) = (q.angle_min.min(angle), q.angle_max.max(angle));
            q.angles[((angle / 180.0 * ANGLES as f64) as usize).min(ANGLES - 1)] += 1;
        }
    }
    q
}

/// Distance below which points are at one position, in diagonals of the mesh: what files in single precision round, times ten.
const SAME: f64 = 1e-6;
/// Width of the cells that points are looked up in, in such distances: most points are farther than one from all borders.
const LOOKED_UP: f64 = 64.0;

/// `[point]` the first point at its position.
fn first_of(points: &[[f64; 3]]) -> Vec<u32> {
    let all = || points.iter().map(|p| DVec3::from(*p));
    let (low, high) = all().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
    let same = (SAME * (high - low).length()).max(f64::MIN_POSITIVE);
    let mut known: HashMap<[i64; 3], Vec<u32>> = HashMap::with_capacity(points.len());
    let mut out: Vec<u32> = Vec::with_capacity(points.len());
    for (id, p) in (0..).zip(all()) {
        // points that stand for themselves, in all cells that the distance reaches
        let cell = |at: DVec3| ((at - low) / (LOOKED_UP * same)).floor().as_i64vec3().to_array();
        let [from, to] = [cell(p - same), cell(p + same)];
        let cells = (from[0]..=to[0])
            .flat_map(|x| (from[1]..=to[1]).flat_map(move |y| (from[2]..=to[2]).map(move |z| [x, y, z])));
        let near = cells.filter_map(|cell| known.get(&cell)).flatten().copied();
        let found = near.filter(|other| DVec3::from(points[*other as usize]).distance(p) <= same).min();
        if found.is_none() {
            known.entry(cell(p)).or_default().push(id);
        }
        out.push(found.unwrap_or(id));
    }
    out
}

/// Ids in ascending order.
fn sorted<const N: usize>(nodes: &[u32; N]) -> [u32; N] {
    let mut nodes = *nodes;
    nodes.sort_unstable();
    nodes
}

/// Number of cells with the points of another one before them, and the first.
fn repeated<const N: usize>(cells: &[[u32; N]]) -> (usize, Option<usize>) {
    let mut all: Vec<([u32; N], u32)> = cells.iter().map(sorted).zip(0..).collect();
    all.sort_unstable();
    let again = all.windows(2).filter(|pair| pair[0].0 == pair[1].0).map(|pair| pair[1].1 as usize);
    (again.clone().count(), again.min())
}

fn defects(mesh: &Mesh, edges: &[Edge]) -> Vec<Defect> {
    let mut used = vec![false; mesh.points.len()];
    mesh.tetrahedra.as_flattened().iter().chain(mesh.triangles.as_flattened()).for_each(|id| used[*id as usize] = true);
    // points
    let first = first_of(&mesh.points);
    let of_points = |holds: &mut dyn FnMut(usize) -> bool| {
        let found = (0..mesh.points.len()).filter(|id| holds(*id)).collect::<Vec<_>>();
        (found.len(), found.first().copied())
    };
    let unused = of_points(&mut |id| !used[id]);
    let equal = of_points(&mut |id| first[id] as usize != id);
    // tetrahedra and triangles
    let of_solids = |holds: &dyn Fn(&[u32; 4]) -> bool| {
        let mut found = mesh.tetrahedra.iter().enumerate().filter(|(_, nodes)| holds(nodes)).map(|(k, _)| k);
        let first = found.next();
        (found.count() + usize::from(first.is_some()), first)
    };
    let flat = of_solids(&|nodes| !has_volume(mesh, nodes));
    let inverted = of_solids(&|nodes| mesh.volume(nodes) < 0.0 && has_volume(mesh, nodes));
    let thin: Vec<usize> = (0..mesh.triangles.len()).filter(|k| !has_area(mesh, &mesh.triangles[*k])).collect();
    // faces and edges between them
    let mut all = faces(&mesh.tetrahedra);
    all.sort_unstable();
    let crowded = all.chunk_by(|a: &Face, b: &Face| a.0 == b.0).filter(|same| same.len() > 2);
    let crowded: Vec<[u32; 3]> = crowded.map(|same| same[0].0).collect();
    let of_edges =
        |holds: fn(&Edge) -> bool| edges.iter().filter(|edge| holds(edge)).map(|e| e.ids).collect::<Vec<_>>();
    let (many, open) = (of_edges(|edge| edge.count() > 2), of_edges(|edge| edge.count() == 1));
    let against = of_edges(|edge| edge.count() == 2 && edge.forward != 1);
    // name, number and first, effect and remedy
    let id = |what: &str, (count, first): (usize, Option<usize>)| {
        (count, first.map(|first| format!("{what} {first}")).unwrap_or_default())
    };
    let ids = |list: &[[u32; 2]]| (list.len(), list.first().map(|ids| format!("points {ids:?}")).unwrap_or_default());
    let face = crowded.first().map(|ids| format!("points {ids:?}")).unwrap_or_default();
    let list = [
        ("unused points", id("point", unused), "nothing holds them; --mend leaves them out"),
        (
            "points at the position of another",
            id("point", equal),
            "cells beside each other do not hang together; --mend joins them",
        ),
        ("inverted tetrahedra", id("tetrahedron", inverted), "their stiffness has the wrong sign; --mend turns them"),
        ("degenerate tetrahedra", id("tetrahedron", flat), "they have no rest shape; --mend leaves them out"),
        (
            "repeated tetrahedra",
            id("tetrahedron", repeated(&mesh.tetrahedra)),
            "mass and stiffness count twice; --mend leaves them out",
        ),
        ("repeated triangles", id("triangle", repeated(&mesh.triangles)), "area counts twice; --mend leaves them out"),
        (
            "degenerate triangles",
            id("triangle", (thin.len(), thin.first().copied())),
            "they have no normal; --mend leaves them out",
        ),
        ("faces of more than two tetrahedra", (crowded.len(), face), "tetrahedra overlap; mesh the solid again"),
        (
            "edges of more than two triangles of the surface",
            ids(&many),
            "parts touch along an edge and share its points; mesh it again if that is not meant",
        ),
        (
            "open edges of the surface",
            ids(&open),
            "the surface has a hole, and encloses no volume; close it in the modeller",
        ),
        (
            "edges between triangles of opposite orientation",
            ids(&against),
            "inside and outside differ; orient the surface in the modeller",
        ),
    ];
    let defect = |(name, (count, first), effect)| Defect { name, count, first, effect };
    list.into_iter().map(defect).filter(|defect| defect.count > 0).collect()
}

/// The mesh without what `--mend` leaves out, joins or turns; the order of what stays is kept.
pub fn mended(mesh: &Mesh) -> Mesh {
    // points at one position become the first of them
    let joined = first_of(&mesh.points);
    let mut out = Mesh { points: mesh.points.clone(), groups: mesh.groups.clone(), ..Mesh::default() };
    let mut known = HashSet::new();
    for (nodes, region) in mesh.tetrahedra.iter().zip(&mesh.tetrahedron_regions) {
        let mut nodes = nodes.map(|id| joined[id as usize]);
        if !has_volume(mesh, &nodes) || !known.insert(sorted(&nodes)) {
            continue;
        }
        if mesh.volume(&nodes) < 0.0 {
            nodes.swap(2, 3);
        }
        out.tetrahedra.push(nodes);
        out.tetrahedron_regions.push(*region);
    }
    let mut known = HashSet::new();
    for (nodes, region) in mesh.triangles.iter().zip(&mesh.triangle_regions) {
        let nodes = nodes.map(|id| joined[id as usize]);
        if has_area(mesh, &nodes) && known.insert(sorted(&nodes)) {
            out.triangles.push(nodes);
            out.triangle_regions.push(*region);
        }
    }
    // points in use, in their order
    let mut new = vec![u32::MAX; mesh.points.len()];
    let cells = out.tetrahedra.as_flattened().iter().chain(out.triangles.as_flattened());
    cells.for_each(|id| new[*id as usize] = 0);
    out.points.clear();
    for (id, new) in new.iter_mut().enumerate().filter(|(_, new)| **new == 0) {
        *new = out.points.len() as u32;
        out.points.push(mesh.points[id]);
    }
    let cells = out.tetrahedra.as_flattened_mut().iter_mut().chain(out.triangles.as_flattened_mut());
    cells.for_each(|id| *id = new[*id as usize]);
    out
}

/// Writes a mesh by the ending of its name, atomically.
///
/// # Errors
/// For an ending that is not written, or a file that cannot be.
pub fn save(mesh: &Mesh, encoding: Encoding, path: &Path) -> Result<()> {
    replace(path, &write(mesh, Format::of(path)?, encoding, path)?)
}

/// Size of a picture, pixels.
const PICTURE: [u32; 2] = [960, 720];
/// Diagonal that a mesh is drawn with, m: light and lines are made for bodies of this size.
const DIAGONAL: f64 = 0.06;
/// Colours of regions, in turn; the first is that of cells without one.
const COLORS: [[u8; 3]; 7] = [
    [205, 160, 140],
    [224, 190, 160],
    [190, 110, 100],
    [226, 204, 120],
    [130, 160, 190],
    [150, 185, 140],
    [180, 140, 190],
];

/// Draws the surface, coloured by region, with its edges, into a PNG file.
///
/// # Errors
/// If there is no memory for it, or it cannot be written.
pub fn picture(mesh: &Mesh, summary: &Summary, path: &Path) -> Result<()> {
    let (low, high) = (DVec3::from(summary.low), DVec3::from(summary.high));
    let (centre, diagonal) = (low.midpoint(high), (high - low).length());
    let scale = if diagonal > 0.0 { DIAGONAL / diagonal } else { 1.0 };
    let positions: Vec<[f64; 3]> =
        mesh.points.iter().map(|p| ((DVec3::from(*p) - centre) * scale).to_array()).collect();
    let (triangles, regions) = surface(mesh);
    let colors: Vec<[u8; 3]> = regions.iter().map(|r| COLORS[r.unsigned_abs() as usize % COLORS.len()]).collect();
    let lines: Vec<[u32; 2]> = edges(&triangles).iter().map(|edge| edge.ids).collect();
    // lines are left out where they would cover the faces
    let drawn = if lines.len() < 60_000 { &lines[..] } else { &[] };
    let outline = [Outline { lines: drawn, width: 0.7, ink: [0.45; 3] }];
    let (outlines, shininess) = (&outline[..], 14.0);
    let surface = Surface {
        positions: &positions,
        triangles: &triangles,
        colors: Paint::Triangles(&colors),
        smooth: false,
        outlines,
        shininess,
    };
    // from the front, above, to the right; the whole diagonal fits
    let eye = (DVec3::new(0.5, -0.75, 0.5).normalize() * 2.6 * DIAGONAL).to_array();
    let camera = Camera { eye, target: [0.0; 3], up: [0.0, 0.0, 1.0], field_of_view_deg: 25.0 };
    let name = format!("{} tetrahedra, {} triangles", summary.tetrahedra, triangles.len());
    let image = view::render(&[surface], &camera, PICTURE[0], PICTURE[1], &[&name])?;
    let bytes = view::png(&image).map_err(|source| Failed::Write { path: path.to_owned(), source })?;
    replace(path, &bytes)
}
