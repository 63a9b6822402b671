//! Which segments (springs, or face links between cell centres) the blade's edge crossed in a step, and where.
//!
//! A piece of the edge goes from `a0 b0` to `a1 b1`, a segment from `p0 q0` to `p1 q1`. With `s` along the piece, `u` along the segment and
//! `t` in time, 0 to 1 each, the piece is at a distance
//!
//! `F(s, u, t) = a + s (b − a) − p − u (q − p)`
//!
//! from the segment, linear in each, from the eight differences of their ends. The piece crosses the segment where `F = 0`: as often (mod 2)
//! as the image of the cube's surface, two triangles a face, winds around the origin, which a ray from the origin counts. What moves,
//! turns and stretches with the segment alike does not cross it, whatever the motion. Source: Brochu, Edwards, Bridson 2012, "Efficient
//! geometrically exact continuous collision detection", section 3 (parity of roots by ray casting).
//!
//! # No gap
//! Every face belongs to two cubes: that of a segment's end to all segments that meet there, that of a piece's end to the next piece, that of
//! the step's end to the next step; and both take the same differences in the same order, so that each triangle is counted or not, rounding
//! or ties aside, alike for both (the shader hides its products from the compiler, which might fuse them in one place and not in the
//! other). So along a closed loop of segments the crossings of an edge that came from outside of it and has left it add up to an even number:
//! no loop is cut in one place alone, and a body that the edge has passed right through comes apart. What the edge only touches, it crosses
//! in this step, in the next, or in the segment beyond.
//!
//! # Where
//! One of Newton's steps to `F = 0` from the cube's centre, exact where the piece does not turn as seen from the segment.
//!
//! A segment that is nowhere is not cut. Of several pieces that cross a segment the first counts. Units: m.

use super::Source;
use crate::math::{Real, V3, V4};
use serde::{Deserialize, Serialize};

/// The shader.
pub const SOURCE: Source = Source {
    name: "cut",
    wgsl: include_str!("cut.wgsl"),
    params: &["segment_count", "quad_count", "capacity", "zero"],
};

/// Beyond every coordinate, m; a power of two.
const FAR: f64 = (1u64 << 60) as f64;

/// A crossed segment.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Hit<R> {
    /// Segment.
    pub segment: u32,
    /// Where, 0 (first end) to 1 (second end).
    pub at: R,
}

/// Every segment against every quad; hits in segment order.
pub fn cut<R: Real>(
    ends: &[[u32; 2]],      // [segment] point ids
    rest: &[V4<R>],         // [point] m
    point_u: &[V4<R>],      // [point] displacement at the step's end, m
    point_before: &[V4<R>], // [point] displacement at the step's start, m
    quads: &[V4<R>],        // [quad × 4] a0 b0 b1 a1, m
) -> Vec<Hit<R>> {
    let pieces: Vec<[V3<R>; 4]> = quads.chunks_exact(4).map(|q| [0, 1, 3, 2].map(|k| V3::from4(q[k]))).collect();
    let boxes: Vec<[V3<R>; 2]> = pieces.iter().map(|piece| around(piece)).collect();
    let whole = around(boxes.as_flattened());
    let mut hits = vec![];
    for (segment, [first, second]) in ends.iter().enumerate() {
        if first == second {
            continue; // an end of the grid: no link
        }
        let place = |n: &u32, u: &[V4<R>]| V3::from4(rest[*n as usize]) + V3::from4(u[*n as usize]);
        let link =
            [place(first, point_before), place(second, point_before), place(first, point_u), place(second, point_u)];
        let own = around(&link);
        if !meet(&whole, &own) || !link.iter().all(is_somewhere) {
            continue;
        }
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

/// Least and largest coordinates.
fn around<R: Real>(points: &[V3<R>]) -> [V3<R>; 2] {
    let far = V3::new(R::of(FAR), R::of(FAR), R::of(FAR));
    points.iter().fold([far, -far], |[low, high], p| {
        [
            V3::new(low.x.min(p.x), low.y.min(p.y), low.z.min(p.z)),
            V3::new(high.x.max(p.x), high.y.max(p.y), high.z.max(p.z)),
        ]
    })
}

/// Whether some difference of what is in two boxes is above 0 and some not, along each axis: without that no ray counts.
fn meet<R: Real>([low, high]: &[V3<R>; 2], [from, to]: &[V3<R>; 2]) -> bool {
    let (most, least) = (*high - *from, *low - *to);
    let zero = R::zero();
    most.x > zero && most.y > zero && most.z > zero && least.x <= zero && least.y <= zero && least.z <= zero
}

fn is_somewhere<R: Real>(p: &V3<R>) -> bool {
    p.x.abs() + p.y.abs() + p.z.abs() < R::of(FAR)
}

/// Whether the surface of the cube of differences winds around the origin an odd number of times.
fn is_crossed<R: Real>(apart: &[V3<R>; 8]) -> bool {
    // a face by its first corner and the bits along its sides
    const FACES: [[usize; 3]; 6] = [[0, 1, 2], [4, 1, 2], [0, 2, 4], [1, 2, 4], [0, 1, 4], [2, 1, 4]];
    let mut odd = false;
    for [corner, one, other] in FACES {
        let [a, b, c, d] = [0, one, one + other, other].map(|k| apart[corner + k]);
        odd ^= is_on_the_ray([a, b, c]);
        odd ^= is_on_the_ray([a, c, d]);
    }
    odd
}

/// Whether a ray from the origin along x passes through a triangle, as a ray a touch above it and before it does. Where the signs of the
/// coordinates suffice they decide, so that what [`meet`] leaves out would have counted as even.
fn is_on_the_ray<R: Real>(corners: [V3<R>; 3]) -> bool {
    let zero = R::zero();
    let count = |above: &dyn Fn(&V3<R>) -> bool| corners.iter().filter(|c| above(c)).count() % 3;
    let ahead = corners.iter().filter(|c| c.x > zero).count();
    if count(&|c| c.y > zero) == 0 || count(&|c| c.z > zero) == 0 || ahead == 0 {
        return false;
    }
    // where the outline passes z = 0: y, the same number for (p, q) and (q, p), and x
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

/// Where along the segment the piece passes it, as the slopes of `F` at the cube's centre have it.
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
