// Deviatoric stress of each domain of smoothed tetrahedra, one right-hand side per dispatch row. Twin: tetrahedra_domains.rs (formula and units
// there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> gradients: array<vec4<f32>>;           // [tetrahedron × 3] see tetrahedra.rs
@group(0) @binding(2) var<storage, read> first_of_domain: array<u32>;           // [domain + 1] into of_domain
@group(0) @binding(3) var<storage, read> of_domain: array<u32>;                 // 4 × tetrahedron
@group(0) @binding(4) var<storage, read> shear: array<vec2<f32>>;               // [domain] sum of the volumes m³, shear modulus Pa
@group(0) @binding(5) var<storage, read> domain_rotation: array<vec4<f32>>;     // [domain] quaternion
@group(0) @binding(6) var<storage, read> strain: array<vec4<f32>>;              // [rhs][tetrahedron × 3] displacement gradient, volume strain
@group(0) @binding(7) var<storage, read_write> domain_stress: array<vec4<f32>>; // [rhs][domain × 3] Pa
@group(0) @binding(8) var<storage, read> scalars: array<vec4<f32>>;             // [rhs × 2] alpha beta gamma done; target² rr iterations state

@compute @workgroup_size(64)
fn tetrahedra_domains(thread: Thread) {
    let k = number_of(thread);
    let rhs = params.first_rhs + thread.group.y;
    if k >= params.domain_count || scalars[rhs * 2u].w != 0.0 { return; }
    let per_volume = 1.0 / shear[k].x;
    var mean = mat3x3<f32>();
    for (var n = first_of_domain[k]; n < first_of_domain[k + 1u]; n += 1u) {
        let e = of_domain[n] / 4u;
        let at = 3u * (rhs * params.tetrahedron_count + e);
        let weight = gradients[3u * e].w * per_volume;
        mean += mat3x3<f32>(strain[at].xyz, strain[at + 1u].xyz, strain[at + 2u].xyz) * weight;
    }
    let q = domain_rotation[k];
    let stress = rotation_matrix(q) * deviator(mean, q, params.total) * (shear[k].y * (1.0 / 3.0));
    let to = 3u * (rhs * params.domain_count + k);
    for (var n = 0u; n < 3u; n += 1u) { domain_stress[to + n] = vec4<f32>(stress[n], 0.0); }
}
