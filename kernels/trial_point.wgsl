// Trial point along Newton's direction. Twin: trial_point.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> u: array<vec4<f32>>;                   // [node] m
@group(0) @binding(2) var<storage, read> dx: array<vec4<f32>>;                  // [node] m
@group(0) @binding(3) var<storage, read> x: array<vec4<f32>>;                   // [node] direction, m
@group(0) @binding(4) var<storage, read> residual_force: array<vec4<f32>>;      // [node] N
@group(0) @binding(5) var<storage, read_write> dx_next: array<vec4<f32>>;       // [node] m
@group(0) @binding(6) var<storage, read_write> displacement: array<vec4<f32>>;  // [node] displacement, m
@group(0) @binding(7) var<storage, read_write> predicted_decrease: array<f32>;  // [group] J

@compute @workgroup_size(64)
fn trial_point(thread: Thread) {
    let block = group_of(thread);
    let i = number_of(thread);
    var part = 0.0;
    if i < params.node_count {
        let moved = dx[i].xyz + x[i].xyz * params.gain;
        dx_next[i] = vec4<f32>(moved, 0.0);
        displacement[i] = vec4<f32>(u[i].xyz + moved * params.stiffness_factor, 0.0);
        part = dot(residual_force[i].xyz, x[i].xyz);
    }
    let sum_of_group = group_sum(part, thread.lane);
    if thread.lane == 0u && i < params.node_count { predicted_decrease[block] = sum_of_group; }
}
