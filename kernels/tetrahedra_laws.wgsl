// Stress of each domain of hyperelastic tetrahedra, and its linearisation. Twin: tetrahedra_laws.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> gradients: array<vec4<f32>>;           // [tetrahedron × 3] see tetrahedra.rs
@group(0) @binding(2) var<storage, read> first_of_domain: array<u32>;           // [domain + 1] into of_domain
@group(0) @binding(3) var<storage, read> of_domain: array<u32>;                 // 4 × tetrahedron
@group(0) @binding(4) var<storage, read> shear: array<vec2<f32>>;               // [domain] sum of the volumes m³, layer
@group(0) @binding(5) var<uniform> laws: array<vec4<f32>, 21>;                  // [layer] κ, two constants Pa, the law's code
@group(0) @binding(6) var<storage, read> strain: array<vec4<f32>>;              // [tetrahedron × 3] displacement gradient, pressure Pa
@group(0) @binding(7) var<storage, read> domain_rotation: array<vec4<f32>>;     // [domain] quaternion
@group(0) @binding(8) var<storage, read_write> domain_stress: array<vec4<f32>>; // [domain × 3] Pa, a sixth
@group(0) @binding(9) var<storage, read_write> frame: array<vec4<f32>>;         // [domain] factors of sym, tr and skew Pa, a sixth; 1/volume 1/m³

const STIFFENED: u32 = 2u;
const STIFFEST: f32 = 1e6;

@compute @workgroup_size(64)
fn tetrahedra_laws(thread: Thread) {
    let k = number_of(thread);
    if k >= params.domain_count { return; }
    let sixth = 1.0 / 6.0;
    let per_volume = 1.0 / shear[k].x;
    let law = laws[u32(shear[k].y)];
    var mean = mat3x3<f32>();
    var pressure = 0.0;
    for (var n = first_of_domain[k]; n < first_of_domain[k + 1u]; n += 1u) {
        let e = of_domain[n] / 4u;
        let weight = gradients[3u * e].w * per_volume;
        mean += mat3x3<f32>(strain[3u * e].xyz, strain[3u * e + 1u].xyz, strain[3u * e + 2u].xyz) * weight;
        pressure += strain[3u * e].w * weight;
    }
    let point = point_of(mean);
    let found = law_stress(law, Fibres(vec4<f32>(0.0), 0.0, 1.0, 0.0), point);
    let modulus = law_shear(law);
    let stress = found * sixth;
    for (var n = 0u; n < 3u; n += 1u) { domain_stress[3u * k + n] = vec4<f32>(stress[n], 0.0); }
    let f = identity() + point.h;
    var s = 1.0;
    var tension = 0.0;
    if params.corotational == STIFFENED {
        let squared = contracted(f, f);
        var pressed = max(1.0, contracted(point.log_gradient, point.log_gradient) - 2.0);
        if 1.0 + point.dilatation < EXTENDED {
            pressed = max(pressed, 0.5 * (1.0 + log_volume_slope(point.dilatation) * sqrt(squared)));
        }
        pressed = law_stiffening(law, point, pressed);
        let sheared = max(-pressure / (2.0 * modulus), 0.0) * sqrt(max(squared, 3.0) / 3.0);
        s = 1.0 + (min(pressed + sheared, STIFFEST) - 1.0) / params.stiffness_factor;
        let whole = found + point.cofactor * pressure;
        let along = contracted(whole, rotation_matrix(domain_rotation[k]));
        let deviator = max(contracted(whole, whole) - along * along / 3.0, 0.0);
        tension = max(along / 3.0 + sqrt(deviator / 6.0), 0.0) / params.stiffness_factor;
    }
    frame[k] = vec4<f32>(2.0 * modulus * s * sixth, law_of_trace(law) * modulus * s * sixth, tension * sixth, per_volume);
}
