// Shared by all shaders; see mod.rs.
struct Params {
    nodes_x: u32, nodes_y: u32, nodes_z: u32, node_count: u32,
    cells_x: u32, cells_y: u32, cells_z: u32, cell_count: u32,
    preconditioner: u32, corotational: u32, rhs_count: u32, first_rhs: u32,
    product_groups: u32, fresh: u32, compensated: u32, zero: u32,
    extra_columns: u32, split_cells: u32, touched_nodes: u32, tetrahedron_count: u32,
    domain_count: u32, total: u32, pad: u32, pad_1: u32,
    pad_2: u32, inertia: f32, stiffness_factor: f32, step: f32,
    momentum_factor: f32, velocity_factor: f32, lead_time: f32, gravity_x: f32,
    gravity_y: f32, gravity_z: f32, keep: f32, gain: f32,
}

const GROUP: u32 = 64u;

// Thread indices; `group.y` is the right-hand side index.
struct Thread {
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
}

// Number of its workgroup in a dispatch that may be folded into z (65,535 groups per dimension at most).
fn group_of(t: Thread) -> u32 {
    return t.group.x + t.group.z * t.groups.x;
}

// Number of the thread in the dispatch, for workgroups of 64.
fn number_of(t: Thread) -> u32 {
    return group_of(t) * GROUP + t.lane;
}

// Grid coordinates and ids, as `Params` in mod.rs has them.
fn node_at(p: Params, i: u32) -> vec3<u32> {
    return vec3<u32>(i % p.nodes_x, (i / p.nodes_x) % p.nodes_y, i / (p.nodes_x * p.nodes_y));
}

fn node_id(p: Params, c: vec3<u32>) -> u32 {
    return c.x + p.nodes_x * (c.y + p.nodes_y * c.z);
}

fn cell_id(p: Params, c: vec3<u32>) -> u32 {
    return c.x + p.cells_x * (c.y + p.cells_y * c.z);
}

fn cell_at(p: Params, i: u32) -> vec3<u32> {
    return vec3<u32>(i % p.cells_x, (i / p.cells_x) % p.cells_y, i / (p.cells_x * p.cells_y));
}

// Whether the grid has a cell at `c`; coordinates below 0 have wrapped.
fn has_cell(p: Params, c: vec3<u32>) -> bool {
    return all(c < vec3<u32>(p.cells_x, p.cells_y, p.cells_z));
}

const PRODUCT_TILE: u32 = 7u; // nodes along a side of product.wgsl's tiles; one thread more computes cells

const PRODUCT_SLAB: u32 = 4u; // levels of nodes of a tile

// Tiles of the product along x, y and z.
fn product_tiles(p: Params) -> vec3<u32> {
    let size = vec3<u32>(PRODUCT_TILE, PRODUCT_TILE, PRODUCT_SLAB);
    return (vec3<u32>(p.nodes_x, p.nodes_y, p.nodes_z) + size - 1u) / size;
}

// Node columns, with the duplicate ones; and the first node of a column and the stride to the next (split.rs).
fn column_count(p: Params) -> u32 {
    return p.nodes_x * p.nodes_y + p.extra_columns;
}

fn column_nodes(p: Params, column: u32) -> vec2<u32> {
    let columns = p.nodes_x * p.nodes_y;
    if column < columns { return vec2<u32>(column, columns); }
    return vec2<u32>(copy_id(p, column - columns, 0u), bundle(p, column - columns).y);
}

const BUNDLE: u32 = 32u; // extra columns that are laid out together

// First column of an extra column's bundle, and the bundle's number of columns.
fn bundle(p: Params, e: u32) -> vec2<u32> {
    let first = e / BUNDLE * BUNDLE;
    return vec2<u32>(first, min(p.extra_columns - first, BUNDLE));
}

// Node at a z-level of an extra column.
fn copy_id(p: Params, e: u32, level: u32) -> u32 {
    let own = bundle(p, e);
    return (p.nodes_x * p.nodes_y + own.x) * p.nodes_z + level * own.y + e - own.x;
}

// Nodes along x, y, z of the next coarser level (coarsen.rs).
fn coarse_nodes(p: Params) -> vec3<u32> {
    return vec3<u32>((p.cells_x + 1u) / 2u + 1u, (p.cells_y + 1u) / 2u + 1u, p.nodes_z);
}

var<workgroup> shared_sum: array<f32, 64>;

// Sum over a workgroup of 64; thread 0 has the result.
fn group_sum(value: f32, lane: u32) -> f32 {
    var sum = value;
    shared_sum[lane] = sum;
    for (var n = GROUP / 2u; n > 0u; n >>= 1u) {
        workgroupBarrier();
        if lane < n {
            sum += shared_sum[lane + n];
            shared_sum[lane] = sum;
        }
    }
    return sum;
}

// Hides a number from the compiler: `zero` is 0 at run time only.
fn hidden(x: vec4<f32>, zero: u32) -> vec4<f32> {
    return bitcast<vec4<f32>>(bitcast<vec4<u32>>(x) ^ vec4<u32>(zero));
}

// Rounding error of `a + b` (probe.rs).
fn rounding_error(a: vec4<f32>, b: vec4<f32>, zero: u32) -> vec4<f32> {
    let sum = hidden(a + b, zero);
    let part = hidden(sum - a, zero);
    let other = hidden(sum - part, zero);
    return hidden(a - other, zero) + hidden(b - part, zero);
}

