//! Where nodes are, as far as reading a scene needs it: a region must hold some.

use super::raw::{At, Points};
use super::text::{SceneText, in_mm};
use super::{Layer, Region, Skin, TestForm};
use crate::error::{Error, Result};

/// Rounding between lengths in mm and node positions in m; a billionth of a metre is far below any cell.
pub(super) const SLACK: f64 = 1e-9;

/// Nodes that 32-bit indices reach in every array: the largest has 64 numbers a node.
pub const MOST_NODES: u32 = u32::MAX / 64;

/// One grid of nodes: the scene's, or its test form's.
pub(super) struct Grid<'a> {
    pub name: &'static str,
    size: [f64; 2],
    cells: [u32; 2],
    layers: &'a [Layer],
}

/// The scene's grid, then that of its test form if it has its own cells.
pub(super) fn grids<'a>(skin: &'a Skin, test: &Option<TestForm>) -> Vec<Grid<'a>> {
    let grid = |name, cells| Grid { name, size: skin.size, cells, layers: &skin.layers };
    let mut grids = vec![grid("scene", skin.cells)];
    grids.extend(test.and_then(|test| test.cells).map(|cells| grid("test form", cells)));
    grids
}

/// An error when the nodes of a grid cannot be numbered.
pub(super) fn numbered(scene: &SceneText, cells: [u32; 2], layers: &[Layer], at: &At<Vec<u32>>) -> Result<()> {
    let over_thickness: u64 = layers.iter().map(|layer| u64::from(layer.cells)).sum();
    let found = (u64::from(cells[0]) + 1)
        .saturating_mul(u64::from(cells[1]) + 1)
        .saturating_mul(over_thickness.saturating_add(1));
    if found <= u64::from(MOST_NODES) {
        return Ok(());
    }
    Err(Error::TooManyNodes { at: scene.place(at.span()), found, limit: MOST_NODES })
}

impl Grid<'_> {
    /// Nodes form a product of three rows, so a box holds one exactly if each of its intervals does.
    pub fn holds_node(&self, scene: &SceneText, at: &Points, min: [f64; 3], max: [f64; 3]) -> Result<()> {
        for axis in 0..3 {
            let rows = self.rows(axis);
            if rows.iter().any(|row| row.holds_node(min[axis], max[axis])) {
                continue;
            }
            return Err(Error::EmptyRegion {
                at: scene.place(at.span()),
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

    /// Whether the region holds one of the nodes.
    pub fn holds(&self, region: &Region) -> bool {
        let along = |axis: usize| self.rows(axis).iter().flat_map(Row::places).collect::<Vec<f64>>();
        let (xs, ys, zs) = (along(0), along(1), along(2));
        let top = zs[zs.len() - 1];
        zs.iter().any(|z| ys.iter().any(|y| xs.iter().any(|x| region.holds([*x, *y, *z], self.size, top))))
    }

    /// The first axis along which a point lies beyond the skin, and the skin's ends along it, m.
    pub fn beyond(&self, point: [f64; 3]) -> Option<(usize, [f64; 2])> {
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

    fn places(&self) -> impl Iterator<Item = f64> {
        let (start, step) = (self.start, self.step);
        (0..=self.cells).map(move |k| start + step * f64::from(k))
    }

    fn holds_node(&self, min: f64, max: f64) -> bool {
        let first = ((min - SLACK - self.start) / self.step).ceil().max(0.0);
        let last = ((max + SLACK - self.start) / self.step).floor().min(f64::from(self.cells));
        first <= last
    }
}
