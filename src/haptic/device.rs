//! A haptic device: pose and buttons in, force and torque out.
//!
//! A device speaks its own frame; [`Workspace`] places that frame in the scene. What a device can give is in its [`Limits`]. The loop calls
//! [`read`](Device::read) and [`write`](Device::write) once a tick, and neither may wait, lock or allocate: a device behind a network has
//! a thread of its own for that, and cells with the latest value in between.
//! Units: m, m/s, rad/s, N, N·m, s.

use crate::error::Result;
use crate::scene;
use glam::{DQuat, DVec3};

/// What a device says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Of the end effector, m.
    pub position: DVec3,
    /// Unit quaternion.
    pub rotation: DQuat,
    /// m/s
    pub velocity: DVec3,
    /// rad/s; zero where the device does not know it.
    pub spin: DVec3,
    /// Bit k is set while button k is down.
    pub buttons: u32,
    /// How long ago the device said this, s; infinite before its first word.
    pub age: f64,
}

impl Reading {
    /// At rest at the origin, said `age` ago.
    pub fn at_rest(age: f64) -> Self {
        Self {
            position: DVec3::ZERO,
            rotation: DQuat::IDENTITY,
            velocity: DVec3::ZERO,
            spin: DVec3::ZERO,
            buttons: 0,
            age,
        }
    }

    /// All numbers are numbers, and the rotation is one.
    pub fn is_sound(&self) -> bool {
        let finite = self.position.is_finite() && self.velocity.is_finite() && self.spin.is_finite();
        finite && (self.rotation.length_squared() - 1.0).abs() < 1e-3
    }
}

/// A force and a torque.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wrench {
    /// N
    pub force: DVec3,
    /// N·m
    pub torque: DVec3,
}

/// What a device can give.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// N
    pub force: f64,
    /// N·m; 0 for a device without torque.
    pub torque: f64,
}

/// A haptic device.
pub trait Device: Send {
    /// For the report: what it is, and which one.
    fn name(&self) -> &str;

    /// What it can give.
    fn limits(&self) -> Limits;

    /// What it says at `time`, s since the loop began.
    fn read(&mut self, time: f64) -> Reading;

    /// The force and torque on the hand from now on.
    fn write(&mut self, time: f64, wrench: Wrench);

    /// Lets go: no force, connection closed.
    ///
    /// # Errors
    /// When something that had to be kept (a recording) is not.
    fn close(&mut self) -> Result<()>;
}

/// Where a device's frame lies in the scene: `x = position + rotation · scale · x_device`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Workspace {
    /// m
    pub position: DVec3,
    /// Unit quaternion.
    pub rotation: DQuat,
    /// Metres of the scene per metre of the device.
    pub scale: f64,
}

impl Workspace {
    /// The device's frame is the scene's.
    pub const SAME: Self = Self { position: DVec3::ZERO, rotation: DQuat::IDENTITY, scale: 1.0 };

    /// As a device of a scene is placed.
    pub fn new(device: &scene::Device) -> Self {
        Self {
            position: DVec3::from_array(device.position),
            rotation: DQuat::from_array(device.rotation),
            scale: device.scale,
        }
    }

    /// What the device says, in the scene.
    pub fn to_scene(&self, reading: Reading) -> Reading {
        Reading {
            position: self.position + self.rotation * (reading.position * self.scale),
            rotation: self.rotation * reading.rotation,
            velocity: self.rotation * (reading.velocity * self.scale),
            spin: self.rotation * reading.spin,
            ..reading
        }
    }

    /// A pose of the scene, in the device's frame.
    pub fn from_scene(&self, position: DVec3, rotation: DQuat) -> (DVec3, DQuat) {
        let back = self.rotation.conjugate();
        (back * (position - self.position) / self.scale, back * rotation)
    }

    /// A force and torque of the device's frame in the scene's; forces are not scaled here.
    pub fn wrench_to_scene(&self, wrench: Wrench) -> Wrench {
        Wrench { force: self.rotation * wrench.force, torque: self.rotation * wrench.torque }
    }

    /// What the scene gives, in the device's frame; forces are not scaled here.
    pub fn to_device(&self, wrench: Wrench) -> Wrench {
        let back = self.rotation.conjugate();
        Wrench { force: back * wrench.force, torque: back * wrench.torque }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn power_is_the_same_in_both_frames_but_for_the_scale() {
        let workspace = Workspace { position: DVec3::X, rotation: DQuat::from_rotation_z(0.7), scale: 2.0 };
        let reading = Reading { velocity: DVec3::new(0.1, 0.2, 0.3), spin: DVec3::Y, ..Reading::at_rest(0.0) };
        let wrench = Wrench { force: DVec3::new(1.0, -2.0, 0.5), torque: DVec3::new(0.1, 0.3, 0.0) };
        let (there, given) = (workspace.to_scene(reading), workspace.to_device(wrench));
        assert!((wrench.force.dot(there.velocity) - 2.0 * given.force.dot(reading.velocity)).abs() < 1e-12);
        assert!((wrench.torque.dot(there.spin) - given.torque.dot(reading.spin)).abs() < 1e-12);
        assert!((there.position - DVec3::X).length() < 1e-12);
    }

    #[test]
    fn a_reading_with_a_number_that_is_none_is_not_sound() {
        assert!(Reading::at_rest(0.0).is_sound());
        let spoilt = Reading { rotation: DQuat::from_xyzw(0.0, 0.0, 0.0, 0.5), ..Reading::at_rest(0.0) };
        assert!(!spoilt.is_sound());
        assert!(!Reading { velocity: DVec3::NAN, ..Reading::at_rest(0.0) }.is_sound());
    }
}
