//! Energy of a run: what the bodies have, what work is done on them, what is dissipated in known ways.
//!
//! The energy `E` of the deformable and of the free rigid bodies is measured from their states at checked steps ([`crate::bodies::energy`]).
//! What is done to them in between is booked step by step, from numbers that are on the host anyway:
//!
//! | booked | what |
//! | --- | --- |
//! | work of loads | a dead load's potential `−f·u` is part of `E`, so a load does work when it begins, changes or ends: `−Δf·u` |
//! | work of hands | contact force on the bodies times the motion of the tool at the contact; tools that a hand holds are outside |
//! | work of overlaps | normal forces and constraints times the motion that parts an overlap found at the start of a step |
//! | impact | the same where the motion closes a gap: contact begins with the force of the step's end (inelastic) |
//! | friction, cutting | tangential forces times slip; forces of a blade's edge, and of contacts at their bound, times slip |
//! | damping | Rayleigh damping and that of springs, from the increments of checked steps; known where every step is checked |
//!
//! With `F·slip` of a contact `= Σ F·(motion of its sides)`, `ΔE = work − impact − friction − cutting − damping − numerical`. The last term
//! is the remainder: at least 0 for implicit Euler, up to the tolerance of its solves. Where it falls below what it was by more than an
//! allowance, the run has made energy from nothing: [`Measured::grew`]. A load's work is read where it changes: one read-back at that step on a
//! GPU, with what the next search for contacts reads. The work of boundaries on paths, of follower pressures, and of tools in static steps, whose solves
//! come to the balance by forces that are not those of the way, is not known; with them nothing is said of the remainder ([`Booked::unknown`]).

use super::{Body, Simulation, StepReport};
use crate::backend::{Query, Snapshot};
use crate::bodies::rigid::{Instrument, rotation_vector};
use crate::bodies::{Energy, beyond_law, energy, inverted_cells};
use crate::constraints::Law;
use crate::error::Result;
use crate::math::{V4, larger};
use crate::scene::{BodyId, Integrator, Load};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Work done on the bodies and energy dissipated since the start, J. See the module.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Booked {
    /// Work of loads that began, changed or ended.
    pub loads: f64,
    /// Work of the hands, through the contacts of their tools.
    pub hands: f64,
    /// Work of normal forces and constraints that part overlaps.
    pub overlap: f64,
    /// Dissipated as contacts close their gaps.
    pub impact: f64,
    /// Dissipated by friction.
    pub friction: f64,
    /// Dissipated by cutting.
    pub cutting: f64,
    /// Dissipated by damping in the checked steps.
    pub damping: f64,
    /// Steps with damping that were not checked, whose part of `damping` is missing.
    pub undamped_steps: u64,
    /// Boundaries have moved, follower pressures have acted, or tools have worked in static steps: that work is missing.
    pub unknown: bool,
    /// Most that the potential can have risen as a cut took mass away.
    pub removed: f64,
    /// Sum of the magnitudes of all work, to which the error of a step's solve is relative.
    pub turnover: f64,
}

impl Booked {
    /// Work done on the bodies, J.
    pub fn work(&self) -> f64 {
        self.loads + self.hands + self.overlap
    }

    /// Energy that damping has dissipated, J, where all steps with damping were checked.
    pub fn damping(&self) -> Option<f64> {
        (self.undamped_steps == 0).then_some(self.damping)
    }

    /// Energy that contacts have dissipated, J.
    pub fn dissipated(&self) -> f64 {
        self.impact + self.friction + self.cutting
    }
}

/// Measures of the bodies' state at a moment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// s
    pub time: f64,
    /// Energy of the deformable and the free rigid bodies, J.
    pub energy: Energy,
    /// Work and dissipation until then, J.
    pub booked: Booked,
    /// Inverted cells.
    pub inverted: u32,
    /// Cells strained beyond where their law is within 5 % of the neo-Hookean one.
    pub beyond_law: u32,
    /// Largest kinetic and elastic energy so far, J. Of explicit steps those at the start or the largest potential so far, without signs: energy
    /// that they make grows with the square of the motion, and the potential with the motion.
    pub largest: f64,
    /// Unexplained energy ([`Measured::unexplained`]) has risen above its least so far by more than [`Measured::allowance`]; after that its least
    /// is counted anew.
    pub grew: bool,
}

/// Share of the largest energy and of the work since that the ledger may rise by: what the solves leave.
const SOLVED_TO: f64 = 1e-3;

