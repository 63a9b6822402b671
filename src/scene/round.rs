//! Spheres and capsules of a scene file, their meshes for display, and hand paths given as lists of positions.

use super::invalid::{Invalid, Result};
use super::raw::{self, Points, Row, Vectors};
use super::text::{SceneText, difference, normalized};
use super::{Pose, Round, ToolMesh};
use crate::math::elementary::{cos, sin};
use std::f64::consts::{PI, TAU};

/// Numbers of facets around the axis and from pole to pole.
const AROUND: u32 = 16;
const ALONG: u32 = 12;

/// A sphere (one point) or a capsule (two distinct points).
pub(super) fn round(scene: &SceneText, raw: &raw::Round) -> Result<Round> {
    let radius = scene.number(&raw::Round::radius_mm, &raw.radius_mm)?;
    let points = scene.points(&raw::Round::points_mm, &raw.points_mm)?;
    match points[..] {
        [centre] => Ok(Round { radius, ends: [centre; 2] }),
        [a, b] if a != b => Ok(Round { radius, ends: [a, b] }),
        _ => Err(Invalid::RoundPoints { at: scene.location(raw.points_mm.span()), found: points.len() }),
    }
}

/// Rows `[t_s, x, y, z]` of a hand path without rotation, at least one, in ascending order of times.
pub(super) fn path(scene: &SceneText, key: &Row<Vectors<4>>, rows: &Points) -> Result<Vec<Pose>> {
    let mut poses: Vec<Pose> = Vec::new();
    for row in rows.get_ref() {
        let [_, x, y, z] = scene.vector(&key.each(), row)?;
        let time = row.get_ref()[0]; // the first column is in s
        if let Some(before) = poses.last().filter(|before| before.time >= time) {
            return Err(Invalid::TrajectoryTime { at: scene.location(row.span()), found: time, before: before.time });
        }
        poses.push(Pose { time, position: [x, y, z], rotation: [0.0, 0.0, 0.0, 1.0] });
    }
    if poses.is_empty() {
        return Err(Invalid::PathEmpty { at: scene.location(rows.span()) });
    }
    Ok(poses)
}

/// Rings around the axis between two poles, counter-clockwise seen from outside.
pub(super) fn mesh(round: &Round) -> ToolMesh {
    let [a, b] = round.ends;
    let (along, across) = axes(a, b);
    let other = cross(along, across);
    let position = |end: [f64; 3], polar: f64, azimuth: f64| {
        let (out, up) = (round.radius * sin(polar), round.radius * cos(polar));
        [0, 1, 2].map(|n| end[n] + along[n] * up + out * (across[n] * cos(azimuth) + other[n] * sin(azimuth)))
    };
    // from the pole at b to the pole at a; a capsule has its widest ring at both ends
    let half = ALONG / 2;
    let upper = (1..=half).map(|k| (b, k));
    let lower = (if a == b { half + 1 } else { half }..ALONG).map(|k| (a, k));
    let rings: Vec<([f64; 3], u32)> = upper.chain(lower).collect();
    let mut positions = vec![position(b, 0.0, 0.0)];
    for (end, k) in &rings {
        let polar = PI * f64::from(*k) / f64::from(ALONG);
        positions.extend((0..AROUND).map(|n| position(*end, polar, TAU * f64::from(n) / f64::from(AROUND))));
    }
    let last = positions.len() as u32;
    positions.push(position(a, PI, 0.0));
    let count = rings.len() as u32;
    let id = |ring: u32, n: u32| 1 + ring * AROUND + n % AROUND;
    let mut triangles = vec![];
    for n in 0..AROUND {
        triangles.push([0, id(0, n), id(0, n + 1)]);
        for ring in 0..count - 1 {
            triangles.push([id(ring, n), id(ring + 1, n), id(ring + 1, n + 1)]);
            triangles.push([id(ring, n), id(ring + 1, n + 1), id(ring, n + 1)]);
        }
        triangles.push([last, id(count - 1, n + 1), id(count - 1, n)]);
    }
    ToolMesh { positions, triangles }
}

/// Unit vectors along the line from `a` to `b` (z for a point) and across it.
fn axes(a: [f64; 3], b: [f64; 3]) -> ([f64; 3], [f64; 3]) {
    let along = normalized(difference(b, a)).unwrap_or([0.0, 0.0, 1.0]);
    let off = if along[0].abs() < 0.6 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
    (along, normalized(cross(along, off)).unwrap_or([0.0, 1.0, 0.0]))
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Volume inside a closed mesh, positive when triangles are counter-clockwise seen from outside.
    fn volume(mesh: &ToolMesh) -> f64 {
        let sixfold = |t: &[u32; 3]| {
            let [p, q, r] = t.map(|id| mesh.positions[id as usize]);
            let n = cross(q, r);
            p[0] * n[0] + p[1] * n[1] + p[2] * n[2]
        };
        mesh.triangles.iter().map(sixfold).sum::<f64>() / 6.0
    }

    #[test]
    fn meshes_fill_the_volume_of_sphere_and_capsule() {
        // chords of 22.5° and 15° lose 4 % of the volume
        let sphere = volume(&mesh(&Round { radius: 1.0, ends: [[3.0, 1.0, 2.0]; 2] }));
        let exact = 4.0 / 3.0 * PI;
        assert!(sphere < exact && sphere > 0.95 * exact, "{sphere} of {exact}");
        let capsule = volume(&mesh(&Round { radius: 1.0, ends: [[0.0, 0.0, 0.0], [3.0, 0.0, 4.0]] }));
        let exact = exact + 5.0 * PI;
        assert!(capsule < exact && capsule > 0.95 * exact, "{capsule} of {exact}");
    }
}
