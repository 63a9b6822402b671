// Table of split nodes, for kernels that bind `params` and `split`. See split.rs.
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

// Grid coordinates of a node, or of a duplicate's original; far outside the grid in an unused extra column.
fn grid_coordinates(p: Params, i: u32) -> vec3<u32> {
    let grid = p.nodes_x * p.nodes_y * p.nodes_z;
    if i < grid { return node_at(p, i); }
    let rest = i - grid;
    let own = bundle(p, rest / p.nodes_z);
    let within = rest - own.x * p.nodes_z;
    let parent = split[own.x + within % own.y];
    if parent == NONE { return vec3<u32>(0x7fffffffu); }
    return vec3<u32>(parent % p.nodes_x, parent / p.nodes_x, within / own.y);
}

// Node above in the same column.
fn above(p: Params, i: u32) -> u32 {
    let columns = p.nodes_x * p.nodes_y;
    if i < columns * p.nodes_z { return i + columns; }
    return i + bundle(p, (i - columns * p.nodes_z) / p.nodes_z).y;
}
