//! The skin near a tool: candidates of the broad phase, read back and put where they are now.
//!
//! A point outside the skin looks no further than the search does. One that has sunk in by `d` belongs to the nearest surface, which may
//! be as far as `d`: where that is further than was looked, the search is widened by `d` and made again.

use super::{Simulation, StepReport};
use crate::collide::{Patch, tool_box};
use crate::error::Result;
use crate::mesh::Quad;
use crate::model::Model;
use glam::DVec3;

/// See the module.
pub(super) struct Near {
    /// Candidate faces.
    pub faces: Vec<Quad>,
    /// Made of them.
    pub patch: Patch,
    nodes: Vec<u32>,
    u: Vec<[f64; 3]>,
}

impl Near {
    /// Where a node of the faces is, m.
    pub fn position(&self, model: &Model, id: u32) -> DVec3 {
        position(model, &self.nodes, &self.u, id)
    }
}

fn position(model: &Model, nodes: &[u32], u: &[[f64; 3]], id: u32) -> DVec3 {
    let k = nodes.binary_search(&id).unwrap_or(0);
    DVec3::from_array(model.rest[id as usize]) + DVec3::from_array(u[k])
}

impl Simulation {
    /// Fits the boxes of the broad phase to the skin as it is.
    pub(super) fn refit_boxes(&mut self, report: &mut StepReport) -> Result<()> {
        if self.boxes.refit(&self.backend.bounds()?) > 0 {
            *report.warnings.entry("non_finite_nodes").or_default() += 1;
        }
        Ok(())
    }

    /// The skin within `margin` of a tool; none when there is none, or when some of it is nowhere.
    pub(super) fn near(&mut self, tool: usize, margin: f64, report: &mut StepReport) -> Result<Option<Near>> {
        let mut sunk = 0.0;
        loop {
            let area = tool_box(&self.tools[tool], margin + sunk);
            let faces = self.boxes.faces(&self.model.grid, &self.wound.surface, &area);
            let mut nodes: Vec<u32> = faces.iter().flat_map(|q| q.nodes).collect();
            nodes.sort_unstable();
            nodes.dedup();
            if nodes.is_empty() {
                return Ok(None);
            }
            let u = self.backend.displacements(&nodes)?;
            if u.iter().flatten().any(|c| !c.is_finite()) {
                return Ok(None);
            }
            let Some(patch) = Patch::new(&faces, |id| position(&self.model, &nodes, &u, id)) else {
                return Ok(None);
            };
            let depth = patch.deepest(&self.tools[tool]);
            if depth > margin + sunk {
                sunk = depth;
                continue;
            }
            self.note_opening(&nodes, &u, report);
            report.contact.candidates += faces.len();
            return Ok(Some(Near { faces, patch, nodes, u }));
        }
    }
}
