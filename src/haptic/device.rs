//! A haptic device: pose and buttons in, force and torque out.
//!
//! A device speaks its own frame; [`Workspace`] places that frame in the scene. What a device can give is in its [`Limits`]. The loop calls
//! [`read`](Device::read) and [`write`](Device::write) once a tick, and neither may wait, lock or allocate: a device behind a network has
//! a thread of its own for that, and cells with the latest value in between.
//! Units: m, m/s, rad/s, N, N·m, s.

use crate::error::Result;
use crate::scene;
use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

/// What a device says.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
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
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Wrench {
    /// N
    pub force: DVec3,
    /// N·m
    pub torque: DVec3,
}

/// What a device can give.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Limits {
    /// N
    pub force: f64,
    /// N·m; 0 for a device without torque.
    pub torque: f64,
}

impl Limits {
    /// A wrench within the limits, its directions kept, and whether one was met; a device without torque gets none.
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
    /// For the report: what it is, and which one.
    fn name(&self) -> &str;

    /// What it can give.
    fn limits(&self) -> Limits;

    /// Step of its position sensors, m; 0 for exact ones.
    fn resolution(&self) -> f64 {
        0.0
    }

    /// What it says at `time`, s since the loop began.
    fn read(&mut self, time: f64) -> Reading;

    /// The force and torque on the hand from now on.
    fn write(&mut self, time: f64, wrench: Wrench);

    /// What went wrong on the way to it so far: messages that were of no use, connections lost; 0 for a device that nothing lies between.
    fn faults(&self) -> u64 {
        0
    }

    /// What [`read`](Device::read) depends on beside the time: to go on from later, by the scene's clock. None of a device that is no program.
    fn state(&self) -> Vec<f64> {
        vec![]
    }

    /// Goes to a state of this kind of device.
    fn restore(&mut self, _state: &[f64]) {}

    /// Lets go: no force, connection closed.
    ///
    /// # Errors
    /// When something that had to be kept (a recording) is not.
    fn close(&mut self) -> Result<()>;
}

/// Where a device's frame lies in the scene, `x = position + rotation · scale · x_device`, and where the tool sits in its hand.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Workspace {
    /// m
    pub position: DVec3,
    /// Unit quaternion.
    pub rotation: DQuat,
    /// Metres of the scene per metre of the device.
    pub scale: f64,
    /// Where the tool's origin is in the end effector's frame, m of the scene.
    pub tool: DVec3,
    /// How the tool is turned there, unit quaternion.
    pub tool_rotation: DQuat,
    /// How far from its origin the device can be, m of its own.
    pub reach: f64,
}

/// A device that crosses its workspace faster than this does not move but fail, s: a tick at 1 kHz.
const CROSSING: f64 = 1e-3;

impl Workspace {
    /// The device's frame is the scene's, and its end effector is the tool.
    pub const SAME: Self = Self {
        position: DVec3::ZERO,
        rotation: DQuat::IDENTITY,
        scale: 1.0,
        tool: DVec3::ZERO,
        tool_rotation: DQuat::IDENTITY,
        reach: f64::INFINITY,
    };

    /// As a device of a scene is placed, and its tool in it.
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

    /// Whether a reading is sound and of this workspace: where the device can be, and no faster than across it in a tick.
    pub fn holds(&self, reading: &Reading) -> bool {
        let near = self.has_place(reading.position) && reading.velocity.length() * CROSSING <= self.reach;
        near && reading.is_sound()
    }

    /// Whether a device can be there, m in its own frame; NaN is nowhere.
    pub fn has_place(&self, position: DVec3) -> bool {
        position.is_finite() && position.length() <= self.reach
    }

    /// From the end effector to the tool's origin, in the scene, m; `effector` is its rotation as the device says it.
    fn lever(&self, effector: DQuat) -> DVec3 {
        self.rotation * effector * self.tool
    }

    /// The tool in the scene where the device says this of its end effector.
    pub fn to_scene(&self, reading: Reading) -> Reading {
        let (lever, spin) = (self.lever(reading.rotation), self.rotation * reading.spin);
        Reading {
            position: self.position + self.rotation * (reading.position * self.scale) + lever,
            rotation: self.rotation * reading.rotation * self.tool_rotation,
            velocity: self.rotation * (reading.velocity * self.scale) + spin.cross(lever),
            spin,
            ..reading
        }
    }

    /// The end effector in the device's frame where the tool has this pose in the scene.
    pub fn from_scene(&self, position: DVec3, rotation: DQuat) -> (DVec3, DQuat) {
        let back = self.rotation.conjugate();
        let effector = back * rotation * self.tool_rotation.conjugate();
        (back * (position - self.lever(effector) - self.position) / self.scale, effector)
    }

    /// A force and torque on the end effector as one at the tool's origin, in the scene's frame; forces are not scaled here.
    pub fn wrench_to_scene(&self, wrench: Wrench, effector: DQuat) -> Wrench {
        let force = self.rotation * wrench.force;
        Wrench { force, torque: self.rotation * wrench.torque - self.lever(effector).cross(force) }
    }

    /// A force and torque at the tool's origin as one on the end effector, in the device's frame; forces are not scaled here.
    pub fn to_device(&self, wrench: Wrench, effector: DQuat) -> Wrench {
        let back = self.rotation.conjugate();
        let torque = wrench.torque + self.lever(effector).cross(wrench.force);
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
        let power = |velocity: DVec3, spin: DVec3| {
            let reading = Reading { rotation: turned, velocity, spin, ..Reading::at_rest(0.0) };
            let there = workspace().to_scene(reading);
            let moved = wrench.force.dot(there.velocity) + wrench.torque.dot(there.spin);
            (moved, 2.0 * given.force.dot(velocity), given.torque.dot(spin))
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
        assert!(Reading::at_rest(0.0).is_sound());
        let spoilt = Reading { rotation: DQuat::from_xyzw(0.0, 0.0, 0.0, 0.5), ..Reading::at_rest(0.0) };
        assert!(!spoilt.is_sound());
        assert!(!Reading { velocity: DVec3::NAN, ..Reading::at_rest(0.0) }.is_sound());
    }
}
