//! The blade's part of a step: the surface that its edge swept through the skin goes to the cut kernel, what is hit is removed.
//!
//! A piece of edge that the tissue holds (a force below its bound) cuts nothing, but parts of it may pass a spring or link all the same:
//! the piece is held at its sample alone. So its sweep is not given up but put off: the piece keeps the line from which it has not swept
//! yet, carried along with the skin at its contact, until the tissue lets go.
//!
//! A piece that has cut stands at the front of its cut, whatever the grid's cells show of it, and is held there as it moves on: what it
//! has opened and what it meets are told apart by how far it has gone back from its front, not by which cell it is in. So the work of
//! cutting is toughness times area, and the force does not beat with the cells.

use super::body::{Body, Located};
use super::{Simulation, StepReport};
use crate::collide::Contact;
use crate::constraints::Law;
use crate::cut::Wound;
use crate::error::Result;
use crate::instrument::{Instrument, Role};
use crate::kernels::corner;
use crate::kernels::cut::Hit;
use crate::scene::Who;
use glam::DVec3;
use std::collections::BTreeMap;

/// Pieces of edge that are held, by tool and sample.
pub(super) type Held = BTreeMap<(usize, usize), Line>;

/// How far pieces of edge have gone back from where they have cut to, m, by tool and sample.
pub(super) type Fronts = BTreeMap<(usize, usize), f64>;

/// What a held piece has not swept yet.
#[derive(Clone, Copy)]
pub(super) struct Line {
    /// Where its ends stood when it last swept, moved with the skin since, m.
    ends: [DVec3; 2],
    /// It is inside the tissue; one that was only pressed on it and lifts off has cut nothing.
    inside: bool,
}

impl Simulation {
    /// Cuts what the pieces of each edge that move through the skin have swept.
    pub(super) fn incise(&mut self, old: &[Instrument], report: &mut StepReport) -> Result<()> {
        let contacts = std::mem::take(&mut report.contact.contacts);
        let refused = self.totals().refused;
        let done = self.sweep(old, &contacts, report);
        report.contact.contacts = contacts;
        report.warn("cut_reserve_exhausted", (self.totals().refused - refused) as u32);
        done
    }

    /// Moves the fronts of the pieces of edge: those that were held in the skin go on or back with it, the others by their own motion; a
    /// piece that has left the wound forgets its front.
    fn follow_fronts(&mut self, old: &[Instrument], contacts: &[Contact], report: &StepReport) {
        let fronts = std::mem::take(&mut self.fronts);
        for (number, (old, new)) in old.iter().zip(&self.tools).enumerate() {
            let Some(edge) = &new.edge else { continue };
            let forward = new.rotation * edge.forward;
            let pieces = new.samples.iter().enumerate().filter(|(_, s)| matches!(s.role, Role::Edge { .. }));
            for (index, sample) in pieces {
                let held = |c: &Contact| {
                    c.on[0] == Who::Rigid(number) && c.feature == index && matches!(c.law, Law::Cut { .. })
                };
                let before = fronts.get(&(number, index));
                let (retreat, motion) = match (contacts.iter().position(held), before) {
                    (Some(k), _) => (contacts[k].gap[0], report.contact.slips[k]),
                    (None, Some(retreat)) if self.in_wound(number, new.at(sample.position)) => {
                        (*retreat, new.at(sample.position) - old.at(sample.position))
                    }
                    _ => continue,
                };
                self.fronts.insert((number, index), (retreat - motion.dot(forward)).max(0.0));
            }
        }
    }

    /// Whether a point near a tool is inside of a body, or in its wound.
    fn in_wound(&self, tool: usize, point: DVec3) -> bool {
        let patches = self.bodies.iter().filter_map(|body| body.located.patches.get(tool)?.as_ref());
        patches.into_iter().any(|patch| patch.in_wound(point))
    }

