// Laws of hyperelastic cells by the code in `material.w`; see hyperelastic.rs (formula and units there).
const MOONEY_RIVLIN: f32 = 1.0;

fn law_energy(material: vec4<f32>, p: Point) -> f32 {
    if material.w == MOONEY_RIVLIN { return mooney_rivlin_energy(material.yz, p); }
    return neo_hookean_energy(material.y, p);
}

fn law_stress(material: vec4<f32>, p: Point) -> mat3x3<f32> {
    if material.w == MOONEY_RIVLIN { return mooney_rivlin_stress(material.yz, p); }
    return neo_hookean_stress(material.y, p);
}

fn law_tangent(material: vec4<f32>, p: Point, change: mat3x3<f32>) -> mat3x3<f32> {
    if material.w == MOONEY_RIVLIN { return mooney_rivlin_tangent(material.yz, p, change); }
    return neo_hookean_tangent(material.y, p, change);
}
