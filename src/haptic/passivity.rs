//! Energy that a device gives to the hand, as sampled, and a controller that keeps it from giving any.
//!
//! A device holds its wrench from tick to tick, so what it gave in between is exactly `F·Δx + τ·Δθ` with the motion that the next reading
//! shows, whatever the hand did in between (for a force; for a torque, of turns small enough that its axis stays). The observer sums that
//! up: `E`, J. A passive device never has `E > 0`.
//!
//! The controller looks one tick ahead: if the hand goes on as it moved last, Δx̂, and changes its motion no more than it did last, by c,
//! the wanted force brings E to `E + F·Δx̂ + |F| c` at most. What is above zero of that is taken away first by leaving out the part of the
//! force that pushes along the motion, and then, for energy that is already out, by a damper `−α v` that takes a fifth of it back in the
//! tick, `α = excess / (5 v² T)`, at most [`MOST_DAMPING`].
//!
//! Sensors with steps do not tell energy finer than a step times the force: what is within four of these is left alone, and motions are the
//! mean of some ticks.
//!
//! Source: Hannaford, Ryu 2002 (time-domain passivity observer and controller); Ryu, Preusche, Hannaford, Hirzinger 2005 (the observer's
//! prediction). Differs: what pushes is left out before anything is damped, so that the damper stays small; the prediction has a margin.
//! Units: N, N·m, m, rad, J, s.

use super::device::Wrench;
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Largest α, N·s/m: a sampled damper makes a mass m buzz above `2 m/T`, 100 N·s/m for 50 g at 1 kHz; this is a third.
pub const MOST_DAMPING: f64 = 30.0;
/// The same for turning, N·m·s/rad: for 2·10⁻⁵ kg·m², a pen held at its end, again a third.
pub const MOST_ANGULAR_DAMPING: f64 = 0.013;
/// Share of the energy that is out which a tick takes back. All of it at once is a force as large as the energy over one step of an encoder:
/// 0.05 N of clicks from half a microjoule at 10 µm.
const TAKEN_BACK: f64 = 0.2;
/// Share of the newest tick in the mean motion of a device with coarse sensors. A slow hand moves by a step of an encoder in one tick and by
/// nothing in the next ones: a controller that takes each step for the hand's speed pushes and pulls it with the encoder. On a press and a
/// withdrawal with 10 µm steps it gave 5 µJ instead of 2 without any controller, in clicks of 0.07 N.
const MEAN_OF: f64 = 1.0 / 16.0;
/// Steps of coarse sensors times the largest force: energy that they cannot tell from none, and that is not acted upon.
const UNSURE: f64 = 4.0;
/// A motion per tick below this (m², rad²) has no direction to damp along: a nanometre.
const STILL: f64 = 1e-18;

/// Observer and controller of a device.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Passivity {
    /// Energy given to the hand, less what it gave, J.
    pub energy: f64,
    /// Largest value of it, J.
    pub energy_most: f64,
    /// The same along the same motions if the wanted wrenches had been given, J.
    pub wanted: f64,
    /// Largest value of that, J.
    pub wanted_most: f64,
    given: Wrench,
    asked: Wrench,
    /// Motion of a tick, of a device with coarse sensors the mean of the last ones.
    moved: DVec3,
    turned: DVec3,
    /// Largest force that was wanted, N, and the step of the sensors, m.
    largest: f64,
    resolution: f64,
    /// How the motion has changed from one tick to the next: m, rad.
    changed: [f64; 2],
}

impl Passivity {
    /// Takes in how the hand has moved since the last tick, m and rad, by sensors of this step, m.
    pub fn observe(&mut self, moved: DVec3, turned: DVec3, resolution: f64) {
        let work = |w: Wrench| w.force.dot(moved) + w.torque.dot(turned);
        self.energy += work(self.given);
        self.wanted += work(self.asked);
        self.energy_most = self.energy_most.max(self.energy);
        self.wanted_most = self.wanted_most.max(self.wanted);
        self.resolution = resolution;
        let share = if resolution > 0.0 { MEAN_OF } else { 1.0 };
        let moved = self.moved.lerp(moved, share);
        let turned = self.turned.lerp(turned, share);
        self.changed = [(moved - self.moved).length(), (turned - self.turned).length()];
        (self.moved, self.turned) = (moved, turned);
    }

    /// The wrench instead of the wanted one, for a tick of `step` seconds; without torque where `turns` is false.
    pub fn control(&self, wanted: Wrench, step: f64, turns: bool) -> Wrench {
        let mut out = wanted;
        let push = wanted.force.dot(self.moved).max(0.0);
        let twist = wanted.torque.dot(self.turned).max(0.0);
        let margin = wanted.force.length() * self.changed[0] + wanted.torque.length() * self.changed[1];
        let ahead = self.energy + wanted.force.dot(self.moved) + wanted.torque.dot(self.turned) + margin;
        let ahead = ahead - UNSURE * self.largest * self.resolution;
        if ahead <= 0.0 {
            return out;
        }
        // what gives energy along the motion is left out, as much of it as is needed
        let mut excess = ahead;
        let share = if push + twist > 0.0 { (excess / (push + twist)).min(1.0) } else { 0.0 };
        excess -= share * (push + twist);
        let (squared, turned_squared) = (self.moved.length_squared(), self.turned.length_squared());
        if push > 0.0 {
            out.force -= self.moved * (share * push / squared);
        }
        if twist > 0.0 {
            out.torque -= self.turned * (share * twist / turned_squared);
        }
        // what is out already is taken back, by and by
        excess *= TAKEN_BACK;
        if excess > 0.0 && squared > STILL {
            let alpha = (excess * step / squared).min(MOST_DAMPING);
            out.force -= self.moved * (alpha / step);
            excess -= alpha * squared / step;
        }
        if turns && excess > 0.0 && turned_squared > STILL {
            let alpha = (excess * step / turned_squared).min(MOST_ANGULAR_DAMPING);
            out.torque -= self.turned * (alpha / step);
        }
        out
    }

    /// Notes what is given from now on, and what was wanted.
    pub fn hold(&mut self, given: Wrench, asked: Wrench) {
        (self.given, self.asked) = (given, asked);
        self.largest = self.largest.max(asked.force.length());
    }
}
