//! Contacts at the start of a step, and the constraint rows of attachments.

use super::{Body, Refused, Simulation, StepReport};
use crate::bodies::rigid::{Instrument, Role, UnconstrainedMotion};
use crate::collide::sides::{Last, Sides};
use crate::collide::{self, Aabb, Contact, Patch, Search, bodies, edges, features, lips, round};
use crate::constraints::Law;
use crate::error::Result;
use crate::mesh::{Face, MaterialPoint};
use crate::scene::{self, Attachment, BodyId, Integrator, Loop, Scene, attach_of};
use glam::DVec3;
use std::collections::BTreeSet;

/// Share of the alarm distance below which nodes of two deformable bodies count as one position.
const SAME: f64 = 1e-3;
/// Weight from which a contact's point is one of a surface's nodes.
const AT_NODE: f64 = 0.99;
/// Most contacts of a body's lips, as a multiple of the scene's number: a wound across a fine grid has more nodes than a tool touches.
const LIPS: usize = 4;
/// Distance from which ends of a tie that both cannot move are apart, m.
const OPEN: f64 = 1e-6;
/// Largest distance at rest at which an attachment's node is tied to a point of the surface; farther in, to one inside the body, m.
const TOUCHES: f64 = 1e-4;

/// One node of an attachment: constraint rows that hold from the first step on.
#[derive(Clone, Debug)]
pub(super) struct Tie {
    contact: Contact,
    /// Attachment point on the second body: in the frame of a rigid body, in the world for a wall or the world.
    attachment_point: DVec3,
    /// Of the rest-shape spring parallel to the tie, along x, y and z, N/m: it bears the gap that the constraint leaves.
    stiffness: DVec3,
}

impl Tie {
    /// Adds what the spring beside the tie bears to its forces, N, where its contact has moved by `slip`, m.
    pub fn add_spring(&self, contact: &Contact, slip: DVec3, forces: &mut [f64; 3]) {
        (0..3).for_each(|k| forces[k] -= self.stiffness[k] * (contact.gap[k] + contact.axes[k].dot(slip)));
    }

    /// Registers the tie's nodes with their bodies, and each in the list of tied nodes: other body, own body, node.
    pub fn note(&self, bodies: &mut [Body], tied: &mut BTreeSet<(BodyId, usize, u32)>) {
        for side in 0..2 {
            if let BodyId::Deformable(number) = self.contact.on[side] {
                bodies[number].tied.extend(contact_nodes(&self.contact, side));
                tied.extend(contact_nodes(&self.contact, side).map(|node| (self.contact.on[1 - side], number, node)));
            }
        }
    }
}

impl Simulation {
    /// Contacts at the start of the step, up to the scene's number, plus those of lips; then the attachments.
    pub(super) fn find_contacts(
        &mut self,
        law: &scene::Contact,
        free: &[UnconstrainedMotion],
        report: &mut StepReport,
    ) -> Result<Vec<Contact>> {
        let search = Search {
            alarm: law.alarm,
            distance: law.distance,
            friction: law.friction,
            filter: law.filter,
            angle_cone: law.angle_cone,
        };
        // how far each tool may move in the step
        let travel: Vec<f64> = (self.tools.iter().zip(free))
            .map(|(tool, free)| free.translation.length() + free.rotation.length() * tool.span())
            .collect();
        // search: rigid pairs, then deformable bodies; drop what is unexplained or tied already
        let mut found = self.rigid_contacts(&search, &travel);
        self.locate(&search, &travel, report)?;
        let (of_skin, sides) = self.skin_contacts(&search, &travel, free, report);
        found.extend(of_skin);
        self.sides = sides;
        self.drop_unexplained(&search, &mut found, report);
        found.retain(|contact| !self.ties_hold(contact));
        if self.swings > 0 {
            found.iter_mut().for_each(|contact| self.settle(contact));
        }
        let most = law.max_contacts as usize;
        report.contact.depth = found.iter().map(|c| -c.gap[0]).fold(0.0, f64::max);
        // keep those that bore and the deepest, up to the scene's number
        if found.len() > most {
            report.warn("contacts_dropped", (found.len() - most) as u32);
            found.sort_by(|a, b| a.gap[0].total_cmp(&b.gap[0]).then(a.id().cmp(&b.id())));
            found.sort_by_key(|contact| !self.bore(contact));
            found.truncate(most);
        }
        found.extend(self.lips_contacts(&search, LIPS * most, report));
        // lips; a fixed order; attachments last
        found.sort_by_key(Contact::id);
        let open = |tie: &Contact| (0..tie.law.rows()).any(|k| tie.gap[k].abs() > OPEN && !self.gives_way(tie, k));
        let ties: Vec<Contact> = self.ties.iter().map(|tie| self.tied(tie)).collect();
        report.warn("held_apart", ties.iter().filter(|tie| open(tie)).count() as u32);
        found.extend(ties);
        // slips of a static step's earlier solves; penalties know no friction
        for contact in found.iter_mut().filter(|_| law.forces == Loop::Constraints) {
            if let Some(slid) = self.slid.get(&contact.id()) {
                contact.law.friction_rows().for_each(|row| contact.gap[row] = contact.axes[row].dot(*slid));
            }
        }
        Ok(found)
    }

