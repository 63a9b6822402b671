// Rest-shape springs in the right-hand side. Twin: rest_springs.rs (formula and units there).
struct RestSpringParams { count: u32, pad_0: u32, pad_1: u32, pad_2: u32 }
@group(0) @binding(0) var<uniform> params: RestSpringParams;
@group(0) @binding(1) var<storage, read> ids: array<u32>;              // [spring] node, each once
@group(0) @binding(2) var<storage, read> spring_stiffness: array<f32>; // [spring] N/m
@group(0) @binding(3) var<storage, read> dofs: array<vec4<f32>>;       // [node] 1 free, 0 fixed, per axis; mass kg
@group(0) @binding(4) var<storage, read> u: array<vec4<f32>>;          // [node] m
@group(0) @binding(5) var<storage, read_write> b: array<vec4<f32>>;    // [rhs][node] N

@compute @workgroup_size(64)
fn rest_springs(thread: Thread) {
    let k = number_of(thread);
    if k >= params.count { return; }
    let i = ids[k];
    b[i] = vec4<f32>(b[i].xyz - u[i].xyz * spring_stiffness[k] * dofs[i].xyz, 0.0);
}
