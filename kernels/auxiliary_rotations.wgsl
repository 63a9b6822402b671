// Rotations of the cells of an auxiliary grid. Twin: auxiliary_rotations.rs (formula there).
@group(0) @binding(0) var<uniform> params: Params; // of the grid
@group(0) @binding(1) var<storage, read> first_of_cell: array<u32>;        // [cell + 1] into in_cell
@group(0) @binding(2) var<storage, read> in_cell: array<u32>;              // nodes
@group(0) @binding(3) var<storage, read> scale: array<f32>;                // [cell] length of the quaternion
@group(0) @binding(4) var<storage, read> node_rotation: array<vec4<f32>>;  // [node] quaternion
@group(0) @binding(5) var<storage, read_write> rotation: array<vec4<f32>>; // [cell] quaternion

@compute @workgroup_size(64)
fn auxiliary_rotations(thread: Thread) {
    let cell = number_of(thread);
    if cell >= params.cell_count { return; }
    var sum = vec4<f32>(0.0);
    for (var n = first_of_cell[cell]; n < first_of_cell[cell + 1u]; n += 1u) {
        let q = node_rotation[in_cell[n]];
        // q and −q are the same rotation
        sum += select(q, -q, dot(q, sum) < 0.0);
    }
    let squared = dot(sum, sum);
    var length = 0.0;
    if squared > 0.0 { length = scale[cell] / sqrt(squared); }
    rotation[cell] = sum * length;
}
