// Sum of the corner forces at node `i`; the cells' list begins at number `first`; see collected.rs.
fn collected(i: u32, first: u32) -> vec3<f32> {
    let c = node_at(params, i);
    var sum = vec3<f32>(0.0);
    for (var a = 0u; a < 8u; a += 1u) {
        let at = c - corner(a);
        if !has_cell(params, at) { continue; }
        let k = first + cell_id(params, at) * 24u + a * 3u;
        sum += vec3<f32>(corner_force[k], corner_force[k + 1u], corner_force[k + 2u]);
    }
    return sum;
}
