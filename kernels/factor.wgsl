// Block LDLᵀ of each z-column, in place. Twin: factor.rs (formula there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> block: array<vec4<f32>>; // [node × 4] packed: D, U in; D'⁻¹, G out

fn inverse_of_definite(m: mat3x3<f32>) -> mat3x3<f32> {
    let i0 = 1.0 / m[0].x;
    let l10 = m[1].x * i0;
    let l20 = m[2].x * i0;
    let rest = m[2].y - l10 * m[2].x;
    let i1 = 1.0 / (m[1].y - l10 * m[1].x);
    let l21 = rest * i1;
    let i2 = 1.0 / (m[2].z - l20 * m[2].x - l21 * rest);
    let n20 = l10 * l21 - l20; // of L⁻¹, as −l10 and −l21
    let yz = -l21 * i2;
    let xz = n20 * i2;
    let yy = i1 - l21 * yz;
    let xy = -l10 * i1 - l21 * xz;
    let xx = i0 + l10 * l10 * i1 + n20 * xz;
    return mat3x3<f32>(vec3<f32>(xx, xy, xz), vec3<f32>(xy, yy, yz), vec3<f32>(xz, yz, i2));
}

@compute @workgroup_size(64)
fn factor(thread: Thread) {
    let column = number_of(thread);
    let columns = column_count(params);
    let nodes = column_nodes(params, column);
    if column >= columns { return; }
    var below = mat3x3<f32>(); // Uᵀ D'⁻¹ U of the node below
    for (var k = 0u; k < params.nodes_z; k += 1u) {
        let at = (nodes.x + k * nodes.y) * 4u;
        let own = unpack(block[at], block[at + 1u], block[at + 2u], block[at + 3u]);
        let d = inverse_of_definite(own.d - below);
        let g = d * own.g;
        below = transpose(own.g) * g;
        let packed = pack(Block(d, g));
        for (var n = 0u; n < 4u; n += 1u) { block[at + n] = packed[n]; }
    }
}
