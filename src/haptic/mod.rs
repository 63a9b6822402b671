//! Haptic rendering: the reduced contact problem that the simulation hands over, and the tick that renders it at 1 kHz.
//!
//! A [`Reduced`] problem replaces the skin after a step: contact rows, the skin's compliance between them, and the rate at which the skin
//! itself opens them. A [tick](Renderer::tick) updates the violations by the motion of hand and skin since, solves the same contact laws
//! again in a few sweeps, and returns the force of the virtual coupling. With C = (K + B/h)⁻¹ the compliance is W_skin + J C Jᵀ, so the
//! coupling's spring counts once. Direct rendering has C = 0: the proxy is at the hand, and the force is that of the skin alone; a rigid
//! contact (a wall, another rigid body) then has no force, as no force could hold the hand. Source of the virtual coupling: Colgate, Stanley,
//! Brown 1995.
//!
//! A [`Servo`](servo::Servo) is the complete tick of one device: transform, render, limit, control passivity. Under the wall clock it runs
//! in a thread of its own ([`thread`]), with [`servo::cells`] between it and the simulation; under the scene's clock in the simulation's
//! thread, so that a run repeats. A tick does not allocate, lock or wait. A slow step costs force, never a tick: the last problem sustains
//! the force, which fades when that is too old ([`guard`]) and returns with the next.

pub mod device;
pub mod devices;
pub mod guard;
#[cfg(feature = "haply")]
pub mod haply;
pub mod servo;
pub mod thread;

use crate::bodies::rigid::rotation_vector;
use crate::constraints::{Law, relax};
use crate::scene::{Coupling, Rendering};
use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};
use std::time::{Duration, Instant};

/// Contact problem of one tool at the end of a step.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Reduced {
    /// Tool position at the end of the step, m.
    pub position: DVec3,
    /// Tool rotation, unit quaternion.
    pub rotation: DQuat,
    /// `[row]` unit directions; a contact has as many rows as its law.
    pub axes: Vec<DVec3>,
    /// `[row]` moment arms from the tool's position, m.
    pub arms: Vec<DVec3>,
    /// `[contact]` laws.
    pub laws: Vec<Law>,
    /// `[row × row]` skin compliance, m/N.
    pub compliance: Vec<f64>,
    /// `[row]` violation with `force` applied, m.
    pub violation: Vec<f64>,
    /// `[row]` rate at which the skin keeps opening the row under these forces, m/s.
    pub rate: Vec<f64>,
    /// `[row]` forces, N.
    pub force: Vec<f64>,
    /// Number of cuts; a problem of an older epoch is from before the last cut.
    pub epoch: u32,
}

impl Reduced {
    /// Problem of a tool at this pose without contact.
    pub fn free(position: DVec3, rotation: DQuat, epoch: u32) -> Self {
        Self { position, rotation, epoch, ..Self::default() }
    }

    /// Copies another problem into its own memory; allocates only to grow.
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

/// Pose of the hand at a tick.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Hand {
    /// Position, m.
    pub position: DVec3,
    /// Rotation, unit quaternion.
    pub rotation: DQuat,
}

/// Result of a tick.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Tick {
    /// Force on the hand, N.
    pub force: DVec3,
    /// Torque on the hand, N·m.
    pub torque: DVec3,
    /// Gauss–Seidel sweeps.
    pub sweeps: u32,
    /// The time budget ended the sweeps.
    pub out_of_time: bool,
    /// The force was scaled down to what the coupling can exert.
    pub bounded: bool,
}

/// State of the proxy, with scratch memory; one per device.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Renderer {
    /// Coupling between hand and proxy.
    pub coupling: Coupling,
    /// Rendering: through the coupling or direct.
    pub rendering: Rendering,
    /// Time budget for the sweeps of a tick; none if results must not depend on a clock.
    pub budget: Option<Duration>,
    /// Most sweeps of a tick.
    pub max_sweeps: u32,
    /// Proxy position, m.
    pub position: DVec3,
    /// Proxy rotation.
    pub rotation: DQuat,
    hand: Hand,
    force: Vec<f64>,
    free: Vec<f64>,
    /// `[row]` angular part of the Jacobian, arm × axis, m.
    angular: Vec<DVec3>,
    /// `[row]` violation without force, before the hand moves, m.
    kept: Vec<f64>,
    /// `[row × row]` W + J C Jᵀ, m/N.
    compliance: Vec<f64>,
}

