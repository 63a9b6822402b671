//! Conditions for the force on the hand: ramp at the start, fade-out while the simulation is late or the clutch is used, safe stop.
//!
//! The force is multiplied by `ramp · fade · clutch`, each between 0 and 1 and linear in time, so these events cause no jump. A stop takes
//! the ramp to 0 and is latched: the force ramps up again only after the device has been valid for a while.
//! Units: s.

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
