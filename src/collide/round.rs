//! Contacts of spheres and capsules with the skin's surface points.
//!
//! Surface points: the corners of each face, the midpoints of its edges and its centre (on the diagonal of its triangles), so half a cell
//! apart, each once. For a point `p`, the nearest point `a` of the tool's axis and the radius R: `n = (a − p)/|a − p|`, gap
//! `n·(a − p) − R`, negative if the point is inside the tool. A small tool would sink between the points where triangles are longer than R:
//! there each locally nearest point of the faces is a contact too, so both sides of a fold. Larger tools sink by at most 3 % of R; more
//! points for them as well were tried and dropped (forces at rest changed by 1 to 3 % from step to step). A tool of a radius of 1,000 edges
//! or more, nearly a plane, has the corners alone: between them it reaches into a face by at most an 8,000th of an edge.
//!
//! Faces are flat; skin that follows a tool is not. Skin of curvature κ (hollow, at most 1/R) lies above the chords between its nodes by
//! `s = κ/2 Σ_{i<j} w_i w_j L_ij²` at weights `w` (`L` across the axis), in the mean by `s̄ = κ/24 Σ L_ij²`. Chords between nodes on the
//! tool therefore reach into it; contacts may overlap by `s − s̄/2` where that is positive. With no overlap chords are kept out of the tool,
//! which acts as one that is too large. With `s` the nodes lie on the tool: flat faces nearest to it in H¹. With `s − s̄` the mean of the
//! faces does: nearest in L². The energy of a solid is of the norm between the two on its surface, H^½. Skin that is touched lightly is
//! still flat and has no overlap. Measured: sphere of 2 mm pressed by 0.575 mm into the neo-Hookean block of
//! scenes/verify/sphere_press_neo_hookean.toml at rest; error of the force to 0.172 N (quadratic hexahedra) on 20 × 20 × 5 cells, with the
//! sphere over a node, an edge, a face and between them; by 1.15 mm over a node (0.609 N); and by 0.575 mm over a node on 40 × 40 × 8:
//!
//! | overlap | node, edge, face, between | 1.15 mm | 40 × 40 × 8 |
//! | --- | --- | --- | --- |
//! | `s − s̄` | +18, +17, +8, +18 % | +8.5 % | +5.7 % |
//! | `s − s̄/2` | +3, +9, +4, +6 % | +2.0 % | +2.9 % |
//! | `s` | −6, +2, −2, −2 % | −3.7 % | |
//! | mortar: gaps averaged by the nodes' shape functions (Puso, Laursen 2004) | +7, +17, +23, +16 % | +11.5 % | +2.6 % |
//!
//! With faces in two by one diagonal, mirror images of a tool feel forces that differ where cells are coarse: a sphere of 1.5 mm on cells of
//! 2 mm 0.128 and 0.123 N, by 0.03 % on cells of 0.5 mm. Faces in four about their centre, which stands for all four corners, were tried: mirror
//! images agree to 10⁻⁶, but a point over a face is stiffer then, and the force depends more on where the tool is. Spheres of radius R pressed by
//! 0.4 mm (R 1.5 mm) and 0.6 mm (2 mm) at 12 random places of a block of 10 mm, to its force on cells of 0.31 mm, mean and standard deviation:
//!
//! | R over cell | in two | in four |
//! | --- | --- | --- |
//! | 1.2 | +21, 8 % | +30, 16 % |
//! | 1.5 | +2, 7 % | +7, 13 % |
//! | 1.6 | −0.3, 3.6 % | +3.2, 4.9 % |
//! | 2.0 | +0.1, 1.8 % | −0.7, 2.9 % |
//! | 2.1 | +0.5, 1.3 % | −0.9, 1.7 % |
//! | 3.0 | +0.8, 1.1 % | +0.9, 1.2 % |
//!
//! On the half space of scenes/verify/hertz.toml an overlap of `s − s̄` has +0.7 %, `s − s̄/2` −1.0 %.
//!
//! Continuous: along the tool's motion s of the step, `a(t) = a + t s`, conservative advancement (Mirtich 1996: no step exceeds the
//! clearance) finds the first t with `|a(t) − p| = R`. Normal and point on the axis are evaluated there, the gap of that plane at the start
//! of the step. The start of the step, never the end of the motion, decides between inside and outside: a tool that would be through the
//! skin by then is stopped on the side that it came from ([`super::sides`]). A tool whose axis starts inside is pushed out.
//! Units: m.

