//! What has been read of a body's state: each value once, and as many as possible at a time, since a read-back waits for the device.
//!
//! The first one of a new state is at the step's end where it cuts or has probes, otherwise at the next one's start. It takes with it what the
//! next search for contacts asks for: the bounds of the tiles, and the displacements and velocities of the nodes that the last search located. So a
//! search reads back only where it reaches other nodes, or where the state has changed since.

use super::Body;
use crate::backend::{Query, Values};
use crate::error::Result;
use crate::kernels::cut::Hit;
use crate::math::{V3, V4};
use std::collections::BTreeMap;

/// See the module.
#[derive(Default)]
pub(in crate::step) struct Known {
    /// Displacements by node, m.
    pub u: BTreeMap<u32, [f64; 3]>,
    /// Velocities by node, m/s.
    pub v: BTreeMap<u32, [f64; 3]>,
    /// Bounds of the tiles, m; none before they are read.
    pub bounds: Option<Vec<[V4<f64>; 2]>>,
}

impl Known {
    /// Displacement, m, and velocity, m/s, of a node as far as they have been read; 0 otherwise.
    pub fn moved(&self, node: usize) -> [V3<f64>; 2] {
        [&self.u, &self.v].map(|known| V3::of(known.get(&(node as u32)).copied().unwrap_or_default()))
    }
}

impl Body {
    /// Has these values in `known`; returns what the quads have crossed.
    pub(in crate::step) fn read(&mut self, mut query: Query) -> Result<Vec<Hit<f64>>> {
        let known = &mut self.known;
        query.displacements.retain(|node| !known.u.contains_key(node));
        query.velocities.retain(|node| !known.v.contains_key(node));
        query.bounds &= known.bounds.is_none();
        if query == Query::default() {
            return Ok(vec![]);
        }
        if known.bounds.is_none() {
            query.bounds = true;
            query.displacements.extend(&self.located.nodes);
            query.velocities.extend(&self.located.nodes);
        }
        for nodes in [&mut query.displacements, &mut query.velocities] {
            nodes.sort_unstable();
            nodes.dedup();
        }
        let Values { displacements, velocities, bounds, hits, .. } = self.backend.read(&query)?;
        known.u.append(&mut query.displacements.into_iter().zip(displacements).collect());
        known.v.append(&mut query.velocities.into_iter().zip(velocities).collect());
        if query.bounds {
            known.bounds = Some(bounds);
        }
        Ok(hits)
    }
}
