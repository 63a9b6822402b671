// Hyperelastic cells; see hyperelastic_cells.rs, hyperelastic.rs (formula and units there).

// A cell, with what it needs of its layer.
struct Cell {
    at: vec3<u32>, // of the grid
    material: vec4<f32>, // κ, two constants Pa, the law's code
    fibres: Fibres,
    pre_strain: vec3<f32>,
    inverse_edges: vec3<f32>, // of the stress-free cell, 1/m
    weight: f32, // of a Gauss point, m³
}

fn cell_of(cell: u32) -> Cell {
    let at = cell_at(params, cell);
    let layer = layer_of[at.z];
    let e = pre_strain[layer].xyz;
    let inverse = (1.0 + e) / shape[layer].xyz;
    let own = fibres[2u * layer + 1u];
    let families = Fibres(fibres[2u * layer], material[layer].z, own.x, own.y);
    return Cell(at, material[layer], families, e, inverse, 0.125 / (inverse.x * inverse.y * inverse.z));
}

// Deformation at Gauss point `p` of a cell with these displacements of its corners.
fn cell_point(cell: Cell, u: array<vec3<f32>, 8>, p: u32) -> Point {
    return point_of(diagonal(cell.pre_strain) + field_gradient(cell.inverse_edges, u, p));
}

// Displacements of a cell's corners, m.
fn at_corners(cell: Cell) -> array<vec3<f32>, 8> {
    var u: array<vec3<f32>, 8>;
    for (var a = 0u; a < 8u; a += 1u) { u[a] = displacement[node_id(params, cell.at + corner(a))].xyz; }
    return u;
}
