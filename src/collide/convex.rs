//! Contact manifolds of boxes and segments with each other, in f64.
//!
//! Boxes: the axis of greatest separation among face normals and products of edges (Gottschalk, Lin, Manocha 1996); where it is a face's,
//! the other box's face clipped by the sides of this one (Sutherland, Hodgman 1974), where it is a product, the nearest points of two
//! edges. A segment and a box: the direction between their nearest points, or the axis of greatest separation where they cross; along a
//! face the ends of what lies over it. Two segments: their nearest points, or the ends of their overlap where these are as near. A point is
//! a segment without length.
//!
//! Thresholds are shares of the parts' own sizes or sines of angles: parts of a millimetre, turned by 1e-9, are as safe as any. (parry3d's
//! manifolds, in f32 and with thresholds in squared metres, lose two boxes of 6 mm turned by 1e-5° to 45°, and bars that cross.)
//! Units: m.

use super::features::closest::{on_segment, segment_edge};
use crate::bodies::rigid::Instrument;
use glam::{DMat3, DVec3};

/// Share of the smaller box's least half extent by which an axis of two edges must separate more than one of a face.
const FACES_FIRST: f64 = 1e-4;
/// Sine of the angle below which two edges, or two lines, are parallel.
const PARALLEL: f64 = 1e-6;
/// Sine of the angle below which two segments touch along their overlap, not in a point.
const ALONG: f64 = 0.05;
/// Cosine of the angle up to which a segment's way to a box is that of a face: the distances differ by less than 1 %.
const OVER_FACE: f64 = 0.99;
/// Share of a part's size below which two points of a manifold are one.
const SAME: f64 = 1e-6;

/// Box.
#[derive(Clone, Copy, Debug)]
pub struct Cuboid {
    /// m
    pub centre: DVec3,
    /// Unit axes.
    pub axes: DMat3,
    /// Half extents, m.
    pub half: DVec3,
}

/// Contact point of two parts: the point half way between them, the unit normal towards the first, and the gap, m.
pub type Point = (DVec3, DVec3, f64);

/// Point half way between two points of parts, for the gap along a normal.
fn midway((p, q): (DVec3, DVec3), normal: DVec3) -> Point {
    ((p + q) * 0.5, normal, normal.dot(p - q))
}

/// Nearest points of two segments, and whether both lie between the ends.
fn nearest(first: [DVec3; 2], second: [DVec3; 2]) -> ((DVec3, DVec3), bool) {
    let near = segment_edge(first, second);
    ((first[0].lerp(first[1], near.u), second[0].lerp(second[1], near.weights[1])), near.strict)
}

impl Cuboid {
    /// Of a rigid body; none if it is no box.
    pub fn of(body: &Instrument) -> Option<Self> {
        Some(Self { centre: body.position, axes: DMat3::from_quat(body.rotation), half: body.cuboid? })
    }

    fn axis(&self, k: usize) -> DVec3 {
        self.axes.col(k)
    }

    /// Half of its extent along a unit direction.
    fn reach(&self, along: DVec3) -> f64 {
        (0..3).map(|k| self.half[k] * self.axis(k).dot(along).abs()).sum()
    }

    /// Corners of the face that looks most along a direction, in order around it.
    fn face(&self, along: DVec3) -> [DVec3; 4] {
        let local = self.axes.transpose() * along;
        let k = local.abs().max_position();
        let middle = self.centre + self.axis(k) * self.half[k].copysign(local[k]);
        let [u, v] = [(k + 1) % 3, (k + 2) % 3].map(|n| self.axis(n) * self.half[n]);
        [middle - u - v, middle + u - v, middle + u + v, middle - u + v]
    }

    /// Edge along axis `k` that lies farthest along a direction.
    fn edge(&self, k: usize, along: DVec3) -> [DVec3; 2] {
        let side = |n: usize| self.axis(n) * self.half[n].copysign(self.axis(n).dot(along));
        let middle = self.centre + side((k + 1) % 3) + side((k + 2) % 3);
        let half = self.axis(k) * self.half[k];
        [middle - half, middle + half]
    }

    /// All twelve edges, each with the outward unit normals of its two faces.
    pub fn edges(&self) -> impl Iterator<Item = ([DVec3; 2], [DVec3; 2])> {
        (0..12).map(|n| {
            let k = n / 4;
            let normal = |bit: usize| self.axis((k + 1 + bit) % 3) * if n >> bit & 1 == 0 { -1.0 } else { 1.0 };
            let normals = [0, 1].map(normal);
            (self.edge(k, normals[0] + normals[1]), normals)
        })
    }

