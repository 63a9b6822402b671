// Displacements at which an explicit step evaluates its elastic forces. Twin: ahead.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> u: array<vec4<f32>>;          // [node] m
@group(0) @binding(2) var<storage, read> v: array<vec4<f32>>;          // [node] m/s
@group(0) @binding(3) var<storage, read_write> y: array<vec4<f32>>;    // [node] m

@compute @workgroup_size(64)
fn ahead(thread: Thread) {
    let i = number_of(thread);
    if i >= params.node_count { return; }
    y[i] = vec4<f32>(u[i].xyz + v[i].xyz * params.lead_time, 0.0);
}
