// z = M⁻¹ r by columns, with r·z. Twin: precondition.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> block: array<vec4<f32>>;                // [node × 4] packed D'⁻¹, G
@group(0) @binding(2) var<storage, read> r: array<vec4<f32>>;                    // [rhs][node] N
@group(0) @binding(3) var<storage, read_write> z: array<vec4<f32>>;              // [rhs][node] m
@group(0) @binding(4) var<storage, read_write> partial_gamma: array<f32>;   // [rhs][group] r·z
@group(0) @binding(5) var<storage, read> scalars: array<vec4<f32>>;              // [rhs × 2]

fn pushed(at: u32) -> vec3<f32> { return r[at].xyz; }

fn keep(at: u32, y: vec3<f32>) { z[at] = vec4<f32>(y, 0.0); }

fn kept(at: u32) -> vec3<f32> { return z[at].xyz; }

fn take(at: u32, solution: vec3<f32>) -> vec3<f32> {
    z[at] = vec4<f32>(solution, 0.0);
    return solution;
}

@compute @workgroup_size(64)
fn precondition(thread: Thread) {
    solve_columns(thread);
}
