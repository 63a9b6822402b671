// Rounding errors of 64 sums. Twin: probe.rs (formula there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> cases: array<vec4<f32>>;        // a, b, 0, 0
@group(0) @binding(2) var<storage, read_write> errors: array<f32>;       // [case]

@compute @workgroup_size(64)
fn probe(@builtin(local_invocation_index) i: u32) {
    errors[i] = rounding_error(vec4<f32>(cases[i].x), vec4<f32>(cases[i].y), params.zero).x;
}
