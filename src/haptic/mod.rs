//! The haptic side: the reduced contact problem that the simulation hands over, and the tick that renders it at 1 kHz.
//!
//! A [`Reduced`] problem is what is left of the skin after a step: contact rows with the skin's compliance between them. A [tick](Renderer::tick)
//! moves the violations by what the hand did since, solves the same contact laws again with few sweeps, and gives the force of the
//! virtual coupling: with C = (K + B/h)⁻¹ the compliance is W_skin + J C Jᵀ, so the coupling's spring is counted once. Direct rendering
//! has C = 0: the proxy is at the hand, and what a tick adds to the force is the skin's own answer; what does not give at all (a wall, another
//! rigid body) then has no force, as no force could hold the hand.
//!
//! A [`Servo`](servo::Servo) is the whole tick of one device around that: place, render, limit, watch the energy. It runs in a thread of its own
//! under the wall clock ([`thread`]), with [`cells`] between it and the simulation, or in the simulation's thread under the scene's clock.
//! Source: Saupin, Duriez, Cotin 2008 (contact model at two rates); Colgate, Stanley, Brown 1995 (virtual coupling).
//! Units: m, N, N·m, s.

pub mod cells;
pub mod device;
pub mod devices;
pub mod guard;
pub mod hand;
pub mod haply;
pub mod histogram;
pub mod passivity;
pub mod replay;
pub mod servo;
pub mod thread;

use crate::constraints::{Law, relax};
use crate::instrument::rotation_vector;
use crate::scene::{Coupling, Rendering};
use glam::{DQuat, DVec3};
use std::time::{Duration, Instant};

/// Contact problem of one tool at the end of a step.
#[derive(Clone, Debug, Default)]
pub struct Reduced {
    /// Tool pose that it was made at, m.
    pub position: DVec3,
    /// Unit quaternion.
    pub rotation: DQuat,
    /// `[row]` unit directions, three per contact.
    pub axes: Vec<DVec3>,
    /// `[row]` lever arms from the tool's position, m.
    pub arms: Vec<DVec3>,
    /// `[contact]`
    pub laws: Vec<Law>,
    /// `[row × row]` skin compliance, m/N.
    pub compliance: Vec<f64>,
    /// `[row]` violation with `force` applied, m.
    pub violation: Vec<f64>,
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
        self.force.clone_from(&other.force);
    }
}

/// The hand at a tick.
#[derive(Clone, Copy, Debug)]
pub struct Hand {
    /// m
    pub position: DVec3,
    /// Unit quaternion.
    pub rotation: DQuat,
}

/// What a tick gives the device.
#[derive(Clone, Copy, Debug, Default)]
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
#[derive(Clone, Debug)]
pub struct Renderer {
    /// Coupling between hand and proxy.
    pub link: Coupling,
    /// Whether that coupling is felt.
    pub rendering: Rendering,
    /// Time for the sweeps of a tick; none where results must not depend on a clock.
    pub budget: Option<Duration>,
    /// Proxy position, m.
    pub position: DVec3,
    /// Proxy rotation.
    pub rotation: DQuat,
    hand: Hand,
    force: Vec<f64>,
    free: Vec<f64>,
    compliance: Vec<f64>,
}

/// Sweeps of one tick at most: with warm starts the force moves by under 0.1 % after ten (0.3 ms allows hundreds of rows' worth).
const MAX_SWEEPS: u32 = 20;
/// Relative change of the forces per sweep at which sweeps end: 0.1 mN of 1 N, far below what a hand can tell.
const SWEEP_TOLERANCE: f64 = 1e-4;
/// Sweeps between two looks at the clock: a look costs about as much as a sweep over one contact.
const SWEEPS_PER_LOOK: u32 = 4;

impl Renderer {
    /// A proxy that rests at the hand.
    pub fn new(link: Coupling, hand: Hand) -> Self {
        let none = Vec::new();
        Self {
            link,
            rendering: Rendering::Coupling,
            budget: None,
            position: hand.position,
            rotation: hand.rotation,
            hand,
            force: none.clone(),
            free: none.clone(),
            compliance: none,
        }
    }

    /// Makes room for problems of that many rows, so that ticks on them allocate nothing.
    pub fn reserve(&mut self, rows: usize) {
        self.force.reserve(rows);
        self.free.reserve(rows);
        self.compliance.reserve(rows * rows);
    }

    /// Takes a new problem over: forces start at its own, and the proxy where its tool was.
    pub fn receive(&mut self, problem: &Reduced) {
        self.position = problem.position;
        self.rotation = problem.rotation;
        self.receive_late(problem);
    }

