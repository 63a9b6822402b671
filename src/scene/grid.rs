//! Node positions of grids and meshes as far as the reader needs them: a region must contain nodes.

use super::invalid::{Invalid, Result};
use super::limits::{LONGEST, MOST_NODES};
use super::raw::{self, At, Extent, Points};
use super::region::{ACROSS, CellFace, SLACK};
use super::text::{SceneText, in_mm, normalized};
use super::{ClosedSurface, Layer, Region, Skin, TestForm, TetrahedralMesh};
use std::ops::Range;

/// A grid of nodes: the scene's, or its test form's; or the nodes of a mesh.
pub(super) struct Grid<'a> {
    pub name: &'static str,
    size: [f64; 2],
    cells: [u32; 2],
    layers: &'a [Layer],
    mesh: Option<&'a TetrahedralMesh>,
    surface: Option<&'a ClosedSurface>,
}

/// The scene's grid, then that of its test form if it has its own cells.
pub(super) fn grids<'a>(skin: &'a Skin, test: &Option<TestForm>) -> Vec<Grid<'a>> {
    let mesh = skin.mesh.as_deref();
    let surface = skin.embedded.as_deref();
    let grid = |name, cells| Grid { name, size: skin.size, cells, layers: &skin.layers, mesh, surface };
    let mut grids = vec![grid("scene", skin.cells)];
    grids.extend(test.and_then(|test| test.cells).map(|cells| grid("test form", cells)));
    grids
}

/// Error if the nodes of a grid exceed 32-bit indices.
pub(super) fn numbered(scene: &SceneText, cells: [u32; 2], layers: &[At<u32>], at: &At<Vec<u32>>) -> Result<()> {
    let over_thickness: u64 = layers.iter().map(|layer| u64::from(*layer.get_ref())).sum();
    let found = (u64::from(cells[0]) + 1)
        .saturating_mul(u64::from(cells[1]) + 1)
        .saturating_mul(over_thickness.saturating_add(1));
    if found <= u64::from(MOST_NODES) {
        return Ok(());
    }
    // the larger number is the one to mend
    let thickest = layers.iter().max_by_key(|layer| *layer.get_ref());
    let span = match thickest.filter(|_| over_thickness > u64::from(cells[0].max(cells[1]))) {
        Some(layer) => layer.span(),
        None => at.span(),
    };
    Err(Invalid::TooManyNodes { at: scene.location(span), found, limit: MOST_NODES })
}

impl Skin {
    /// First number of its grid that is out of range: its part, value and range.
    pub(super) fn odd_grid(&self) -> Option<(String, String, &'static str)> {
        let odd = |part: String, found: String, wanted| Some((part, found, wanted));
        if self.cells.contains(&0) {
            return odd("cells".into(), "0".into(), "at least 1");
        }
        let levels: u64 = self.layers.iter().map(|layer| u64::from(layer.cells)).sum();
        let nodes = self.cells.iter().fold(levels.saturating_add(1), |n, c| n.saturating_mul(u64::from(*c) + 1));
        if nodes > u64::from(MOST_NODES) {
            return odd("cells".into(), nodes.to_string(), "fewer nodes than 32-bit indices reach");
        }
        for (k, layer) in self.layers.iter().enumerate() {
            let part = |name: &str| format!("layers[{k}].{name}");
            if !(layer.thickness.is_finite() && layer.thickness > 0.0) {
                return odd(part("thickness"), layer.thickness.to_string(), "finite numbers above 0");
            }
            if layer.cells == 0 {
                return odd(part("cells"), "0".into(), "at least 1");
            }
            let aspect = layer.aspect(self.size, self.cells);
            if aspect.is_nan() || aspect > LONGEST {
                return odd(part("thickness, cells"), aspect.to_string(), "cells at most 10000 times as long as wide");
            }
        }
        None
    }
}

impl Layer {
    /// Edges of its cells, m.
    pub(super) fn edges(&self, size: [f64; 2], cells: [u32; 2]) -> [f64; 3] {
        let [x, y] = [0, 1].map(|axis| size[axis] / f64::from(cells[axis]));
        [x, y, self.thickness / f64::from(self.cells)]
    }

    /// Longest edge of its cells over the shortest one.
    pub(super) fn aspect(&self, size: [f64; 2], cells: [u32; 2]) -> f64 {
        let edges = self.edges(size, cells);
        edges.iter().copied().fold(0.0, f64::max) / edges.iter().copied().fold(f64::INFINITY, f64::min)
    }
}

