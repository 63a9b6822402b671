//! How a surface is embedded in a grid: what of each cell is inside, and which cell each of its points moves with ([`super::embedded`]).

use super::embedded::{Embedded, Misfit};
use super::point::trilinear;
use super::unstructured::{Extent, extend};
use super::{Face, Grid};
use crate::kernels::{Params, corner};
use crate::scene::{ClosedSurface, Group, Skin};
use glam::DVec3;
use rayon::prelude::*;
use std::borrow::Cow;
use std::collections::VecDeque;
use std::sync::Arc;

/// Share of a cell below which it is gone. Its mass is lost: at most this share of a cut cell.
const GONE: f64 = 1e-4;
/// What is inside of a row of cells along x, at all levels.
#[derive(Clone, Default)]
struct Inside {
    share: f64,
    corners: [f64; 8], // ∫ N_a over the cell's volume
}

impl Grid {
    /// Grid of a skin with what is embedded in it, or the nodes of its mesh.
    pub fn new(skin: &Skin) -> Self {
        let mut grid = Self::whole(skin);
        grid.embedded = skin.embedded.as_ref().map(|surface| Arc::new(Embedded::new(&grid, skin, surface)));
        grid
    }
}

impl Embedded {
    /// Embeds the surface of a skin in its grid.
    pub(super) fn new(grid: &Grid, skin: &Skin, surface: &Arc<ClosedSurface>) -> Self {
        let params = grid.params::<f64>();
        let (share, mass) = inside(grid, skin, surface);
        let fine = match surface.in_cells(skin.size, skin.cells) {
            Cow::Borrowed(_) => surface.clone(),
            Cow::Owned(fine) => Arc::new(fine),
        };
        let mut out = Self {
            surface: fine.clone(),
            share,
            mass,
            nodes: vec![],
            weights: vec![],
            outside: vec![],
            behind: vec![],
            beyond: 0.0,
            groups: vec![],
            misfit: None,
        };
        // the points of the surface, each with its cell
        let mut cells = vec![];
        for point in fine.points() {
            let (cell, natural) = out.carrier(grid, &params, *point).unwrap_or_else(|nearest| {
                out.misfit = Some(Misfit::Thin(*point));
                nearest
            });
            let weights = trilinear(natural);
            out.beyond = out.beyond.max(0.5 * (weights.iter().map(|w| w.abs()).sum::<f64>() - 1.0));
            out.nodes.push(params.corners(cell).map(|id| id as u32));
            out.weights.push(weights);
            cells.push(cell as u32);
        }
        let parts = [out.parts(&params), bodies(surface)];
        if out.misfit.is_none() && parts[0] != parts[1] {
            out.misfit = Some(Misfit::Apart(parts[0], parts[1]));
        }
        let first = params.node_count;
        let face = |t: &[u32; 3]| Face::triangle(t.map(|id| first + id), cells[t[0] as usize]);
        out.outside = fine.triangles().iter().map(face).collect();
        out.behind = out.behind(grid, &params, &cells);
        let of_group = |group: &Group| {
            let nodes = group.nodes().iter().flat_map(|point| out.point(*point).0).map(|(node, _)| node);
            Group::new(group.name().to_string(), nodes.collect())
        };
        out.groups = fine.groups().iter().map(of_group).collect();
        out
    }

