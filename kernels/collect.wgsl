// Sums of the corner forces at the nodes. Twin: collect.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> corner_force: array<f32>;      // [cell][corner][axis] N
@group(0) @binding(2) var<storage, read_write> f: array<vec4<f32>>;     // [node] N
@group(0) @binding(3) var<storage, read> split: array<u32>;             // see split.rs

@compute @workgroup_size(64)
fn collect(thread: Thread) {
    let i = number_of(thread);
    if i >= params.node_count { return; }
    let c = grid_coordinates(params, i);
    var sum = vec3<f32>(0.0);
    for (var a = 0u; a < 8u; a += 1u) {
        let at = c - corner(a);
        if !has_cell(params, at) || corner_node(params, at, a) != i { continue; }
        let k = cell_id(params, at) * 24u + a * 3u;
        sum += vec3<f32>(corner_force[k], corner_force[k + 1u], corner_force[k + 2u]);
    }
    f[i] = vec4<f32>(sum, 0.0);
}
