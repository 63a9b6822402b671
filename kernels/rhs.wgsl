// Right-hand side of the unconstrained motion, and its load. Twin: rhs.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> f: array<vec4<f32>>;             // [node] N
@group(0) @binding(2) var<storage, read> v: array<vec4<f32>>;             // [node] m/s
@group(0) @binding(3) var<storage, read> dofs: array<vec4<f32>>;          // [node] 1 free, 0 fixed, per axis; mass kg
@group(0) @binding(4) var<storage, read> load: array<vec4<f32>>;          // [node] N
@group(0) @binding(5) var<storage, read_write> b: array<vec4<f32>>;       // [rhs][node] N
@group(0) @binding(6) var<storage, read_write> partial_load: array<f32>;  // [group] N²

@compute @workgroup_size(64)
fn rhs(thread: Thread) {
    let block = group_of(thread);
    let i = number_of(thread);
    var load_squared = 0.0;
    if i < params.node_count {
        let g = vec3<f32>(params.gravity_x, params.gravity_y, params.gravity_z);
        let mass = dofs[i].w;
        let axes = dofs[i].xyz;
        let elastic = f[i].xyz;
        let applied = load[i].xyz + g * mass;
        let rate = mass * params.momentum_factor / params.step;
        let sum = (applied - elastic + v[i].xyz * rate) * axes;
        b[i] = vec4<f32>(sum, 0.0);
        let pushed = applied * axes;
        let reaction = elastic - elastic * axes;
        load_squared = dot(sum, sum) + dot(pushed, pushed) + dot(reaction, reaction);
    }
    let sum_of_group = group_sum(load_squared, thread.lane);
    if thread.lane == 0u && i < params.node_count { partial_load[block] = sum_of_group; }
}