/// The same for symplectic Euler, of what there was to swing. Its energy differs from the one that it keeps by `h/2 v·K u`, at most `z/2` of it for
/// a vibration of `z = h ω` ([`crate::bodies::Step`]), so it rises by up to `(z/2)/(1 − z/2)` times what was there: 99 times where the step is 99 %
/// of the stable one and all motion is in the stiffest vibration, without bound beyond. A block of 48 cells over 2000 steps (tests/engine/energy.rs),
/// random at the start: linear 1.9 and 12 times at 90 and 99 % of the step that is stable at rest, neo-Hookean 1.1 times at 80 %; from rest under a
/// load 0.5 and 2.1 times at 99 and 99.9 %. Steps beyond the limit pass 100 times after 12 to 96 steps (linear, at the limit), and after 21 of
/// the 25 until the run is non-finite (neo-Hookean at 97 %, whose compressed cells are stiffer). With 10 the stable block would be warned of.
const SWINGS: f64 = 100.0;

impl Measured {
    /// Measures of the deformable bodies' states, and of the free rigid bodies.
    fn of<'a>(
        time: f64,
        bodies: impl Iterator<Item = (&'a Body, &'a Snapshot, Vec<V4<f64>>)>,
        tools: &[Instrument],
        booked: Booked,
    ) -> Self {
        let mut sum = Self { time, booked, ..Self::default() };
        for (Body { model, .. }, state, load) in bodies {
            sum.energy = sum.energy.and(energy(model, state, &load));
            sum.inverted += inverted_cells(model, state);
            sum.beyond_law += beyond_law(model, state);
        }
        let rigid = tools.iter().filter(|tool| tool.free).map(Instrument::energy);
        sum.energy = rigid.fold(sum.energy, Energy::and);
        sum
    }

    /// Trouble by name.
    pub fn warnings(&self) -> [(&'static str, u32); 4] {
        [
            ("inverted_cells", self.inverted),
            ("strain_beyond_law", self.beyond_law),
            ("non_finite_energy", u32::from(!self.energy.total().is_finite())),
            ("energy_grew", u32::from(self.grew)),
        ]
    }

    /// Energy that has come from nothing since a measure before, J: the rise beyond the work less what contacts have dissipated.
    pub fn unexplained(&self, before: &Self) -> f64 {
        let work = self.booked.work() - before.booked.work();
        let lost = self.booked.dissipated() - before.booked.dissipated();
        self.energy.total() - before.energy.total() - work + lost
    }

    /// Most of it that is let pass, J: a share of [`Measured::largest`] and of the work since, the rounding of positions in f32, and the
    /// potential of mass that a cut has taken away.
    pub fn allowance(&self, before: &Self, share: f64) -> f64 {
        let turnover = self.booked.turnover - before.booked.turnover;
        let removed = self.booked.removed - before.booked.removed;
        let rounded = f64::from(f32::EPSILON) * self.energy.weight.max(before.energy.weight);
        share * (self.largest + turnover) + rounded + removed
    }
}

impl Simulation {
    /// Books the work of loads that begin, change or end with the present step.
    pub(super) fn book_loads(&mut self) -> Result<()> {
        let work = match (self.scene.time.integrator, self.step_number) {
            (Integrator::Static, now) => self.load_work(now - 1, None)?,
            (_, 1) => 0.0, // the first loads are part of the energy at the start
            (_, now) => self.load_work(now - 2, None)?,
        };
        self.booked.loads += work;
        self.booked.turnover += work.abs();
        let [from, to] = [1, 0].map(|back| (self.step_number - back) as f64 * self.scene.time.part());
        self.booked.unknown |= self.bodies.iter().any(|body| body.model.driven(&self.scene, from, to) > 0.0)
            || self.scene.loads.iter().any(Load::follows)
            || self.scene.time.integrator == Integrator::Static && !self.tools.is_empty();
        Ok(())
    }

    /// Work of loads that begin, change or end in the step after `step`, at the present displacements, or those of `states`, J.
    fn load_work(&mut self, step: u64, states: Option<&[Snapshot]>) -> Result<f64> {
        let [before, now] = [step, step + 1].map(|step| step as f64 * self.scene.time.part());
        let changed = self.load_changes.iter().any(|time| *time > before && *time <= now);
        let mut work = 0.0;
        for (number, body) in self.bodies.iter_mut().enumerate().filter(|_| changed) {
            let [old, new] = [before, now].map(|time| body.load_at(&self.scene, time));
            let nodes: Vec<u32> = (0..new.len()).filter(|node| old[*node] != new[*node]).map(|n| n as u32).collect();
            if nodes.is_empty() {
                continue;
            }
            if states.is_none() {
                body.read(Query { displacements: nodes.clone(), ..Query::default() })?;
            }
            for node in nodes.into_iter().map(|node| node as usize) {
                let u = match states {
                    Some(states) => states[number].u[node],
                    None => body.known.moved(node)[0].pad(0.0),
                };
                work -= (0..3).map(|n| (new[node][n] - old[node][n]) * u[n]).sum::<f64>();
            }
        }
        Ok(work)
    }

