// Segments crossed by the swept edge. Twin: cut.rs (method and units there).
struct CutParams { segment_count: u32, quad_count: u32, capacity: u32, step: f32 }
@group(0) @binding(0) var<uniform> params: CutParams;
@group(0) @binding(1) var<storage, read> ends: array<vec2<u32>>;         // [segment] point ids
@group(0) @binding(2) var<storage, read> rest: array<vec4<f32>>;         // [point] m
@group(0) @binding(3) var<storage, read> point_u: array<vec4<f32>>;      // [point] displacement at the step's end, m
@group(0) @binding(4) var<storage, read> point_v: array<vec4<f32>>;      // [point] m/s over the step
@group(0) @binding(5) var<storage, read> quads: array<vec4<f32>>;        // [quad × 4] a0 b0 b1 a1, m
@group(0) @binding(6) var<storage, read_write> hits: array<u32>;         // 2·segment + half
@group(0) @binding(7) var<storage, read_write> hit_count: atomic<u32>;   // also counts what found no room

fn crossing(p: vec3<f32>, q: vec3<f32>, a: vec3<f32>, b: vec3<f32>, c: vec3<f32>) -> f32 {
    let n = cross(b - a, c - a);
    let over = dot(n, p - a);
    let under = dot(n, q - a);
    let same_side = (over > 0.0 && under > 0.0) || (over < 0.0 && under < 0.0);
    if same_side || over == under { return -1.0; }
    let d = q - p;
    let x = dot(d, cross(a - p, b - p));
    let y = dot(d, cross(b - p, c - p));
    let z = dot(d, cross(c - p, a - p));
    let one_side = (x >= 0.0 && y >= 0.0 && z >= 0.0) || (x <= 0.0 && y <= 0.0 && z <= 0.0);
    return select(-1.0, over / (over - under), one_side);
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
    if first == second { return; }
    let p = rest[first].xyz + point_u[first].xyz;
    let q = rest[second].xyz + point_u[second].xyz;
    let middle = (p + q) * 0.5;
    let moved = (point_v[first].xyz + point_v[second].xyz) * (0.5 * params.step);
    for (var k = 0u; k < params.quad_count; k += 1u) {
        let a0 = quads[k * 4u].xyz + moved - middle;
        let b0 = quads[k * 4u + 1u].xyz + moved - middle;
        let b1 = quads[k * 4u + 2u].xyz - middle;
        let a1 = quads[k * 4u + 3u].xyz - middle;
        var t = crossing(p - middle, q - middle, a0, b0, b1);
        if t < 0.0 { t = crossing(p - middle, q - middle, a0, b1, a1); }
        if t >= 0.0 {
            let at = atomicAdd(&hit_count, 1u);
            if at < params.capacity { hits[at] = 2u * segment + select(0u, 1u, t > 0.5); }
            break;
        }
    }
}
