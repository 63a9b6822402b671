// Block LDLᵀ of each z-column, in place. Twin: factor.rs (formula there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> block: array<vec4<f32>>; // [node × 4] packed: D, U in; D'⁻¹, G out

@compute @workgroup_size(64)
fn factor(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let column = group_of(group, groups) * GROUP + lane;
    let columns = column_count(params);
    let nodes = column_nodes(params, column);
    if column >= columns { return; }
    var below = mat3x3<f32>(); // Uᵀ D'⁻¹ U of the node below
    for (var k = 0u; k < params.nodes_z; k += 1u) {
        let at = (nodes.x + k * nodes.y) * 4u;
        let own = unpack(block[at], block[at + 1u], block[at + 2u], block[at + 3u]);
        let d = inverse(own.d - below);
        let g = d * own.g;
        below = transpose(own.g) * g;
        let packed = pack(Block(d, g));
        for (var n = 0u; n < 4u; n += 1u) { block[at + n] = packed[n]; }
    }
}
