//! The broad phase: boxes over the tiles of a body, in a tree that is built once and refitted as the skin moves.
//!
//! A tile ([`crate::kernels::bounds`]) of rest box `R` whose nodes move by something between `l` and `g` lies in
//! `[R.low + l, R.high + g]`, whatever else it does: skin is found where it is now, however far it has come. A tile is whole columns of
//! cells, so its box holds what is under the surface too, and a point that has sunk into the skin still meets it.
//!
//! Tiles whose boxes meet a tool's are looked at column by column with the same two displacements; the surface of the columns that may
//! meet the tool's box goes to the narrow phase. Leaves are rounded outward to the f32 of parry3d.
//! Units: m.

use crate::kernels::bounds::{columns, tiles};
use crate::math::V4;
use crate::mesh::{Grid, Quad, Surface};
use glam::DVec3;
use parry3d::bounding_volume::Aabb;
use parry3d::math::Vector;
use parry3d::partitioning::{Bvh, BvhBuildStrategy};

/// What f64 may take from a place along the grid, cells (10⁶ of them are known to 10⁻¹⁰): a face on the rim of an area stays in.
const ROUNDING: f64 = 1e-6;

/// Boxes over the tiles of one body.
pub struct Boxes {
    tree: Bvh,
    rest: Vec<[DVec3; 2]>,   // [tile] box at rest
    motion: Vec<[DVec3; 2]>, // [tile] least and greatest displacement
    moved: f64,              // most that one of these changed at the last refit, m
}

/// The f32 box that holds an f64 one.
fn outward(low: DVec3, high: DVec3) -> Aabb {
    let next = |v: DVec3, to: fn(f32) -> f32| Vector::from_array(v.to_array().map(|c| to(c as f32)));
    Aabb::new(next(low, f32::next_down), next(high, f32::next_up))
}

impl Boxes {
    /// Boxes of a body at rest.
    pub fn new(grid: &Grid) -> Self {
        let params = grid.params::<f64>();
        let [x, y] = tiles(&params);
        let rest: Vec<[DVec3; 2]> = (0..x * y)
            .map(|tile| {
                let [first, last] = columns(&params, tile);
                let corner = |c: [usize; 2], z: usize| grid.rest(params.node_id([c[0], c[1], z]));
                [corner(first, 0), corner(last, grid.cells[2])].map(DVec3::from_array)
            })
            .collect();
        let leaves: Vec<Aabb> = rest.iter().map(|[low, high]| outward(*low, *high)).collect();
        let motion = vec![[DVec3::ZERO; 2]; rest.len()];
        Self { tree: Bvh::from_leaves(BvhBuildStrategy::Binned, &leaves), rest, motion, moved: 0.0 }
    }

    /// Fits the boxes to what the tiles move between, `[tile]` least and greatest displacement as `Backend::bounds` has them; returns how
    /// many nodes are nowhere. A tile all of whose nodes are nowhere keeps its rest box.
    pub fn refit(&mut self, bounds: &[[V4<f64>; 2]]) -> usize {
        self.moved = 0.0;
        for (tile, pair) in bounds.iter().enumerate().take(self.rest.len()) {
            let [least, greatest] = pair.map(|v| DVec3::new(v[0], v[1], v[2]));
            let nowhere = least.x > greatest.x;
            let now = if nowhere { [DVec3::ZERO; 2] } else { [least, greatest] };
            let before = std::mem::replace(&mut self.motion[tile], now);
            self.moved = (0..2).map(|n| now[n].distance(before[n])).fold(self.moved, f64::max);
            self.tree.insert_or_update_partially(self.around(tile), tile as u32, 0.0);
        }
        self.tree.refit_without_opt();
        bounds.iter().map(|pair| pair[0][3] as usize).sum()
    }

    /// A tile's box.
    pub fn around(&self, tile: usize) -> Aabb {
        let ([low, high], [least, greatest]) = (self.rest[tile], self.motion[tile]);
        outward(low + least, high + greatest)
    }

    /// Most that a tile's least or greatest displacement changed at the last refit, m: how far the body moves in a step.
    pub fn moved(&self) -> f64 {
        self.moved
    }

    /// Corners of the box around all tiles.
    pub fn all(&self) -> [DVec3; 2] {
        let nothing = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        self.rest
            .iter()
            .zip(&self.motion)
            .fold(nothing, |[low, high], (rest, motion)| [low.min(rest[0] + motion[0]), high.max(rest[1] + motion[1])])
    }

    /// How many tiles there are.
    pub fn count(&self) -> usize {
        self.rest.len()
    }

    /// Tiles whose boxes meet an area, in order.
    pub fn tiles(&self, area: &Aabb) -> Vec<usize> {
        let mut found: Vec<usize> = self.tree.intersect_aabb(area).map(|tile| tile as usize).collect();
        found.sort_unstable();
        found
    }

    /// Surface of the columns of cells that may meet an area.
    pub fn faces(&self, grid: &Grid, surface: &Surface, area: &Aabb) -> Vec<Quad> {
        let params = grid.params::<f64>();
        let mut out = vec![];
        for tile in self.tiles(area) {
            let [least, greatest] = self.motion[tile];
            let (low, high) = (area.mins.as_dvec3() - greatest, area.maxs.as_dvec3() - least);
            let [mut first, mut last] = columns(&params, tile);
            for axis in 0..2 {
                let at = |x: f64| x / grid.edge[axis] + 0.5 * grid.cells[axis] as f64;
                first[axis] = first[axis].max((at(low[axis]) - ROUNDING).floor().max(0.0) as usize);
                last[axis] = last[axis].min((at(high[axis]) + ROUNDING).ceil().max(0.0) as usize);
            }
            surface.quads([first[0], first[1], 0], [last[0], last[1], grid.cells[2]], &mut out);
        }
        out
    }
}
