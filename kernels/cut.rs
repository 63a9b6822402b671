//! Which segments (springs, or face links between cell centres) the blade's edge crossed in a step.
//!
//! A piece of the edge sweeps the quad `(a0, b0, b1, a1)`: its ends at the step's start and end. The sweep is taken relative to the
//! segment's own motion: the start corners are shifted by the displacement of the segment's middle in the step, so skin that moves onto
//! a resting blade is cut too. The quad is split into the triangles `(a0, b0, b1)` and `(a0, b1, a1)`; a segment `(p, q)` crosses a
//! triangle when the signed volumes of `p` and `q` over it differ in sign and the line passes on one side of all three edges
//! (Plücker sides; Möller, Trumbore 1997 in exact-sign form). Zero counts as crossed: a segment that is only touched is cut.
//! Everything is measured from the middle of the segment, which keeps f32 sharp. Hits are appended as `2·segment + half`, half 0 when the
//! crossing lies nearer to the first end; their order is not fixed, the host sorts them.
//! Units: m; v m/s.

use super::Source;
use crate::math::{Real, V3, V4};

/// The shader.
pub const SOURCE: Source = Source {
    name: "cut",
    wgsl: include_str!("cut.wgsl"),
    params: &["segment_count", "quad_count", "capacity", "step"],
};

/// Every segment against every quad; hits in segment order.
pub fn cut<R: Real>(
    step: R,
    ends: &[[u32; 2]], // [segment] point ids
    rest: &[V4<R>],    // [point] m
    point_u: &[V4<R>], // [point] displacement at the step's end, m
    point_v: &[V4<R>], // [point] m/s over the step
    quads: &[V4<R>],   // [quad × 4] a0 b0 b1 a1, m
) -> Vec<u32> {
    let mut hits = vec![];
    for (segment, [first, second]) in ends.iter().enumerate() {
        if first == second {
            continue; // an end of the grid: no link
        }
        let (first, second) = (*first as usize, *second as usize);
        let p = V3::from4(rest[first]) + V3::from4(point_u[first]);
        let q = V3::from4(rest[second]) + V3::from4(point_u[second]);
        let middle = (p + q) * R::of(0.5);
        let moved = (V3::from4(point_v[first]) + V3::from4(point_v[second])) * (R::of(0.5) * step);
        for quad in quads.chunks_exact(4) {
            let a0 = V3::from4(quad[0]) + moved - middle;
            let b0 = V3::from4(quad[1]) + moved - middle;
            let b1 = V3::from4(quad[2]) - middle;
            let a1 = V3::from4(quad[3]) - middle;
            let mut t = crossing(p - middle, q - middle, a0, b0, b1);
            if t < R::zero() {
                t = crossing(p - middle, q - middle, a0, b1, a1);
            }
            if t >= R::zero() {
                hits.push(2 * segment as u32 + u32::from(t > R::of(0.5)));
                break;
            }
        }
    }
    hits
}

/// Where (0 to 1) the segment `p q` crosses the triangle, or −1.
pub fn crossing<R: Real>(p: V3<R>, q: V3<R>, a: V3<R>, b: V3<R>, c: V3<R>) -> R {
    let miss = -R::one();
    let n = (b - a).cross(c - a);
    let (over, under) = (n.dot(p - a), n.dot(q - a));
    let zero = R::zero();
    let same_side = (over > zero && under > zero) || (over < zero && under < zero);
    if same_side || over == under {
        return miss;
    }
    let d = q - p;
    let side = |s: V3<R>, t: V3<R>| d.dot((s - p).cross(t - p));
    let (x, y, z) = (side(a, b), side(b, c), side(c, a));
    let one_side = (x >= zero && y >= zero && z >= zero) || (x <= zero && y <= zero && z <= zero);
    if one_side { over / (over - under) } else { miss }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_crossing_is_found_where_it_lies() {
        let v = V3::<f64>::new;
        let t = crossing(v(0.2, 0.2, -1.0), v(0.2, 0.2, 3.0), v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), v(0.0, 1.0, 0.0));
        assert!((t - 0.25).abs() < 1e-15);
        let outside =
            crossing(v(0.8, 0.8, -1.0), v(0.8, 0.8, 3.0), v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), v(0.0, 1.0, 0.0));
        assert_eq!(outside, -1.0);
        let short = crossing(v(0.2, 0.2, 1.0), v(0.2, 0.2, 3.0), v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), v(0.0, 1.0, 0.0));
        assert_eq!(short, -1.0);
    }

    #[test]
    fn skin_moving_onto_a_resting_blade_is_cut() {
        // the edge a–b rests on y = 0; the segment along x moved from y = −1 to y = 1 in the step
        let rest = [[-1.0, -1.0, 0.5, 0.0], [1.0, -1.0, 0.5, 0.0]];
        let (u, v) = ([[0.0, 2.0, 0.0, 0.0]; 2], [[0.0, 2.0, 0.0, 0.0]; 2]);
        let edge = [[0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 0.0]];
        assert_eq!(cut::<f64>(1.0, &[[0, 1]], &rest, &u, &v, &edge).len(), 1);
        let still = [[0.0; 4]; 2];
        assert!(cut::<f64>(1.0, &[[0, 1]], &rest, &u, &still, &edge).is_empty());
    }
}
