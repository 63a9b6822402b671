//! Bodies made of the tetrahedra of a mesh file: the mesh in SI units, its checks, and how a scene takes it from a file.
//!
//! Like a grid, the mesh stands on the origin of its body's frame: the middle of the bottom of its bounding box is put there. A mesh that
//! already stands so keeps its coordinates.

use super::files::Files;
use super::invalid::{Invalid, Result};
use super::limits::{LONGEST, MOST_NODES};
use super::raw::At;
use super::region::{Group, Region};
use super::text::{SceneText, shorten};
use super::{Layer, Skin, TrianglePart};
use crate::formats::{self, Mesh, faces};
use crate::math::elementary::cbrt;
use glam::DVec3;
use std::collections::BTreeSet;
use std::fmt;
use std::sync::OnceLock;

/// Most names of groups in a message.
const NAMED: usize = 12;

/// Tetrahedra that a body is made of: each node is in one of them, each tetrahedron is positive and no sliver, no face has more than two.
#[derive(Clone, Debug, PartialEq)]
pub struct TetrahedralMesh {
    nodes: Vec<[f64; 3]>,
    tetrahedra: Vec<[u32; 4]>,
    layers: Vec<u32>,
    size: [f64; 3],
    groups: Vec<Group>,
    fitted: Fitted,
}

/// `[layer][spring]` stiffnesses of the springs along the edges, N/m per Pa, once they are known. They follow from the mesh: equal meshes are
/// equal with and without.
#[derive(Clone, Debug, Default)]
struct Fitted(OnceLock<Vec<Vec<f64>>>);

impl PartialEq for Fitted {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// What is wrong with tetrahedra.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Defect {
    /// There are none.
    Empty,
    /// Not one layer per tetrahedron.
    Layers,
    /// A tetrahedron names a node that is not there.
    Node(usize),
    /// A coordinate of a node is beyond the range of f32, in m.
    NonFinite(usize),
    /// Nodes that no tetrahedron has: their number, the first.
    Unused(usize, usize),
    /// Tetrahedra of negative volume: their number, the first.
    Inverted(usize, usize),
    /// Tetrahedra 10⁴ times as long as high, or without volume: their number, the first.
    Slivers(usize, usize),
    /// Faces of more than two tetrahedra: their number, a tetrahedron of the first.
    Crowded(usize, usize),
}

impl fmt::Display for Defect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Empty => write!(f, "it has no tetrahedron"),
            Self::Layers => write!(f, "it has another number of layers than of tetrahedra"),
            Self::Node(first) => write!(f, "tetrahedron {first} (from 0) has a node that is not there"),
            Self::NonFinite(first) => write!(f, "point {first} (from 0) is beyond the range of f32, in metres"),
            Self::Unused(count, first) => {
                write!(f, "{count} of its points are in no tetrahedron, first point {first} (from 0)")
            }
            Self::Inverted(count, first) => {
                write!(f, "{count} of its tetrahedra are inverted, first tetrahedron {first} (from 0)")
            }
            Self::Slivers(count, first) => write!(
                f,
                "{count} of its tetrahedra are flat, {LONGEST} times as long as high or more, first tetrahedron {first} (from 0)"
            ),
            Self::Crowded(count, first) => {
                write!(f, "{count} of its faces have more than two tetrahedra, first at tetrahedron {first} (from 0)")
            }
        }
    }
}

impl Defect {
    /// How to mend it in a file.
    fn mend(self) -> &'static str {
        match self {
            Self::Empty | Self::Layers | Self::Node(_) | Self::NonFinite(_) => {
                "export the volume's tetrahedra too (Gmsh: `gmsh -3`, with a physical volume)"
            }
            Self::Unused(..) => "`cutis mesh FILE --mend --out NEW` leaves them out",
            Self::Inverted(..) => "`cutis mesh FILE --mend --out NEW` turns them",
            Self::Slivers(..) => "let the mesh generator optimise the mesh; `cutis mesh FILE` shows the quality",
            Self::Crowded(..) => "`cutis mesh FILE` shows them; `--mend` leaves repeated tetrahedra out",
        }
    }
}

