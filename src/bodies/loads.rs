//! Loads on the surface of a body as forces at its nodes.
//!
//! A traction `t` over parts `S` of the grid's outer faces gives its nodes the consistent loads `f_a = ∫_S N_a t dA`, `N_a` the bilinear
//! shape functions of the face. At rest faces are rectangles, so the integral is exact: a uniform traction gives each corner of a whole face
//! a quarter of its force. A dead pressure `p` is `t = −p n` with the outward normal `n` at rest, a total force `F` is `t = F/A` with the
//! area `A` of `S`. A force at a material point acts on the nodes of its cell by their shape functions; on the surface only those of the
//! face differ from 0, so force and moment at rest are those of the force itself.
//!
//! A follower pressure acts along the normal of the deformed face, on its area: `f_a = −p ∫ N_a (x_ξ × x_η) dξ dη` with the positions
//! `x(ξ, η) = Σ N_a x_a`. The integrand is of degree 2 in each coordinate, so two Gauss points per axis are exact, and a closed surface under
//! uniform pressure has no resultant. The positions are those at the start of a step; static steps and those in full ([`crate::scene::Scene::in_full`])
//! repeat their solves until the balance holds with the pressure on the shape that they end in.
//! Source: Bonet, Wood 2008, section 8.5 (pressure forces); here without their stiffness, so the repetitions converge linearly.
//!
//! A triangle of a mesh or of an embedded surface has parts in the region that are triangles too: a part of the area `A` with its middle at the
//! barycentric coordinates `b_a` gives the corners `f_a = t A b_a`, which is exact, of a follower pressure with
//! `t A = −p s/2 (x_1 − x_0) × (x_2 − x_0)`, `s` the part's share of the triangle at rest. On an embedded surface the same force acts at the middles
//! of equal parts of it, at most a third of a cell wide, by the shape functions of the cells that they are in: shared by the corners, it
//! would reach some nodes more than others (centre of a skin block aslant under 10 kPa −9 and +10 % off on 1 and 0.7 mm cells).
//!
//! After a cut a face keeps its load, on the nodes that its cell has then.
//! Units: m, N, Pa.

use super::Model;
use crate::kernels::corner;
use crate::math::V3;
use crate::mesh::{Face as Outer, Grid, MaterialPoint, trilinear};
use crate::scene::{ACROSS, CellFace, Load, LoadKind, Region, Spans, TrianglePart, share_of};

/// Parts of a loaded triangle of an embedded surface per width of a cell, along each of its edges.
const PARTS: f64 = 3.0;

/// Face of the surface with its loaded parts. Its corners are in the order `00, 10, 01, 11` of its two axes.
struct Face {
    /// Cell behind it.
    cell: usize,
    /// Numbers of its corners in the cell.
    corners: [usize; 4],
    /// Edges along its two axes, m.
    edge: [f64; 2],
    /// Outward normal at rest.
    normal: [f64; 3],
    /// 1 where the outward normal is the first axis × the second one, otherwise −1.
    orientation: f64,
    parts: Vec<Spans>,
}

/// Faces of the grid's surface that have parts in a region.
fn faces(grid: &Grid, region: &Region) -> Vec<Face> {
    let params = grid.params::<f64>();
    let size = grid.size();
    let mut out = vec![];
    for (axis, upper) in (0..3).flat_map(|axis| [(axis, 0), (axis, 1)]) {
        let [p, q] = ACROSS[axis];
        let corners = [[0, 0], [1, 0], [0, 1], [1, 1]].map(|[i, j]| {
            let wanted = |a: &usize| (corner(*a)[axis], corner(*a)[p], corner(*a)[q]) == (upper, i, j);
            (0..8).find(wanted).expect("a cell has this corner")
        });
        let outward = if upper == 1 { 1.0 } else { -1.0 };
        let mut normal = [0.0; 3];
        normal[axis] = outward;
        for j in 0..grid.cells[q] {
            for i in 0..grid.cells[p] {
                let mut cell = [0; 3];
                (cell[axis], cell[p], cell[q]) = (upper * (grid.cells[axis] - 1), i, j);
                let mut lowest = cell;
                lowest[axis] += upper;
                let height = grid.heights[cell[2] + 1] - grid.heights[cell[2]];
                let edge = [grid.edge[0], grid.edge[1], height];
                let face = CellFace { axis, low: grid.rest(params.node_id(lowest)), edge };
                let parts = region.parts_of(&face, size, grid.thickness());
                if !parts.is_empty() {
                    out.push(Face {
                        cell: params.cell_id(cell),
                        corners,
                        edge: [edge[p], edge[q]],
                        normal,
                        orientation: if axis == 1 { -outward } else { outward }, // e_x × e_z = −e_y
                        parts,
                    });
                }
            }
        }
    }
    out
}