    /// Whether a contact bore a force in the last step. Without it, it may go through in this one, whatever its gap is now.
    fn bore(&self, contact: &Contact) -> bool {
        self.last_forces.get(&contact.id()).is_some_and(|force| *force != DVec3::ZERO)
    }

    /// Contacts of the lips of wounds, per body at most `most`: those that bore, then the deepest.
    fn lips_contacts(&self, search: &Search, most: usize, report: &mut StepReport) -> Vec<Contact> {
        let mut out = vec![];
        for (number, body) in self.bodies.iter().enumerate() {
            let Some(lips) = &body.lips else { continue };
            let position = |id: u32| [body.node_position(id), DVec3::from_array(body.wound.rest[id as usize])];
            let is_free = |id: u32| body.wound.dofs[id as usize][..3].iter().all(|axis| *axis != 0.0);
            // the search reaches farther by the body's own motion
            let mut found = lips::contacts(number, lips, position, is_free, search.alarm + body.travel);
            report.overlap = found.first().map_or(report.overlap, |deepest| report.overlap.max(-deepest.gap[0]));
            found.sort_by_key(|contact| !self.bore(contact));
            let dropped = found.iter().skip(most).filter(|c| c.gap[0] < 0.0).count();
            report.warn("contacts_dropped", dropped as u32);
            found.truncate(most);
            out.extend(found);
        }
        out
    }

    /// Drops contacts that lie deeper than the last step's motion can have brought their sample. A tool enters skin only through the
    /// surface, so such a contact belongs to a surface that the tool did not pass. Each is counted.
    fn drop_unexplained(&mut self, search: &Search, found: &mut Vec<Contact>, report: &mut StepReport) {
        let h = self.step_size();
        let before = std::mem::take(&mut self.depths);
        // a tool may start inside, and in a static step it has no velocity that says how far it came
        let first = self.step_number == 1 || self.scene.time.integrator == Integrator::Static;
        let explained = |contact: &Contact| {
            let Some(sample) = self.sample_of(contact) else { return true };
            let tool = &self.tools[sample.0];
            let moved = h * (tool.velocity.length() + tool.angular_velocity.length() * tool.span())
                + self.bodies[sample.1].travel;
            // a piece of edge that has cut stands in its own cut, at most a cell from the walls, and leads those beside it out of it
            let of_edge = |k: usize| tool.samples.get(k).is_some_and(|s| matches!(s.role, Role::Edge { .. }));
            let beside = contact.feature.saturating_sub(1)..=contact.feature + 1;
            let own_cut =
                of_edge(contact.feature) && beside.into_iter().any(|k| self.fronts.contains_key(&(sample.0, k)));
            let cell = if own_cut { self.bodies[sample.1].model.cell_width() } else { 0.0 };
            let last = before.get(&sample).copied().unwrap_or(0.0).max(cell);
            first || contact.depth <= last + moved + search.alarm
        };
        let dropped: Vec<Contact> = found.extract_if(.., |contact| !explained(contact)).collect();
        report.warn("contacts_unexplained", dropped.len() as u32);
        self.unexplained = dropped.iter().filter_map(|contact| self.sample_of(contact)).collect();
        for contact in found {
            if let Some(sample) = self.sample_of(contact) {
                let depth = self.depths.entry(sample).or_default();
                *depth = depth.max(contact.depth);
            }
        }
    }

