// M⁻¹ by columns, with r·z; see columns.rs (formula and units there). A kernel that includes it binds `block`, `r`, `partial_gamma` and
// `scalars` and has five functions of an index `at` into [slot][node]: `pushed` gives the load, `keep` and `kept` store and read y, `take`
// turns the solution, with what `earlier` has read, into the z of r·z.

// Levels whose values are read together: a GPU waits for memory once for all of them, which is most of what a column takes.
const AHEAD: u32 = 4u;

fn solve_columns(thread: Thread) {
    let group_index = group_of(thread);
    let column = number_of(thread);
    let columns = column_count(params);
    let nodes = column_nodes(params, column);
    let slot = params.first_slot + thread.group.y;
    let offset = slot * params.node_count;
    let running = scalars[slot * 2u].w == 0.0;
    var gamma = 0.0;
    if running && column < columns {
        var factors: array<Block, AHEAD>;
        var load: array<vec3<f32>, AHEAD>;
        var carried = vec3<f32>(0.0); // G_{k−1}ᵀ y_{k−1}
        // forward substitution, bottom to top
        for (var k = 0u; k < params.nodes_z; k += AHEAD) {
            let count = min(AHEAD, params.nodes_z - k);
            for (var n = 0u; n < AHEAD; n += 1u) {
                if n < count {
                    let i = nodes.x + (k + n) * nodes.y;
                    factors[n] = factors_of(i);
                    load[n] = pushed(offset + i);
                }
            }
            for (var n = 0u; n < AHEAD; n += 1u) {
                if n < count {
                    let y = load[n] - carried;
                    keep(offset + nodes.x + (k + n) * nodes.y, y);
                    carried = y * factors[n].g;
                }
            }
        }
        // backward substitution, top to bottom
        var before: array<array<vec3<f32>, 2>, AHEAD>;
        var residual: array<vec3<f32>, AHEAD>;
        var above = vec3<f32>(0.0);
        for (var k = 0u; k < params.nodes_z; k += AHEAD) {
            let count = min(AHEAD, params.nodes_z - k);
            let top = nodes.x + (params.nodes_z - 1u - k) * nodes.y;
            for (var n = 0u; n < AHEAD; n += 1u) {
                if n < count {
                    let i = top - n * nodes.y;
                    factors[n] = factors_of(i);
                    load[n] = kept(offset + i);
                    residual[n] = r[offset + i].xyz;
                    before[n] = earlier(offset + i);
                }
            }
            for (var n = 0u; n < AHEAD; n += 1u) {
                if n < count {
                    let own = factors[n];
                    above = own.d * load[n] - own.g * above;
                    gamma += dot(residual[n], take(offset + top - n * nodes.y, above, before[n]));
                }
            }
        }
    }
    let sum_of_group = group_sum(gamma, thread.lane);
    if thread.lane == 0u && column < columns {
        partial_gamma[slot * ((columns + GROUP - 1u) / GROUP) + group_index] = sum_of_group;
    }
}

fn factors_of(i: u32) -> Block {
    return unpack(block[i * 4u], block[i * 4u + 1u], block[i * 4u + 2u], block[i * 4u + 3u]);
}
