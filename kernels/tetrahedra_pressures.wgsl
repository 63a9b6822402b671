// Pressure at each node of smoothed tetrahedra, one right-hand side per dispatch row. Twin: tetrahedra_pressures.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> corners: array<vec4<u32>>;      // [tetrahedron] nodes
@group(0) @binding(2) var<storage, read> gradients: array<vec4<f32>>;    // [tetrahedron × 3] see tetrahedra.rs
@group(0) @binding(3) var<storage, read> first_of_node: array<u32>;      // [node + 1] into of_node
@group(0) @binding(4) var<storage, read> of_node: array<u32>;            // 4 × tetrahedron + corner
@group(0) @binding(5) var<storage, read> per_volume: array<f32>;         // [node] 1 / sum of the volumes, 1/m³
@group(0) @binding(6) var<storage, read> nodal_strain: array<f32>;       // [rhs][node] volume strain
@group(0) @binding(7) var<storage, read_write> pressure: array<f32>;     // [rhs][node] Pa
@group(0) @binding(8) var<storage, read> scalars: array<vec4<f32>>;      // [rhs × 2] alpha beta gamma done; target² rr iterations state

@compute @workgroup_size(64)
fn tetrahedra_pressures(thread: Thread) {
    let i = number_of(thread);
    let rhs = params.first_rhs + thread.group.y;
    if i >= params.node_count || scalars[rhs * 2u].w != 0.0 { return; }
    let offset = rhs * params.node_count;
    var sum = 0.0;
    for (var n = first_of_node[i]; n < first_of_node[i + 1u]; n += 1u) {
        let e = of_node[n] / 4u;
        let c = corners[e] + offset;
        let mean = (nodal_strain[c.x] + nodal_strain[c.y] + nodal_strain[c.z] + nodal_strain[c.w]) * 0.25;
        sum += gradients[3u * e].w * gradients[3u * e + 1u].w * mean;
    }
    pressure[offset + i] = sum * per_volume[i];
}