use super::features::closest::on_segment;
use super::sides::{Last, OfSamples, Side};
use super::{Contact, Patch, Search, frame};
use crate::bodies::rigid::{Instrument, Role, UnconstrainedMotion};
use crate::constraints::Law;
use crate::mesh::{Face, MaterialPoint};
use crate::scene::{Filter, Round};
use glam::DVec3;
use std::collections::BTreeMap;

/// Shortest advancement step, radii: largest depth at which the first touch is found. A smaller one takes more steps past near misses.
const SHORTEST: f64 = 0.01;
/// Most advancement steps; a near miss that takes more keeps the nearest approach found so far.
const MOST_STEPS: u32 = 128;
/// Cosine below which a point's surface is turned away from the tool: the far side of the skin or of a wound.
const FACING: f64 = 0.1;
/// Distance to a surface point, radii, below which a nearest point is redundant.
const SAME: f64 = 1e-3;
/// Weight below which a point is on the opposite edge: a multiple of f32's rounding.
const ON_EDGE: f64 = 1e-5;
/// Cosine between the normals of neighbours below which they meet at an edge of the body or of a wound, not in curved skin.
const SMOOTH: f64 = 0.5;
/// Share of the mean distance `s̄` between curved skin and its chords that an overlap leaves out.
const MEAN_SHARE: f64 = 0.5;
/// Largest overlap of flat faces, radii; reached by triangles longer than 0.8 radii, between whose corners the estimate is no better than a
/// guess.
const OVERLAP: f64 = 0.05;

/// Lengths of an edge, to the radius, above which its midpoint is no contact. A sphere of 1 m on 400 faces has 441 contacts for 1,681.
const FLAT: f64 = 1e3;

/// The tool's axis at the start of the step, with its motion.
struct Sweep {
    ends: [DVec3; 2],
    /// Unit vector; zero for a sphere.
    along: DVec3,
    translation: DVec3,
    radius: f64,
}

/// Contact: unit normal from skin to tool, point of the axis at the start of the step, gap there.
struct Touch {
    normal: DVec3,
    axis: DVec3,
    gap: f64,
}

/// Point of the skin as nodes and weights.
type OnTriangle = ([u32; 3], [f64; 3]);

/// Where an axis sample first touches: feature number, point of the skin as nodes and weights, touch, position.
type Nearest = (usize, OnTriangle, Touch, DVec3);

impl Sweep {
    fn new(tool: &Instrument, round: &Round, free: &UnconstrainedMotion) -> Self {
        let ends = round.ends.map(|end| tool.at(DVec3::from_array(end)));
        let middle = (ends[0] + ends[1]) * 0.5;
        let translation = free.translation + free.rotation.cross(middle - tool.position);
        Self { ends, along: (ends[1] - ends[0]).normalize_or_zero(), translation, radius: round.radius }
    }

    /// Nearest point of the axis before the motion.
    fn nearest(&self, p: DVec3) -> DVec3 {
        let [a, b] = self.ends;
        a + (b - a) * on_segment(p, self.ends)
    }

    /// Smallest clearance up to the first touch, with the value of `at` there; `at` maps the fraction of the motion to clearance and value.
    fn advance<T>(&self, at: impl Fn(f64) -> (f64, T)) -> (f64, T) {
        let length = self.translation.length();
        let mut best = at(0.0);
        let (mut clear, mut t) = (best.0, 0.0);
        for _ in 0..MOST_STEPS {
            t += clear.max(SHORTEST * self.radius) / length;
            if clear <= 0.0 || t > 1.0 || length == 0.0 {
                break;
            }
            let next = at(t);
            clear = next.0;
            if clear < best.0 {
                best = next;
            }
        }
        best
    }

