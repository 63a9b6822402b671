//! Which segments (springs, or face links between cell centres) the blade's edge crossed in a step, and where.
//!
//! A piece of the edge sweeps `(a0, b0, b1, a1)`, its ends at the step's start and end, as the triangles `(a0, b0, b1)` and
//! `(a0, b1, a1)`. They are looked at from the segment, which moves, turns and stretches in the step: a point at the start is mapped by the
//! segment's frame at the start, one at the end by that at the end. The frame subtracts the segment's middle, turns its direction `d` into
//! that at rest `d₀` by the smallest rotation, and divides by its length. Across it lie `x` and `y`, the images of the axes `e ⟂ d₀`:
//!
//! `Rᵀe = e − (d·e)/(1 + d·d₀) (d + d₀)`,
//!
//! along it `z = d·(c − m)/|q − p|`. In the frame the segment rests: the origin of the plane, `z` from −½ to ½. Where it has turned by more than
//! 90° at the step's start, `−d₀` stands for `d₀` at both ends of the step: the formula stays far from its pole.
//!
//! # No gap
//! The end edge of one step's sweep and the start edge of the next come from the same numbers by the same operations, so they have the same
//! coordinates bit by bit (the shader hides its products from the compiler, which might fuse them in one place and not in the other). A
//! triangle holds the origin when one of its edges passes the line `y = 0` at `x > 0` and another at `x ≤ 0`; `x = (p × q)/(q_y − p_y)` is the
//! same number for `(p, q)` and `(q, p)`. So each edge is counted alike by the two triangles that share it, whatever rounding does to
//! it, and the numbers of turns of the triangles about the origin add up to that of the whole sweep's outline: a segment that a path
//! of any number of steps winds around is in one of its triangles. Source: Sunday 2001, "Inclusion of a point in a polygon" (crossings).
//!
//! # Rounding
//! With `u` half an ulp of 1, `X` the largest coordinate, `L` the length, `κ = X/L`, `r = |c − m|/L`: the ends carry `u X`, their middle
//! `2 u X`, `c − m` in all `3.5 u X`, so `d` is off by `2.8 u κ + u`, the axes by up to twice that (smallest rotations up to 90° spin by
//! `tan(θ/2) ≤ 1` of what `d` moves) and `6 u` of their own; `1/L` by `3.5 u κ + 3 u`. Together `u (3.5 κ + r (9.2 κ + 16))` of a length; with
//! the largest components instead of norms, `X ≤ |m| + (r + ½) L`, and `ε = 2 u`, at most `10 ε (1 + |m|/L + r) (1 + r)`. `slack` is twice
//! that: two evaluations of one point lie no further apart. Random cases use a twentieth of the bound. `slack` decides
//! - touching: an edge that passes the origin within `slack` crosses, so that grazing, starting or ending on a segment cuts it;
//! - where: `z` is known to `slack (1 + |∂z/∂x| + |∂z/∂y|)`, and that range of it must meet `[−½, ½]`: links that
//!   meet in a cell's centre, and turn and stretch alike, leave no gap there;
//! - slivers: a triangle thinner than `slack` has no inside, only edges: a blade at rest on a segment's line cuts it only where it lies.
//!
//! Links that meet but turn differently see their sweeps alike at each end of a step and apart by a second order of the turn between them.
//! A segment without length, at rest or now, is not cut. Of several quads that cross a segment the first counts.
//! Units: m; coordinates in a frame are lengths of the segment.

use super::Source;
use crate::math::{Real, V3, V4};

/// The shader.
pub const SOURCE: Source = Source {
    name: "cut",
    wgsl: include_str!("cut.wgsl"),
    params: &["segment_count", "quad_count", "capacity", "zero"],
};

/// `slack` in units of `ε (1 + |m|/L + r) (1 + r)`; a smaller one than twice 10 may leave gaps where a segment passes 90°.
const SLACK: f64 = 20.0;
/// Keeps the rotation finite when a segment turns upside down within one step.
const LEAST: f64 = 1e-6;
/// Beyond every coordinate; a power of two.
const FAR: f64 = (1u64 << 60) as f64;

