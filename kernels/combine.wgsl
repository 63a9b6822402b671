// First guess of the contact correction from the columns. Twin: combine.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> coefficient: array<f32>;        // [slot]
@group(0) @binding(2) var<storage, read_write> x: array<vec4<f32>>;      // [slot][node]

@compute @workgroup_size(64)
fn combine(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = group_of(group, groups) * GROUP + lane;
    if i >= params.node_count { return; }
    var sum = vec3<f32>(0.0);
    for (var slot = 1u; slot < params.slot_count; slot += 1u) {
        let c = coefficient[slot];
        if c != 0.0 { sum += c * x[slot * params.node_count + i].xyz; }
    }
    x[params.node_count + i] = vec4<f32>(sum, 0.0);
}
