// Displacements of the cell centres. Twin: centres.rs (units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> u: array<vec4<f32>>;                // [node] m
@group(0) @binding(2) var<storage, read_write> point_u: array<vec4<f32>>;    // [cell] m
@group(0) @binding(3) var<storage, read> split: array<u32>;                  // see split.rs

@compute @workgroup_size(64)
fn centres(thread: Thread) {
    let cell = number_of(thread);
    if cell >= params.cell_count { return; }
    let at = cell_at(params, cell);
    var sum = vec3<f32>(0.0);
    for (var k = 0u; k < 8u; k += 1u) {
        sum += u[corner_node(params, at, k)].xyz;
    }
    point_u[cell] = vec4<f32>(sum * 0.125, 0.0);
}
