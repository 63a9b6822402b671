//! Bodies that no boundary and no rest-shape spring holds.

use super::Model;
use glam::DVec3;

/// Relative pivot below which a rigid-body mode counts as unconstrained.
const UNCONSTRAINED_PIVOT: f64 = 1e-9;

impl Model {
    /// Whether the body is floating: its constrained axes and rest-shape springs leave at least one of the six rigid-body modes unconstrained.
    pub fn floats(&self) -> bool {
        let mut seen = [[0.0; 6]; 6]; // Σ rᵀr over fixed axes, r the axis's value in the six modes; positions in units of the extent
        let length = self.extent();
        for (node, (dofs, rest)) in self.dofs.iter().zip(&self.rest).enumerate().filter(|(_, (dofs, _))| dofs[3] > 0.0)
        {
            let on_spring = self.rest_springs.nodes.binary_search(&(node as u32)).is_ok();
            let at = (DVec3::from_array(*rest) - DVec3::from_array(self.position)) / length;
            for axis in (0..3).filter(|axis| on_spring || dofs[*axis] == 0.0) {
                let translation = DVec3::AXES[axis];
                let rotation = at.cross(translation);
                let row = [translation.x, translation.y, translation.z, rotation.x, rotation.y, rotation.z];
                (0..36).for_each(|k| seen[k / 6][k % 6] += row[k / 6] * row[k % 6]);
            }
        }
        let largest = (0..6).map(|k| seen[k][k]).fold(0.0, f64::max);
        for k in 0..6 {
            // symmetric elimination with diagonal pivoting
            let Some(pivot) = (k..6).max_by(|a, b| seen[*a][*a].total_cmp(&seen[*b][*b])) else { return true };
            if seen[pivot][pivot] <= UNCONSTRAINED_PIVOT * largest {
                return true;
            }
            seen.swap(k, pivot);
            seen.iter_mut().for_each(|row| row.swap(k, pivot));
            for i in k + 1..6 {
                let factor = seen[i][k] / seen[k][k];
                (k..6).for_each(|j| seen[i][j] -= factor * seen[k][j]);
            }
        }
        false
    }
}
