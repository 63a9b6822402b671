//! What the tests put on the bench: walls, settings, readings.

use cutis::constraints::Law;
use cutis::haptic::device::{Limits, Reading, Workspace};
use cutis::haptic::servo::{Buttons, Problem, Servo, Settings};
use cutis::haptic::{Hand, MAX_SWEEPS, Reduced};
use cutis::scene::{Coupling, Pose, Rendering};
use glam::{DQuat, DVec3};

/// Ticks at 1 kHz, s.
pub const TICK: f64 = 1e-3;

/// A coupling without damping.
pub fn spring(stiffness: f64) -> Coupling {
    Coupling { stiffness, damping: 0.0, angular_stiffness: 1.0, angular_damping: 0.0 }
}

/// A servo's settings with nothing but rendering: no limits, no guards, no controller.
pub fn plain(coupling: Coupling) -> Settings {
    Settings {
        tick: TICK,
        step: 5e-3,
        coupling,
        rendering: Rendering::Coupling,
        force_scale: 1.0,
        limits: Limits { force: f64::INFINITY, torque: f64::INFINITY },
        workspace: Workspace::SAME,
        buttons: Buttons::default(),
        passivity: false,
        resolution: 0.0,
        guarded: false,
        budget: None,
        max_sweeps: MAX_SWEEPS,
        rows: 30,
    }
}

/// A hand, unturned.
pub fn at(position: DVec3) -> Hand {
    Hand { position, rotation: DQuat::IDENTITY }
}

/// A servo at the origin.
pub fn servo(settings: Settings) -> Servo {
    Servo::new(settings, at(DVec3::ZERO))
}

/// A reading at a position, at rest.
pub fn reading(position: DVec3) -> Reading {
    Reading { position, ..Reading::at_rest(0.0) }
}

/// Frictionless contacts along z at the arms, each with this compliance, made by a tool at the origin that just touches.
pub fn wall(arms: &[DVec3], compliance: f64) -> Reduced {
    wall_of(Law::contact(0.0), arms, compliance)
}

/// The same contacts with another law.
pub fn wall_of(law: Law, arms: &[DVec3], compliance: f64) -> Reduced {
    let (each, rows) = (law.rows(), law.rows() * arms.len());
    Reduced {
        axes: (0..rows).map(|row| [DVec3::Z, DVec3::X, DVec3::Y][row % each]).collect(),
        arms: (0..rows).map(|row| arms[row / each]).collect(),
        laws: vec![law; arms.len()],
        compliance: (0..rows * rows).map(|k| if k % (rows + 1) == 0 { compliance } else { 0.0 }).collect(),
        violation: vec![0.0; rows],
        force: vec![0.0; rows],
        ..Reduced::default()
    }
}

/// A problem that is always fresh.
pub fn problem(reduced: Reduced) -> Problem {
    Problem { reduced, time: f64::INFINITY, ..Problem::default() }
}

/// A path that rests.
pub fn resting(position: DVec3) -> Vec<Pose> {
    vec![Pose { time: 0.0, position: position.to_array(), rotation: [0.0, 0.0, 0.0, 1.0] }]
}

/// Prints a measured line when asked to.
pub fn measured(line: &str) {
    if std::env::var_os("CUTIS_MEASURED").is_some() {
        eprintln!("{line}");
    }
}
