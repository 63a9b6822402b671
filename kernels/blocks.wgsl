// Node blocks of A for the preconditioner. Twin: blocks.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> stiffness: array<mat3x3<f32>, 1344>;   // [layer × 64] blocks a×8+b, N/m
@group(0) @binding(2) var<storage, read> layer_of: array<u32>;            // [cells_z] layer
@group(0) @binding(3) var<storage, read> rotation: array<vec4<f32>>;      // [cell] quaternion
@group(0) @binding(4) var<storage, read> dofs: array<vec4<f32>>;          // [node] 1 free, 0 fixed, per axis; mass kg
@group(0) @binding(5) var<storage, read_write> block: array<vec4<f32>>;   // [node × 4] packed
@group(0) @binding(6) var<storage, read> split: array<u32>;               // see split.rs

@compute @workgroup_size(64)
fn blocks(thread: Thread) {
    let i = number_of(thread);
    if i >= params.node_count { return; }
    let c = grid_coordinates(params, i);
    let over = above(params, i);
    var d = mat3x3<f32>();
    var g = mat3x3<f32>();
    for (var a = 0u; a < 8u; a += 1u) {
        let at = c - corner(a);
        if !has_cell(params, at) { continue; }
        if corner_node(params, at, a) != i { continue; }
        let cell = cell_id(params, at);
        let first = layer_of[at.z] * 64u + a * 8u;
        let r = rotation_matrix(rotation[cell]);
        let turned = transpose(r);
        let other = corner_node(params, at, a ^ 4u); // along the vertical edge
        let chained = select(above(params, other) == i, other == over, a < 4u);
        var own = stiffness[first + a];
        var upper = stiffness[first + (a | 4u)];
        if params.corotational >= HYPERELASTIC {
            own += stiffness_between(cell, a, a);
            upper += stiffness_between(cell, a, a | 4u);
        }
        d += r * own * turned * select(2.0, 1.0, chained);
        if a < 4u && chained { g += r * upper * turned; }
    }
    var axes_above = vec3<f32>(0.0);
    if over < params.node_count { axes_above = dofs[over].xyz; }
    let packed = finish(d, g, dofs[i], axes_above, params.stiffness_factor, params.inertia, params.preconditioner);
    for (var k = 0u; k < 4u; k += 1u) { block[i * 4u + k] = packed[k]; }
}