/// Error if the cells of a layer are [`LONGEST`] times as long as wide, or more: of its thickness, or, where that holds for every one of
/// several layers, of the body's size.
pub(super) fn not_slender(
    scene: &SceneText,
    (size, size_at): ([f64; 2], Range<usize>),
    cells: [u32; 2],
    layers: &[Layer],
    thicknesses: &[Range<usize>],
) -> Result<()> {
    let slender = |layer: &Layer| layer.aspect(size, cells) > LONGEST;
    let all = layers.len() > 1 && layers.iter().all(slender);
    let found = layers.iter().zip(thicknesses).find(|(layer, _)| slender(layer));
    found.map_or(Ok(()), |(layer, thickness)| {
        Err(Invalid::SlenderCells {
            at: scene.location(if all { size_at } else { thickness.clone() }),
            layer: layer.name.clone(),
            edges: layer.edges(size, cells).map(in_mm),
            most: LONGEST,
        })
    })
}

impl Grid<'_> {
    /// Error if a box contains no node. Nodes are a product of three rows, so a box contains one exactly if each of its intervals does.
    pub fn holds_node(&self, scene: &SceneText, at: &Points, min: [f64; 3], max: [f64; 3]) -> Result<()> {
        if self.mesh.is_some() {
            let region = "box".to_string();
            let none = || Err(Invalid::NoNode { at: scene.location(at.span()), grid: self.name, region });
            return if self.holds(&Region::Box { min, max }) { Ok(()) } else { none() };
        }
        for axis in 0..3 {
            let rows = self.rows(axis);
            if rows.iter().any(|row| row.holds_node(min[axis], max[axis])) {
                continue;
            }
            return Err(Invalid::EmptyRegion {
                at: scene.location(at.span()),
                grid: self.name,
                axis: ['x', 'y', 'z'][axis],
                min: in_mm(min[axis]),
                max: in_mm(max[axis]),
                body_min: in_mm(rows.iter().map(|row| row.start).fold(f64::INFINITY, f64::min)),
                body_max: in_mm(rows.iter().map(Row::end).fold(f64::NEG_INFINITY, f64::max)),
                cell: in_mm(rows.iter().map(|row| row.step).fold(0.0, f64::max)),
            });
        }
        Ok(())
    }

    /// True if the region contains a node. On a line of nodes each region is one interval, or both ends of the line. Along the longest axis
    /// it is therefore enough to test the ends and the nodes next to the region's own position on the line.
    pub fn holds(&self, region: &Region) -> bool {
        if let Some(mesh) = self.mesh {
            return (0..mesh.nodes().len()).any(|node| mesh.node_is_in(node, region));
        }
        let rows = [0, 1, 2].map(|axis| self.rows(axis));
        let count = |axis: usize| rows[axis].iter().map(|row| u64::from(row.cells) + 1).sum::<u64>();
        let longest = (0..3).max_by_key(|axis| count(*axis)).unwrap_or(0);
        let [first, second] = [[1, 2], [0, 2], [0, 1]][longest];
        let top = rows[2].last().map_or(0.0, Row::end);
        let positions = |axis: usize| rows[axis].iter().flat_map(Row::positions);
        let holds = |p: [f64; 3]| region.holds(p, self.size, top);
        positions(first).any(|a| {
            positions(second).any(|b| {
                let at = |along: f64| {
                    let mut p = [0.0; 3];
                    (p[longest], p[first], p[second]) = (along, a, b);
                    p
                };
                let own = region.position_along(longest, at(0.0));
                rows[longest].iter().any(|row| row.around(own).any(|along| holds(at(along))))
            })
        })
    }

    /// True if the region contains the four corners of a face of the surface.
    pub fn holds_face(&self, region: &Region) -> bool {
        if let Some(surface) = self.surface {
            return surface.has_triangle_in(region, self.size, self.cells);
        }
        if let Some(mesh) = self.mesh {
            return mesh.outside().iter().any(|face| face.iter().all(|node| mesh.node_is_in(*node as usize, region)));
        }
        let places = [0, 1, 2].map(|axis| {
            let mut all: Vec<f64> = self.rows(axis).iter().flat_map(Row::positions).collect();
            all.dedup(); // layers share their interfaces
            all
        });
        let top = places[2].last().copied().unwrap_or(0.0);
        let holds = |axis: usize, end: f64, [first, a]: [usize; 2], [second, b]: [usize; 2]| {
            let mut p = [0.0; 3];
            (p[axis], p[first], p[second]) = (end, places[first][a], places[second][b]);
            region.holds(p, self.size, top)
        };
        (0..3).any(|axis| {
            let [first, second] = [[1, 2], [0, 2], [0, 1]][axis];
            let ends = [places[axis][0], places[axis][places[axis].len() - 1]];
            ends.into_iter().any(|end| {
                let corner = |a: usize, b: usize| holds(axis, end, [first, a], [second, b]);
                (1..places[first].len()).any(|a| {
                    (1..places[second].len())
                        .any(|b| corner(a, b) && corner(a - 1, b) && corner(a, b - 1) && corner(a - 1, b - 1))
                })
            })
        })
    }

    /// True if the region contains a part of the surface.
    pub fn loads(&self, region: &Region) -> bool {
        if let Some(surface) = self.surface {
            return surface.triangles().iter().any(|corners| !surface.parts_in(region, *corners).is_empty());
        }
        if let Some(mesh) = self.mesh {
            return mesh.outside().iter().any(|corners| !mesh.parts_in(region, *corners).is_empty());
        }
        let rows = [0, 1, 2].map(|axis| {
            let cells = |row: &Row| {
                let (start, step) = (row.start, row.step);
                (0..row.cells).map(move |k| [start + step * f64::from(k), step])
            };
            self.rows(axis).iter().flat_map(cells).collect::<Vec<_>>()
        });
        let top = self.rows(2).last().map_or(0.0, Row::end);
        (0..3).any(|axis| {
            let [first, second] = ACROSS[axis];
            let [start, step] = rows[axis][rows[axis].len() - 1];
            [rows[axis][0][0], start + step].into_iter().any(|end| {
                rows[first].iter().any(|a| {
                    rows[second].iter().any(|b| {
                        let mut face = CellFace { axis, low: [end; 3], edge: [0.0; 3] };
                        for (n, [start, step]) in [(first, a), (second, b)] {
                            (face.low[n], face.edge[n]) = (*start, *step);
                        }
                        !region.parts_of(&face, self.size, top).is_empty()
                    })
                })
            })
        })
    }

    /// Error if a point lies outside the skin.
    pub fn contains(&self, scene: &SceneText, point: [f64; 3], at: &At<Vec<f64>>) -> Result<()> {
        if let Some(mesh) = self.mesh {
            let outside = || Err(Invalid::PointOutsideMesh { at: scene.location(at.span()), found: point.map(in_mm) });
            return if mesh.holds(point) { Ok(()) } else { outside() };
        }
        match self.beyond(point) {
            None => Ok(()),
            Some((axis, [min, max])) => Err(Invalid::PointOutside {
                at: scene.location(at.span()),
                axis: ['x', 'y', 'z'][axis],
                found: in_mm(point[axis]),
                min: in_mm(min),
                max: in_mm(max),
            }),
        }
    }

    /// First axis along which a point lies outside the skin, and the skin's ends along it, m.
    fn beyond(&self, point: [f64; 3]) -> Option<(usize, [f64; 2])> {
        let ends = |axis: usize| {
            let rows = self.rows(axis);
            [rows[0].start, rows[rows.len() - 1].end()]
        };
        let outside =
            |(axis, [low, high]): &(usize, [f64; 2])| point[*axis] < low - SLACK || point[*axis] > high + SLACK;
        (0..3).map(|axis| (axis, ends(axis))).find(outside)
    }

    fn rows(&self, axis: usize) -> Vec<Row> {
        if axis < 2 {
            let step = self.size[axis] / f64::from(self.cells[axis]);
            let start = -self.size[axis] / 2.0;
            let cells = self.cells[axis];
            return vec![Row { start, step, cells }];
        }
        let mut start = 0.0;
        let layers = self.layers.iter();
        layers
            .map(|layer| {
                let step = layer.thickness / f64::from(layer.cells);
                let cells = layer.cells;
                let row = Row { start, step, cells };
                start += layer.thickness;
                row
            })
            .collect()
    }
}

