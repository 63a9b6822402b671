// M⁻¹ by columns, with r·z; see columns.rs (formula and units there). A kernel that includes it binds `block`, `r`, `partial_gamma` and
// `scalars` and has four functions of an index `at` into [rhs][node]: `pushed` gives the load, `keep` and `kept` store and read y, `take`
// turns the solution into the z of r·z.
fn solve_columns(thread: Thread) {
    let group_index = group_of(thread);
    let column = number_of(thread);
    let columns = column_count(params);
    let nodes = column_nodes(params, column);
    let rhs = params.first_rhs + thread.group.y;
    let offset = rhs * params.node_count;
    let running = scalars[rhs * 2u].w == 0.0;
    var gamma = 0.0;
    if running && column < columns {
        var carried = vec3<f32>(0.0); // G_{k−1}ᵀ y_{k−1}
        // forward substitution, bottom to top
        for (var k = 0u; k < params.nodes_z; k += 1u) {
            let i = nodes.x + k * nodes.y;
            let y = pushed(offset + i) - carried;
            keep(offset + i, y);
            carried = y * factors_of(i).g;
        }
        // backward substitution, top to bottom
        var above = vec3<f32>(0.0);
        for (var n = 0u; n < params.nodes_z; n += 1u) {
            let i = nodes.x + (params.nodes_z - 1u - n) * nodes.y;
            let own = factors_of(i);
            above = own.d * kept(offset + i) - own.g * above;
            gamma += dot(r[offset + i].xyz, take(offset + i, above));
        }
    }
    let sum_of_group = group_sum(gamma, thread.lane);
    if thread.lane == 0u && column < columns {
        partial_gamma[rhs * ((columns + GROUP - 1u) / GROUP) + group_index] = sum_of_group;
    }
}

fn factors_of(i: u32) -> Block {
    return unpack(block[i * 4u], block[i * 4u + 1u], block[i * 4u + 2u], block[i * 4u + 3u]);
}
