//! Segments (springs, or face links between cell centres) that the blade's edge crossed in a step, and the position of the crossing.
//!
//! A piece of the edge moves from `a0 b0` to `a1 b1`, a segment from `p0 q0` to `p1 q1`. With `s` along the piece, `u` along the segment
//! and `t` in time, each from 0 to 1, their distance vector is
//!
//! `F(s, u, t) = a + s (b − a) − p − u (q − p)`,
//!
//! trilinear between the eight differences of their ends. The piece crosses the segment where `F = 0`. The number of roots (mod 2) is the
//! number of times that the image of the cube's surface, two triangles per face, winds around the origin; a ray from the origin counts it.
//! A blade that moves, rotates and stretches with the segment does not cross it, whatever the motion. Source: Brochu, Edwards, Bridson
//! 2012, "Efficient geometrically exact continuous collision detection", section 3 (parity of roots by ray casting).
//!
//! # No gap
//! Every face is shared by two cubes: the face of a segment's end by all segments that meet there, that of a piece's end by the next piece,
//! that of the step's end by the next step. Both cubes take the same differences in the same order, so each triangle is counted alike for
//! both, whatever the rounding and ties (the shader hides its products from the compiler, which might fuse them in one place only). Along a
//! closed loop of segments the crossings of an edge that came from outside and has left the loop therefore add up to an even number: no
//! loop is cut in one place only, and a body that the edge has passed completely comes apart. A segment that the edge only touches is
//! crossed in this step or the next, or the segment beyond is.
//!
//! # Position
//! One Newton step towards `F = 0` from the cube's centre; exact if the piece does not rotate relative to the segment.
//!
//! A segment with a non-finite end is not cut. If several pieces cross a segment, the first counts. Units: m.

use super::Source;
use crate::math::{Real, V3, V4};
use serde::{Deserialize, Serialize};

/// The shader.
pub const SOURCE: Source = Source {
    name: "cut",
    wgsl: include_str!("cut.wgsl"),
    params: &["segment_count", "quad_count", "capacity", "zero"],
};

/// Larger than any coordinate, m; a power of two.
const FAR: f64 = (1u64 << 60) as f64;

/// A crossed segment.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Hit<R> {
    /// Segment.
    pub segment: u32,
    /// Position along it, 0 (first end) to 1 (second end).
    pub at: R,
}

/// Tests every segment against every quad; hits in ascending order of segments.
pub fn cut<R: Real>(
    ends: &[[u32; 2]],      // [segment] point ids
    rest: &[V4<R>],         // [point] m
    point_u: &[V4<R>],      // [point] displacement at the step's end, m
    point_before: &[V4<R>], // [point] displacement at the step's start, m
    quads: &[V4<R>],        // [quad × 4] a0 b0 b1 a1, m
) -> Vec<Hit<R>> {
    // swept pieces of the edge, with bounding boxes
    let pieces: Vec<[V3<R>; 4]> = quads.chunks_exact(4).map(|q| [0, 1, 3, 2].map(|k| V3::from4(q[k]))).collect();
    let boxes: Vec<[V3<R>; 2]> = pieces.iter().map(|piece| around(piece)).collect();
    let whole = around(boxes.as_flattened());
    // of each point the sides of the box around all pieces that it is beyond before and after the step (Cohen, Sutherland 1967)
    let position = |n: usize, u: &[V4<R>]| V3::from4(rest[n]) + V3::from4(u[n]);
    let of_point = |n: usize| beyond(&whole, &[position(n, point_before), position(n, point_u)]);
    let sides: Vec<u8> = (0..rest.len()).map(of_point).collect();
    let mut hits = vec![];
    // segments whose box meets that of a piece
    for (segment, [first, second]) in ends.iter().enumerate() {
        if first == second {
            continue; // at the end of the grid: no link
        }
        let [first, second] = [*first as usize, *second as usize];
        if sides[first] & sides[second] != 0 {
            continue;
        }
        let link = [
            position(first, point_before),
            position(second, point_before),
            position(first, point_u),
            position(second, point_u),
        ];
        if !link.iter().all(is_somewhere) {
            continue;
        }
        let own = around(&link);
        let crossed = |(piece, near): (&[V3<R>; 4], &[V3<R>; 2])| {
            if !meet(near, &own) {
                return None;
            }
            // a or b, p or q, start or end: one bit each
            let apart: [V3<R>; 8] = std::array::from_fn(|k| piece[k & 1 | k >> 1 & 2] - link[k >> 1]);
            is_crossed(&apart).then(|| at(&apart))
        };
        let found = pieces.iter().zip(&boxes).find_map(crossed);
        hits.extend(found.map(|at| Hit { segment: segment as u32, at }));
    }
    hits
}

