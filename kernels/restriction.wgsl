// Residual of the next coarser level. Twin: restriction.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params; // of the finer level
@group(0) @binding(1) var<storage, read> coarse_dofs: array<vec4<f32>>;      // [coarse node] 1 free, 0 fixed, per axis
@group(0) @binding(2) var<storage, read> r: array<vec4<f32>>;                // [rhs][node] N
@group(0) @binding(3) var<storage, read> w: array<vec4<f32>>;                // [rhs][node] N
@group(0) @binding(4) var<storage, read_write> coarse_r: array<vec4<f32>>;   // [rhs][coarse node] N
@group(0) @binding(5) var<storage, read> scalars: array<vec4<f32>>;          // [rhs × 2]
@group(0) @binding(6) var<storage, read> split: array<u32>;                  // see split.rs

@compute @workgroup_size(64)
fn restriction(thread: Thread) {
    let i = number_of(thread);
    let rhs = params.first_rhs + thread.group.y;
    let size = coarse_nodes(params);
    let count = size.x * size.y * size.z;
    if i >= count || scalars[rhs * 2u].w != 0.0 { return; }
    let offset = rhs * params.node_count;
    let at = vec3<u32>(2u * (i % size.x), 2u * ((i / size.x) % size.y), i / (size.x * size.y));
    var sum = vec3<f32>(0.0);
    // x and y are one more than the node's, so that they are not negative
    for (var x = at.x; x < at.x + 3u; x += 1u) {
        var along_y = vec3<f32>(0.0);
        for (var y = at.y; y < at.y + 3u; y += 1u) {
            if x < 1u || y < 1u || x > params.nodes_x || y > params.nodes_y { continue; }
            let weight = select(0.5, 1.0, y == at.y + 1u);
            let column = (x - 1u) + params.nodes_x * (y - 1u);
            let node = offset + column + params.nodes_x * params.nodes_y * at.z;
            along_y += (r[node].xyz - w[node].xyz) * weight;
            if params.extra_columns == 0u { continue; }
            var next = split[2u * params.extra_columns + column];
            while next != 0u {
                let copy = offset + copy_id(params, next - 1u, at.z);
                along_y += (r[copy].xyz - w[copy].xyz) * weight;
                next = split[params.extra_columns + next - 1u];
            }
        }
        sum += along_y * select(0.5, 1.0, x == at.x + 1u);
    }
    coarse_r[rhs * count + i] = vec4<f32>(sum * coarse_dofs[i].xyz, 0.0);
}