    /// The present cell that a point moves with, and its natural coordinates there: of the cells that contain it the one with most inside;
    /// otherwise the nearest one beside those. Without one beside it the cell that contains it.
    fn carrier(
        &self,
        grid: &Grid,
        params: &Params<f64>,
        at: [f64; 3],
    ) -> std::result::Result<(usize, [f64; 3]), (usize, [f64; 3])> {
        let around = grid.cells_at(at);
        let fullest = around.iter().max_by(|a, b| self.share[a.0].total_cmp(&self.share[b.0]));
        let own = *fullest.unwrap_or_else(|| unreachable!("a position is in a cell of the grid's box"));
        if self.share[own.0] > 0.0 {
            return Ok(own);
        }
        let place = params.cell_at(own.0);
        let mut best = (f64::INFINITY, own);
        for number in 0..27 {
            let step = [number % 3, number / 3 % 3, number / 9];
            let next = [0, 1, 2].map(|n| place[n] + step[n]); // one more than the cell
            if (0..3).any(|n| next[n] == 0 || next[n] > grid.cells[n]) {
                continue;
            }
            let cell = params.cell_id(next.map(|n| n - 1));
            if self.share[cell] == 0.0 {
                continue;
            }
            let natural = grid.natural_in(params, cell, at);
            let far = natural.iter().map(|t| (t - t.clamp(0.0, 1.0)).powi(2)).sum::<f64>();
            if far < best.0 {
                best = (far, (cell, natural));
            }
        }
        if best.0.is_finite() { Ok(best.1) } else { Err(best.1) }
    }

    /// Present cells that share a face with a cell.
    fn beside(&self, params: &Params<f64>, cell: usize) -> impl Iterator<Item = usize> {
        let (at, size) = (params.cell_at(cell), [params.cells_x, params.cells_y, params.cells_z]);
        let strides = [1, params.cells_x as usize, (params.cells_x * params.cells_y) as usize];
        (0..3).flat_map(move |axis| {
            let before = (at[axis] > 0).then(|| cell - strides[axis]);
            let after = (at[axis] + 1 < size[axis] as usize).then(|| cell + strides[axis]);
            [before, after].into_iter().flatten().filter(|other| self.share[*other] > 0.0)
        })
    }

    /// Number of parts that present cells come in.
    fn parts(&self, params: &Params<f64>) -> usize {
        let mut seen: Vec<bool> = self.share.iter().map(|share| *share == 0.0).collect();
        let (mut count, mut open) = (0, vec![]);
        for first in 0..seen.len() {
            if std::mem::replace(&mut seen[first], true) {
                continue;
            }
            count += 1;
            open.push(first);
            while let Some(cell) = open.pop() {
                for next in self.beside(params, cell) {
                    if !std::mem::replace(&mut seen[next], true) {
                        open.push(next);
                    }
                }
            }
        }
        count
    }

    /// Boxes around triangles and the cells behind them: those that are reached from their points' cells first, from cell to cell.
    fn behind(&self, grid: &Grid, params: &Params<f64>, cells: &[u32]) -> Vec<[[f64; 3]; 2]> {
        let triangles = self.surface.triangles();
        let mut owner = vec![None; self.share.len()];
        let mut queue = VecDeque::new();
        for (number, triangle) in triangles.iter().enumerate() {
            for cell in triangle.map(|id| cells[id as usize] as usize) {
                if owner[cell].is_none() {
                    owner[cell] = Some(number);
                    queue.push_back(cell);
                }
            }
        }
        while let Some(cell) = queue.pop_front() {
            for next in self.beside(params, cell) {
                if owner[next].is_none() {
                    owner[next] = owner[cell];
                    queue.push_back(next);
                }
            }
        }
        let around = |triangle: &[u32; 3]| {
            let corners = triangle.map(|id| self.surface.points()[id as usize]);
            let bound = |by: fn(f64, f64) -> f64| {
                [0, 1, 2].map(|n| corners.map(|x| x[n]).into_iter().reduce(by).unwrap_or(0.0))
            };
            [bound(f64::min), bound(f64::max)]
        };
        let mut boxes: Vec<Extent> = triangles.iter().map(around).collect();
        for (cell, owner) in owner.iter().enumerate() {
            let Some(owner) = owner else { continue };
            grid.cell_box(params, cell).into_iter().for_each(|x| extend(&mut boxes[*owner], x));
        }
        boxes
    }
}

