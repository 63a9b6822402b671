//! How far nodes of a wound are inside of foreign cells, measured in the cells themselves, which know nothing of contacts.

use cutis::collide::lips::faces;
use cutis::mesh::trilinear;
use cutis::step::Simulation;
use glam::{DMat3, DVec3};

/// Depths of the nodes of the first body's wound that are inside of a cell that is none of theirs, each in the cell that it is deepest in, m.
pub fn inside(simulation: &mut Simulation) -> Vec<f64> {
    let u = simulation.bodies[0].snapshot().expect("the CPU path has no device to fail").u;
    let body = &simulation.bodies[0];
    let at = |node: usize| DVec3::from_array(body.wound.rest[node]) + DVec3::new(u[node][0], u[node][1], u[node][2]);
    let parts = &body.wound.surface.parts;
    let mut nodes: Vec<u32> = faces(parts, &body.wound.surface.alive).into_iter().flat_map(|face| face.nodes).collect();
    nodes.sort_unstable();
    nodes.dedup();
    let there = |cell: &usize| body.wound.surface.alive[*cell];
    let cells: Vec<[usize; 8]> =
        (0..body.model.grid.cell_count()).filter(there).map(|cell| parts.corners(cell)).collect();
    let depth = |node: u32| {
        let p = at(node as usize);
        let foreign = cells.iter().filter(|corners| !corners.contains(&(node as usize)));
        foreign.filter_map(|corners| depth_in(corners.map(&at), p)).fold(0.0, f64::max)
    };
    nodes.into_iter().map(depth).filter(|depth| *depth > 0.0).collect()
}

/// Depth of a point in a hexahedron, m: of the distances to its three pairs of opposite faces the least; none outside of it.
fn depth_in(corners: [DVec3; 8], p: DVec3) -> Option<f64> {
    let low = corners.iter().copied().reduce(DVec3::min)?;
    let high = corners.iter().copied().reduce(DVec3::max)?;
    if (low - p).max(p - high).max_element() > 0.0 {
        return None;
    }
    // Newton's method for the natural coordinates
    let point = |natural: [f64; 3]| corners.iter().zip(trilinear(natural)).map(|(c, w)| *c * w).sum::<DVec3>();
    let across = |axis: usize, mut natural: [f64; 3]| {
        let mut end = |value: f64| {
            natural[axis] = value;
            point(natural)
        };
        end(1.0) - end(0.0)
    };
    let mut natural = [0.5; 3];
    for _ in 0..12 {
        let jacobian = DMat3::from_cols(across(0, natural), across(1, natural), across(2, natural));
        if jacobian.determinant().abs() < 1e-30 {
            return None;
        }
        let change = jacobian.inverse() * (p - point(natural));
        (0..3).for_each(|axis| natural[axis] = (natural[axis] + change[axis]).clamp(-1.0, 2.0));
    }
    let depth = |axis: usize| natural[axis].min(1.0 - natural[axis]) * across(axis, natural).length();
    let depth = depth(0).min(depth(1)).min(depth(2));
    // a cell too warped for it to end has no coordinates there
    (depth > 0.0 && point(natural).distance(p) < 1e-9).then_some(depth)
}
