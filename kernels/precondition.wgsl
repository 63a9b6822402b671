// z = M⁻¹ r by columns, with r·z. Twin: precondition.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> block: array<vec4<f32>>;                // [node × 4] packed D'⁻¹, G
@group(0) @binding(2) var<storage, read> r: array<vec4<f32>>;                    // [slot][node] N
@group(0) @binding(3) var<storage, read_write> z: array<vec4<f32>>;              // [slot][node] m
@group(0) @binding(4) var<storage, read_write> partial_gamma: array<f32>;   // [slot][group] r·z
@group(0) @binding(5) var<storage, read> scalars: array<vec4<f32>>;              // [slot × 2]

@compute @workgroup_size(64)
fn precondition(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let group_index = group_of(group, groups);
    let column = group_index * GROUP + lane;
    let columns = column_count(params);
    let nodes = column_nodes(params, column);
    let slot = params.first_slot + group.y;
    let offset = slot * params.node_count;
    let running = scalars[slot * 2u].w == 0.0;
    var gamma = 0.0;
    if running && column < columns {
        var y = vec3<f32>(0.0); // G_{k−1}ᵀ y_{k−1}
        for (var k = 0u; k < params.nodes_z; k += 1u) {
            let i = nodes.x + k * nodes.y;
            let own = r[offset + i].xyz - y;
            z[offset + i] = vec4<f32>(own, 0.0);
            let at = i * 4u;
            y = own * unpack(block[at], block[at + 1u], block[at + 2u], block[at + 3u]).g;
        }
        var above = vec3<f32>(0.0);
        for (var n = 0u; n < params.nodes_z; n += 1u) {
            let i = nodes.x + (params.nodes_z - 1u - n) * nodes.y;
            let at = i * 4u;
            let own = unpack(block[at], block[at + 1u], block[at + 2u], block[at + 3u]);
            above = own.d * z[offset + i].xyz - own.g * above;
            z[offset + i] = vec4<f32>(above, 0.0);
            gamma += dot(r[offset + i].xyz, above);
        }
    }
    let sum_of_group = group_sum(gamma, lane);
    if lane == 0u && column < columns {
        partial_gamma[slot * ((columns + GROUP - 1u) / GROUP) + group_index] = sum_of_group;
    }
}
