// Gathers values by index. Twin: gather.rs.
struct PickParams { count: u32, first: u32, pad_0: u32, pad_1: u32 }
@group(0) @binding(0) var<uniform> params: PickParams;
@group(0) @binding(1) var<storage, read> ids: array<u32>;                   // [picked] into source
@group(0) @binding(2) var<storage, read> source: array<vec4<f32>>;          // any
@group(0) @binding(3) var<storage, read_write> picked: array<vec4<f32>>;    // [picked]

@compute @workgroup_size(64)
fn gather(thread: Thread) {
    let k = params.first + number_of(thread);
    if k < params.first + params.count { picked[k] = source[ids[k]]; }
}
