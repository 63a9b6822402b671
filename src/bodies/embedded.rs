//! Whether the grid of a body can carry the surface that is embedded in it, and holds what the scene asks of it.

use super::Refused;
use crate::error::Result;
use crate::mesh::{Grid, Misfit};
use crate::scene::{LoadKind, ProbeKind, Region, Scene, cells_of};

/// Refuses a surface that is too thin for its cells, and regions and points outside of it, where a scene knows the box of the grid alone.
///
/// # Errors
/// [`Refused::EmbeddedThin`], [`Refused::EmbeddedApart`], [`Refused::EmbeddedRegion`], [`Refused::EmbeddedPoint`].
pub(super) fn check(scene: &Scene, body: usize, grid: &Grid) -> Result<()> {
    let Some(embedded) = &grid.embedded else { return Ok(()) };
    let at = scene.at(&cells_of(&scene.skins[body].name));
    match embedded.misfit {
        Some(Misfit::Thin(point)) => return Err(Refused::EmbeddedThin { at, point: point.map(|c| 1e3 * c) }.into()),
        Some(Misfit::Apart(cells, surface)) => return Err(Refused::EmbeddedApart { at, cells, surface }.into()),
        None => {}
    }
    // regions without a node
    let boundaries = scene.boundaries.iter().map(|own| ("boundary".to_string(), own.body, &own.region));
    let anchors = scene.anchors.iter().map(|own| ("anchor".to_string(), own.body, &own.region));
    let ties = scene.attachments.iter().map(|own| ("attach".to_string(), own.body, &own.region));
    let probes = scene.probes.iter().filter_map(|probe| {
        let (body, region) = probe.kind.region()?;
        Some((format!("probe {}", probe.name), body, region))
    });
    let empty = |(_, of, region): &(String, usize, &Region)| *of == body && grid.count_in(region) == 0;
    if let Some((what, ..)) = boundaries.chain(anchors).chain(ties).chain(probes).find(empty) {
        return Err(Refused::EmbeddedRegion { at: scene.file.display().to_string(), what }.into());
    }
    // points in cells that are gone
    let probed = scene.probes.iter().filter_map(|probe| match &probe.kind {
        ProbeKind::Displacement { body, point, .. }
        | ProbeKind::Strain { body, point, .. }
        | ProbeKind::Stress { body, point, .. } => Some((format!("the probe {}", probe.name), *body, *point)),
        _ => None,
    });
    let loaded = scene.loads.iter().filter_map(|load| match load.kind {
        LoadKind::PointForce { at, .. } => Some(("a load".to_string(), load.body, at)),
        _ => None,
    });
    let outside = |(_, of, point): &(String, usize, [f64; 3])| *of == body && grid.present_at(*point).is_none();
    if let Some((what, _, point)) = probed.chain(loaded).find(outside) {
        let at = scene.file.display().to_string();
        return Err(Refused::EmbeddedPoint { at, what, point: point.map(|c| 1e3 * c) }.into());
    }
    Ok(())
}