impl TetrahedralMesh {
    /// A mesh of `nodes`, m, of tetrahedra in positive orientation and the layer of each. The middle of the bottom of the bounding box
    /// becomes the origin.
    ///
    /// # Errors
    /// The first [`Defect`].
    pub fn new(nodes: Vec<[f64; 3]>, tetrahedra: Vec<[u32; 4]>, layers: Vec<u32>) -> std::result::Result<Self, Defect> {
        if tetrahedra.is_empty() {
            return Err(Defect::Empty);
        }
        if layers.len() != tetrahedra.len() {
            return Err(Defect::Layers);
        }
        let beyond = |corners: &[u32; 4]| corners.iter().any(|id| *id as usize >= nodes.len());
        if let Some(first) = tetrahedra.iter().position(beyond) {
            return Err(Defect::Node(first));
        }
        if let Some(first) = nodes.iter().position(|x| x.iter().any(|c| !(*c as f32).is_finite())) {
            return Err(Defect::NonFinite(first));
        }
        // counts of what holds, with the first
        let count = |found: Vec<usize>| found.first().map(|first| (found.len(), *first));
        let mut used = vec![false; nodes.len()];
        tetrahedra.as_flattened().iter().for_each(|id| used[*id as usize] = true);
        if let Some((count, first)) = count((0..nodes.len()).filter(|id| !used[*id]).collect()) {
            return Err(Defect::Unused(count, first));
        }
        let of = |holds: fn(&Shape) -> bool| {
            let shape = |e: &usize| holds(&Shape::of(tetrahedra[*e].map(|id| nodes[id as usize])));
            count((0..tetrahedra.len()).filter(shape).collect())
        };
        if let Some((count, first)) = of(Shape::is_sliver) {
            return Err(Defect::Slivers(count, first));
        }
        if let Some((count, first)) = of(|shape| shape.volume < 0.0) {
            return Err(Defect::Inverted(count, first));
        }
        let mut all = faces(&tetrahedra);
        all.sort_unstable();
        let crowded = all.chunk_by(|a, b| a.0 == b.0).filter(|same| same.len() > 2);
        if let Some((count, first)) = count(crowded.map(|same| same[0].1 as usize / 4).collect()) {
            return Err(Defect::Crowded(count, first));
        }
        Ok(Self::placed(nodes, tetrahedra, layers))
    }

