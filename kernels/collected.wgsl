// Sum of the corner forces at node `i`; the cells' list begins at number `first`; see collected.rs.
fn collected(i: u32, first: u32) -> vec3<f32> {
    let c = node_at(params, i);
    let cells = vec3<u32>(params.cells_x, params.cells_y, params.cells_z);
    var sum = vec3<f32>(0.0);
    for (var a = 0u; a < 8u; a += 1u) {
        let at = c - corner(a); // wraps below 0, which the test catches
        if any(at >= cells) { continue; }
        let k = first + cell_id(params, at) * 24u + a * 3u;
        sum += vec3<f32>(corner_force[k], corner_force[k + 1u], corner_force[k + 2u]);
    }
    return sum;
}