// Offset (0 or 1) of a corner along x, y, z; VTK order.
fn corner(a: u32) -> vec3<u32> {
    return vec3<u32>(((a + 1u) >> 1u) & 1u, (a >> 1u) & 1u, a >> 2u);
}

// a ⊗ b
fn outer(a: vec3<f32>, b: vec3<f32>) -> mat3x3<f32> {
    return mat3x3<f32>(a * b.x, a * b.y, a * b.z);
}

// |q|² times the rotation matrix: 0 for a removed cell.
fn rotation_matrix(q: vec4<f32>) -> mat3x3<f32> {
    let xx = q.x * q.x; let yy = q.y * q.y; let zz = q.z * q.z; let ww = q.w * q.w;
    let xy = q.x * q.y; let xz = q.x * q.z; let yz = q.y * q.z;
    let wx = q.w * q.x; let wy = q.w * q.y; let wz = q.w * q.z;
    return mat3x3<f32>(
        vec3<f32>(ww + xx - yy - zz, 2.0 * (xy + wz), 2.0 * (xz - wy)),
        vec3<f32>(2.0 * (xy - wz), ww - xx + yy - zz, 2.0 * (yz + wx)),
        vec3<f32>(2.0 * (xz + wy), 2.0 * (yz - wx), ww - xx - yy + zz),
    );
}

// Rotation matrix minus identity, without cancellation at small angles.
fn rotation_minus_identity(q: vec4<f32>) -> mat3x3<f32> {
    let xx = q.x * q.x; let yy = q.y * q.y; let zz = q.z * q.z;
    let xy = q.x * q.y; let xz = q.x * q.z; let yz = q.y * q.z;
    let wx = q.w * q.x; let wy = q.w * q.y; let wz = q.w * q.z;
    return mat3x3<f32>(
        vec3<f32>(-2.0 * (yy + zz), 2.0 * (xy + wz), 2.0 * (xz - wy)),
        vec3<f32>(2.0 * (xy - wz), -2.0 * (xx + zz), 2.0 * (yz + wx)),
        vec3<f32>(2.0 * (xz + wy), 2.0 * (yz - wx), -2.0 * (xx + yy)),
    );
}

// Inverse by cofactors.
fn inverse(m: mat3x3<f32>) -> mat3x3<f32> {
    let r0 = cross(m[1], m[2]);
    let r1 = cross(m[2], m[0]);
    let r2 = cross(m[0], m[1]);
    let s = 1.0 / dot(m[0], r0);
    return transpose(mat3x3<f32>(r0 * s, r1 * s, r2 * s));
}

// Preconditioner blocks of a node, 64 bytes: `d` symmetric (6 numbers), `g` (9), one pad.
struct Block { d: mat3x3<f32>, g: mat3x3<f32> }

// A symmetric matrix by its 6 numbers: xx xy xz yy; yz zz.
fn symmetric(a: vec4<f32>, b: vec4<f32>) -> mat3x3<f32> {
    return mat3x3<f32>(a.xyz, vec3<f32>(a.y, a.w, b.x), vec3<f32>(a.z, b.x, b.y));
}

fn unpack(a: vec4<f32>, b: vec4<f32>, c: vec4<f32>, e: vec4<f32>) -> Block {
    return Block(symmetric(a, b), mat3x3<f32>(vec3<f32>(b.zw, c.x), c.yzw, e.xyz));
}

fn pack(k: Block) -> array<vec4<f32>, 4> {
    return array<vec4<f32>, 4>(
        vec4<f32>(k.d[0], k.d[1].y),
        vec4<f32>(k.d[1].z, k.d[2].z, k.g[0].xy),
        vec4<f32>(k.g[0].z, k.g[1]),
        vec4<f32>(k.g[2], 0.0),
    );
}

fn masked(m: mat3x3<f32>, left: vec3<f32>, right: vec3<f32>) -> mat3x3<f32> {
    return mat3x3<f32>(m[0] * left * right.x, m[1] * left * right.y, m[2] * left * right.z);
}

fn diagonal(d: vec3<f32>) -> mat3x3<f32> {
    return mat3x3<f32>(d.x, 0.0, 0.0, 0.0, d.y, 0.0, 0.0, 0.0, d.z);
}

// Packed blocks of a node (blocks.rs): multiplies by the stiffness factor, adds inertia, eliminates fixed axes, selects the entries.
fn finish(
    d_sum: mat3x3<f32>, g_sum: mat3x3<f32>, at: vec4<f32>, axes_above: vec3<f32>,
    factor: f32, rate: f32, kind: u32,
) -> array<vec4<f32>, 4> {
    let axes = at.xyz;
    let inertia = diagonal(vec3<f32>(rate * at.w));
    var d = masked(d_sum * factor + inertia, axes, axes) + diagonal(1.0 - axes);
    var g = masked(g_sum * factor, axes, axes_above);
    if kind == 0u {
        d = diagonal(vec3<f32>(1.0));
    } else if kind == 1u {
        d = diagonal(vec3<f32>(d[0].x, d[1].y, d[2].z));
    }
    if kind < 3u { g = mat3x3<f32>(); }
    return pack(Block(d, g));
}