/// Corners of a tetrahedron, twice.
pub fn twice([a, b, c, d]: [u32; 4]) -> [usize; 8] {
    [a, b, c, d, a, b, c, d].map(|node| node as usize)
}

impl Face {
    /// Area at rest of its loaded parts, m².
    fn area(&self) -> f64 {
        let of =
            |spans: &Spans| spans.iter().zip(self.edge).map(|([from, to], edge)| (to - from) * edge).product::<f64>();
        self.parts.iter().map(of).sum()
    }

    /// Adds the loads of a traction, Pa, on its corners `nodes`.
    fn add_traction(&self, traction: [f64; 3], nodes: [usize; 4], out: &mut [[f64; 3]]) {
        for spans in &self.parts {
            let share = |n: usize| {
                let ([a, b], edge) = (spans[n], self.edge[n]);
                let upper = 0.5 * (b * b - a * a);
                [(b - a - upper) * edge, upper * edge]
            };
            let (x, y) = (share(0), share(1));
            for (node, [p, q]) in nodes.into_iter().zip([[0, 0], [1, 0], [0, 1], [1, 1]]) {
                (0..3).for_each(|n| out[node][n] += traction[n] * x[p] * y[q]);
            }
        }
    }

    /// Adds the loads of a pressure, Pa, on the face with its corners at `x`, m.
    fn add_follower(&self, pressure: f64, x: [V3<f64>; 4], nodes: [usize; 4], out: &mut [[f64; 3]]) {
        let gauss = [-1.0, 1.0].map(|side: f64| 0.5 + side * 0.5 / 3f64.sqrt());
        for [[a, b], [c, d]] in &self.parts {
            for (s, t) in gauss.into_iter().flat_map(|s| gauss.map(|t| (a + s * (b - a), c + t * (d - c)))) {
                let along = (x[1] - x[0]) * (1.0 - t) + (x[3] - x[2]) * t;
                let across = (x[2] - x[0]) * (1.0 - s) + (x[3] - x[1]) * s;
                let weight = 0.25 * (b - a) * (d - c) * self.orientation;
                let force = (along.cross(across) * (-pressure * weight)).f64();
                let shape = [(1.0 - s) * (1.0 - t), s * (1.0 - t), (1.0 - s) * t, s * t];
                for (node, shape) in nodes.into_iter().zip(shape) {
                    (0..3).for_each(|n| out[node][n] += force[n] * shape);
                }
            }
        }
    }
}