    /// Squared length of a line across the axis, m².
    fn across_squared(&self, line: DVec3) -> f64 {
        (line - self.along * line.dot(self.along)).length_squared()
    }

    /// Allowed overlap of a point of a triangle with the tool on skin of this curvature (1/m), m.
    fn overlap(&self, corners: [DVec3; 3], weights: [f64; 3], curvature: f64) -> f64 {
        let edges = [(0, 1), (1, 2), (2, 0)];
        let share = |(i, j): (usize, usize)| {
            self.across_squared(corners[i] - corners[j]) * (weights[i] * weights[j] - MEAN_SHARE / 12.0)
        };
        let followed = curvature.clamp(0.0, 1.0 / self.radius);
        (0.5 * followed * edges.map(share).iter().sum::<f64>()).clamp(0.0, OVERLAP * self.radius)
    }

    /// Touch of the tool with a surface point, if it comes within `reach`.
    fn meets(&self, p: DVec3, reach: f64) -> Option<Touch> {
        let (clear, (axis, away)) = self.advance(|t| {
            let axis = self.nearest(p - self.translation * t);
            let away = axis + self.translation * t - p;
            (away.length() - self.radius, (axis, away))
        });
        let normal = away.try_normalize().filter(|_| clear < reach)?;
        let outside = self.nearest(p).distance(p) >= self.radius;
        let gap = normal.dot(axis - p) - self.radius;
        // past the nearest approach the plane may lie behind the start by up to an advancement step
        Some(Touch { normal, axis, gap: if outside { gap.max(0.0) } else { gap } })
    }

    /// Touch of a surface point inside a tool that is itself inside the skin, along the way out.
    fn buries(&self, p: DVec3, out: DVec3) -> Option<Touch> {
        let axis = self.nearest(p);
        let away = axis - p;
        let height = away.dot(out);
        let squared = self.radius * self.radius - (away - out * height).length_squared();
        (squared > 0.0).then(|| Touch { normal: out, axis, gap: height - squared.sqrt() })
    }
}

/// `[face]` curvature of the skin, 1/m, positive in a hollow: change of the normal over the distance to a neighbour, the largest one. At
/// the end of a contact the skin leaves the tool on one side.
fn curvatures(faces: &[Face], position: &impl Fn(u32) -> DVec3) -> Vec<f64> {
    let shape = |face: &Face| {
        let [a, b, c, d] = face.nodes.map(position);
        let corners = face.corners();
        let centre = corners.iter().map(|id| position(*id)).sum::<DVec3>() * (1.0 / corners.len() as f64);
        (centre, (c - a).cross(d - b).normalize_or_zero())
    };
    let shapes: Vec<(DVec3, DVec3)> = faces.iter().map(shape).collect();
    let mut beside: BTreeMap<(u32, u32), usize> = BTreeMap::new();
    let mut most = vec![0.0f64; faces.len()];
    // each edge with the face seen before on its other side
    for (k, face) in faces.iter().enumerate() {
        for [a, b] in face.edges() {
            let Some(other) = beside.insert((a.min(b), a.max(b)), k) else { continue };
            let ((here, up), (there, turned)) = (shapes[k], shapes[other]);
            let way = there - here;
            if up.dot(turned) > SMOOTH && way.length_squared() > 0.0 {
                let bent = (up - turned).dot(way) / way.length_squared();
                for face in [k, other] {
                    most[face] = most[face].max(bent);
                }
            }
        }
    }
    most
}

/// Surface point: outward direction, not of unit length, and its allowed overlap with the tool, m.
struct Overlapped {
    outward: DVec3,
    overlap: f64,
}

