//! What the window shows and what is wanted of it: between the panel, which changes it, and the picture, which is drawn from it.

use super::link::{Begun, Shot};
use super::plots::Plots;
use crate::report::frames::SkinSurface;
use crate::session::{Asked, Command, Hand, Quantity};
use crate::view::Clip;
use glam::DVec3;
use std::collections::BTreeSet;
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

/// What the colours are of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Colors {
    /// Layers.
    #[default]
    Layers,
    /// Length of the displacement.
    Displacement,
    /// Length of the velocity.
    Velocity,
    /// A quantity over cells, which the session reads while it is asked for.
    Of(Quantity),
}

impl Colors {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::Layers,
        Self::Displacement,
        Self::Velocity,
        Self::Of(Quantity::VonMises),
        Self::Of(Quantity::Pressure),
        Self::Of(Quantity::Alive),
        Self::Of(Quantity::Stiffness),
    ];

    /// In words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Layers => "layers",
            Self::Displacement => "displacement",
            Self::Velocity => "velocity",
            Self::Of(quantity) => quantity.name(),
        }
    }

    /// Values; none of the layers, or of a quantity that the session has not read yet.
    pub fn values(self, shot: &Shot) -> Option<Colored> {
        let skin = &shot.skin;
        let lengths = |vectors: &[[f64; 3]]| vectors.iter().map(|v| DVec3::from(*v).length()).collect();
        let of_nodes = |nodes: Vec<f64>, unit, factor| {
            let slice = OnSlice::Vertices(shot.read.slice.as_ref().map_or(vec![], |slice| slice.of_nodes(&nodes)));
            Some(Colored { nodes, slice, unit, factor })
        };
        match self {
            Self::Layers => None,
            Self::Displacement => of_nodes(lengths(&skin.displacements), "mm", 1e3),
            Self::Velocity => of_nodes(lengths(&skin.velocities), "mm/s", 1e3),
            Self::Of(wanted) => {
                let values = shot.read.values.as_ref().filter(|values| values.of == wanted)?;
                let (unit, factor) = wanted.unit();
                let slice = OnSlice::Triangles(values.slice.clone());
                Some(Colored { nodes: values.nodes.clone(), slice, unit, factor })
            }
        }
    }
}

/// Values that the picture is coloured by.
pub struct Colored {
    /// `[node]`
    pub nodes: Vec<f64>,
    /// Of what a plane lays open.
    pub slice: OnSlice,
    /// Unit in the picture.
    pub unit: &'static str,
    /// Its factor.
    pub factor: f64,
}

/// Values on a slice.
pub enum OnSlice {
    /// `[vertex]`
    Vertices(Vec<f64>),
    /// `[triangle]`
    Triangles(Vec<f64>),
}

impl OnSlice {
    /// All of them.
    pub fn values(&self) -> &[f64] {
        match self {
            Self::Vertices(values) | Self::Triangles(values) => values,
        }
    }
}

/// What of the picture is wanted.
#[derive(Clone, Debug, PartialEq)]
pub struct Shows {
    /// Colours.
    pub colors: Colors,
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
        Self { colors: Colors::Layers, cells: true, forces: true, way: true, hidden: BTreeSet::new(), clip: (1, 0.0) }
    }
}

impl Shows {
    /// What the session is to read for it.
    pub fn asked(&self, skin: &SkinSurface) -> Asked {
        let quantity = if let Colors::Of(quantity) = self.colors { Some(quantity) } else { None };
        Asked { quantity, plane: self.plane(skin) }
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
