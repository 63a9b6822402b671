//! Who watches a session, what it is shown, and what it asks.

use super::mouse::Target;
use super::quantity::{Asked, Read};
use crate::report::frames::SkinSurface;
use crate::scene::{Scene, TRAJECTORY_COLUMNS};
use crate::step::{Simulation, StepReport, Warnings};
use crate::view::Clip;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::sync::mpsc::Receiver;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Most commands that wait for a session; beyond, the newest are refused with words.
pub const MOST_COMMANDS: usize = 256;

/// Recorded motion of the hands: `[tool][row]` time, s, position, mm, and quaternion.
pub type Motion = Arc<Mutex<Vec<Vec<[f64; 8]>>>>;

/// Recorded motion of a tool's hand as a table that a scene's `trajectory` reads.
pub fn trajectory(motion: &Motion, tool: usize) -> String {
    let motion = lock(motion);
    let mut table = TRAJECTORY_COLUMNS.join(",");
    for row in motion.get(tool).into_iter().flatten() {
        let numbers: Vec<String> = row.iter().map(f64::to_string).collect();
        table.push('\n');
        table.push_str(&numbers.join(","));
    }
    table + "\n"
}

/// Locks; each value is whole between any two statements that hold it.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Pages, or a window. Nothing here may wait for a picture: the session's thread calls it between two steps.
pub trait Audience {
    /// Commands in the order of their arrival, with the number of the watcher that sent them.
    fn commands(&self) -> &Receiver<(u64, Command)>;
    /// Number of watchers; when it changes, what stands still is shown again.
    fn watchers(&self) -> usize;
    /// Whether a picture made now would be looked at.
    fn is_ready(&self) -> bool;
    /// The scene has begun (anew), with these values; `held` tells the tools that watchers may hold.
    fn begin(&mut self, scene: &Scene, held: &[bool]);
    /// The present state.
    fn show(&mut self, shown: Shown);
    /// Words for a watcher, or with `None` for all: what was refused, or why the session stands still.
    fn refuse(&mut self, to: Option<u64>, words: &str);
}

/// A state as it is shown.
pub struct Shown<'a> {
    /// Surface of the deformable bodies.
    pub surface: SkinSurface,
    /// What was asked for beside it.
    pub read: Read,
    /// The simulation in that state.
    pub simulation: &'a Simulation,
    /// `[tool]` positions of the hands, m
    pub hands: &'a [[f64; 3]],
    /// The last step.
    pub report: &'a StepReport,
    /// Figures of the last steps.
    pub figures: Figures,
}

/// Figures of the last steps.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Figures {
    /// Time of the scene, s.
    pub time_s: f64,
    /// False while it stands still.
    pub playing: bool,
    /// Scene time per wall time.
    pub speed: f64,
    /// `[tool]` contact force, N
    pub force_n: Vec<f64>,
    /// Number of contact points.
    pub contacts: usize,
    /// Passes of the contact solver.
    pub passes: u32,
    /// Iterations of the linear solver.
    pub iterations: u32,
    /// Residual that it ended with.
    pub residual: f64,
    /// Computing time of a step, ms: median, and the one that nine of ten steps keep.
    pub step_ms: f64,
    /// See `step_ms`.
    pub step_ms_90: f64,
    /// Time that a step may take, ms.
    pub budget_ms: f64,
    /// Number of steps that took longer.
    pub late: u64,
    /// Links cut and springs removed.
    pub severed: usize,
    /// `[kept state]` time, s
    pub kept: Vec<f64>,
    /// Coefficient of friction; none without contact.
    pub friction: Option<f64>,
    /// Factor on the stiffness of the scene as read.
    pub stiffness: f64,
    /// Residual of a solve.
    pub tolerance: f64,
    /// Length of a step, ms.
    pub scene_step_ms: f64,
    /// What is read beside the surface.
    pub look: Asked,
    /// Number of watchers.
    #[serde(rename = "pages")]
    pub watchers: usize,
    /// Numerical trouble so far.
    pub warnings: Warnings,
}

/// Whether steps keep to the wall clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// Stands still.
    Still,
    /// Nine of ten steps take at most 80 % of their time.
    InTime,
    /// They take at most their time.
    Tight,
    /// They take longer.
    Late,
}

impl Figures {
    /// Computing time of a step per time that it may take: nine of ten are below.
    pub fn share(&self) -> f64 {
        if self.budget_ms > 0.0 { self.step_ms_90 / self.budget_ms } else { 0.0 }
    }

    /// Whether steps keep to the wall clock.
    pub fn pace(&self) -> Pace {
        match self.share() {
            _ if !self.playing => Pace::Still,
            share if share <= 0.8 => Pace::InTime,
            share if share <= 1.0 => Pace::Tight,
            _ => Pace::Late,
        }
    }
}

/// Where a watcher wants a tool's hand.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Hand {
    /// Number of the tool.
    pub tool: usize,
    /// m
    pub position: [f64; 3],
    /// rad about z
    #[serde(default)]
    pub turn: f64,
    /// The button that a blade cuts with.
    #[serde(default)]
    pub pressed: bool,
}

