//! The haptic side: the reduced contact problem that the simulation hands over, and the tick that renders it at 1 kHz.
//!
//! A [`Reduced`] problem is what is left of the skin after a step: contact rows with the skin's compliance between them, and how fast the
//! skin opens them by itself. A [tick](Renderer::tick) moves the violations by what hand and skin did since, solves the same contact laws again with few sweeps, and gives the force of the
//! virtual coupling: with C = (K + B/h)⁻¹ the compliance is W_skin + J C Jᵀ, so the coupling's spring is counted once. Direct rendering
//! has C = 0: the proxy is at the hand, and what a tick adds to the force is the skin's own answer; what does not give at all (a wall, another
//! rigid body) then has no force, as no force could hold the hand.
//!
//! A [`Servo`](servo::Servo) is the whole tick of one device around that: place, render, limit, watch the energy. It runs in a thread of its own
//! under the wall clock ([`thread`]), with [`cells`] between it and the simulation, or in the simulation's thread under the scene's clock, so that
//! a run repeats. A tick allocates nothing, takes no lock and waits for nothing; a slow step costs the force, never a tick: it is held by
//! the last problem, fades when that is too old ([`guard`]), and comes back.
//! Source: Saupin, Duriez, Cotin 2008 (contact model at two rates); Colgate, Stanley, Brown 1995 (virtual coupling).
//! Units: m, N, N·m, s.

pub mod cells;
pub mod device;
pub mod devices;
pub mod guard;
pub mod hand;
#[cfg(feature = "haply")]
pub mod haply;
pub mod histogram;
pub mod passivity;
mod refused;
pub mod replay;
pub mod servo;
pub mod thread;

pub use refused::Refused;

use crate::bodies::rigid::rotation_vector;
use crate::constraints::{Law, relax};
use crate::scene::{Coupling, Rendering};
use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};
use std::time::{Duration, Instant};

/// Contact problem of one tool at the end of a step.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Reduced {
    /// Tool pose that it was made at, m.
    pub position: DVec3,
    /// Unit quaternion.
    pub rotation: DQuat,
    /// `[row]` unit directions; a contact has as many rows as its law.
    pub axes: Vec<DVec3>,
    /// `[row]` lever arms from the tool's position, m.
    pub arms: Vec<DVec3>,
    /// `[contact]`
    pub laws: Vec<Law>,
    /// `[row × row]` skin compliance, m/N.
    pub compliance: Vec<f64>,
    /// `[row]` violation with `force` applied, m.
    pub violation: Vec<f64>,
    /// `[row]` how fast the skin goes on to open the row under these forces, m/s.
    pub rate: Vec<f64>,
    /// `[row]` N
    pub force: Vec<f64>,
    /// Counts cuts: a problem of an older epoch is from before a cut.
    pub epoch: u32,
}

impl Reduced {
    /// A tool at this pose that touches nothing.
    pub fn free(position: DVec3, rotation: DQuat, epoch: u32) -> Self {
        Self { position, rotation, epoch, ..Self::default() }
    }

    /// Becomes a copy of another problem in its own memory: allocates only where it has to grow.
    pub fn refill(&mut self, other: &Self) {
        (self.position, self.rotation, self.epoch) = (other.position, other.rotation, other.epoch);
        self.axes.clone_from(&other.axes);
        self.arms.clone_from(&other.arms);
        self.laws.clone_from(&other.laws);
        self.compliance.clone_from(&other.compliance);
        self.violation.clone_from(&other.violation);
        self.rate.clone_from(&other.rate);
        self.force.clone_from(&other.force);
    }
}

/// The hand at a tick.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Hand {
    /// m
    pub position: DVec3,
    /// Unit quaternion.
    pub rotation: DQuat,
}

/// What a tick gives the device.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Tick {
    /// On the hand, N.
    pub force: DVec3,
    /// On the hand, N·m.
    pub torque: DVec3,
    /// Gauss–Seidel sweeps.
    pub sweeps: u32,
    /// The time for sweeps was used up before they ended.
    pub out_of_time: bool,
}

