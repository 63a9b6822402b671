//! Cuts through spring networks: crossed springs are removed, and those stretched beyond their layer's limit. A cell counts as open if two or more of its four edges along one axis are
//! cut, a tetrahedron of a mesh if its remaining edges do not join its corners. A node without springs leaves the system.

use super::{Springs, comes_apart};
use crate::bodies::{Model, Removal, Wound};
use crate::kernels::corner;
use crate::kernels::cut::Hit;
use crate::kernels::springs::elongation;
use crate::math::{V3, V4};
use crate::mesh::TOP;
use glam::DVec3;

impl Model {
    /// Springs that are stretched beyond their limit at displacements `u`, `[node]` m, as if they were crossed in the middle.
    pub fn overstretched(&self, wound: &Wound, u: &[V4<f64>]) -> Vec<Hit<f64>> {
        let Some(springs) = self.springs() else { return vec![] };
        let beyond = |(spring, limit): &(usize, &f64)| {
            let [a, b] = springs.ends[*spring].map(|node| node as usize);
            let span = V3::of(self.rest[b]) - V3::of(self.rest[a]);
            let shift = V3::from4(u[b]) - V3::from4(u[a]);
            let slack = springs.law[*spring][0];
            let stretch = slack + elongation(span, shift, (span + shift).length());
            !wound.spring_gone[*spring] && stretch > **limit * (span.length() - slack)
        };
        let broken = springs.breaks_at.iter().enumerate().filter(beyond);
        broken.map(|(spring, _)| Hit { segment: spring as u32, at: 0.5 }).collect()
    }
}

impl Wound {
    /// Removes crossed springs.
    pub(super) fn cut_springs(&mut self, model: &Model, springs: &Springs, hits: &[Hit<f64>]) -> Removal {
        let params = model.grid.params::<f64>();
        let mut removal = Removal::default();
        let mut touched = vec![];
        for hit in hits {
            let spring = hit.segment as usize;
            if std::mem::replace(&mut self.spring_gone[spring], true) {
                continue;
            }
            // remove the spring, and nodes that lose their last one
            removal.springs.push(spring as u32);
            self.totals.springs_removed += 1;
            let [a, b] = springs.ends[spring].map(|n| n as usize);
            for node in [a, b] {
                self.live[node] -= 1;
                if self.live[node] == 0 {
                    self.leave(node as u32, &mut removal);
                }
            }
            if let Some(mesh) = model.unstructured() {
                // a plane meets `½ L` edges per area where their length per volume is L (Saltykov 1958): each stands for the area 2 V / l
                let [x, y] = springs.ends[spring].map(|n| DVec3::from_array(model.rest[n as usize]));
                let around = springs.tetrahedra.of_spring(spring);
                let share: f64 = around.iter().map(|e| mesh.mesh.volume(*e as usize) / 6.0).sum();
                self.totals.area += 2.0 * share / x.distance(y);
                touched.extend(around);
                continue;
            }
            // a spring along an axis is a grid edge
            let (p, q) = (params.node_at(a), params.node_at(b));
            let along: Vec<usize> = (0..3).filter(|n| p[*n] != q[*n]).collect();
            if let [axis] = along[..] {
                self.edge_cut(model, springs, a, axis, &mut removal);
            }
        }
        self.open_tetrahedra(model, springs, touched);
        removal
    }

    /// Opens those of some tetrahedra that come apart, and extends the wound by them.
    fn open_tetrahedra(&mut self, model: &Model, springs: &Springs, mut touched: Vec<u32>) {
        touched.sort_unstable();
        touched.dedup();
        let left = |e: &u32| springs.tetrahedra.springs[*e as usize].map(|spring| !self.spring_gone[spring as usize]);
        touched.retain(|e| self.surface.present()[*e as usize] && comes_apart(left(e)));
        let Some(mesh) = model.unstructured() else { return };
        let top = model.position[2] + model.grid.thickness() * (1.0 - TOP);
        for e in &touched {
            let corners = mesh.mesh.tetrahedra()[*e as usize].map(|node| model.rest[node as usize]);
            corners.iter().for_each(|x| self.all.add(x));
            corners.iter().filter(|x| x[2] >= top).for_each(|x| self.top.add(x));
        }
        self.totals.tetrahedra += touched.len();
        if let Some(parts) = self.surface.tetrahedra_mut() {
            parts.remove(&touched);
        }
    }

    /// Opens the cells around a cut grid edge (from node `a` along `axis`) that have severed two edges along that axis.
    fn edge_cut(&mut self, model: &Model, springs: &Springs, a: usize, axis: usize, removal: &mut Removal) {
        let params = model.grid.params::<f64>();
        let at = params.node_at(a);
        let stride = [1, params.nodes_x as usize, (params.nodes_x * params.nodes_y) as usize];
        let gone = |first: usize| {
            let second = (first + stride[axis]) as u32;
            let range = springs.first[first] as usize..springs.first[first + 1] as usize;
            springs.half[range].iter().any(|h| h[0] == second && self.spring_gone[h[1] as usize])
        };
        // area of the face that belongs to the edge
        let level = at[2].min(model.grid.cells[2] - 1);
        let h = model.shape[model.grid.layer_of[level] as usize];
        self.totals.area += h[0] * h[1] * h[2] / h[axis];
        // cells around the edge with at least two cut edges
        let mut opened = vec![];
        for a in 0..8 {
            let o = corner(a);
            if o[axis] == 1 {
                continue;
            }
            let Some(cell) = params.cell_below(at, a) else {
                continue;
            };
            if !self.surface.alive[cell] {
                continue;
            }
            let corners = params.corners(cell);
            let severed = (0..8).filter(|k| corner(*k)[axis] == 0).filter(|k| gone(corners[*k])).count();
            if severed >= 2 {
                opened.push(cell as u32);
            }
        }
        for cell in opened {
            self.open_cell(model, cell, axis);
            removal.cells.push(cell);
        }
    }
}
