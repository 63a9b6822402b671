// Sums of the corner forces at the nodes. Twin: collect.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> corner_force: array<f32>;      // [cell][corner][axis] N
@group(0) @binding(2) var<storage, read_write> f: array<vec4<f32>>;     // [node] N

@compute @workgroup_size(64)
fn collect(thread: Thread) {
    let i = number_of(thread);
    if i >= params.node_count { return; }
    f[i] = vec4<f32>(collected(i, 0u), 0.0);
}
