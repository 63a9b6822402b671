// Deformation of each hyperelastic tetrahedron. Twin: tetrahedra_deformations.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> corners: array<vec4<u32>>;        // [tetrahedron] nodes
@group(0) @binding(2) var<storage, read> gradients: array<vec4<f32>>;      // [tetrahedron × 3] see tetrahedra.rs
@group(0) @binding(3) var<storage, read> u: array<vec4<f32>>;              // [node] m
@group(0) @binding(4) var<storage, read_write> strain: array<vec4<f32>>;   // [tetrahedron × 3] displacement gradient, J − 1
@group(0) @binding(5) var<storage, read_write> cofactor: array<vec4<f32>>; // [tetrahedron × 3] cof F; volume m³, two zeros

@compute @workgroup_size(64)
fn tetrahedra_deformations(thread: Thread) {
    let e = number_of(thread);
    if e >= params.tetrahedron_count { return; }
    let c = corners[e];
    let point = point_of(displacement_gradient(u[c.x].xyz, u[c.y].xyz, u[c.z].xyz, u[c.w].xyz, shape_gradients(e)));
    strain[3u * e] = vec4<f32>(point.h[0], point.dilatation);
    strain[3u * e + 1u] = vec4<f32>(point.h[1], 0.0);
    strain[3u * e + 2u] = vec4<f32>(point.h[2], 0.0);
    cofactor[3u * e] = vec4<f32>(point.cofactor[0], gradients[3u * e].w);
    cofactor[3u * e + 1u] = vec4<f32>(point.cofactor[1], 0.0);
    cofactor[3u * e + 2u] = vec4<f32>(point.cofactor[2], 0.0);
}
