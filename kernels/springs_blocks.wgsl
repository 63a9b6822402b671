// Node blocks of A of the spring body. Twin: springs_blocks.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> first: array<u32>;               // [node + 1] into half
@group(0) @binding(2) var<storage, read> half: array<vec2<u32>>;          // other node, spring
@group(0) @binding(3) var<storage, read> tangent: array<vec4<f32>>;       // [half × 2] symmetric T, N/m
@group(0) @binding(4) var<storage, read> dofs: array<vec4<f32>>;          // [node] 1 free, 0 fixed, per axis; mass kg
@group(0) @binding(5) var<storage, read_write> block: array<vec4<f32>>;   // [node × 4] packed

@compute @workgroup_size(64)
fn springs_blocks(thread: Thread) {
    let i = number_of(thread);
    if i >= params.node_count { return; }
    let above = i + params.nodes_x * params.nodes_y;
    var d = mat3x3<f32>();
    var g = mat3x3<f32>();
    for (var n = first[i]; n < first[i + 1u]; n += 1u) {
        let t = symmetric(tangent[n * 2u], tangent[n * 2u + 1u]);
        d += t;
        if half[n].x == above { g -= t; }
    }
    var axes_above = vec3<f32>(0.0);
    if above < params.node_count { axes_above = dofs[above].xyz; }
    let packed = finish(d, g, dofs[i], axes_above, 1.0, params.inertia, params.preconditioner); // tangents hold the step's stiffness factor already
    for (var k = 0u; k < 4u; k += 1u) { block[i * 4u + k] = packed[k]; }
}
