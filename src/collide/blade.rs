//! What a blade touches: its edge the tissue that it is to cut, its flats the walls of what it has cut.

use super::{Found, Patch, Search, frame};
use crate::bodies::rigid::{Edge, Flat, Instrument};
use crate::constraints::Law;
use glam::DVec3;

/// What tissue bears of a blade.
#[derive(Clone, Copy, Debug)]
pub struct Resistance {
    /// Force per length of edge at which it is cut, N/m.
    pub edge: f64,
    /// Force per length of a flat, over the root of the flat's distance from the edge, at which it splits before the edge, N/m^1.5.
    pub splitting: f64,
    /// Side of its cells along the surface, m: nearer to the front of a cut its walls do not open as those of a sharp crack do.
    pub cell: f64,
}

/// Walls whose normal lies closer than this to the blade's normal are the flats' business.
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
        spot: patch.spot(triangle, weights),
        point,
        axes: [-forward, along, side],
        gap: 0.0,
        depth: (-distance).max(0.0),
        law: Law::Cut { radius: bound },
    };
    let in_wound = distance <= 0.0 || patch.walls[triangle];
    match retreat.filter(|_| in_wound) {
        // back in its own cut: nothing holds it before it is where it has cut to
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

/// How much a blade's half thickness grows over a length behind its edge: a scalpel's bevel of 28° in all.
const BEVEL: f64 = 0.25;

/// A flat touches the first wall that faces it.
///
/// The blade is as thick there as its bevel has made it behind the edge, less a cell: within a cell of its front a cut opens as the grid
/// lets it, not as a sharp crack does. (With the whole bevel, walls of cells of 0.83 mm that had just come apart took another 0.11 N of 0.28,
/// those of 0.56 mm 0.07 N, for a step or two each.) Nor are walls pushed faster than the bevel opens them as the blade goes on: a
/// cut opens by a whole cell at once. They bear no more than what would split the tissue before the edge. A wall that has passed the
/// blade's middle plane is let go. (Following it instead, from step to step, threw the blade in 5 of 12 random cuts right through: walls
/// that a cut has just made stand anywhere, and what has passed pulls the two flats of a blade against each other.)
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
        spot: patch.spot(triangle, weights),
        point: point + direction * half_thickness,
        axes: frame(-direction),
        gap: gap.max(-BEVEL * travel),
        depth: 0.0,
        law: Law::Coulomb { friction: search.friction, bound },
    })
}