    /// Takes over a problem from some ticks ago: the proxy has gone on since, and stays where it is.
    pub fn receive_late(&mut self, problem: &Reduced) {
        self.force.clone_from(&problem.force);
    }

    /// One tick of `step` seconds: the force on the hand.
    pub fn tick(&mut self, problem: &Reduced, hand: Hand, step: f64) -> Tick {
        let Place { shift, turn, c, ca } = self.without_contact(problem, hand, step);
        let rows = problem.axes.len();
        self.free.clear();
        self.compliance.clear();
        for i in 0..rows {
            let (axis, lever) = (problem.axes[i], problem.arms[i].cross(problem.axes[i]));
            let line = &problem.compliance[i * rows..(i + 1) * rows];
            let kept: f64 = line.iter().zip(&problem.force).map(|(w, f)| w * f).sum();
            self.free.push(problem.violation[i] - kept + axis.dot(shift) + lever.dot(turn));
            for (j, w) in line.iter().enumerate() {
                let other = problem.arms[j].cross(problem.axes[j]);
                self.compliance.push(w + c * axis.dot(problem.axes[j]) + ca * lever.dot(other));
            }
        }
        self.force.resize(rows, 0.0);
        let mut tick = self.solve(&problem.laws);
        for i in 0..rows {
            tick.force += problem.axes[i] * self.force[i];
            tick.torque += problem.arms[i].cross(problem.axes[i]) * self.force[i];
        }
        self.position = problem.position + shift + tick.force * c;
        self.rotation = DQuat::from_scaled_axis(turn + tick.torque * ca) * problem.rotation;
        self.hand = hand;
        tick
    }

    /// Where the proxy would go without contact, from the problem's pose, and how it gives.
    fn without_contact(&self, problem: &Reduced, hand: Hand, step: f64) -> Place {
        let (k, b) = (self.link.stiffness, self.link.damping / step);
        let (ka, ba) = (self.link.angular_stiffness, self.link.angular_damping / step);
        let target = hand.position - problem.position;
        let aim = rotation_vector(hand.rotation * problem.rotation.conjugate());
        if self.rendering == Rendering::Direct {
            return Place { shift: target, turn: aim, c: 0.0, ca: 0.0 };
        }
        let moved = hand.position - self.hand.position;
        let from = self.position - problem.position;
        let turned = rotation_vector(hand.rotation * self.hand.rotation.conjugate());
        let turn_from = rotation_vector(self.rotation * problem.rotation.conjugate());
        Place {
            shift: (target * k + (from + moved) * b) / (k + b),
            turn: (aim * ka + (turn_from + turned) * ba) / (ka + ba),
            c: 1.0 / (k + b),
            ca: 1.0 / (ka + ba),
        }
    }

    /// Sweeps until they end, or the time for them does.
    fn solve(&mut self, laws: &[Law]) -> Tick {
        let mut tick = Tick::default();
        let chunk = self.budget.map_or(MAX_SWEEPS, |_| SWEEPS_PER_LOOK);
        let begin = self.budget.map(|_| Instant::now());
        while tick.sweeps < MAX_SWEEPS {
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

/// Motion of the proxy without contact, m and rad, and the coupling's compliances, m/N and rad/(N·m).
struct Place {
    shift: DVec3,
    turn: DVec3,
    c: f64,
    ca: f64,
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
            axes: vec![DVec3::Z, DVec3::X, DVec3::Y],
            arms: vec![DVec3::ZERO; 3],
            laws: vec![Law::Coulomb { friction: 0.0, bound: f64::INFINITY }],
            compliance: vec![compliance, 0.0, 0.0, 0.0, compliance, 0.0, 0.0, 0.0, compliance],
            violation: vec![0.0; 3],
            force: vec![0.0; 3],
            ..Reduced::default()
        }
    }

    #[test]
    fn a_rigid_wall_feels_as_stiff_as_the_coupling() {
        let mut renderer = Renderer::new(LINK, hand(0.0));
        let force = renderer.tick(&wall(0.0), hand(-1e-3), 1e-3).force.z;
        assert!((force - 1.0).abs() < 1e-6, "{force}");
    }

    #[test]
    fn skin_and_coupling_are_springs_in_series() {
        let mut renderer = Renderer::new(LINK, hand(0.0));
        let force = renderer.tick(&wall(3e-3), hand(-1e-3), 1e-3).force.z;
        assert!((force - 0.25).abs() < 1e-6, "{force}");
        assert!((renderer.position.z + 0.75e-3).abs() < 1e-9);
    }

    #[test]
    fn there_is_no_force_off_the_wall() {
        let mut renderer = Renderer::new(LINK, hand(0.0));
        assert_eq!(renderer.tick(&wall(0.0), hand(1e-3), 1e-3).force, DVec3::ZERO);
    }
}
