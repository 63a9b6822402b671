// Segments crossed by the swept edge. Twin: cut.rs (method and units there).
struct CutParams { segment_count: u32, quad_count: u32, capacity: u32, zero: u32 }
@group(0) @binding(0) var<uniform> params: CutParams;
@group(0) @binding(1) var<storage, read> ends: array<vec2<u32>>;         // [segment] point ids
@group(0) @binding(2) var<storage, read> rest: array<vec4<f32>>;         // [point] m
@group(0) @binding(3) var<storage, read> point_u: array<vec4<f32>>;      // [point] displacement at the step's end, m
@group(0) @binding(4) var<storage, read> point_before: array<vec4<f32>>; // [point] displacement at the step's start, m
@group(0) @binding(5) var<storage, read> quads: array<vec4<f32>>;        // [quad × 4] a0 b0 b1 a1, m
@group(0) @binding(6) var<storage, read_write> hits: array<vec2<u32>>;   // segment, bits of where
@group(0) @binding(7) var<storage, read_write> hit_count: atomic<u32>;   // also counts what found no room

const SLACK: f32 = 20.0;
const EPSILON: f32 = 1.1920929e-7;
const LEAST: f32 = 1e-6;
const FAR: f32 = 1152921504606846976.0;

// How a segment sees the world: two axes across it and its direction.
struct Frame { middle: vec3<f32>, x: vec3<f32>, y: vec3<f32>, z: vec3<f32>, scale: f32, offset: f32 }

// Rounded here, not fused with what comes next.
fn rounded(a: vec3<f32>) -> vec3<f32> {
    return hidden(vec4<f32>(a, 0.0), params.zero).xyz;
}

fn product(a: vec3<f32>, b: vec3<f32>) -> f32 {
    let m = rounded(a * b);
    return m.x + m.y + m.z;
}

fn largest(v: vec3<f32>) -> f32 {
    return max(max(abs(v.x), abs(v.y)), abs(v.z));
}

fn frame(p: vec3<f32>, q: vec3<f32>, scale: f32, own: vec3<f32>, e: vec3<f32>, f: vec3<f32>) -> Frame {
    let middle = (p + q) * 0.5;
    let d = rounded((q - p) * scale);
    let over = 1.0 / max(1.0 + product(d, own), LEAST);
    let half = d + own;
    let x = e - rounded(half * (product(d, e) * over));
    let y = f - rounded(half * (product(d, f) * over));
    return Frame(middle, x, y, d, scale, largest(middle) * scale);
}

fn place(frame: Frame, corner: vec4<f32>) -> vec3<f32> {
    let c = corner.xyz - frame.middle;
    return rounded(vec3<f32>(product(frame.x, c), product(frame.y, c), product(frame.z, c)) * frame.scale);
}

fn is_near(a: f32, b: f32, c: f32, reach: f32) -> bool {
    return min(min(a, b), c) <= reach && max(max(a, b), c) >= -reach;
}

// The part of an edge that passes the origin within the slack, along the segment.
fn beside(p: vec3<f32>, q: vec3<f32>, side: f32, slack: f32) -> vec2<f32> {
    let d = q - p;
    let near = min(p.x, q.x) <= slack && max(p.x, q.x) >= -slack && min(p.y, q.y) <= slack && max(p.y, q.y) >= -slack
        && abs(side) <= slack * (abs(d.x) + abs(d.y));
    if !near { return vec2<f32>(FAR, -FAR); }
    let nearest = -(p.x * d.x + p.y * d.y) / max(d.x * d.x + d.y * d.y, slack * slack);
    let around = 4.0 * slack / max(max(abs(d.x), abs(d.y)), slack);
    let z = p.z + d.z * clamp(vec2<f32>(nearest - around, nearest + around), vec2<f32>(0.0), vec2<f32>(1.0));
    return vec2<f32>(min(z.x, z.y) - slack, max(z.x, z.y) + slack);
}

