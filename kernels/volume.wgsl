// Stiffness of a hyperelastic cell's volume; see volume.rs.
const HYPERELASTIC: u32 = 2u;

fn volume_row(cell: u32, n: u32) -> vec3<f32> { return rotation[params.cell_count + 3u * cell + n].xyz; }

// Of a corner, in the cell's frame.
fn volume_slope(cell: u32, a: u32) -> vec3<f32> {
    let sign = select(vec3<f32>(-1.0), vec3<f32>(1.0), corner(a) == vec3<u32>(0u));
    return volume_row(cell, 0u) * sign.x + volume_row(cell, 1u) * sign.y + volume_row(cell, 2u) * sign.z;
}
