//! Requirements of a scene on a backend, and its initial state.

use super::super::Refused;
use super::compliance::{COLUMNS, most_nodes};
use crate::backend::{Needs, Snapshot};
use crate::bodies::{self, Model};
use crate::error::Result;
use crate::scene::{Attachment, BodyId, Correction, STEP, Scene};

/// Nodes of a body that a tie acts on, at most: those of three hexahedra, around the corners of an embedded triangle.
const OF_A_TIE: usize = 24;

/// Number of right-hand sides of a deformable body's backend.
pub(super) fn right_hand_sides(scene: &Scene) -> usize {
    let exact = scene.contact.is_some_and(|contact| contact.correction == Correction::Exact);
    let columns = if exact { COLUMNS } else { 0 };
    Needs { contact: scene.contact.is_some(), columns, ..Needs::default() }.right_hand_sides()
}

/// Refuses an explicit step above the stability limit.
pub(super) fn check_step(scene: &Scene, model: &Model) -> Result<()> {
    if !model.step.explicit() {
        return Ok(());
    }
    let (step, stable) = (model.step.step, model.stable_step());
    if step <= stable {
        return Ok(());
    }
    let refused = Refused::UnstableStep {
        at: scene.at(STEP),
        name: scene.skins[model.body].name.clone(),
        step_ms: 1e3 * step,
        stable_ms: 1e3 * stable,
        substeps: (scene.time.step / stable).ceil() as u64,
    };
    Err(refused.into())
}

/// Arrays that a deformable body's backend holds; `model` counts the tied nodes.
pub fn needs(scene: &Scene, model: &Model) -> Needs {
    let breaking = scene.skins[model.body].breaks();
    let in_full = scene.in_full() && model.newton().is_none();
    let Some(contact) = &scene.contact else {
        return Needs { breaking, in_full, ..Needs::default() };
    };
    let exact = contact.correction == Correction::Exact;
    let tied = |a: &&Attachment| a.body == model.body || a.to == BodyId::Deformable(model.body);
    let ties: usize = scene.attachments.iter().filter(tied).map(|a| OF_A_TIE * tied_nodes(scene, model, a)).sum();
    Needs {
        contact: true,
        columns: if exact { COLUMNS } else { 0 },
        near: most_nodes(contact.max_contacts) + ties,
        cutting: scene.tools.iter().any(|t| t.blade.is_some()),
        breaking,
        node_blocks: contact.correction == Correction::Uncoupled,
        in_full,
    }
}

/// Number of an attachment's nodes, whichever body they belong to.
fn tied_nodes(scene: &Scene, model: &Model, attachment: &Attachment) -> usize {
    match attachment.body == model.body {
        true => model.count_in(&attachment.region),
        false => bodies::count_in(&scene.skins[attachment.body], &attachment.region),
    }
}

/// Initial state of a body.
pub fn start(scene: &Scene, model: &Model) -> Snapshot {
    let [u, v] = model.start(scene);
    Snapshot { u, v, ..Snapshot::default() }
}
