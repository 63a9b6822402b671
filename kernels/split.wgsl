// The table of split nodes, for kernels that bind `params` and `split`. See split.rs.
const NONE: u32 = 0xffffffffu;

fn split_row(p: Params) -> u32 {
    return 2u * p.extra_columns + p.nodes_x * p.nodes_y;
}

// Node at corner `a` of the cell at `at`.
fn corner_node(p: Params, at: vec3<u32>, a: u32) -> u32 {
    if p.extra_columns > 0u {
        let row = split[split_row(p) + cell_id(p, at)];
        if row > 0u { return split[split_row(p) + p.cell_count + p.touched_nodes + (row - 1u) * 8u + a]; }
    }
    return node_id(p, at + corner(a));
}

fn is_split(p: Params, cell: u32) -> bool {
    return p.extra_columns > 0u && split[split_row(p) + cell] != 0u;
}

// Grid coordinates of a node or of what it is a copy of; where there is no copy, far outside of the grid.
fn place(p: Params, i: u32) -> vec3<u32> {
    let columns = p.nodes_x * p.nodes_y;
    let grid = columns * p.nodes_z;
    if i < grid { return node_at(p, i); }
    let parent = split[(i - grid) % p.extra_columns];
    if parent == NONE { return vec3<u32>(0x7fffffffu); }
    return vec3<u32>(parent % p.nodes_x, parent / p.nodes_x, (i - grid) / p.extra_columns);
}

// The node above in the same column.
fn above(p: Params, i: u32) -> u32 {
    let columns = p.nodes_x * p.nodes_y;
    return i + select(p.extra_columns, columns, i < columns * p.nodes_z);
}
