// Internal forces of tetrahedra at the nodes. Twin: tetrahedra_forces.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> first_of_node: array<u32>;            // [node + 1] into of_node
@group(0) @binding(2) var<storage, read> of_node: array<u32>;                  // 4 × tetrahedron + corner
@group(0) @binding(3) var<storage, read> tetrahedron_force: array<vec4<f32>>;  // [tetrahedron × 3] at corners 1 to 3, N
@group(0) @binding(4) var<storage, read_write> f: array<vec4<f32>>;            // [node] N

@compute @workgroup_size(64)
fn tetrahedra_forces(thread: Thread) {
    let i = number_of(thread);
    if i >= params.node_count { return; }
    f[i] = vec4<f32>(gathered(i, 0u), 0.0);
}
