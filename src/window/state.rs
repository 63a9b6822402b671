//! What the window shows and what is wanted of it: between the panel, which changes it, and the picture, which is drawn from it.

use super::link::{Begun, Shot};
use super::plots::Plots;
use crate::error::Result;
use crate::report::frames::SkinSurface;
use crate::session::{Asked, Command, Hand, Quantity};
use crate::view::Clip;
use glam::DVec3;
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::mpsc::SyncSender;
use std::time::{Duration, Instant};

/// Most words at once, and how long they stay.
const MOST_WORDS: usize = 4;
pub const WORDS: Duration = Duration::from_secs(8);
/// A tool in the mouse's hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Held {
    /// Its number.
    pub tool: usize,
    /// m
    pub position: DVec3,
    /// rad about z
    pub turn: f64,
    /// The button that a blade cuts with.
    pub pressed: bool,
}

/// What of the picture is wanted.
#[derive(Clone, Debug, PartialEq)]
pub struct Shows {
    /// What the colours are of: layers, or a quantity that the session reads while it is asked for.
    pub colors: Option<Quantity>,
    /// Lines between cells.
    pub cells: bool,
    /// Arrows of contact forces.
    pub forces: bool,
    /// Way of the tip.
    pub way: bool,
    /// Bodies with their layers that are left out.
    pub hidden: BTreeSet<[u32; 2]>,
    /// Axis that the clipping plane is across, and where it is, as a share of the bodies' extent; 0 cuts nothing.
    pub clip: (usize, f64),
}

impl Default for Shows {
    fn default() -> Self {
        Self { colors: None, cells: true, forces: true, way: true, hidden: BTreeSet::new(), clip: (1, 0.0) }
    }
}

impl Shows {
    /// What the session is to read for it.
    pub fn asked(&self, skin: &SkinSurface) -> Asked {
        Asked { quantity: self.colors, plane: self.plane(skin) }
    }

    /// The clipping plane through a surface.
    pub fn plane(&self, skin: &SkinSurface) -> Option<Clip> {
        let (axis, share) = self.clip;
        let rest = skin.positions.iter().zip(&skin.displacements).map(|(x, u)| x[axis] - u[axis]);
        let [low, high] = rest.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)]);
        let mut normal = [0.0; 3];
        normal[axis] = 1.0;
        (share > 0.0 && low < high).then_some(Clip { normal, offset: low + share * (high - low) })
    }
}

/// What the panel shows and changes.
pub struct State {
    /// The scene and its tools.
    pub begun: Option<Begun>,
    /// The newest state.
    pub shot: Option<Box<Shot>>,
    /// Curves.
    pub plots: Plots,
    /// What of the picture is wanted.
    pub shows: Shows,
    /// The tool in hand.
    pub held: Option<Held>,
    /// Words, and when they came.
    pub words: Vec<(Instant, String)>,
    /// What the session was asked to read.
    pub asked: Asked,
    /// A picture is to be saved.
    pub saves: bool,
    /// The motion of the hand is to be saved.
    pub saves_motion: bool,
    /// A film is recorded.
    pub films: bool,
    sender: SyncSender<(u64, Command)>,
}

impl State {
    /// Nothing yet.
    pub fn new(sender: SyncSender<(u64, Command)>) -> Self {
        Self {
            begun: None,
            shot: None,
            plots: Plots::default(),
            shows: Shows::default(),
            held: None,
            words: vec![],
            asked: Asked::default(),
            saves: false,
            saves_motion: false,
            films: false,
            sender,
        }
    }

    /// Sends a command; what cannot be is said.
    pub fn send(&mut self, command: Command) {
        let sent = command.checked().and_then(|command| {
            self.sender.try_send((0, command)).map_err(|_| "the simulation takes no more commands at the moment".into())
        });
        if let Err(words) = sent {
            self.say(words);
        }
    }

    /// Plays, or pauses.
    pub fn toggle(&mut self) {
        let playing = self.shot.as_ref().is_some_and(|shot| shot.figures.playing);
        self.send(if playing { Command::Pause } else { Command::Play });
    }

    /// Forgets the words that have been there for long.
    pub fn forget(&mut self) {
        self.words.retain(|(said, _)| said.elapsed() < WORDS);
    }

    /// Shows words for a while.
    pub fn say(&mut self, words: String) {
        if self.words.len() == MOST_WORDS {
            self.words.remove(0);
        }
        self.words.push((Instant::now(), words));
    }

    /// Says where something was saved, or why not.
    pub fn say_saved(&mut self, saved: Result<PathBuf>) {
        self.say(match saved {
            Ok(path) => format!("saved {}", path.display()),
            Err(error) => error.to_string(),
        });
    }

    /// Takes a tool, or with the one in hand or none lets go.
    pub fn take(&mut self, tool: Option<usize>) {
        let before = self.held.take().map(|held| held.tool);
        if let Some(before) = before {
            self.send(Command::Release(before));
        }
        let hand = |tool: &usize| self.shot.as_ref().and_then(|shot| shot.hands.get(*tool)).copied();
        if let Some((tool, position)) = tool.filter(|tool| before != Some(*tool)).and_then(|t| Some((t, hand(&t)?))) {
            self.hold(Held { tool, position: position.into(), turn: 0.0, pressed: false });
        }
    }

    /// Holds a tool otherwise, or another one.
    pub fn hold(&mut self, held: Held) {
        if self.held != Some(held) {
            self.held = Some(held);
            let Held { tool, position, turn, pressed } = held;
            self.send(Command::Hand(Hand { tool, position: position.to_array(), turn, pressed }));
        }
    }
}