    /// Books a step that has been solved; `old` are the rigid bodies at its start.
    pub(super) fn book_step(&mut self, old: &[Instrument], report: &StepReport) {
        let booked = &mut self.booked;
        let moved = |who: BodyId, point: DVec3| match who {
            BodyId::Rigid(number) if !old[number].free => {
                let (old, new) = (&old[number], &self.tools[number]);
                let turned = rotation_vector(new.rotation * old.rotation.conjugate());
                new.position - old.position + turned.cross(point - old.position)
            }
            _ => DVec3::ZERO,
        };
        let solved = &report.contact;
        for ((contact, along), slip) in solved.contacts.iter().zip(&solved.forces).zip(&solved.slips) {
            let force = contact.in_world(*along);
            let hand = force.dot(moved(contact.on[1], contact.point) - moved(contact.on[0], contact.point));
            booked.hands += hand;
            booked.turnover += hand.abs();
            let work = [0, 1, 2].map(|k| along[k] * contact.axes[k].dot(*slip));
            let (normal, tangential) = match contact.law {
                Law::Cut { .. } => {
                    booked.cutting -= work.iter().sum::<f64>();
                    continue;
                }
                Law::Coulomb { .. } if contact.law.at_bound(*along) => {
                    booked.cutting -= work[0];
                    (0.0, work[1] + work[2])
                }
                Law::Coulomb { .. } => (work[0], work[1] + work[2]),
                Law::Slide { .. } => (work[0] + work[1], work[2]),
                Law::Bilateral { .. } => (work.iter().sum(), 0.0),
            };
            booked.friction -= tangential;
            booked.overlap += normal.max(0.0);
            booked.impact += (-normal).max(0.0);
            booked.turnover += normal.abs();
        }
    }

    /// Books the damping of a step: `damped` of the checked bodies, J, or nothing known. That of explicit steps is not at the mean velocity.
    pub(super) fn book_damping(&mut self, damped: Option<f64>) {
        let damps = |body: &Body| body.model.damps();
        match damped.filter(|_| self.scene.time.integrator != Integrator::SymplecticEuler) {
            _ if !self.bodies.iter().any(damps) => {}
            Some(energy) => self.booked.damping += energy,
            None => self.booked.undamped_steps += 1,
        }
    }

    /// Measures the states at the start of a checked step, whose loads begin at `begin`, s.
    pub(super) fn measure_start(&mut self, begin: f64, states: &[Option<Snapshot>], report: &mut StepReport) {
        if !self.has_energy() {
            return;
        }
        let load = |body: &Body| body.padded_load_at(&self.scene, begin);
        let bodies =
            self.bodies.iter().zip(states).filter_map(|(body, state)| Some((body, state.as_ref()?, load(body))));
        let measured = Measured::of(begin, bodies, &self.tools, self.booked);
        let measured = self.compared(measured);
        measured.warnings().into_iter().for_each(|(name, count)| report.warn(name, count));
        report.measured = Some(measured);
    }

    /// Whether there are deformable or free rigid bodies.
    fn has_energy(&self) -> bool {
        !self.bodies.is_empty() || self.tools.iter().any(|tool| tool.free)
    }

    /// The same, compared with the measure of least unexplained energy before, which it may become.
    fn compared(&mut self, mut measured: Measured) -> Measured {
        let explicit = self.scene.time.integrator == Integrator::SymplecticEuler;
        let share = if explicit { SWINGS } else { SOLVED_TO };
        measured.largest = measured.energy.kinetic + measured.energy.elastic;
        let Some(least) = &mut self.least else {
            self.least = Some(measured);
            return measured;
        };
        if explicit {
            measured.largest = measured.energy.weight;
        }
        measured.largest = larger(measured.largest, least.largest);
        least.largest = measured.largest;
        let rise = measured.unexplained(least);
        measured.grew = rise > measured.allowance(least, share) && !measured.booked.unknown;
        if measured.grew || rise <= 0.0 {
            *least = measured;
        }
        measured
    }

    /// Measures of the bodies in these states, which are the present ones; none of a scene whose bodies are all held by hands.
    pub fn measure(&mut self, states: &[Snapshot]) -> Option<Measured> {
        if !self.has_energy() {
            return None;
        }
        // loads that change right now are booked by the next step
        let work = match (self.scene.time.integrator, self.step_number) {
            (Integrator::Static, _) | (_, 0) => 0.0,
            (_, step) => self.load_work(step - 1, Some(states)).unwrap_or(f64::NAN),
        };
        let booked =
            Booked { loads: self.booked.loads + work, turnover: self.booked.turnover + work.abs(), ..self.booked };
        let load = |body: &Body| body.padded_load_at(&self.scene, self.time);
        let bodies = self.bodies.iter().zip(states).map(|(body, state)| (body, state, load(body)));
        let measured = Measured::of(self.time, bodies, &self.tools, booked);
        Some(self.compared(measured))
    }
}
