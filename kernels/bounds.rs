//! Minimum and maximum displacement over each tile of the body, for conservative bounding boxes of the skin.
//!
//! A tile is 8×8 columns of cells over all z-levels. Its nodes are the 9×9 columns of their corners; nodes on a seam count for each
//! adjacent tile. A body without cells is one tile, all of its nodes. The displacement of a point in a hexahedron is a weighted mean of
//! those of its corners, so every point of a tile moves by a value between the two. A node with an infinite or NaN displacement is excluded
//! and counted. A tile without any other node has its minimum above its maximum.
//! Units: m.

use super::{Params, Source};
use crate::math::{Real, V4};

/// The shader.
pub const SOURCE: Source = Source { name: "bounds", wgsl: include_str!("bounds.wgsl"), params: Params::<f32>::FIELDS };

/// Number of cells along a side of a tile.
pub const TILE: usize = 8;

/// Number of tiles along x and y.
pub fn tiles<R: Real>(params: &Params<R>) -> [usize; 2] {
    [params.cells_x, params.cells_y].map(|n| (n as usize).div_ceil(TILE).max(1))
}

/// Number of tiles for `node_count` nodes: those of the grid, then one per [`TILE`] duplicate columns.
pub fn tile_count<R: Real>(params: &Params<R>) -> usize {
    let [x, y] = tiles(params);
    x * y + params.extra_allocated().div_ceil(TILE)
}

/// First cell column of a tile along x and y, and the one after its last.
pub fn columns<R: Real>(params: &Params<R>, tile: usize) -> [[usize; 2]; 2] {
    let across = tiles(params)[0];
    let first = [tile % across * TILE, tile / across * TILE];
    if params.cells_x == 0 {
        return [first, [params.nodes_x as usize - 1, params.nodes_y as usize - 1]];
    }
    [first, [(first[0] + TILE).min(params.cells_x as usize), (first[1] + TILE).min(params.cells_y as usize)]]
}

/// All tiles.
pub fn bounds<R: Real>(
    params: &Params<R>,
    u: &[V4<R>],               // [node] m
    tile_bounds: &mut [V4<R>], // [tile × 2] least m, number of non-finite nodes; greatest m, 0
) {
    for (tile, pair) in tile_bounds.chunks_exact_mut(2).enumerate() {
        pair.copy_from_slice(&bounds_of_tile(params, u, tile));
    }
}

/// One tile of [`bounds`].
pub fn bounds_of_tile<R: Real>(params: &Params<R>, u: &[V4<R>], tile: usize) -> [V4<R>; 2] {
    let [x, y] = tiles(params);
    let largest = R::of(f64::from(f32::MAX));
    let (mut low, mut high) = ([largest, largest, largest, R::zero()], [-largest, -largest, -largest, R::zero()]);
    let mut add = |d: V4<R>| {
        if !d[..3].iter().all(|c| c.is_finite()) {
            low[3] += R::one();
            return;
        }
        for n in 0..3 {
            low[n] = low[n].min(d[n]);
            high[n] = high[n].max(d[n]);
        }
    };
    for k in 0..params.nodes_z as usize {
        if tile < x * y {
            let [first, last] = columns(params, tile);
            for (j, i) in (first[1]..=last[1]).flat_map(|j| (first[0]..=last[0]).map(move |i| (j, i))) {
                add(u[params.node_id([i, j, k])]);
            }
        } else {
            // no group spans two bundles
            let first = (tile - x * y) * TILE;
            let count = TILE.min(params.extra_columns as usize - first);
            u[params.copy_id(first, k)..][..count].iter().for_each(|d| add(*d));
        }
    }
    [low, high]
}