/// Equally spaced nodes along an axis.
struct Row {
    start: f64,
    step: f64,
    cells: u32,
}

impl Row {
    fn end(&self) -> f64 {
        self.start + self.step * f64::from(self.cells)
    }

    fn positions(&self) -> impl Iterator<Item = f64> {
        let (start, step) = (self.start, self.step);
        (0..=self.cells).map(move |k| start + step * f64::from(k))
    }

    /// Both ends, and the nodes next to a position.
    fn around(&self, position: f64) -> impl Iterator<Item = f64> {
        let (start, step, cells) = (self.start, self.step, f64::from(self.cells));
        let below = ((position - start) / step).floor();
        [0.0, below, below + 1.0, cells].into_iter().map(move |k| start + step * k.clamp(0.0, cells))
    }

    fn holds_node(&self, min: f64, max: f64) -> bool {
        let first = ((min - SLACK - self.start) / self.step).ceil().max(0.0);
        let last = ((max + SLACK - self.start) / self.step).floor().min(f64::from(self.cells));
        first <= last
    }
}

/// Error if a key of a region is present.
pub(super) fn no_extent(scene: &SceneText, extent: &Extent, why: &'static str) -> Result<()> {
    let Extent { box_mm, centre_mm, radius_mm, through_mm, normal, within_mm, margin_mm, group } = extent;
    scene.needless("group", group, why)?;
    scene.needless("box_mm", box_mm, why)?;
    scene.needless("centre_mm", centre_mm, why)?;
    scene.needless("radius_mm", radius_mm, why)?;
    scene.needless("through_mm", through_mm, why)?;
    scene.needless("normal", normal, why)?;
    scene.needless("within_mm", within_mm, why)?;
    scene.needless("margin_mm", margin_mm, why)
}

