//! Points in the cells of a grid, for bodies whose elements are these: what probes and fields are read from.

use super::{ElementPoint, Model, Moved, Wound};
use crate::math::{M3, V3, V4};
use rayon::prelude::*;

/// Corners of cells as they are cut now, in ascending order.
pub fn corners(wound: &Wound, cells: impl Iterator<Item = usize>) -> Vec<u32> {
    let parts = &wound.surface.parts;
    let mut nodes: Vec<u32> = cells.flat_map(|cell| parts.corners(cell)).map(|node| node as u32).collect();
    nodes.sort_unstable();
    nodes.dedup();
    nodes
}

/// Nodes of the cells around nodes, or of the tetrahedra of a mesh.
pub fn reached(model: &Model, wound: &Wound, nodes: &[u32]) -> Vec<u32> {
    match model.unstructured() {
        Some(of) => of.mesh.nodes_around(nodes),
        None => {
            let parts = &wound.surface.parts;
            corners(wound, nodes.iter().flat_map(|node| parts.cells_of(*node as usize)))
        }
    }
}

/// Present cells of one layer that contain a rest position in the body's frame: between two layers those of the upper one.
pub fn at(model: &Model, wound: &Wound, point: [f64; 3]) -> Vec<ElementPoint> {
    let mut cells = model.cells_at(point);
    cells.retain(|(cell, _)| wound.surface.alive[*cell]);
    let upper = cells.iter().map(|(cell, _)| model.layer(*cell)).max();
    cells.retain(|(cell, _)| Some(model.layer(*cell)) == upper);
    cells
}

/// Means over points of strain and stress, Pa.
pub fn means(model: &Model, wound: &Wound, points: &[ElementPoint], moved: &Moved) -> [M3<f64>; 2] {
    let mut sum = [M3::zero(); 2];
    for (cell, natural) in points {
        let u = wound.surface.parts.corners(*cell).map(|node| moved(node)[0]);
        let own = model.mechanics().strain_and_stress(model, *cell, &u, *natural);
        sum = [0, 1].map(|k| sum[k] + own[k] * (1.0 / points.len() as f64));
    }
    sum
}

/// `[cell]` strain and stress in the middle, Pa.
pub fn in_the_middle(model: &Model, wound: &Wound, u: &[V4<f64>]) -> Vec<[M3<f64>; 2]> {
    let surface = &wound.surface;
    let of_cell = |cell: usize| {
        if !surface.alive[cell] {
            return [M3::zero(); 2];
        }
        let u = surface.parts.corners(cell).map(|node| V3::from4(u[node]));
        model.mechanics().strain_and_stress(model, cell, &u, [0.5; 3])
    };
    (0..surface.alive.len()).into_par_iter().map(of_cell).collect()
}
