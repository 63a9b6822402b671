//! Space that tools have carved out of a grid of hexahedra or a mesh of tetrahedra, finer than its cells. Below, cells are tetrahedra too.
//!
//! Each cell that a tool has reached has [`SAMPLES`] with the part of them that is left, in 255ths; the cell's share `s` is their mean.
//! A cell has `s` times the stiffness and mass of a whole one, and is gone below [`LEAST`]. What is reached is decided where the tissue is
//! when it is carved: a sample at rest position `X` is at `x = X + u(X)`, and is gone where the signed distance `φ(x)` of the tool, less its
//! reach, is negative.
//!
//! The surface has the topology of the cells' faces, as in a dual contour (Ju, Losasso, Schaefer, Warren 2002), and its corners lie on what was carved:
//! a corner that is reached moves to `φ = 0` by Newton's method along `Fᵀ∇φ`, so that a pit is as smooth as the tool, whatever the cells.
//! Corners move with the cell that they are in ([`super::Corner`]). Where the tool reaches the middle of a face or of its edge, their corners recede
//! by the least that clears it: faces are flatter than a round tool, which would otherwise rest on them for good.
//!
//! Error: a ball's volume to 1 % with 2 to 4 cells in its radius (the tests here), that of a groove that it carves to 0.4 and 0.3 %, its depth to 1.3 and
//! 1.0 %, with 1.5 and 3 cells in its radius; of tetrahedra, six to each of those cells, volume 1.1 and 0.4 %, depth 7 and 5 %, since their samples are
//! flatter (`--test engine -- pit`). Corners lie below what is left by the sag of a chord, `h²/8R` along each edge `h`.

use super::element::{Element, SAMPLES};
use super::{Corner, Face, Grid, MaterialPoint, TetrahedralParts};
use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Share of a cell below which it is gone.
pub const LEAST: f64 = 0.05;

/// Rounds in which the surface recedes from what is removed.
const SWEEPS: usize = 8;

/// Share of the thickness below the highest point in which points are of the top.
pub const TOP: f64 = 1e-6;

/// Depth inside of what is removed that counts as outside, m.
const NEAR: f64 = 1e-8;

/// Signed distance of a position from what is removed, in the frame of the body, m, with its gradient; negative where it is removed.
pub type Distance<'a> = dyn Fn([f64; 3]) -> (f64, [f64; 3]) + Sync + 'a;

/// Material that a tool removes in one step.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Carved {
    /// Cells or tetrahedra in ascending order, with what is left of their samples, 255ths.
    pub cells: Vec<(u32, Vec<u8>)>,
    /// Nodes in ascending order, with the rest positions of the surface's corners at them, in the frame of the body, m.
    pub corners: Vec<(u32, [f64; 3])>,
}

/// A cell that has lost some of its volume.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thinned {
    /// Cell id.
    pub cell: u32,
    /// Its share before.
    pub before: f64,
    /// Its share now.
    pub after: f64,
}

/// Removed space.
#[derive(Clone, Debug, Default)]
pub struct Pit {
    /// `[cell]` what is left of its samples, 255ths; of the cells that tools have reached.
    cells: BTreeMap<u32, Vec<u8>>,
    /// `[node]` rest position of the surface's corner at a node, should it be on the surface, m; of the nodes that tools have reached.
    corners: BTreeMap<u32, [f64; 3]>,
}

/// Body to carve in its present state: a grid, or the tetrahedra of a mesh.
#[derive(Clone, Copy)]
pub struct Tissue<'a> {
    /// The grid of the body.
    pub of: &'a Grid,
    /// Tetrahedra of a mesh, prepared for changes.
    pub tetrahedra: Option<&'a TetrahedralParts>,
    /// `[cell]` or `[tetrahedron]`: false if removed.
    pub alive: &'a [bool],
}

