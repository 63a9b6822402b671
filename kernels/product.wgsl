// w = A z, gathered per node, one slot per dispatch row. Twin: product.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> stiffness: array<mat3x3<f32>, 1344>;      // [layer × 64] blocks a×8+b, N/m
@group(0) @binding(2) var<storage, read> layer_of: array<u32>;               // [cells_z] layer
@group(0) @binding(3) var<storage, read> rotation: array<vec4<f32>>;         // [cell] quaternion
@group(0) @binding(4) var<storage, read> free: array<vec4<f32>>;             // [node] 1 free, 0 held, per axis; mass kg
@group(0) @binding(5) var<storage, read> z: array<vec4<f32>>;                // [slot][node] m
@group(0) @binding(6) var<storage, read_write> w: array<vec4<f32>>;          // [slot][node] N
@group(0) @binding(7) var<storage, read_write> partial_product: array<f32>;  // [slot][group] z·w
@group(0) @binding(8) var<storage, read> scalars: array<vec4<f32>>;          // [slot × 2] alpha beta gamma done; target² rr iterations state

var<workgroup> shared_sum: array<f32, 64>;

@compute @workgroup_size(64)
fn product(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let block = group_of(group, groups);
    let i = block * GROUP + lane;
    let slot = params.first_slot + group.y;
    let offset = slot * params.node_count;
    let running = scalars[slot * 2u].w == 0.0;
    var product_dot = 0.0;
    if running && i < params.node_count {
        let c = vec3<u32>(
            i % params.nodes_x,
            (i / params.nodes_x) % params.nodes_y,
            i / (params.nodes_x * params.nodes_y),
        );
        let cells = vec3<u32>(params.cells_x, params.cells_y, params.cells_z);
        var sum = vec3<f32>(0.0);
        for (var a = 0u; a < 8u; a += 1u) {
            let at = c - corner(a); // wraps below 0, which the test catches
            if any(at >= cells) { continue; }
            let q = rotation[at.x + params.cells_x * (at.y + params.cells_y * at.z)];
            if all(q == vec4<f32>(0.0)) { continue; }
            let first = layer_of[at.z] * 64u + a * 8u;
            let r = rotation_matrix(q);
            var local = vec3<f32>(0.0);
            for (var b = 0u; b < 8u; b += 1u) {
                let o = corner(b);
                let node = (at.x + o.x) + params.nodes_x * ((at.y + o.y) + params.nodes_y * (at.z + o.z));
                local += stiffness[first + b] * (z[offset + node].xyz * r);
            }
            sum += r * local;
        }
        let own = z[offset + i].xyz;
        let out = (sum * params.stiffness_factor + own * (params.inertia * free[i].w)) * free[i].xyz;
        w[offset + i] = vec4<f32>(out, 0.0);
        product_dot = dot(own, out);
    }
    shared_sum[lane] = product_dot;
    for (var n = GROUP / 2u; n > 0u; n >>= 1u) {
        workgroupBarrier();
        if lane < n { shared_sum[lane] += shared_sum[lane + n]; }
    }
    if lane == 0u && i < params.node_count {
        partial_product[slot * ((params.node_count + GROUP - 1u) / GROUP) + block] = shared_sum[0];
    }
}
