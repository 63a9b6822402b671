// w = A z of the spring body, one right-hand side per dispatch row. Twin: springs_product.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> first: array<u32>;                  // [node + 1] into half
@group(0) @binding(2) var<storage, read> half: array<vec2<u32>>;             // other node, spring
@group(0) @binding(3) var<storage, read> tangent: array<vec4<f32>>;          // [half × 2] symmetric T, N/m
@group(0) @binding(4) var<storage, read> dofs: array<vec4<f32>>;             // [node] 1 free, 0 fixed, per axis; mass kg
@group(0) @binding(5) var<storage, read> z: array<vec4<f32>>;                // [rhs][node] m
@group(0) @binding(6) var<storage, read_write> w: array<vec4<f32>>;          // [rhs][node] N
@group(0) @binding(7) var<storage, read_write> partial_product: array<f32>;  // [rhs][group] z·w
@group(0) @binding(8) var<storage, read> scalars: array<vec4<f32>>;          // [rhs × 2]

@compute @workgroup_size(64)
fn springs_product(thread: Thread) {
    let block = group_of(thread);
    let i = number_of(thread);
    let rhs = params.first_rhs + thread.group.y;
    let offset = rhs * params.node_count;
    let running = scalars[rhs * 2u].w == 0.0;
    var product_dot = 0.0;
    if running && i < params.node_count {
        let own = z[offset + i].xyz;
        var sum = vec3<f32>(0.0);
        for (var n = first[i]; n < first[i + 1u]; n += 1u) {
            sum += symmetric(tangent[n * 2u], tangent[n * 2u + 1u]) * (own - z[offset + half[n].x].xyz);
        }
        let out = (sum + own * (params.inertia * dofs[i].w)) * dofs[i].xyz;
        w[offset + i] = vec4<f32>(out, 0.0);
        product_dot = dot(own, out);
    }
    let sum_of_group = group_sum(product_dot, thread.lane);
    if thread.lane == 0u && i < params.node_count {
        partial_product[rhs * params.product_groups + block] = sum_of_group;
    }
}
