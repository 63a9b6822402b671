// w = A z, one right-hand side per dispatch row. Twin: product.rs (formula, mirror blocks and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> modes: array<mat3x3<f32>, 168>;           // [layer × 8] blocks of B, N/m
@group(0) @binding(2) var<storage, read> layer_of: array<u32>;               // [cells_z] layer
@group(0) @binding(3) var<storage, read> rotation: array<vec4<f32>>;         // [cell] quaternion
@group(0) @binding(4) var<storage, read> dofs: array<vec4<f32>>;             // [node] 1 free, 0 fixed, per axis; mass kg
@group(0) @binding(5) var<storage, read> z: array<vec4<f32>>;                // [rhs][node] m
@group(0) @binding(6) var<storage, read_write> w: array<vec4<f32>>;          // [rhs][node] N
@group(0) @binding(7) var<storage, read_write> partial_product: array<f32>;  // [rhs][tile] z·w, of a slab each
@group(0) @binding(8) var<storage, read> scalars: array<vec4<f32>>;          // [rhs × 2] alpha beta gamma done; target² rr iterations state
@group(0) @binding(9) var<storage, read> split: array<u32>;                  // see split.rs

var<workgroup> corner_force: array<vec3<f32>, 512>; // [corner][thread], corners by bits x + 2y + 4z
fn patterns(v: array<vec3<f32>, 8>) -> array<vec3<f32>, 8> {
    let a0 = v[0] + v[1]; let a1 = v[0] - v[1];
    let a2 = v[2] + v[3]; let a3 = v[2] - v[3];
    let a4 = v[4] + v[5]; let a5 = v[4] - v[5];
    let a6 = v[6] + v[7]; let a7 = v[6] - v[7];
    let b0 = a0 + a2; let b2 = a0 - a2;
    let b1 = a1 + a3; let b3 = a1 - a3;
    let b4 = a4 + a6; let b6 = a4 - a6;
    let b5 = a5 + a7; let b7 = a5 - a7;
    return array<vec3<f32>, 8>(b0 + b4, b1 + b5, b2 + b6, b3 + b7, b0 - b4, b1 - b5, b2 - b6, b3 - b7);
}

fn cell_forces(cell: u32, first: u32, at: array<vec3<f32>, 8>) -> array<vec3<f32>, 8> {
    let r = rotation_matrix(rotation[cell]);
    let a = patterns(at);
    let l1 = a[1] * r; let l2 = a[2] * r; let l3 = a[3] * r; let l4 = a[4] * r;
    let l5 = a[5] * r; let l6 = a[6] * r; let l7 = a[7] * r;
    // parity P holds x of pattern P^1, y of P^2, z of P^4
    let g0 = modes[first] * vec3<f32>(l1.x, l2.y, l4.z);
    let g1 = modes[first + 1u] * vec3<f32>(0.0, l3.y, l5.z);
    let g2 = modes[first + 2u] * vec3<f32>(l3.x, 0.0, l6.z);
    let g3 = modes[first + 3u] * vec3<f32>(l2.x, l1.y, l7.z);
    let g4 = modes[first + 4u] * vec3<f32>(l5.x, l6.y, 0.0);
    let g5 = modes[first + 5u] * vec3<f32>(l4.x, l7.y, l1.z);
    let g6 = modes[first + 6u] * vec3<f32>(l7.x, l4.y, l2.z);
    let g7 = modes[first + 7u] * vec3<f32>(l6.x, l5.y, l3.z);
    var f1 = vec3<f32>(g0.x, g3.y, g5.z);
    var f2 = vec3<f32>(g3.x, g0.y, g6.z);
    var f4 = vec3<f32>(g5.x, g6.y, g0.z);
    var f3 = vec3<f32>(g2.x, g1.y, g7.z);
    var f5 = vec3<f32>(g4.x, g7.y, g1.z);
    var f6 = vec3<f32>(g7.x, g4.y, g2.z);
    var f7 = vec3<f32>(g6.x, g5.y, g3.z);
    if params.corotational >= HYPERELASTIC {
        let y1 = volume_row(cell, 0u); let y2 = volume_row(cell, 1u); let y4 = volume_row(cell, 2u);
        let change = dot(y1, l1) + dot(y2, l2) + dot(y4, l4);
        f1 += y1 * change; f2 += y2 * change; f4 += y4 * change;
        // tension: rotation and hourglass patterns
        let p = tension_row(cell);
        let spin = 0.5 * (cross(vec3<f32>(p.x, 0.0, 0.0), l1) + cross(vec3<f32>(0.0, p.y, 0.0), l2) + cross(vec3<f32>(0.0, 0.0, p.z), l4));
        f1 += cross(spin, vec3<f32>(p.x, 0.0, 0.0));
        f2 += cross(spin, vec3<f32>(0.0, p.y, 0.0));
        f4 += cross(spin, vec3<f32>(0.0, 0.0, p.z));
        let k = p * p / 3.0;
        f3 += vec3<f32>(k.y, k.x, k.x + k.y) * l3;
        f5 += vec3<f32>(k.z, k.x + k.z, k.x) * l5;
        f6 += vec3<f32>(k.y + k.z, k.z, k.y) * l6;
        f7 += vec3<f32>(k.y + k.z, k.x + k.z, k.x + k.y) / 3.0 * l7;
    }
    return patterns(array<vec3<f32>, 8>(
        vec3<f32>(0.0),
        r * f1,
        r * f2,
        r * f3,
        r * f4,
        r * f5,
        r * f6,
        r * f7,
    ));
}

