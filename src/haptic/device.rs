//! Haptic devices: pose and buttons in, force and torque out.
//!
//! A device uses its own frame; [`Workspace`] places it in the scene. [`Limits`] are the forces that the device can exert. The loop calls
//! [`read`](Device::read) and [`write`](Device::write) once per tick. Neither may wait, lock or allocate: a device behind a network needs a
//! thread of its own, with buffers for the latest values in between.
//! Units: m, m/s, rad/s, N, N·m, s.

use crate::error::Result;
use crate::scene;
use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

/// Reading of a device.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Reading {
    /// Position of the end effector, m.
    pub position: DVec3,
    /// Unit quaternion.
    pub rotation: DQuat,
    /// m/s
    pub velocity: DVec3,
    /// Angular velocity, rad/s; zero if the device does not measure it.
    pub angular_velocity: DVec3,
    /// Bit k is set while button k is pressed.
    pub buttons: u32,
    /// Age of the reading, s; infinite before the first one.
    pub age: f64,
}

impl Reading {
    /// At rest at the origin, with the given age, s.
    pub fn at_rest(age: f64) -> Self {
        Self {
            position: DVec3::ZERO,
            rotation: DQuat::IDENTITY,
            velocity: DVec3::ZERO,
            angular_velocity: DVec3::ZERO,
            buttons: 0,
            age,
        }
    }

    /// True if all numbers are finite and the quaternion is a rotation.
    pub fn is_valid(&self) -> bool {
        let finite = self.position.is_finite() && self.velocity.is_finite() && self.angular_velocity.is_finite();
        finite && (self.rotation.length_squared() - 1.0).abs() < 1e-3
    }
}

/// A force and a torque.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Wrench {
    /// N
    pub force: DVec3,
    /// N·m
    pub torque: DVec3,
}

/// Largest force and torque of a device.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Limits {
    /// N
    pub force: f64,
    /// N·m; 0 for a device without torque.
    pub torque: f64,
}

impl Limits {
    /// Limits a wrench, keeping its directions, and returns whether a limit was exceeded; without torque for a device that has none.
    pub fn apply(&self, wrench: Wrench) -> (Wrench, bool) {
        let (force, torque) = (wrench.force.length(), wrench.torque.length());
        let mut out = wrench;
        if force > self.force {
            out.force *= self.force / force;
        }
        if self.torque == 0.0 {
            out.torque = DVec3::ZERO;
        } else if torque > self.torque {
            out.torque *= self.torque / torque;
        }
        (out, force > self.force || (self.torque > 0.0 && torque > self.torque))
    }
}

/// A haptic device.
pub trait Device: Send {
    /// Name for the report: kind and identity of the device.
    fn name(&self) -> &str;

    /// Largest force and torque.
    fn limits(&self) -> Limits;

    /// Resolution of the position sensors, m; 0 for exact ones.
    fn resolution(&self) -> f64 {
        0.0
    }

    /// Reading at `time`, s since the loop began.
    fn read(&mut self, time: f64) -> Reading;

    /// Sets the force and torque on the hand from now on.
    fn write(&mut self, time: f64, wrench: Wrench);

    /// Number of faults so far: unusable messages, lost connections; 0 for a directly connected device.
    fn faults(&self) -> u64 {
        0
    }

    /// State that [`read`](Device::read) depends on besides the time, for a restart by the scene's clock. Empty for real devices.
    fn state(&self) -> Vec<f64> {
        vec![]
    }

    /// Restores a state of this kind of device.
    fn restore(&mut self, _state: &[f64]) {}

    /// Releases the device: no force, connection closed.
    ///
    /// # Errors
    /// If data that had to be kept (a recording) is incomplete.
    fn close(&mut self) -> Result<()>;
}

/// Placement of a device's frame in the scene, `x = position + rotation · scale · x_device`, and of the tool in the end effector's frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Workspace {
    /// m
    pub position: DVec3,
    /// Unit quaternion.
    pub rotation: DQuat,
    /// Metres of the scene per metre of the device.
    pub scale: f64,
    /// Origin of the tool in the end effector's frame, m of the scene.
    pub tool: DVec3,
    /// Rotation of the tool in that frame, unit quaternion.
    pub tool_rotation: DQuat,
    /// Largest distance of the end effector from the device's origin, m of the device.
    pub reach: f64,
}

/// Time for crossing the workspace below which a motion is a sensor failure, s: a tick at 1 kHz.
const CROSSING: f64 = 1e-3;

impl Workspace {
    /// The device's frame is the scene's, and the end effector is the tool.
    pub const SAME: Self = Self {
        position: DVec3::ZERO,
        rotation: DQuat::IDENTITY,
        scale: 1.0,
        tool: DVec3::ZERO,
        tool_rotation: DQuat::IDENTITY,
        reach: f64::INFINITY,
    };

    /// Placement of a scene's device and of its tool.
    pub fn new(device: &scene::Device) -> Self {
        Self {
            position: DVec3::from_array(device.position),
            rotation: DQuat::from_array(device.rotation),
            scale: device.scale,
            tool: DVec3::from_array(device.tool),
            tool_rotation: DQuat::from_array(device.tool_rotation),
            reach: device.workspace,
        }
    }

