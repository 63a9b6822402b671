//! Nearest points between a tool's point or segment and a vertex, an edge or a triangle; piercing of a triangle by a segment.
//!
//! A point on the tool is `a + u (b − a)` (`a = b` for a point), a point on the skin has weights on up to three corners. `strict` means
//! that both lie strictly inside their primitives, so that no smaller feature (an end, an edge, a corner) has the same pair. Segment and
//! triangle have no nearest pair of their own besides those of ends and edges: they meet only where one pierces the other.
//! Source: Ericson 2005, Real-Time Collision Detection, 5.1.2, 5.1.5, 5.1.9, 5.3.6; segment and triangle after Möller and Trumbore 1997.
//! Differs: signed areas alone determine the region of the triangle. Units: m.

use glam::DVec3;

/// Share of a primitive within which a point belongs to its end: 1 nm on cells of a millimetre. Above f32's resolution of a patch, pairs
/// would be lost between a face and its edge; at 0, rounding decides which of two features has the pair.
pub const MARGIN: f64 = 1e-6;
/// Sine of the angle below which two lines count as parallel; the ends then decide their nearest points.
const PARALLEL: f64 = 1e-6;

/// Nearest points of two primitives.
#[derive(Clone, Copy, Debug)]
pub struct Near {
    /// Parameter of the point on the tool's segment, 0 for a point.
    pub u: f64,
    /// Weights of the point on the skin's feature.
    pub weights: [f64; 3],
    /// From the point on the skin to the one on the tool, m.
    pub away: DVec3,
    /// Both points are strictly inside.
    pub strict: bool,
}

fn inside(share: f64) -> bool {
    share > MARGIN && share < 1.0 - MARGIN
}

/// Parameter, 0 to 1, of the point on a segment nearest to `p`.
pub fn on_segment(p: DVec3, ends: [DVec3; 2]) -> f64 {
    let line = ends[1] - ends[0];
    let squared = line.length_squared();
    if squared > 0.0 { ((p - ends[0]).dot(line) / squared).clamp(0.0, 1.0) } else { 0.0 }
}

/// Weights of the point on a triangle nearest to `p`.
pub fn on_triangle(p: DVec3, corners: [DVec3; 3]) -> [f64; 3] {
    let [a, b, c] = corners;
    let normal = (b - a).cross(c - a);
    let area = normal.length_squared();
    let share = |q: DVec3, r: DVec3| normal.dot((q - p).cross(r - p)) / area;
    let weights = [share(b, c), share(c, a), share(a, b)];
    if area > 0.0 && weights.iter().all(|w| *w >= 0.0) {
        return weights;
    }
    // outside: on the nearest edge
    let edge = |k: usize| {
        let (i, j) = (k, (k + 1) % 3);
        let t = on_segment(p, [corners[i], corners[j]]);
        let mut weights = [0.0; 3];
        (weights[i], weights[j]) = (1.0 - t, t);
        (p.distance_squared(corners[i].lerp(corners[j], t)), weights)
    };
    let nearest = [edge(0), edge(1), edge(2)].into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
    nearest.map_or([1.0, 0.0, 0.0], |found| found.1)
}

/// Tool point and skin vertex.
pub fn point_vertex(p: DVec3, q: DVec3) -> Near {
    Near { u: 0.0, weights: [1.0, 0.0, 0.0], away: p - q, strict: true }
}

/// Tool point and skin edge.
pub fn point_edge(p: DVec3, edge: [DVec3; 2]) -> Near {
    let t = on_segment(p, edge);
    Near { u: 0.0, weights: [1.0 - t, t, 0.0], away: p - edge[0].lerp(edge[1], t), strict: inside(t) }
}

/// Tool point and skin triangle.
pub fn point_face(p: DVec3, corners: [DVec3; 3]) -> Near {
    let weights = on_triangle(p, corners);
    let nearest = corners[0] * weights[0] + corners[1] * weights[1] + corners[2] * weights[2];
    Near { u: 0.0, weights, away: p - nearest, strict: weights.iter().all(|w| inside(*w)) }
}

/// Tool segment and skin vertex.
pub fn segment_vertex(ends: [DVec3; 2], q: DVec3) -> Near {
    let u = on_segment(q, ends);
    Near { u, weights: [1.0, 0.0, 0.0], away: ends[0].lerp(ends[1], u) - q, strict: inside(u) }
}

/// Tool segment and skin edge.
pub fn segment_edge(ends: [DVec3; 2], edge: [DVec3; 2]) -> Near {
    let (d, e, r) = (ends[1] - ends[0], edge[1] - edge[0], ends[0] - edge[0]);
    let (dd, ee, de) = (d.length_squared(), e.length_squared(), d.dot(e));
    let apart = dd * ee - de * de;
    let crossing = apart > PARALLEL * PARALLEL * dd * ee;
    let u = if crossing { ((de * e.dot(r) - d.dot(r) * ee) / apart).clamp(0.0, 1.0) } else { 0.0 };
    let t = on_segment(ends[0] + d * u, edge);
    let u = on_segment(edge[0] + e * t, ends);
    let away = ends[0] + d * u - (edge[0] + e * t);
    Near { u, weights: [1.0 - t, t, 0.0], away, strict: crossing && inside(u) && inside(t) }
}

/// Where a segment pierces a triangle: its parameter there, and whether it goes in (against the outward normal).
pub fn pierces(ends: [DVec3; 2], corners: [DVec3; 3]) -> Option<(f64, bool)> {
    let [a, b, c] = corners;
    let line = ends[1] - ends[0];
    let normal = (b - a).cross(c - a);
    let slope = normal.dot(line);
    if slope.abs() <= PARALLEL * normal.length() * line.length() {
        return None;
    }
    let u = normal.dot(a - ends[0]) / slope;
    let p = ends[0] + line * u;
    let side = |q: DVec3, r: DVec3| normal.dot((q - p).cross(r - p));
    let within = (0.0..=1.0).contains(&u) && [side(a, b), side(b, c), side(c, a)].iter().all(|s| *s >= 0.0);
    within.then_some((u, slope < 0.0))
}
