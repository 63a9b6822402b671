// Displacement gradient and volume strain of each tetrahedron, one right-hand side per dispatch row. Twin: tetrahedra_strains.rs (formula and units
// there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> corners: array<vec4<u32>>;           // [tetrahedron] nodes
@group(0) @binding(2) var<storage, read> gradients: array<vec4<f32>>;         // [tetrahedron × 3] see tetrahedra.rs
@group(0) @binding(3) var<storage, read> element_rotation: array<vec4<f32>>;  // [tetrahedron] quaternion
@group(0) @binding(4) var<storage, read> z: array<vec4<f32>>;                 // [rhs][node] m
@group(0) @binding(5) var<storage, read_write> strain: array<vec4<f32>>;      // [rhs][tetrahedron × 3] displacement gradient, volume strain
@group(0) @binding(6) var<storage, read> scalars: array<vec4<f32>>;           // [rhs × 2] alpha beta gamma done; target² rr iterations state

@compute @workgroup_size(64)
fn tetrahedra_strains(thread: Thread) {
    let e = number_of(thread);
    let rhs = params.first_rhs + thread.group.y;
    if e >= params.tetrahedron_count || scalars[rhs * 2u].w != 0.0 { return; }
    let c = corners[e] + rhs * params.node_count;
    let gradient = displacement_gradient(z[c.x].xyz, z[c.y].xyz, z[c.z].xyz, z[c.w].xyz, shape_gradients(e));
    let theta = volume_strain(gradient, element_rotation[e], params.total);
    let at = 3u * (rhs * params.tetrahedron_count + e);
    strain[at] = vec4<f32>(gradient[0], theta);
    strain[at + 1u] = vec4<f32>(gradient[1], 0.0);
    strain[at + 2u] = vec4<f32>(gradient[2], 0.0);
}
