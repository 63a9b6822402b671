//! Devices without force feedback: a recorded path, a hand at rest; and a recorder for any device.
//!
//! The output of a [`Recorder`] is a trajectory in the format of scenes, with the forces in six additional columns, which scenes ignore.
//! Units: m, s, N, N·m; files in mm, N, N·mm.

use super::Refused;
use super::device::{Device, Limits, Reading, Workspace, Wrench};
use super::guard::LOST_AFTER;
use crate::bodies::rigid::along;
use crate::error::Result;
use crate::scene::{FORCE_COLUMNS, Pose, TRAJECTORY_COLUMNS};
use glam::{DQuat, DVec3};
use rtrb::{Consumer, Producer, RingBuffer};
use std::sync::Arc;

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