    /// True if a reading is valid for this workspace: within reach, and not faster than once across it in a tick.
    pub fn accepts(&self, reading: &Reading) -> bool {
        let near = self.within_reach(reading.position) && reading.velocity.length() * CROSSING <= self.reach;
        near && reading.is_valid()
    }

    /// True if a position is within reach, m in the device's frame; false for NaN.
    pub fn within_reach(&self, position: DVec3) -> bool {
        position.is_finite() && position.length() <= self.reach
    }

    /// Vector from the end effector to the tool's origin, in the scene, m; `effector` is the rotation of the end effector in the device's
    /// frame.
    fn tool_offset(&self, effector: DQuat) -> DVec3 {
        self.rotation * effector * self.tool
    }

    /// Converts a reading of the end effector to the tool in the scene.
    pub fn to_scene(&self, reading: Reading) -> Reading {
        let (offset, angular_velocity) = (self.tool_offset(reading.rotation), self.rotation * reading.angular_velocity);
        Reading {
            position: self.position + self.rotation * (reading.position * self.scale) + offset,
            rotation: self.rotation * reading.rotation * self.tool_rotation,
            velocity: self.rotation * (reading.velocity * self.scale) + angular_velocity.cross(offset),
            angular_velocity,
            ..reading
        }
    }

    /// Converts the tool's pose in the scene to the end effector's in the device's frame.
    pub fn from_scene(&self, position: DVec3, rotation: DQuat) -> (DVec3, DQuat) {
        let back = self.rotation.conjugate();
        let effector = back * rotation * self.tool_rotation.conjugate();
        (back * (position - self.tool_offset(effector) - self.position) / self.scale, effector)
    }

    /// Converts a wrench on the end effector to the tool's origin, in the scene's frame; forces are not scaled.
    pub fn wrench_to_scene(&self, wrench: Wrench, effector: DQuat) -> Wrench {
        let force = self.rotation * wrench.force;
        Wrench { force, torque: self.rotation * wrench.torque - self.tool_offset(effector).cross(force) }
    }

    /// Converts a wrench at the tool's origin to the end effector, in the device's frame; forces are not scaled.
    pub fn to_device(&self, wrench: Wrench, effector: DQuat) -> Wrench {
        let back = self.rotation.conjugate();
        let torque = wrench.torque + self.tool_offset(effector).cross(wrench.force);
        Wrench { force: back * wrench.force, torque: back * torque }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn workspace() -> Workspace {
        Workspace {
            position: DVec3::X,
            rotation: DQuat::from_rotation_z(0.7),
            scale: 2.0,
            tool: DVec3::new(0.01, -0.02, 0.1),
            tool_rotation: DQuat::from_rotation_x(-0.4),
            reach: 10.0,
        }
    }

    #[test]
    fn power_is_the_same_in_both_frames_but_for_the_scale() {
        let turned = DQuat::from_rotation_y(0.9);
        let wrench = Wrench { force: DVec3::new(1.0, -2.0, 0.5), torque: DVec3::new(0.1, 0.3, 0.0) };
        let given = workspace().to_device(wrench, turned);
        let power = |velocity: DVec3, angular_velocity: DVec3| {
            let reading = Reading { rotation: turned, velocity, angular_velocity, ..Reading::at_rest(0.0) };
            let there = workspace().to_scene(reading);
            let moved = wrench.force.dot(there.velocity) + wrench.torque.dot(there.angular_velocity);
            (moved, 2.0 * given.force.dot(velocity), given.torque.dot(angular_velocity))
        };
        let (straight, wanted, _) = power(DVec3::new(0.1, 0.2, 0.3), DVec3::ZERO);
        assert!((straight - wanted).abs() < 1e-12, "{straight} {wanted}");
        let (turning, _, wanted) = power(DVec3::ZERO, DVec3::new(0.5, -1.0, 2.0));
        assert!((turning - wanted).abs() < 1e-12, "{turning} {wanted}");
        let back = workspace().wrench_to_scene(given, turned);
        assert!((back.force - wrench.force).length() + (back.torque - wrench.torque).length() < 1e-12);
    }

    #[test]
    fn the_tool_sits_in_the_hand_as_it_is_told() {
        let there = workspace().to_scene(Reading::at_rest(0.0));
        let held = DVec3::X + DQuat::from_rotation_z(0.7) * DVec3::new(0.01, -0.02, 0.1);
        assert!((there.position - held).length() < 1e-12);
        let (position, rotation) = workspace().from_scene(DVec3::new(0.3, 0.1, -0.2), DQuat::from_rotation_y(0.3));
        let back = workspace().to_scene(Reading { position, rotation, ..Reading::at_rest(0.0) });
        assert!((back.position - DVec3::new(0.3, 0.1, -0.2)).length() < 1e-12);
        assert!(back.rotation.dot(DQuat::from_rotation_y(0.3)).abs() > 1.0 - 1e-12);
    }

    #[test]
    fn a_reading_with_a_number_that_is_none_is_not_sound() {
        assert!(Reading::at_rest(0.0).is_valid());
        let invalid = Reading { rotation: DQuat::from_xyzw(0.0, 0.0, 0.0, 0.5), ..Reading::at_rest(0.0) };
        assert!(!invalid.is_valid());
        assert!(!Reading { velocity: DVec3::NAN, ..Reading::at_rest(0.0) }.is_valid());
    }
}
