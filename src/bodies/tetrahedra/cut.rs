//! Cuts through a mesh of tetrahedra, and carving. Links over faces are severed and nodes are duplicated
//! ([`crate::mesh::TetrahedralParts`]); a node has the quarters of the masses of its tetrahedra, of a uniform mass the share of its original
//! that these make. Alternatively, a crossed link removes the tetrahedron in whose half the blade crossed it. A node without tetrahedra
//! leaves the system. Space carved out of tetrahedra ([`crate::mesh::Pit`]) leaves them a share of their volume, in the operator and the masses.
//!
//! The duplicates follow the nodes of the mesh in all arrays from the start, fixed and without mass, and every kernel runs over them: a
//! reserve of 500 nodes takes as long as 500 more nodes of the mesh.
//!
//! A cut takes the host time twice over. What depends on the tetrahedra around it (components, domains, node blocks) is as much for each
//! link as making the operator of 13 tetrahedra afresh, 65 µs of smoothed ones. What is put in order for the whole body (lists of nodes and
//! domains, outside) is a twelfth of making its operator, 0.4 µs per tetrahedron, in each step that cuts: 4 links of 24,576
//! tetrahedra take 11 ms, of 196,608 74 ms, 4032 of these 340 ms (two shared cores; `what_a_cut_costs` in tests/engine/tetrahedra_cut.rs). A
//! device gets the parts that changed and the whole lists, 44 bytes per tetrahedron. A removal takes the first part alone, 0.4 ms for a
//! tetrahedron of a body of 12,000 or of 192,000 (`cargo bench --bench tetrahedra -- 3`).

use super::Tetrahedra;
use super::operator::{Arrays, Changes};
use crate::bodies::{Model, Removal, Wound};
use crate::kernels::cut::Hit;
use crate::mesh::{Carved, LEAST, Severed, TOP, TetrahedralParts, Thinned};
use crate::scene::Mass;
use glam::DVec3;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Tetrahedra of a body that has them.
fn parts(wound: &mut Wound) -> &mut TetrahedralParts {
    wound.surface.tetrahedra_mut().unwrap_or_else(|| unreachable!("scenes that cut tetrahedra of a grid are refused"))
}

impl Wound {
    /// Severs links and duplicates nodes.
    pub(super) fn split_nodes(&mut self, model: &Model, own: &Tetrahedra, hits: &[Hit<f64>]) -> Removal {
        let cut = parts(self).cut(hits.iter().map(|hit| (hit.segment, hit.at)));
        let Severed { links, refused, holding, copies, tetrahedra } = cut;
        // the faces of the links have the duplicates by now
        for [copy, source] in &copies {
            self.rest[*copy as usize] = self.rest[*source as usize];
        }
        links.iter().for_each(|link| self.measure_link(model, *link as usize));
        self.totals.refused += refused as usize;
        self.totals.holding += holding as usize;
        self.totals.copies += copies.len();
        let nodes: BTreeSet<u32> = copies.iter().flatten().copied().collect();
        let mut removal = Removal { copies, ..Removal::default() };
        self.divide_masses(model, own, nodes, &mut removal);
        self.change_operator(own, &tetrahedra, &[], &mut removal);
        removal
    }

    /// Removes one tetrahedron for each crossed link.
    pub(super) fn remove_crossed(&mut self, model: &Model, own: &Tetrahedra, hits: &[Hit<f64>]) -> Removal {
        let mut gone = BTreeSet::new();
        for hit in hits {
            let parts = parts(self);
            let ends = parts.mesh().links.ends(hit.segment as usize);
            if ends.iter().all(|e| parts.present()[*e]) {
                gone.insert(ends[usize::from(hit.at > 0.5)] as u32);
                self.measure_link(model, hit.segment as usize);
            }
        }
        let gone: Vec<u32> = gone.into_iter().collect();
        parts(self).remove(&gone);
        self.take_tetrahedra(model, own, gone)
    }

    /// Removes tetrahedra, and what would hang by a node or an edge without them.
    pub(super) fn carve_tetrahedra(&mut self, model: &Model, own: &Tetrahedra, chosen: &[u32]) -> Removal {
        let gone = parts(self).carve(chosen);
        self.take_tetrahedra(model, own, gone)
    }

    /// Counts a severed link and extends the wound by its face.
    fn measure_link(&mut self, model: &Model, link: usize) {
        let [face, _] = parts(self).faces(link);
        let [a, b, c] = face.map(|node| DVec3::from_array(self.rest[node as usize]));
        self.totals.links += 1;
        self.totals.area += 0.5 * (b - a).cross(c - a).length();
        self.measure_nodes(model, &face);
    }

    /// Extends the wound by nodes.
    fn measure_nodes(&mut self, model: &Model, nodes: &[u32]) {
        let top = model.position[2] + model.grid.thickness() * (1.0 - TOP);
        for x in nodes.iter().map(|node| self.rest[*node as usize]) {
            self.all.add(&x);
            if x[2] >= top {
                self.top.add(&x);
            }
        }
    }

