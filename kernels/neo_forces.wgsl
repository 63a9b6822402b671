// Energy and forces of neo-Hookean cells. Twin: neo_forces.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> shape: array<vec4<f32>, 21>;             // [layer] cell edges m, mass of one corner kg
@group(0) @binding(2) var<uniform> lame: array<vec4<f32>, 21>;              // [layer] λ, μ Pa
@group(0) @binding(3) var<storage, read> layer_of: array<u32>;              // [cells_z] layer
@group(0) @binding(4) var<storage, read> place: array<vec4<f32>>;           // [node] displacement, m
@group(0) @binding(5) var<storage, read_write> corner_force: array<f32>;    // [cell][corner][axis] N
@group(0) @binding(6) var<storage, read_write> energy: array<f32>;          // [cell] J

const INSIDE_OUT: f32 = 1e38;

@compute @workgroup_size(64)
fn neo_forces(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let cell = group_of(group, groups) * GROUP + lane;
    if cell >= params.cell_count { return; }
    let at = vec3<u32>(
        cell % params.cells_x, (cell / params.cells_x) % params.cells_y, cell / (params.cells_x * params.cells_y),
    );
    let layer = layer_of[at.z];
    let edges = shape[layer].xyz;
    let inverse_edges = 1.0 / edges;
    let lambda = lame[layer].x;
    let mu = lame[layer].y;
    let weight = edges.x * edges.y * edges.z * 0.125;
    var u: array<vec3<f32>, 8>;
    for (var a = 0u; a < 8u; a += 1u) { u[a] = place[node_id(params, at + corner(a))].xyz; }
    var force: array<vec3<f32>, 8>;
    var growing: array<vec3<f32>, 8>;
    var growths = 0.0;
    var sum = 0.0;
    var inside_out = false;
    for (var p = 0u; p < 8u; p += 1u) {
        let point = point_of(field_gradient(inverse_edges, u, p));
        inside_out = inside_out || point.growth <= -1.0;
        growths += point.growth;
        let h = point.h;
        let squares = dot(h[0], h[0]) + dot(h[1], h[1]) + dot(h[2], h[2]);
        sum += squares - 2.0 * point.bend + 2.0 * logarithm(point.growth).y;
        let pushed = point.back * (weight * (1.0 + point.growth));
        let stress = (h + (identity() - point.back)) * (weight * mu);
        for (var a = 0u; a < 8u; a += 1u) {
            let gradient = shape_gradient(inverse_edges, a, p);
            growing[a] += pushed * gradient;
            force[a] += stress * gradient;
        }
    }
    let mean = growths * 0.125;
    let log_mean = logarithm(mean).x;
    let pressure = lambda * log_mean / (1.0 + mean);
    energy[cell] = select(weight * (0.5 * mu * sum + 4.0 * lambda * log_mean * log_mean), INSIDE_OUT, inside_out);
    for (var a = 0u; a < 8u; a += 1u) {
        let out = select(force[a] + growing[a] * pressure, vec3<f32>(0.0), inside_out);
        for (var n = 0u; n < 3u; n += 1u) { corner_force[cell * 24u + a * 3u + n] = out[n]; }
    }
}
