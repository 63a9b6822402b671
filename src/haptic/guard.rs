//! When the force may be felt: ramp-in at the start, fade-out while the simulation is late or the hand is being moved elsewhere, safe stop.
//!
//! The force on the hand is multiplied by `ramp · fade · clutch`, each between 0 and 1 and linear in time, so it never jumps for these
//! reasons. A stop takes the ramp to 0 and is latched: the device has to be sound for a while before it ramps in again.
//! Units: s.

use serde::{Deserialize, Serialize};

/// From no force to all of it, s: long enough for a hand to give way to a tool that starts inside of something.
pub const RAMP_TIME: f64 = 0.2;
/// From all of the force to none when the simulation is late, and back, s: no jolt, and short beside a hand's reaction of 0.15 s.
pub const FADE_TIME: f64 = 0.1;
/// From all of the force to none at a stop, s: fast, but a few ticks long, so that 10 N do not become a click.
pub const STOP_TIME: f64 = 0.005;
/// A device that was not heard of for this long is lost, s: fifty ticks; networks with a lost packet come back sooner.
pub const LOST_AFTER: f64 = 0.05;
/// How long a device has to be sound before a stop ends, s: one that comes and goes stays without force.
pub const SOUND_FOR: f64 = 0.1;
/// Steps of the simulation after which its last problem is too old to feel: one is the rule, two come with a slow step now and then.
pub const LATE_STEPS: f64 = 4.0;

/// What a tick sees.
#[derive(Clone, Copy, Debug, Default)]
pub struct Signs {
    /// The device is lost, or its pose is no number.
    pub lost: bool,
    /// The problem is too old.
    pub late: bool,
    /// The hand is moved elsewhere.
    pub clutched: bool,
}

/// The state of the three factors.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Guard {
    ramp: f64,
    faded: f64,
    lifted: f64,
    stopped: bool,
    sound: f64,
    late: bool,
    /// Times that a fade-out began.
    pub fades: u64,
    /// Times that a force that was there stopped.
    pub stops: u64,
}

impl Guard {
    /// Whether a stop is latched: the tool stays where it was.
    pub fn stopped(&self) -> bool {
        self.stopped
    }

    /// Takes in what a tick of `step` seconds sees; returns the share of the force that may be felt.
    pub fn update(&mut self, signs: Signs, step: f64) -> f64 {
        self.sound = if signs.lost { 0.0 } else { self.sound + step };
        if signs.lost && !self.stopped {
            self.stopped = true;
            self.stops += u64::from(self.ramp > 0.0);
        } else if self.stopped && self.sound >= SOUND_FOR && self.ramp == 0.0 {
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
