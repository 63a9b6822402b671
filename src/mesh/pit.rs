//! Space that tools have carved out of a grid of hexahedra, finer than its cells.
//!
//! Each cell that a tool has reached has [`SIDE`]³ samples with the part of them that is left, in 255ths; the cell's share `s` is their mean.
//! A cell has `s` times the stiffness and mass of a whole one, and is gone below [`LEAST`]. What is reached is decided where the tissue is
//! when it is carved: a sample at rest position `X` is at `x = X + u(X)`, and is gone where the signed distance `φ(x)` of the tool, less its
//! reach, is negative.
//!
//! The surface has the topology of the cells' faces, as in a dual contour (Ju, Losasso, Schaefer, Warren 2002), and its corners lie on what was carved:
//! a corner that is reached moves to `φ = 0` by Newton's method along `Fᵀ∇φ`, so that a pit is as smooth as the tool, whatever the cells.
//! Corners move with the cell that they are in ([`super::Corner`]).

use super::{Corner, Face, Grid, MaterialPoint, trilinear};
use crate::kernels::corner;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Samples along each edge of a cell.
const SIDE: usize = 4;

/// Samples of a cell.
const SAMPLES: usize = SIDE * SIDE * SIDE;

/// Share of a cell below which it is gone.
pub const LEAST: f64 = 0.05;

/// Rounds in which the surface recedes from what is removed.
const SWEEPS: usize = 6;

/// Depth inside of what is removed that counts as outside, m.
const NEAR: f64 = 1e-8;

/// Signed distance of a position from what is removed, in the frame of the body, m, with its gradient; negative where it is removed.
pub type Distance<'a> = dyn Fn([f64; 3]) -> (f64, [f64; 3]) + Sync + 'a;

/// What a tool takes from a grid at once.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Carved {
    /// Cells in ascending order, with what is left of their samples, 255ths.
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

/// A cell at its present place.
struct Placed {
    low: [f64; 3],
    edges: [f64; 3],
    moved: [[f64; 3]; 8],
}

impl Placed {
    fn new(grid: &Grid, cell: usize, moved: &dyn Fn(u32) -> [f64; 3]) -> Self {
        let corners = grid.params::<f64>().corners(cell);
        let edges = grid.cell_edges(grid.layer(cell) as u32);
        Self { low: grid.rest(corners[0]), edges, moved: corners.map(|node| moved(node as u32)) }
    }

