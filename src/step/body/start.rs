//! What a scene asks of a backend, and the state that it starts from.

use super::compliance::{COLUMNS, most_nodes};
use crate::backend::{Needs, Snapshot};
use crate::error::{Error, Result};
use crate::mesh::Grid;
use crate::model::{Model, turned};
use crate::scene::{Attachment, BodyId, Correction, Scene, Start};

/// Right-hand sides that a deformable body's backend keeps.
pub(super) fn slots(scene: &Scene) -> usize {
    let exact = scene.contact.is_some_and(|contact| contact.correction == Correction::Exact);
    let columns = if exact { COLUMNS } else { 0 };
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
    let tied = |a: &&Attachment| a.body == model.body || a.to == BodyId::Deformable(model.body);
    let ties: usize = scene.attachments.iter().filter(tied).map(|a| 3 * tied_nodes(scene, model, a)).sum();
    Needs {
        contact: true,
        columns: if exact { COLUMNS } else { 0 },
        near: most_nodes(contact.max_contacts) + ties,
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
        let shaped = shaped(skin.start, &model.grid, n);
        let at = |a: usize| {
            if model.free[n][a] == 0.0 { model.held[n][a] } else { shaped[a] + skin.displacement[a] }
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

/// Displacement of a node from rest in a shape, m.
fn shaped(start: Start, grid: &Grid, node: usize) -> [f64; 3] {
    let [x, y, z] = grid.rest(node);
    match start {
        Start::Rest => [0.0; 3],
        Start::Random { amplitude, seed } => {
            [0, 1, 2].map(|axis| amplitude * scattered((u64::from(seed) << 34) | (3 * node as u64 + axis)))
        }
        Start::Flat => [0.0, 0.0, -z],
        Start::InsideOut => {
            let params = grid.params::<f64>();
            let corners = params.corners(params.cell_id(grid.cells.map(|count| count / 2)));
            let (low, high) = (grid.rest(corners[0]), grid.rest(corners[6]));
            let opposite = |axis: usize| low[axis] + high[axis] - 2.0 * [x, y, z][axis];
            if corners.contains(&node) { [opposite(0), opposite(1), opposite(2)] } else { [0.0; 3] }
        }
        Start::Twist(angle) => turned([x, y, z], angle * z / grid.thickness()),
    }
}

/// A number in −1…1 that looks random and is the same for the same `key`: the finaliser of SplitMix64 (Steele, Lea, Flood 2014).
fn scattered(key: u64) -> f64 {
    let mut bits = key.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^= bits >> 31;
    (bits >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}
