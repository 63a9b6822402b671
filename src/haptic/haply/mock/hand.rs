//! The hand behind a stand-in: a mass on a damped spring to a path, pushed by the force that the client sends.
//!
//! `m v' = f + k (target − x) − d v`, semi-implicit Euler with a step far below its period (0.14 s); at rest `x = target + f/k`.
//! Time is frames, not seconds: each frame of the client moves the hand on by one tick, with the frame's force held over it. So what a
//! stand-in says depends on the frames alone.
//! Units: x m, v m/s, f N, m kg, d N·s/m, k N/m.

use crate::bodies::rigid::along;
use crate::scene::Pose;
use glam::{DQuat, DVec3};

/// Time per frame of the client, s.
pub(super) const TICK: f64 = 1e-3;
/// Inner steps of a tick.
const INNER: u32 = 10;
/// Of a hand that holds a stylus, of the order of a finger and the device's own, kg.
const MASS: f64 = 0.1;
/// N/m; of the order of a relaxed grip.
pub(super) const STIFFNESS: f64 = 200.0;
/// N·s/m; 0.9 of critical.
const DAMPING: f64 = 8.0;
/// Step of the encoders, m.
pub(super) const QUANTUM: f64 = 1e-5;

/// Where an Inverse3's cursor rests without a path: before the device, above the table, m.
const REST: DVec3 = DVec3::new(0.0, -0.12, 0.15);

/// A hand.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hand {
    pub position: DVec3,
    pub velocity: DVec3,
    pub rotation: DQuat,
    ticks: u64,
}

/// The path at a time.
fn target(path: &[Pose], time: f64) -> (DVec3, DQuat) {
    along(path, time).unwrap_or((REST, DQuat::IDENTITY))
}

impl Hand {
    /// At rest at the path's start.
    pub fn at_start(path: &[Pose]) -> Self {
        let (position, rotation) = target(path, 0.0);
        Self { position, velocity: DVec3::ZERO, rotation, ticks: 0 }
    }

    /// Seconds of its own.
    pub fn time(&self) -> f64 {
        self.ticks as f64 * TICK
    }

    /// One tick with a force held.
    pub fn advance(&mut self, path: &[Pose], force: DVec3) {
        let (from, h) = (self.time(), TICK / f64::from(INNER));
        for k in 1..=INNER {
            let (aim, rotation) = target(path, from + f64::from(k) * h);
            let push = force + (aim - self.position) * STIFFNESS - self.velocity * DAMPING;
            self.velocity += push * (h / MASS);
            self.position += self.velocity * h;
            self.rotation = rotation;
        }
        self.ticks += 1;
    }

    /// What the encoders say of the position, m.
    pub fn encoded(&self) -> DVec3 {
        (self.position / QUANTUM).round() * QUANTUM
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_held_force_moves_the_hand_by_its_spring() {
        let mut hand = Hand::at_start(&[]);
        for _ in 0..2000 {
            hand.advance(&[], DVec3::new(0.0, 0.0, 1.0));
        }
        assert!((hand.position - REST - DVec3::Z / STIFFNESS).length() < 1e-9, "{hand:?}");
        assert!((hand.encoded() - hand.position).abs().max_element() <= QUANTUM / 2.0);
    }

    #[test]
    fn the_hand_follows_its_path_and_rests_at_its_end() {
        let pose = |time, x| Pose { time, position: [x, 0.0, 0.0], rotation: [0.0, 0.0, 0.0, 1.0] };
        let path = [pose(0.0, 0.0), pose(1.0, 0.1)];
        let mut hand = Hand::at_start(&path);
        for _ in 0..800 {
            hand.advance(&path, DVec3::ZERO);
        }
        // a moving target is followed at a distance of d v / k
        assert!((hand.position.x - (0.08 - DAMPING * 0.1 / STIFFNESS)).abs() < 1e-4, "{hand:?}");
        for _ in 0..2000 {
            hand.advance(&path, DVec3::ZERO);
        }
        assert!((hand.position.x - 0.1).abs() < 1e-9, "{hand:?}");
    }
}
