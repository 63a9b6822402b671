// Rotation of each tetrahedron. Twin: tetrahedra_rotations.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> corners: array<vec4<u32>>;                // [tetrahedron] nodes
@group(0) @binding(2) var<storage, read> gradients: array<vec4<f32>>;              // [tetrahedron × 3] see tetrahedra.rs
@group(0) @binding(3) var<storage, read> u: array<vec4<f32>>;                      // [node] m
@group(0) @binding(4) var<storage, read_write> element_rotation: array<vec4<f32>>; // [tetrahedron] quaternion

@compute @workgroup_size(64)
fn tetrahedra_rotations(thread: Thread) {
    let e = number_of(thread);
    if e >= params.tetrahedron_count { return; }
    let c = corners[e];
    let gradient = displacement_gradient(u[c.x].xyz, u[c.y].xyz, u[c.z].xyz, u[c.w].xyz, shape_gradients(e));
    element_rotation[e] = polar(diagonal(vec3<f32>(1.0)) + gradient, vec4<f32>(0.0, 0.0, 0.0, 1.0));
}
