// Rotations and remaining fractions of a coarser level's cells. Twin: coarsen.rs (formula there).
@group(0) @binding(0) var<uniform> params: Params; // of the finer level
@group(0) @binding(1) var<storage, read> rotation: array<vec4<f32>>;               // [cell] quaternion; [cell × 3] y, p
@group(0) @binding(2) var<storage, read_write> coarse_rotation: array<vec4<f32>>;  // [coarse cell] quaternion

@compute @workgroup_size(64)
fn coarsen(thread: Thread) {
    let cell = number_of(thread);
    let size = coarse_nodes(params) - 1u;
    if cell >= size.x * size.y * size.z { return; }
    let at = vec3<u32>(cell % size.x, (cell / size.x) % size.y, cell / (size.x * size.y));
    var sum = vec4<f32>(0.0);
    var share = 0.0;
    var rows = array<vec4<f32>, 3>();
    for (var child = 0u; child < 4u; child += 1u) {
        let x = 2u * at.x + (child & 1u);
        let y = 2u * at.y + (child >> 1u);
        if x >= params.cells_x || y >= params.cells_y { continue; }
        let fine = x + params.cells_x * (y + params.cells_y * at.z);
        let q = rotation[fine];
        let squared = dot(q, q);
        if squared == 0.0 { continue; }
        let weight = squared * sqrt(squared);
        sum += select(weight, -weight, dot(q, sum) < 0.0) * q;
        share += squared * squared;
        if params.corotational >= HYPERELASTIC {
            for (var n = 0u; n < 3u; n += 1u) { rows[n] += rotation[params.cell_count + 3u * fine + n] * (squared * squared); }
        }
    }
    let squared = dot(sum, sum);
    var out = vec4<f32>(0.0);
    if squared > 0.0 { out = sum * (sqrt(sqrt(0.25 * share)) / sqrt(squared)); }
    coarse_rotation[cell] = out;
    if params.corotational < HYPERELASTIC { return; }
    var mean = 0.0;
    if share > 0.0 { mean = 1.0 / share; }
    let first = size.x * size.y * size.z + 3u * cell;
    coarse_rotation[first] = rows[0] * mean;
    coarse_rotation[first + 1u] = rows[1] * mean;
    coarse_rotation[first + 2u] = rows[2] * (2.0 * mean);
}
