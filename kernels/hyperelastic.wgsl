// Hyperelastic laws, by the code in `material.w`; see hyperelastic.rs (formula and units there).
const MOONEY_RIVLIN: f32 = 1.0;
const HOLZAPFEL: f32 = 2.0;

fn law_energy(material: vec4<f32>, fibres_of: Fibres, p: Point) -> f32 {
    if material.w == MOONEY_RIVLIN { return mooney_rivlin_energy(material.yz, p); }
    if material.w == HOLZAPFEL { return holzapfel_energy(material.y, fibres_of, p); }
    return neo_hookean_energy(material.y, p);
}

fn law_stress(material: vec4<f32>, fibres_of: Fibres, p: Point) -> mat3x3<f32> {
    if material.w == MOONEY_RIVLIN { return mooney_rivlin_stress(material.yz, p); }
    if material.w == HOLZAPFEL { return holzapfel_stress(material.y, fibres_of, p); }
    return neo_hookean_stress(material.y, p);
}

fn law_shear(material: vec4<f32>) -> f32 {
    return select(material.y, 2.0 * (material.y + material.z), material.w == MOONEY_RIVLIN);
}

fn law_stiffening(material: vec4<f32>, p: Point, g: f32) -> f32 {
    if material.w == MOONEY_RIVLIN { return mooney_rivlin_stiffening(material.yz, p, g); }
    return g;
}

fn law_tangent(material: vec4<f32>, fibres_of: Fibres, p: Point, change: mat3x3<f32>) -> mat3x3<f32> {
    if material.w == MOONEY_RIVLIN { return mooney_rivlin_tangent(material.yz, p, change); }
    if material.w == HOLZAPFEL { return holzapfel_tangent(material.y, fibres_of, p, change); }
    return neo_hookean_tangent(material.y, p, change);
}

// Factor of the shear modulus on tr ε 1 at small strain.
fn law_of_trace(material: vec4<f32>) -> f32 { return select(0.0, -2.0 / 3.0, material.w == MOONEY_RIVLIN); }
