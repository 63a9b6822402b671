// Scatters values by index. Twin: scatter.rs.
struct PickParams { count: u32, pad_0: u32, pad_1: u32, pad_2: u32 }
@group(0) @binding(0) var<uniform> params: PickParams;
@group(0) @binding(1) var<storage, read> ids: array<u32>;                       // [entry] into destination, each once
@group(0) @binding(2) var<storage, read> values: array<vec4<f32>>;              // [entry]
@group(0) @binding(3) var<storage, read_write> destination: array<vec4<f32>>;   // any

@compute @workgroup_size(64)
fn scatter(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let k = group_of(group, groups) * GROUP + lane;
    if k < params.count { destination[ids[k]] = values[k]; }
}
