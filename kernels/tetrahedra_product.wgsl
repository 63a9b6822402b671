// w = A z of tetrahedra, one right-hand side per dispatch row. Twin: tetrahedra_product.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> first_of_node: array<u32>;            // [node + 1] into of_node
@group(0) @binding(2) var<storage, read> of_node: array<u32>;                  // 4 × tetrahedron + corner
@group(0) @binding(3) var<storage, read> tetrahedron_force: array<vec4<f32>>;  // [rhs][tetrahedron × 3] at corners 1 to 3, N
@group(0) @binding(4) var<storage, read> dofs: array<vec4<f32>>;               // [node] 1 free, 0 fixed, per axis; mass kg
@group(0) @binding(5) var<storage, read> z: array<vec4<f32>>;                  // [rhs][node] m
@group(0) @binding(6) var<storage, read_write> w: array<vec4<f32>>;            // [rhs][node] N
@group(0) @binding(7) var<storage, read_write> partial_product: array<f32>;    // [rhs][group] z·w
@group(0) @binding(8) var<storage, read> scalars: array<vec4<f32>>;            // [rhs × 2] alpha beta gamma done; target² rr iterations state

@compute @workgroup_size(64)
fn tetrahedra_product(thread: Thread) {
    let block = group_of(thread);
    let i = number_of(thread);
    let rhs = params.first_rhs + thread.group.y;
    let at = rhs * params.node_count + i;
    var product_dot = 0.0;
    if i < params.node_count && scalars[rhs * 2u].w == 0.0 {
        let elastic = gathered(i, 3u * rhs * params.tetrahedron_count) * params.stiffness_factor;
        let out = (elastic + z[at].xyz * (params.inertia * dofs[i].w)) * dofs[i].xyz;
        w[at] = vec4<f32>(out, 0.0);
        product_dot = dot(z[at].xyz, out);
    }
    let sum_of_group = group_sum(product_dot, thread.lane);
    if thread.lane == 0u && i < params.node_count {
        partial_product[rhs * params.product_groups + block] = sum_of_group;
    }
}
