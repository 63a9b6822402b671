// Scalars of the conjugate gradients, one workgroup per right-hand side. Twin: advance.rs (formula and states there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> requests: array<vec4<f32>>;         // [rhs] tolerance², reference², floor², use_load
@group(0) @binding(2) var<storage, read> partial_product: array<f32>;        // [rhs][group]
@group(0) @binding(3) var<storage, read> partial_gamma: array<f32>;          // [rhs][group]
@group(0) @binding(4) var<storage, read> partial_residual: array<f32>;       // [rhs][group]
@group(0) @binding(5) var<storage, read> partial_load: array<f32>;           // [group]
@group(0) @binding(6) var<storage, read_write> scalars: array<vec4<f32>>;    // [rhs × 2]

@compute @workgroup_size(256)
fn advance(thread: Thread) {
    let rhs = params.first_rhs + thread.group.y;
    let groups = (params.node_count + GROUP - 1u) / GROUP;
    let column_groups = (column_count(params) + GROUP - 1u) / GROUP;
    let starting = scalars[rhs * 2u + 1u].w == 0.0;
    let most = max(max(groups, column_groups), params.product_groups);
    var sum = vec4<f32>(0.0); // load, delta, gamma, residual
    var compensation = vec4<f32>(0.0);
    for (var n = thread.lane; n < most && scalars[rhs * 2u].w == 0.0; n += LANES) {
        var part = vec4<f32>(0.0);
        if starting && n < groups { part.x = partial_load[n]; }
        if n < params.product_groups { part.y = partial_product[rhs * params.product_groups + n]; }
        if n < column_groups { part.z = partial_gamma[rhs * column_groups + n]; }
        if n < groups { part.w = partial_residual[rhs * groups + n]; }
        if params.compensated == 1u { compensation += rounding_error(sum, part, params.zero); }
        sum += part;
    }
    let total = compensated_sum(params, sum, compensation, thread.lane);
    if thread.lane == 0u { advance_rhs(rhs, total); }
}

fn advance_rhs(rhs: u32, sums: vec4<f32>) {
    let request = requests[rhs];
    var head = scalars[rhs * 2u];      // alpha beta gamma done
    var tail = scalars[rhs * 2u + 1u]; // target² rr iterations state
    if head.w != 0.0 { return; }
    if tail.w == 0.0 {
        let reference = select(request.y, sums.x, request.w >= 1.0);
        tail.x = max(request.x * reference, request.z);
        tail.w = 1.0;
        scalars[rhs * 2u + 1u] = tail;
        return;
    }
    let delta = sums.y;
    let gamma = sums.z;
    tail.y = sums.w;
    if tail.w == 1.0 && request.w == 2.0 { tail.x = max(tail.x, request.x * sums.w); }
    var denominator = delta;
    if tail.y <= tail.x {
        head.w = 1.0;
    } else {
        head.y = 0.0;
        if tail.w >= 2.0 {
            head.y = gamma / head.z;
            denominator = delta - head.y * gamma / head.x;
        }
        if denominator > 0.0 && gamma > 0.0 {
            head.x = gamma / denominator;
            head.z = gamma;
            tail.z += 1.0;
            tail.w = select(3.0, 2.0, tail.w == 1.0);
        } else {
            head.w = 2.0;
        }
    }
    scalars[rhs * 2u] = head;
    scalars[rhs * 2u + 1u] = tail;
}