    /// Tool, body and sample of a contact of a tool with a deformable body; none for round tools, lines and pairs of edges, whose contact points
    /// move over their surface.
    fn sample_of(&self, contact: &Contact) -> Option<(usize, usize, usize)> {
        let [BodyId::Rigid(number), BodyId::Deformable(body)] = contact.on else { return None };
        let tool = &self.tools[number];
        let of_sample = tool.round.is_none() && tool.lines.is_none() && !edges::is_pair(contact.feature);
        of_sample.then_some((number, body, contact.feature))
    }

    /// Contacts of rigid bodies with walls and with each other.
    fn rigid_contacts(&self, search: &Search, travel: &[f64]) -> Vec<Contact> {
        let mut found = vec![];
        for (number, tool) in self.tools.iter().enumerate() {
            for plane in self.scene.planes.iter().enumerate() {
                found.extend(bodies::with_plane((number, tool), plane, search, travel[number]));
            }
            for (other, second) in self.tools.iter().enumerate().skip(number + 1) {
                let travel = travel[number] + travel[other];
                found.extend(bodies::between_rigid((number, tool), (other, second), search, travel));
            }
        }
        found
    }

    /// Reads back the positions of deformable bodies' nodes near other bodies.
    ///
    /// The search margin suffices for points outside. The nearest surface of a point inside at depth `d` is as far as `d`: if that exceeds the
    /// margin, the margin of its tool grows by `d` and all bodies are located again. (Where it came in may be farther yet; then it is pushed out
    /// of the nearest surface.)
    fn locate(&mut self, search: &Search, travel: &[f64], report: &mut StepReport) -> Result<()> {
        for body in &mut self.bodies {
            body.refit_boxes()?;
        }
        if let Some(number) = self.bodies.iter().position(|body| body.non_finite) {
            return Err(self.non_finite(BodyId::Deformable(number)));
        }
        let mut margins: Vec<f64> = travel.iter().map(|travel| search.alarm + search.distance + travel).collect();
        loop {
            self.locate_within(search, &margins)?;
            let mut widened = false;
            for body in &self.bodies {
                for (k, tool) in self.tools.iter().enumerate() {
                    let depth = body.located.patches[k].as_ref().map_or(0.0, |patch| patch.deepest(tool));
                    if depth > margins[k] {
                        margins[k] += depth;
                        widened = true;
                    }
                }
            }
            if !widened {
                let faces = self.bodies.iter().flat_map(|body| &body.located.faces);
                report.contact.candidates = faces.map(Vec::len).sum();
                return Ok(());
            }
        }
    }