/// Bounding box: minimum and maximum coordinates.
fn around<R: Real>(points: &[V3<R>]) -> [V3<R>; 2] {
    let far = V3::new(R::of(FAR), R::of(FAR), R::of(FAR));
    points.iter().fold([far, -far], |[low, high], p| {
        [
            V3::new(low.x.min(p.x), low.y.min(p.y), low.z.min(p.z)),
            V3::new(high.x.max(p.x), high.y.max(p.y), high.z.max(p.z)),
        ]
    })
}

/// True if, along each axis, the differences between points of two boxes can be positive and non-positive; otherwise no ray counts.
fn meet<R: Real>([low, high]: &[V3<R>; 2], [from, to]: &[V3<R>; 2]) -> bool {
    let (most, least) = (*high - *from, *low - *to);
    let zero = R::zero();
    most.x > zero && most.y > zero && most.z > zero && least.x <= zero && least.y <= zero && least.z <= zero
}

/// Sides of a box, a bit each, that all points are beyond in the sense of [`meet`].
fn beyond<R: Real>([low, high]: &[V3<R>; 2], points: &[V3<R>; 2]) -> u8 {
    let bit = |outside: bool, n: u8| u8::from(outside) << n;
    points.iter().fold(0x3f, |all, p| {
        all & (bit(p.x >= high.x, 0)
            | bit(p.y >= high.y, 1)
            | bit(p.z >= high.z, 2)
            | bit(p.x < low.x, 3)
            | bit(p.y < low.y, 4)
            | bit(p.z < low.z, 5))
    })
}

fn is_somewhere<R: Real>(p: &V3<R>) -> bool {
    p.x.abs() + p.y.abs() + p.z.abs() < R::of(FAR)
}

/// True if the surface of the cube of differences winds around the origin an odd number of times.
fn is_crossed<R: Real>(apart: &[V3<R>; 8]) -> bool {
    // faces: first corner and the bits along the two sides
    const FACES: [[usize; 3]; 6] = [[0, 1, 2], [4, 1, 2], [0, 2, 4], [1, 2, 4], [0, 1, 4], [2, 1, 4]];
    let mut odd = false;
    for [corner, one, other] in FACES {
        let [a, b, c, d] = [0, one, one + other, other].map(|k| apart[corner + k]);
        odd ^= is_on_the_ray([a, b, c]);
        odd ^= is_on_the_ray([a, c, d]);
    }
    odd
}

/// True if a ray from the origin along x passes through a triangle; ties are resolved as for a ray slightly above and before it. Where the
/// signs of the coordinates suffice they decide, so pairs that [`meet`] excludes would have counted as even.
fn is_on_the_ray<R: Real>(corners: [V3<R>; 3]) -> bool {
    let zero = R::zero();
    let count = |above: &dyn Fn(&V3<R>) -> bool| corners.iter().filter(|c| above(c)).count() % 3;
    let ahead = corners.iter().filter(|c| c.x > zero).count();
    if count(&|c| c.y > zero) == 0 || count(&|c| c.z > zero) == 0 || ahead == 0 {
        return false;
    }
    // the two points where the outline passes z = 0: y (the same number for (p, q) and (q, p)) and x
    let mut passes = [[zero; 2]; 2];
    let mut found = 0;
    for k in 0..3 {
        let (p, q) = (corners[k], corners[(k + 1) % 3]);
        if (p.z > zero) != (q.z > zero) {
            let x = p.x + (q.x - p.x) * (p.z / (p.z - q.z));
            passes[found] = [(p.y * q.z - p.z * q.y) / (q.z - p.z), x];
            found += 1;
        }
    }
    let [[y, x], [other_y, other_x]] = passes;
    (y > zero) != (other_y > zero) && (ahead == 3 || x + (other_x - x) * (y / (y - other_y)) > zero)
}

/// Position of the crossing along the segment, from the slopes of `F` at the cube's centre.
fn at<R: Real>(c: &[V3<R>; 8]) -> R {
    // four times the slopes and eight times F
    let along_s = (c[1] - c[0]) + (c[3] - c[2]) + (c[5] - c[4]) + (c[7] - c[6]);
    let along_u = (c[2] - c[0]) + (c[3] - c[1]) + (c[6] - c[4]) + (c[7] - c[5]);
    let along_t = (c[4] - c[0]) + (c[5] - c[1]) + (c[6] - c[2]) + (c[7] - c[3]);
    let f = (c[0] + c[1]) + (c[2] + c[3]) + (c[4] + c[5]) + (c[6] + c[7]);
    let across = along_t.cross(along_s);
    let (volume, half) = (along_u.dot(across), R::of(0.5));
    if volume == R::zero() {
        return half;
    }
    (half - half * (f.dot(across) / volume)).max(R::zero()).min(R::one())
}
