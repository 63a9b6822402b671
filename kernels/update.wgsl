// Vector updates of the conjugate gradients. Twin: update.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> scalars: array<vec4<f32>>;     // [rhs × 2]
@group(0) @binding(2) var<storage, read> z: array<vec4<f32>>;           // [rhs][node] m
@group(0) @binding(3) var<storage, read> w: array<vec4<f32>>;           // [rhs][node] N
@group(0) @binding(4) var<storage, read_write> x: array<vec4<f32>>;     // [rhs][node] m
@group(0) @binding(5) var<storage, read_write> p: array<vec4<f32>>;     // [rhs][node] m
@group(0) @binding(6) var<storage, read_write> s: array<vec4<f32>>;     // [rhs][node] N
@group(0) @binding(7) var<storage, read_write> r: array<vec4<f32>>;     // [rhs][node] N
@group(0) @binding(8) var<storage, read_write> partial_residual: array<f32>; // [rhs][group] r·r

@compute @workgroup_size(64)
fn update(thread: Thread) {
    let group_index = group_of(thread);
    let node = number_of(thread);
    let rhs = params.first_rhs + thread.group.y;
    let running = node < params.node_count && scalars[rhs * 2u].w == 0.0;
    var residual = vec4<f32>(0.0);
    if running { residual = update_node(rhs, rhs * params.node_count + node); }
    let sum_of_group = group_sum(dot(residual, residual), thread.lane);
    if thread.lane == 0u && running {
        partial_residual[rhs * ((params.node_count + GROUP - 1u) / GROUP) + group_index] = sum_of_group;
    }
}

fn update_node(rhs: u32, i: u32) -> vec4<f32> {
    let head = scalars[rhs * 2u];
    if scalars[rhs * 2u + 1u].w == 1.0 {
        x[i] = z[i];
        let residual = r[i] - w[i];
        r[i] = residual;
        return residual;
    }
    var direction = z[i];
    var change = w[i];
    if head.y != 0.0 {
        direction += head.y * p[i];
        change += head.y * s[i];
    }
    p[i] = direction;
    s[i] = change;
    x[i] += head.x * direction;
    let residual = r[i] - head.x * change;
    r[i] = residual;
    return residual;
}