impl Tissue<'_> {
    fn element(&self, cell: usize) -> Element {
        match self.tetrahedra {
            Some(parts) => Element::of_tetrahedron(parts, cell),
            None => Element::of_cell(self.of, cell),
        }
    }

    /// Cells or tetrahedra around a node.
    fn around(&self, node: usize) -> Vec<usize> {
        if let Some(parts) = self.tetrahedra {
            return parts.around(node as u32);
        }
        let params = self.of.params::<f64>();
        let at = params.node_at(node);
        (0..8).filter_map(|a| params.cell_below(at, a)).collect()
    }

    /// Whether a node is on the surface.
    fn is_outside(&self, node: usize) -> bool {
        if let Some(parts) = self.tetrahedra {
            return parts.is_outside(node as u32);
        }
        let around = self.around(node);
        around.len() < 8 || around.iter().any(|cell| !self.alive[*cell])
    }

    /// The element that a node's corner moves with: of those that are `there` the one that it is in, or of those around the node the nearest.
    fn element_of(&self, node: usize, at: [f64; 3], there: impl Fn(usize) -> bool) -> Option<usize> {
        if self.tetrahedra.is_none()
            && let Some((cell, _)) = self.of.cells_at(at).into_iter().find(|(cell, _)| there(*cell))
        {
            return Some(cell);
        }
        let around = self.around(node).into_iter().filter(|cell| there(*cell));
        let around = around.map(|cell| (cell, self.element(cell).outside(at)));
        around.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(cell, _)| cell)
    }

    /// The part of a way of a node's corner at `at` that does not leave the body, to first order.
    fn within(&self, node: u32, at: [f64; 3], way: [f64; 3]) -> [f64; 3] {
        if let Some(parts) = self.tetrahedra {
            let out = |way: DVec3, normal: &DVec3| way - *normal * normal.dot(way).max(0.0);
            return parts.held(node).iter().fold(DVec3::from_array(way), out).to_array();
        }
        let [low, high] = self.box_of();
        let leaves = |n: usize| (at[n] <= low[n] && way[n] < 0.0) || (at[n] >= high[n] && way[n] > 0.0);
        [0, 1, 2].map(|n| if leaves(n) { 0.0 } else { way[n] })
    }

    /// Lowest and highest corner of the body's box, m.
    fn box_of(&self) -> [[f64; 3]; 2] {
        let [x, y] = self.of.size().map(|size| 0.5 * size);
        [[-x, -y, 0.0], [x, y, self.of.thickness()]]
    }
}

/// An element with the displacements of its corners.
struct Placed {
    rest: Element,
    moved: [[f64; 3]; 8],
}

impl Placed {
    fn new(rest: Element, moved: &dyn Fn(u32) -> [f64; 3]) -> Self {
        Self { moved: rest.nodes.map(moved), rest }
    }

    /// Present position of a point at rest, m.
    fn now(&self, at: [f64; 3]) -> [f64; 3] {
        let weights = self.rest.weights(at);
        [0, 1, 2].map(|n| at[n] + (0..8).map(|a| weights[a] * self.moved[a][n]).sum::<f64>())
    }

    /// Gradient over rest positions, `Fᵀ∇φ`, of what has the gradient `along` over present ones.
    fn slope(&self, at: [f64; 3], along: [f64; 3]) -> [f64; 3] {
        let gradients = self.rest.gradients(at);
        let slope = |axis: usize| {
            let part = |a: usize| (0..3).map(|n| gradients[a][axis] * self.moved[a][n] * along[n]).sum::<f64>();
            along[axis] + (0..8).map(part).sum::<f64>()
        };
        [0, 1, 2].map(slope)
    }

    /// Signed distance of a point at rest, m, and its gradient over rest positions.
    fn distance(&self, at: [f64; 3], of: &Distance) -> (f64, [f64; 3]) {
        let (distance, along) = of(self.now(at));
        (distance, self.slope(at, along))
    }
}

impl Pit {
    /// Share of a cell that is left.
    pub fn share(&self, cell: usize) -> f64 {
        self.cells.get(&(cell as u32)).map_or(1.0, |samples| mean(samples))
    }

    /// True if nothing was removed.
    pub fn is_empty(&self) -> bool {
        self.cells.is_empty()
    }

