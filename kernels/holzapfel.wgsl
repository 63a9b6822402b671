// The Holzapfel–Gasser–Ogden law at a Gauss point; see holzapfel.rs (formula and units there).
const MOST_EXPONENT: f32 = 16.0;

// Two families of fibres: unit vectors along x and y, k₁ Pa, k₂, κ.
struct Fibres { directions: vec4<f32>, stiffness: f32, growth: f32, dispersion: f32 }

struct Family { structure: mat3x3<f32>, energy: f32, slope: f32, curvature: f32 }

fn family_of(fibres: Fibres, strain: mat3x3<f32>, family: u32) -> Family {
    let a = vec3<f32>(select(fibres.directions.xy, fibres.directions.zw, family == 1u), 0.0);
    let along = 1.0 - 3.0 * fibres.dispersion;
    let structure = identity() * fibres.dispersion + outer(a, a) * along;
    let stretched = contracted(structure, strain);
    if stretched <= 0.0 { return Family(structure, 0.0, 0.0, 0.0); }
    let within = min(stretched, sqrt(MOST_EXPONENT / fibres.growth));
    let exponent = fibres.growth * within * within;
    let grown = exponential(exponent);
    let slope = fibres.stiffness * within * (1.0 + grown);
    let curvature = fibres.stiffness * (1.0 + grown) * (1.0 + 2.0 * exponent);
    let beyond = stretched - within;
    let energy = fibres.stiffness / (2.0 * fibres.growth) * grown + (slope + 0.5 * curvature * beyond) * beyond;
    return Family(structure, energy, slope + curvature * beyond, curvature);
}

fn holzapfel_energy(mu: f32, fibres: Fibres, p: Point) -> f32 {
    let e = green(p);
    return neo_hookean_energy(mu, p) + family_of(fibres, e, 0u).energy + family_of(fibres, e, 1u).energy;
}

fn holzapfel_stress(mu: f32, fibres: Fibres, p: Point) -> mat3x3<f32> {
    let e = green(p);
    let f = identity() + p.h;
    let first = family_of(fibres, e, 0u);
    let second = family_of(fibres, e, 1u);
    return neo_hookean_stress(mu, p) + f * (first.structure * (2.0 * first.slope) + second.structure * (2.0 * second.slope));
}

fn holzapfel_tangent(mu: f32, fibres: Fibres, p: Point, change: mat3x3<f32>) -> mat3x3<f32> {
    let e = green(p);
    let f = identity() + p.h;
    var sum = neo_hookean_tangent(mu, p, change);
    for (var n = 0u; n < 2u; n += 1u) {
        let own = family_of(fibres, e, n);
        let pull = f * own.structure;
        sum += change * own.structure * (2.0 * own.slope) + pull * (4.0 * own.curvature * contracted(pull, change));
    }
    return sum;
}

fn holzapfel_stiffening(mu: f32, fibres: Fibres, p: Point) -> f32 {
    let e = green(p);
    var sum = 0.0;
    for (var n = 0u; n < 2u; n += 1u) {
        let own = family_of(fibres, e, n);
        if own.slope > 0.0 {
            let stretched = e * own.structure * 0.5;
            let grown = contracted(stretched, own.structure) / contracted(own.structure, own.structure);
            let turned = stretched - own.structure * grown;
            let stiffer = own.curvature * (1.0 + grown) * (1.0 + grown) / fibres.stiffness - 1.0;
            sum += max(stiffer, 0.0) + (own.slope * (1.0 - 2.0 * fibres.dispersion) + 2.0 * own.curvature * contracted(turned, turned)) / mu;
        }
    }
    return sum;
}
