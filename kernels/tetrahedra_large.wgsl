// Forces of each hyperelastic tetrahedron at its corners, one right-hand side per dispatch row. Twin: tetrahedra_large.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> corners: array<vec4<u32>>;                 // [tetrahedron] patches of its volume
@group(0) @binding(2) var<storage, read> gradients: array<vec4<f32>>;               // [tetrahedron × 3] see tetrahedra.rs
@group(0) @binding(3) var<storage, read> cofactor: array<vec4<f32>>;                // [tetrahedron × 3] cof F
@group(0) @binding(4) var<storage, read> domains: array<u32>;                       // [tetrahedron × 6]
@group(0) @binding(5) var<storage, read> domain_stress: array<vec4<f32>>;           // [rhs][domain × 3] Pa, a sixth
@group(0) @binding(6) var<storage, read> pressure: array<f32>;                      // [rhs][patch] Pa
@group(0) @binding(7) var<storage, read_write> tetrahedron_force: array<vec4<f32>>; // [rhs][tetrahedron × 3] at corners 1 to 3, N
@group(0) @binding(8) var<storage, read> scalars: array<vec4<f32>>;                 // [rhs × 2] alpha beta gamma done; target² rr iterations state

const EDGES: u32 = 6u;

@compute @workgroup_size(64)
fn tetrahedra_large(thread: Thread) {
    let e = number_of(thread);
    let rhs = params.first_rhs + thread.group.y;
    if e >= params.tetrahedron_count || scalars[rhs * 2u].w != 0.0 { return; }
    let c = corners[e] + rhs * params.node_count;
    let mean = (pressure[c.x] + pressure[c.y] + pressure[c.z] + pressure[c.w]) * 0.25;
    var stress = mat3x3<f32>(cofactor[3u * e].xyz, cofactor[3u * e + 1u].xyz, cofactor[3u * e + 2u].xyz) * mean;
    for (var n = 0u; n < EDGES; n += 1u) {
        let at = 3u * (rhs * params.domain_count + domains[EDGES * e + n]);
        stress += mat3x3<f32>(domain_stress[at].xyz, domain_stress[at + 1u].xyz, domain_stress[at + 2u].xyz);
    }
    let forces = stress * shape_gradients(e) * gradients[3u * e].w;
    let to = 3u * (rhs * params.tetrahedron_count + e);
    for (var n = 0u; n < 3u; n += 1u) { tetrahedron_force[to + n] = vec4<f32>(forces[n], 0.0); }
}