    fn locate_within(&mut self, search: &Search, margins: &[f64]) -> Result<()> {
        let around = |(tool, margin): (_, &f64)| collide::tool_box(tool, *margin);
        let tools: Vec<Aabb> = self.tools.iter().zip(margins).map(around).collect();
        let bodies: Vec<Aabb> = self.bodies.iter().map(|b| b.area(search.alarm + search.distance + b.travel)).collect();
        for number in 0..self.bodies.len() {
            let own = Search { alarm: search.alarm + self.bodies[number].travel, ..*search };
            let walls = self.scene.planes.iter().map(|plane| collide::slab(plane, &bodies[number], &own));
            let others = bodies.iter().enumerate().filter(|(other, _)| *other != number).map(|(_, area)| Some(*area));
            let body = &self.bodies[number];
            let tools = tools.iter().map(|area| Some(collide::wider(area, body.travel)));
            let areas = tools.chain(others).chain(walls);
            let near: Vec<Vec<Face>> = areas.map(|area| area.map_or(vec![], |area| body.faces_near(&area))).collect();
            let walls = self.scene.planes.len(); // their lists come last; a wall meets nodes, not faces
            let patched = near.len() - walls;
            let of_points = |tool: &Instrument| tool.edge.is_none() && tool.round.is_none() && tool.lines.is_none();
            let about_centres: Vec<bool> = self.tools.iter().map(of_points).collect();
            self.bodies[number].locate(near, patched, &about_centres)?;
        }
        Ok(())
    }

    /// Contacts of deformable bodies with all other bodies, and the sides of the skin that tools are on.
    fn skin_contacts(
        &self,
        search: &Search,
        travel: &[f64],
        free: &[UnconstrainedMotion],
        report: &mut StepReport,
    ) -> (Vec<Contact>, Sides) {
        let (mut found, mut sides) = (vec![], Sides::new());
        let (tools, walls) = (self.tools.len(), self.scene.planes.len());
        let patches: Vec<&Vec<Option<Patch>>> = self.bodies.iter().map(|body| &body.located.patches).collect();
        for (number, body) in self.bodies.iter().enumerate() {
            report.opening = report.opening.max(body.opening());
            // the search reaches farther by the body's own motion
            let own = Search { alarm: search.alarm + body.travel, ..*search };
            let position = |id: u32| body.position(id);
            // with tools, by their shape
            for (k, tool) in self.tools.iter().enumerate() {
                let last = Last::new(&self.sides, (k, number), &position);
                let Some(patch) = &patches[number][k] else {
                    sides.extend(last.away().into_iter().map(|(sample, side)| ((k, number, sample), side)));
                    continue;
                };
                let faces = &body.located.faces[k];
                let (of_tool, of_skin) = ((k, tool), (number, patch));
                let (of_pair, of_samples) = match (&tool.round, &tool.lines) {
                    (Some(round), _) => {
                        round::contacts(of_tool, round, of_skin, faces, &position, &own, &free[k], &last)
                    }
                    (None, Some(lines)) => features::contacts(of_tool, lines, of_skin, &own, &free[k], &last),
                    (None, None) => {
                        let retreat = |sample| self.fronts.get(&(k, sample)).copied();
                        let resistance = |cell| body.resistance(cell);
                        collide::contacts(of_tool, of_skin, &own, travel[k], resistance, retreat, &last)
                    }
                };
                found.extend(of_pair);
                sides.extend(of_samples.into_iter().map(|(sample, side)| ((k, number, sample), side)));
                let of_nodes = bodies::skin_on_box((number, faces), &position, of_tool, &own, travel[k]);
                let held = nodes_that_touch(&of_nodes, number);
                let surface = (number, patch, &faces[..]);
                found.extend(edges::of_box(of_tool, surface, &position, &held, &own, travel[k]));
                found.extend(of_nodes);
            }
            // with walls
            let others = self.bodies.len() - 1;
            for (wall, plane) in self.scene.planes.iter().enumerate() {
                let faces = &body.located.faces[tools + others + wall];
                found.extend(bodies::skin_on_plane((number, faces), &position, (wall, plane), &own));
            }
            // with the other deformable bodies, both ways round
            for other in number + 1..self.bodies.len() {
                let second = &self.bodies[other];
                let (here, there) = (tools + other - 1, tools + number);
                let at_second = |id: u32| second.position(id);
                let same = SAME * search.alarm;
                let both = Search { alarm: own.alarm + second.travel, ..*search };
                let mut pairs = vec![];
                if let Some(patch) = &patches[other][there] {
                    let faces = &body.located.faces[here];
                    pairs = bodies::skin_on_skin((number, faces, &position), (other, patch), &both, &[], same);
                }
                let (faces, others) = (&body.located.faces[here], &second.located.faces[there]);
                if let Some(patch) = &patches[number][here] {
                    let skip: Vec<DVec3> = pairs.iter().map(|c: &Contact| c.point).collect();
                    let back = (other, &others[..], &at_second);
                    pairs.extend(bodies::skin_on_skin(back, (number, patch), &both, &skip, same));
                }
                // edges, where no node holds them
                if let Some(patch) = &patches[other][there] {
                    let held = [number, other].map(|of| nodes_that_touch(&pairs, of));
                    let here = (number, &faces[..], &position, &held[0]);
                    let there = (other, &others[..], &at_second, &held[1]);
                    found.extend(edges::of_surfaces(here, there, patch, &both));
                }
                found.extend(pairs);
            }
            debug_assert_eq!(body.located.faces.len(), tools + others + walls);
        }
        // forces on an embedded surface, or on carved space, act on the nodes of the cells
        for contact in &mut found {
            for side in 0..2 {
                if let BodyId::Deformable(number) = contact.on[side] {
                    let point = std::mem::take(&mut contact.points[side]);
                    let body = &self.bodies[number];
                    contact.points[side] = body.model.on_nodes(body.wound.surface.on_nodes(point));
                }
            }
        }
        // skin that is held against a wall rests on what holds it; that it is driven into one is said
        let deeper = |contact: &&Contact| contact.gap[0] < -search.alarm && !self.gives_way(contact, 0);
        report.warn("held_overlap", found.iter().filter(deeper).count() as u32);
        found.retain(|contact| self.gives_way(contact, 0));
        (found, sides)
    }

