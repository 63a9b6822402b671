// Strains of tetrahedra; see tetrahedra.rs.
fn displacement_gradient(u0: vec3<f32>, u1: vec3<f32>, u2: vec3<f32>, u3: vec3<f32>, g: mat3x3<f32>) -> mat3x3<f32> {
    return outer(u1 - u0, g[0]) + outer(u2 - u0, g[1]) + outer(u3 - u0, g[2]);
}

fn trace(m: mat3x3<f32>) -> f32 {
    return m[0].x + m[1].y + m[2].z;
}

fn deviator(gradient: mat3x3<f32>, q: vec4<f32>, total: u32) -> mat3x3<f32> {
    var a = transpose(rotation_matrix(q)) * gradient;
    if total == 1u { a += transpose(rotation_minus_identity(q)); }
    let strain = (a + transpose(a)) * 0.5;
    return strain - diagonal(vec3<f32>(trace(strain) * (1.0 / 3.0)));
}

fn volume_strain(gradient: mat3x3<f32>, q: vec4<f32>, total: u32) -> f32 {
    let r = rotation_matrix(q);
    let theta = dot(r[0], gradient[0]) + dot(r[1], gradient[1]) + dot(r[2], gradient[2]);
    return theta + select(0.0, trace(rotation_minus_identity(q)), total == 1u);
}

// The three columns of a tetrahedron's `gradients`.
fn shape_gradients(e: u32) -> mat3x3<f32> {
    return mat3x3<f32>(gradients[3u * e].xyz, gradients[3u * e + 1u].xyz, gradients[3u * e + 2u].xyz);
}