    fn natural(&self, at: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|n| (at[n] - self.low[n]) / self.edges[n])
    }

    /// Present position of a point at rest, m.
    fn now(&self, at: [f64; 3]) -> [f64; 3] {
        let weights = trilinear(self.natural(at));
        [0, 1, 2].map(|n| at[n] + (0..8).map(|a| weights[a] * self.moved[a][n]).sum::<f64>())
    }

    /// Gradient over rest positions, `Fᵀ∇φ`, of what has the gradient `along` over present ones.
    fn slope(&self, at: [f64; 3], along: [f64; 3]) -> [f64; 3] {
        let natural = self.natural(at);
        let slope = |axis: usize| {
            let part = |a: usize| {
                let sign = if corner(a)[axis] == 1 { 1.0 } else { -1.0 };
                let side = |n: usize| if corner(a)[n] == 1 { natural[n] } else { 1.0 - natural[n] };
                let weight: f64 = sign / self.edges[axis] * (0..3).filter(|n| *n != axis).map(side).product::<f64>();
                (0..3).map(|n| weight * self.moved[a][n] * along[n]).sum::<f64>()
            };
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

    /// What is reached of some present cells, in ascending order, and of the surface at their nodes, of which `faces` are; `moved` has the
    /// nodes' displacements, m.
    pub fn reached(
        &self,
        grid: &Grid,
        (cells, faces): (&[u32], &[Face]),
        moved: &(dyn Fn(u32) -> [f64; 3] + Sync),
        of: &Distance,
    ) -> Carved {
        let params = grid.params::<f64>();
        let cells: BTreeMap<usize, Placed> =
            cells.iter().map(|cell| (*cell as usize, Placed::new(grid, *cell as usize, moved))).collect();
        let before = |node: u32| self.corners.get(&node).copied().unwrap_or_else(|| grid.rest(node as usize));
        let nodes = cells.keys().flat_map(|cell| params.corners(*cell)).map(|node| node as u32);
        let mut corners: BTreeMap<u32, [f64; 3]> = nodes.map(|node| (node, before(node))).collect();
        // corners alone, and points of faces that have all of theirs here
        let mut points: Vec<MaterialPoint> = corners.keys().map(|node| MaterialPoint::node(*node)).collect();
        for face in faces.iter().filter(|face| face.nodes.iter().all(|node| corners.contains_key(node))) {
            let [a, b, c, d] = face.nodes;
            points.extend([[a, b], [b, c], [c, d], [d, a]].map(|ends| MaterialPoint::of(ends, [0.5; 2])));
            points.push(MaterialPoint::of(face.nodes, [0.25; 4]));
        }
        let place = |at: [f64; 3]| grid.cells_at(at).into_iter().find_map(|(cell, _)| cells.get(&cell));
        for _ in 0..SWEEPS {
            let moved = points.iter().filter(|point| recede(grid, point, &mut corners, &place, of)).count();
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
        let edges = place.edges.map(|edge| edge / SIDE as f64);
        let half = [0, 1, 2].map(|n| place.low[n] + 0.5 * place.edges[n]);
        // the whole cell may be out of reach
        let (middle, slope) = place.distance(half, of);
        if middle > (0..3).map(|n| slope[n].abs() * place.edges[n]).sum::<f64>() {
            return None;
        }
        let mut left = self.cells.get(&cell).cloned().unwrap_or_else(|| vec![u8::MAX; SAMPLES]);
        let mut less = false;
        for (k, left) in left.iter_mut().enumerate().filter(|(_, left)| **left > 0) {
            let at = [k % SIDE, k / SIDE % SIDE, k / SIDE / SIDE];
            let at = [0, 1, 2].map(|n| place.low[n] + (at[n] as f64 + 0.5) * edges[n]);
            // the part of the sample's box that is left, as if the surface were a plane across it
            let (distance, slope) = place.distance(at, of);
            let width: f64 = (0..3).map(|n| slope[n].abs() * edges[n]).sum();
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
        let mut thinned = |(cell, left): &(u32, Vec<u8>)| {
            let before = self.share(*cell as usize);
            self.cells.insert(*cell, left.clone());
            Thinned { cell: *cell, before, after: mean(left) }
        };
        carved.cells.iter().map(|own| thinned(own)).collect()
    }

    /// Corner of the surface at a node, where it is not the node itself.
    pub fn corner(&self, grid: &Grid, alive: &[bool], node: usize) -> Option<Corner> {
        let at = *self.corners.get(&(node as u32))?;
        let params = grid.params::<f64>();
        let level = params.node_at(node);
        let around = (0..8).filter_map(|a| params.cell_below(level, a));
        let present: Vec<usize> = around.filter(|cell| alive[*cell]).collect();
        if present.is_empty() || present.len() == 8 {
            return None; // not on the surface
        }
        // the cell that it is in, or of those around the node the one that it is nearest to
        let natural = |cell: usize| Placed::new(grid, cell, &|_| [0.0; 3]).natural(at);
        let outside = |cell: &usize| natural(*cell).iter().map(|t| (t - t.clamp(0.0, 1.0)).powi(2)).sum::<f64>();
        let within = grid.cells_at(at).into_iter().find(|(cell, _)| alive[*cell]).map(|(cell, _)| cell);
        let cell = within.or_else(|| present.into_iter().min_by(|a, b| outside(a).total_cmp(&outside(b))))?;
        let nodes = params.corners(cell).map(|node| node as u32);
        let start = grid.rest(node);
        Some(Corner { offset: [0, 1, 2].map(|n| at[n] - start[n]), nodes, weights: trilinear(natural(cell)) })
    }
}

/// Moves the corners that a point of the surface is between out of what is removed, the least that does it to first order, and not out of the
/// body's box; false if the point is not in it.
fn recede<'a>(
    grid: &Grid,
    point: &MaterialPoint,
    corners: &mut BTreeMap<u32, [f64; 3]>,
    place: &dyn Fn([f64; 3]) -> Option<&'a Placed>,
    of: &Distance,
) -> bool {
    let mut now = [0.0; 3];
    let mut places = vec![];
    for (node, weight) in &point.0 {
        let at = corners[node];
        let Some(own) = place(at) else { return false };
        let there = own.now(at);
        (0..3).for_each(|n| now[n] += weight * there[n]);
        places.push((*node, *weight, at, own));
    }
    let (distance, along) = of(now);
    if distance >= -NEAR {
        return false;
    }
    // the way out of each corner at rest, without what would leave the box
    let [x, y] = grid.size().map(|size| 0.5 * size);
    let (low, high) = ([-x, -y, 0.0], [x, y, grid.thickness()]);
    let ways: Vec<[f64; 3]> = places
        .iter()
        .map(|(_, _, at, own)| {
            let slope = own.slope(*at, along);
            let leaves = |n: usize| (at[n] <= low[n] && slope[n] < 0.0) || (at[n] >= high[n] && slope[n] > 0.0);
            std::array::from_fn(|n| if leaves(n) { 0.0 } else { slope[n] })
        })
        .collect();
    let squared = |way: &[f64; 3]| way.iter().map(|c| c * c).sum::<f64>();
    let sum: f64 = places.iter().zip(&ways).map(|((_, weight, ..), way)| weight * weight * squared(way)).sum();
    if sum == 0.0 {
        return false;
    }
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