    /// Its point nearest to a point.
    fn nearest(&self, p: DVec3) -> DVec3 {
        self.centre + self.axes * (self.axes.transpose() * (p - self.centre)).clamp(-self.half, self.half)
    }

    /// Whether a part of a segment is inside.
    fn holds_part_of(&self, ends: [DVec3; 2]) -> bool {
        let [from, to] = ends.map(|end| self.axes.transpose() * (end - self.centre));
        let (mut enters, mut leaves) = (0.0_f64, 1.0_f64);
        for k in 0..3 {
            let along = to[k] - from[k];
            let at = [-self.half[k], self.half[k]].map(|face| (face - from[k]) / along);
            if along == 0.0 {
                leaves = if from[k].abs() > self.half[k] { -1.0 } else { leaves };
            } else {
                enters = enters.max(at[0].min(at[1]));
                leaves = leaves.min(at[0].max(at[1]));
            }
        }
        enters <= leaves
    }

    /// Clips a polygon, or a segment as one of two corners, by the sides of the faces along axis `k`.
    fn clip(&self, k: usize, mut polygon: Vec<DVec3>) -> Vec<DVec3> {
        for side in [(k + 1) % 3, (k + 2) % 3] {
            for outward in [self.axis(side), -self.axis(side)] {
                let beyond = |p: &DVec3| outward.dot(*p - self.centre) - self.half[side];
                let mut kept = vec![];
                for (n, to) in polygon.iter().enumerate() {
                    let from = &polygon[(n + polygon.len() - 1) % polygon.len()];
                    let (before, here) = (beyond(from), beyond(to));
                    if (before > 0.0) != (here > 0.0) {
                        kept.push(from.lerp(*to, before / (before - here)));
                    }
                    if here <= 0.0 {
                        kept.push(*to);
                    }
                }
                polygon = kept;
            }
        }
        // corners on a side come twice
        let same = SAME * self.half.min_element();
        let mut once: Vec<DVec3> = vec![];
        for p in polygon {
            if once.iter().all(|other| other.distance(p) > same) {
                once.push(p);
            }
        }
        once
    }

    /// Contact points with a polygon over the face along `±` axis `k`; normals lead out of this box.
    fn over_face(&self, k: usize, sign: f64, polygon: Vec<DVec3>) -> impl Iterator<Item = Point> {
        let normal = self.axis(k) * sign;
        let (centre, half) = (self.centre, self.half[k]);
        let gap = move |p: DVec3| normal.dot(p - centre) - half;
        self.clip(k, polygon).into_iter().map(move |p| (p - normal * (0.5 * gap(p)), normal, gap(p)))
    }
}

/// Contact points of two boxes, none if they are more than `reach` apart.
pub fn boxes(a: &Cuboid, b: &Cuboid, reach: f64) -> Vec<Point> {
    let apart = a.centre - b.centre;
    let separation = |axis: DVec3| apart.dot(axis).abs() - a.reach(axis) - b.reach(axis);
    // faces of either: separation, whether of the second, axis
    let faces = [(a, false), (b, true)].into_iter().flat_map(|(of, second)| (0..3).map(move |k| (of, second, k)));
    let faces = faces.map(|(of, second, k)| (separation(of.axis(k)), second, k));
    let Some(face) = faces.reduce(|best, next| if next.0 > best.0 { next } else { best }) else { return vec![] };
    // products of edges
    let mut edge: Option<(f64, DVec3, [usize; 2])> = None;
    for (i, j) in (0..9).map(|n| (n / 3, n % 3)) {
        let across = a.axis(i).cross(b.axis(j));
        let sine = across.length();
        if sine > PARALLEL {
            let axis = across / sine * 1.0_f64.copysign(across.dot(apart));
            let found = separation(axis);
            if edge.is_none_or(|(best, ..)| found > best) {
                edge = Some((found, axis, [i, j]));
            }
        }
    }
    if face.0.max(edge.map_or(f64::NEG_INFINITY, |edge| edge.0)) > reach {
        return vec![];
    }
    let of_edges = |(apart, normal, [i, j]): (f64, DVec3, [usize; 2])| {
        let (first, second) = (a.edge(i, -normal), b.edge(j, normal));
        let (points, between) = nearest(first, second);
        // not past each other's ends
        if between || apart <= 0.0 { vec![midway(points, normal)] } else { vec![] }
    };
    let bias = FACES_FIRST * a.half.min_element().min(b.half.min_element());
    if let Some(edge) = edge.filter(|edge| edge.0 > face.0 + bias) {
        return of_edges(edge);
    }
    // the other's face over this one's
    let (_, second, k) = face;
    let (of, other, away) = if second { (b, a, apart) } else { (a, b, -apart) };
    let sign = 1.0_f64.copysign(away.dot(of.axis(k)));
    let polygon = other.face(of.axis(k) * -sign).to_vec();
    let towards_first = if second { 1.0 } else { -1.0 };
    let found: Vec<Point> =
        of.over_face(k, sign, polygon).map(|(point, normal, gap)| (point, normal * towards_first, gap)).collect();
    // beside each other nothing is over the face
    if found.is_empty() && face.0 <= 0.0 { edge.map_or(vec![], of_edges) } else { found }
}

