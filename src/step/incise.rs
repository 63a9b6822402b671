//! Cutting in a step: the surface that a blade's edge swept through the skin goes to the cut kernel; the links or springs that it hits are
//! cut.
//!
//! A piece of edge that the tissue holds (its force is below the bound) cuts nothing, but parts of it may pass a link all the same, since
//! it is held at its sample alone. Its sweep is therefore put off: the ends of the piece keep the positions from which they have not yet
//! swept, carried along with the skin at its contact, until the tissue lets go. Neighbouring pieces share their ends, so sweeps at
//! different times leave no gap.
//!
//! A piece that has cut stands at the front of its cut, whichever cell it is in, and is held there as it advances: its retreat from that
//! front, not the cell, tells opened tissue from new tissue. The work of cutting is then toughness times area (Atkins 2009), and the force
//! does not pulsate from cell to cell.

use super::body::{Body, Cut, Known, Located};
use super::probes::query;
use super::{Simulation, StepReport};
use crate::backend::Query;
use crate::bodies::rigid::{Instrument, Role};
use crate::bodies::{Removal, Wound};
use crate::collide::{Contact, distance_from, lips};
use crate::constraints::Law;
use crate::error::Result;
use crate::kernels::corner;
use crate::kernels::cut::Hit;
use crate::math::V3;
use crate::mesh::{Carved, Face, MaterialPoint};
use crate::scene::{self, BodyId};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// Shift of what an edge has swept, in widths of a cell. A blade that is led through centres of cells (through nodes of springs), as in the
/// plane of symmetry of a patch, would sever the links on either side of them, whichever their least motion decides: 44 in place of 40 in a
/// cut of 11 mm on 25 × 25 cells, 54 in place of 37 where the skin is drawn, in a zigzag whose lips lock. No two components alike, for cuts
/// aslant.
const ASIDE: DVec3 = DVec3::new(0.01, 0.007, 0.0045);

/// Ends of sticking pieces of edge, whose sweep is postponed, by tool and number along the edge.
pub(super) type Postponed = BTreeMap<(usize, usize), PostponedEnd>;

/// Retreat of pieces of edge from the front of their cut, m, by tool and sample.
pub(super) type Fronts = BTreeMap<(usize, usize), f64>;

/// Contact of a tool that carves space: see [`Simulation::carved_cells`].
struct Touched {
    at: DVec3,
    cell: u32,
    gap: f64,
    force: f64,
}

/// Swept position of the end of a sticking piece.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct PostponedEnd {
    /// Its position when it last swept, moved with the skin since, m.
    at: DVec3,
    /// Inside the tissue. An end that was only pressed on it and lifts off has cut nothing, unless the wound has opened under it. One that
    /// advances has passed what it was pressed on: over a border, nothing is left to touch.
    inside: bool,
}

/// State of a piece of edge in a step.
#[derive(Clone, Copy, Default)]
struct Piece {
    /// Touches the skin or is in its wound.
    touches: bool,
    /// Motion of the skin that holds it, m, and whether it is inside; none for a piece that advances.
    sticking: Option<(DVec3, bool)>,
    /// Index of its sample in the tool's.
    sample: usize,
}

/// Point of the surface that a contact is on, m.
fn foot(contact: &Contact) -> DVec3 {
    contact.point - contact.axes[0] * contact.gap[0]
}

impl Simulation {
    /// Whether an edge touches skin in a step: without a contact it cuts nothing.
    pub(super) fn edges_meet_skin(&self, contacts: &[Contact]) -> bool {
        contacts.iter().any(|contact| match contact.on {
            [BodyId::Rigid(number), BodyId::Deformable(_)] => {
                self.tools[number].edge.is_some() && self.tools[number].sharp
            }
            _ => false,
        })
    }

    /// Cuts what the edges have swept; `cuts` says whether any of them touches skin.
    pub(super) fn incise(&mut self, old: &[Instrument], cuts: bool, report: &mut StepReport) -> Result<()> {
        let contacts = std::mem::take(&mut report.contact.contacts);
        let refused = self.totals().refused;
        let done = self.sweep(old, &contacts, cuts, report);
        report.contact.contacts = contacts;
        report.warn("cut_reserve_exhausted", (self.totals().refused - refused) as u32);
        done
    }

