// Correction from the next coarser level. Twin: prolongation.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params; // of the finer level
@group(0) @binding(1) var<storage, read> dofs: array<vec4<f32>>;        // [node] 1 free, 0 fixed, per axis; mass kg
@group(0) @binding(2) var<storage, read> coarse_z: array<vec4<f32>>;    // [rhs][coarse node] m
@group(0) @binding(3) var<storage, read_write> z: array<vec4<f32>>;     // [rhs][node] m
@group(0) @binding(4) var<storage, read> scalars: array<vec4<f32>>;     // [rhs × 2]
@group(0) @binding(5) var<storage, read> split: array<u32>;             // see split.rs

@compute @workgroup_size(64)
fn prolongation(thread: Thread) {
    let i = number_of(thread);
    let rhs = params.first_rhs + thread.group.y;
    if i >= params.node_count || scalars[rhs * 2u].w != 0.0 { return; }
    let size = coarse_nodes(params);
    let at = grid_coordinates(params, i);
    if at.x >= params.nodes_x { return; }
    let x = at.x;
    let y = at.y;
    let level = at.z;
    let first = rhs * size.x * size.y * size.z + x / 2u + size.x * (y / 2u + size.y * level);
    // the same node twice where the fine node coincides with it
    let step_x = x % 2u;
    let step_y = (y % 2u) * size.x;
    let sum = coarse_z[first].xyz + coarse_z[first + step_x].xyz
        + coarse_z[first + step_y].xyz + coarse_z[first + step_x + step_y].xyz;
    z[rhs * params.node_count + i] += vec4<f32>(sum * 0.25 * dofs[i].xyz, 0.0);
}