    fn sweep(&mut self, old: &[Instrument], contacts: &[Contact], report: &mut StepReport) -> Result<()> {
        self.follow_fronts(old, contacts, report);
        let held = std::mem::take(&mut self.held);
        let by_edge = |c: &Contact| match c.on {
            [Who::Rigid(number), Who::Skin(_)] => self.tools[number].edge.is_some(),
            _ => false,
        };
        if !contacts.iter().any(by_edge) {
            return Ok(()); // an edge that meets no skin cuts none
        }
        let mut quads = vec![];
        for (number, (old, new)) in old.iter().zip(&self.tools).enumerate() {
            let Some(edge) = &new.edge else { continue };
            for (index, sample) in new.samples.iter().enumerate() {
                let Role::Edge { piece, .. } = sample.role else {
                    continue;
                };
                let id = (number, index);
                let ends = [edge.points[piece], edge.points[piece + 1]];
                let of_piece = |c: &Contact| c.on[0] == Who::Rigid(number) && c.feature == index;
                let contact = contacts.iter().position(of_piece);
                let line = held.get(&id).filter(|line| line.inside || contact.is_some());
                let start = line.map_or(ends.map(|p| old.at(p)), |line| line.ends);
                match contact.filter(|k| !lets_go(&contacts[*k], &report.contact.forces[3 * k..3 * k + 3])) {
                    Some(k) => {
                        let moved = new.at(sample.position) - old.at(sample.position) - report.contact.slips[k];
                        let inside = matches!(contacts[k].law, Law::Cut { .. });
                        self.held.insert(id, Line { ends: start.map(|p| p + moved), inside });
                    }
                    None => quads.extend([start[0], start[1], new.at(ends[1]), new.at(ends[0])].map(|p| p.to_array())),
                }
            }
        }
        for body in &mut self.bodies {
            let hits = body.backend.cut(&quads)?;
            let severed = body.sever(&hits)?;
            report.severed += severed;
            self.epoch += u32::from(severed > 0);
        }
        Ok(())
    }
}

impl Body {
    /// Severs links or springs where they were crossed; returns how many went.
    ///
    /// # Errors
    /// When the device fails.
    pub fn sever(&mut self, hits: &[Hit<f64>]) -> Result<u32> {
        let count = |wound: &Wound| wound.totals.links + wound.totals.springs;
        let before = count(&self.wound);
        let removal = self.wound.apply(&self.model, hits);
        let severed = (count(&self.wound) - before) as u32;
        if severed > 0 {
            self.compliance.forget(removal.free.iter().map(|(node, _)| *node));
            self.backend.remove(&removal)?;
            self.loaded = false;
        }
        Ok(severed)
    }

    /// How far the lips of the wound have parted, of what was located anyway: its severed links and its open cells, m.
    pub(super) fn opening(&self) -> f64 {
        let surface = &self.wound.surface;
        let cuts = surface.parts.cuts();
        cuts.filter_map(|(cell, axis, _)| self.parted(cell as usize, axis)).fold(self.opening_of_cells(), f64::max)
    }

    /// How far the two sides of a severed link have parted along it, the mean of its face's corners, m; none of a face not located whole.
    fn parted(&self, cell: usize, axis: usize) -> Option<f64> {
        let params = self.model.grid.params::<f64>();
        let mut at = params.cell_at(cell);
        at[axis] += 1;
        let parts = &self.wound.surface.parts;
        let (near, far) = (parts.corners(cell), parts.corners(params.cell_id(at)));
        let mut sum = 0.0;
        for (a, b) in face_pairs(axis) {
            let [near, far] = [near[b], far[a]].map(|node| self.located.place(node as u32));
            sum += (far? - near?)[axis];
        }
        Some(0.25 * sum)
    }

    fn opening_of_cells(&self) -> f64 {
        let params = self.model.grid.params::<f64>();
        let Located { nodes, u, .. } = &self.located;
        let mut widest = 0.0f64;
        for (cell, axis) in &self.wound.open {
            let corners = params.corners(*cell as usize);
            let mut sum = 0.0;
            let mut pairs = 0;
            for (a, b) in face_pairs(*axis) {
                let at = |n: usize| nodes.binary_search(&(corners[n] as u32)).ok();
                if let (Some(p), Some(q)) = (at(a), at(b)) {
                    sum += u[q][*axis] - u[p][*axis];
                    pairs += 1;
                }
            }
            if pairs >= 2 {
                widest = widest.max(sum / f64::from(pairs));
            }
        }
        widest
    }
}

/// Corners of a cell's face before along an axis, each with the one beyond.
fn face_pairs(axis: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..8).filter(move |a| corner(*a)[axis] == 0).filter_map(move |a| {
        let mut beyond = corner(a);
        beyond[axis] = 1;
        Some((a, (0..8).find(|b| corner(*b) == beyond)?))
    })
}

/// Whether the force of a contact has reached what the tissue bears.
fn lets_go(contact: &Contact, force: &[f64]) -> bool {
    contact.law.at_bound([force[0], force[1], force[2]])
}
