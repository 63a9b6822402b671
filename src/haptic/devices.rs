//! The devices that a scene names: opens them, and has those that need no hardware, a recorded path, a hand at rest and a simulated hand.
//! A recorder for any device.
//!
//! The output of a [`Recorder`] is a trajectory in the format of scenes, with the forces in six additional columns, which scenes ignore.
//! Units: m, s, N, N·m, kg, N/m, N·s/m; files in mm, N, N·mm.
//!
//! A [`SimulatedHand`] is a mass with a damper and a spring to a path, driven by the force that the servo writes.
//! `m v' = F + k (target − x) − b v`, `x' = v`, with F held between writes, in substeps of at most 10 µs that are implicit in the damper.
//! With constant F the position is second-order accurate, so only the sampling of the force can make it unstable, as with a real hand. The
//! rotation follows the path. Positions are rounded to the encoder's resolution. Source: Colgate, Brown 1994 (model of a device at a
//! sampled wall).

use super::Refused;
use super::device::{Device, Limits, Reading, Workspace, Wrench};
use super::guard::LOST_AFTER;
#[cfg(feature = "haply")]
use super::haply;
use crate::bodies::rigid::along;
use crate::error::Result;
use crate::scene::{self, DeviceKind, FORCE_COLUMNS, Pose, TRAJECTORY_COLUMNS, Tool};
use glam::{DQuat, DVec3};
use rtrb::{Consumer, Producer, RingBuffer};
use std::sync::Arc;

/// Opens a device for a tool.
///
/// # Errors
/// If the device is not available.
pub fn open(device: &scene::Device, tool: &Tool) -> Result<Box<dyn Device>> {
    let path = Path { poses: tool.trajectory.as_slice().into(), workspace: Workspace::new(device) };
    Ok(match &device.kind {
        DeviceKind::Replay => Box::new(Replay(path)),
        DeviceKind::Null => Box::new(Null(path)),
        DeviceKind::Hand { mass, stiffness, damping, encoder } => {
            Box::new(SimulatedHand::new(path, [*mass, *stiffness, *damping, *encoder]))
        }
        #[cfg(not(feature = "haply"))]
        DeviceKind::Haply { .. } => {
            return Err(super::Refused::NotBuilt { tool: tool.name.clone() }.into());
        }
        #[cfg(feature = "haply")]
        DeviceKind::Haply { url, device: arm, grip } => {
            let named = |name: &String| (!name.is_empty()).then(|| name.clone());
            let mut settings = haply::Settings { url: url.clone(), ..haply::Settings::default() };
            (settings.device, settings.grip) = (named(arm), named(grip));
            if device.max_force.is_finite() {
                settings.limits.force = device.max_force;
            }
            Box::new(haply::open(&settings)?)
        }
    })
}

/// Interval of the finite difference for a path's velocity, s: a tick at 1 kHz.
const BETWEEN: f64 = 1e-3;

/// A tool's path in the frame of its device.
#[derive(Clone, Debug)]
pub struct Path {
    /// Poses in the scene, at least one.
    pub poses: Arc<[Pose]>,
    /// Placement of the device's frame.
    pub workspace: Workspace,
}

impl Path {
    /// The pose at a time.
    pub fn at(&self, time: f64) -> (DVec3, DQuat) {
        let (position, rotation) = along(&self.poses, time).unwrap_or((DVec3::ZERO, DQuat::IDENTITY));
        self.workspace.from_scene(position, rotation)
    }

    /// Reading of a device on the path at a time.
    pub fn reading(&self, time: f64) -> Reading {
        let ((position, rotation), (before, turned)) = (self.at(time), self.at(time - BETWEEN));
        Reading {
            position,
            rotation,
            velocity: (position - before) / BETWEEN,
            angular_velocity: crate::bodies::rigid::rotation_vector(rotation * turned.conjugate()) / BETWEEN,
            ..Reading::at_rest(0.0)
        }
    }
}

/// A recorded hand, which ignores forces.
#[derive(Clone, Debug)]
pub struct Replay(pub Path);

impl Device for Replay {
    fn name(&self) -> &str {
        "replay"
    }

