//! What a scene asks of a backend, and the state that it starts from.

use super::compliance;
use crate::backend::{Needs, Snapshot};
use crate::error::{Error, Result};
use crate::mesh::Grid;
use crate::model::Model;
use crate::scene::{Attachment, Correction, Scene, Who};

/// Right-hand sides that a deformable body's backend keeps.
pub(super) fn slots(scene: &Scene) -> usize {
    let exact = scene.contact.is_some_and(|contact| contact.correction == Correction::Exact);
    let columns = if exact { compliance::COLUMNS } else { 0 };
    Needs { contact: scene.contact.is_some(), columns, ..Needs::default() }.slots()
}

/// Refuses an explicit step that would blow up.
pub(super) fn check_step(scene: &Scene, model: &Model) -> Result<()> {
    if !model.step.explicit() {
        return Ok(());
    }
    let (step, stable) = (model.step.step, model.stable_step());
    if step <= stable {
        return Ok(());
    }
    Err(Error::UnstableStep {
        path: scene.file.clone(),
        name: scene.skins[model.body].name.clone(),
        step_ms: 1e3 * step,
        stable_ms: 1e3 * stable,
        substeps: (scene.time.step / stable).ceil() as u64,
    })
}

/// Which arrays the backend of a scene's deformable body of that number holds; `model` says how many nodes are tied.
pub fn needs(scene: &Scene, model: &Model) -> Needs {
    let Some(contact) = &scene.contact else {
        return Needs::default();
    };
    let exact = contact.correction == Correction::Exact;
    let tied = |a: &&Attachment| a.body == model.body || a.to == Who::Skin(model.body);
    let ties: usize = scene.attachments.iter().filter(tied).map(|a| 3 * tied_nodes(scene, model, a)).sum();
    Needs {
        contact: true,
        columns: if exact { compliance::COLUMNS } else { 0 },
        near: compliance::most_nodes(contact.max_contacts) + ties,
        cutting: scene.tools.iter().any(|t| t.blade.is_some()),
        node_blocks: contact.correction == Correction::Uncoupled,
    }
}

/// Nodes of an attachment, of whichever body it is.
fn tied_nodes(scene: &Scene, model: &Model, attachment: &Attachment) -> usize {
    match attachment.body == model.body {
        true => model.nodes_in(&attachment.region).len(),
        false => {
            let grid = Grid::new(&scene.skins[attachment.body]);
            (0..grid.node_count()).filter(|n| grid.contains(&attachment.region, *n)).count()
        }
    }
}

/// The state that a scene starts from.
pub fn start(scene: &Scene, model: &Model) -> Snapshot {
    let skin = &scene.skins[model.body];
    let displaced = |n: usize| {
        let at = |a: usize| {
            if model.free[n][a] == 0.0 { model.held[n][a] } else { skin.displacement[a] }
        };
        [at(0), at(1), at(2), 0.0]
    };
    let moving = |n: usize| {
        let at = |a: usize| {
            if model.free[n][a] == 0.0 { 0.0 } else { skin.velocity[a] }
        };
        [at(0), at(1), at(2), 0.0]
    };
    let count = model.grid.node_count();
    let mut start =
        Snapshot { u: (0..count).map(displaced).collect(), v: (0..count).map(moving).collect(), ..Snapshot::default() };
    start.u.resize(model.node_count(), [0.0; 4]);
    start.v.resize(model.node_count(), [0.0; 4]);
    start
}
