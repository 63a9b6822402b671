//! Simulated hand of the stand-in: a mass on a damped spring to a path, driven by the force that the client sends.
//!
//! `m v' = f + k (target − x) − d v`, semi-implicit Euler with a step far below its period (0.14 s); at rest `x = target + f/k`. Time
//! counts frames, not seconds: each frame of the client advances the hand by one tick with the frame's force held. The output of a stand-in
//! therefore depends on the frames only.
//! Units: x m, v m/s, f N, m kg, d N·s/m, k N/m.

use crate::bodies::rigid::along;
use crate::scene::Pose;
use glam::{DQuat, DVec3};

/// Time per frame of the client, s.
pub(super) const TICK: f64 = 1e-3;
/// Substeps of a tick.
const INNER: u32 = 10;
/// Mass of a hand that holds a stylus, of the order of a finger and the device's own, kg.
const MASS: f64 = 0.1;
/// Stiffness, N/m; of the order of a relaxed grip.
pub(super) const STIFFNESS: f64 = 200.0;
/// Damping, N·s/m; 0.9 of critical.
const DAMPING: f64 = 8.0;
/// Resolution of the encoders, m.
pub(super) const QUANTUM: f64 = 1e-5;

/// Rest position of an Inverse3's cursor without a path: in front of the device, above the table, m.
const REST: DVec3 = DVec3::new(0.0, -0.12, 0.15);

/// Simulated hand.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hand {
    pub position: DVec3,
    pub velocity: DVec3,
    pub rotation: DQuat,
    ticks: u64,
}

/// Target pose of the path at a time.
fn target(path: &[Pose], time: f64) -> (DVec3, DQuat) {
    along(path, time).unwrap_or((REST, DQuat::IDENTITY))
}

impl Hand {
    /// At rest at the start of the path.
    pub fn at_start(path: &[Pose]) -> Self {
        let (position, rotation) = target(path, 0.0);
        Self { position, velocity: DVec3::ZERO, rotation, ticks: 0 }
    }

    /// Time of the hand, s.
    pub fn time(&self) -> f64 {
        self.ticks as f64 * TICK
    }

    /// Advances by one tick with a constant force.
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

    /// Position rounded to the encoders' resolution, m.
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
