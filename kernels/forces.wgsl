// Elastic forces of the hexahedra, gathered per node. Twin: forces.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> shape: array<vec4<f32>, 21>;            // [layer] cell edges m, mass of one corner kg
@group(0) @binding(2) var<uniform> pre_strain: array<vec4<f32>, 21>;       // [layer] elastic strain at rest along x, y, z
@group(0) @binding(3) var<uniform> stiffness: array<mat3x3<f32>, 1344>;    // [layer × 64] blocks a×8+b, N/m
@group(0) @binding(4) var<storage, read> layer_of: array<u32>;             // [cells_z] layer
@group(0) @binding(5) var<storage, read> u: array<vec4<f32>>;              // [node] m
@group(0) @binding(6) var<storage, read> rotation: array<vec4<f32>>;       // [cell] quaternion
@group(0) @binding(7) var<storage, read_write> f: array<vec4<f32>>;        // [node] N
@group(0) @binding(8) var<storage, read> split: array<u32>;                // see split.rs

@compute @workgroup_size(64)
fn forces(thread: Thread) {
    let i = number_of(thread);
    if i >= params.node_count { return; }
    let c = grid_coordinates(params, i);
    let own = u[i].xyz;
    var sum = vec3<f32>(0.0);
    for (var a = 0u; a < 8u; a += 1u) {
        let at = c - corner(a);
        if !has_cell(params, at) { continue; }
        let q = rotation[cell_id(params, at)];
        if all(q == vec4<f32>(0.0)) || corner_node(params, at, a) != i { continue; }
        let layer = layer_of[at.z];
        let h = shape[layer].xyz;
        let e = pre_strain[layer].xyz;
        let r = rotation_matrix(q);
        let change = transpose(rotation_minus_identity(q));
        var local = vec3<f32>(0.0);
        for (var b = 0u; b < 8u; b += 1u) {
            let x = (vec3<f32>(corner(b)) - 0.5) * h;
            let stretch = (u[corner_node(params, at, b)].xyz - own) * r + change * x + e * x;
            local += stiffness[layer * 64u + a * 8u + b] * stretch;
        }
        sum += r * local;
    }
    f[i] = vec4<f32>(sum, 0.0);
}
