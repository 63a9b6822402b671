// Rotation of each domain or node, from a mean over tetrahedra. Twin: tetrahedra_means.rs (formula and units there).
struct MeanParams { count: u32, pad_0: u32, pad_1: u32, pad_2: u32 }
@group(0) @binding(0) var<uniform> params: MeanParams;
@group(0) @binding(1) var<storage, read> gradients: array<vec4<f32>>;           // [tetrahedron × 3] see tetrahedra.rs
@group(0) @binding(2) var<storage, read> first: array<u32>;                     // [list + 1] into members
@group(0) @binding(3) var<storage, read> members: array<u32>;                   // 4 × tetrahedron, and a corner or 0
@group(0) @binding(4) var<storage, read> strain: array<vec4<f32>>;              // [tetrahedron × 3] displacement gradient
@group(0) @binding(5) var<storage, read_write> mean_rotation: array<vec4<f32>>; // [list] quaternion

@compute @workgroup_size(64)
fn tetrahedra_means(thread: Thread) {
    let k = number_of(thread);
    if k >= params.count { return; }
    var volume = 0.0;
    var sum = mat3x3<f32>();
    for (var n = first[k]; n < first[k + 1u]; n += 1u) {
        let e = members[n] / 4u;
        let own = gradients[3u * e].w;
        volume += own;
        sum += mat3x3<f32>(strain[3u * e].xyz, strain[3u * e + 1u].xyz, strain[3u * e + 2u].xyz) * own;
    }
    var per_volume = 0.0;
    if volume > 0.0 { per_volume = 1.0 / volume; }
    mean_rotation[k] = polar(diagonal(vec3<f32>(1.0)) + sum * per_volume, vec4<f32>(0.0, 0.0, 0.0, 1.0));
}
