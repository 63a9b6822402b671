//! Complete state of a simulation beside its scene, without anything that can be computed again: a run restored from it gives the same
//! bits.
//!
//! The wound is stored as its cuts: applying them to the uncut body gives the same nodes in the same order. Compliance columns are stored
//! although they could be solved for: their age decides how many passes a step takes.

use super::body::{Body, Compliance, Cut, Known, first_motion};
use super::{Booked, Measured, Refused, Simulation, incise};
use crate::backend::{FREE, Vector};
use crate::bodies::rigid::Motion;
use crate::collide::sides;
use crate::error::Result;
use crate::haptic::Reduced;
use crate::math::V4;
use crate::mesh::SAMPLES;
use crate::scene::{BodyId, Scene};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// State of a [`Simulation`] between two steps.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct State {
    step_number: u64,
    epoch: u32,
    bodies: Vec<BodyState>,
    tools: Vec<Motion>,
    reduced: Vec<Reduced>,
    postponed: incise::Postponed,
    fronts: incise::Fronts,
    depths: BTreeMap<(usize, usize, usize), f64>,
    sides: sides::Sides,
    last_forces: BTreeMap<([BodyId; 2], usize), DVec3>,
    booked: Booked,
    least: Option<Measured>,
}

/// State of a deformable body.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct BodyState {
    /// `[node]` m, m/s
    u: Vec<V4<f64>>,
    v: Vec<V4<f64>>,
    /// `[cell]` quaternions, warm start of the next rotation extraction; none for springs.
    rotation: Vec<V4<f64>>,
    /// `[node]` displacement of the last step, with which the next solve starts, m.
    solution: Vec<V4<f64>>,
    /// `[cut]` in order.
    cuts: Vec<Cut>,
    /// `[tile]` bounds of its nodes' displacement when last read, m.
    motion: Vec<[DVec3; 2]>,
    compliance: Compliance,
    at_rest: Compliance,
    /// Displacement of the nodes that follower pressures acted on in the last step, m.
    pressed: BTreeMap<u32, [f64; 3]>,
}

impl Simulation {
    /// State after the last step. Reading it does not change how the simulation continues.
    ///
    /// # Errors
    /// When a device fails.
    pub fn state(&mut self) -> Result<State> {
        Ok(State {
            step_number: self.step_number,
            epoch: self.epoch,
            bodies: self.bodies.iter_mut().map(|body| body.state()).collect::<Result<_>>()?,
            tools: self.tools.iter().map(|tool| tool.motion()).collect(),
            reduced: self.reduced.clone(),
            postponed: self.postponed.clone(),
            fronts: self.fronts.clone(),
            depths: self.depths.clone(),
            sides: self.sides.clone(),
            last_forces: self.last_forces.clone(),
            booked: self.booked,
            least: self.least,
        })
    }

    /// Restores a state of the same scene in the same precision; from there on the simulation repeats the original bit for bit.
    ///
    /// # Errors
    /// [`Refused::StateUnfit`] for a state of other bodies; when a device fails.
    pub fn restore(&mut self, state: &State) -> Result<()> {
        self.fits(state)?;
        for number in 0..self.bodies.len() {
            let from = &state.bodies[number];
            let body = &mut self.bodies[number];
            if !from.cuts.starts_with(&body.cuts) {
                // a cut cannot be undone: start from the uncut body
                let tied = std::mem::take(&mut body.tied);
                *body = Body::new(&self.scene, number, self.gpu.as_ref(), self.single)?;
                body.tied = tied;
                body.backend.interrupt_by(self.interrupt.clone());
            }
            self.bodies[number].restore(from)?;
            let begun = state.step_number > 0;
            self.bodies[number].first_motion = if begun { 0.0 } else { first_motion(&self.scene, number) };
        }
        self.tools.iter_mut().zip(&state.tools).for_each(|(tool, motion)| tool.set_motion(*motion));
        self.probes.iter_mut().for_each(|probe| probe.forget());
        self.step_number = state.step_number;
        self.time = state.step_number as f64 * self.scene.time.part();
        self.epoch = state.epoch;
        self.reduced.clone_from(&state.reduced);
        self.postponed.clone_from(&state.postponed);
        self.fronts.clone_from(&state.fronts);
        self.depths.clone_from(&state.depths);
        self.sides.clone_from(&state.sides);
        self.last_forces.clone_from(&state.last_forces);
        (self.booked, self.least) = (state.booked, state.least);
        Ok(())
    }

