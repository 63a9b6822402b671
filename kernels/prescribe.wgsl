// Increments of nodes on prescribed paths. Twin: prescribe.rs (formula and units there).
struct PrescribeParams { count: u32, pad_0: u32, pad_1: u32, pad_2: u32 }
@group(0) @binding(0) var<uniform> params: PrescribeParams;
@group(0) @binding(1) var<storage, read> ids: array<u32>;              // [entry] node, each once
@group(0) @binding(2) var<storage, read> values: array<vec4<f32>>;     // [entry] prescribed displacement at the end of the step, m
@group(0) @binding(3) var<storage, read> dofs: array<vec4<f32>>;       // [node] 1 free, 0 fixed, per axis; mass kg
@group(0) @binding(4) var<storage, read> u: array<vec4<f32>>;          // [node] m
@group(0) @binding(5) var<storage, read_write> x: array<vec4<f32>>;    // [rhs][node] m

@compute @workgroup_size(64)
fn prescribe(thread: Thread) {
    let k = number_of(thread);
    if k >= params.count { return; }
    let i = ids[k];
    let fixed = dofs[i].xyz == vec3<f32>(0.0);
    x[i] = vec4<f32>(select(x[i].xyz, values[k].xyz - u[i].xyz, fixed), x[i].w);
}
