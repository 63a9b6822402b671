// Spring forces and tangents, gathered per node. Twin: springs.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> rest: array<vec4<f32>>;            // [node] m
@group(0) @binding(2) var<storage, read> u: array<vec4<f32>>;               // [node] m
@group(0) @binding(3) var<storage, read> first: array<u32>;                 // [node + 1] into half
@group(0) @binding(4) var<storage, read> half: array<vec2<u32>>;            // other node, spring
@group(0) @binding(5) var<storage, read> law: array<vec4<f32>>;             // [spring] e, k, c, 0
@group(0) @binding(6) var<storage, read_write> f: array<vec4<f32>>;         // [node] N
@group(0) @binding(7) var<storage, read_write> tangent: array<vec4<f32>>;   // [half × 2] xx xy xz yy; yz zz 0 0

fn elongation(span: vec3<f32>, shift: vec3<f32>, length: f32) -> f32 {
    return dot(span + span + shift, shift) / (length + sqrt(dot(span, span)));
}

@compute @workgroup_size(64)
fn springs(thread: Thread) {
    let i = number_of(thread);
    if i >= params.node_count { return; }
    var sum = vec3<f32>(0.0);
    for (var n = first[i]; n < first[i + 1u]; n += 1u) {
        let j = half[n].x;
        let own = law[half[n].y]; // e, k, c
        let span = rest[j].xyz - rest[i].xyz;
        let shift = u[j].xyz - u[i].xyz;
        let d = span + shift;
        let length = sqrt(dot(d, d));
        var t0 = vec4<f32>(0.0);
        var t1 = vec4<f32>(0.0);
        if length > 0.0 {
            let stretch = (own.x + elongation(span, shift, length)) / length;
            sum -= d * (own.y * stretch);
            let axis = d * (1.0 / length);
            let stiff = own.y * params.stiffness_factor;
            let across = stiff * max(stretch, 0.0);
            let along = stiff + own.z / params.step - across;
            let a = axis * along;
            t0 = vec4<f32>(a.x * axis.x + across, a.x * axis.y, a.x * axis.z, a.y * axis.y + across);
            t1 = vec4<f32>(a.y * axis.z, a.z * axis.z + across, 0.0, 0.0);
        }
        tangent[n * 2u] = t0;
        tangent[n * 2u + 1u] = t1;
    }
    f[i] = vec4<f32>(sum, 0.0);
}