/// A crossed segment.
#[derive(Clone, Copy, Debug, PartialEq)]
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
    let mut hits = vec![];
    for (segment, [first, second]) in ends.iter().enumerate() {
        if first == second {
            continue; // an end of the grid: no link
        }
        let ends = |u: &[V4<R>]| [*first as usize, *second as usize].map(|n| V3::from4(rest[n]) + V3::from4(u[n]));
        let [p, q] = [*first as usize, *second as usize].map(|n| V3::from4(rest[n]));
        let Some([start, end]) = frames([p, q], ends(point_before), ends(point_u)) else {
            continue;
        };
        let crossed = |quad: &[V4<R>]| {
            let (a0, b0) = (start.place(quad[0]), start.place(quad[1]));
            let (b1, a1) = (end.place(quad[2]), end.place(quad[3]));
            let r = largest(a0).max(largest(b0)).max(largest(b1)).max(largest(a1));
            let offset = start.offset.max(end.offset);
            let slack = R::of(SLACK) * R::EPSILON * (R::one() + offset + r) * (R::one() + r);
            let at = crossing([a0, b0, b1], slack);
            if at < R::zero() { crossing([a0, b1, a1], slack) } else { at }
        };
        let found = quads.chunks_exact(4).map(crossed).find(|at| *at >= R::zero());
        hits.extend(found.map(|at| Hit { segment: segment as u32, at }));
    }
    hits
}

/// How a segment sees the world.
struct Frame<R> {
    /// m
    middle: V3<R>,
    /// Two axes across the segment and its direction.
    axes: [V3<R>; 3],
    /// One over its length, 1/m.
    scale: R,
    /// Largest coordinate of the middle, in its lengths.
    offset: R,
}

/// Frames at the step's start and end; none without length.
fn frames<R: Real>(rest: [V3<R>; 2], before: [V3<R>; 2], now: [V3<R>; 2]) -> Option<[Frame<R>; 2]> {
    let squared = [rest, before, now].map(|[p, q]| (q - p).dot(q - p));
    if rest[0] == rest[1] || !squared.iter().all(|l| *l > R::zero()) {
        return None;
    }
    let scales = squared.map(|l| R::one() / l.sqrt());
    let own = (rest[1] - rest[0]) * scales[0];
    let across = across(own);
    let turned = ((before[1] - before[0]) * scales[1]).dot(own) < R::zero();
    let own = if turned { -own } else { own };
    Some([frame(before, scales[1], own, across), frame(now, scales[2], own, across)])
}

/// Two axes across a direction, all at right angles. Source: Duff et al. 2017, "Building an orthonormal basis, revisited", listing 3.
fn across<R: Real>(d: V3<R>) -> [V3<R>; 2] {
    let one = R::one();
    let sign = if d.z >= R::zero() { one } else { -one };
    let a = -one / (sign + d.z);
    let b = d.x * d.y * a;
    [V3::new(one + sign * (d.x * d.x * a), sign * b, -sign * d.x), V3::new(b, sign + d.y * d.y * a, -d.y)]
}

fn frame<R: Real>([p, q]: [V3<R>; 2], scale: R, own: V3<R>, across: [V3<R>; 2]) -> Frame<R> {
    let middle = (p + q) * R::of(0.5);
    let d = (q - p) * scale;
    let over = R::one() / (R::one() + d.dot(own)).max(R::of(LEAST));
    let turn = |e: V3<R>| e - (d + own) * (d.dot(e) * over);
    Frame { middle, axes: [turn(across[0]), turn(across[1]), d], scale, offset: largest(middle) * scale }
}

impl<R: Real> Frame<R> {
    fn place(&self, corner: V4<R>) -> V3<R> {
        let c = V3::from4(corner) - self.middle;
        V3::new(self.axes[0].dot(c), self.axes[1].dot(c), self.axes[2].dot(c)) * self.scale
    }
}

