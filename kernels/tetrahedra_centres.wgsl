// Displacements of the centroids of tetrahedra. Twin: tetrahedra_centres.rs (units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> corners: array<vec4<u32>>;       // [tetrahedron] nodes
@group(0) @binding(2) var<storage, read> u: array<vec4<f32>>;             // [node] m
@group(0) @binding(3) var<storage, read_write> point_u: array<vec4<f32>>; // [tetrahedron] m

@compute @workgroup_size(64)
fn tetrahedra_centres(thread: Thread) {
    let e = number_of(thread);
    if e >= params.tetrahedron_count { return; }
    let c = corners[e];
    let sum = u[c.x].xyz + u[c.y].xyz + u[c.z].xyz + u[c.w].xyz;
    point_u[e] = vec4<f32>(sum * 0.25, 0.0);
}
