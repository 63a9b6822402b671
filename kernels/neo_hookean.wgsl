// The neo-Hookean law at a Gauss point; see neo_hookean.rs (formula and units there).
fn neo_hookean_energy(mu: f32, p: Point) -> f32 {
    let squares = dot(p.h[0], p.h[0]) + dot(p.h[1], p.h[1]) + dot(p.h[2], p.h[2]);
    return 0.5 * mu * (squares - 2.0 * p.second_order + 2.0 * log_volume(p.dilatation).y);
}

fn neo_hookean_stress(mu: f32, p: Point) -> mat3x3<f32> {
    return (p.h + p.complement) * mu;
}

fn neo_hookean_tangent(mu: f32, p: Point, change: mat3x3<f32>) -> mat3x3<f32> {
    return (change + p.log_gradient * transpose(change) * p.log_gradient) * mu;
}