    /// What the tool reaches: of some present cells, in ascending order, and of the surface nodes of their `faces`; `moved` has the nodes'
    /// displacements, m.
    pub fn reached(
        &self,
        tissue: Tissue,
        (cells, faces): (&[u32], &[Face]),
        moved: &(dyn Fn(u32) -> [f64; 3] + Sync),
        of: &Distance,
    ) -> Carved {
        let cells: BTreeMap<usize, Placed> =
            cells.iter().map(|cell| (*cell as usize, Placed::new(tissue.element(*cell as usize), moved))).collect();
        let before = |node: u32| self.corners.get(&node).copied().unwrap_or_else(|| tissue.of.rest(node as usize));
        let nodes = cells.values().flat_map(|place| place.rest.nodes);
        let mut corners: BTreeMap<u32, [f64; 3]> = nodes.map(|node| (node, before(node))).collect();
        // corners alone, and points of faces that have all of theirs here
        let mut points: Vec<MaterialPoint> = corners.keys().map(|node| MaterialPoint::node(*node)).collect();
        for face in faces.iter().filter(|face| face.nodes.iter().all(|node| corners.contains_key(node))) {
            points.extend(face.edges().map(|ends| MaterialPoint::of(ends, [0.5; 2])));
            let corners = face.corners();
            let share = 1.0 / corners.len() as f64;
            points.push(MaterialPoint(corners.iter().map(|node| (*node, share)).collect()));
        }
        let there = |cell: usize| cells.contains_key(&cell);
        let place = |node: u32, at: [f64; 3]| cells.get(&tissue.element_of(node as usize, at, there)?);
        for _ in 0..SWEEPS {
            let moved = points.iter().filter(|point| recede(tissue, point, &mut corners, &place, of)).count();
            if moved == 0 {
                break;
            }
        }
        let thinned = |(cell, place): (&usize, &Placed)| self.thinned(*cell as u32, place, of);
        corners.retain(|node, at| *at != before(*node) && at.iter().all(|c| c.is_finite()));
        Carved { cells: cells.par_iter().filter_map(thinned).collect(), corners: corners.into_iter().collect() }
    }

    /// Samples of a cell after what is reached is gone; none if nothing of it is.
    fn thinned(&self, cell: u32, place: &Placed, of: &Distance) -> Option<(u32, Vec<u8>)> {
        let (middle, slope) = place.distance(place.rest.middle(), of);
        if middle > place.rest.range(slope) {
            return None; // out of reach
        }
        let mut left = self.cells.get(&cell).cloned().unwrap_or_else(|| vec![u8::MAX; SAMPLES]);
        let mut less = false;
        for (k, left) in left.iter_mut().enumerate().filter(|(_, left)| **left > 0) {
            // the part of the sample that is left, as if the surface were a plane across it
            let (distance, slope) = place.distance(place.rest.sample(k), of);
            let width = place.rest.range_of_sample(k, slope);
            let part = if width > 0.0 { 0.5 + distance / width } else { 0.0 };
            let own = (255.0 * part.clamp(0.0, 1.0)).round() as u8;
            less |= own < *left;
            *left = own.min(*left);
        }
        less.then_some((cell, left))
    }

    /// Removes space; returns the cells that have lost something.
    pub fn carve(&mut self, carved: &Carved) -> Vec<Thinned> {
        self.corners.extend(carved.corners.iter().copied());
        let thinned = |(cell, left): &(u32, Vec<u8>)| {
            let before = self.share(*cell as usize);
            self.cells.insert(*cell, left.clone());
            Thinned { cell: *cell, before, after: mean(left) }
        };
        carved.cells.iter().map(thinned).collect()
    }

    /// Points that what was carved reaches to at rest, in the frame of the body, m: of each sample that lost some the depth of it, if it is taken from
    /// above, and of those that lost half their sides; and whether they are at the body's top.
    pub fn extent(&self, tissue: Tissue, carved: &Carved) -> Vec<([f64; 3], bool)> {
        let top = tissue.of.thickness() * (1.0 - TOP);
        let mut out = vec![];
        for (cell, left) in &carved.cells {
            let rest = tissue.element(*cell as usize);
            for (k, left) in left.iter().enumerate().filter(|(_, left)| **left < u8::MAX) {
                let half = *left < u8::MAX / 2;
                let whole = rest.tops(k, 1.0);
                let highest = half && whole.iter().any(|at| at[2] >= top);
                out.extend(rest.tops(k, f64::from(*left) / f64::from(u8::MAX)).into_iter().map(|at| (at, highest)));
            }
        }
        out
    }