    /// Removes the tissue that tools carve, where they are near enough and press hard enough: the cells behind their contacts, or the space
    /// that they reach.
    pub(super) fn carve(&mut self, report: &mut StepReport) -> Result<()> {
        let contact = &report.contact;
        let mut cells: Vec<Vec<u32>> = vec![vec![]; self.bodies.len()];
        for (k, found) in contact.contacts.iter().enumerate() {
            let [BodyId::Rigid(tool), BodyId::Deformable(number)] = found.on else { continue };
            let Some(carve) = self.scene.tools[tool].carve else { continue };
            if !carve.whole_cells || !self.scene.skins[number].can_be_carved() {
                continue;
            }
            // the face that the contact is on, and what presses on it; out of a pit contacts are on the nodes of cells
            let located = &self.bodies[number].located;
            let of = |point: &MaterialPoint| {
                let holds = |face: &&Face| point.nodes().all(|node| face.nodes.contains(&node));
                located.faces[tool].iter().find(holds)
            };
            let nearest = || located.patches[tool].as_ref().map(|patch| patch.nearest(foot(found)).0);
            let in_pit = self.bodies[number].wound.surface.has_pit();
            let face = if in_pit { nearest().and_then(|point| of(&point)) } else { of(&found.points[1]) };
            let Some(face) = face else { continue };
            let area = self.bodies[number].area_of(face);
            let gap = found.gap[0] + found.axes[0].dot(contact.slips[k]);
            if gap <= carve.distance && contact.forces[k][0] >= carve.pressure * area {
                cells[number].push(face.cell);
            }
        }
        for (number, mut cells) in cells.into_iter().enumerate() {
            cells.sort_unstable();
            cells.dedup();
            let space = self.scene.carves_space(number);
            let carves = |tool: &usize| space && self.scene.tools[*tool].carve.is_some_and(|carve| !carve.whole_cells);
            let tools: Vec<usize> = (0..self.scene.tools.len()).filter(carves).collect();
            let (mass, volume) = (self.bodies[number].wound.mass_of_nodes(), self.bodies[number].wound.totals.volume);
            let mut removed = self.bodies[number].carve(&cells)?;
            for tool in tools {
                self.bodies[number].wound.surface.prepare();
                let near = self.carved_cells(tool, number, report);
                // from the surface that contacts keep away from the tool
                let kept = self.scene.contact.map_or(0.0, |contact| contact.distance);
                let reach = self.scene.tools[tool].carve.map_or(0.0, |carve| carve.distance) + kept;
                let body = &mut self.bodies[number];
                let carved = body.reached(&near, (tool, &self.tools[tool]), reach)?;
                removed += body.carve_space(&carved)?;
            }
            report.carved += removed;
            self.epoch += u32::from(self.bodies[number].wound.totals.volume > volume);
            self.book_removal(number, mass, self.bodies[number].boxes.farthest());
        }
        Ok(())
    }

    /// Books what a body has lost of its `mass` before, kg: mass that has left takes its potential with it. Its displacement is at most
    /// `farthest`, m.
    fn book_removal(&mut self, number: usize, mass: f64, farthest: f64) {
        let body = &self.bodies[number];
        let weight = DVec3::from_array(body.model.step.gravity).length() * (mass - body.wound.mass_of_nodes());
        self.booked.removed += weight.max(0.0) * farthest;
    }

