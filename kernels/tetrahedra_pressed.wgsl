// Pressure of each hyperelastic tetrahedron and the stiffness of its volume. Twin: tetrahedra_pressed.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> corners: array<vec4<u32>>;        // [tetrahedron] patches of its volume
@group(0) @binding(2) var<storage, read> gradients: array<vec4<f32>>;      // [tetrahedron × 3] see tetrahedra.rs
@group(0) @binding(3) var<storage, read> nodal_strain: array<f32>;         // [patch] mean of J − 1
@group(0) @binding(4) var<storage, read_write> strain: array<vec4<f32>>;   // [tetrahedron × 3] first fourth number: pressure Pa
@group(0) @binding(5) var<storage, read_write> cofactor: array<vec4<f32>>; // [tetrahedron × 3] second fourth number: stiffness of the volume Pa

@compute @workgroup_size(64)
fn tetrahedra_pressed(thread: Thread) {
    let e = number_of(thread);
    if e >= params.tetrahedron_count { return; }
    let c = corners[e];
    let mean = (nodal_strain[c.x] + nodal_strain[c.y] + nodal_strain[c.z] + nodal_strain[c.w]) * 0.25;
    let bulk = gradients[3u * e + 1u].w;
    strain[3u * e].w = bulk * volume_pressure(mean);
    cofactor[3u * e + 1u].w = bulk * volume_stiffness(mean);
}
