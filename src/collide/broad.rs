//! Broad phase: bounding boxes of a body's tiles, in a tree that is built once and refitted as the skin moves (van den Bergen 1997).
//!
//! A tile ([`crate::kernels::bounds`]) with rest box `R` whose nodes' displacements lie between `l` and `g` is contained in
//! `[R.low + l, R.high + g]`, for any motion: skin is found wherever it has moved to. A tile is whole columns of cells, so its box contains
//! what is below the surface too, and a point that has sunk into the skin still meets it.
//!
//! Tiles whose boxes meet a tool's are searched column by column with the same two displacements; the surface of the columns that may meet
//! the tool's box goes to the narrow phase. A mesh of tetrahedra is one tile; its triangles are searched one by one with the boxes of the
//! tetrahedra behind them ([`crate::mesh::Unstructured`]). So are those of an embedded surface, with the cells behind them
//! ([`crate::mesh::Embedded`]) and the displacements of the tiles that these are in. Leaves are rounded outward to the f32 of parry3d.
//! Units: m.

use crate::kernels::Params;
use crate::kernels::bounds::{TILE, columns, tile_count, tiles};
use crate::math::V4;
use crate::mesh::{Face, Grid, Surface};
use glam::DVec3;
use parry3d::bounding_volume::{Aabb, BoundingVolume};
use parry3d::math::Vector;
use parry3d::partitioning::{Bvh, BvhBuildStrategy};
use std::collections::BTreeSet;

/// Rounding of a position along the grid in f64, cells (10⁶ of them are known to 10⁻¹⁰): a face on the rim of an area is kept.
const ROUNDING: f64 = 1e-6;

/// Bounding boxes of one body's tiles.
pub struct Boxes {
    tree: Bvh,
    rest: Vec<[DVec3; 2]>,   // [tile] rest box
    motion: Vec<[DVec3; 2]>, // [tile] least and greatest displacement
    of_grid: usize,          // tiles of the grid; groups of duplicate columns follow
    moved: f64,              // largest change of these at the last refit, m
}

/// f32 box that contains an f64 one.
fn outward(low: DVec3, high: DVec3) -> Aabb {
    let next = |v: DVec3, to: fn(f32) -> f32| Vector::from_array(v.to_array().map(|c| to(c as f32)));
    Aabb::new(next(low, f32::next_down), next(high, f32::next_up))
}

/// Rest box around some node columns.
fn around_columns(grid: &Grid, columns: &[u32]) -> [DVec3; 2] {
    let top = grid.thickness();
    let nothing = [DVec3::INFINITY, DVec3::NEG_INFINITY];
    columns.iter().fold(nothing, |[low, high], column| {
        let at = DVec3::from_array(grid.rest(*column as usize));
        [low.min(at), high.max(at.with_z(top))]
    })
}

/// Cell columns around a node column.
fn cells_around(params: &Params<f64>, column: u32) -> Vec<[usize; 2]> {
    let (x, y) = (column as usize % params.nodes_x as usize, column as usize / params.nodes_x as usize);
    let ends = |n: usize, cells: u32| n.saturating_sub(1)..(n + 1).min(cells as usize);
    ends(y, params.cells_y).flat_map(|j| ends(x, params.cells_x).map(move |i| [i, j])).collect()
}

impl Boxes {
    /// Boxes of a body at rest.
    pub fn new(surface: &Surface) -> Self {
        let (grid, params) = (surface.grid(), surface.params());
        let [x, y] = tiles(params);
        let mut rest: Vec<[DVec3; 2]> = (0..x * y)
            .map(|tile| {
                let [first, last] = columns(params, tile);
                if grid.unstructured.is_some() {
                    let [x, y] = grid.size().map(|size| 0.5 * size);
                    return [DVec3::new(-x, -y, 0.0), DVec3::new(x, y, grid.thickness())];
                }
                let corner = |c: [usize; 2], z: usize| grid.rest(params.node_id([c[0], c[1], z]));
                [corner(first, 0), corner(last, grid.cells[2])].map(DVec3::from_array)
            })
            .collect();
        // degenerate until there are duplicated nodes
        rest.resize(tile_count(params), [rest[0][0]; 2]);
        let leaves: Vec<Aabb> = rest.iter().map(|[low, high]| outward(*low, *high)).collect();
        let motion = vec![[DVec3::ZERO; 2]; rest.len()];
        Self { tree: Bvh::from_leaves(BvhBuildStrategy::Binned, &leaves), rest, motion, of_grid: x * y, moved: 0.0 }
    }

