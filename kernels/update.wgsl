// Vector updates of the conjugate gradients. Twin: update.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> scalars: array<vec4<f32>>;     // [slot × 2]
@group(0) @binding(2) var<storage, read> z: array<vec4<f32>>;           // [slot][node] m
@group(0) @binding(3) var<storage, read> w: array<vec4<f32>>;           // [slot][node] N
@group(0) @binding(4) var<storage, read_write> x: array<vec4<f32>>;     // [slot][node] m
@group(0) @binding(5) var<storage, read_write> p: array<vec4<f32>>;     // [slot][node] m
@group(0) @binding(6) var<storage, read_write> s: array<vec4<f32>>;     // [slot][node] N
@group(0) @binding(7) var<storage, read_write> r: array<vec4<f32>>;     // [slot][node] N

@compute @workgroup_size(64)
fn update(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let node = group_of(group, groups) * GROUP + lane;
    let slot = params.first_slot + group.y;
    let head = scalars[slot * 2u];
    if node >= params.node_count || head.w != 0.0 { return; }
    let i = slot * params.node_count + node;
    if scalars[slot * 2u + 1u].w == 1.0 {
        x[i] = z[i];
        r[i] -= w[i];
        return;
    }
    var direction = z[i];
    var change = w[i];
    if head.y != 0.0 {
        direction += head.y * p[i];
        change += head.y * s[i];
    }
    p[i] = direction;
    s[i] = change;
    x[i] += head.x * direction;
    r[i] -= head.x * change;
}
