//! Who watches a session, and what it is shown.

use super::command::Command;
use super::quantity::{Asked, Read};
use crate::report::frames::SkinSurface;
use crate::scene::{Scene, TRAJECTORY_COLUMNS};
use crate::step::{Simulation, StepReport, Warnings};
use serde::Serialize;
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
