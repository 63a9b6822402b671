//! Contacts of a blade: its edge with the tissue that it is to cut, its flats with the walls of the cut.

use super::{Found, Patch, Search, frame};
use crate::bodies::rigid::{Edge, Flat, Instrument};
use crate::constraints::Law;
use glam::DVec3;

/// Resistance of tissue to a blade.
#[derive(Clone, Copy, Debug)]
pub struct Resistance {
    /// Force per length of edge at which the tissue is cut, N/m.
    pub edge: f64,
    /// Force per length of a flat, over the root of the flat's distance from the edge, at which the tissue splits ahead of the edge,
    /// N/m^1.5.
    pub splitting: f64,
    /// Cell width along the surface, m: within it of the front a cut's walls do not open as those of a sharp crack.
    pub cell: f64,
}

/// Cosine with the blade's normal above which a wall belongs to the flats, not to the edge.
const SIDEWAYS: f64 = 0.7;

pub(super) fn edge_contact(
    tool: &Instrument,
    edge: &Edge,
    patch: &Patch,
    point: DVec3,
    length: f64,
    reach: f64,
    search: &Search,
    resistance: &impl Fn(u32) -> Resistance,
    retreat: Option<f64>,
) -> Option<Found> {
    let (triangle, weights, distance, normal) = patch.project(point);
    if distance >= reach {
        return None;
    }
    let bound = resistance(patch.cells[triangle]).edge * length;
    let [forward, along, side] = [edge.forward, edge.along, edge.normal].map(|a| tool.rotation * a);
    let base = Found {
        material_point: patch.material_point(triangle, weights),
        point,
        axes: [-forward, along, side],
        gap: 0.0,
        depth: (-distance).max(0.0),
        law: Law::Cut { radius: bound },
    };
    let in_wound = distance <= 0.0 || patch.walls[triangle];
    match retreat.filter(|_| in_wound) {
        // back in its own cut: free up to the front
        Some(retreat) => return (retreat < reach).then_some(Found { gap: retreat, ..base }),
        // inside: held by the tissue where it is
        None if distance <= 0.0 => return Some(base),
        None => {}
    }
    if normal.dot(side).abs() > SIDEWAYS || normal.dot(forward) > 0.0 {
        return None; // beside or behind the edge
    }
    let law = Law::Coulomb { friction: search.friction, bound };
    Some(Found { axes: frame(normal), gap: distance, law, ..base })
}

/// Growth of a blade's half thickness per length behind its edge: a scalpel's included bevel angle of 28°.
const BEVEL: f64 = 0.25;

/// Contact of a flat with the first wall that faces it.
///
/// The half thickness is what the bevel reaches at the flat's distance behind the edge, less a cell: within a cell of its front a cut opens
/// as the grid lets it, not as a sharp crack. (With the whole bevel, walls of cells of 0.83 mm that had just separated took another 0.11 N
/// of 0.28, those of 0.56 mm 0.07 N, for a step or two each.) Walls are pushed no faster than the bevel opens them as the blade advances: a
/// cut opens by a whole cell at once. Their force is at most what would split the tissue ahead of the edge. A wall that has passed the
/// blade's middle plane is released. (Following it from step to step threw the blade in 5 of 12 random cuts right through: walls of a fresh
/// cut stand anywhere, and one that has passed pulls the two flats against each other.)
pub(super) fn flat_contact(
    tool: &Instrument,
    edge: &Edge,
    patch: &Patch,
    point: DVec3,
    flat: Flat,
    travel: f64,
    search: &Search,
    resistance: &impl Fn(u32) -> Resistance,
) -> Option<Found> {
    let direction = tool.rotation * edge.normal * flat.side;
    let reach = edge.half_thickness + search.alarm + travel + search.distance;
    let (triangle, weights, distance) = patch.cast(point, direction, reach)?;
    let tissue = resistance(patch.cells[triangle]);
    let half_thickness = edge.half_thickness.min(BEVEL * (flat.behind - tissue.cell).max(0.0));
    let gap = distance - half_thickness - search.distance;
    let bound = tissue.splitting * flat.behind.sqrt() * flat.length;
    Some(Found {
        material_point: patch.material_point(triangle, weights),
        point: point + direction * half_thickness,
        axes: frame(-direction),
        gap: gap.max(-BEVEL * travel),
        depth: 0.0,
        law: Law::Coulomb { friction: search.friction, bound },
    })
}
