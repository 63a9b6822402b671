// Adds the cells' tangent products to w = A z, one right-hand side per dispatch row. Twin: collect_product.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> corner_force: array<f32>;           // [rhs][cell][corner][axis] N
@group(0) @binding(2) var<storage, read> dofs: array<vec4<f32>>;             // [node] 1 free, 0 fixed, per axis; mass kg
@group(0) @binding(3) var<storage, read> z: array<vec4<f32>>;                // [rhs][node] m
@group(0) @binding(4) var<storage, read_write> w: array<vec4<f32>>;          // [rhs][node] N
@group(0) @binding(5) var<storage, read_write> partial_product: array<f32>;  // [rhs][group] z·w
@group(0) @binding(6) var<storage, read> scalars: array<vec4<f32>>;          // [rhs × 2] alpha beta gamma done; target² rr iterations state

@compute @workgroup_size(64)
fn collect_product(thread: Thread) {
    let block = group_of(thread);
    let i = number_of(thread);
    let rhs = params.first_rhs + thread.group.y;
    let at = rhs * params.node_count + i;
    var more_dot = 0.0;
    if i < params.node_count && scalars[rhs * 2u].w == 0.0 {
        let more = collected(i, rhs * params.cell_count * 24u) * params.stiffness_factor * dofs[i].xyz;
        w[at] = vec4<f32>(w[at].xyz + more, 0.0);
        more_dot = dot(z[at].xyz, more);
    }
    let sum_of_group = group_sum(more_dot, thread.lane);
    if thread.lane == 0u && i < params.node_count {
        let tiles = product_tiles(params); // whose sums come first
        partial_product[rhs * params.product_groups + tiles.x * tiles.y * tiles.z + block] = sum_of_group;
    }
}