impl Model {
    /// The body's loads that act at a time.
    fn acting<'a>(&self, loads: &'a [Load], time: f64) -> impl Iterator<Item = &'a Load> {
        let body = self.body;
        loads.iter().filter(move |load| load.body == body && time >= load.start && time < load.end)
    }

    /// `[node]` loads on the uncut body at rest at a time, N.
    pub fn load_at(&self, loads: &[Load], time: f64) -> Vec<[f64; 3]> {
        let params = self.grid.params::<f64>();
        let corners = |cell: usize| match self.unstructured() {
            Some(of) => twice(of.mesh.tetrahedra()[cell]),
            None => params.corners(cell),
        };
        self.load_on(loads, time, corners, |_| [0.0; 3])
    }

    /// The same with the cells' `corners` after a cut (of a tetrahedron its four, twice), and displacements, m, of the nodes that follower
    /// pressures act on.
    pub fn load_on(
        &self,
        loads: &[Load],
        time: f64,
        corners: impl Fn(usize) -> [usize; 8],
        displacement: impl Fn(usize) -> [f64; 3],
    ) -> Vec<[f64; 3]> {
        let mut out = vec![[0.0; 3]; self.node_count()];
        for load in self.acting(loads, time) {
            if let LoadKind::PointForce { force, at } = load.kind {
                if let Some((e, weights)) = self.grid.tetrahedron_at(at) {
                    corners(e)
                        .iter()
                        .zip(weights)
                        .for_each(|(node, w)| (0..3).for_each(|n| out[*node][n] += force[n] * w));
                    continue;
                }
                let (cell, natural) = match &self.grid.embedded {
                    Some(_) => self.grid.present_at(at).unwrap_or_else(|| self.grid.cell_at(at)),
                    None => self.grid.cell_at(at),
                };
                for (node, weight) in corners(cell).into_iter().zip(trilinear(natural)) {
                    (0..3).for_each(|n| out[node][n] += force[n] * weight);
                }
                continue;
            }
            if let Some(outside) = self.outside() {
                self.load_triangles(outside, load, &corners, &displacement, &mut out);
                continue;
            }
            let faces = faces(&self.grid, &load.region);
            let area: f64 = faces.iter().map(Face::area).sum();
            for face in &faces {
                let of_cell = corners(face.cell);
                let nodes = face.corners.map(|a| of_cell[a]);
                match load.kind {
                    LoadKind::Pressure { pressure, follower: true } => {
                        // positions from those of the uncut cell: a duplicate rests where its original does
                        let own = self.grid.params::<f64>().corners(face.cell);
                        let at =
                            |k: usize| V3::of(self.grid.rest(own[face.corners[k]])) + V3::of(displacement(nodes[k]));
                        face.add_follower(pressure, [0, 1, 2, 3].map(at), nodes, &mut out);
                    }
                    LoadKind::Pressure { pressure, follower: false } => {
                        face.add_traction(face.normal.map(|n| -pressure * n), nodes, &mut out);
                    }
                    LoadKind::Traction(traction) => face.add_traction(traction, nodes, &mut out),
                    LoadKind::Force(force) => face.add_traction(force.map(|f| f / area), nodes, &mut out),
                    LoadKind::PointForce { .. } => {}
                }
            }
        }
        out
    }

    /// Triangles of a mesh of tetrahedra, or of an embedded surface; none of a grid.
    fn outside(&self) -> Option<&[Outer]> {
        match (&self.grid.unstructured, &self.grid.embedded) {
            (Some(unstructured), _) => Some(&unstructured.outside.faces),
            (None, embedded) => embedded.as_ref().map(|embedded| &embedded.outside[..]),
        }
    }

    /// Triangles with parts in a region, their corners after a cut, and these parts.
    fn triangles<'a>(
        &'a self,
        outside: &'a [Outer],
        region: &'a Region,
        corners: &'a impl Fn(usize) -> [usize; 8],
    ) -> impl Iterator<Item = ([[u32; 3]; 2], Vec<TrianglePart>)> + 'a {
        outside.iter().filter_map(move |face| {
            let own = [0, 1, 2].map(|k| face.nodes[k]);
            let parts = match (self.unstructured(), &self.grid.embedded) {
                (Some(of), _) => of.mesh.parts_in(region, own),
                (None, Some(of)) => of.surface.parts_in(region, own.map(|id| id - self.node_count() as u32)),
                (None, None) => vec![],
            };
            let now = || {
                let Some(of) = self.unstructured() else { return own };
                let whole = of.mesh.tetrahedra()[face.cell as usize];
                let now = corners(face.cell as usize);
                own.map(|id| whole.iter().position(|other| *other == id).map_or(id, |k| now[k] as u32))
            };
            (!parts.is_empty()).then(|| ([own, now()], parts))
        })
    }

    /// Adds a load on triangles: see the module.
    fn load_triangles(
        &self,
        outside: &[Outer],
        load: &Load,
        corners: &impl Fn(usize) -> [usize; 8],
        displacement: &impl Fn(usize) -> [f64; 3],
        out: &mut [[f64; 3]],
    ) {
        // twice the outward area, m²
        let area_twice = |x: [V3<f64>; 3]| (x[1] - x[0]).cross(x[2] - x[0]);
        let at_rest = |corners: [u32; 3]| corners.map(|id| V3::of(self.rest_of_point(id)));
        let loaded: Vec<_> = self.triangles(outside, &load.region, corners).collect();
        let area: f64 = loaded
            .iter()
            .map(|([own, _], parts)| 0.5 * area_twice(at_rest(*own)).length() * parts.iter().map(share_of).sum::<f64>())
            .sum();
        for ([own, now], parts) in loaded {
            let rest = at_rest(own);
            let own = 0.5 * area_twice(rest).length();
            let force = match load.kind {
                LoadKind::Pressure { pressure, follower } => {
                    let moved = |k: usize| {
                        let nodes = self.on_nodes(MaterialPoint::node(now[k])).0;
                        let each = nodes.iter().map(|(node, w)| V3::of(displacement(*node as usize)) * *w);
                        rest[k] + each.fold(V3::zero(), |sum, own| sum + own)
                    };
                    area_twice(if follower { [0, 1, 2].map(moved) } else { rest }) * (-0.5 * pressure)
                }
                LoadKind::Traction(traction) => V3::of(traction) * own,
                LoadKind::Force(force) => V3::of(force) * (own / area),
                LoadKind::PointForce { .. } => V3::zero(), // acts at its point
            };
            for (point, share) in parts.iter().flat_map(|part| self.spread(rest, now, part)) {
                let part = (force * share).f64();
                for (node, weight) in point.0 {
                    (0..3).for_each(|n| out[node as usize][n] += part[n] * weight);
                }
            }
        }
    }

    /// Points that a uniform load on a part of a triangle acts at, with their shares of the whole triangle's: its corners, or of an embedded
    /// surface the middles of equal parts that are at most a third of a cell wide.
    fn spread(&self, rest: [V3<f64>; 3], corners: [u32; 3], part: &TrianglePart) -> Vec<(MaterialPoint, f64)> {
        let all = share_of(part);
        if self.grid.embedded.is_none() {
            let share = |k: usize| all * part.iter().map(|corner| corner[k]).sum::<f64>() / 3.0;
            return [0, 1, 2].map(|k| (MaterialPoint::node(corners[k]), share(k))).into();
        }
        let [a, b, c] = part.map(|[p, q, r]| rest[0] * p + rest[1] * q + rest[2] * r);
        // cells that it reaches over, along the axis along which these are most
        let heights = self.grid.heights.windows(2).map(|ends| ends[1] - ends[0]);
        let width = [self.grid.edge[0], self.grid.edge[1], heights.fold(f64::INFINITY, f64::min)];
        let reach = |edge: V3<f64>| edge.f64().into_iter().zip(width).map(|(e, w)| e.abs() / w).fold(0.0, f64::max);
        let cells = [b - a, c - b, a - c].map(reach).into_iter().fold(0.0, f64::max);
        let rows = ((PARTS * cells).ceil() as usize).max(1);
        // parts turned like the triangle, and between them those turned the other way
        let lower = (0..rows).flat_map(|i| (0..rows - i).map(move |j| [i, j].map(|n| n as f64 + 1.0 / 3.0)));
        let upper = (1..rows).flat_map(|i| (0..rows - i).map(move |j| [i as f64 - 1.0 / 3.0, j as f64 + 2.0 / 3.0]));
        let share = all / (rows * rows) as f64;
        let params = self.grid.params::<f64>();
        let point = |[p, q]: [f64; 2]| {
            let [p, q] = [p, q].map(|n| n / rows as f64);
            let at = (a + (b - a) * p + (c - a) * q).f64();
            match self.grid.present_at(at) {
                // not rounded to a node nearby, so that moments are exact
                Some((cell, _)) => {
                    let natural = self.grid.natural_in(&params, cell, at);
                    MaterialPoint::of(params.corners(cell).map(|id| id as u32), trilinear(natural))
                }
                // where there is no cell, with the corners
                None => {
                    let [first, second, third] = part;
                    let weight = |k: usize| (1.0 - p - q) * first[k] + p * second[k] + q * third[k];
                    self.on_nodes(MaterialPoint::of(corners, [0, 1, 2].map(weight)))
                }
            }
        };
        lower.chain(upper).map(|at| (point(at), share)).collect()
    }

    /// Nodes that give the shape that follower pressures act on at a time, each once, in ascending order.
    pub fn followed_nodes(&self, loads: &[Load], time: f64, corners: impl Fn(usize) -> [usize; 8]) -> Vec<u32> {
        let followed = || self.acting(loads, time).filter(|load| load.follows());
        if let Some(outside) = self.outside() {
            let triangles = followed().flat_map(|load| self.triangles(outside, &load.region, &corners));
            let mut nodes: Vec<u32> = triangles
                .flat_map(|([_, now], _)| now)
                .flat_map(|id| self.on_nodes(MaterialPoint::node(id)).0)
                .map(|(node, _)| node)
                .collect();
            nodes.sort_unstable();
            nodes.dedup();
            return nodes;
        }
        let faces = followed().flat_map(|load| faces(&self.grid, &load.region));
        let mut nodes: Vec<u32> = faces
            .flat_map(|face| {
                let of_cell = corners(face.cell);
                face.corners.map(|a| of_cell[a] as u32)
            })
            .collect();
        nodes.sort_unstable();
        nodes.dedup();
        nodes
    }
}