    /// Refits the boxes to the tiles' bounds, `[tile]` least and greatest displacement as from `Backend::bounds`; returns the number of
    /// non-finite nodes. A tile without finite nodes keeps its rest box.
    pub fn refit(&mut self, surface: &Surface, bounds: &[[V4<f64>; 2]]) -> usize {
        let (grid, parents) = (surface.grid(), surface.parts.parents());
        self.moved = 0.0;
        self.rest.truncate(self.of_grid);
        self.rest.extend(parents.chunks(TILE).map(|group| around_columns(grid, group)));
        let count = self.rest.len();
        self.motion.resize(count, [DVec3::ZERO; 2]);
        for (tile, pair) in bounds.iter().enumerate().take(count) {
            let [least, greatest] = pair.map(|v| DVec3::new(v[0], v[1], v[2]));
            let is_empty = least.x > greatest.x; // no finite node
            let now = if is_empty { [DVec3::ZERO; 2] } else { [least, greatest] };
            let before = std::mem::replace(&mut self.motion[tile], now);
            self.moved = (0..2).map(|n| now[n].distance(before[n])).fold(self.moved, f64::max);
            self.tree.insert_or_update_partially(self.around(tile), tile as u32, 0.0);
        }
        self.tree.refit_without_opt();
        bounds.iter().map(|pair| pair[0][3] as usize).sum()
    }

    /// Box of a tile.
    pub fn around(&self, tile: usize) -> Aabb {
        let ([low, high], [least, greatest]) = (self.rest[tile], self.motion[tile]);
        outward(low + least, high + greatest)
    }

    /// Largest change of a tile's least or greatest displacement at the last refit, m: the body's motion in a step.
    pub fn moved(&self) -> f64 {
        self.moved
    }

    /// Bound on the displacements of all nodes at the end of a step that moves them as far as the last one did, m.
    pub fn farthest(&self) -> f64 {
        self.motion.iter().flatten().map(|u| u.length()).fold(0.0, f64::max) + self.moved
    }

    /// `[tile]` least and greatest displacement at the last refit, m.
    pub fn motion(&self) -> &[[DVec3; 2]] {
        &self.motion
    }

    /// Restores these from another time, as if the last refit had read them.
    pub fn set_motion(&mut self, motion: &[[DVec3; 2]]) {
        self.motion = motion.to_vec();
    }

    /// Corners of the bounding box of all tiles.
    pub fn all(&self) -> [DVec3; 2] {
        let nothing = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        self.rest
            .iter()
            .zip(&self.motion)
            .fold(nothing, |[low, high], (rest, motion)| [low.min(rest[0] + motion[0]), high.max(rest[1] + motion[1])])
    }

    /// Number of tiles.
    pub fn count(&self) -> usize {
        self.rest.len()
    }

    /// Tiles whose boxes meet an area, in ascending order.
    pub fn tiles(&self, area: &Aabb) -> Vec<usize> {
        let mut found: Vec<usize> = self.tree.intersect_aabb(area).map(|tile| tile as usize).collect();
        found.sort_unstable();
        found
    }

