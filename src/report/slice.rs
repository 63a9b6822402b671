//! What a clipping plane lays open: the polygons in which it cuts the cells where they are now.

use super::frames::SkinSurface;
use crate::mesh::PAIRS;
use crate::step::Simulation;
use crate::view::Clip;
use glam::DVec3;

/// Edges of a hexahedron, pairs of corners.
const EDGES: [[usize; 2]; 12] =
    [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]];

/// See the module. Vertices of a cell's polygon belong to it alone.
#[derive(Debug, Default)]
pub struct Slice {
    /// `[vertex]` m
    pub positions: Vec<[f64; 3]>,
    /// `[vertex]` nodes between which it lies, and how far from the first one, 0 to 1
    pub between: Vec<([u32; 2], f64)>,
    /// `[triangle]` vertices
    pub triangles: Vec<[u32; 3]>,
    /// `[triangle]` body and layer
    pub layers: Vec<[u32; 2]>,
    /// `[triangle]` cell of the body
    pub cells: Vec<u32>,
    /// `[line]` vertices, around each polygon
    pub edges: Vec<[u32; 2]>,
}

impl Slice {
    /// Cuts the present cells of all bodies, whose nodes are at `surface.positions`.
    pub fn new(simulation: &Simulation, surface: &SkinSurface, plane: Clip) -> Self {
        let normal = DVec3::from(plane.normal);
        let heights: Vec<f64> = surface.positions.iter().map(|x| normal.dot(DVec3::from(*x)) - plane.offset).collect();
        let (mut out, mut first) = (Self::default(), 0);
        for (number, body) in simulation.bodies.iter().enumerate() {
            let (parts, alive) = (&body.wound.surface.parts, &body.wound.surface.alive);
            let of = |cell: usize| [number as u32, body.model.layer(cell) as u32];
            if body.model.unstructured().is_some() {
                let cut = &body.wound.surface;
                let all = cut.corners_of_tetrahedra().iter().zip(cut.present()).enumerate();
                for (cell, (corners, _)) in all.filter(|(_, (_, here))| **here) {
                    let corners = corners.map(|node| first + node);
                    out.add(&heights, surface, normal, &corners, &PAIRS, (of(cell), cell));
                }
            } else {
                for cell in (0..alive.len()).filter(|cell| alive[*cell]) {
                    let corners = parts.corners(cell).map(|node| first + node as u32);
                    out.add(&heights, surface, normal, &corners, &EDGES, (of(cell), cell));
                }
            }
            first += body.model.point_count() as u32;
        }
        out
    }

    /// Adds the polygon of a convex cell, if the plane meets it.
    fn add(
        &mut self,
        heights: &[f64],
        surface: &SkinSurface,
        normal: DVec3,
        corners: &[u32],
        edges: &[[usize; 2]],
        (layer, cell): ([u32; 2], usize),
    ) {
        let mut crossed: Vec<(DVec3, ([u32; 2], f64))> = vec![];
        for edge in edges {
            let [a, b] = edge.map(|corner| corners[corner] as usize);
            let (above, below) = (heights[a], heights[b]);
            // half open, so that a corner in the plane counts once for each edge that leaves it upward
            if (above >= 0.0) != (below >= 0.0) {
                let share = above / (above - below);
                let [x, y] = [a, b].map(|node| DVec3::from(surface.positions[node]));
                crossed.push((x.lerp(y, share), ([a as u32, b as u32], share)));
            }
        }
        if crossed.len() < 3 {
            return;
        }
        // around their middle
        let middle = crossed.iter().map(|(x, _)| *x).sum::<DVec3>() / crossed.len() as f64;
        let (u, v) = normal.normalize_or(DVec3::Z).any_orthonormal_pair();
        let angle = |x: DVec3| (x - middle).dot(v).atan2((x - middle).dot(u));
        crossed.sort_by(|(a, _), (b, _)| angle(*a).total_cmp(&angle(*b)));
        let (first, count) = (self.positions.len() as u32, crossed.len() as u32);
        for (x, between) in crossed {
            self.positions.push(x.to_array());
            self.between.push(between);
        }
        self.triangles.extend((2..count).map(|k| [first, first + k - 1, first + k]));
        self.layers.resize(self.triangles.len(), layer);
        self.cells.resize(self.triangles.len(), cell as u32);
        self.edges.extend((0..count).map(|k| [first + k, first + (k + 1) % count]));
    }

    /// `[vertex]` a field over nodes.
    pub fn of_nodes(&self, values: &[f64]) -> Vec<f64> {
        let of = |([a, b], share): &([u32; 2], f64)| (1.0 - share) * values[*a as usize] + share * values[*b as usize];
        self.between.iter().map(of).collect()
    }