/// What a watcher asks of a session.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(rename_all = "snake_case")]
pub enum Command {
    /// Go on.
    Play,
    /// Stand still.
    Pause,
    /// One step, then stand still.
    Step,
    /// Begin anew, with the present settings.
    Reset,
    /// Scene time per wall time.
    Speed(f64),
    /// Move a tool's hand.
    Hand(Hand),
    /// Give a tool's hand back to its recording.
    Release(usize),
    /// Go back to a kept state, counted from the oldest.
    Seek(usize),
    /// Coefficient of friction.
    Friction(f64),
    /// Factor on Young's moduli and spring stiffnesses of the scene as read.
    Stiffness(f64),
    /// Residual of a solve.
    Tolerance(f64),
    /// Length of a step, ms; begins anew.
    StepMs(f64),
    /// Read this too for every picture, for all who watch.
    Look(Asked),
    /// A page has drawn a frame; no matter of the session.
    Drawn(u32),
}

/// Farthest that a watcher may move a hand, or put a plane from the origin, m.
const FARTHEST: f64 = 10.0;

impl Command {
    /// Reads a command.
    ///
    /// # Errors
    /// What is wrong with the text, for the one who sent it.
    pub fn read(text: &str) -> Result<Self, String> {
        serde_json::from_str::<Self>(text).map_err(|error| format!("no command: {error}"))?.checked()
    }

    /// The command, if its values can be.
    ///
    /// # Errors
    /// Which value cannot, for the one who sent it.
    pub fn checked(self) -> Result<Self, String> {
        let within = |what: &str, value: f64, [low, high]: [f64; 2]| match (low..=high).contains(&value) {
            true => Ok(self),
            false => Err(format!("{what} = {value}; wanted a number from {low} to {high}")),
        };
        match self {
            Self::Speed(v) => within("speed", v, [0.01, 10.0]),
            Self::Friction(v) => within("friction", v, [0.0, 10.0]),
            Self::Stiffness(v) => within("stiffness", v, [0.01, 100.0]),
            Self::Tolerance(v) => within("tolerance", v, [1e-9, 0.5]),
            Self::StepMs(v) => within("step_ms", v, [0.01, 1000.0]),
            Self::Hand(Hand { position, turn, .. }) => {
                position.into_iter().try_for_each(|v| within("position", v, [-FARTHEST, FARTHEST]).map(drop))?;
                within("turn", turn, [-1e3, 1e3])
            }
            Self::Look(Asked { plane: Some(Clip { normal, offset }), .. }) => {
                // its length scales the offset
                let length = DVec3::from(normal).length();
                within("length of the plane's normal", length, [1e-3, 1e3])?;
                within("offset of the plane", offset, [-FARTHEST * length, FARTHEST * length])
            }
            _ => Ok(self),
        }
    }
}

impl Hand {
    /// As a target.
    pub fn target(&self) -> Target {
        Target { position: self.position.into(), turn: self.turn, pressed: self.pressed }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::Quantity;

    #[test]
    fn commands_are_read_or_refused_with_words() {
        assert_eq!(Command::read("\"pause\""), Ok(Command::Pause));
        assert_eq!(Command::read("{\"speed\": 0.5}"), Ok(Command::Speed(0.5)));
        let hand = Hand { tool: 0, position: [0.0, 0.01, 0.02], turn: 0.0, pressed: true };
        let text = "{\"hand\": {\"tool\": 0, \"position\": [0, 0.01, 0.02], \"pressed\": true}}";
        assert_eq!(Command::read(text), Ok(Command::Hand(hand)));
        let text = "{\"look\": {\"quantity\": \"von_mises\", \"plane\": {\"normal\": [0, 1, 0], \"offset\": 0.001}}}";
        let plane = Some(Clip { normal: [0.0, 1.0, 0.0], offset: 1e-3 });
        assert_eq!(Command::read(text), Ok(Command::Look(Asked { quantity: Some(Quantity::VonMises), plane })));
        assert_eq!(Command::read("{\"look\": {}}"), Ok(Command::Look(Asked::default())));
        for wrong in [
            "",
            "{}",
            "\"fly\"",
            "{\"speed\": -1}",
            "{\"speed\": 1e999}",
            "{\"hand\": {\"tool\": 0, \"position\": [0, 1e9, 0]}}",
            "{\"hand\": {\"tool\": -1, \"position\": [0, 0, 0]}}",
            "{\"hand\": {\"tool\": 0, \"position\": [0, 0]}}",
            "{\"hand\": {\"tool\": 0, \"position\": [0, 0, 0], \"more\": 1}}",
            "{\"friction\": null}",
            "{\"look\": {\"quantity\": \"beauty\"}}",
            "{\"look\": {\"plane\": {\"normal\": [0, 0, 0], \"offset\": 0}}}",
            "{\"look\": {\"plane\": {\"normal\": [0, 1, 0], \"offset\": 11}}}",
        ] {
            let words = Command::read(wrong).expect_err(wrong);
            assert!(words.contains("no command") || words.contains("wanted a number"), "{wrong}: {words}");
        }
    }
}