    fn limits(&self) -> Limits {
        Limits { force: f64::INFINITY, torque: f64::INFINITY }
    }

    fn read(&mut self, time: f64) -> Reading {
        self.0.reading(time)
    }

    fn write(&mut self, _time: f64, _wrench: Wrench) {}

    fn close(&mut self) -> Result<()> {
        Ok(())
    }
}

/// A hand at rest at the start of a path.
#[derive(Clone, Debug)]
pub struct Null(pub Path);

impl Device for Null {
    fn name(&self) -> &str {
        "null"
    }

    fn limits(&self) -> Limits {
        Limits { force: f64::INFINITY, torque: f64::INFINITY }
    }

    fn read(&mut self, _time: f64) -> Reading {
        let (position, rotation) = self.0.at(f64::NEG_INFINITY);
        Reading { position, rotation, ..Reading::at_rest(0.0) }
    }

    fn write(&mut self, _time: f64, _wrench: Wrench) {}

    fn close(&mut self) -> Result<()> {
        Ok(())
    }
}

/// One tick of a recording, in the columns of a trajectory and its forces: s, mm, quaternion, N, N·mm.
pub type Row = [f64; TRAJECTORY_COLUMNS.len() + FORCE_COLUMNS.len()];

/// Passes readings (as the device moved, without clutch or freeze) and forces of a device to the writer of a recording. A tick allocates
/// nothing and does not wait; rows that find the ring full are counted as lost.
pub struct Recorder {
    inner: Box<dyn Device>,
    workspace: Workspace,
    rows: Producer<Row>,
    open: Option<(f64, Reading, Option<Wrench>)>, // the last reading, until the next one
    last: f64,
    lost: usize,
}

impl Recorder {
    /// Wraps a device with the given placement; `ticks` rows fit into the ring.
    pub fn new(inner: Box<dyn Device>, workspace: Workspace, ticks: usize) -> (Self, Consumer<Row>) {
        let (rows, written) = RingBuffer::new(ticks);
        (Self { inner, workspace, rows, open: None, last: f64::NEG_INFINITY, lost: 0 }, written)
    }

    /// Passes the last reading on. Times ascend in a trajectory; a second reading at the same time is skipped.
    fn pass_on(&mut self) {
        let Some((time, reading, wrench)) = self.open.take() else { return };
        if !self.workspace.accepts(&reading) || reading.age > LOST_AFTER || time <= self.last {
            return;
        }
        self.last = time;
        let there = self.workspace.to_scene(reading);
        let felt = self.workspace.wrench_to_scene(wrench.unwrap_or_default(), reading.rotation);
        let mut row = [0.0; TRAJECTORY_COLUMNS.len() + FORCE_COLUMNS.len()];
        row[0] = time;
        row[1..4].copy_from_slice(&(there.position * 1e3).to_array());
        row[4..8].copy_from_slice(&there.rotation.to_array());
        row[8..11].copy_from_slice(&felt.force.to_array());
        row[11..].copy_from_slice(&(felt.torque * 1e3).to_array());
        self.lost += usize::from(self.rows.push(row).is_err());
    }
}

impl Device for Recorder {
    fn name(&self) -> &str {
        self.inner.name()
    }

    fn limits(&self) -> Limits {
        self.inner.limits()
    }

    fn read(&mut self, time: f64) -> Reading {
        let reading = self.inner.read(time);
        self.pass_on();
        self.open = Some((time, reading, None));
        reading
    }

    fn write(&mut self, time: f64, wrench: Wrench) {
        if let Some((_, _, given)) = &mut self.open {
            given.get_or_insert(wrench);
        }
        self.inner.write(time, wrench);
    }

    fn resolution(&self) -> f64 {
        self.inner.resolution()
    }

    fn faults(&self) -> u64 {
        self.inner.faults()
    }

    fn close(&mut self) -> Result<()> {
        let closed = self.inner.close();
        self.pass_on();
        closed?;
        match self.lost {
            0 => Ok(()),
            ticks => Err(Refused::TicksLost { device: self.name().into(), ticks }.into()),
        }
    }
}

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