fn largest<R: Real>(v: V3<R>) -> R {
    v.x.abs().max(v.y.abs()).max(v.z.abs())
}

/// Where (0 to 1) the segment crosses a triangle of its frame, or −1.
pub fn crossing<R: Real>(corners: [V3<R>; 3], slack: R) -> R {
    let (zero, half, miss) = (R::zero(), R::of(0.5), -R::one());
    let [a, b, c] = corners;
    let near = |a: R, b: R, c: R, reach: R| a.min(b).min(c) <= reach && a.max(b).max(c) >= -reach;
    if !(near(a.x, b.x, c.x, slack) && near(a.y, b.y, c.y, slack) && near(a.z, b.z, c.z, half + slack)) {
        return miss;
    }
    let (mut low, mut high) = (R::of(FAR), -R::of(FAR));
    let mut passes = [[zero; 2]; 2]; // x and z where edges pass y = 0
    let mut count = 0;
    for k in 0..3 {
        let (p, q) = (corners[k], corners[(k + 1) % 3]);
        let side = p.x * q.y - p.y * q.x;
        if (p.y > zero) != (q.y > zero) {
            passes[count] = [side / (q.y - p.y), p.z + (q.z - p.z) * (p.y / (p.y - q.y))];
            count += 1;
        }
        let [from, to] = beside(p, q, side, slack);
        (low, high) = (low.min(from), high.max(to));
    }
    let [[x, z], [other_x, other_z]] = passes;
    let n = (b - a).cross(c - a);
    let size = (b.x - a.x).abs().max((b.y - a.y).abs()).max((c.x - a.x).abs()).max((c.y - a.y).abs());
    if (x > zero) != (other_x > zero) && n.z.abs() > slack * size {
        let inside = z + (other_z - z) * (x / (x - other_x));
        let spread = slack * (R::one() + (n.x.abs() + n.y.abs()) / n.z.abs());
        (low, high) = (low.min(inside - spread), high.max(inside + spread));
    }
    let hit = low <= half && high >= -half;
    if hit { half + half * (low.max(-half) + high.min(half)) } else { miss }
}