/// Number of separate bodies that a surface encloses: its connected parts of positive volume; those of negative volume are cavities.
fn bodies(surface: &ClosedSurface) -> usize {
    let mut parent: Vec<u32> = (0..surface.points().len() as u32).collect();
    fn root(parent: &mut [u32], mut id: u32) -> u32 {
        while parent[id as usize] != id {
            parent[id as usize] = parent[parent[id as usize] as usize];
            id = parent[id as usize];
        }
        id
    }
    for [a, b, c] in surface.triangles() {
        let first = root(&mut parent, *a);
        for id in [*b, *c] {
            let other = root(&mut parent, id);
            parent[other as usize] = first;
        }
    }
    let mut volume = vec![0.0; parent.len()];
    for [a, b, c] in surface.triangles() {
        let [p, q, r] = [a, b, c].map(|id| DVec3::from_array(surface.points()[*id as usize]));
        volume[root(&mut parent, *a) as usize] += p.dot(q.cross(r));
    }
    volume.into_iter().filter(|volume| *volume > 0.0).count()
}

/// `[cell]` shares inside, and `[node]` masses, kg.
fn inside(grid: &Grid, skin: &Skin, surface: &ClosedSurface) -> (Vec<f64>, Vec<f64>) {
    let params = grid.params::<f64>();
    let [width, depth, _] = grid.cells;
    // triangles of each row of cells along x
    let mut of_row: Vec<Vec<usize>> = vec![vec![]; depth];
    for (t, triangle) in surface.triangles().iter().enumerate() {
        let [low, high] = ends(triangle.map(|id| surface.points()[id as usize][1]));
        (number(low, grid.edge[1], depth)..=number(high, grid.edge[1], depth)).for_each(|j| of_row[j].push(t));
    }
    let rows: Vec<Vec<Inside>> =
        of_row.par_iter().enumerate().map(|(j, triangles)| inside_row(grid, surface, j, triangles)).collect();
    let mut share = vec![0.0; grid.cell_count()];
    let mut mass = vec![0.0; grid.node_count()];
    for (j, row) in rows.iter().enumerate() {
        for (number, found) in row.iter().enumerate().filter(|(_, found)| found.share >= GONE) {
            let cell = params.cell_id([number % width, j, number / width]);
            let layer = grid.layer(cell);
            let full = skin.layers[layer].density * grid.cell_edges(layer as u32).iter().product::<f64>();
            share[cell] = found.share.min(1.0);
            let once = share[cell] / found.share; // where a surface overlaps itself
            for (node, part) in params.corners(cell).into_iter().zip(found.corners) {
                mass[node] += full * part * once;
            }
        }
    }
    (share, mass)
}

/// Least and largest of some numbers.
fn ends<const N: usize>(values: [f64; N]) -> [f64; 2] {
    values.into_iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)])
}

/// Index of the cell at a coordinate along x or y, of `count` about the middle.
fn number(coordinate: f64, edge: f64, count: usize) -> usize {
    (coordinate / edge + 0.5 * count as f64).floor().clamp(0.0, (count - 1) as f64) as usize
}

/// `[level × width]` what is inside of a row of cells: of each cell the integral of what is below the triangles that face up, less that of
/// those that face down.
fn inside_row(grid: &Grid, surface: &ClosedSurface, j: usize, triangles: &[usize]) -> Vec<Inside> {
    let [width, depth, height] = grid.cells;
    let mut out = vec![Inside::default(); width * height];
    let start = |axis: usize, k: usize| (k as f64 - 0.5 * grid.cells[axis] as f64) * grid.edge[axis];
    for t in triangles {
        let corners = surface.triangles()[*t].map(|id| DVec3::from_array(surface.points()[id as usize]));
        let in_row = clipped(&corners, 1, [start(1, j), start(1, j + 1)], [j == 0, j + 1 == depth]);
        let [low, high] = ends(corners.map(|x| x.x));
        for i in number(low, grid.edge[0], width)..=number(high, grid.edge[0], width) {
            let piece = clipped(&in_row, 0, [start(0, i), start(0, i + 1)], [i == 0, i + 1 == width]);
            if piece.len() < 3 {
                continue;
            }
            let place = |x: DVec3| [(x.x - start(0, i)) / grid.edge[0], (x.y - start(1, j)) / grid.edge[1]];
            add_below(grid, &piece, place, |k| i + width * k, &mut out);
        }
    }
    out
}