@compute @workgroup_size(64)
fn product(thread: Thread) {
    let lane = thread.lane;
    let tile = group_of(thread);
    let tiles = product_tiles(params);
    let tile_count = tiles.x * tiles.y * tiles.z;
    let rhs = params.first_rhs + thread.group.y;
    let offset = rhs * params.node_count;
    let running = scalars[rhs * 2u].w == 0.0 && tile < tile_count;
    let x = (tile % tiles.x) * PRODUCT_TILE + lane % 8u; // this thread's node; its cell lies at x − 1, y − 1
    let y = (tile / tiles.x % tiles.y) * PRODUCT_TILE + lane / 8u;
    let first = tile / (tiles.x * tiles.y) * PRODUCT_SLAB; // levels of nodes of this slab
    let last = min(first + PRODUCT_SLAB, params.nodes_z);
    let has_cell = running && x >= 1u && y >= 1u && x <= params.cells_x && y <= params.cells_y;
    let has_node = running && lane % 8u < PRODUCT_TILE && lane / 8u < PRODUCT_TILE && x < params.nodes_x && y < params.nodes_y;
    let level = params.nodes_x * params.nodes_y;
    let corner_0 = offset + (x - 1u) + params.nodes_x * (y - 1u);
    let start = max(first, 1u) - 1u; // level of cells under the first nodes
    var at: array<vec3<f32>, 8>;
    if has_cell {
        let lowest = corner_0 + start * level;
        at[4] = z[lowest].xyz;
        at[5] = z[lowest + 1u].xyz;
        at[6] = z[lowest + params.nodes_x].xyz;
        at[7] = z[lowest + params.nodes_x + 1u].xyz;
    }
    var below = vec3<f32>(0.0); // from the cells under the node's level
    var product_dot = 0.0;
    for (var step = 0u; step < min(PRODUCT_SLAB + 1u, params.nodes_z); step += 1u) {
        let k = start + step;
        var force: array<vec3<f32>, 8>;
        if has_cell && k < min(last, params.cells_z) {
            at[0] = at[4]; at[1] = at[5]; at[2] = at[6]; at[3] = at[7];
            let upper = corner_0 + (k + 1u) * level;
            at[4] = z[upper].xyz;
            at[5] = z[upper + 1u].xyz;
            at[6] = z[upper + params.nodes_x].xyz;
            at[7] = z[upper + params.nodes_x + 1u].xyz;
            let cell = (x - 1u) + params.cells_x * ((y - 1u) + params.cells_y * k);
            if !is_split(params, cell) { force = cell_forces(cell, layer_of[k] * 8u, at); }
        }
        for (var n = 0u; n < 8u; n += 1u) { corner_force[n * 64u + lane] = force[n]; }
        workgroupBarrier();
        if has_node && k >= first && k < last {
            // the node is corner 3 of the cell at its own thread, 2 of the one at +x, 1 at +y, 0 at +x +y
            let above = corner_force[192u + lane] + corner_force[129u + lane]
                + corner_force[72u + lane] + corner_force[9u + lane];
            let i = x + params.nodes_x * y + k * level;
            let own = z[offset + i].xyz;
            let out = ((below + above) * params.stiffness_factor + own * (params.inertia * dofs[i].w)) * dofs[i].xyz;
            w[offset + i] = vec4<f32>(out, 0.0);
            product_dot += dot(own, out);
        }
        if has_node {
            below = corner_force[448u + lane] + corner_force[385u + lane]
                + corner_force[328u + lane] + corner_force[265u + lane];
        }
        workgroupBarrier();
    }
    let sum_of_group = group_sum(product_dot, lane);
    if lane == 0u && tile < tile_count { partial_product[rhs * params.product_groups + tile] = sum_of_group; }
}