/// Contact points of a segment with a box; normals lead from the box to the segment.
pub fn segment_on_box(ends: [DVec3; 2], of: &Cuboid) -> Vec<Point> {
    let over_face = |normal: DVec3| {
        let local = of.axes.transpose() * normal;
        let k = local.abs().max_position();
        (local[k].abs(), of.over_face(k, 1.0_f64.copysign(local[k]), ends.to_vec()))
    };
    // apart: between an end and the box, or the segment and an edge
    let pairs =
        ends.map(|end| (end, of.nearest(end))).into_iter().chain(of.edges().map(|(edge, _)| nearest(ends, edge).0));
    let least = pairs.min_by(|a, b| a.0.distance_squared(a.1).total_cmp(&b.0.distance_squared(b.1)));
    let (p, q) = least.unwrap_or_default();
    if p.distance(q) > SAME * of.half.min_element() && !of.holds_part_of(ends) {
        let normal = (p - q).normalize();
        let (cosine, over) = over_face(normal);
        let found: Vec<Point> = over.collect();
        let as_near = found.iter().any(|(.., gap)| *gap * OVER_FACE <= p.distance(q)); // not so where a steep segment passes the rim
        return if cosine > OVER_FACE && as_near { found } else { vec![midway((p, q), normal)] };
    }
    // touching or crossing: the axis of greatest separation, of a face or of an edge and the segment
    let separation =
        |axis: DVec3| ends.map(|end| axis.dot(end - of.centre)).into_iter().fold(f64::MAX, f64::min) - of.reach(axis);
    let line = ends[1] - ends[0];
    let across = (0..3).map(|k| (of.axis(k).cross(line), Some(k)));
    let across = across.filter(|(across, _)| across.length() > PARALLEL * line.length());
    let axes = (0..3).map(|k| (of.axis(k), None)).chain(across.map(|(across, k)| (across.normalize(), k)));
    let bias = |k: Option<usize>| if k.is_some() { FACES_FIRST * of.half.min_element() } else { 0.0 };
    let both = axes.flat_map(|(axis, k)| [axis, -axis].map(|axis| (separation(axis) - bias(k), axis, k)));
    match both.max_by(|a, b| a.0.total_cmp(&b.0)) {
        Some((_, normal, Some(k))) => vec![midway(nearest(ends, of.edge(k, normal)).0, normal)],
        Some((_, normal, None)) => {
            let found: Vec<Point> = over_face(normal).1.collect();
            if found.is_empty() { vec![midway((p, q), normal)] } else { found } // at a corner
        }
        None => vec![],
    }
}

