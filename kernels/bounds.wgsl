// Minimum and maximum displacement of each tile, one workgroup per tile. Twin: bounds.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> u: array<vec4<f32>>;                   // [node] m
@group(0) @binding(2) var<storage, read_write> tile_bounds: array<vec4<f32>>;   // [tile × 2] least m, number of non-finite nodes; greatest m, 0

const TILE: u32 = 8u; // cells along a side
const LARGEST: f32 = 0x1.fffffep+127f;
var<workgroup> least: array<vec4<f32>, 64>;
var<workgroup> greatest: array<vec3<f32>, 64>;

@compute @workgroup_size(64)
fn bounds(thread: Thread) {
    let lane = thread.lane;
    let tile = group_of(thread);
    let tiles = max((vec2<u32>(params.cells_x, params.cells_y) + TILE - 1u) / TILE, vec2<u32>(1u));
    let of_grid = tiles.x * tiles.y;
    var first = vec2<u32>(tile % tiles.x, tile / tiles.x) * TILE;
    var last = min(first + TILE, vec2<u32>(params.cells_x, params.cells_y));
    if params.cells_x == 0u { last = vec2<u32>(params.nodes_x, params.nodes_y) - 1u; } // no cells: one tile of all nodes
    let inside = tile < of_grid + (params.extra_columns + TILE - 1u) / TILE;
    var size = last - first + 1u; // columns of nodes, seams included
    if tile >= of_grid {
        first = vec2<u32>((tile - of_grid) * TILE, 0u);
        size = vec2<u32>(min(TILE, params.extra_columns - min(first.x, params.extra_columns)), 1u);
    }
    var low = vec4<f32>(LARGEST, LARGEST, LARGEST, 0.0);
    var high = vec3<f32>(-LARGEST);
    for (var n = lane; n < size.x * size.y * params.nodes_z; n += GROUP) {
        let at = vec3<u32>(first + vec2<u32>(n % size.x, n / size.x % size.y), n / (size.x * size.y));
        var i = node_id(params, at);
        if tile >= of_grid { i = copy_id(params, at.x, at.z); }
        let d = u[i].xyz;
        // all exponent bits set: infinite or NaN, which float comparisons may miss
        if any((bitcast<vec3<u32>>(d) & vec3<u32>(0x7f800000u)) == vec3<u32>(0x7f800000u)) {
            low.w += 1.0;
        } else {
            low = vec4<f32>(min(low.xyz, d), low.w);
            high = max(high, d);
        }
    }
    least[lane] = low;
    greatest[lane] = high;
    for (var n = GROUP / 2u; n > 0u; n >>= 1u) {
        workgroupBarrier();
        if lane < n {
            let other = least[lane + n];
            least[lane] = vec4<f32>(min(least[lane].xyz, other.xyz), least[lane].w + other.w);
            greatest[lane] = max(greatest[lane], greatest[lane + n]);
        }
    }
    if lane == 0u && inside {
        tile_bounds[tile * 2u] = least[0];
        tile_bounds[tile * 2u + 1u] = vec4<f32>(greatest[0], 0.0);
    }
}
