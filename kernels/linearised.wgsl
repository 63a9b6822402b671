// Stiffness of a hyperelastic cell's volume and tension; see linearised.rs.
const HYPERELASTIC: u32 = 2u;

fn volume_row(cell: u32, n: u32) -> vec3<f32> { return rotation[params.cell_count + 3u * cell + n].xyz; }

fn tension_row(cell: u32) -> vec3<f32> {
    let first = params.cell_count + 3u * cell;
    return vec3<f32>(rotation[first].w, rotation[first + 1u].w, rotation[first + 2u].w);
}

// Signs of a corner in the patterns 1, 2, 4.
fn corner_signs(a: u32) -> vec3<f32> { return select(vec3<f32>(-1.0), vec3<f32>(1.0), corner(a) == vec3<u32>(0u)); }

// Of a corner, in the cell's frame.
fn volume_slope(cell: u32, a: u32) -> vec3<f32> {
    let sign = corner_signs(a);
    return volume_row(cell, 0u) * sign.x + volume_row(cell, 1u) * sign.y + volume_row(cell, 2u) * sign.z;
}

// Block between two corners, in the cell's frame.
fn stiffness_between(cell: u32, a: u32, b: u32) -> mat3x3<f32> {
    let p = tension_row(cell);
    let s_a = corner_signs(a) * p;
    let s_b = corner_signs(b) * p;
    let both = corner_signs(a) * corner_signs(b);
    let xy = both.x * both.y; let xz = both.x * both.z; let yz = both.y * both.z;
    let all = xy * both.z / 3.0;
    let squares = p * p / 3.0;
    let hourglass = vec3<f32>(
        squares.y * (xy + yz + all) + squares.z * (xz + yz + all),
        squares.x * (xy + xz + all) + squares.z * (yz + xz + all),
        squares.x * (xz + xy + all) + squares.y * (yz + xy + all),
    );
    return diagonal(hourglass + 0.5 * dot(s_a, s_b)) - outer(s_b, s_a) * 0.5
        + outer(volume_slope(cell, a), volume_slope(cell, b));
}
