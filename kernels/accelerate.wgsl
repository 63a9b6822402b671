// Solve of an explicit step. Twin: accelerate.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> dofs: array<vec4<f32>>;       // [node] 1 free, 0 fixed, per axis; mass kg
@group(0) @binding(2) var<storage, read> b: array<vec4<f32>>;          // [rhs][node] N
@group(0) @binding(3) var<storage, read_write> x: array<vec4<f32>>;    // [rhs][node] m

@compute @workgroup_size(64)
fn accelerate(thread: Thread) {
    let i = number_of(thread);
    if i >= params.node_count { return; }
    let inertia = dofs[i].w * params.inertia;
    let inverse = select(0.0, 1.0 / inertia, inertia > 0.0);
    x[i] = vec4<f32>(b[i].xyz * inverse * dofs[i].xyz, 0.0);
}
