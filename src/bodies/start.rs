//! Initial state of a scene.

use super::{Model, turned};
use crate::math::V4;
use crate::math::random::scattered;
use crate::mesh::Grid;
use crate::scene::{Scene, Start, TetrahedralMesh};

impl Model {
    /// `[node]` initial displacements, m, and velocities, m/s.
    pub fn start(&self, scene: &Scene) -> [Vec<V4<f64>>; 2] {
        let skin = &scene.skins[self.body];
        let driven = self.prescribed_at(scene, 0.0);
        let displaced = |n: usize| {
            let shaped = shaped(skin.start, &self.grid, n);
            let prescribed = match self.paths.nodes.binary_search(&(n as u32)) {
                Ok(entry) => driven[entry],
                Err(_) => self.prescribed[n],
            };
            let at = |a: usize| {
                if self.dofs[n][a] == 0.0 { prescribed[a] } else { shaped[a] + skin.displacement[a] }
            };
            [at(0), at(1), at(2), 0.0]
        };
        let moving = |n: usize| {
            let at = |a: usize| if self.dofs[n][a] == 0.0 { 0.0 } else { skin.velocity[a] };
            [at(0), at(1), at(2), 0.0]
        };
        let count = self.own_nodes();
        let mut start: [Vec<V4<f64>>; 2] = [(0..count).map(displaced).collect(), (0..count).map(moving).collect()];
        start.iter_mut().for_each(|values| values.resize(self.node_count(), [0.0; 4]));
        start
    }
}

/// Displacement of a node from rest in an initial shape, m.
fn shaped(start: Start, grid: &Grid, node: usize) -> [f64; 3] {
    let [x, y, z] = grid.rest(node);
    match start {
        Start::Rest => [0.0; 3],
        Start::Random { amplitude, seed } => {
            [0, 1, 2].map(|axis| amplitude * scattered((u64::from(seed) << 34) | (3 * node as u64 + axis)))
        }
        Start::Flat => [0.0, 0.0, -z],
        Start::Inverted => {
            if let Some(unstructured) = &grid.unstructured {
                return inverted(&unstructured.mesh, grid.thickness(), node);
            }
            let params = grid.params::<f64>();
            let corners = params.corners(params.cell_id(grid.cells.map(|count| count / 2)));
            let (low, high) = (grid.rest(corners[0]), grid.rest(corners[6]));
            let opposite = |axis: usize| low[axis] + high[axis] - 2.0 * [x, y, z][axis];
            if corners.contains(&node) { [opposite(0), opposite(1), opposite(2)] } else { [0.0; 3] }
        }
        Start::Twist(angle) => turned([x, y, z], angle * z / grid.thickness()),
    }
}

/// Displacement that puts a corner of the tetrahedron in the middle of a mesh beyond its centroid; 0 of other nodes.
fn inverted(mesh: &TetrahedralMesh, thickness: f64, node: usize) -> [f64; 3] {
    let (e, _) = mesh.nearest([0.0, 0.0, 0.5 * thickness]);
    if !mesh.tetrahedra()[e].contains(&(node as u32)) {
        return [0.0; 3];
    }
    let corners = mesh.corners(e);
    [0, 1, 2].map(|n| 0.5 * corners.iter().map(|x| x[n]).sum::<f64>() - 2.0 * mesh.nodes()[node][n])
}
