// Hyperelastic cells and their laws, by the code in `material.w`; see hyperelastic.rs (formula and units there).
const MOONEY_RIVLIN: f32 = 1.0;
const HOLZAPFEL: f32 = 2.0;

fn law_energy(own: Cell, p: Point) -> f32 {
    let material = own.material;
    if material.w == MOONEY_RIVLIN { return mooney_rivlin_energy(material.yz, p); }
    if material.w == HOLZAPFEL { return holzapfel_energy(material.y, own.fibres, p); }
    return neo_hookean_energy(material.y, p);
}

fn law_stress(own: Cell, p: Point) -> mat3x3<f32> {
    let material = own.material;
    if material.w == MOONEY_RIVLIN { return mooney_rivlin_stress(material.yz, p); }
    if material.w == HOLZAPFEL { return holzapfel_stress(material.y, own.fibres, p); }
    return neo_hookean_stress(material.y, p);
}

fn law_shear(material: vec4<f32>) -> f32 {
    return select(material.y, 2.0 * (material.y + material.z), material.w == MOONEY_RIVLIN);
}

fn law_tangent(own: Cell, p: Point, change: mat3x3<f32>) -> mat3x3<f32> {
    let material = own.material;
    if material.w == MOONEY_RIVLIN { return mooney_rivlin_tangent(material.yz, p, change); }
    if material.w == HOLZAPFEL { return holzapfel_tangent(material.y, own.fibres, p, change); }
    return neo_hookean_tangent(material.y, p, change);
}

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
