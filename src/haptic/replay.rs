//! Devices that feel nothing: a recorded path, a hand at rest; and a recorder around any device.
//!
//! What a [`Recorder`] writes is a trajectory as scenes read them, with the forces in six more columns, which scenes pass over.
//! Units: m, s, N, N·m; files in mm, N, N·mm.

use super::device::{Device, Limits, Reading, Workspace, Wrench};
use super::guard::LOST_AFTER;
use crate::error::{Error, Result};
use crate::instrument::along;
use crate::scene::{FORCE_COLUMNS, Pose, TRAJECTORY_COLUMNS};
use glam::{DQuat, DVec3};
use std::fmt::Write as _;
use std::path::PathBuf;
use std::sync::Arc;

/// Over which a path's velocity is taken, s: a tick at 1 kHz.
const BETWEEN: f64 = 1e-3;

/// A tool's path in the frame of its device.
#[derive(Clone, Debug)]
pub struct Path {
    /// At least one, in the scene.
    pub poses: Arc<[Pose]>,
    /// Where the device's frame lies.
    pub workspace: Workspace,
}

impl Path {
    /// The pose at a time.
    pub fn at(&self, time: f64) -> (DVec3, DQuat) {
        let (position, rotation) = along(&self.poses, time).unwrap_or((DVec3::ZERO, DQuat::IDENTITY));
        self.workspace.from_scene(position, rotation)
    }

    /// What a device on the path says at a time.
    pub fn reading(&self, time: f64) -> Reading {
        let ((position, rotation), (before, turned)) = (self.at(time), self.at(time - BETWEEN));
        Reading {
            position,
            rotation,
            velocity: (position - before) / BETWEEN,
            spin: crate::instrument::rotation_vector(rotation * turned.conjugate()) / BETWEEN,
            ..Reading::at_rest(0.0)
        }
    }
}

/// A recorded hand: goes its way whatever the force.
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

/// A hand that rests where a path starts.
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

/// Keeps what a device says (as it moved, not as clutch or freeze moved its tool) and is given, and writes it when it is closed. Its memory is taken at the start: a tick allocates nothing.
pub struct Recorder {
    inner: Box<dyn Device>,
    workspace: Workspace,
    path: PathBuf,
    rows: Vec<(f64, Reading, Option<Wrench>)>,
    lost: usize,
}

impl Recorder {
    /// Around a device whose frame lies there, for so many ticks; writes to `path`.
    pub fn new(inner: Box<dyn Device>, workspace: Workspace, path: PathBuf, ticks: usize) -> Self {
        Self { inner, workspace, path, rows: Vec::with_capacity(ticks), lost: 0 }
    }

    fn text(&self) -> String {
        let header: Vec<&str> = TRAJECTORY_COLUMNS.iter().chain(&FORCE_COLUMNS).copied().collect();
        let mut text = header.join(",") + "\n";
        let mut last = f64::NEG_INFINITY;
        for (time, reading, wrench) in self.rows.iter().filter(|row| row.1.is_sound() && row.1.age <= LOST_AFTER) {
            if *time <= last {
                continue; // times rise in a trajectory; a device that is read twice at once says the same
            }
            last = *time;
            let there = self.workspace.to_scene(*reading);
            let felt = self.workspace.wrench_to_scene(wrench.unwrap_or_default(), reading.rotation);
            let groups = [there.position.to_array().map(|x| x * 1e3), felt.force.to_array()];
            let [place, force] = groups.map(|g| format!("{},{},{}", g[0], g[1], g[2]));
            let [qx, qy, qz, qw] = there.rotation.to_array();
            let [tx, ty, tz] = felt.torque.to_array().map(|t| t * 1e3);
            writeln!(text, "{time},{place},{qx},{qy},{qz},{qw},{force},{tx},{ty},{tz}")
                .expect("a String takes any text");
        }
        text
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
        match self.rows.len() < self.rows.capacity() {
            true => self.rows.push((time, reading, None)),
            false => self.lost += 1,
        }
        reading
    }

    fn write(&mut self, time: f64, wrench: Wrench) {
        if let Some(row) = self.rows.last_mut().filter(|row| self.lost == 0 && row.2.is_none()) {
            row.2 = Some(wrench);
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
        let written = std::fs::write(&self.path, self.text());
        written.map_err(|source| Error::Write { path: self.path.clone(), source })?;
        closed?;
        match self.lost {
            0 => Ok(()),
            lost => Err(Error::Usage {
                what: format!("{}: the recording was full, and {lost} ticks are not in it", self.path.display()),
                fix: "record for a shorter time".into(),
            }),
        }
    }
}
