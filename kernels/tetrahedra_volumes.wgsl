// Volume strain at each node of smoothed tetrahedra, one right-hand side per dispatch row. Twin: tetrahedra_volumes.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> gradients: array<vec4<f32>>;      // [tetrahedron × 3] see tetrahedra.rs
@group(0) @binding(2) var<storage, read> first_of_node: array<u32>;        // [node + 1] into of_node
@group(0) @binding(3) var<storage, read> of_node: array<u32>;              // 4 × tetrahedron + corner
@group(0) @binding(4) var<storage, read> per_volume: array<f32>;           // [node] 1 / sum of the volumes, 1/m³
@group(0) @binding(5) var<storage, read> strain: array<vec4<f32>>;         // [rhs][tetrahedron × 3] displacement gradient, volume strain
@group(0) @binding(6) var<storage, read_write> nodal_strain: array<f32>;   // [rhs][node] volume strain
@group(0) @binding(7) var<storage, read> scalars: array<vec4<f32>>;        // [rhs × 2] alpha beta gamma done; target² rr iterations state

@compute @workgroup_size(64)
fn tetrahedra_volumes(thread: Thread) {
    let i = number_of(thread);
    let rhs = params.first_rhs + thread.group.y;
    if i >= params.node_count || scalars[rhs * 2u].w != 0.0 { return; }
    let first = 3u * rhs * params.tetrahedron_count;
    var sum = 0.0;
    for (var n = first_of_node[i]; n < first_of_node[i + 1u]; n += 1u) {
        let at = 3u * (of_node[n] / 4u);
        sum += gradients[at].w * strain[first + at].w;
    }
    nodal_strain[rhs * params.node_count + i] = sum * per_volume[i];
}
