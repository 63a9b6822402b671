// Scatters values by index, or adds them. Twin: scatter.rs.
struct PickParams { count: u32, add: u32, pad_0: u32, pad_1: u32 }
@group(0) @binding(0) var<uniform> params: PickParams;
@group(0) @binding(1) var<storage, read> ids: array<u32>;                       // [entry] into destination, each once
@group(0) @binding(2) var<storage, read> values: array<vec4<f32>>;              // [entry]
@group(0) @binding(3) var<storage, read_write> destination: array<vec4<f32>>;   // any

@compute @workgroup_size(64)
fn scatter(thread: Thread) {
    let k = number_of(thread);
    if k >= params.count { return; }
    let before = select(vec4<f32>(), destination[ids[k]], params.add == 1u);
    destination[ids[k]] = before + values[k];
}
