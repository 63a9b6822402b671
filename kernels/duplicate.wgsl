// Copies the values of nodes to their duplicates. Twin: duplicate.rs.
struct DuplicateParams { count: u32, stride: u32, pad_0: u32, pad_1: u32 }
@group(0) @binding(0) var<uniform> params: DuplicateParams;
@group(0) @binding(1) var<storage, read> pairs: array<vec2<u32>>;       // [entry] copy, source
@group(0) @binding(2) var<storage, read_write> values: array<vec4<f32>>; // [rhs][node] any

@compute @workgroup_size(64)
fn duplicate(thread: Thread) {
    let k = number_of(thread);
    if k >= params.count { return; }
    let offset = thread.group.y * params.stride;
    values[offset + pairs[k].x] = values[offset + pairs[k].y];
}
