// Energy and forces of hyperelastic cells. Twin: hyperelastic_forces.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> shape: array<vec4<f32>, 21>;             // [layer] cell edges m, mass of one corner kg
@group(0) @binding(2) var<uniform> material: array<vec4<f32>, 21>;          // [layer] κ, two constants Pa, the law's code
@group(0) @binding(3) var<storage, read> layer_of: array<u32>;              // [cells_z] layer
@group(0) @binding(4) var<storage, read> displacement: array<vec4<f32>>;    // [node] displacement, m
@group(0) @binding(5) var<storage, read_write> corner_force: array<f32>;    // [cell][corner][axis] N
@group(0) @binding(6) var<storage, read_write> energy: array<f32>;          // [cell] J
@group(0) @binding(7) var<storage, read> split: array<u32>;                 // see split.rs
@group(0) @binding(8) var<storage, read_write> rotation: array<vec4<f32>>;  // [cell] quaternion, 0 of a dead cell; [cell × 3] y, p
@group(0) @binding(9) var<uniform> pre_strain: array<vec4<f32>, 21>;       // [layer] elastic strain at rest along x, y, z
@group(0) @binding(10) var<uniform> fibres: array<vec4<f32>, 42>;          // [layer × 2] directions; k₂, κ
@group(0) @binding(11) var<storage, read> scale: array<f32>;               // [cell] factor on the layer's stiffness, or one for all

const INVERTED_ENERGY: f32 = 1e38;
const STIFFENED: u32 = 2u;
const STIFFEST: f32 = 1e6;

// Of the mean stress in the cell's frame, Pa.
fn largest_tension(own: Cell, turn: mat3x3<f32>, force: array<vec3<f32>, 8>) -> f32 {
    var mean = mat3x3<f32>();
    for (var a = 0u; a < 8u; a += 1u) {
        for (var n = 0u; n < 3u; n += 1u) { mean[n] += select(force[a], -force[a], corner(a)[n] == 0u); }
    }
    for (var n = 0u; n < 3u; n += 1u) { mean[n] *= 0.0625 / (own.weight * own.inverse_edges[n]); }
    let trace = contracted(mean, turn);
    let deviator = max(contracted(mean, mean) - trace * trace / 3.0, 0.0);
    return max(trace / 3.0 + sqrt(deviator / 6.0), 0.0);
}

@compute @workgroup_size(64)
fn hyperelastic_forces(thread: Thread) {
    let cell = number_of(thread);
    if cell >= params.cell_count { return; }
    if all(rotation[cell] == vec4<f32>(0.0)) {
        energy[cell] = 0.0;
        for (var n = 0u; n < 24u; n += 1u) { corner_force[cell * 24u + n] = 0.0; }
        return;
    }
    let own = cell_of(cell);
    let times = scale[min(cell, arrayLength(&scale) - 1u)];
    var u: array<vec3<f32>, 8>;
    for (var a = 0u; a < 8u; a += 1u) { u[a] = displacement[corner_node(params, own.at, a)].xyz; }
    var force: array<vec3<f32>, 8>;
    var volume_gradient: array<vec3<f32>, 8>;
    var dilatations = 0.0;
    var sum = 0.0;
    var inverted = false;
    var pressed = 1.0; // the parts of the stiffening: largest of the Gauss points
    var first_cofactor = mat3x3<f32>();
    var beyond = mat3x3<f32>();
    var squares = 0.0;
    var longest = 3.0;
    var fibrous = 0.0;
    for (var p = 0u; p < 8u; p += 1u) {
        let point = cell_point(own, u, p);
        inverted = inverted || is_inverted(point);
        dilatations += point.dilatation;
        sum += law_energy(own.material, own.fibres, point);
        if params.corotational == STIFFENED {
            let f = identity() + point.h;
            let squared = contracted(f, f);
            let flat = 0.5 * (1.0 + log_volume_slope(point.dilatation) * sqrt(squared));
            let volume = max(1.0, contracted(point.log_gradient, point.log_gradient) - 2.0);
            let g = max(volume, select(0.0, flat, 1.0 + point.dilatation < EXTENDED));
            pressed = max(pressed, law_stiffening(own.material, point, g));
            longest = max(longest, squared);
            if p == 0u { first_cofactor = point.cofactor; }
            let more = point.cofactor - first_cofactor;
            beyond += more;
            squares += contracted(more, more);
            if own.material.w == HOLZAPFEL { fibrous = max(fibrous, holzapfel_stiffening(own.material.y, own.fibres, point)); }
        }
        let pushed = point.cofactor * own.weight;
        let stress = law_stress(own.material, own.fibres, point) * own.weight;
        for (var a = 0u; a < 8u; a += 1u) {
            let gradient = shape_gradient(own.inverse_edges, a, p);
            volume_gradient[a] += pushed * gradient;
            force[a] += stress * gradient;
        }
    }
    let mean = dilatations * 0.125;
    let log_mean = log_volume(mean).x;
    let pressure = own.material.x * log_mean * log_volume_slope(mean);
    energy[cell] = select(own.weight * (sum + 4.0 * own.material.x * log_mean * log_mean) * times, INVERTED_ENERGY, inverted);
    for (var a = 0u; a < 8u; a += 1u) { force[a] += volume_gradient[a] * pressure; }
    var factor = 1.0;
    var tension = vec3<f32>(0.0);
    if params.corotational == STIFFENED {
        let shear = law_shear(own.material);
        let uneven = max(squares - 0.125 * contracted(beyond, beyond), 0.0);
        let volume = own.material.x / (24.0 * shear) * volume_stiffness(mean) * uneven;
        let sheared = max(-pressure / (2.0 * shear), 0.0) * sqrt(longest / 3.0);
        let stretch = 1.0 + own.pre_strain;
        let strained = stretch * stretch / (stretch.x * stretch.y * stretch.z);
        let most = max(max(strained.x, strained.y), max(strained.z, 1.0));
        let s = min((pressed + volume + sheared + fibrous) * most, STIFFEST);
        factor = 1.0 + (s - 1.0) / params.stiffness_factor;
        let most_drawn = largest_tension(own, rotation_matrix(rotation[cell]), force) / params.stiffness_factor;
        tension = own.inverse_edges * (0.25 * sqrt(8.0 * own.weight * most_drawn / factor));
    }
    if params.corotational >= HYPERELASTIC {
        let bulk = own.material.x * volume_stiffness(mean);
        let scale = 0.125 * sqrt(bulk / (8.0 * own.weight * factor));
        let r = rotation_matrix(rotation[cell]);
        for (var n = 0u; n < 3u; n += 1u) {
            var row = vec3<f32>(0.0);
            for (var a = 0u; a < 8u; a += 1u) {
                row += select(-volume_gradient[a], volume_gradient[a], corner(a)[n] == 0u);
            }
            rotation[params.cell_count + 3u * cell + n] = vec4<f32>((row * r) * scale, tension[n]);
        }
        rotation[cell] = rotation[cell] * (sqrt(sqrt(factor)) * sqrt(sqrt(times)));
    }
    for (var a = 0u; a < 8u; a += 1u) {
        for (var n = 0u; n < 3u; n += 1u) { corner_force[cell * 24u + a * 3u + n] = force[a][n] * times; }
    }
}
