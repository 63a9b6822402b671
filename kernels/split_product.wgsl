// Adds split cells and the rows of duplicate nodes to w = A z. Twin: split_product.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> stiffness: array<mat3x3<f32>, 1344>;      // [layer × 64] blocks a×8+b, N/m
@group(0) @binding(2) var<storage, read> layer_of: array<u32>;               // [cells_z] layer
@group(0) @binding(3) var<storage, read> rotation: array<vec4<f32>>;         // [cell] quaternion
@group(0) @binding(4) var<storage, read> dofs: array<vec4<f32>>;             // [node] 1 free, 0 fixed, per axis; mass kg
@group(0) @binding(5) var<storage, read> split: array<u32>;                  // see split.rs
@group(0) @binding(6) var<storage, read> z: array<vec4<f32>>;                // [rhs][node] m
@group(0) @binding(7) var<storage, read_write> w: array<vec4<f32>>;          // [rhs][node] N
@group(0) @binding(8) var<storage, read_write> partial_product: array<f32>;  // [rhs][group] z·w
@group(0) @binding(9) var<storage, read> scalars: array<vec4<f32>>;          // [rhs × 2] alpha beta gamma done; target² rr iterations state

// Force of the split cells at node `i`, without the factor s.
fn force_on(i: u32, offset: u32) -> vec3<f32> {
    let c = grid_coordinates(params, i);
    let own = z[offset + i].xyz;
    var sum = vec3<f32>(0.0);
    for (var a = 0u; a < 8u; a += 1u) {
        let at = c - corner(a);
        if !has_cell(params, at) { continue; }
        let cell = cell_id(params, at);
        if !is_split(params, cell) || corner_node(params, at, a) != i { continue; }
        let first = layer_of[at.z] * 64u + a * 8u;
        let r = rotation_matrix(rotation[cell]);
        var local = vec3<f32>(0.0);
        for (var b = 0u; b < 8u; b += 1u) {
            // K has no force for a translation
            let moved = (z[offset + corner_node(params, at, b)].xyz - own) * r;
            local += stiffness[first + b] * moved;
            if params.corotational >= HYPERELASTIC { local += stiffness_between(cell, a, b) * moved; }
        }
        sum += r * local;
    }
    return sum;
}

@compute @workgroup_size(64)
fn split_product(thread: Thread) {
    let index = group_of(thread);
    let entry = number_of(thread);
    let rhs = params.first_rhs + thread.group.y;
    let offset = rhs * params.node_count;
    var i = NONE;
    if entry < params.touched_nodes { i = split[split_row(params) + params.cell_count + entry]; }
    var product_dot = 0.0;
    if i != NONE && scalars[rhs * 2u].w == 0.0 {
        let own = z[offset + i].xyz;
        var out = force_on(i, offset) * params.stiffness_factor;
        let of_grid = i < params.nodes_x * params.nodes_y * params.nodes_z;
        if !of_grid { out += own * (params.inertia * dofs[i].w); }
        out *= dofs[i].xyz;
        product_dot = dot(own, out);
        if of_grid { out += w[offset + i].xyz; }
        w[offset + i] = vec4<f32>(out, 0.0);
    }
    let sum_of_group = group_sum(product_dot, thread.lane);
    if thread.lane == 0u && entry < params.touched_nodes {
        let tiles = product_tiles(params); // whose sums come first
        partial_product[rhs * params.product_groups + tiles.x * tiles.y * tiles.z + index] = sum_of_group;
    }
}