/// Contact points of two segments; normals lead to the first.
pub fn segments(first: [DVec3; 2], second: [DVec3; 2]) -> Vec<Point> {
    let (line, other) = (first[1] - first[0], second[1] - second[0]);
    let (longest, lengths) = (line.length().max(other.length()), line.length() * other.length());
    let across = line.cross(other);
    // where axes meet: across both, towards the first's middle
    let apart = first[0] + first[1] - second[0] - second[1];
    let crossing = match across.length() > PARALLEL * lengths {
        true => across.normalize(),
        false if longest > 0.0 => if line.length() > 0.0 { line } else { other }.normalize().any_orthonormal_vector(),
        false => DVec3::Z,
    };
    let crossing = crossing * 1.0_f64.copysign(crossing.dot(apart));
    let point = |(p, q): (DVec3, DVec3)| {
        midway((p, q), if p.distance(q) > SAME * longest { (p - q).normalize() } else { crossing })
    };
    let least = point(nearest(first, second).0);
    if lengths > 0.0 && across.length() < ALONG * lengths {
        // ends of the overlap, on the first, if they are as near
        let shares = second.map(|end| on_segment(end, first));
        let ends = shares.map(|share| first[0].lerp(first[1], share));
        let found = ends.map(|p| point((p, second[0].lerp(second[1], on_segment(p, second)))));
        let as_near = |(.., gap): &Point| gap * OVER_FACE <= least.2 + SAME * longest;
        if ends[0].distance(ends[1]) > SAME * line.length() && found.iter().all(as_near) {
            return found.to_vec();
        }
    }
    vec![least]
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;
    use proptest::prelude::*;

    fn cuboid(centre: DVec3, turn: DQuat, half: [f64; 3]) -> Cuboid {
        Cuboid { centre, axes: DMat3::from_quat(turn), half: half.into() }
    }

    /// Area of the polygon of a manifold's points around their mean, seen along z.
    fn area(points: &[Point]) -> f64 {
        let middle = points.iter().map(|(p, ..)| *p).sum::<DVec3>() / points.len() as f64;
        let mut around: Vec<DVec3> = points.iter().map(|(p, ..)| *p - middle).collect();
        around.sort_by(|p, q| p.y.atan2(p.x).total_cmp(&q.y.atan2(q.x)));
        let next = around.iter().skip(1).chain(around.first());
        around.iter().zip(next).map(|(p, q)| 0.5 * p.cross(*q).z).sum()
    }

    /// Overlap of two squares of half edge `h` turned against each other: an octagon whose sides are all `h` from its centre.
    fn overlap(h: f64, angle: f64) -> f64 {
        4.0 * h * h * ((0.5 * angle).tan() + (0.5 * (std::f64::consts::FRAC_PI_2 - angle)).tan())
    }

    #[test]
    fn boxes_on_each_other_touch_over_their_overlap_however_they_are_turned() {
        for size in [3e-6, 3e-3, 3.0] {
            for degrees in [0.0_f64, 1e-9, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 0.01, 0.1, 1.0, 10.0, 30.0, 45.0] {
                let angle = degrees.to_radians();
                let below = cuboid(DVec3::ZERO, DQuat::IDENTITY, [size, size, 0.5 * size]);
                let above = cuboid(DVec3::Z * size, DQuat::from_rotation_z(angle), [size, size, 0.5 * size]);
                for found in [boxes(&above, &below, 0.1 * size), boxes(&below, &above, 0.1 * size)] {
                    let wanted = overlap(size, angle);
                    assert!((area(&found) / wanted - 1.0).abs() < 1e-5, "{size} {degrees}: {} {wanted}", area(&found));
                    assert!(found.iter().all(|(_, _, gap)| gap.abs() < 1e-9 * size), "{found:?}");
                }
            }
        }
    }

    #[test]
    fn bars_that_cross_touch_where_they_do() {
        for turn in [1e-6, 1e-3, 0.5, 1.57] {
            let bar = cuboid(DVec3::ZERO, DQuat::IDENTITY, [12e-3, 0.3e-3, 1e-3]);
            let ends =
                [-12e-3, 12e-3].map(|x| DQuat::from_rotation_z(turn) * DVec3::new(x, 0.0, 0.0) + DVec3::Z * 1.5e-3);
            let on_bar = segment_on_box(ends, &bar);
            assert_eq!(on_bar.len(), 2, "{turn}: {on_bar:?}");
            for (_, normal, gap) in &on_bar {
                assert!(normal.distance(DVec3::Z) < 1e-9 && (gap - 0.5e-3).abs() < 1e-12, "{turn}: {on_bar:?}");
            }
            let found = segments(ends, [DVec3::X * -12e-3, DVec3::X * 12e-3]);
            // of those that are all but parallel the ends, each by its own way
            let off = if turn < 1e-2 { 1e-2 } else { 1e-6 };
            assert!(found.iter().all(|(_, n, gap)| n.z > 1.0 - off && (gap / 1.5e-3 - 1.0).abs() < off), "{found:?}");
            assert_eq!(found.len(), if turn < 1e-2 { 2 } else { 1 }, "{turn}: {found:?}");
        }
    }

    fn vector(size: f64) -> impl Strategy<Value = DVec3> {
        prop::array::uniform3(-size..size).prop_map(DVec3::from)
    }

    fn rotation() -> impl Strategy<Value = DQuat> {
        prop::array::uniform4(-1.0..1.0_f64).prop_filter_map("of no length", |q| {
            DQuat::from_array(q).length().gt(&0.1).then(|| DQuat::from_array(q).normalize())
        })
    }

    fn half() -> impl Strategy<Value = [f64; 3]> {
        prop::array::uniform3(0.1..2.0_f64)
    }

    /// Most separation of two boxes along any of their fifteen axes.
    fn apart(a: &Cuboid, b: &Cuboid) -> f64 {
        let products = (0..9).map(|n| a.axis(n / 3).cross(b.axis(n % 3)).try_normalize().unwrap_or(DVec3::X));
        let axes = (0..3).flat_map(|k| [a.axis(k), b.axis(k)]).chain(products);
        let separation = |axis: DVec3| (a.centre - b.centre).dot(axis).abs() - a.reach(axis) - b.reach(axis);
        axes.map(separation).fold(f64::MIN, f64::max)
    }

    #[test]
    fn boxes_beside_each_other_do_not_touch() {
        let below = cuboid(DVec3::ZERO, DQuat::IDENTITY, [10.0; 3]);
        for (at, turn) in
            [([20.5, 0.0, 30.0], 0.0), ([20.05, 0.0, 20.1], 0.0), ([20.5, 20.5, 20.5], 0.0), ([25.0, 25.0, 20.5], 0.7)]
        {
            let above = cuboid(at.into(), DQuat::from_rotation_z(turn), [10.0; 3]);
            assert!(boxes(&above, &below, 40.0).is_empty(), "{at:?}");
        }
    }

    #[test]
    fn axes_that_meet_part_across_both_and_rods_aslant_touch_where_they_do() {
        let on_axis = segments([DVec3::Z; 2], [DVec3::ZERO, DVec3::Z * 2.0]);
        assert!(on_axis.len() == 1 && on_axis[0].1.z.abs() < 1e-9, "{on_axis:?}");
        let rounded = segments([DVec3::new(-1.0, 1e-18, 1e-18), DVec3::X], [-DVec3::Y, DVec3::new(1e-18, 1.0, 0.0)]);
        assert!(rounded.len() == 1 && rounded[0].1.z.abs() > 1.0 - 1e-9, "{rounded:?}");
        let far = DVec3::new(0.2 * 0.05_f64.cos(), 0.2 * 0.05_f64.sin(), 2e-3);
        let aslant = segments([DVec3::Z * 2e-3, far], [DVec3::ZERO, DVec3::X * 0.2]);
        assert!(aslant.len() == 1 && (aslant[0].2 - 2e-3).abs() < 1e-9, "{aslant:?}");
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

        /// Moved out along the normal by the depth, and no less, boxes are free of each other.
        #[test]
        fn boxes_are_freed_by_their_depth(at in vector(3.0), turn in rotation(), one in half(), two in half()) {
            let (a, b) = (cuboid(at, turn, one), cuboid(DVec3::ZERO, DQuat::IDENTITY, two));
            let before = apart(&a, &b);
            let found = boxes(&a, &b, 0.1);
            prop_assert_eq!(found.is_empty() && before < 0.0, false);
            if let (Some((_, normal, _)), true) = (found.first(), before < 0.0) {
                let depth = found.iter().map(|(.., gap)| -gap).fold(f64::MIN, f64::max);
                prop_assert!(depth <= -before + 2.0 * FACES_FIRST * 2.0, "{} {}", depth, before);
                for (share, free) in [(1.001, true), (0.9, false)] {
                    let moved = Cuboid { centre: at + *normal * (share * -before + if free { 2e-3 } else { -2e-3 }), ..a };
                    prop_assert_eq!(apart(&moved, &b) >= 0.0, free, "{} {:?}", before, found);
                }
            }
        }

        /// Gaps of a segment and a box are the distance where they are apart, and moved out by the depth it is free.
        #[test]
        fn a_segment_is_as_far_from_a_box_as_its_gap_says(from in vector(3.0), to in vector(3.0), half in half()) {
            let of = cuboid(DVec3::ZERO, DQuat::IDENTITY, half);
            let distance = |by: DVec3| {
                let at = (0..=2000).map(|n| from.lerp(to, f64::from(n) / 2000.0) + by);
                at.map(|p| p.distance(of.nearest(p))).fold(f64::MAX, f64::min)
            };
            let found = segment_on_box([from, to], &of);
            let least = found.iter().map(|(.., gap)| *gap).fold(f64::MAX, f64::min);
            let true_distance = distance(DVec3::ZERO);
            if true_distance > 0.0 {
                // what is sampled is at most a piece too far; along a face heights differ by 1 %
                prop_assert!((least - true_distance).abs() < 0.011 * true_distance + 2e-3, "{} {:?}", true_distance, found);
            } else {
                let normal = found[0].1;
                prop_assert!(distance(normal * (1.001 * -least + 2e-3)) > 0.0, "{:?}", found);
                prop_assert!(distance(normal * (0.9 * -least - 2e-3).max(0.0)) == 0.0, "{:?}", found);
            }
        }
    }
}
