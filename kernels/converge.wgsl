// Ends a right-hand side whose residual is small enough, one workgroup per right-hand side. Twin: converge.rs (formula there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> partial_residual: array<f32>;       // [rhs][group]
@group(0) @binding(2) var<storage, read_write> scalars: array<vec4<f32>>;    // [rhs × 2]

@compute @workgroup_size(256)
fn converge(thread: Thread) {
    let rhs = params.first_rhs + thread.group.y;
    let groups = (params.node_count + GROUP - 1u) / GROUP;
    let running = scalars[rhs * 2u].w == 0.0;
    var sum = vec4<f32>(0.0); // of one number
    var compensation = vec4<f32>(0.0);
    for (var n = thread.lane; n < groups && running; n += LANES) {
        let part = vec4<f32>(partial_residual[rhs * groups + n]);
        if params.compensated == 1u { compensation += rounding_error(sum, part, params.zero); }
        sum += part;
    }
    let residual = compensated_sum(params, sum, compensation, thread.lane).x;
    if thread.lane == 0u && running {
        scalars[rhs * 2u + 1u].y = residual;
        if residual <= scalars[rhs * 2u + 1u].x { scalars[rhs * 2u].w = 1.0; }
    }
}