    /// Moves the middle of the bottom to the origin.
    fn placed(mut nodes: Vec<[f64; 3]>, tetrahedra: Vec<[u32; 4]>, layers: Vec<u32>) -> Self {
        let bound = |axis: usize, by: fn(f64, f64) -> f64| nodes.iter().map(|x| x[axis]).reduce(by).unwrap_or_default();
        let (low, high) = ([0, 1, 2].map(|n| bound(n, f64::min)), [0, 1, 2].map(|n| bound(n, f64::max)));
        let origin = [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), low[2]];
        nodes.iter_mut().for_each(|x| (0..3).for_each(|n| x[n] -= origin[n]));
        let size = [0, 1, 2].map(|n| high[n] - low[n]);
        Self { nodes, tetrahedra, layers, size, groups: vec![], fitted: Fitted::default() }
    }

    /// `[node]` rest position in the body's frame, m.
    pub fn nodes(&self) -> &[[f64; 3]] {
        &self.nodes
    }

    /// `[tetrahedron]` nodes, in positive orientation.
    pub fn tetrahedra(&self) -> &[[u32; 4]] {
        &self.tetrahedra
    }

    /// `[tetrahedron]` layer of the body.
    pub fn layers(&self) -> &[u32] {
        &self.layers
    }

    /// `[layer][spring]` what `fit` finds for springs along the edges, N/m per Pa; it is asked once.
    ///
    /// # Errors
    /// Those of `fit`.
    pub(crate) fn fitted_springs<E>(
        &self,
        fit: impl FnOnce() -> std::result::Result<Vec<Vec<f64>>, E>,
    ) -> std::result::Result<&[Vec<f64>], E> {
        if let Some(known) = self.fitted.0.get() {
            return Ok(known);
        }
        let found = fit()?;
        Ok(self.fitted.0.get_or_init(|| found))
    }

    /// Edge of a cube of six mean tetrahedra, m.
    pub fn cell_width(&self) -> f64 {
        let volume: f64 = (0..self.tetrahedra.len()).map(|e| self.volume(e)).sum();
        cbrt(6.0 * volume / self.tetrahedra.len() as f64)
    }

    /// Edges of the bounding box, m.
    pub fn size(&self) -> [f64; 3] {
        self.size
    }

    /// Named nodes: of the file's groups of triangles, then of its groups of tetrahedra.
    pub fn groups(&self) -> &[Group] {
        &self.groups
    }

    /// Rest positions of the corners of a tetrahedron, m.
    pub fn corners(&self, e: usize) -> [[f64; 3]; 4] {
        self.tetrahedra[e].map(|id| self.nodes[id as usize])
    }

    /// Corners of the tetrahedra around some nodes, both in ascending order.
    pub fn nodes_around(&self, nodes: &[u32]) -> Vec<u32> {
        let around = |corners: &&[u32; 4]| corners.iter().any(|node| nodes.binary_search(node).is_ok());
        let mut all: Vec<u32> = self.tetrahedra.iter().filter(around).flatten().copied().collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    /// Volume of a tetrahedron, m³.
    pub fn volume(&self, e: usize) -> f64 {
        Shape::of(self.corners(e)).volume
    }

    /// First part of a body that does not fit its mesh: the part, what was found, what has to be.
    pub(super) fn misfit(&self, skin: &Skin) -> Option<(String, String, &'static str)> {
        let [x, y, _] = self.size;
        let of_grid = |layer: &Layer| layer.thickness != 0.0 || layer.cells != 0;
        let most = self.layers.iter().copied().max().unwrap_or_default() as usize;
        let (count, nodes) = (skin.layers.len(), self.nodes.len());
        let parts = [
            (skin.size == [x, y], "size", format!("{:?}", skin.size), "that of the mesh"),
            (skin.cells == [0; 2], "cells", format!("{:?}", skin.cells), "0 of a mesh"),
            (!skin.layers.iter().any(of_grid), "layers", "with a thickness or cells".into(), "without, of a mesh"),
            (most < count, "mesh.layers", most.to_string(), "the number of one that is there, from 0"),
            (skin.law.is_of_mesh(), "law", "of other elements".into(), "of tetrahedra or springs with a mesh"),
            (nodes <= MOST_NODES as usize, "mesh", nodes.to_string(), "fewer nodes than 32-bit indices reach"),
        ];
        let odd = parts.into_iter().find(|(fits, ..)| !fits);
        odd.map(|(_, part, found, wanted)| (part.to_string(), found, wanted))
    }

    /// Node triples of the faces of one tetrahedron alone, outward.
    pub(super) fn outside(&self) -> Vec<[u32; 3]> {
        let mut all = faces(&self.tetrahedra);
        all.sort_unstable();
        let alone = all.chunk_by(|a, b| a.0 == b.0).filter(|same| same.len() == 1);
        alone.map(|same| same[0].outward(&self.tetrahedra)).collect()
    }

    /// True if a node belongs to a region.
    pub fn node_is_in(&self, node: usize, region: &Region) -> bool {
        let [x, y, thickness] = self.size;
        match region {
            Region::Group(group) => group.holds(node),
            _ => region.holds(self.nodes[node], [x, y], thickness),
        }
    }

    /// Parts of a triangle of its nodes that belong to a region.
    pub fn parts_in(&self, region: &Region, triangle: [u32; 3]) -> Vec<TrianglePart> {
        let [x, y, thickness] = self.size;
        let inside = triangle.map(|node| self.node_is_in(node as usize, region));
        region.parts_of_triangle(triangle.map(|node| self.nodes[node as usize]), inside, [x, y], thickness)
    }

    /// The tetrahedron at a position in the body's frame, and the position's barycentric coordinates in it: of those that contain it the
    /// first, otherwise the one whose least coordinate is largest. Takes time in proportion to the mesh.
    pub fn nearest(&self, at: [f64; 3]) -> (usize, [f64; 4]) {
        let mut best = (0, [f64::NEG_INFINITY; 4], f64::NEG_INFINITY);
        for e in 0..self.tetrahedra.len() {
            let weights = barycentric(self.corners(e), at);
            let least = weights.iter().copied().fold(f64::INFINITY, f64::min);
            if least > best.2 {
                best = (e, weights, least);
            }
            if best.2 >= 0.0 {
                break;
            }
        }
        (best.0, best.1)
    }

    /// Barycentric coordinates of a position in the body's frame in a tetrahedron.
    pub fn weights(&self, e: usize, at: [f64; 3]) -> [f64; 4] {
        barycentric(self.corners(e), at)
    }

    /// True if a position in the body's frame is in a tetrahedron, or at most a millionth of one's height outside.
    pub fn holds(&self, at: [f64; 3]) -> bool {
        self.nearest(at).1.iter().all(|weight| *weight >= -INSIDE)
    }
}

