// Node blocks of A of tetrahedra. Twin: tetrahedra_blocks.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> rest_block: array<vec4<f32>>;     // [node × 2] symmetric B, N/m
@group(0) @binding(2) var<storage, read> node_rotation: array<vec4<f32>>;  // [node] quaternion
@group(0) @binding(3) var<storage, read> dofs: array<vec4<f32>>;           // [node] 1 free, 0 fixed, per axis; mass kg
@group(0) @binding(4) var<storage, read_write> block: array<vec4<f32>>;    // [node × 4] packed

@compute @workgroup_size(64)
fn tetrahedra_blocks(thread: Thread) {
    let i = number_of(thread);
    if i >= params.node_count { return; }
    let r = rotation_matrix(node_rotation[i]);
    let d = r * symmetric(rest_block[2u * i], rest_block[2u * i + 1u]) * transpose(r);
    let packed = finish(d, mat3x3<f32>(), dofs[i], vec3<f32>(0.0), params.stiffness_factor, params.inertia, params.preconditioner);
    for (var k = 0u; k < 4u; k += 1u) { block[i * 4u + k] = packed[k]; }
}
