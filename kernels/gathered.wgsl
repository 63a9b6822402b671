// Sum of the forces of the tetrahedra around node `i`, whose list begins at number `first`; see gathered.rs.
fn gathered(i: u32, first: u32) -> vec3<f32> {
    var sum = vec3<f32>(0.0);
    for (var n = first_of_node[i]; n < first_of_node[i + 1u]; n += 1u) {
        let at = first + 3u * (of_node[n] / 4u);
        let a = of_node[n] % 4u;
        if a == 0u {
            sum -= tetrahedron_force[at].xyz + tetrahedron_force[at + 1u].xyz + tetrahedron_force[at + 2u].xyz;
        } else {
            sum += tetrahedron_force[at + a - 1u].xyz;
        }
    }
    return sum;
}
