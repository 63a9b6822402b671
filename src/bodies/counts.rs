//! Counts of a body's arrays, without the arrays.

use super::rest_springs;
use super::springs::Springs;
use crate::mesh::Grid;
use crate::scene::{Law, Scene};
use rayon::prelude::*;

/// What the arrays of a model would hold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Unconstrained degrees of freedom.
    pub dof: usize,
    /// Nodes with a rest-shape spring.
    pub rest_springs: usize,
    /// Nodes on prescribed paths.
    pub driven: usize,
    /// Springs; 0 for hexahedra.
    pub springs: usize,
}

impl Counts {
    /// Goes over the nodes of a body and keeps nothing of them.
    pub fn new(scene: &Scene, body: usize, grid: &Grid) -> Self {
        let boundaries: Vec<_> = scene.boundaries.iter().filter(|b| b.body == body).collect();
        let rest_springs = rest_springs::of_body(scene, body, grid);
        let springs = match scene.skins[body].law {
            Law::Springs { .. } => Springs::count(grid),
            _ => 0,
        };
        let of_node = |node: usize| {
            if !grid.is_used(node) {
                return Self::default();
            }
            // the last boundary of the scene holds an axis
            let mut holding = [None; 3];
            for boundary in boundaries.iter().filter(|b| grid.contains(&b.region, node)) {
                (0..3).filter(|axis| boundary.axes[*axis]).for_each(|axis| holding[axis] = Some(boundary));
            }
            Self {
                dof: holding.iter().filter(|held| held.is_none()).count(),
                rest_springs: usize::from(
                    rest_springs.iter().any(|rest_spring| grid.contains(&rest_spring.region, node)),
                ),
                driven: usize::from(holding.iter().flatten().any(|boundary| !boundary.path.is_empty())),
                springs: 0,
            }
        };
        let add = |a: Self, b: Self| Self {
            dof: a.dof + b.dof,
            rest_springs: a.rest_springs + b.rest_springs,
            driven: a.driven + b.driven,
            springs: a.springs + b.springs,
        };
        let of_nodes = (0..grid.node_count()).into_par_iter().map(of_node).reduce(Self::default, add);
        Self { springs, ..of_nodes }
    }
}
