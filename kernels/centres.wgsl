// Displacements of the cell centres. Twin: centres.rs (units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> u: array<vec4<f32>>;                // [node] m
@group(0) @binding(2) var<storage, read_write> point_u: array<vec4<f32>>;    // [cell] m
@group(0) @binding(3) var<storage, read> split: array<u32>;                  // see split.rs

@compute @workgroup_size(64)
fn centres(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let cell = group_of(group, groups) * GROUP + lane;
    if cell >= params.cell_count { return; }
    let at = cell_at(params, cell);
    var sum = vec3<f32>(0.0);
    for (var k = 0u; k < 8u; k += 1u) {
        sum += u[corner_node(params, at, k)].xyz;
    }
    point_u[cell] = vec4<f32>(sum * 0.125, 0.0);
}