/// Region of the given name; it must contain a node of each grid.
pub(super) fn region<'a>(scene: &SceneText, name: &At<String>, extent: Extent, grids: &[Grid<'a>]) -> Result<Region> {
    let word = scene.choice(&raw::Boundary::region, name)?;
    let Extent { box_mm, centre_mm, radius_mm, through_mm, normal, within_mm, margin_mm, group } = &extent;
    // keys of other regions
    if word != "group" {
        scene.needless("group", group, "it belongs to region = \"group\"")?;
    }
    if word != "box" {
        scene.needless("box_mm", box_mm, "it belongs to region = \"box\"")?;
    }
    if word != "sphere" {
        scene.needless("centre_mm", centre_mm, "it belongs to region = \"sphere\"")?;
        scene.needless("radius_mm", radius_mm, "it belongs to region = \"sphere\"")?;
    }
    if word != "plane" {
        scene.needless("through_mm", through_mm, "it belongs to region = \"plane\"")?;
        scene.needless("normal", normal, "it belongs to region = \"plane\"")?;
        scene.needless("within_mm", within_mm, "it belongs to region = \"plane\"")?;
    }
    if !word.starts_with("bottom_") {
        scene.needless("margin_mm", margin_mm, "it belongs to region = \"bottom_rim\" and \"bottom_core\"")?;
    }
    // regions without keys, then those with keys of their own
    let region = match word {
        "bottom" => return Ok(Region::Bottom),
        "top" => return Ok(Region::Top),
        "sides" => return Ok(Region::Sides),
        "sides_x" => return Ok(Region::SidesX),
        "sides_y" => return Ok(Region::SidesY),
        "side_x_min" => return Ok(Region::SideXMin),
        "side_x_max" => return Ok(Region::SideXMax),
        "side_y_min" => return Ok(Region::SideYMin),
        "side_y_max" => return Ok(Region::SideYMax),
        "all" => return Ok(Region::All),
        "box" => return within_box(scene, name, box_mm, grids),
        "group" => {
            let why = "region = \"group\" asks for `group`, the name of a physical group of the mesh";
            let asked = scene.required("group", group.as_ref(), name.span(), why)?;
            let of =
                |grid: &Grid<'a>| grid.mesh.map(TetrahedralMesh::groups).or(grid.surface.map(ClosedSurface::groups));
            let groups = grids.iter().find_map(of).unwrap_or_default();
            let why = "a grid has no groups; they are of a body with `mesh` whose file names some";
            if groups.is_empty() {
                scene.needless("group", group, why)?;
            }
            let known: Vec<&str> = groups.iter().map(|group| group.name()).collect();
            let found = groups.iter().find(|group| group.name() == asked.get_ref());
            let found = found.ok_or_else(|| scene.unknown_word("group", asked, &known))?;
            return Ok(Region::Group(found.clone()));
        }
        "sphere" => {
            let why = "region = \"sphere\" asks for centre_mm = [x,y,z] and radius_mm";
            let centre = scene.required("centre_mm", centre_mm.as_ref(), name.span(), why)?;
            let radius = scene.required("radius_mm", radius_mm.as_ref(), name.span(), why)?;
            Region::Sphere {
                centre: scene.vector(&raw::Boundary::centre_mm, centre)?,
                radius: scene.number(&raw::Boundary::radius_mm, radius)?,
            }
        }
        "plane" => {
            let why = "region = \"plane\" asks for through_mm = [x,y,z], normal = [x,y,z] and within_mm";
            let through = scene.required("through_mm", through_mm.as_ref(), name.span(), why)?;
            let normal = scene.required("normal", normal.as_ref(), name.span(), why)?;
            let within = scene.required("within_mm", within_mm.as_ref(), name.span(), why)?;
            let direction = normalized(scene.vector(&raw::Boundary::normal, normal)?);
            let none = || Invalid::NoDirection { at: scene.location(normal.span()), key: "normal" };
            Region::Plane {
                through: scene.vector(&raw::Boundary::through_mm, through)?,
                normal: direction.ok_or_else(none)?,
                within: scene.number(&raw::Boundary::within_mm, within)?,
            }
        }
        _ => {
            let why = "the rim is what lies within margin_mm of the sides, the core the rest";
            let margin = scene.required("margin_mm", margin_mm.as_ref(), name.span(), why)?;
            let margin = scene.number(&raw::Boundary::margin_mm, margin)?;
            if word == "bottom_rim" { Region::Rim(margin) } else { Region::Core(margin) }
        }
    };
    // each grid must have a node in it
    for grid in grids {
        if !grid.holds(&region) {
            return Err(Invalid::NoNode { at: scene.location(name.span()), grid: grid.name, region: word.into() });
        }
    }
    Ok(region)
}