/// Least barycentric coordinate of a point that counts as inside: coordinates in scenes are rounded.
const INSIDE: f64 = 1e-6;

/// Barycentric coordinates of a position in a tetrahedron.
fn barycentric(corners: [[f64; 3]; 4], at: [f64; 3]) -> [f64; 4] {
    let [o, a, b, c] = corners.map(DVec3::from_array);
    let (a, b, c, p) = (a - o, b - o, c - o, DVec3::from_array(at) - o);
    let six = a.dot(b.cross(c));
    let [u, v, w] = [p.dot(b.cross(c)) / six, p.dot(c.cross(a)) / six, p.dot(a.cross(b)) / six];
    [1.0 - u - v - w, u, v, w]
}

/// Measures of a tetrahedron.
struct Shape {
    volume: f64,
    longest: f64,
    largest: f64, // face, m²
}

impl Shape {
    fn of(corners: [[f64; 3]; 4]) -> Self {
        let [a, b, c, d] = corners.map(DVec3::from_array);
        let edges = [b - a, c - a, d - a, c - b, d - b, d - c].map(DVec3::length);
        let twice = [(c - b).cross(d - b), (c - a).cross(d - a), (b - a).cross(d - a), (b - a).cross(c - a)];
        Self {
            volume: (b - a).dot((c - a).cross(d - a)) / 6.0,
            longest: edges.into_iter().fold(0.0, f64::max),
            largest: 0.5 * twice.map(DVec3::length).into_iter().fold(0.0, f64::max),
        }
    }

    /// Longest edge over the least height, `3V/A` of the largest face, from [`LONGEST`] on.
    fn is_sliver(&self) -> bool {
        3.0 * self.volume.abs() * LONGEST <= self.longest * self.largest
    }
}

/// A layer's name for the groups of a mesh, as the file states it.
pub(super) struct Wanted<'a> {
    /// Layer.
    pub name: &'a At<String>,
    /// Its `group`.
    pub group: &'a Option<At<String>>,
}

impl Wanted<'_> {
    fn word(&self) -> &At<String> {
        self.group.as_ref().unwrap_or(self.name)
    }
}