    /// Whether one side of a contact can move along one of its axes.
    fn gives_way(&self, contact: &Contact, axis: usize) -> bool {
        (0..2).any(|side| match contact.on[side] {
            BodyId::Rigid(_) => true,
            BodyId::Deformable(number) => contact_nodes(contact, side).any(|node| {
                let [x, y, z, _] = self.bodies[number].wound.dofs[node as usize];
                (DVec3::new(x, y, z) * contact.axes[axis]).length_squared() > 1e-12
            }),
            BodyId::Plane(_) | BodyId::World => false,
        })
    }

    /// Whether a contact acts on a node that is already tied to the other body.
    fn ties_hold(&self, contact: &Contact) -> bool {
        (0..2).any(|side| match contact.on[side] {
            BodyId::Deformable(number) => {
                contact_nodes(contact, side).any(|node| self.tied.contains(&(contact.on[1 - side], number, node)))
            }
            _ => false,
        })
    }

    /// A tie's contact at the present positions.
    fn tied(&self, tie: &Tie) -> Contact {
        let mut contact = tie.contact.clone();
        let position = |side: usize| match contact.on[side] {
            BodyId::Deformable(body) => {
                // nodes, not surface corners, which move off the nodes when cut: a tie's point must not
                self.bodies[body].position_of(&contact.points[side])
            }
            BodyId::Rigid(number) => self.tools[number].at(tie.attachment_point),
            BodyId::Plane(_) | BodyId::World => tie.attachment_point,
        };
        let (first, second): (DVec3, DVec3) = (position(0), position(1));
        contact.point = first;
        contact.gap = contact.axes.map(|axis| axis.dot(first - second));
        if let Law::Slide { .. } = contact.law {
            contact.gap[2] = 0.0; // friction acts on the slip of the step alone
        }
        contact
    }
}

/// Nodes of a deformable body at which contacts act, without those that only have a share in a point of a face.
fn nodes_that_touch(contacts: &[Contact], body: usize) -> BTreeSet<u32> {
    let sides = contacts.iter().flat_map(|contact| contact.on.iter().zip(&contact.points));
    let own = sides.filter(|(on, _)| **on == BodyId::Deformable(body)).flat_map(|(_, point)| &point.0);
    own.filter(|(_, weight)| *weight > AT_NODE).map(|(node, _)| *node).collect()
}