/// The part of an edge that passes the origin within `slack`, along the segment; `side` is `p × q`.
fn beside<R: Real>(p: V3<R>, q: V3<R>, side: R, slack: R) -> [R; 2] {
    let (zero, one) = (R::zero(), R::one());
    let d = q - p;
    let near = p.x.min(q.x) <= slack
        && p.x.max(q.x) >= -slack
        && p.y.min(q.y) <= slack
        && p.y.max(q.y) >= -slack
        && side.abs() <= slack * (d.x.abs() + d.y.abs());
    if !near {
        return [R::of(FAR), -R::of(FAR)];
    }
    let nearest = -(p.x * d.x + p.y * d.y) / (d.x * d.x + d.y * d.y).max(slack * slack);
    let around = R::of(4.0) * slack / d.x.abs().max(d.y.abs()).max(slack);
    let z = |t: R| p.z + d.z * t.max(zero).min(one);
    let (from, to) = (z(nearest - around), z(nearest + around));
    [from.min(to) - slack, from.max(to) + slack]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From −1 to 1.
    fn random(state: &mut u64) -> f64 {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    /// A segment at rest, before and now, up to 90° turned and then up to 20° more, and a corner: m.
    fn case(seed: &mut u64) -> ([[V3<f64>; 2]; 3], V4<f64>) {
        let mut vector = |size: f64| V3::new(random(seed), random(seed), random(seed)) * size;
        let rest = vector(0.03);
        let (own, other) = (vector(1e-3), vector(1e-3));
        let before = if own.dot(other) < 0.0 { -other } else { other };
        let now = before + vector(0.3 * before.length());
        let place = rest + vector(1e-3);
        let corner = (place + vector(5e-3)).pad(0.0);
        let round = |v: V3<f64>| V3::new(f64::from(v.x as f32), f64::from(v.y as f32), f64::from(v.z as f32));
        let segment = |p: V3<f64>, d: V3<f64>| [round(p), round(p + d)];
        let ends = [segment(rest, own), segment(place, before), segment(place, now)];
        (ends, corner.map(|c| f64::from(c as f32)))
    }

    #[test]
    fn rounding_in_a_frame_is_within_half_the_slack() {
        let single = |v: V3<f64>| V3::<f32>::of(v.f64());
        let mut seed = 1;
        let mut used: f64 = 0.0;
        for _ in 0..100_000 {
            let ([rest, before, now], corner) = case(&mut seed);
            let exact = frames(rest, before, now).expect("it has a length");
            let rounded = [rest, before, now].map(|ends| ends.map(single));
            let rounded = frames(rounded[0], rounded[1], rounded[2]).expect("it has a length");
            for (exact, rounded) in exact.iter().zip(&rounded) {
                let c = exact.place(corner);
                let off = largest(V3::of(rounded.place(corner.map(|c| c as f32)).f64()) - c);
                let r = largest(c);
                let bound = 0.5 * SLACK * f64::from(f32::EPSILON) * (1.0 + exact.offset + r) * (1.0 + r);
                used = used.max(off / bound);
            }
        }
        println!("at most {used:.3} of the bound");
        // roundings seldom all pull one way, and few segments lie at right angles to their rest
        assert!(used < 1.0 && used > 0.02, "{used} of the bound");
    }

    #[test]
    fn a_frame_turns_the_segment_into_its_direction_at_rest() {
        let mut seed = 2;
        for _ in 0..1000 {
            let ([rest, before, now], _) = case(&mut seed);
            let frames = frames(rest, before, now).expect("it has a length");
            for (frame, ends) in frames.iter().zip([before, now]) {
                for (end, z) in ends.iter().zip([-0.5, 0.5]) {
                    let off = frame.place(end.pad(0.0)) - V3::new(0.0, 0.0, z);
                    assert!(off.length() < 1e-11, "{off:?}");
                }
                let [x, y, z] = frame.axes;
                let off = V3::new(x.dot(y), y.dot(z), z.dot(x)).length() + (x.dot(x) + y.dot(y) + z.dot(z) - 3.0).abs();
                assert!(off < 1e-12, "{off:e}");
            }
        }
    }

    /// Edges from below the line `y = 0` to above it, all but the first and last of them through the origin but for rounding.
    fn strip(seed: &mut u64) -> Vec<[V3<f32>; 2]> {
        let mut edge = |shift: f64| {
            let (across, below, above) = (random(seed), 0.1 + random(seed).abs(), 0.1 + random(seed).abs());
            [below, -above].map(|y| V3::new((shift - across * y) as f32, -y as f32, 0.0))
        };
        [-0.5, 0.0, 0.0, 0.0, 0.5].map(&mut edge).to_vec()
    }

    #[test]
    fn without_slack_no_strip_around_the_origin_misses_it() {
        let strictly = |corners: [V3<f32>; 3]| {
            let sides = [0, 1, 2].map(|k| corners[k].cross(corners[(k + 1) % 3]).z);
            sides.iter().all(|s| *s > 0.0) || sides.iter().all(|s| *s < 0.0)
        };
        let mut seed = 3;
        let mut missed = [0; 2];
        for _ in 0..100_000 {
            let edges = strip(&mut seed);
            let triangles = edges.windows(2).flat_map(|pair| {
                let ([a0, b0], [a1, b1]) = (pair[0], pair[1]);
                [[a0, b0, b1], [a0, b1, a1]]
            });
            let triangles: Vec<_> = triangles.collect();
            missed[0] += u32::from(!triangles.iter().any(|t| crossing(*t, 0.0) >= 0.0));
            missed[1] += u32::from(!triangles.iter().any(|t| strictly(*t)));
        }
        println!("missed {} of 100000; {} if only what lies strictly inside counts", missed[0], missed[1]);
        assert!(missed[0] == 0 && missed[1] > 10, "{missed:?}");
    }
}