fn within_box(scene: &SceneText, name: &At<String>, corners: &Option<Points>, grids: &[Grid]) -> Result<Region> {
    let why = "region = \"box\" asks for box_mm = [[x,y,z],[x,y,z]]";
    let corners = scene.required("box_mm", corners.as_ref(), name.span(), why)?;
    let [min, max] = scene.corners(&raw::Boundary::box_mm, corners)?;
    for grid in grids {
        grid.holds_node(scene, corners, min, max)?;
    }
    Ok(Region::Box { min, max })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn region() -> impl Strategy<Value = Region> {
        let point = || prop::array::uniform3(-3.0f64..3.0);
        // on a coarse raster, so that positions fall on nodes now and then
        let raster = || prop::array::uniform3((-6i32..7).prop_map(|n| f64::from(n) / 2.0));
        prop_oneof![
            (point(), 0.0f64..2.0).prop_map(|(centre, radius)| Region::Sphere { centre, radius }),
            (raster(), 0.0f64..1.0).prop_map(|(centre, radius)| Region::Sphere { centre, radius }),
            (point(), point(), 0.0f64..0.3).prop_map(|(through, n, within)| {
                let length = n.iter().map(|c| c * c).sum::<f64>().sqrt().max(1e-3);
                Region::Plane { through, normal: n.map(|c| c / length), within }
            }),
            (raster(), 0usize..3).prop_map(|(through, axis)| {
                let mut normal = [0.0; 3];
                normal[axis] = 1.0;
                Region::Plane { through, normal, within: 0.0 }
            }),
            (raster(), raster()).prop_map(|(min, max)| Region::Box { min, max }),
            (0.0f64..3.0).prop_map(Region::Rim),
            (0.0f64..3.0).prop_map(Region::Core),
            prop::sample::select(vec![
                Region::Bottom,
                Region::Top,
                Region::Sides,
                Region::SidesX,
                Region::SidesY,
                Region::SideXMin,
                Region::SideXMax,
                Region::SideYMin,
                Region::SideYMax,
                Region::All
            ]),
        ]
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 4000, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn a_region_holds_a_node_if_one_of_all_nodes_is_inside(
            region in region(),
            cells in prop::array::uniform2(1u32..7),
            over in prop::collection::vec((1u32..5, 0.1f64..2.0), 1..4),
        ) {
            let layer = |(cells, thickness): &(u32, f64)| Layer {
                second_share: 0.0,
                fibres: Default::default(),
                name: String::new(),
                thickness: *thickness,
                cells: *cells,
                young: 1.0,
                poisson: 0.0,
                density: 1.0,
                pre_strain: [0.0; 2],
                toughness: 0.0,
                break_strain: f64::INFINITY,
                color: [0; 3],
            };
            let layers: Vec<Layer> = over.iter().map(layer).collect();
            let grid = Grid { name: "scene", size: [4.0, 3.0], cells, layers: &layers, mesh: None, surface: None };
            let positions = [0, 1, 2].map(|axis| grid.rows(axis).iter().flat_map(Row::positions).collect::<Vec<f64>>());
            let top = positions[2][positions[2].len() - 1];
            let all = positions[2].iter().flat_map(|z| positions[1].iter().flat_map(|y| positions[0].iter().map(|x| [*x, *y, *z])));
            let wanted = all.collect::<Vec<_>>().into_iter().any(|p| region.holds(p, grid.size, top));
            prop_assert_eq!(grid.holds(&region), wanted);
        }
    }
}