/// Nodes on one side of a contact.
fn contact_nodes(contact: &Contact, side: usize) -> impl Iterator<Item = u32> {
    contact.points[side].nodes()
}

/// Ties of a scene's attachments, one per node, from the bodies at rest.
///
/// # Errors
/// [`Refused::TiedToNothing`] when a node of the region is neither on the other body's surface nor inside it.
pub(super) fn ties(simulation: &Simulation, scene: &Scene) -> Result<Vec<Tie>> {
    let mut out = vec![];
    for (number, attachment) in scene.attachments.iter().enumerate() {
        let model = &simulation.bodies[attachment.body].model;
        let patch = match attachment.to {
            BodyId::Deformable(other) => {
                let wound = &simulation.bodies[other].wound;
                Patch::new(&wound.surface.all(), |id| DVec3::from_array(wound.rest[id as usize]))
            }
            _ => None,
        };
        let nodes = model.nodes_in(&attachment.region);
        let (axes, law) = rows(attachment, nodes.len());
        let stiffness = model.stiffness_of_tie(scene, attachment);
        for node in nodes {
            let at = DVec3::from_array(model.rest[node as usize]);
            let apart = |distance: f64| Refused::TiedToNothing {
                at: scene.at(&attach_of(number)),
                position: at.to_array().map(|c| c * 1e3),
                distance: distance * 1e3,
            };
            let (point, attachment_point) = other_end(simulation, attachment.to, patch.as_ref(), at).map_err(apart)?;
            let contact = Contact {
                on: [BodyId::Deformable(attachment.body), attachment.to],
                points: [MaterialPoint::node(node), point],
                feature: number << 32 | node as usize,
                point: at,
                axes,
                gap: [0.0; 3],
                depth: 0.0,
                law,
            };
            // along a prescribed axis the spring bears nothing
            let [x, y, z, _] = model.dofs[node as usize];
            out.push(Tie { contact, attachment_point, stiffness: DVec3::new(x, y, z) * stiffness });
        }
    }
    Ok(out)
}

/// Axes and law of an attachment's ties; the resistance of its path is shared evenly among its nodes.
fn rows(attachment: &Attachment, nodes: usize) -> ([DVec3; 3], Law) {
    let Some(slide) = attachment.slide else { return (DVec3::AXES, Law::Bilateral { rows: 3 }) };
    let [along, s, t] = collide::frame(DVec3::from_array(slide.direction));
    let law = match slide.friction == 0.0 && slide.resistance == 0.0 {
        true => Law::Bilateral { rows: 2 },
        false => Law::Slide { friction: slide.friction, resistance: slide.resistance / nodes.max(1) as f64 },
    };
    ([s, t, along], law)
}

/// Attachment point on the other body for a rest position `at`: the material point of a deformable body, on its surface or inside, and the
/// point as a [`Tie`] keeps it; the distance to the body, m, if it is not there.
fn other_end(
    simulation: &Simulation,
    to: BodyId,
    patch: Option<&Patch>,
    at: DVec3,
) -> std::result::Result<(MaterialPoint, DVec3), f64> {
    match (to, patch) {
        (BodyId::Rigid(number), _) => {
            let tool = &simulation.tools[number];
            Ok((MaterialPoint::default(), tool.rotation.inverse() * (at - tool.position)))
        }
        (BodyId::Deformable(other), Some(patch)) => {
            let (on_surface, distance) = patch.nearest(at);
            let model = &simulation.bodies[other].model;
            let inside = || model.material_point(at.to_array());
            match distance <= TOUCHES {
                true => Ok((model.on_nodes(on_surface), at)),
                false => Ok((inside().ok_or(distance)?, at)),
            }
        }
        (BodyId::Deformable(_), None) => Err(f64::INFINITY),
        (BodyId::Plane(_) | BodyId::World, _) => Ok((MaterialPoint::default(), at)),
    }
}
