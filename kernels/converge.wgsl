// Ends a slot whose residual is small enough, one workgroup per slot. Twin: converge.rs (formula there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> partial_residual: array<f32>;       // [slot][group]
@group(0) @binding(2) var<storage, read_write> scalars: array<vec4<f32>>;    // [slot × 2]

const LANES: u32 = 256u;
var<workgroup> shared_sum: array<f32, 256>;
var<workgroup> shared_rest: array<f32, 256>; // what the sums have lost

@compute @workgroup_size(256)
fn converge(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let slot = params.first_slot + group.y;
    let groups = (params.node_count + GROUP - 1u) / GROUP;
    let running = scalars[slot * 2u].w == 0.0;
    var sum = 0.0;
    var rest = 0.0;
    for (var n = lane; n < groups && running; n += LANES) {
        let part = partial_residual[slot * groups + n];
        if params.compensated == 1u { rest += lost(vec4<f32>(sum), vec4<f32>(part), params.zero).x; }
        sum += part;
    }
    shared_sum[lane] = sum;
    shared_rest[lane] = rest;
    for (var n = LANES / 2u; n > 0u; n >>= 1u) {
        workgroupBarrier();
        if lane < n {
            let part = shared_sum[lane + n];
            rest += shared_rest[lane + n];
            if params.compensated == 1u { rest += lost(vec4<f32>(shared_sum[lane]), vec4<f32>(part), params.zero).x; }
            shared_sum[lane] += part;
            shared_rest[lane] = rest;
        }
    }
    if lane == 0u && running {
        let residual = shared_sum[0] + rest;
        scalars[slot * 2u + 1u].y = residual;
        if residual <= scalars[slot * 2u + 1u].x { scalars[slot * 2u].w = 1.0; }
    }
}
