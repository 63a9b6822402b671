// Change of stress of each domain of hyperelastic tetrahedra, one right-hand side per dispatch row. Twin: tetrahedra_frames.rs (formula and units
// there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> gradients: array<vec4<f32>>;           // [tetrahedron × 3] see tetrahedra.rs
@group(0) @binding(2) var<storage, read> first_of_domain: array<u32>;           // [domain + 1] into of_domain
@group(0) @binding(3) var<storage, read> of_domain: array<u32>;                 // 4 × tetrahedron
@group(0) @binding(4) var<storage, read> domain_rotation: array<vec4<f32>>;     // [domain] quaternion
@group(0) @binding(5) var<storage, read> frame: array<vec4<f32>>;               // [domain] factors a, b, t Pa; 1/volume 1/m³
@group(0) @binding(6) var<storage, read> strain: array<vec4<f32>>;              // [rhs][tetrahedron × 3] change of F
@group(0) @binding(7) var<storage, read_write> domain_stress: array<vec4<f32>>; // [rhs][domain × 3] Pa
@group(0) @binding(8) var<storage, read> scalars: array<vec4<f32>>;             // [rhs × 2] alpha beta gamma done; target² rr iterations state

@compute @workgroup_size(64)
fn tetrahedra_frames(thread: Thread) {
    let k = number_of(thread);
    let rhs = params.first_rhs + thread.group.y;
    if k >= params.domain_count || scalars[rhs * 2u].w != 0.0 { return; }
    let factors = frame[k];
    var mean = mat3x3<f32>();
    for (var n = first_of_domain[k]; n < first_of_domain[k + 1u]; n += 1u) {
        let e = of_domain[n] / 4u;
        let at = 3u * (rhs * params.tetrahedron_count + e);
        let weight = gradients[3u * e].w * factors.w;
        mean += mat3x3<f32>(strain[at].xyz, strain[at + 1u].xyz, strain[at + 2u].xyz) * weight;
    }
    let turn = rotation_matrix(domain_rotation[k]);
    let change = transpose(turn) * mean;
    let even = (change + transpose(change)) * (factors.x * 0.5) + diagonal(vec3<f32>(factors.y * trace(change)));
    let stress = turn * (even + (change - transpose(change)) * (factors.z * 0.5));
    let to = 3u * (rhs * params.domain_count + k);
    for (var n = 0u; n < 3u; n += 1u) { domain_stress[to + n] = vec4<f32>(stress[n], 0.0); }
}
