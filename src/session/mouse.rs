//! A tool's hand, moved by a mouse: the recorded one until somebody takes the tool.
//!
//! A mouse moves in jumps of some 16 ms. The hand follows its target as through a damper, and no faster than a hand is.

use crate::error::Result;
use crate::haptic::device::{Device, Limits, Reading, Wrench};
use crate::haptic::devices::Path;
use glam::{DQuat, DVec3};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Time constant with which the hand follows, s.
const LAG: f64 = 0.02;
/// Largest speed of the hand, m/s.
const FASTEST: f64 = 0.3;
/// Longest time that one reading moves the hand on, s.
const LONGEST: f64 = 0.01;

/// Button that a blade cuts with.
const CUTS: u32 = 1;

/// Where a watcher wants a hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    /// m
    pub position: DVec3,
    /// Rotation about the scene's z axis from where the tool was taken, rad.
    pub turn: f64,
    /// The button is pressed.
    pub pressed: bool,
}

/// Hand of a tool, shared by the device and the session.
#[derive(Debug, Default)]
pub struct Shared(Mutex<Option<Target>>);

impl Shared {
    fn target(&self) -> MutexGuard<'_, Option<Target>> {
        // a target is whole between any two statements that hold the lock
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Moves the hand to a target, or, with none, gives it back to the recorded one.
    pub fn set(&self, target: Option<Target>) {
        *self.target() = target;
    }
}

/// See the module.
pub struct Mouse {
    path: Path,
    shared: Arc<Shared>,
    taken: Option<DQuat>, // rotation at which it was taken
    position: DVec3,
    rotation: DQuat,
    time: f64,
    wanted: Option<Target>,
}

impl Mouse {
    /// Hand on a path that follows what `shared` says.
    pub fn new(path: Path, shared: Arc<Shared>) -> Self {
        let (position, rotation) = path.at(0.0);
        Self { path, shared, taken: None, position, rotation, time: 0.0, wanted: None }
    }
}

impl Device for Mouse {
    fn name(&self) -> &str {
        "mouse"
    }

    fn limits(&self) -> Limits {
        Limits { force: f64::INFINITY, torque: f64::INFINITY }
    }

    fn read(&mut self, time: f64) -> Reading {
        let passed = (time - std::mem::replace(&mut self.time, time)).clamp(0.0, LONGEST);
        // a tick under the wall clock does not wait for the watcher: the last target serves
        if let Ok(target) = self.shared.0.try_lock() {
            self.wanted = *target;
        }
        let Some(target) = self.wanted else {
            let reading = self.path.reading(time);
            (self.taken, self.position, self.rotation) = (None, reading.position, reading.rotation);
            return Reading { buttons: CUTS, ..reading };
        };
        let from = *self.taken.get_or_insert(self.rotation);
        let share = passed / (passed + LAG);
        let step = ((target.position - self.position) * share).clamp_length_max(FASTEST * passed);
        self.position += step;
        let wanted = DQuat::from_rotation_z(target.turn) * from;
        let before = self.rotation;
        // the same rotation by the shorter way
        let wanted = if wanted.dot(before) < 0.0 { -wanted } else { wanted };
        self.rotation = before.lerp(wanted, share).normalize();
        let per = if passed > 0.0 { 1.0 / passed } else { 0.0 };
        let turned = crate::bodies::rigid::rotation_vector(self.rotation * before.conjugate());
        Reading {
            position: self.position,
            rotation: self.rotation,
            velocity: step * per,
            angular_velocity: turned * per,
            buttons: if target.pressed { CUTS } else { 0 },
            age: 0.0,
        }
    }

    fn write(&mut self, _time: f64, _wrench: Wrench) {}

    fn state(&self) -> Vec<f64> {
        let turned = self.taken.unwrap_or(self.rotation);
        let taken = f64::from(u8::from(self.taken.is_some()));
        let parts = [&[self.time, taken][..], &self.position.to_array(), &self.rotation.to_array(), &turned.to_array()];
        parts.concat()
    }

    fn restore(&mut self, state: &[f64]) {
        let [time, taken, x, y, z, rest @ ..] = state else { return };
        let &[a, b, c, d, e, f, g, h] = rest else { return };
        (self.time, self.position) = (*time, DVec3::new(*x, *y, *z));
        self.rotation = DQuat::from_xyzw(a, b, c, d);
        self.taken = (*taken > 0.0).then_some(DQuat::from_xyzw(e, f, g, h));
        // the mouse's hand is where it was then
        self.wanted = (*taken > 0.0).then_some(Target { position: self.position, turn: 0.0, pressed: false });
        self.shared.set(self.wanted);
    }

    fn close(&mut self) -> Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::haptic::device::Workspace;
    use crate::scene::Pose;

    fn mouse() -> (Mouse, Arc<Shared>) {
        let pose = |time, x| Pose { time, position: [x, 0.0, 0.01], rotation: [0.0, 0.0, 0.0, 1.0] };
        let path = Path { poses: vec![pose(0.0, 0.0), pose(1.0, 0.1)].into(), workspace: Workspace::SAME };
        let shared = Arc::new(Shared::default());
        (Mouse::new(path, shared.clone()), shared)
    }

    fn run(mouse: &mut Mouse, from: u32, to: u32) -> Vec<Reading> {
        (from..to).map(|tick| mouse.read(f64::from(tick) * 1e-3)).collect()
    }

    #[test]
    fn a_hand_follows_its_recording_until_it_is_taken_and_then_its_target() {
        let (mut mouse, shared) = mouse();
        let recorded = run(&mut mouse, 0, 500);
        assert!((recorded[499].position.x - 0.0499).abs() < 1e-12 && recorded[499].buttons == CUTS);
        let wanted = DVec3::new(0.05, 0.02, 0.008);
        shared.set(Some(Target { position: wanted, turn: 0.5, pressed: false }));
        let taken = run(&mut mouse, 500, 900);
        // without a jump, no faster than a hand, and there at the end
        let steps = taken.windows(2).map(|pair| (pair[1].position - pair[0].position).length());
        assert!((taken[0].position - recorded[499].position).length() <= FASTEST * 1.001e-3);
        assert!(steps.fold(0.0, f64::max) <= FASTEST * 1.001e-3);
        assert!((taken[399].position - wanted).length() < 1e-5 && taken[399].buttons == 0);
        assert!(taken[399].rotation.dot(DQuat::from_rotation_z(0.5)).abs() > 1.0 - 1e-9);
        shared.set(None);
        assert!((mouse.read(0.9).position.x - 0.09).abs() < 1e-12);
    }

    #[test]
    fn a_restored_hand_goes_on_from_where_it_was() {
        let (mut mouse, shared) = mouse();
        run(&mut mouse, 0, 100);
        shared.set(Some(Target { position: DVec3::new(0.0, 0.03, 0.01), turn: 0.0, pressed: true }));
        run(&mut mouse, 100, 150);
        let (state, there) = (mouse.state(), mouse.position);
        shared.set(Some(Target { position: DVec3::X, turn: 1.0, pressed: true }));
        run(&mut mouse, 150, 400);
        mouse.restore(&state);
        let after = run(&mut mouse, 150, 300);
        assert!((after[149].position - there).length() < 1e-12, "{} {there}", after[149].position);
    }
}
