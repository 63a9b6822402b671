//! Springs of a mass–spring body: one per unique pair of corners of every cell (12 edges, 12 face and 4 space diagonals), as SOFA's
//! MeshSpringForceField makes them of hexahedra; rest length is the initial one.

use crate::mesh::Grid;
use std::collections::BTreeSet;

/// Spring arrays.
#[derive(Clone, Debug)]
pub struct Springs {
    /// `[spring]` node ids, first < second.
    pub ends: Vec<[u32; 2]>,
    /// `[spring]` elongation at the grid's rest (its length less the spring's own) m, stiffness N/m, damping N·s/m, 0.
    pub law: Vec<[f64; 4]>,
    /// `[node + 1]` into `half`.
    pub first: Vec<u32>,
    /// Springs around each node: other node, spring.
    pub half: Vec<[u32; 2]>,
}

impl Springs {
    /// All corner pairs of every cell of a grid.
    pub fn new(grid: &Grid, stiffness: f64, damping: f64) -> Self {
        let params = grid.params::<f64>();
        let mut pairs = BTreeSet::new();
        for cell in 0..grid.cell_count() {
            let corners = params.corners(cell);
            for (a, first) in corners.iter().enumerate() {
                for second in &corners[a + 1..] {
                    pairs.insert([*first.min(second) as u32, *first.max(second) as u32]);
                }
            }
        }
        let ends: Vec<[u32; 2]> = pairs.into_iter().collect();
        let law = vec![[0.0, stiffness, damping, 0.0]; ends.len()];
        let mut around = vec![vec![]; grid.node_count()];
        for (s, [a, b]) in ends.iter().enumerate() {
            around[*a as usize].push([*b, s as u32]);
            around[*b as usize].push([*a, s as u32]);
        }
        let mut first = vec![0];
        let mut half = vec![];
        for list in around {
            half.extend(list);
            first.push(half.len() as u32);
        }
        Self { ends, law, first, half }
    }
}
