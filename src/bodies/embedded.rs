//! Surfaces embedded in the grid of a body: their points among its nodes, and whether the grid can carry them and holds what the scene asks of it.

use super::{Model, Refused};
use crate::error::Result;
use crate::mesh::{Grid, MaterialPoint, Misfit};
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
    let rest_springs = scene.rest_springs.iter().map(|own| ("rest_spring".to_string(), own.body, &own.region));
    let ties = scene.attachments.iter().map(|own| ("attach".to_string(), own.body, &own.region));
    let probes = scene.probes.iter().filter_map(|probe| {
        let (body, region) = probe.kind.region()?;
        Some((format!("probe {}", probe.name), body, region))
    });
    let empty = |(_, of, region): &(String, usize, &Region)| *of == body && grid.count_in(region) == 0;
    if let Some((what, ..)) = boundaries.chain(rest_springs).chain(ties).chain(probes).find(empty) {
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

impl Model {
    /// Number of nodes and of points of an embedded surface, which are numbered after them.
    pub fn point_count(&self) -> usize {
        self.node_count() + self.grid.embedded.as_ref().map_or(0, |embedded| embedded.nodes.len())
    }

    /// `[point]` rest positions of the nodes, of the reserve of duplicates at 0, and of the points of an embedded surface, m.
    pub fn rest_of_surface(&self) -> Vec<[f64; 3]> {
        let mut all = self.rest.clone();
        all.resize(self.node_count(), [0.0; 3]);
        let points = self.grid.embedded.as_ref().map_or(&[][..], |embedded| embedded.surface.points());
        all.extend(points.iter().map(|x| [0, 1, 2].map(|n| x[n] + self.position[n])));
        all
    }

    /// Rest position of a node, or of a point of an embedded surface, in the body's frame, m.
    pub(super) fn rest_of_point(&self, id: u32) -> [f64; 3] {
        match (&self.grid.embedded, (id as usize).checked_sub(self.node_count())) {
            (Some(embedded), Some(point)) => embedded.surface.points()[point],
            _ => self.grid.rest(id as usize),
        }
    }

    /// A material point of the surface as nodes alone: a point of an embedded surface moves with those of its cell.
    pub fn on_nodes(&self, point: MaterialPoint) -> MaterialPoint {
        let Some(embedded) = &self.grid.embedded else { return point };
        let first = self.node_count() as u32;
        point.through(|id| if id < first { MaterialPoint::node(id) } else { embedded.point(id - first) })
    }

    /// Share of a cell's volume that belongs to the body: 1 but for cells that an embedded surface cuts.
    pub fn grid_share(&self, cell: usize) -> f64 {
        self.grid.share(cell)
    }

    /// True if a node is of a cell that was there from the start, or a duplicate.
    pub fn is_used(&self, node: usize) -> bool {
        node >= self.own_nodes() || self.grid.is_used(node)
    }
}