// Where (0 to 1) the segment crosses a triangle of its frame, or −1.
fn crossing(a: vec3<f32>, b: vec3<f32>, c: vec3<f32>, slack: f32) -> f32 {
    if !(is_near(a.x, b.x, c.x, slack) && is_near(a.y, b.y, c.y, slack) && is_near(a.z, b.z, c.z, 0.5 + slack)) {
        return -1.0;
    }
    var corners = array<vec3<f32>, 3>(a, b, c);
    var reach = vec2<f32>(FAR, -FAR);
    var passes = array<vec2<f32>, 2>(); // x and z where edges pass y = 0
    var count = 0u;
    for (var k = 0u; k < 3u; k += 1u) {
        let p = corners[k];
        let q = corners[(k + 1u) % 3u];
        let both = rounded(vec3<f32>(p.x * q.y, p.y * q.x, 0.0));
        let side = both.x - both.y;
        if (p.y > 0.0) != (q.y > 0.0) {
            passes[min(count, 1u)] = vec2<f32>(side / (q.y - p.y), p.z + (q.z - p.z) * (p.y / (p.y - q.y)));
            count += 1u;
        }
        let part = beside(p, q, side, slack);
        reach = vec2<f32>(min(reach.x, part.x), max(reach.y, part.y));
    }
    let n = cross(b - a, c - a);
    let size = max(max(abs(b.x - a.x), abs(b.y - a.y)), max(abs(c.x - a.x), abs(c.y - a.y)));
    if (passes[0].x > 0.0) != (passes[1].x > 0.0) && abs(n.z) > slack * size {
        let inside = passes[0].y + (passes[1].y - passes[0].y) * (passes[0].x / (passes[0].x - passes[1].x));
        let spread = slack * (1.0 + (abs(n.x) + abs(n.y)) / abs(n.z));
        reach = vec2<f32>(min(reach.x, inside - spread), max(reach.y, inside + spread));
    }
    let hit = reach.x <= 0.5 && reach.y >= -0.5;
    return select(-1.0, 0.5 + 0.5 * (max(reach.x, -0.5) + min(reach.y, 0.5)), hit);
}

@compute @workgroup_size(64)
fn cut(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let segment = group_of(group, groups) * GROUP + lane;
    if segment >= params.segment_count { return; }
    let first = ends[segment].x;
    let second = ends[segment].y;
    if first == second || all(rest[first].xyz == rest[second].xyz) { return; }
    let p0 = rest[first].xyz + point_before[first].xyz;
    let q0 = rest[second].xyz + point_before[second].xyz;
    let p1 = rest[first].xyz + point_u[first].xyz;
    let q1 = rest[second].xyz + point_u[second].xyz;
    let at_rest = rest[second].xyz - rest[first].xyz;
    let squared = vec3<f32>(product(at_rest, at_rest), product(q0 - p0, q0 - p0), product(q1 - p1, q1 - p1));
    if !all(squared > vec3<f32>(0.0)) { return; }
    let scales = 1.0 / sqrt(squared);
    var own = rounded(at_rest * scales.x);
    // two axes across
    let sign = select(-1.0, 1.0, own.z >= 0.0);
    let a = -1.0 / (sign + own.z);
    let b = own.x * own.y * a;
    let e = vec3<f32>(1.0 + sign * (own.x * own.x * a), sign * b, -sign * own.x);
    let f = vec3<f32>(b, sign + own.y * own.y * a, -own.y);
    if product(rounded((q0 - p0) * scales.y), own) < 0.0 { own = -own; }
    let start = frame(p0, q0, scales.y, own, e, f);
    let end = frame(p1, q1, scales.z, own, e, f);
    for (var k = 0u; k < params.quad_count; k += 1u) {
        let a0 = place(start, quads[k * 4u]);
        let b0 = place(start, quads[k * 4u + 1u]);
        let b1 = place(end, quads[k * 4u + 2u]);
        let a1 = place(end, quads[k * 4u + 3u]);
        let r = max(max(largest(a0), largest(b0)), max(largest(b1), largest(a1)));
        let slack = SLACK * EPSILON * (1.0 + max(start.offset, end.offset) + r) * (1.0 + r);
        var at = crossing(a0, b0, b1, slack);
        if at < 0.0 { at = crossing(a0, b1, a1, slack); }
        if at >= 0.0 {
            let slot = atomicAdd(&hit_count, 1u);
            if slot < params.capacity { hits[slot] = vec2<u32>(segment, bitcast<u32>(at)); }
            break;
        }
    }
}
