// Rotation quaternion that maximises tr(Rᵀ f), starting at `start`; see polar.rs.
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