/// Surface points of faces by their two nodes (a corner has the same one twice).
fn surface_points(
    faces: &[Face],
    position: &impl Fn(u32) -> DVec3,
    sweep: &Sweep,
    curvature: &[f64],
) -> BTreeMap<(u32, u32), Overlapped> {
    let mut points: BTreeMap<(u32, u32), Overlapped> = BTreeMap::new();
    for (face, curvature) in faces.iter().zip(curvature) {
        let corners = face.nodes.map(position);
        let turned = (corners[2] - corners[0]).cross(corners[3] - corners[1]);
        // two nodes of a triangle and the third; the diagonal of a face is that of its triangles
        let of_triangle = [(0, 0, 0), (1, 1, 1), (2, 2, 2), (0, 1, 2), (1, 2, 0), (0, 2, 1)];
        let of_second = [(3, 3, 3), (2, 3, 0), (3, 0, 2)];
        let second = if face.is_triangle() { &[][..] } else { &of_second };
        for (i, j, k) in of_triangle.iter().chain(second).copied() {
            if i != j && FLAT * corners[i].distance(corners[j]) < sweep.radius {
                continue;
            }
            let overlap = sweep.overlap([corners[i], corners[j], corners[k]], [0.5, 0.5, 0.0], *curvature);
            let (a, b) = (face.nodes[i], face.nodes[j]);
            let first = Overlapped { outward: DVec3::ZERO, overlap };
            let point = points.entry((a.min(b), a.max(b))).or_insert(first);
            point.outward += turned;
            point.overlap = point.overlap.min(overlap);
        }
    }
    points
}

/// Feature number of a surface point, after those of the tool's own samples.
fn point_id(tool: &Instrument, i: u32, j: u32) -> usize {
    tool.samples.len() + ((i as usize) << 32 | j as usize)
}

/// Feature number of a triangle, after those of surface points: the same from step to step.
fn triangle_id(nodes: [u32; 3]) -> usize {
    let mixed =
        nodes.iter().fold(0usize, |sum, node| sum.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(*node as usize));
    1 << 63 | mixed >> 1
}

/// Contacts of one round tool with the faces near it, which make up `patch`; `position` gives a node's present position.
pub fn contacts(
    (number, tool): (usize, &Instrument),
    round: &Round,
    (body, patch): (usize, &Patch),
    faces: &[Face],
    position: &impl Fn(u32) -> DVec3,
    search: &Search,
    free: &UnconstrainedMotion,
    last: &Last,
) -> (Vec<Contact>, OfSamples) {
    let sweep = Sweep::new(tool, round, free);
    let reach = search.alarm + search.distance;
    let Near { points: mut nearest, out, sides } = nearest_points(tool, patch, &sweep, reach, last);
    let made = |index: usize, (nodes, weights): OnTriangle, touch: &Touch| {
        let point = touch.axis - touch.normal * sweep.radius;
        let contact = Contact::on_skin(number, index, body, MaterialPoint::of(nodes, weights), point);
        let law = Law::contact(search.friction);
        let gap = [touch.gap - search.distance, 0.0, 0.0];
        Contact { axes: frame(touch.normal), gap, depth: (-touch.gap).max(0.0), law, ..contact }
    };
    // filter "one": the deepest only
    if search.filter == Filter::One {
        let deepest = nearest.iter().min_by(|a, b| a.2.gap.total_cmp(&b.2.gap));
        let found = deepest.map(|(index, on_skin, touch, _)| made(*index, *on_skin, touch)).into_iter().collect();
        return (found, sides);
    }
    let curvature = curvatures(faces, position);
    if out.is_none() {
        nearest = nearest_on_triangles(tool, patch, &sweep, &curvature, reach);
    }
    // surface points
    let mut found = vec![];
    let mut taken = vec![];
    for ((i, j), point) in surface_points(faces, position, &sweep, &curvature) {
        let p = (position(i) + position(j)) * 0.5;
        let touch = match out {
            Some(out) => sweep.buries(p, out),
            None => sweep.meets(p, reach),
        };
        if let Some(touch) = touch.filter(|t| t.normal.dot(point.outward) > FACING * point.outward.length()) {
            let touch = Touch { gap: touch.gap + point.overlap, ..touch };
            found.push(made(point_id(tool, i, j), ([i, j, j], [0.5, 0.5, 0.0]), &touch));
            taken.push(p);
        }
    }
    // nearest points that no surface point stands for
    for (index, on_skin, touch, nearest) in &nearest {
        if taken.iter().all(|p| p.distance(*nearest) > SAME * sweep.radius) {
            found.push(made(*index, *on_skin, touch));
            taken.push(*nearest);
        }
    }
    (found, sides)
}