    /// Range of the displacements of the tiles that a box at rest meets, widened by a part of it, m.
    fn motion_in(&self, grid: &Grid, params: &Params<f64>, rest: [DVec3; 2], beyond: f64) -> [DVec3; 2] {
        // one cell more on either side: points move with cells beside their own
        let tile = |end: usize, axis: usize, more: f64| {
            let cell = rest[end][axis] / grid.edge[axis] + 0.5 * grid.cells[axis] as f64 + more;
            cell.clamp(0.0, (grid.cells[axis] - 1) as f64) as usize / TILE
        };
        let across = tiles(params)[0];
        let nothing = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        let rows = (tile(0, 1, -1.0 - ROUNDING)..=tile(1, 1, 1.0 + ROUNDING))
            .flat_map(|j| (tile(0, 0, -1.0 - ROUNDING)..=tile(1, 0, 1.0 + ROUNDING)).map(move |i| i + across * j));
        let [least, greatest] = rows.fold(nothing, |[low, high], tile| {
            let [least, greatest] = self.motion[tile];
            [low.min(least), high.max(greatest)]
        });
        let more = (greatest - least) * beyond;
        [least - more, greatest + more]
    }

    /// Surface faces of the cell columns, or of the tetrahedra behind them, that may meet an area.
    pub fn faces(&self, surface: &Surface, area: &Aabb) -> Vec<Face> {
        let grid = surface.grid();
        if let Some(outside) = surface.outside() {
            let [least, greatest] = self.motion[0];
            let meets = |[low, high]: &[[f64; 3]; 2]| {
                outward(DVec3::from_array(*low) + least, DVec3::from_array(*high) + greatest).intersects(area)
            };
            let near = outside.faces.iter().zip(&outside.behind).filter(|(_, behind)| meets(behind));
            return near.map(|(face, _)| *face).collect();
        }
        let params = grid.params::<f64>();
        if let Some(embedded) = &grid.embedded {
            let near = embedded.outside.iter().zip(&embedded.behind).filter(|(_, behind)| {
                let [low, high] = behind.map(DVec3::from_array);
                let [least, greatest] = self.motion_in(grid, &params, [low, high], embedded.beyond);
                outward(low + least, high + greatest).intersects(area)
            });
            return near.map(|(face, _)| *face).collect();
        }
        let mut out = vec![];
        let parents = surface.parts.parents();
        let spread = if parents.is_empty() { 0.0 } else { 1.0 }; // corners of a wound lie up to half a cell beside their nodes
        let beside = spread * 0.5 * DVec3::new(grid.edge[0], grid.edge[1], 0.0);
        let wider = outward(area.mins.as_dvec3() - beside, area.maxs.as_dvec3() + beside);
        let mut looked_at = vec![];
        let mut by_copies = BTreeSet::new(); // cell columns around duplicated nodes in the area
        // grid tiles: the range of cell columns in the area; duplicate columns are collected
        for tile in self.tiles(&wider) {
            if tile >= self.of_grid {
                let group = parents.chunks(TILE).nth(tile - self.of_grid).unwrap_or_default();
                by_copies.extend(group.iter().flat_map(|parent| cells_around(&params, *parent)));
                continue;
            }
            let [least, greatest] = self.motion[tile];
            let (low, high) = (area.mins.as_dvec3() - greatest, area.maxs.as_dvec3() - least);
            let [mut first, mut last] = columns(&params, tile);
            for axis in 0..2 {
                let at = |x: f64| x / grid.edge[axis] + 0.5 * grid.cells[axis] as f64;
                first[axis] = first[axis].max((at(low[axis]) - ROUNDING - spread).floor().max(0.0) as usize);
                last[axis] = last[axis].min((at(high[axis]) + ROUNDING + spread).ceil().max(0.0) as usize);
            }
            surface.quads([first[0], first[1], 0], [last[0], last[1], grid.cells[2]], &mut out);
            looked_at.push([first, last]);
        }
        // cell columns around duplicated nodes, unless covered already
        let new =
            |[x, y]: &[usize; 2]| !looked_at.iter().any(|[a, b]| (a[0]..b[0]).contains(x) && (a[1]..b[1]).contains(y));
        for [x, y] in by_copies.into_iter().filter(new) {
            surface.quads([x, y, 0], [x + 1, y + 1, grid.cells[2]], &mut out);
        }
        out
    }
}