    /// Masses of nodes whose tetrahedra have parted.
    fn divide_masses(&mut self, model: &Model, own: &Tetrahedra, nodes: BTreeSet<u32>, removal: &mut Removal) {
        // per original: its nodes, each with the quarters of its tetrahedra, kg
        let mut parted: BTreeMap<usize, Vec<(u32, f64)>> = BTreeMap::new();
        for node in nodes {
            let around = parts(self).around(node);
            let quarters = around.into_iter().map(|e| own.quarter(model, self, e)).sum();
            parted.entry(self.surface.original(node as usize)).or_default().push((node, quarters));
        }
        for (original, nodes) in parted {
            let [x, y, z, _] = model.dofs[original];
            let whole: f64 = nodes.iter().map(|(node, _)| self.dofs[*node as usize][3]).sum();
            let all: f64 = nodes.iter().map(|(_, quarters)| quarters).sum();
            for (node, quarters) in nodes {
                let mass = if model.mass == Mass::Uniform { whole * quarters / all } else { quarters };
                self.dofs[node as usize] = [x, y, z, mass];
                removal.dofs.push((node, self.dofs[node as usize]));
            }
        }
    }

    /// Takes removed tetrahedra's masses from their nodes; a node without tetrahedra leaves the system.
    fn take_tetrahedra(&mut self, model: &Model, own: &Tetrahedra, gone: Vec<u32>) -> Removal {
        let mut removal = Removal::default();
        let corners: Vec<[u32; 4]> = gone.iter().map(|e| parts(self).corners()[*e as usize]).collect();
        self.measure_nodes(model, corners.as_flattened());
        self.count(own, &gone);
        self.take_masses(model, own, corners.as_flattened(), &mut removal);
        self.change_operator(own, &gone, &[], &mut removal);
        removal.cells = gone;
        removal
    }

    /// Counts removed tetrahedra, and what was left of their volumes.
    fn count(&mut self, own: &Tetrahedra, gone: &[u32]) {
        self.totals.tetrahedra += gone.len();
        let volume = |e: &u32| own.arrays.volume(*e as usize) * self.surface.share(*e as usize);
        self.totals.volume += gone.iter().map(volume).sum::<f64>();
    }

    /// Gives nodes the masses of what is left around them.
    fn take_masses(&mut self, model: &Model, own: &Tetrahedra, nodes: &[u32], removal: &mut Removal) {
        for node in nodes.iter().copied().collect::<BTreeSet<u32>>() {
            let around = parts(self).around(node);
            if around.is_empty() {
                self.leave(node, removal);
                continue;
            }
            if model.mass != Mass::Uniform {
                self.dofs[node as usize][3] = around.into_iter().map(|e| own.quarter(model, self, e)).sum();
            }
            removal.dofs.push((node, self.dofs[node as usize]));
        }
    }

    /// Removes space: the tetrahedra that were reached lose stiffness and mass with their volume, and those with less than [`LEAST`] left are
    /// removed as by [`Self::carve_tetrahedra`].
    pub(super) fn carve_space_of_tetrahedra(&mut self, model: &Model, own: &Tetrahedra, carved: &Carved) -> Removal {
        let thinned = self.surface.carve(carved);
        let mut removal = Removal::default();
        if thinned.is_empty() {
            return removal;
        }
        let lost = |of: &Thinned| own.arrays.volume(of.cell as usize) * (of.before - of.after);
        self.totals.volume += thinned.iter().map(lost).sum::<f64>();
        let below: Vec<u32> = thinned.iter().filter(|of| of.after < LEAST).map(|of| of.cell).collect();
        let gone = parts(self).carve(&below);
        self.count(own, &gone);
        self.measure_space(model, carved);
        let left = thinned.iter().filter(|of| self.surface.present()[of.cell as usize]);
        let volumes: Vec<(u32, f64)> =
            left.map(|of| (of.cell, own.arrays.volume(of.cell as usize) * of.after)).collect();
        let changed = thinned.iter().map(|of| of.cell).chain(gone.iter().copied());
        let nodes: Vec<u32> = changed.flat_map(|e| self.surface.corners_of_tetrahedra()[e as usize]).collect();
        self.take_masses(model, own, &nodes, &mut removal);
        self.change_operator(own, &gone, &volumes, &mut removal);
        removal.cells = gone;
        removal
    }

    /// Has the operator follow changed or removed tetrahedra, and the volumes that are left of others, m³.
    fn change_operator(&mut self, own: &Tetrahedra, changed: &[u32], volumes: &[(u32, f64)], removal: &mut Removal) {
        if changed.is_empty() && volumes.is_empty() {
            return;
        }
        let parts = parts(self);
        let now = |e: &u32| {
            let corners = parts.corners()[*e as usize];
            (*e, if parts.present()[*e as usize] { corners } else { [corners[0]; 4] })
        };
        let changes: Vec<(u32, [u32; 4])> = changed.iter().map(now).collect();
        let operator: &mut Arc<Arrays<f64>> = self.operator.get_or_insert_with(|| Arc::new(own.arrays.clone()));
        let arrays = Arc::make_mut(operator);
        let found: Changes = arrays.change(&changes, volumes);
        arrays.set_blocks(&found.nodes);
        let word = |(e, corners): &(u32, [u32; 4])| {
            let (e, corners) = (*e, *corners);
            (0..4).map(move |k| (4 * e + k, corners[k as usize]))
        };
        removal.words = changes.iter().flat_map(word).collect();
        removal.operator = Some((operator.clone(), found));
    }
}
