//! Anchors of a scene file: regions that springs hold to their rest shape.

use super::bodies::Names;
use super::grid::{Grid, region};
use super::invalid::{Invalid, Result};
use super::raw::{self, Table};
use super::region::Region;
use super::text::{Bound, STIFFNESS, SceneText};
use super::{Mass, Skin};

/// Springs from the nodes of a region to their rest positions.
#[derive(Clone, Debug)]
pub struct Anchor {
    /// Number of the deformable body.
    pub body: usize,
    /// Which nodes.
    pub region: Region,
    /// Of each node's spring, N/m.
    pub stiffness: f64,
}

/// All of them.
pub(super) fn anchors(
    scene: &SceneText,
    list: Vec<Table<raw::Anchor>>,
    names: &Names,
    skins: &[Skin],
    grids: &[Vec<Grid>],
) -> Result<Vec<Anchor>> {
    let one = |table: Table<raw::Anchor>| {
        let mut raw = table.keys;
        let body = names.skin(scene, &raw.body, table.span.clone())?;
        if skins[body].mass == Mass::Consistent {
            return Err(Invalid::AnchoredMass { at: scene.place(table.span) });
        }
        let extent = raw.extent();
        Ok(Anchor {
            body,
            region: region(scene, &raw.region, extent, &grids[body])?,
            stiffness: scene.number("stiffness_n_m", &raw.stiffness_n_m, STIFFNESS, Bound::Positive)?,
        })
    };
    list.into_iter().map(one).collect()
}
