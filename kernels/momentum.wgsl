// Nodal velocity of a consistent mass. Twin: momentum.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> shape: array<vec4<f32>, 21>;           // [layer] cell edges m, mass of one corner kg
@group(0) @binding(2) var<storage, read> layer_of: array<u32>;            // [cells_z] layer
@group(0) @binding(3) var<storage, read> rotation: array<vec4<f32>>;      // [cell] quaternion
@group(0) @binding(4) var<storage, read> dofs: array<vec4<f32>>;          // [node] 1 free, 0 fixed, per axis; mass kg
@group(0) @binding(5) var<storage, read> v: array<vec4<f32>>;             // [node] m/s
@group(0) @binding(6) var<storage, read_write> mean_v: array<vec4<f32>>;  // [node] m/s
@group(0) @binding(7) var<storage, read> split: array<u32>;               // see split.rs

@compute @workgroup_size(64)
fn momentum(thread: Thread) {
    let i = number_of(thread);
    if i >= params.node_count { return; }
    let c = grid_coordinates(params, i);
    let own = v[i].xyz;
    var sum = vec3<f32>(0.0);
    for (var a = 0u; a < 8u; a += 1u) {
        let o_a = corner(a);
        let at = c - o_a;
        if !has_cell(params, at) { continue; }
        if all(rotation[cell_id(params, at)] == vec4<f32>(0.0)) || corner_node(params, at, a) != i { continue; }
        var local = vec3<f32>(0.0);
        for (var b = 0u; b < 8u; b += 1u) {
            let o_b = corner(b);
            let near = select(vec3<f32>(1.0), vec3<f32>(2.0), o_a == o_b);
            local += (v[corner_node(params, at, b)].xyz - own) * (near.x * near.y * near.z / 27.0);
        }
        sum += local * shape[layer_of[at.z]].w;
    }
    // a node that has left the system has no mass and no cells
    let mass = dofs[i].w;
    let rate = select(0.0, 1.0 / mass, mass > 0.0);
    mean_v[i] = vec4<f32>(own + sum * rate, 0.0);
}
