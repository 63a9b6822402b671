// Residual of an auxiliary grid. Twin: auxiliary_restriction.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params; // of the grid
@group(0) @binding(1) var<storage, read> first_around: array<u32>;             // [node of the grid + 1] into around
@group(0) @binding(2) var<storage, read> around: array<u32>;                   // nodes of the body
@group(0) @binding(3) var<storage, read> weight_around: array<f32>;            // [around] weights
@group(0) @binding(4) var<storage, read> auxiliary_dofs: array<vec4<f32>>;     // [node of the grid] 1 free, 0 fixed, per axis
@group(0) @binding(5) var<storage, read> r: array<vec4<f32>>;                  // [rhs][node] N
@group(0) @binding(6) var<storage, read_write> auxiliary_r: array<vec4<f32>>;  // [rhs][node of the grid] N
@group(0) @binding(7) var<storage, read> scalars: array<vec4<f32>>;            // [rhs × 2]

@compute @workgroup_size(64)
fn auxiliary_restriction(thread: Thread) {
    let i = number_of(thread);
    let rhs = params.first_rhs + thread.group.y;
    if i >= params.node_count || scalars[rhs * 2u].w != 0.0 { return; }
    let offset = rhs * (arrayLength(&r) / params.rhs_count);
    var sum = vec3<f32>(0.0);
    for (var n = first_around[i]; n < first_around[i + 1u]; n += 1u) {
        sum += r[offset + around[n]].xyz * weight_around[n];
    }
    auxiliary_r[rhs * params.node_count + i] = vec4<f32>(sum * auxiliary_dofs[i].xyz, 0.0);
}
