//! Static steps: linear solves with their contact, until the forces balance with the loads and the hands of the step's end.
//!
//! Friction acts against the slip of the whole step. Against that of each solve alone, it faded as solves went on: a sphere pressed by
//! 1.9 of 5 mm and slid was held by 0.1420 and 0.1424 N in steps of 10 and 5 ms, and is by 0.1442 N in both, with a sixth fewer solves.
//!
//! A face under a tool tilts, so that the nearest point is another one; pressed there it tilts back. Where cells are as large as a tool, solves
//! go to and fro between the two. Contacts then settle between where they were and where they are; at the balance both are the same.

use super::contact::ContactReport;
use super::{Refused, Simulation, StepReport, refused};
use crate::collide::{Contact, frame};
use crate::error::{Result, unless};
use crate::math::larger;
use crate::mesh::MaterialPoint;
use crate::scene::{BodyId, STEP};
use glam::DVec3;
use std::collections::BTreeMap;

/// Most linear solves, with their contact, of a static step.
const MOST_STATIC: u32 = 1000;
/// Most of them running that bring the step no nearer to balance: what is left is then rounding, or goes to and fro.
const IDLE_STATIC: u32 = 200;
/// Those of them after which contacts settle the more ([`Simulation::settle`]).
const SWINGS_STATIC: u32 = 6;
/// Part of the least imbalance so far that a solve has to come below to bring the step nearer.
const NEARER: f64 = 0.99;

/// Where a round tool's contact was in a solve.
pub(super) struct Touched {
    on_skin: MaterialPoint,
    normal: DVec3,
    /// Point of the tool's axis, in its own frame, m.
    centre: DVec3,
}

impl Simulation {
    /// Takes a static step.
    pub(super) fn balance(&mut self, check: bool) -> Result<StepReport> {
        let tolerance = self.scene.solver.tolerance;
        self.slid.clear();
        self.swings = 0;
        self.bodies.iter_mut().for_each(|body| body.loaded = false);
        let (mut report, mut forces) = self.solve_from(self.time, false)?;
        let (mut away, mut nearest) = (0.0, f64::INFINITY);
        let (mut solves, mut idle) = (1, 0);
        while solves < MOST_STATIC && idle < IDLE_STATIC {
            unless(&self.interrupt)?;
            // out of balance: the bodies, or the hands, which the tools' forces follow
            let mut left = 0.0;
            for (number, body) in self.bodies.iter_mut().enumerate() {
                let contact = forces.as_ref().map_or(&[][..], |forces| &forces[number]);
                left = larger(left, body.out_of_balance(contact, &self.scene, self.time)?);
            }
            let before = report.contact.on_tool.clone();
            let balanced = left <= tolerance;
            self.swings = self.swings.max(idle / SWINGS_STATIC);
            let (next, of_next) = self.solve_from(self.time, check && balanced)?;
            forces = of_next;
            solves += 1;
            let open = refused::OPEN.iter().any(|name| next.warnings.contains_key(name));
            report.followed_by(next);
            let scale = report.contact.largest_on_tools();
            let change = before.iter().zip(&report.contact.on_tool);
            let change = change.map(|(a, b)| (DVec3::from_array(*a) - DVec3::from_array(*b)).length());
            let change = change.fold(0.0, f64::max);
            if balanced && !open && change <= tolerance * scale {
                return Ok(report);
            }
            away = larger(left, if scale > 0.0 { change / scale } else { 0.0 });
            (nearest, idle) = if away < NEARER * nearest { (away, 0) } else { (nearest, idle + 1) };
        }
        let fix = refused::mends_balance(&report.warnings, self.single || self.gpu.is_some());
        let (at, time) = (self.scene.at(STEP), self.time);
        Err(Refused::NoBalance { at, time, iterations: solves, left: away, tolerance, fix }.into())
    }

    /// Keeps what the next solve of the step needs of the last one's contacts.
    pub(super) fn keep_contacts(&mut self, last: &ContactReport) {
        self.slid = self.slid_by(last);
        let touched = |contact: &Contact| {
            let BodyId::Rigid(number) = contact.on[0] else { return None };
            let tool = &self.tools[number];
            let centre = contact.point + contact.axes[0] * tool.round?.radius;
            let centre = tool.rotation.inverse() * (centre - tool.position);
            Some((contact.id(), Touched { on_skin: contact.points[1].clone(), normal: contact.axes[0], centre }))
        };
        self.touched = last.contacts.iter().filter_map(touched).collect();
    }

    /// Slips of contacts since they have borne a force in a static step, after one more of its solves: along their friction's axes, without
    /// those of tools of lines and of rigid bodies among each other, which are numbered anew in each search.
    fn slid_by(&self, last: &ContactReport) -> BTreeMap<([BodyId; 2], usize), DVec3> {
        let keeps_number = |contact: &Contact| match contact.on {
            [BodyId::Rigid(_), BodyId::Rigid(_)] => false,
            [BodyId::Rigid(number), BodyId::Deformable(_)] => self.tools[number].lines.is_none(),
            _ => true,
        };
        let bears = |(contact, force): &(&Contact, &[f64; 3])| contact.law.is_constraint() || force[0] > 0.0;
        let bore = last.contacts.iter().zip(&last.forces).zip(&last.slips);
        bore.filter(|(of, _)| keeps_number(of.0) && bears(of))
            .map(|((contact, _), slip)| {
                let before = self.slid.get(&contact.id()).copied().unwrap_or_default();
                let along = |row: usize| contact.axes[row] * contact.axes[row].dot(before + *slip);
                (contact.id(), contact.law.friction_rows().map(along).sum())
            })
            .collect()
    }

    /// Has a round tool's contact act between the points and the normal that it had in the last solve and those that it has now: half way at
    /// first.
    pub(super) fn settle(&self, contact: &mut Contact) {
        let ([BodyId::Rigid(number), BodyId::Deformable(body)], Some(last)) =
            (contact.on, self.touched.get(&contact.id()))
        else {
            return;
        };
        let tool = &self.tools[number];
        let Some(round) = tool.round else { return };
        let share = 1.0 / f64::from(1 + self.swings);
        let normal = contact.axes[0].lerp(last.normal, 1.0 - share).normalize_or_zero();
        let body = &self.bodies[body];
        let located = &body.located.nodes;
        if normal == DVec3::ZERO || !last.on_skin.nodes().all(|node| located.binary_search(&node).is_ok()) {
            return;
        }
        // the tool's surface is about a point of its axis
        let centre = contact.point + contact.axes[0] * round.radius;
        let between = centre.lerp(tool.at(last.centre), 1.0 - share);
        let now = contact.points[1].0.iter().map(|(node, weight)| (*node, share * weight));
        let before = last.on_skin.0.iter().map(|(node, weight)| (*node, (1.0 - share) * weight));
        let on_skin = MaterialPoint(now.chain(before).collect()).through(MaterialPoint::node);
        contact.gap[0] += normal.dot(between - body.position_of(&on_skin))
            - contact.axes[0].dot(centre - body.position_of(&contact.points[1]));
        (contact.point, contact.axes, contact.points[1]) = (between - normal * round.radius, frame(normal), on_skin);
    }
}