    /// Present cells of a body, in ascending order, out of which a tool may take space: those around the contacts that are within its reach and
    /// press hard enough, by the mean over a cell's width, and the cells beside them.
    fn carved_cells(&self, tool: usize, number: usize, report: &StepReport) -> Vec<u32> {
        let (contact, body) = (&report.contact, &self.bodies[number]);
        let (Some(carve), Some(patch)) = (self.scene.tools[tool].carve, &body.located.patches[tool]) else {
            return vec![];
        };
        let corners: BTreeMap<u32, DVec3> = (body.located.faces[tool].iter().flat_map(|face| face.nodes))
            .map(|node| (node, DVec3::from_array(body.wound.rest_of_corner(node))))
            .collect();
        let rest = |node: u32| corners.get(&node).copied().unwrap_or_default();
        // where contacts are at rest, the cell there, the present gap and the force
        let of_pair = |c: &Contact| c.on == [BodyId::Rigid(tool), BodyId::Deformable(number)];
        let touched: Vec<Touched> = (contact.contacts.iter().enumerate())
            .filter(|(_, c)| of_pair(c))
            .map(|(k, c)| {
                let (at, cell) = patch.at_rest(foot(c), rest);
                Touched { at, cell, gap: c.gap[0] + c.axes[0].dot(contact.slips[k]), force: contact.forces[k][0] }
            })
            .collect();
        let mut areas: BTreeMap<u32, f64> = BTreeMap::new();
        for face in body.located.faces[tool].iter().filter(|face| touched.iter().any(|t| t.cell == face.cell)) {
            *areas.entry(face.cell).or_default() += body.area_of(face);
        }
        let width = body.model.cell_width();
        let presses = |here: &&Touched| {
            let near = || touched.iter().filter(|t| t.at.distance(here.at) <= width);
            let cells: BTreeSet<u32> = near().map(|t| t.cell).collect();
            let area: f64 = cells.iter().filter_map(|cell| areas.get(cell)).sum();
            near().map(|t| t.force).sum::<f64>() >= carve.pressure * area
        };
        let taken: Vec<&Touched> = touched.iter().filter(|here| here.gap <= carve.distance).filter(presses).collect();
        let beside = |cell: u32| body.wound.surface.beside(cell as usize).into_iter().map(|cell| cell as u32);
        // a face may be larger than the mean width
        let mut cells: BTreeSet<u32> = taken.iter().flat_map(|here| beside(here.cell)).collect();
        for face in &body.located.faces[tool] {
            let corners = face.corners();
            let centre = corners.iter().map(|node| rest(*node)).sum::<DVec3>() / corners.len() as f64;
            if taken.iter().any(|here| here.at.distance(centre) <= 1.5 * width) {
                cells.extend(beside(face.cell));
            }
        }
        cells.into_iter().collect()
    }

