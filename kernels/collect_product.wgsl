// Adds the cells' tangent products to w = A z, one slot per dispatch row. Twin: collect_product.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> corner_force: array<f32>;           // [slot][cell][corner][axis] N
@group(0) @binding(2) var<storage, read> free: array<vec4<f32>>;             // [node] 1 free, 0 held, per axis; mass kg
@group(0) @binding(3) var<storage, read> z: array<vec4<f32>>;                // [slot][node] m
@group(0) @binding(4) var<storage, read_write> w: array<vec4<f32>>;          // [slot][node] N
@group(0) @binding(5) var<storage, read_write> partial_product: array<f32>;  // [slot][group] z·w
@group(0) @binding(6) var<storage, read> scalars: array<vec4<f32>>;          // [slot × 2] alpha beta gamma done; target² rr iterations state

const TILE: u32 = 7u; // of product.wgsl, whose sums come first
@compute @workgroup_size(64)
fn collect_product(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let block = group_of(group, groups);
    let i = block * GROUP + lane;
    let slot = params.first_slot + group.y;
    let at = slot * params.node_count + i;
    var more_dot = 0.0;
    if i < params.node_count && scalars[slot * 2u].w == 0.0 {
        let more = collected(i, slot * params.cell_count * 24u) * params.stiffness_factor * free[i].xyz;
        w[at] = vec4<f32>(w[at].xyz + more, 0.0);
        more_dot = dot(z[at].xyz, more);
    }
    let sum_of_group = group_sum(more_dot, lane);
    if lane == 0u && i < params.node_count {
        let tiles = ((params.nodes_x + TILE - 1u) / TILE) * ((params.nodes_y + TILE - 1u) / TILE);
        partial_product[slot * params.product_groups + tiles + block] = sum_of_group;
    }
}
