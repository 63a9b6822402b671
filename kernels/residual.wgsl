// Residual at a trial point, and the nodal part of the potential. Twin: residual.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> corner_force: array<f32>;                        // [cell][corner][axis] at the trial point, N
@group(0) @binding(2) var<storage, read> f: array<vec4<f32>>;                             // [node] at the step's start, N
@group(0) @binding(3) var<storage, read> b: array<vec4<f32>>;                             // [node] N
@group(0) @binding(4) var<storage, read> w: array<vec4<f32>>;                             // [node] N
@group(0) @binding(5) var<storage, read> dx: array<vec4<f32>>;                            // [node] m
@group(0) @binding(6) var<storage, read> dofs: array<vec4<f32>>;                          // [node] 1 free, 0 fixed, per axis; mass kg
@group(0) @binding(7) var<storage, read_write> residual_force: array<vec4<f32>>;          // [node] N
@group(0) @binding(8) var<storage, read_write> potential_and_residual: array<vec4<f32>>;  // [group] potential J, squared residual N², work J

@compute @workgroup_size(64)
fn residual(thread: Thread) {
    let block = group_of(thread);
    let i = number_of(thread);
    var part = vec3<f32>(0.0);
    if i < params.node_count {
        let before = f[i].xyz;
        let elastic = collected(i, 0u);
        let left = (b[i].xyz - w[i].xyz - (elastic - before)) * dofs[i].xyz;
        residual_force[i] = vec4<f32>(left, 0.0);
        let pull = w[i].xyz * 0.5 - (b[i].xyz + before);
        part = vec3<f32>(dot(dx[i].xyz, pull), dot(left, left), dot(dx[i].xyz, elastic + left));
    }
    let potential = group_sum(part.x, thread.lane);
    workgroupBarrier(); // nobody reads what the next sum writes
    let squared = group_sum(part.y, thread.lane);
    workgroupBarrier();
    let work = group_sum(part.z, thread.lane);
    if thread.lane == 0u && i < params.node_count {
        potential_and_residual[block] = vec4<f32>(potential, squared, work, 0.0);
    }
}