    /// Corner of the surface at a node, where it is not the node itself.
    pub fn corner(&self, tissue: Tissue, node: usize) -> Option<Corner> {
        let at = *self.corners.get(&(node as u32))?;
        if !tissue.is_outside(node) {
            return None;
        }
        let own = tissue.element(tissue.element_of(node, at, |cell| tissue.alive[cell])?);
        let start = tissue.of.rest(node);
        Some(Corner { offset: [0, 1, 2].map(|n| at[n] - start[n]), nodes: own.nodes, weights: own.weights(at) })
    }
}

/// Moves the corners that a point of the surface is between out of what is removed, the least that does it to first order, and not out of the
/// body's box; false if the point is not in it.
fn recede<'a>(
    tissue: Tissue,
    point: &MaterialPoint,
    corners: &mut BTreeMap<u32, [f64; 3]>,
    place: &dyn Fn(u32, [f64; 3]) -> Option<&'a Placed>,
    of: &Distance,
) -> bool {
    let mut now = [0.0; 3];
    let mut places = vec![];
    for (node, weight) in &point.0 {
        let at = corners[node];
        let Some(own) = place(*node, at) else { return false };
        let there = own.now(at);
        (0..3).for_each(|n| now[n] += weight * there[n]);
        places.push((*node, *weight, at, own));
    }
    let (distance, along) = of(now);
    if distance >= -NEAR {
        return false;
    }
    // the way out of each corner at rest
    let way = |(node, _, at, own): &(u32, f64, [f64; 3], &Placed)| tissue.within(*node, *at, own.slope(*at, along));
    let ways: Vec<[f64; 3]> = places.iter().map(way).collect();
    let squared = |way: &[f64; 3]| way.iter().map(|c| c * c).sum::<f64>();
    let sum: f64 = places.iter().zip(&ways).map(|((_, weight, ..), way)| weight * weight * squared(way)).sum();
    if sum == 0.0 {
        return false;
    }
    let [low, high] = tissue.box_of();
    for ((node, weight, at, _), way) in places.iter().zip(&ways) {
        let next = [0, 1, 2].map(|n| (at[n] - distance * weight / sum * way[n]).clamp(low[n], high[n]));
        corners.insert(*node, next);
    }
    true
}

