// Correction by an auxiliary grid. Twin: auxiliary_correction.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params; // of the body
@group(0) @binding(1) var<storage, read> first_weight: array<u32>;         // [node + 1] into weighted
@group(0) @binding(2) var<storage, read> weighted: array<u32>;             // nodes of the grid
@group(0) @binding(3) var<storage, read> weight: array<f32>;               // [weighted] weights
@group(0) @binding(4) var<storage, read> dofs: array<vec4<f32>>;           // [node] 1 free, 0 fixed, per axis; mass kg
@group(0) @binding(5) var<storage, read> auxiliary_z: array<vec4<f32>>;    // [rhs][node of the grid] m
@group(0) @binding(6) var<storage, read_write> z: array<vec4<f32>>;        // [rhs][node] m
@group(0) @binding(7) var<storage, read_write> w: array<vec4<f32>>;        // [rhs][node] N
@group(0) @binding(8) var<storage, read> scalars: array<vec4<f32>>;        // [rhs × 2]

@compute @workgroup_size(64)
fn auxiliary_correction(thread: Thread) {
    let i = number_of(thread);
    let rhs = params.first_rhs + thread.group.y;
    if i >= params.node_count || scalars[rhs * 2u].w != 0.0 { return; }
    let offset = rhs * (arrayLength(&auxiliary_z) / params.rhs_count);
    var sum = vec3<f32>(0.0);
    for (var n = first_weight[i]; n < first_weight[i + 1u]; n += 1u) {
        sum += auxiliary_z[offset + weighted[n]].xyz * weight[n];
    }
    let at = rhs * params.node_count + i;
    z[at] = vec4<f32>(sum * dofs[i].xyz, 0.0);
    w[at] = vec4<f32>(0.0);
}
