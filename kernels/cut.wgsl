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

const FAR: f32 = 1152921504606846976.0;
const NONE: vec3<f32> = vec3<f32>(0.0);

// Rounds here, so that it is not fused with the next operation.
fn rounded(a: vec3<f32>) -> vec3<f32> {
    return hidden(vec4<f32>(a, 0.0), params.zero).xyz;
}

// True if a ray from the origin along x passes through a triangle.
fn is_on_the_ray(a: vec3<f32>, b: vec3<f32>, c: vec3<f32>) -> bool {
    var corners = array<vec3<f32>, 3>(a, b, c);
    let least = min(a, min(b, c));
    let most = max(a, max(b, c));
    if least.y > 0.0 || !(most.y > 0.0) || least.z > 0.0 || !(most.z > 0.0) || !(most.x > 0.0) { return false; }
    // the two points where the outline passes z = 0: y and x
    var passes = array<vec2<f32>, 2>();
    var found = 0u;
    for (var k = 0u; k < 3u; k += 1u) {
        let p = corners[k];
        let q = corners[(k + 1u) % 3u];
        if (p.z > 0.0) != (q.z > 0.0) {
            let both = rounded(vec3<f32>(p.y * q.z, p.z * q.y, (q.x - p.x) * (p.z / (p.z - q.z))));
            passes[min(found, 1u)] = vec2<f32>((both.x - both.y) / (q.z - p.z), p.x + both.z);
            found += 1u;
        }
    }
    let y = passes[0].x;
    let other = passes[1];
    if (y > 0.0) == (other.x > 0.0) { return false; }
    let more = rounded(vec3<f32>((other.y - passes[0].y) * (y / (y - other.x)), 0.0, 0.0));
    return least.x > 0.0 || passes[0].y + more.x > 0.0;
}

// Position of the crossing along the segment.
fn where_crossed(c: array<vec3<f32>, 8>) -> f32 {
    // four times the slopes and eight times F at the cube's centre
    let along_s = (c[1] - c[0]) + (c[3] - c[2]) + (c[5] - c[4]) + (c[7] - c[6]);
    let along_u = (c[2] - c[0]) + (c[3] - c[1]) + (c[6] - c[4]) + (c[7] - c[5]);
    let along_t = (c[4] - c[0]) + (c[5] - c[1]) + (c[6] - c[2]) + (c[7] - c[3]);
    let f = (c[0] + c[1]) + (c[2] + c[3]) + (c[4] + c[5]) + (c[6] + c[7]);
    let across = cross(along_t, along_s);
    let volume = dot(along_u, across);
    if volume == 0.0 { return 0.5; }
    return clamp(0.5 - 0.5 * (dot(f, across) / volume), 0.0, 1.0);
}

@compute @workgroup_size(64)
fn cut(thread: Thread) {
    let segment = number_of(thread);
    if segment >= params.segment_count { return; }
    let first = ends[segment].x;
    let second = ends[segment].y;
    if first == second { return; }
    let p0 = rest[first].xyz + point_before[first].xyz;
    let q0 = rest[second].xyz + point_before[second].xyz;
    let p1 = rest[first].xyz + point_u[first].xyz;
    let q1 = rest[second].xyz + point_u[second].xyz;
    let low = min(min(p0, q0), min(p1, q1));
    let high = max(max(p0, q0), max(p1, q1));
    if !all(high < vec3<f32>(FAR)) || !all(low > vec3<f32>(-FAR)) { return; }
    // faces of the cube of differences: first corner and the bits along the two sides
    var faces = array<vec3<u32>, 6>(
        vec3<u32>(0u, 1u, 2u), vec3<u32>(4u, 1u, 2u), vec3<u32>(0u, 2u, 4u),
        vec3<u32>(1u, 2u, 4u), vec3<u32>(0u, 1u, 4u), vec3<u32>(2u, 1u, 4u),
    );
    for (var k = 0u; k < params.quad_count; k += 1u) {
        let a0 = quads[k * 4u].xyz;
        let b0 = quads[k * 4u + 1u].xyz;
        let b1 = quads[k * 4u + 2u].xyz;
        let a1 = quads[k * 4u + 3u].xyz;
        let most = max(max(a0, b0), max(a1, b1)) - low;
        let least = min(min(a0, b0), min(a1, b1)) - high;
        if !all(most > NONE) || !all(least <= NONE) { continue; }
        // a or b, p or q, start or end: one bit each
        var apart = array<vec3<f32>, 8>(a0 - p0, b0 - p0, a0 - q0, b0 - q0, a1 - p1, b1 - p1, a1 - q1, b1 - q1);
        var odd = false;
        for (var n = 0u; n < 12u; n += 1u) {
            let face = faces[n / 2u];
            let across = apart[face.x + face.y + face.z];
            // second triangle: a, c, d
            let one = select(apart[face.x + face.y], across, n % 2u == 1u);
            let other = select(across, apart[face.x + face.z], n % 2u == 1u);
            odd = odd != is_on_the_ray(apart[face.x], one, other);
        }
        if odd {
            let at = where_crossed(apart);
            let slot = atomicAdd(&hit_count, 1u);
            if slot < params.capacity { hits[slot] = vec2<u32>(segment, bitcast<u32>(at)); }
            break;
        }
    }
}