/// Skin near a tool's axis.
struct Near {
    /// For each axis sample the point that it first touches or comes nearest to.
    points: Vec<Nearest>,
    /// If a sample starts inside the skin, the way out: the normal at the point nearest to the deepest one.
    out: Option<DVec3>,
    /// Sides that the samples are on.
    sides: OfSamples,
}

fn nearest_points(tool: &Instrument, patch: &Patch, sweep: &Sweep, reach: f64, last: &Last) -> Near {
    let (mut found, mut sides) = (vec![], vec![]);
    let mut deepest: Option<(f64, DVec3)> = None;
    for (index, axis) in samples_on_axis(tool) {
        let start = last.project(patch, index, axis);
        let (clear, (triangle, weights, normal)) = sweep.advance(|t| {
            let (triangle, weights, distance, normal) =
                if t == 0.0 { start } else { patch.project_outside(axis + sweep.translation * t) };
            (distance - sweep.radius, (triangle, weights, normal))
        });
        sides.push((index, (clear < reach).then(|| Side::of(patch, axis, start))));
        if clear >= reach {
            continue;
        }
        let (_, _, distance, out) = start;
        if deepest.is_none_or(|(depth, _)| distance < depth) {
            deepest = Some((distance, out));
        }
        let nearest = patch.position(triangle, weights);
        let gap = normal.dot(axis - nearest) - sweep.radius;
        let gap = if distance >= sweep.radius { gap.max(0.0) } else { gap };
        found.push((index, (patch.triangles[triangle], weights), Touch { normal, axis, gap }, nearest));
    }
    let out = deepest.filter(|(distance, _)| *distance < 0.0).map(|(_, normal)| normal);
    Near { points: found, out, sides }
}

/// For each triangle with an edge longer than the tool's radius, the point that an axis sample first touches on it, unless a triangle
/// around that point is touched earlier elsewhere: local minima of the distance.
fn nearest_on_triangles(
    tool: &Instrument,
    patch: &Patch,
    sweep: &Sweep,
    curvature: &[f64],
    reach: f64,
) -> Vec<Nearest> {
    let mut met: Vec<(f64, usize, Nearest)> = vec![];
    let per_face = patch.corners.len() / curvature.len().max(1); // faces of a body are all of one kind
    for (triangle, corners) in patch.corners.iter().enumerate() {
        let longest = (0..3).map(|k| corners[k].distance(corners[(k + 1) % 3])).fold(0.0, f64::max);
        if longest <= sweep.radius {
            continue;
        }
        let outward = patch.face_normal(triangle);
        // first touch over the axis samples
        let candidates = samples_on_axis(tool).filter_map(|(_, at)| {
            let (clear, weights) = sweep.advance(|t| {
                let centre = at + sweep.translation * t;
                let weights = patch.nearest_on(triangle, centre);
                (patch.position(triangle, weights).distance(centre) - sweep.radius, weights)
            });
            let nearest = patch.position(triangle, weights);
            let touch = sweep.meets(nearest, reach).filter(|t| t.normal.dot(outward) > FACING)?;
            let touch =
                Touch { gap: touch.gap + sweep.overlap(*corners, weights, curvature[triangle / per_face]), ..touch };
            Some((
                clear,
                triangle,
                (triangle_id(patch.triangles[triangle]), (patch.triangles[triangle], weights), touch, nearest),
            ))
        });
        met.extend(candidates.min_by(|a, b| a.0.total_cmp(&b.0)));
    }
    // keep those that no triangle around the point touches earlier
    let earlier = |(clear, triangle, (_, (nodes, weights), ..)): &(f64, usize, Nearest)| {
        let holds = |other: &[u32; 3]| (0..3).all(|k| weights[k] < ON_EDGE || other.contains(&nodes[k]));
        met.iter().any(|m| m.1 != *triangle && m.0 < clear - SAME * sweep.radius && holds(&m.2.1.0))
    };
    let least: Vec<bool> = met.iter().map(|m| !earlier(m)).collect();
    met.into_iter().zip(least).filter(|(_, least)| *least).map(|(m, _)| m.2).collect()
}