    /// Moves the fronts of the pieces of edge: sticking pieces move relative to the skin, the others by their own motion. A piece that has
    /// left the wound loses its front.
    fn follow_fronts(&mut self, old: &[Instrument], contacts: &[Contact], report: &StepReport) {
        let fronts = std::mem::take(&mut self.fronts);
        for (number, (old, new)) in old.iter().zip(&self.tools).enumerate() {
            let Some(edge) = new.edge.as_ref().filter(|_| new.sharp) else { continue };
            let forward = new.rotation * edge.forward;
            let pieces = new.samples.iter().enumerate().filter(|(_, s)| matches!(s.role, Role::Edge { .. }));
            for (index, sample) in pieces {
                let cutting = |c: &Contact| {
                    c.on[0] == BodyId::Rigid(number) && c.feature == index && matches!(c.law, Law::Cut { .. })
                };
                let before = fronts.get(&(number, index));
                let (retreat, motion) = match (contacts.iter().position(cutting), before) {
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

    /// Whether a point near a tool is inside a body or in its wound.
    fn in_wound(&self, tool: usize, point: DVec3) -> bool {
        let patches = self.bodies.iter().filter_map(|body| body.located.patches.get(tool)?.as_ref());
        patches.into_iter().any(|patch| patch.in_wound(point))
    }

    /// States of the pieces of a tool's edge, in order.
    fn pieces(&self, number: usize, old: &Instrument, contacts: &[Contact], report: &StepReport) -> Vec<Piece> {
        let new = &self.tools[number];
        let count = new.edge.as_ref().map_or(0, |edge| edge.points.len() - 1);
        let mut out = vec![Piece::default(); count];
        for (index, sample) in new.samples.iter().enumerate() {
            let Role::Edge { piece, .. } = sample.role else { continue };
            // walls and rigid bodies hold no edge in tissue
            let of_piece = |k: &usize| {
                let Contact { on, feature, .. } = &contacts[*k];
                on[0] == BodyId::Rigid(number) && matches!(on[1], BodyId::Deformable(_)) && *feature == index
            };
            let mut touched = (0..contacts.len()).filter(of_piece).peekable();
            let sticks = |k: &usize| !contacts[*k].law.at_bound(report.contact.forces[*k]);
            out[piece] = Piece {
                touches: touched.peek().is_some() || self.in_wound(number, new.at(sample.position)),
                sticking: touched.find(sticks).map(|k| {
                    let moved = new.at(sample.position) - old.at(sample.position) - report.contact.slips[k];
                    (moved, matches!(contacts[k].law, Law::Cut { .. }))
                }),
                sample: index,
            };
        }
        out
    }

    /// Sweeps the edges of all tools and cuts every body by the swept quads.
    fn sweep(&mut self, old: &[Instrument], contacts: &[Contact], cuts: bool, report: &mut StepReport) -> Result<()> {
        self.follow_fronts(old, contacts, report);
        let postponed = std::mem::take(&mut self.postponed);
        if !cuts {
            return Ok(());
        }
        // quads that the pieces of each edge sweep, with tool and sample
        let mut quads: Vec<(usize, usize, [DVec3; 4])> = vec![];
        for (number, (old, new)) in old.iter().zip(&self.tools).enumerate() {
            let Some(edge) = new.edge.as_ref().filter(|_| new.sharp) else { continue };
            let pieces = self.pieces(number, old, contacts, report);
            let forward = new.rotation * edge.forward;
            // an end sticks if one of its two pieces does; it sweeps from where it last stopped
            let ends: Vec<[DVec3; 2]> = (0..edge.points.len())
                .map(|end| {
                    let beside = &pieces[end.saturating_sub(1)..(end + 1).min(pieces.len())];
                    let passes = |e: &PostponedEnd| (new.at(edge.points[end]) - e.at).dot(forward) > 0.0;
                    let continues = |e: &&PostponedEnd| e.inside || beside.iter().any(|p| p.touches) || passes(e);
                    let kept = postponed.get(&(number, end)).filter(continues);
                    let start = kept.map_or(old.at(edge.points[end]), |e| e.at);
                    let sticking: Vec<(DVec3, bool)> = beside.iter().filter_map(|p| p.sticking).collect();
                    if sticking.is_empty() {
                        return [start, new.at(edge.points[end])];
                    }
                    let moved = sticking.iter().map(|h| h.0).sum::<DVec3>() / sticking.len() as f64;
                    let kept = PostponedEnd { at: start + moved, inside: sticking.iter().any(|h| h.1) };
                    self.postponed.insert((number, end), kept);
                    [start, kept.at]
                })
                .collect();
            // sticking pieces sweep as well: a link that slips past one, moving unlike the skin at its contact, is behind the blade
            for (pair, piece) in ends.windows(2).zip(&pieces) {
                let [a, b] = [pair[0], pair[1]];
                quads.push((number, piece.sample, [a[0], b[0], b[1], a[1]]));
            }
        }
        // cut the bodies, but not with pieces that are where no motion can have brought them
        for number in 0..self.bodies.len() {
            let body = &mut self.bodies[number];
            report.costs.cut_tests += body.model.mechanics().segment_count(&body.model) as u64;
            let aside = ASIDE * body.model.cell_width();
            let explained =
                quads.iter().filter(|(tool, sample, _)| !self.unexplained.contains(&(*tool, number, *sample)));
            let moved =
                explained.flat_map(|(_, _, corners)| corners.map(|corner| (corner + aside).to_array())).collect();
            let mut hits = body.read(Query { quads: moved, ..query(&self.probes, number) })?;
            // cells and springs are removed whole: there the shifted hit says which of two
            if matches!(self.scene.skins[number].cut, scene::Cut::Split { .. }) {
                hits.iter_mut().for_each(|hit| body.move_back(hit, aside));
            }
            self.sever(number, &hits, self.bodies[number].boxes.farthest(), report)?;
        }
        Ok(())
    }

    /// Breaks springs that are stretched beyond their layer's limit.
    pub(super) fn break_springs(&mut self, report: &mut StepReport) -> Result<()> {
        for number in 0..self.bodies.len() {
            if self.scene.skins[number].breaks() {
                let body = &mut self.bodies[number];
                let u = body.backend.displacements()?;
                let hits = body.model.overstretched(&body.wound, &u);
                if hits.is_empty() {
                    continue;
                }
                let farthest = u.iter().map(|u| V3::from4(*u).length()).fold(0.0, f64::max);
                self.sever(number, &hits, farthest, report)?;
            }
        }
        Ok(())
    }

    /// Cuts links or springs of a body at these hits; its nodes have moved by `farthest` at most, m.
    fn sever(&mut self, number: usize, hits: &[Hit<f64>], farthest: f64, report: &mut StepReport) -> Result<()> {
        let body = &mut self.bodies[number];
        let mass = body.wound.mass_of_nodes();
        let severed = body.sever(hits)?;
        if severed > 0 {
            self.book_removal(number, mass, farthest);
        }
        report.severed += severed;
        self.epoch += u32::from(severed > 0);
        Ok(())
    }
}

impl Body {
    /// Moves a hit back along its link by the shift of the blade, as where the blade crosses it at a right angle in skin that has not turned:
    /// elsewhere it stays off by about the shift. The lips' surface goes through it.
    fn move_back(&self, hit: &mut Hit<f64>, aside: DVec3) {
        let rest = |node: usize| DVec3::from_array(self.wound.rest[node]);
        let centre = |cell: usize| self.wound.surface.corners_of(cell).map(rest).iter().sum::<DVec3>() * 0.125;
        let [from, to] = self.wound.surface.ends_of_link(hit.segment as usize).map(centre);
        let along = to - from;
        if along != DVec3::ZERO {
            hit.at = (hit.at - aside.dot(along) / along.length_squared()).clamp(0.0, 1.0);
        }
    }

    /// Cuts links or springs at these hits; returns how many were cut.
    ///
    /// # Errors
    /// When the device fails.
    pub fn sever(&mut self, hits: &[Hit<f64>]) -> Result<u32> {
        if hits.is_empty() {
            return Ok(0);
        }
        self.cuts.push(Cut::Swept(hits.to_vec()));
        let count = |wound: &Wound| wound.totals.links + wound.totals.springs_removed;
        let before = count(&self.wound);
        let removal = self.wound.apply(&self.model, hits);
        let severed = (count(&self.wound) - before) as u32;
        if severed > 0 {
            self.apply(&removal)?;
        }
        Ok(severed)
    }

    /// Removes cells, and what would hang by an edge or a corner without them; returns how many cells were removed.
    ///
    /// # Errors
    /// When the device fails.
    pub fn carve(&mut self, cells: &[u32]) -> Result<u32> {
        if cells.is_empty() {
            return Ok(0);
        }
        self.cuts.push(Cut::Carved(cells.to_vec()));
        let removal = self.wound.carve(&self.model, cells);
        self.apply(&removal)?;
        Ok(removal.cells.len() as u32)
    }

    /// What a tool reaches of some cells, in ascending order, at their present positions: all that is nearer to its surface than `reach`, m.
    ///
    /// # Errors
    /// When the device fails.
    fn reached(&mut self, cells: &[u32], (number, tool): (usize, &Instrument), reach: f64) -> Result<Carved> {
        let mut nodes: Vec<u32> =
            cells.iter().flat_map(|c| self.wound.surface.corners_of(*c as usize)).map(|node| node as u32).collect();
        nodes.sort_unstable();
        nodes.dedup();
        if nodes.is_empty() {
            return Ok(Carved::default());
        }
        self.read(Query { displacements: nodes, ..Query::default() })?;
        let (known, origin) = (&self.known.u, self.origin());
        let moved = |node: u32| known[&node];
        let distance = |at: [f64; 3]| {
            let (distance, along) = distance_from(tool, DVec3::from_array(at) + origin);
            (distance - reach, along.to_array())
        };
        Ok(self.wound.surface.reached((cells, &self.located.faces[number]), &moved, &distance))
    }

    /// Removes space; returns how many cells are gone with it.
    ///
    /// # Errors
    /// When the device fails.
    pub fn carve_space(&mut self, carved: &Carved) -> Result<u32> {
        if carved.cells.is_empty() {
            return Ok(0);
        }
        self.cuts.push(Cut::Space(carved.clone()));
        let removal = self.wound.carve_space(&self.model, carved);
        self.apply(&removal)?;
        Ok(removal.cells.len() as u32)
    }

    /// Area of a located face, m².
    fn area_of(&self, face: &Face) -> f64 {
        let [a, b, c, d] = face.nodes.map(|node| self.position(node));
        0.5 * (c - a).cross(d - b).length()
    }

    /// Applies the changes of a wound.
    fn apply(&mut self, removal: &Removal) -> Result<()> {
        let changed = removal.dofs.iter().map(|(node, _)| *node);
        self.compliance.invalidate(changed.chain(removal.loose.iter().copied()));
        self.backend.remove(removal)?;
        if let Some(lips) = &mut self.lips {
            let surface = &self.wound.surface;
            let of_grid = || lips::faces(&surface.parts, &surface.alive);
            *lips = surface.tetrahedra().map_or_else(of_grid, lips::triangles);
        }
        self.known = Known::default();
        self.loaded = false;
        Ok(())
    }

    /// Opening of the wound over its severed links and open cells, as far as they were located, m.
    pub(super) fn opening(&self) -> f64 {
        let surface = &self.wound.surface;
        if let Some(of) = surface.tetrahedra() {
            return of.cuts().filter_map(|link| self.faces_parted(of.faces(link))).fold(0.0, f64::max);
        }
        let cuts = surface.parts.cuts();
        cuts.filter_map(|(cell, axis, _)| self.parted(cell as usize, axis)).fold(self.opening_of_cells(), f64::max)
    }

    /// Distance that the two sides of a severed link have parted along it, mean over its face's corners, m; none if not all were located.
    fn parted(&self, cell: usize, axis: usize) -> Option<f64> {
        let parts = &self.wound.surface.parts;
        let (near, far) = (parts.corners(cell), parts.corners(parts.beyond(cell, axis)?));
        let mut sum = 0.0;
        for (a, b) in face_pairs(axis) {
            let [near, far] = [near[b], far[a]].map(|node| self.located.corner_position(node as u32));
            sum += (far? - near?)[axis];
        }
        Some(0.25 * sum)
    }

    /// Distance that the two faces of a severed link have parted along their normal at rest, mean over their corners, m; none if not all
    /// were located.
    fn faces_parted(&self, [near, far]: [[u32; 3]; 2]) -> Option<f64> {
        let [a, b, c] = near.map(|node| DVec3::from_array(self.wound.rest[node as usize]));
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let position = |node: u32| self.located.corner_position(node);
        let gaps = near.into_iter().zip(far).map(|(near, far)| Some(normal.dot(position(far)? - position(near)?)));
        Some(gaps.collect::<Option<Vec<f64>>>()?.iter().sum::<f64>() / 3.0)
    }

    /// Widest opening of the open cells along their axes, m; a cell counts with at least two pairs of corners located.
    fn opening_of_cells(&self) -> f64 {
        let Located { nodes, u, .. } = &self.located;
        let mut widest = 0.0f64;
        for (cell, axis) in &self.wound.open {
            let corners = self.wound.surface.params().corners(*cell as usize);
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

/// Corners of a cell's lower face along an axis, each with the opposite one.
fn face_pairs(axis: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..8).filter(move |a| corner(*a)[axis] == 0).filter_map(move |a| {
        let mut beyond = corner(a);
        beyond[axis] = 1;
        Some((a, (0..8).find(|b| corner(*b) == beyond)?))
    })
}
