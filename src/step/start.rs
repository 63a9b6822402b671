//! What a scene asks of a backend, and the state that it starts from.

use super::compliance;
use crate::backend::{Needs, Snapshot};
use crate::model::Model;
use crate::scene::{Correction, Scene};

/// Which arrays a scene's backend holds.
pub fn needs(scene: &Scene) -> Needs {
    let Some(contact) = &scene.contact else {
        return Needs::default();
    };
    let exact = contact.correction == Correction::Exact;
    Needs {
        contact: true,
        columns: if exact { compliance::COLUMNS } else { 0 },
        near: compliance::most_nodes(contact.max_contacts),
        cutting: scene.tools.iter().any(|t| t.blade.is_some()),
        node_blocks: !exact,
    }
}

/// The state that a scene starts from.
pub fn start(scene: &Scene, model: &Model) -> Snapshot {
    let displaced = |n: usize| {
        let at = |a: usize| {
            if model.free[n][a] == 0.0 { model.held[n][a] } else { scene.skin.displacement[a] }
        };
        [at(0), at(1), at(2), 0.0]
    };
    let moving = |n: usize| {
        let at = |a: usize| {
            if model.free[n][a] == 0.0 { 0.0 } else { scene.skin.velocity[a] }
        };
        [at(0), at(1), at(2), 0.0]
    };
    let count = model.grid.node_count();
    Snapshot { u: (0..count).map(displaced).collect(), v: (0..count).map(moving).collect(), ..Snapshot::default() }
}