/// The tetrahedra of a mesh file for a body with these layers; `unit` is one unit of the file in m.
pub(super) fn read(
    scene: &SceneText,
    files: &Files,
    name: &At<String>,
    unit: f64,
    wanted: &[Wanted],
) -> Result<TetrahedralMesh> {
    let (path, mesh) = files.mesh(scene, name)?;
    let refuse = |found: String, mend: &str| {
        Err(Invalid::BodyMesh { at: scene.location(name.span()), path: path.clone(), found, mend: mend.to_string() })
    };
    if mesh.tetrahedra.is_empty() {
        return refuse(Defect::Empty.to_string(), Defect::Empty.mend());
    }
    // layer of each group of tetrahedra
    let tags: BTreeSet<i32> = mesh.tetrahedron_regions.iter().copied().collect();
    let word = |tag: i32| match named(&mesh, 3, tag) {
        Some(name) => format!("\"{}\" ({tag})", shorten(name)),
        None => format!("{tag}"),
    };
    let words = tags.iter().take(NAMED).map(|tag| word(*tag)).collect::<Vec<_>>().join(", ");
    let none = tags.iter().all(|tag| *tag == 0);
    let alone = none && matches!(wanted, [Wanted { group: None, .. }]);
    let matches = |wanted: &Wanted, tag: i32| {
        let asked = wanted.word().get_ref();
        alone || tag != 0 && named(&mesh, 3, tag).map_or(*asked == tag.to_string(), |name| name == asked)
    };
    if let Some(empty) = wanted.iter().find(|wanted| !tags.iter().any(|tag| matches(wanted, *tag))) {
        let layer = empty.name.get_ref();
        let found = format!("no physical group of its tetrahedra is layer \"{layer}\"; it has {words}");
        return refuse(found, "give the layer one of these as `group`, by name, or by number where it has no name");
    }
    let twice = |tag: &&i32| wanted.iter().filter(|wanted| matches(wanted, **tag)).count() > 1;
    if let Some(tag) = tags.iter().find(twice) {
        let found = format!("its physical group {} is two layers", word(*tag));
        return refuse(found, "give each layer a group of its own");
    }
    let layer_of = |tag: i32| wanted.iter().position(|wanted| matches(wanted, tag));
    if let Some(tag) = tags.iter().find(|tag| layer_of(**tag).is_none()) {
        let count = mesh.tetrahedron_regions.iter().filter(|region| *region == tag).count();
        let found = match tag {
            0 => format!("{count} of its tetrahedra are in no physical group"),
            _ => format!("physical group {} with {count} tetrahedra is no layer", word(*tag)),
        };
        return refuse(found, "add a layer whose `group` it is, or leave the tetrahedra out");
    }
    let layers = mesh.tetrahedron_regions.iter().map(|tag| layer_of(*tag).unwrap_or_default() as u32).collect();
    // in metres, with its groups
    let groups = groups(&mesh);
    let nodes = mesh.points.iter().map(|x| x.map(|c| c * unit)).collect();
    match TetrahedralMesh::new(nodes, mesh.tetrahedra, layers) {
        Ok(made) => Ok(TetrahedralMesh { groups, ..made }),
        Err(defect) => refuse(defect.to_string(), defect.mend()),
    }
}

/// Name of a physical group.
fn named(mesh: &Mesh, dimension: u8, tag: i32) -> Option<&String> {
    mesh.groups.iter().find(|group| (group.dimension, group.tag) == (dimension, tag)).map(|group| &group.name)
}

/// Nodes of the groups of triangles and tetrahedra.
pub(super) fn groups(mesh: &formats::Mesh) -> Vec<Group> {
    let triangles = mesh.triangles.iter().map(|cell| &cell[..]).zip(&mesh.triangle_regions).collect::<Vec<_>>();
    let tetrahedra = mesh.tetrahedra.iter().map(|cell| &cell[..]).zip(&mesh.tetrahedron_regions).collect::<Vec<_>>();
    let mut out = vec![];
    for (dimension, cells) in [(2, triangles), (3, tetrahedra)] {
        let tags: BTreeSet<i32> = cells.iter().map(|(_, tag)| **tag).filter(|tag| *tag != 0).collect();
        for tag in tags {
            let name = named(mesh, dimension, tag).cloned().unwrap_or_else(|| tag.to_string());
            let nodes = cells.iter().filter(|(_, own)| **own == tag).flat_map(|(cell, _)| cell.iter().copied());
            out.push(Group::new(name, nodes.collect()));
        }
    }
    out
}
