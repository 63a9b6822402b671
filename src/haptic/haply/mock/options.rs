//! What a stand-in has, how it misbehaves, and what it has seen.

use super::super::wire::{ArmKind, GripKind};
use super::PORT;
use crate::scene::Pose;
use glam::DVec3;
use std::net::SocketAddr;
use std::time::Duration;

/// Something that happened at a stand-in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// A client came, from this address.
    Connected(SocketAddr),
    /// It left, after this many frames.
    Left(SocketAddr, u64),
}

/// What a stand-in has, and how it misbehaves.
#[derive(Clone, Debug)]
pub struct Options {
    /// 0 for any that is free.
    pub port: u16,
    /// As `/version` says it; before 3.5 a force is heard as `values` alone.
    pub version: String,
    /// Arms by kind and name.
    pub arms: Vec<(ArmKind, String)>,
    /// Grips by kind and name; all are in the first arm's hand, or at rest without an arm.
    pub grips: Vec<(GripKind, String)>,
    /// What the hands follow, m; they rest without one.
    pub path: Vec<Pose>,
    /// From a time of the hand on, s, which buttons are down; times rise.
    pub buttons: Vec<(f64, u32)>,
    /// None by default.
    pub faults: Faults,
    /// Told of each event.
    pub tell: Option<fn(Event)>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            port: PORT,
            version: "3.5.0".into(),
            arms: vec![(ArmKind::Inverse3, "MOCK".into())],
            grips: vec![(GripKind::Wired, "GRIP".into())],
            path: Vec::new(),
            buttons: Vec::new(),
            faults: Faults::default(),
            tell: None,
        }
    }
}

/// Ways to misbehave; 0 and `false` for none of it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Faults {
    /// Connections end without a goodbye after this many frames.
    pub drop_after: u64,
    /// Each n-th frame is cut in half.
    pub malformed_every: u64,
    /// Each n-th frame has `null` for a position, as JSON has no NaN.
    pub null_every: u64,
    /// Each n-th frame has no devices.
    pub empty_every: u64,
    /// Arms say that they are not calibrated.
    pub uncalibrated: bool,
    /// Before each answer.
    pub delay: Duration,
    /// Each 10th frame comes after this many old ones.
    pub burst: u32,
    /// Forces are passed over.
    pub deaf: bool,
    /// There is no inventory.
    pub silent: bool,
}

/// What a stand-in has seen.
#[derive(Clone, Debug, Default)]
pub struct Record {
    /// Connections that became WebSockets.
    pub connections: u64,
    /// Those that ended.
    pub ended: u64,
    /// Frames of clients.
    pub frames: u64,
    /// `[arm]` force now, N.
    pub forces: Vec<DVec3>,
    /// `[arm]` force of each connection's first frame, N.
    pub first_forces: Vec<Vec<DVec3>>,
    /// `[arm]` force of each ended connection's last frame, N.
    pub last_forces: Vec<Vec<DVec3>>,
    /// Times that a force was let go because no frame came.
    pub idled: u64,
    /// Largest force so far, N.
    pub peak: f64,
    /// What the last client called itself.
    pub profile: Option<String>,
    /// The version it asked for.
    pub required_version: Option<String>,
    /// The word that forces came in last.
    pub wording: Option<&'static str>,
}
