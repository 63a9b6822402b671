// Products of the cells' tangents with a field, one right-hand side per dispatch row. Twin: hyperelastic_tangent.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> shape: array<vec4<f32>, 21>;             // [layer] cell edges m, mass of one corner kg
@group(0) @binding(2) var<uniform> material: array<vec4<f32>, 21>;          // [layer] κ, two constants Pa, the law's code
@group(0) @binding(3) var<storage, read> layer_of: array<u32>;              // [cells_z] layer
@group(0) @binding(4) var<storage, read> displacement: array<vec4<f32>>;           // [node] displacement, m
@group(0) @binding(5) var<storage, read> z: array<vec4<f32>>;               // [rhs][node] m
@group(0) @binding(6) var<storage, read_write> corner_force: array<f32>;    // [rhs][cell][corner][axis] N
@group(0) @binding(7) var<storage, read> scalars: array<vec4<f32>>;         // [rhs × 2] alpha beta gamma done; target² rr iterations state
@group(0) @binding(8) var<uniform> pre_strain: array<vec4<f32>, 21>;       // [layer] elastic strain at rest along x, y, z
@group(0) @binding(9) var<uniform> fibres: array<vec4<f32>, 42>;          // [layer × 2] directions; k₂, κ
@group(0) @binding(10) var<storage, read> scale: array<f32>;               // [cell] factor on the layer's stiffness, or one for all

@compute @workgroup_size(64)
fn hyperelastic_tangent(thread: Thread) {
    let cell = number_of(thread);
    let rhs = params.first_rhs + thread.group.y;
    if cell >= params.cell_count || scalars[rhs * 2u].w != 0.0 { return; }
    let own = cell_of(cell);
    let times = scale[min(cell, arrayLength(&scale) - 1u)];
    let u = at_corners(own);
    var field: array<vec3<f32>, 8>;
    for (var a = 0u; a < 8u; a += 1u) {
        field[a] = z[rhs * params.node_count + node_id(params, own.at + corner(a))].xyz;
    }
    // the pressure depends on all points, and each point needs it
    var dilatations = 0.0;
    for (var p = 0u; p < 8u; p += 1u) { dilatations += cell_point(own, u, p).dilatation; }
    let mean = dilatations * 0.125;
    let pressure = own.material.x * log_volume(mean).x * log_volume_slope(mean);
    var force: array<vec3<f32>, 8>;
    var volume_gradient: array<vec3<f32>, 8>;
    var volume = 0.0;
    var inverted = false;
    for (var p = 0u; p < 8u; p += 1u) {
        let point = cell_point(own, u, p);
        inverted = inverted || is_inverted(point);
        let change = field_gradient(own.inverse_edges, field, p);
        let log_gradient = point.log_gradient;
        let jacobian = 1.0 + point.dilatation;
        let relative_change = dot(log_gradient[0], change[0]) + dot(log_gradient[1], change[1]) + dot(log_gradient[2], change[2]);
        let kirchhoff_pressure = pressure * jacobian;
        volume += own.weight * jacobian * relative_change;
        let crossed = log_gradient * transpose(change) * log_gradient;
        let stress = (law_tangent(own.material, own.fibres, point, change)
            - crossed * kirchhoff_pressure + log_gradient * (kirchhoff_pressure * relative_change)) * own.weight;
        let pushed = point.cofactor * own.weight;
        for (var a = 0u; a < 8u; a += 1u) {
            let gradient = shape_gradient(own.inverse_edges, a, p);
            volume_gradient[a] += pushed * gradient;
            force[a] += stress * gradient;
        }
    }
    let pressure_change = own.material.x * log_volume_stiffness(mean) / (8.0 * own.weight) * volume;
    let first = (rhs * params.cell_count + cell) * 24u;
    for (var a = 0u; a < 8u; a += 1u) {
        let out = select(force[a] + volume_gradient[a] * pressure_change, vec3<f32>(0.0), inverted);
        for (var n = 0u; n < 3u; n += 1u) { corner_force[first + a * 3u + n] = out[n] * times; }
    }
}
