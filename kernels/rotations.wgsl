// Rotation of each cell. Twin: rotations.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> shape: array<vec4<f32>, 21>;          // [layer] cell edges m, mass of one corner kg
@group(0) @binding(2) var<storage, read> layer_of: array<u32>;           // [cells_z] layer
@group(0) @binding(3) var<storage, read> u: array<vec4<f32>>;            // [node] m
@group(0) @binding(4) var<storage, read_write> rotation: array<vec4<f32>>; // [cell] quaternion
@group(0) @binding(5) var<storage, read> split: array<u32>;              // see split.rs

@compute @workgroup_size(64)
fn rotations(thread: Thread) {
    let cell = number_of(thread);
    if cell >= params.cell_count { return; }
    let q = rotation[cell];
    if all(q == vec4<f32>(0.0)) { return; }
    let at = cell_at(params, cell);
    let g = vec3<f32>(0.25) / shape[layer_of[at.z]].xyz;
    var f = mat3x3<f32>(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
    for (var a = 0u; a < 8u; a += 1u) {
        let o = corner(a);
        let gradient = (vec3<f32>(o) * 2.0 - 1.0) * g;
        let d = u[corner_node(params, at, a)].xyz;
        f += mat3x3<f32>(d * gradient.x, d * gradient.y, d * gradient.z);
    }
    rotation[cell] = polar(f, q);
}