/// Most sweeps of a tick: with warm starts 20 contacts take seven in the mean, and the force is off by 0.02 % (`benches/haptic.rs`).
pub const MAX_SWEEPS: u32 = 20;
/// Largest motion of the proxy by contact, in largest violations.
const FARTHEST: f64 = 10.0;
/// Relative change of the forces per sweep that ends the sweeps: 0.1 mN of 1 N, far below what a hand can feel.
const SWEEP_TOLERANCE: f64 = 1e-4;
/// Sweeps between two readings of the clock, each of which costs about as much as a sweep over one contact.
const SWEEPS_PER_LOOK: u32 = 4;
/// Contacts from which a sweep takes far longer than a reading of the clock; half as many sweeps then lie between two readings (with one,
/// converged sweeps could not be told from others).
const CROWDED: usize = 10;

impl Renderer {
    /// Proxy at rest at the hand.
    pub fn new(coupling: Coupling, hand: Hand) -> Self {
        let none = Vec::new();
        Self {
            coupling,
            rendering: Rendering::Coupling,
            budget: None,
            max_sweeps: MAX_SWEEPS,
            position: hand.position,
            rotation: hand.rotation,
            hand,
            force: none.clone(),
            free: none.clone(),
            angular: vec![],
            kept: none.clone(),
            compliance: none,
        }
    }

    /// Reserves memory for problems of that many rows, so that ticks on them do not allocate.
    pub fn reserve(&mut self, rows: usize) {
        self.force.reserve(rows);
        self.free.reserve(rows);
        self.angular.reserve(rows);
        self.kept.reserve(rows);
        self.compliance.reserve(rows * rows);
    }

    /// Resets the proxy: at rest at a hand, without force.
    pub fn rest_at(&mut self, hand: Hand) {
        (self.position, self.rotation, self.hand) = (hand.position, hand.rotation, hand);
        self.force.fill(0.0);
    }

    /// Accepts a new problem for ticks of `step` seconds: forces start from the problem's, the proxy from its tool pose.
    pub fn receive(&mut self, problem: &Reduced, step: f64) {
        self.position = problem.position;
        self.rotation = problem.rotation;
        self.receive_late(problem, step);
    }

    /// Accepts a problem from some ticks ago: the proxy has moved since and stays where it is.
    pub fn receive_late(&mut self, problem: &Reduced, step: f64) {
        self.force.clone_from(&problem.force);
        self.prepare(problem, step);
    }

    /// Computes what all ticks on a problem share.
    fn prepare(&mut self, problem: &Reduced, step: f64) {
        let rows = problem.axes.len();
        let (c, ca) = self.compliances(step);
        self.angular.clear();
        self.angular.extend(problem.arms.iter().zip(&problem.axes).map(|(arm, axis)| arm.cross(*axis)));
        self.kept.clear();
        self.compliance.clear();
        for (i, line) in problem.compliance.chunks_exact(rows.max(1)).enumerate() {
            let displacement: f64 = line.iter().zip(&problem.force).map(|(w, f)| w * f).sum();
            self.kept.push(problem.violation[i] - displacement);
            let (axis, angular) = (problem.axes[i], self.angular[i]);
            let through = |j: usize| c * axis.dot(problem.axes[j]) + ca * angular.dot(self.angular[j]);
            self.compliance.extend(line.iter().enumerate().map(|(j, w)| w + through(j)));
        }
    }

    /// One tick of `step` seconds, `age` seconds after the hand pose of the problem: returns the force on the hand. Until the next problem
    /// the violations drift at `rate`; the hand's own motion acts through the compliance.
    pub fn tick(&mut self, problem: &Reduced, hand: Hand, step: f64, age: f64) -> Tick {
        let rows = problem.axes.len();
        if self.kept.len() != rows {
            self.prepare(problem, step);
        }
        // violations without force: drift and unconstrained motion of the proxy
        let (c, ca) = self.compliances(step);
        let (translation, rotation) = self.without_contact(problem, hand, step);
        self.free.clear();
        for i in 0..rows {
            let drift = problem.rate.get(i).map_or(0.0, |rate| rate * age);
            self.free.push(self.kept[i] + drift + problem.axes[i].dot(translation) + self.angular[i].dot(rotation));
        }
        // forces, then the proxy's pose under them
        self.force.resize(rows, 0.0);
        let mut tick = self.solve(&problem.laws);
        for i in 0..rows {
            tick.force += problem.axes[i] * self.force[i];
            tick.torque += self.angular[i] * self.force[i];
        }
        self.bound(&mut tick, step);
        self.position = problem.position + translation + tick.force * c;
        self.rotation = DQuat::from_scaled_axis(rotation + tick.torque * ca) * problem.rotation;
        self.hand = hand;
        tick
    }

