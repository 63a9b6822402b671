//! What keeps the hand safe: conditions for the force, and a bound on the energy that it gives.
//!
//! [`Guard`] has the conditions: ramp at the start, fade-out while the simulation is late or the clutch is used, safe stop. The force is
//! multiplied by `ramp · fade · clutch`, each between 0 and 1 and linear in time, so these events cause no jump. A stop takes the ramp to 0
//! and is latched: the force ramps up again only after the device has been valid for a while.
//!
//! [`Passivity`] observes the energy that a sampled device gives to the hand, and its controller prevents it. A device holds its wrench
//! from tick to tick, so the work in between is exactly `F·Δx + τ·Δθ` with the motion that the next reading shows, whatever path the hand
//! took (for a torque, if rotations are small enough to keep their axis). The observer sums it: `E`, J. A passive device never has `E > 0`.
//!
//! The controller predicts one tick: if the hand repeats its last motion Δx̂ and changes it by no more than the last change c, the
//! requested force brings E to at most `E + F·Δx̂ + |F| c`. Of what exceeds zero, it first removes the part of the force that pushes along
//! the motion. Energy already given is recovered by a damper `−α v`, a fifth of it per tick, `α = excess / (5 v² T)`, at most
//! [`MOST_DAMPING`].
//!
//! Sensors of finite resolution cannot resolve energies below one increment times the force: a band of four of these is ignored, and
//! motions are averaged over several ticks.
//!
//! Source: Hannaford, Ryu 2002 (time-domain passivity observer and controller); Ryu, Preusche, Hannaford, Hirzinger 2005 (the observer's
//! prediction). Differs: force along the motion is removed before damping is added, so the damper stays small; the prediction has a margin.
//! Units: N, N·m, m, rad, J, s.

use super::device::Wrench;
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Time of the ramp, s: long enough for a hand to give way to a tool that starts inside a body.
pub const RAMP_TIME: f64 = 0.2;
/// Time of a fade-out or fade-in when the simulation is late, s: no jolt, and short compared with a hand's reaction time of 0.15 s.
pub const FADE_TIME: f64 = 0.1;
/// Time from full force to none at a stop, s: fast, but several ticks, so that 10 N do not become a click.
pub const STOP_TIME: f64 = 0.005;
/// A device without a reading for this time is lost, s: fifty ticks; networks recover from a lost packet sooner.
pub const LOST_AFTER: f64 = 0.05;
/// Time that a device must be valid before a stop ends, s: an intermittent device stays without force.
pub const VALID_FOR: f64 = 0.1;
/// Number of simulation steps after which the last problem is too old: one is normal, two occur with an occasional slow step.
pub const LATE_STEPS: f64 = 4.0;

/// Conditions of a tick.
#[derive(Clone, Copy, Debug, Default)]
pub struct Signs {
    /// The device is lost, or its pose is invalid.
    pub lost: bool,
    /// The problem is too old.
    pub late: bool,
    /// The clutch is used.
    pub clutched: bool,
}

/// State of the three factors.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Guard {
    ramp: f64,
    faded: f64,
    lifted: f64,
    stopped: bool,
    valid_time: f64,
    late: bool,
    /// Number of fade-outs.
    pub fades: u64,
    /// Number of stops while a force was applied.
    pub stops: u64,
}

impl Guard {
    /// True while a stop is latched: the tool keeps its position.
    pub fn stopped(&self) -> bool {
        self.stopped
    }

    /// Updates the factors for a tick of `step` seconds; returns their product.
    pub fn update(&mut self, signs: Signs, step: f64) -> f64 {
        self.valid_time = if signs.lost { 0.0 } else { self.valid_time + step };
        if signs.lost && !self.stopped {
            self.stopped = true;
            self.stops += u64::from(self.ramp > 0.0);
        } else if self.stopped && self.valid_time >= VALID_FOR && self.ramp == 0.0 {
            self.stopped = false;
        }
        self.fades += u64::from(signs.late && !self.late);
        self.late = signs.late;
        let towards = |value: f64, up: bool, [rise, fall]: [f64; 2]| match up {
            true => (value + step / rise).min(1.0),
            false => (value - step / fall).max(0.0),
        };
        self.ramp = towards(self.ramp, !self.stopped, [RAMP_TIME, STOP_TIME]);
        self.faded = towards(self.faded, signs.late, [FADE_TIME; 2]);
        self.lifted = towards(self.lifted, signs.clutched, [FADE_TIME; 2]);
        self.ramp * (1.0 - self.faded) * (1.0 - self.lifted)
    }
}

/// Largest α, N·s/m: a sampled damper makes a mass m oscillate above `2 m/T`, 100 N·s/m for 50 g at 1 kHz; this is a third.
pub const MOST_DAMPING: f64 = 30.0;
/// The same for rotation, N·m·s/rad: for 2·10⁻⁵ kg·m², a pen held at its end, again a third.
pub const MOST_ANGULAR_DAMPING: f64 = 0.013;
/// Fraction of the given energy that a tick recovers. All of it at once is a force as large as the energy over one encoder increment:
/// clicks of 0.05 N from half a microjoule at 10 µm.
const TAKEN_BACK: f64 = 0.2;
/// Weight of the newest tick in the mean motion of a device with finite resolution. A slow hand moves by one encoder increment in one tick
/// and by zero in the next ones: a controller that takes each increment for the hand's speed pushes and pulls with the encoder. On a press
/// and a withdrawal with 10 µm increments it gave 5 µJ instead of 2 without any controller, in clicks of 0.07 N.
const MEAN_OF: f64 = 1.0 / 16.0;
/// Sensor increments times the largest force: energy below the resolution, which is ignored.
const UNSURE: f64 = 4.0;
/// A squared motion per tick below this (m², rad²) has no direction to damp along: a nanometre.
const STILL: f64 = 1e-18;

/// Passivity observer and controller of a device.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Passivity {
    /// Energy given to the hand minus energy received, J.
    pub energy: f64,
    /// Maximum of `energy`, J.
    pub energy_most: f64,
    /// The same for the same motion with the requested wrenches, J.
    pub wanted: f64,
    /// Maximum of `wanted`, J.
    pub wanted_most: f64,
    given: Wrench,
    asked: Wrench,
    /// Motion of a tick; the mean of the last ticks for a device with finite resolution.
    moved: DVec3,
    turned: DVec3,
    /// Largest requested force, N, and the sensors' resolution, m.
    largest: f64,
    resolution: f64,
    /// Change of the motion from one tick to the next: m, rad.
    changed: [f64; 2],
}

impl Passivity {
    /// Takes the motion of the hand since the last tick, m and rad, measured with this resolution, m.
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

    /// Passive wrench closest to the requested one for a tick of `step` seconds; adds no torque if `turns` is false.
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
        // remove as much as needed of the wrench along the motion
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
        // recover energy already given, over several ticks
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

    /// Records the wrench applied from now on, and the requested one.
    pub fn hold(&mut self, given: Wrench, asked: Wrench) {
        (self.given, self.asked) = (given, asked);
        self.largest = self.largest.max(asked.force.length());
    }
}
