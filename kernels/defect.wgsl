// Defect of a step's linearisation. Twin: defect.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> w: array<vec4<f32>>;          // [node] product A Δx, N
@group(0) @binding(2) var<storage, read> x: array<vec4<f32>>;          // [rhs][node] m
@group(0) @binding(3) var<storage, read> dofs: array<vec4<f32>>;       // [node] DOF mask and mass as in A, kg
@group(0) @binding(4) var<storage, read> f: array<vec4<f32>>;          // [node] elastic forces at the start, N
@group(0) @binding(5) var<storage, read> f_end: array<vec4<f32>>;      // [node] those at the increment, N
@group(0) @binding(6) var<storage, read_write> b: array<vec4<f32>>;    // [rhs][node] N

@compute @workgroup_size(64)
fn defect(thread: Thread) {
    let i = number_of(thread);
    if i >= params.node_count { return; }
    let inertia = x[i].xyz * (params.inertia * dofs[i].w);
    let linear = (w[i].xyz - inertia) * (1.0 / params.stiffness_factor);
    let change = f_end[i].xyz - f[i].xyz;
    b[i] = vec4<f32>(b[i].xyz + (linear - change) * dofs[i].xyz, 0.0);
}