/// The proxy's memory and scratch; one per device.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Renderer {
    /// Coupling between hand and proxy.
    pub link: Coupling,
    /// Whether that coupling is felt.
    pub rendering: Rendering,
    /// Time for the sweeps of a tick; none where results must not depend on a clock.
    pub budget: Option<Duration>,
    /// Sweeps of a tick at most.
    pub max_sweeps: u32,
    /// Proxy position, m.
    pub position: DVec3,
    /// Proxy rotation.
    pub rotation: DQuat,
    hand: Hand,
    force: Vec<f64>,
    free: Vec<f64>,
    /// `[row]` arm × axis
    levers: Vec<DVec3>,
    /// `[row]` violation without force, before the hand moves, m.
    kept: Vec<f64>,
    /// `[row × row]` W + J C Jᵀ, m/N.
    compliance: Vec<f64>,
}

/// Sweeps of one tick at most: with warm starts seven are the mean of 20 contacts, and the force is off by 0.02 % (`benches/haptic.rs`).
pub const MAX_SWEEPS: u32 = 20;
/// Relative change of the forces per sweep at which sweeps end: 0.1 mN of 1 N, far below what a hand can tell.
const SWEEP_TOLERANCE: f64 = 1e-4;
/// Sweeps between two looks at the clock: a look costs about as much as a sweep over one contact.
const SWEEPS_PER_LOOK: u32 = 4;
/// Contacts from which a sweep takes far longer than a look at the clock; then they are half as many (with one, sweeps that have ended could
/// not be told from those that have not).
const CROWDED: usize = 10;

impl Renderer {
    /// A proxy that rests at the hand.
    pub fn new(link: Coupling, hand: Hand) -> Self {
        let none = Vec::new();
        Self {
            link,
            rendering: Rendering::Coupling,
            budget: None,
            max_sweeps: MAX_SWEEPS,
            position: hand.position,
            rotation: hand.rotation,
            hand,
            force: none.clone(),
            free: none.clone(),
            levers: vec![],
            kept: none.clone(),
            compliance: none,
        }
    }

    /// Makes room for problems of that many rows, so that ticks on them allocate nothing.
    pub fn reserve(&mut self, rows: usize) {
        self.force.reserve(rows);
        self.free.reserve(rows);
        self.levers.reserve(rows);
        self.kept.reserve(rows);
        self.compliance.reserve(rows * rows);
    }

    /// Forgets what it was doing: the proxy rests at a hand, without force.
    pub fn rest_at(&mut self, hand: Hand) {
        (self.position, self.rotation, self.hand) = (hand.position, hand.rotation, hand);
        self.force.fill(0.0);
    }

    /// Takes a new problem over, for ticks of `step` seconds: forces start at its own, and the proxy where its tool was.
    pub fn receive(&mut self, problem: &Reduced, step: f64) {
        self.position = problem.position;
        self.rotation = problem.rotation;
        self.receive_late(problem, step);
    }

    /// Takes over a problem from some ticks ago: the proxy has gone on since, and stays where it is.
    pub fn receive_late(&mut self, problem: &Reduced, step: f64) {
        self.force.clone_from(&problem.force);
        self.prepare(problem, step);
    }

    /// What ticks on a problem share.
    fn prepare(&mut self, problem: &Reduced, step: f64) {
        let rows = problem.axes.len();
        let (c, ca) = self.compliances(step);
        self.levers.clear();
        self.levers.extend(problem.arms.iter().zip(&problem.axes).map(|(arm, axis)| arm.cross(*axis)));
        self.kept.clear();
        self.compliance.clear();
        for (i, line) in problem.compliance.chunks_exact(rows.max(1)).enumerate() {
            let held: f64 = line.iter().zip(&problem.force).map(|(w, f)| w * f).sum();
            self.kept.push(problem.violation[i] - held);
            let (axis, lever) = (problem.axes[i], self.levers[i]);
            let through = |j: usize| c * axis.dot(problem.axes[j]) + ca * lever.dot(self.levers[j]);
            self.compliance.extend(line.iter().enumerate().map(|(j, w)| w + through(j)));
        }
    }

    /// One tick of `step` seconds, `age` seconds after the hand that the problem knows: the force on the hand. Until the next problem comes
    /// the skin creeps on as it would under the problem's forces; what the hand does to it on top is its compliance.
    pub fn tick(&mut self, problem: &Reduced, hand: Hand, step: f64, age: f64) -> Tick {
        let rows = problem.axes.len();
        if self.kept.len() != rows {
            self.prepare(problem, step);
        }
        let (c, ca) = self.compliances(step);
        let (shift, turn) = self.without_contact(problem, hand, step);
        self.free.clear();
        for i in 0..rows {
            let drift = problem.rate.get(i).map_or(0.0, |rate| rate * age);
            self.free.push(self.kept[i] + drift + problem.axes[i].dot(shift) + self.levers[i].dot(turn));
        }
        self.force.resize(rows, 0.0);
        let mut tick = self.solve(&problem.laws);
        for i in 0..rows {
            tick.force += problem.axes[i] * self.force[i];
            tick.torque += self.levers[i] * self.force[i];
        }
        self.position = problem.position + shift + tick.force * c;
        self.rotation = DQuat::from_scaled_axis(turn + tick.torque * ca) * problem.rotation;
        self.hand = hand;
        tick
    }