    /// Continues with a changed scene: friction, loads, stiffness, tolerance, anything that keeps the bodies, their cells and the step.
    /// Costs as much as making the simulation; the compliance near the tools is solved anew.
    ///
    /// # Errors
    /// As [`Simulation::new`], [`Refused::StateUnfit`] for other bodies, [`Refused::OtherStep`] for another step. The simulation is then
    /// unchanged, unless a device runs out of memory, which holds both for a while.
    pub fn change(&mut self, change: impl FnOnce(&mut Scene)) -> Result<()> {
        let mut scene = self.scene.clone();
        change(&mut scene);
        if scene.time.part() != self.scene.time.part() {
            return Err(Refused::OtherStep.into());
        }
        scene.check()?;
        let mut state = self.state()?;
        state.least = None; // other loads and stiffnesses: another energy of the same state
        for body in &mut state.bodies {
            (body.compliance, body.at_rest) = (Compliance::default(), Compliance::default());
        }
        let mut changed = Self::on(&scene, self.gpu.clone(), self.single)?;
        changed.interrupt_by(&self.interrupt);
        changed.restore(&state)?;
        *self = changed;
        Ok(())
    }

    fn fits(&self, state: &State) -> Result<()> {
        let unfit = |what, [found, wanted]: [usize; 2]| match found == wanted {
            true => Ok(()),
            false => Err(Refused::StateUnfit { what, found, wanted }),
        };
        unfit("rigid bodies", [state.tools.len(), self.tools.len()])?;
        unfit("rigid bodies", [state.reduced.len(), self.tools.len()])?;
        unfit("deformable bodies", [state.bodies.len(), self.bodies.len()])?;
        for (from, body) in state.bodies.iter().zip(&self.bodies) {
            let (nodes, mechanics) = (body.model.node_count(), body.model.mechanics());
            let segments = mechanics.segment_count(&body.model);
            unfit("nodes", [from.u.len(), nodes])?;
            unfit("nodes", [from.v.len(), nodes])?;
            unfit("nodes", [from.solution.len(), nodes])?;
            unfit("cells", [from.rotation.len(), mechanics.rotation_count(&body.model)])?;
            let hits = from.cuts.iter().flat_map(|cut| if let Cut::Swept(hits) = cut { &hits[..] } else { &[] });
            let last = hits.map(|hit| hit.segment as usize + 1).max().unwrap_or(0);
            unfit("links or springs", [last.max(segments), segments])?;
            let carved = from.cuts.iter().flat_map(|cut| match cut {
                Cut::Carved(cells) => cells.clone(),
                Cut::Space(carved) => carved.cells.iter().map(|(cell, _)| *cell).collect(),
                Cut::Swept(_) => vec![],
            });
            let surface = &body.wound.surface;
            let cells = surface.alive.len().max(surface.present().len());
            let last = carved.map(|cell| cell as usize + 1).max().unwrap_or(0);
            unfit("cells", [last.max(cells), cells])?;
            let space =
                from.cuts.iter().filter_map(|cut| if let Cut::Space(carved) = cut { Some(carved) } else { None });
            for carved in space {
                let last = carved.corners.iter().map(|(node, _)| *node as usize + 1).max().unwrap_or(0);
                unfit("nodes", [last.max(nodes), nodes])?;
                let samples = carved.cells.iter().map(|(_, left)| left.len()).find(|count| *count != SAMPLES);
                unfit("samples of a cell", [samples.unwrap_or(SAMPLES), SAMPLES])?;
            }
        }
        Ok(())
    }
}

impl Body {
    fn state(&mut self) -> Result<BodyState> {
        let snapshot = self.backend.snapshot()?;
        Ok(BodyState {
            u: snapshot.u,
            v: snapshot.v,
            rotation: snapshot.rotation,
            solution: self.backend.solution(FREE)?,
            cuts: self.cuts.clone(),
            motion: self.boxes.motion().to_vec(),
            compliance: self.compliance.clone(),
            at_rest: self.at_rest.known.clone(),
            pressed: self.pressed.clone(),
        })
    }

    /// Restores a state whose cuts begin with those of the body.
    fn restore(&mut self, state: &BodyState) -> Result<()> {
        for cut in &state.cuts[self.cuts.len()..] {
            match cut {
                Cut::Swept(hits) => self.sever(hits)?,
                Cut::Carved(cells) => self.carve(cells)?,
                Cut::Space(carved) => self.carve_space(carved)?,
            };
        }
        self.backend.set_state(&state.u, &state.v, &state.rotation)?;
        self.known = Known::default();
        self.backend.set_vector(Vector::Solution, FREE, &state.solution)?;
        self.boxes.set_motion(&state.motion);
        self.compliance.clone_from(&state.compliance);
        self.at_rest.known.clone_from(&state.at_rest);
        self.pressed.clone_from(&state.pressed);
        (self.loaded, self.non_finite) = (false, false);
        Ok(())
    }
}
