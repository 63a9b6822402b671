// Ends a step. Twin: integrate.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> x: array<vec4<f32>>;    // [rhs][node] m
@group(0) @binding(2) var<storage, read_write> u: array<vec4<f32>>;    // [node] m
@group(0) @binding(3) var<storage, read_write> v: array<vec4<f32>>;    // [node] m/s

@compute @workgroup_size(64)
fn integrate(thread: Thread) {
    let i = number_of(thread);
    if i >= params.node_count { return; }
    var dx = x[i].xyz;
    if params.rhs_count > 1u {
        dx += x[params.node_count + i].xyz;
        x[i] = vec4<f32>(dx, 0.0);
    }
    u[i] = vec4<f32>(u[i].xyz + dx, 0.0);
    let kept = v[i].xyz * (params.velocity_factor - 1.0);
    v[i] = vec4<f32>(dx * (params.velocity_factor / params.step) - kept, 0.0);
}
