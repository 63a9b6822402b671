// Energy and forces of hyperelastic cells. Twin: hyperelastic_forces.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> shape: array<vec4<f32>, 21>;             // [layer] cell edges m, mass of one corner kg
@group(0) @binding(2) var<uniform> material: array<vec4<f32>, 21>;          // [layer] κ, two constants Pa, the law's code
@group(0) @binding(3) var<storage, read> layer_of: array<u32>;              // [cells_z] layer
@group(0) @binding(4) var<storage, read> place: array<vec4<f32>>;           // [node] displacement, m
@group(0) @binding(5) var<storage, read_write> corner_force: array<f32>;    // [cell][corner][axis] N
@group(0) @binding(6) var<storage, read_write> energy: array<f32>;          // [cell] J

const INSIDE_OUT: f32 = 1e38;

@compute @workgroup_size(64)
fn hyperelastic_forces(thread: Thread) {
    let cell = number_of(thread);
    if cell >= params.cell_count { return; }
    let own = cell_of(cell);
    let u = at_corners(own);
    var force: array<vec3<f32>, 8>;
    var growing: array<vec3<f32>, 8>;
    var growths = 0.0;
    var sum = 0.0;
    var inside_out = false;
    for (var p = 0u; p < 8u; p += 1u) {
        let point = point_of(field_gradient(own.inverse_edges, u, p));
        inside_out = inside_out || point.growth <= -1.0;
        growths += point.growth;
        sum += law_energy(own.material, point);
        let pushed = point.back * (own.weight * (1.0 + point.growth));
        let stress = law_stress(own.material, point) * own.weight;
        for (var a = 0u; a < 8u; a += 1u) {
            let gradient = shape_gradient(own.inverse_edges, a, p);
            growing[a] += pushed * gradient;
            force[a] += stress * gradient;
        }
    }
    let mean = growths * 0.125;
    let log_mean = logarithm(mean).x;
    let pressure = own.material.x * log_mean / (1.0 + mean);
    energy[cell] = select(own.weight * (sum + 4.0 * own.material.x * log_mean * log_mean), INSIDE_OUT, inside_out);
    for (var a = 0u; a < 8u; a += 1u) {
        let out = select(force[a] + growing[a] * pressure, vec3<f32>(0.0), inside_out);
        for (var n = 0u; n < 3u; n += 1u) { corner_force[cell * 24u + a * 3u + n] = out[n]; }
    }
}