fn samples_on_axis(tool: &Instrument) -> impl Iterator<Item = (usize, DVec3)> {
    let axis = tool.samples.iter().enumerate().filter(|(_, s)| s.role == Role::Axis);
    axis.map(|(index, sample)| (index, tool.at(sample.position)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Side of a cell, m.
    const CELL: f64 = 1e-3;
    const RADIUS: f64 = 4e-3;

    fn sweep(along: DVec3) -> Sweep {
        Sweep { ends: [DVec3::ZERO; 2], along, translation: DVec3::ZERO, radius: RADIUS }
    }

    /// Patch of 4 × 4 faces at height `z(x, y)`, and its nodes.
    fn patch(z: impl Fn(f64, f64) -> f64) -> (Vec<Face>, Vec<DVec3>) {
        let at = |k: u32| (f64::from(k) - 2.0) * CELL;
        let nodes = (0..25).map(|n| (at(n % 5), at(n / 5)));
        let corner = |k: u32| k % 4 + 5 * (k / 4);
        let quad = |k: u32| Face { nodes: [0, 1, 6, 5].map(|n| corner(k) + n), cell: 0, wall: false };
        ((0..16).map(quad).collect(), nodes.map(|(x, y)| DVec3::new(x, y, z(x, y))).collect())
    }

    #[test]
    fn curvature_is_that_of_a_bowl_and_none_on_a_plane_a_hill_or_over_an_edge() {
        let found = |z: &dyn Fn(f64, f64) -> f64| {
            let (faces, nodes) = patch(z);
            curvatures(&faces, &|id| nodes[id as usize])
        };
        let bowl = found(&|x, y| (x * x + y * y) / (2.0 * RADIUS));
        // tangents of up to 0.375, not angles
        assert!(bowl.iter().all(|k| (k * RADIUS - 1.0).abs() < 0.2), "{bowl:?}");
        assert!(found(&|x, _| 0.3 * x).iter().all(|k| k.abs() < 1e-9));
        assert!(found(&|x, y| -(x * x + y * y) / (2.0 * RADIUS)).iter().all(|k| *k == 0.0));
        assert!(found(&|x, _| 3.0 * x.abs()).iter().all(|k| k.abs() < 1e-6), "walls of a wound");
    }

    #[test]
    fn chords_of_a_bowl_overlap_by_their_sag_less_half_its_mean() {
        let corners = [DVec3::ZERO, DVec3::X * CELL, (DVec3::X + DVec3::Y) * CELL];
        let (sphere, middle) = (sweep(DVec3::ZERO), [0.5, 0.0, 0.5]);
        let diagonal = 2.0 * CELL * CELL;
        let two_thirds_of_sag = diagonal / (12.0 * RADIUS);
        assert!((sphere.overlap(corners, middle, 1.0 / RADIUS) - two_thirds_of_sag).abs() < 1e-12);
        assert!(
            (sphere.overlap(corners, middle, 9.0 / RADIUS) - two_thirds_of_sag).abs() < 1e-12,
            "no more than the tool's"
        );
        assert_eq!(sphere.overlap(corners, [1.0, 0.0, 0.0], 1.0 / RADIUS), 0.0, "a corner");
        assert_eq!(sphere.overlap(corners, middle, 0.0), 0.0, "flat skin");
        assert_eq!(sphere.overlap(corners.map(|c| c * 50.0), middle, 1.0 / RADIUS), OVERLAP * RADIUS);
        // a capsule along x: the same chords, seen along its axis, count half
        let capsule = sweep(DVec3::X).overlap(corners, middle, 1.0 / RADIUS);
        assert!((capsule - 0.5 * two_thirds_of_sag).abs() < 1e-12, "{capsule}");
    }
}
