// Rotation of each cell. Twin: rotations.rs (formula and units there).
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> shape: array<vec4<f32>, 21>;          // [layer] cell edges m, mass of one corner kg
@group(0) @binding(2) var<storage, read> layer_of: array<u32>;           // [cells_z] layer
@group(0) @binding(3) var<storage, read> u: array<vec4<f32>>;            // [node] m
@group(0) @binding(4) var<storage, read_write> rotation: array<vec4<f32>>; // [cell] quaternion
@group(0) @binding(5) var<storage, read> split: array<u32>;              // see split.rs

const MAX_NEWTON: u32 = 64u;
const EPSILON: f32 = 1.1920929e-7;

fn polar(f: mat3x3<f32>, start: vec4<f32>) -> vec4<f32> {
    var q = start;
    for (var n = 0u; n < MAX_NEWTON; n += 1u) {
        let s = transpose(rotation_matrix(q)) * f;
        let axial = vec3<f32>(s[1].z - s[2].y, s[2].x - s[0].z, s[0].y - s[1].x);
        let t = s[0].x + s[1].y + s[2].z;
        let xy = -0.5 * (s[0].y + s[1].x);
        let xz = -0.5 * (s[0].z + s[2].x);
        let yz = -0.5 * (s[1].z + s[2].y);
        let hessian = mat3x3<f32>(
            vec3<f32>(t - s[0].x, xy, xz),
            vec3<f32>(xy, t - s[1].y, yz),
            vec3<f32>(xz, yz, t - s[2].z),
        );
        let size = sqrt(dot(s[0], s[0]) + dot(s[1], s[1]) + dot(s[2], s[2]));
        let tiny = 1e-6 * size;
        let hx = hessian[0].x; let hy = hessian[1].y; let hz = hessian[2].z;
        let minor = hx * hy - xy * xy;
        let determinant = dot(hessian[0], cross(hessian[1], hessian[2]));
        let definite = hx > tiny && minor > tiny * tiny && determinant > tiny * tiny * tiny;
        // 1.1 |S| I − sym S is positive definite for any S and gives an ascent direction
        let shift = select(1.1 * size + 1e-6 - t, 0.0, definite);
        var omega = inverse(hessian + diagonal(vec3<f32>(shift))) * axial;
        if !definite && dot(axial, axial) < tiny * tiny {
            if hx <= hy && hx <= hz {
                omega = vec3<f32>(0.5, 0.0, 0.0);
            } else if hy <= hz {
                omega = vec3<f32>(0.0, 0.5, 0.0);
            } else {
                omega = vec3<f32>(0.0, 0.0, 0.5);
            }
        }
        let squared = dot(omega, omega);
        if squared > 1.0 {
            omega = omega * (1.0 / sqrt(squared));
        }
        let half = omega * 0.5;
        let turned = vec4<f32>(half * q.w + q.xyz + cross(q.xyz, half), q.w - dot(q.xyz, half));
        q = turned * (1.0 / sqrt(dot(turned, turned)));
        if squared < EPSILON { break; }
    }
    return q;
}

@compute @workgroup_size(64)
fn rotations(thread: Thread) {
    let cell = number_of(thread);
    if cell >= params.cell_count { return; }
    let q = rotation[cell];
    if all(q == vec4<f32>(0.0)) { return; }
    let at = cell_at(params, cell);
    let g = vec3<f32>(0.25) / shape[layer_of[at.z]].xyz;
    var f = mat3x3<f32>(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
    for (var a = 0u; a < 8u; a += 1u) {
        let o = corner(a);
        let gradient = (vec3<f32>(o) * 2.0 - 1.0) * g;
        let d = u[corner_node(params, at, a)].xyz;
        f += mat3x3<f32>(d * gradient.x, d * gradient.y, d * gradient.z);
    }
    rotation[cell] = polar(f, q);
}
