// One step of the smoother by columns, with r·z. Twin: relax.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> block: array<vec4<f32>>;                // [node × 4] packed D'⁻¹, G
@group(0) @binding(2) var<storage, read> r: array<vec4<f32>>;                    // [rhs][node] N
@group(0) @binding(3) var<storage, read_write> w: array<vec4<f32>>;              // [rhs][node] N, used up
@group(0) @binding(4) var<storage, read_write> d: array<vec4<f32>>;              // [rhs][node] m
@group(0) @binding(5) var<storage, read_write> z: array<vec4<f32>>;              // [rhs][node] m
@group(0) @binding(6) var<storage, read_write> partial_gamma: array<f32>;   // [rhs][group] r·z
@group(0) @binding(7) var<storage, read> scalars: array<vec4<f32>>;              // [rhs × 2]

fn pushed(at: u32) -> vec3<f32> {
    if params.fresh == 1u { return r[at].xyz; }
    return r[at].xyz - w[at].xyz;
}

fn keep(at: u32, y: vec3<f32>) { w[at] = vec4<f32>(y, 0.0); }

fn kept(at: u32) -> vec3<f32> { return w[at].xyz; }

fn take(at: u32, solution: vec3<f32>) -> vec3<f32> {
    var change = solution * params.gain;
    var sum = change;
    if params.fresh == 0u {
        change += d[at].xyz * params.keep;
        sum = z[at].xyz + change;
    }
    d[at] = vec4<f32>(change, 0.0);
    z[at] = vec4<f32>(sum, 0.0);
    return sum;
}

@compute @workgroup_size(64)
fn relax(thread: Thread) {
    solve_columns(thread);
}