/// Mean of samples.
fn mean(samples: &[u8]) -> f64 {
    samples.iter().map(|left| f64::from(*left)).sum::<f64>() / (255.0 * samples.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Unstructured;
    use crate::scene::TetrahedralMesh;
    use std::sync::Arc;

    const RADIUS: f64 = 2e-3;

    /// Cells of 1 × 0.7 mm, in thinner levels above.
    fn grid() -> Grid {
        let heights = [0.0, 1.0, 2.0, 3.0, 3.5, 4.0, 4.5, 5.0].map(|h| 1e-3 * h).to_vec();
        Grid {
            cells: [8, 10, 7],
            nodes: [9, 11, 8],
            edge: [1e-3, 0.7e-3],
            layer_of: vec![0, 0, 0, 1, 1, 1, 1],
            heights,
            unstructured: None,
            embedded: None,
        }
    }

    /// Nothing is gone.
    fn tissue(grid: &Grid) -> Tissue<'_> {
        Tissue { of: grid, tetrahedra: None, alive: &[] }
    }

    fn of_tetrahedra<'a>(grid: &'a Grid, parts: &'a TetrahedralParts) -> Tissue<'a> {
        Tissue { of: grid, tetrahedra: Some(parts), alive: parts.present() }
    }

    /// A ball, with the positions that it takes.
    fn ball(centre: [f64; 3]) -> impl Fn([f64; 3]) -> (f64, [f64; 3]) + Sync {
        move |at| {
            let away = [0, 1, 2].map(|n| at[n] - centre[n]);
            let far = away.iter().map(|c| c * c).sum::<f64>().sqrt();
            (far - RADIUS, away.map(|c| c / far))
        }
    }

    /// Volume that a ball takes from the whole grid, displaced, m³, and what it has carved.
    fn taken(centre: [f64; 3], moved: &(dyn Fn(u32) -> [f64; 3] + Sync)) -> (f64, Carved) {
        let grid = grid();
        let all: Vec<u32> = (0..grid.cell_count() as u32).collect();
        let mut pit = Pit::default();
        let carved = pit.reached(tissue(&grid), (&all, &[]), moved, &ball(centre));
        let volume = |own: &Thinned| {
            let [x, y, z] = grid.cell_edges(grid.layer(own.cell as usize) as u32);
            x * y * z * (own.before - own.after)
        };
        (pit.carve(&carved).iter().map(volume).sum(), carved)
    }

    #[test]
    fn a_ball_takes_its_own_volume() {
        let whole = 4.0 / 3.0 * std::f64::consts::PI * RADIUS.powi(3);
        let off = |volume: f64, wanted: f64| (volume / wanted - 1.0).abs();
        // inside, and half of it in the top
        for (centre, wanted) in [([0.13e-3, -0.2e-3, 2.5e-3], whole), ([0.4e-3, 0.1e-3, 5e-3], 0.5 * whole)] {
            let (volume, _) = taken(centre, &|_| [0.0; 3]);
            assert!(off(volume, wanted) < 0.01, "{volume:e} {wanted:e}");
        }
        // of tissue stretched to 1.3 times its length, less of it at rest: the ball takes what is there now
        let grid = grid();
        let stretched = |node: u32| [0.3 * grid.rest(node as usize)[0], 0.0, 0.0];
        let (volume, _) = taken([0.0, 0.0, 2.5e-3], &stretched);
        assert!(off(volume, whole / 1.3) < 0.01 && off(volume, whole) > 0.2, "{volume:e}");
    }

    #[test]
    fn a_ball_takes_its_own_volume_of_tetrahedra_and_their_corners_lie_on_it() {
        let (grid, centre) = (grid(), [0.13e-3, -0.2e-3, 4.8e-3]);
        let nodes = (0..grid.node_count()).map(|node| grid.rest(node)).collect();
        let (corners, layers) = grid.tetrahedra().into_iter().map(|(own, layer)| (own, layer as u32)).unzip();
        let mesh = TetrahedralMesh::new(nodes, corners, layers).unwrap_or_else(|defect| panic!("{defect}"));
        let mut parts = TetrahedralParts::new(Arc::new(Unstructured::new(&Arc::new(mesh))), 0);
        parts.prepare();
        let all: Vec<u32> = (0..parts.present().len() as u32).collect();
        let mut pit = Pit::default();
        let carved = pit.reached(of_tetrahedra(&grid, &parts), (&all, &[]), &|_| [0.0; 3], &ball(centre));
        let thinned = pit.carve(&carved);
        let volume: f64 =
            thinned.iter().map(|own| parts.mesh().mesh.volume(own.cell as usize) * (own.before - own.after)).sum();
        // the ball without its cap above the top
        let h = RADIUS - 0.2e-3;
        let pi = std::f64::consts::PI;
        let wanted = 4.0 / 3.0 * pi * RADIUS.powi(3) - pi * h * h * (RADIUS - h / 3.0);
        assert!((volume / wanted - 1.0).abs() < 0.01, "{volume:e} {wanted:e}");
        let gone: Vec<u32> = thinned.iter().filter(|own| own.after < LEAST).map(|own| own.cell).collect();
        parts.carve(&gone);
        let mut moved = 0;
        for node in 0..grid.node_count() {
            let Some(own) = pit.corner(of_tetrahedra(&grid, &parts), node) else { continue };
            let at = [0, 1, 2].map(|n| grid.rest(node)[n] + own.offset[n]);
            assert!(ball(centre)(at).0.abs() < 1e-5 && at[2] <= grid.thickness(), "node {node}: {at:?}");
            assert!((own.weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            moved += 1;
        }
        assert!(moved > 10 && gone.len() > 30, "{moved} {}", gone.len());
    }

    #[test]
    fn what_is_taken_twice_is_counted_once() {
        let (grid, away) = (grid(), ball([0.0, 0.0, 5e-3]));
        let all: Vec<u32> = (0..grid.cell_count() as u32).collect();
        let mut pit = Pit::default();
        let carved = pit.reached(tissue(&grid), (&all, &[]), &|_| [0.0; 3], &away);
        assert!(!pit.carve(&carved).is_empty() && !pit.is_empty());
        assert_eq!(pit.reached(tissue(&grid), (&all, &[]), &|_| [0.0; 3], &away), Carved::default());
        assert!(all.iter().any(|cell| pit.share(*cell as usize) < 1.0) && pit.share(0) == 1.0);
    }

    #[test]
    fn corners_lie_on_the_ball_and_move_with_the_tissue() {
        let (grid, centre) = (grid(), [0.2e-3, 0.1e-3, 5.5e-3]);
        let shear = |node: u32| {
            let [x, _, z] = grid.rest(node as usize);
            [0.1 * z, 0.05 * x, -0.1 * z]
        };
        let (_, carved) = taken(centre, &shear);
        let mut pit = Pit::default();
        let gone: Vec<u32> = pit.carve(&carved).iter().filter(|own| own.after < LEAST).map(|own| own.cell).collect();
        let alive: Vec<bool> = (0..grid.cell_count()).map(|cell| !gone.contains(&(cell as u32))).collect();
        let mut moved = 0;
        for node in 0..grid.node_count() {
            let Some(own) = pit.corner(Tissue { alive: &alive, ..tissue(&grid) }, node) else { continue };
            let (rest, shift) = (grid.rest(node), own.moved(shear));
            let at = [0, 1, 2].map(|n| rest[n] + own.offset[n] + shift[n]);
            let (off, _) = ball(centre)(at);
            assert!(off.abs() < 5e-6, "node {node}: {off:e} m from the ball");
            assert!((own.weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            assert!(rest[2] + own.offset[2] <= grid.thickness(), "node {node} has left the body");
            moved += 1;
        }
        assert!(moved > 10 && gone.len() > 5, "{moved} {}", gone.len());
        // the counter-test: nodes themselves are not on it
        let off = |node: &u32| ball(centre)([0, 1, 2].map(|n| grid.rest(*node as usize)[n] + shear(*node)[n])).0.abs();
        assert!(carved.corners.iter().map(|(node, _)| off(node)).fold(0.0, f64::max) > 1e-4);
    }

    #[test]
    fn a_face_recedes_where_its_middle_is_reached() {
        let grid = grid();
        let all: Vec<u32> = (0..grid.cell_count() as u32).collect();
        let params = grid.params::<f64>();
        let cell = params.cell_id([4, 5, 6]);
        let nodes = params.corners(cell).map(|node| node as u32);
        let face = Face { nodes: [nodes[4], nodes[5], nodes[6], nodes[7]], cell: cell as u32, wall: false };
        // 0.05 mm into the middle, and not as far as the corners
        let low = grid.rest(nodes[4] as usize);
        let centre = [low[0] + 0.5e-3, low[1] + 0.35e-3, 5e-3 + RADIUS - 0.05e-3];
        let pit = Pit::default();
        let carved = pit.reached(tissue(&grid), (&all, &[face]), &|_| [0.0; 3], &ball(centre));
        let height = |node: u32| carved.corners.iter().find(|(own, _)| *own == node).map_or(low[2], |(_, at)| at[2]);
        let middle = face.nodes.map(height).iter().sum::<f64>() / 4.0;
        assert!((middle - (5e-3 - 0.05e-3)).abs() < 1e-6, "{middle:e}");
        assert_eq!(pit.reached(tissue(&grid), (&all, &[]), &|_| [0.0; 3], &ball(centre)).corners, []);
    }
}