/// The part of a polygon between two planes across an axis; a plane that is `open` does not cut.
fn clipped(polygon: &[DVec3], axis: usize, planes: [f64; 2], open: [bool; 2]) -> Vec<DVec3> {
    let mut kept = polygon.to_vec();
    for ((plane, side), _) in planes.into_iter().zip([1.0, -1.0]).zip(open).filter(|(_, open)| !open) {
        let whole = std::mem::take(&mut kept);
        let height = |x: &DVec3| side * (x[axis] - plane);
        for (k, here) in whole.iter().enumerate() {
            let next = &whole[(k + 1) % whole.len()];
            let (a, b) = (height(here), height(next));
            if a >= 0.0 {
                kept.push(*here);
            }
            if (a > 0.0 && b < 0.0) || (a < 0.0 && b > 0.0) {
                kept.push(here.lerp(*next, a / (a - b)));
            }
        }
    }
    kept
}

/// Adds what is below a polygon in a column of cells to these; `place` gives natural coordinates across.
fn add_below(
    grid: &Grid,
    polygon: &[DVec3],
    place: impl Fn(DVec3) -> [f64; 2],
    cell: impl Fn(usize) -> usize,
    out: &mut [Inside],
) {
    let height = grid.cells[2];
    let level = |z: f64| grid.heights.partition_point(|level| *level <= z).clamp(1, height) - 1;
    let bound = |start: f64, by: fn(f64, f64) -> f64| polygon.iter().fold(start, |sum, x| by(sum, x.z));
    let [low, high] = [bound(f64::INFINITY, f64::min), bound(f64::NEG_INFINITY, f64::max)];
    let (first, last) = (level(low), level(high));
    let mut above = Inside::default(); // below what lies in higher levels
    for k in (0..=last).rev() {
        let own = &mut out[cell(k)];
        own.share += above.share;
        own.corners.iter_mut().zip(above.corners).for_each(|(own, above)| *own += above);
        if k < first {
            continue;
        }
        let (bottom, top) = (grid.heights[k], grid.heights[k + 1]);
        // one that lies level, maybe between two levels, is whole in one of them
        let piece = clipped(polygon, 2, [bottom, top], [k == 0 || low == high, k + 1 == height || low == high]);
        for n in 2..piece.len() {
            let triangle = [piece[0], piece[n - 1], piece[n]];
            let [a, b, c] = triangle.map(&place);
            let area = 0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]));
            for (weight, shares) in POINTS {
                for turn in 0..3 {
                    let of =
                        |at: fn(DVec3) -> f64| (0..3).map(|m| shares[(m + turn) % 3] * at(triangle[m])).sum::<f64>();
                    let [xi, eta] = place(DVec3::new(of(|x| x.x), of(|x| x.y), 0.0));
                    let up = ((of(|x| x.z) - bottom) / (top - bottom)).clamp(0.0, 1.0);
                    let upper = 0.5 * up * up;
                    own.share += weight * area * up;
                    above.share += weight * area;
                    for a in 0..8 {
                        let [x, y, z] = corner(a);
                        let across = weight * area * [1.0 - xi, xi][x] * [1.0 - eta, eta][y];
                        own.corners[a] += across * [up - upper, upper][z];
                        above.corners[a] += 0.5 * across;
                    }
                }
            }
        }
    }
}

/// Weights and barycentric coordinates of six points of a triangle, three of each kind, that integrate polynomials of degree 4.
/// Source: Dunavant 1985.
const POINTS: [(f64, [f64; 3]); 2] = [
    (0.223_381_589_678_011, [0.108_103_018_168_070, 0.445_948_490_915_965, 0.445_948_490_915_965]),
    (0.109_951_743_655_322, [0.816_847_572_980_458, 0.091_576_213_509_771, 0.091_576_213_509_771]),
];
