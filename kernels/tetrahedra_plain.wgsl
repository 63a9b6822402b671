// Forces of each plain tetrahedron at its corners, one right-hand side per dispatch row. Twin: tetrahedra_plain.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> corners: array<vec4<u32>>;                 // [tetrahedron] nodes
@group(0) @binding(2) var<storage, read> gradients: array<vec4<f32>>;               // [tetrahedron × 3] see tetrahedra.rs
@group(0) @binding(3) var<storage, read> element_rotation: array<vec4<f32>>;        // [tetrahedron] quaternion
@group(0) @binding(4) var<storage, read> z: array<vec4<f32>>;                       // [rhs][node] m
@group(0) @binding(5) var<storage, read_write> tetrahedron_force: array<vec4<f32>>; // [rhs][tetrahedron × 3] at corners 1 to 3, N
@group(0) @binding(6) var<storage, read> scalars: array<vec4<f32>>;                 // [rhs × 2] alpha beta gamma done; target² rr iterations state

@compute @workgroup_size(64)
fn tetrahedra_plain(thread: Thread) {
    let e = number_of(thread);
    let rhs = params.first_rhs + thread.group.y;
    if e >= params.tetrahedron_count || scalars[rhs * 2u].w != 0.0 { return; }
    let c = corners[e] + rhs * params.node_count;
    let q = element_rotation[e];
    let gradient = displacement_gradient(z[c.x].xyz, z[c.y].xyz, z[c.z].xyz, z[c.w].xyz, shape_gradients(e));
    let pressure = gradients[3u * e + 1u].w * volume_strain(gradient, q, params.total);
    let strain = deviator(gradient, q, params.total);
    let stress = rotation_matrix(q) * (diagonal(vec3<f32>(pressure)) + strain * (2.0 * gradients[3u * e + 2u].w));
    let forces = stress * shape_gradients(e) * gradients[3u * e].w;
    let to = 3u * (rhs * params.tetrahedron_count + e);
    for (var n = 0u; n < 3u; n += 1u) { tetrahedron_force[to + n] = vec4<f32>(forces[n], 0.0); }
}
