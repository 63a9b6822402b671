//! A simulated hand on a device: a mass with a damper and a spring to a path, driven by the force that the servo writes.
//!
//! `m v' = F + k (target − x) − b v`, `x' = v`, with F held between writes, in substeps of at most 10 µs that are implicit in the damper.
//! With constant F the position is second-order accurate, so only the sampling of the force can make it unstable, as with a real hand. The
//! rotation follows the path. Positions are rounded to the encoder's resolution. Source: Colgate, Brown 1994 (model of a device at a
//! sampled wall). Units: m, kg, N, N/m, N·s/m, s.

use super::device::{Device, Limits, Reading, Wrench};
use super::replay::Path;
use crate::error::Result;
use glam::DVec3;

/// Longest substep, s: a hundredth of a tick at 1 kHz, so that the integration error is 1 % of the effect of sampling.
const STEP: f64 = 1e-5;
/// Maximum time that one read catches up with, s: a stalled loop must not stall further.
const MOST: f64 = 0.1;

/// Simulated hand and its state.
#[derive(Clone, Debug)]
pub struct SimulatedHand {
    /// kg
    pub mass: f64,
    /// Stiffness of the spring to the path, N/m.
    pub stiffness: f64,
    /// N·s/m
    pub damping: f64,
    /// Resolution, m; 0 for exact positions.
    pub encoder: f64,
    /// Target path.
    pub path: Path,
    /// m
    pub position: DVec3,
    /// m/s
    pub velocity: DVec3,
    /// Work of the force on the hand, J.
    pub work: f64,
    force: DVec3,
    time: Option<f64>,
}

impl SimulatedHand {
    /// At rest at the start of its path.
    pub fn new(path: Path, [mass, stiffness, damping, encoder]: [f64; 4]) -> Self {
        Self {
            mass,
            stiffness,
            damping,
            encoder,
            position: path.at(f64::NEG_INFINITY).0,
            velocity: DVec3::ZERO,
            work: 0.0,
            force: DVec3::ZERO,
            time: None,
            path,
        }
    }

    fn advance(&mut self, from: f64, to: f64) {
        let count = ((to - from) / STEP - 1e-6).ceil().max(1.0);
        let h = (to - from) / count;
        let divisor = 1.0 + h * self.damping / self.mass;
        for k in 0..count as u32 {
            let target = self.path.at(from + f64::from(k) * h).0;
            let push = self.force + (target - self.position) * self.stiffness;
            let next = (self.velocity + push * (h / self.mass)) / divisor;
            let moved = (self.velocity + next) * (0.5 * h);
            self.position += moved;
            self.work += self.force.dot(moved);
            self.velocity = next;
        }
    }
}

impl Device for SimulatedHand {
    fn name(&self) -> &str {
        "hand"
    }

    fn resolution(&self) -> f64 {
        self.encoder
    }

    fn limits(&self) -> Limits {
        Limits { force: f64::INFINITY, torque: 0.0 }
    }

    fn read(&mut self, time: f64) -> Reading {
        let from = self.time.unwrap_or(time).max(time - MOST);
        if time > from {
            self.advance(from, time);
        }
        self.time = Some(time);
        let quantised = |x: f64| if self.encoder > 0.0 { (x / self.encoder).round() * self.encoder } else { x };
        let position = DVec3::from_array(self.position.to_array().map(quantised));
        Reading { position, velocity: self.velocity, ..self.path.reading(time) }
    }

    fn write(&mut self, _time: f64, wrench: Wrench) {
        self.force = wrench.force;
    }

    fn state(&self) -> Vec<f64> {
        let vectors = [self.position, self.velocity, self.force].map(|v| v.to_array());
        vectors.as_flattened().iter().copied().chain([self.work]).chain(self.time).collect()
    }

    fn restore(&mut self, state: &[f64]) {
        let vector = |at: usize| state.get(at..at + 3).map_or(DVec3::ZERO, DVec3::from_slice);
        (self.position, self.velocity, self.force) = (vector(0), vector(3), vector(6));
        (self.work, self.time) = (state.get(9).copied().unwrap_or_default(), state.get(10).copied());
    }

    fn close(&mut self) -> Result<()> {
        Ok(())
    }
}