    /// Scales the forces down to what moves the proxy by [`FARTHEST`] times the largest violation. Sweeps over a compliance that is not
    /// positive grow without bound, and so does the direct force of skin that hardly gives.
    fn bound(&mut self, tick: &mut Tick, step: f64) {
        let largest = self.free.iter().fold(0.0f64, |most, free| most.max(free.abs()));
        let most = FARTHEST * largest * (self.coupling.stiffness + self.coupling.damping / step);
        let force = tick.force.length();
        if force > most {
            let share = most / force;
            self.force.iter_mut().for_each(|force| *force *= share);
            (tick.force, tick.torque, tick.bounded) = (tick.force * share, tick.torque * share, true);
        }
    }

    /// Compliances of the coupling, m/N and rad/(N·m).
    fn compliances(&self, step: f64) -> (f64, f64) {
        let Coupling { stiffness, damping, angular_stiffness, angular_damping } = self.coupling;
        match self.rendering {
            Rendering::Direct => (0.0, 0.0),
            Rendering::Coupling => {
                (1.0 / (stiffness + damping / step), 1.0 / (angular_stiffness + angular_damping / step))
            }
        }
    }

    /// Motion of the proxy without contact, from the problem's pose: m and rad.
    fn without_contact(&self, problem: &Reduced, hand: Hand, step: f64) -> (DVec3, DVec3) {
        let (k, b) = (self.coupling.stiffness, self.coupling.damping / step);
        let (ka, ba) = (self.coupling.angular_stiffness, self.coupling.angular_damping / step);
        let target = hand.position - problem.position;
        let aim = rotation_vector(hand.rotation * problem.rotation.conjugate());
        if self.rendering == Rendering::Direct {
            return (target, aim);
        }
        let moved = hand.position - self.hand.position;
        let from = self.position - problem.position;
        let turned = rotation_vector(hand.rotation * self.hand.rotation.conjugate());
        let rotation_from = rotation_vector(self.rotation * problem.rotation.conjugate());
        let translation = (target * k + (from + moved) * b) / (k + b);
        (translation, (aim * ka + (rotation_from + turned) * ba) / (ka + ba))
    }

    /// Sweeps until converged or out of time.
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

/// Why a device is not had, or not recorded as a whole.
#[derive(Clone, Debug, thiserror::Error)]
pub enum Refused {
    /// A device whose driver was left out of the build.
    #[error(
        "the tool \"{tool}\" is held by a haply device, which this build does not have; build with the feature `haply`, or attach a device \
         of your own"
    )]
    NotBuilt {
        /// What it holds.
        tool: String,
    },

    /// A recording with gaps.
    #[error(
        "the recording of the {device} device waited too long to be written, and {ticks} ticks are not in it; use fewer pictures while \
         recording, or a disk that keeps up"
    )]
    TicksLost {
        /// Its name.
        device: String,
        /// That are not in it.
        ticks: usize,
    },
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
    fn skin_that_hardly_gives_pushes_no_harder_than_the_coupling_can() {
        let pressed = |compliance: f64| {
            let mut renderer = Renderer::new(LINK, hand(0.0));
            renderer.rendering = Rendering::Direct;
            renderer.tick(&wall(compliance), hand(-1e-3), 1e-3, 0.0)
        };
        // 10⁶ N without a bound
        let (hard, soft) = (pressed(1e-9), pressed(3e-3));
        assert!(hard.bounded && (hard.force.z - FARTHEST * 1e-3 * LINK.stiffness).abs() < 1e-9, "{hard:?}");
        assert!(!soft.bounded && (soft.force.z - 1.0 / 3.0).abs() < 1e-6, "{soft:?}");
    }

    #[test]
    fn there_is_no_force_off_the_wall() {
        let mut renderer = Renderer::new(LINK, hand(0.0));
        assert_eq!(renderer.tick(&wall(0.0), hand(1e-3), 1e-3, 0.0).force, DVec3::ZERO);
    }
}