    /// How the coupling gives, m/N and rad/(N·m).
    fn compliances(&self, step: f64) -> (f64, f64) {
        let Coupling { stiffness, damping, angular_stiffness, angular_damping } = self.link;
        match self.rendering {
            Rendering::Direct => (0.0, 0.0),
            Rendering::Coupling => {
                (1.0 / (stiffness + damping / step), 1.0 / (angular_stiffness + angular_damping / step))
            }
        }
    }

    /// Motion of the proxy without contact, from the problem's pose, m and rad.
    fn without_contact(&self, problem: &Reduced, hand: Hand, step: f64) -> (DVec3, DVec3) {
        let (k, b) = (self.link.stiffness, self.link.damping / step);
        let (ka, ba) = (self.link.angular_stiffness, self.link.angular_damping / step);
        let target = hand.position - problem.position;
        let aim = rotation_vector(hand.rotation * problem.rotation.conjugate());
        if self.rendering == Rendering::Direct {
            return (target, aim);
        }
        let moved = hand.position - self.hand.position;
        let from = self.position - problem.position;
        let turned = rotation_vector(hand.rotation * self.hand.rotation.conjugate());
        let turn_from = rotation_vector(self.rotation * problem.rotation.conjugate());
        let shift = (target * k + (from + moved) * b) / (k + b);
        (shift, (aim * ka + (turn_from + turned) * ba) / (ka + ba))
    }

    /// Sweeps until they end, or the time for them does.
    fn solve(&mut self, laws: &[Law]) -> Tick {
        let mut tick = Tick::default();
        let begin = self.budget.map(|_| Instant::now());
        let between = if laws.len() < CROWDED { SWEEPS_PER_LOOK } else { SWEEPS_PER_LOOK / 2 };
        while tick.sweeps < self.max_sweeps {
            let left = self.max_sweeps - tick.sweeps;
            let chunk = self.budget.map_or(left, |_| between.min(left));
            let done = relax(laws, &self.compliance, &self.free, &mut self.force, SWEEP_TOLERANCE, chunk);
            tick.sweeps += done;
            if done < chunk {
                break;
            }
            if let (Some(budget), Some(begin)) = (self.budget, begin)
                && begin.elapsed() > budget
            {
                tick.out_of_time = true;
                break;
            }
        }
        tick
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LINK: Coupling = Coupling { stiffness: 1000.0, damping: 0.0, angular_stiffness: 1.0, angular_damping: 0.0 };

    fn hand(z: f64) -> Hand {
        Hand { position: DVec3::new(0.0, 0.0, z), rotation: DQuat::IDENTITY }
    }

    fn wall(compliance: f64) -> Reduced {
        Reduced {
            axes: vec![DVec3::Z],
            arms: vec![DVec3::ZERO],
            laws: vec![Law::contact(0.0)],
            compliance: vec![compliance],
            violation: vec![0.0],
            force: vec![0.0],
            ..Reduced::default()
        }
    }

    #[test]
    fn a_rigid_wall_feels_as_stiff_as_the_coupling() {
        let mut renderer = Renderer::new(LINK, hand(0.0));
        let force = renderer.tick(&wall(0.0), hand(-1e-3), 1e-3, 0.0).force.z;
        assert!((force - 1.0).abs() < 1e-6, "{force}");
    }

    #[test]
    fn skin_and_coupling_are_springs_in_series() {
        let mut renderer = Renderer::new(LINK, hand(0.0));
        let force = renderer.tick(&wall(3e-3), hand(-1e-3), 1e-3, 0.0).force.z;
        assert!((force - 0.25).abs() < 1e-6, "{force}");
        assert!((renderer.position.z + 0.75e-3).abs() < 1e-9);
    }

    #[test]
    fn there_is_no_force_off_the_wall() {
        let mut renderer = Renderer::new(LINK, hand(0.0));
        assert_eq!(renderer.tick(&wall(0.0), hand(1e-3), 1e-3, 0.0).force, DVec3::ZERO);
    }
}