    /// `[vertex]` the value of the cell that its polygon cuts, of `[body][cell]` values.
    pub fn of_cells(&self, values: &[Vec<f64>]) -> Vec<f64> {
        let mut out = vec![0.0; self.positions.len()];
        for ((triangle, [body, _]), cell) in self.triangles.iter().zip(&self.layers).zip(&self.cells) {
            triangle.iter().for_each(|vertex| out[*vertex as usize] = values[*body as usize][*cell as usize]);
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::corner;
    use crate::scene::{Element, Law, read};
    use crate::step::Platform;
    use std::path::Path;

    #[test]
    fn edges_join_corners_that_differ_along_one_axis() {
        let mut seen = EDGES.map(|[a, b]| [a.min(b), a.max(b)]).to_vec();
        let differ = |[a, b]: [usize; 2]| (0..3).filter(|n| corner(a)[*n] != corner(b)[*n]).count();
        assert!(seen.iter().all(|edge| differ(*edge) == 1), "{seen:?}");
        seen.sort_unstable();
        seen.dedup();
        assert_eq!(seen.len(), 12);
    }

    /// Area and its largest distance from the plane, of a slice aslant through a scene after some steps.
    fn sliced(file: &str, law: Option<Law>, plane: Clip) -> ([f64; 2], Slice) {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(file);
        let mut scene = read(&path).unwrap_or_else(|e| panic!("{e}"));
        if let Some(law) = law {
            scene.skins[0].law = law;
            scene.solver.preconditioner = crate::scene::Preconditioner::Block;
        }
        let simulation = Simulation::new(&scene, &Platform::Cpu64).unwrap_or_else(|e| panic!("{e}"));
        let mut simulation = simulation;
        simulation.step(false).unwrap_or_else(|e| panic!("{e}"));
        let state = simulation.snapshots().unwrap_or_else(|e| panic!("{e}"));
        let surface = SkinSurface::new(&simulation, &state);
        let slice = Slice::new(&simulation, &surface, plane);
        let at = |n: u32| DVec3::from(slice.positions[n as usize]);
        let area = slice.triangles.iter().map(|[a, b, c]| 0.5 * (at(*b) - at(*a)).cross(at(*c) - at(*a)).length());
        let normal = DVec3::from(plane.normal);
        let off = slice.positions.iter().map(|x| (normal.dot(DVec3::from(*x)) - plane.offset).abs());
        ([area.sum(), off.fold(0.0, f64::max)], slice)
    }

    #[test]
    fn a_slice_has_the_section_of_the_body() {
        // the block of 10 × 10 × 2.5 mm, stretched to 2.75 mm; free across, so narrower by the root of the volume ratio
        let across = Clip { normal: [0.0, 0.0, 1.0], offset: 1.3e-3 };
        let ([level, off], slice) = sliced("verify/patch.toml", None, across);
        assert!(off < 1e-15, "{off:e}");
        let along = Clip { normal: [1.0, 0.0, 0.0], offset: -1.234e-3 };
        let ([upright, _], _) = sliced("verify/patch.toml", None, along);
        let width = level.sqrt();
        assert!((0.93e-2..1e-2).contains(&width), "{width:e}");
        assert!((upright / (width * 2.75e-3) - 1.0).abs() < 1e-6, "{upright:e} of {width:e}");
        // aslant: the level area over the cosine, as far as it meets neither top nor bottom
        let aslant = Clip { normal: [0.1, -0.05, 1.0], offset: 1.3e-3 };
        let ([tilted, _], _) = sliced("verify/patch.toml", None, aslant);
        let longer = DVec3::from(aslant.normal).length();
        assert!((tilted / (level * longer) - 1.0).abs() < 1e-6, "{tilted:e} of {level:e}");
        // fields are interpolated: height over the bottom
        let heights: Vec<f64> = (0..1000).map(f64::from).collect();
        assert!(slice.of_nodes(&heights).iter().all(|h| (0.0..1000.0).contains(h)));
        // beside the body there is none
        let ([none, _], slice) = sliced("verify/patch.toml", None, Clip { normal: [0.0, 0.0, 1.0], offset: 1.0 });
        assert!(none == 0.0 && slice.triangles.is_empty());
        // tetrahedra of a mesh: the section of its box, 12 × 12 mm or so
        let law = Law::Fem { element: Element::Tetra, corotational: true };
        let ([mesh, off], slice) =
            sliced("skin_tetra.toml", Some(law), Clip { normal: [0.0, 0.0, 1.0], offset: 0.7e-3 });
        let [low, high] =
            [f64::min, f64::max].map(|of| slice.positions.iter().map(|x| x[0]).reduce(of).expect("it is cut"));
        assert!(off < 1e-15 && (mesh / (high - low).powi(2) - 1.0).abs() < 1e-3, "{mesh:e}, {low:e} to {high:e}");
    }
}
